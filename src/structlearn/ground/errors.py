"""The one error that means "the input is at fault, not the program"."""


class InputError(ValueError):
    """Bad input from the user: a file, a parameter or a recording.

    The message is one sentence that names the file, topic, row or key. Stages print it without a
    traceback and exit with code 1 (`structlearn.ground.stage.run`).
    """
