"""Parameters of a source of recordings: where it is, its reader, clock and stamps, and labels of settings.

A setting in which people corrected is named by a label, or by a number in its shortest form: `5`, `5.0` and 5
are all "5"; `tilt_left` is a label. The recordings of each setting are in a folder with its label as name.
"""

import math
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field

from structlearn.core.params import Name, Parameters


class ClockParameters(Parameters):
    """The uniform clock on which all stages read the demonstrations."""

    rate_hz: float = Field(gt=0, le=10_000)
    max_gap_s: float = Field(gt=0)


class StampPolicy(Parameters):
    """Which stamps of a user's messages are used, and how disorder is handled."""

    # `header`: time of the sample, or the log time if no message of a topic has it. `log`: time of reception
    # by the recorder
    clock: Literal["header", "log"]
    # if a stamp repeats or decreases, `error`: refuse the recording; `drop`: leave out as few samples as
    # possible; `sort`: sort them. Of several samples with one stamp the first is kept
    disorder: Literal["error", "drop", "sort"]


AS_WRITTEN = StampPolicy(clock="header", disorder="error")  # for our own files, whose stamps are in order


class SourceParameters(Parameters):
    """Recordings of one kind of data."""

    kind: ClassVar[str]  # kind of data, under which entries are listed; see `tasks.kinds`

    title: Name | None  # of its page and of its claims; null: its name
    # file or folder; starts with `~` in the home folder, with `$DATA` in the folder of public sets
    source: str = Field(min_length=1)
    # module of `structlearn.readers`, dotted name of another module, or `bags`
    reader: str = Field(pattern=r"^[a-z]\w*(\.[a-z]\w*)*$")
    part: str | int | None  # part of the source, in the reader's terms
    stamps: StampPolicy  # for bags

    def sources(self) -> dict[str, tuple[str, ...]]:
        """All files and folders that are read, as written in the parameters, by purpose."""
        return {"recordings": (self.source,)}

    @property
    def skips_failures(self) -> bool:
        """Whether recordings that cannot be read or cut are left out."""
        return False


def setting_label(setting: Any) -> Any:
    """Label of a setting: the shortest form of a number, other text unchanged."""
    try:
        number = float(setting)
    except (TypeError, ValueError):
        return setting
    return f"{number + 0.0:g}" if math.isfinite(number) else str(setting)  # + 0.0 turns -0 into 0


Setting = Annotated[str, BeforeValidator(setting_label), Field(pattern=r"^-?\w[\w .+()-]*$")]
"""A setting in a parameter file: a number, which may be negative, or a name as in `core.params.NAME`."""
