"""Which clock stamps a message, and what becomes of stamps that do not increase."""

from typing import Literal


from structlearn.ground.params import Parameters


class StampPolicy(Parameters):
    """How the stamps of a user's messages are taken.

    Attributes:
        clock: `header`: when a sample was taken, as its message says; where no message of a topic says so,
            the log time stands in. `log`: when the recorder got it.
        disorder: what is done where a stamp repeats or runs back. `error`: the recording is refused. `drop`:
            as few samples as possible are left out so that the others increase. `sort`: samples are put in
            the order of their stamps; of several with one stamp the first stays.
    """

    clock: Literal["header", "log"]
    disorder: Literal["error", "drop", "sort"]


AS_WRITTEN = StampPolicy(clock="header", disorder="error")
"""How our own files are read: whoever wrote them had the stamps in order."""
