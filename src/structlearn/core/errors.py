"""The errors that mean "the input is at fault, not the program"."""

LONGEST = 600  # characters of a message; libraries that quote what they could not read know no end


def printable(text: str) -> str:
    """Text in one line, in which whatever is not printable is escaped.

    What a file says, e.g. the name of a topic, may neither steer a terminal nor begin a line of its own.
    """
    return "".join(
        sign if sign.isprintable() else sign.encode("unicode_escape").decode("ascii") for sign in text
    )


class InputError(ValueError):
    """Bad input from the user: a file, a parameter or a recording.

    The message is one line that names the file, topic, row or key. Stages print it without a traceback and
    exit with code 1 (`structlearn.core.stage.run`).
    """

    def __init__(self, message: str) -> None:
        line = printable(" ".join(message.split()))
        super().__init__(line if len(line) <= LONGEST else f"{line[:LONGEST]} ...")


class MissingInputError(InputError):
    """Input that is not there at all, or too little of it for what is asked of it.

    What is there and damaged is an `InputError`. Who can do without says what is missing and goes on
    (`structlearn.core.stage.or_empty`).
    """
