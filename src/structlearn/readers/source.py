"""Where recordings come from: a file or folder, what reads it, the clock, and settings of the environment.

A setting that people corrected in is a label, or a number where it is one: `5`, `5.0` and 5 are one setting,
called "5"; `tilt_left` is one too. A set of recordings of each is a folder that has its label as its name.
"""

import math
from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator, Field

from structlearn.core.params import Name, Parameters
from structlearn.readers.clock import StampPolicy


class ClockParameters(Parameters):
    """The one clock on which all stages read the demonstrations."""

    rate_hz: float = Field(gt=0, le=10_000)
    max_gap_s: float = Field(gt=0)


class SourceParameters(Parameters):
    """Recordings of one kind of data."""

    kind: ClassVar[str]  # of data, under which entries stand

    title: Name | None  # of its page and above its claims; null: its name
    # file or folder; begins with `~` in the home folder, with `$DATA` in that of public sets
    source: str = Field(min_length=1)
    reader: str = Field(pattern=r"^[a-z][a-z0-9_]*$")  # module of `structlearn.readers`, or `bags`
    part: str | int | None  # of the source, as the reader names its parts
    stamps: StampPolicy  # of bags, which clock counts

    def sources(self) -> dict[str, tuple[str, ...]]:
        """All files and folders that are read, as they are written, by what they are for."""
        return {"recordings": (self.source,)}


def setting_label(setting: Any) -> Any:
    """The label of a setting: of a number its shortest form, of any other text the text itself."""
    try:
        number = float(setting)
    except (TypeError, ValueError):
        return setting
    return f"{number + 0.0:g}" if math.isfinite(number) else str(setting)  # + 0.0: -0 is 0


Setting = Annotated[str, BeforeValidator(setting_label), Field(pattern=r"^-?\w[\w .+()-]*$")]
"""A setting in a parameter file: a number, which may be negative, or a name as of `core.params.NAME`."""
