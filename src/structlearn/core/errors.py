"""Errors in the user's input, as opposed to bugs."""

LONGEST = 600  # characters of a message; some libraries quote everything they could not read


def printable(text: str) -> str:
    """Text with control characters escaped, so that e.g. a topic's name cannot control a terminal."""
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
    """Input that is absent or insufficient, but not damaged; optional stages continue (`stage.or_empty`)."""
