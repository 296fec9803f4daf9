"""Where recordings come from: a file or folder, what reads it, the clock, and settings of the environment.

A setting that people corrected in is a label, or a number where it is one: `5`, `5.0` and 5 are one setting,
called "5"; `tilt_left` is one too. A set of recordings of each is a folder that has its label as its name.
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator, Field

from structlearn.core.errors import InputError
from structlearn.core.params import Name, Parameters, home_path
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


def setting_folders(source: str | Path, named: Sequence[str]) -> dict[str, Path]:
    """Folders of a source by the label of their setting: those that are named, then all others.

    Raises InputError: there is no such folder, two of its folders are one setting, or one of those named is
    missing.
    """
    source = home_path(source)
    if not source.is_dir():
        raise InputError(f"{source}: no such folder")
    found: dict[str, Path] = {}
    for path in sorted(source.iterdir()):
        if path.is_dir() and not path.name.startswith("."):
            label = setting_label(path.name)
            if label in found:
                raise InputError(f"{path}: the setting {label} has another folder, {found[label].name}, too")
            found[label] = path
    missing = [label for label in named if label not in found]
    if missing:
        raise InputError(
            f"{source}: nothing was recorded in the setting {', '.join(missing)}; there are "
            f"{', '.join(found) or 'none'}"
        )
    return {label: found[label] for label in (*named, *(one for one in found if one not in named))}
