"""Where recordings come from: a file or folder, what reads it, and the clock that signals are put on."""

from typing import ClassVar

from pydantic import Field

from structlearn.core.params import Name, Parameters
from structlearn.readers.stamps import StampPolicy


class ClockParameters(Parameters):
    """The one clock on which all stages read the demonstrations."""

    rate_hz: float = Field(gt=0, le=10_000)
    max_gap_s: float = Field(gt=0)


class SourceParameters(Parameters):
    """Recordings of one kind of data.

    Attributes:
        kind: of data, under which entries stand.
        title: of its page and above its claims; null: its name.
        source: file or folder; begins with `~` in the home folder, with `$DATA` in that of public sets.
        reader: module of `structlearn.readers`, or `bags`.
        part: of the source, as the reader names its parts.
        stamps: of bags, which clock counts.
    """

    kind: ClassVar[str]

    title: Name | None
    source: str = Field(min_length=1)
    reader: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    part: str | int | None
    stamps: StampPolicy

    def sources(self) -> dict[str, tuple[str, ...]]:
        """All files and folders that are read, as they are written, by what they are for."""
        return {"recordings": (self.source,)}
