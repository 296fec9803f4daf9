"""Where the demonstrations of a pipeline come from, and the clock they are read on."""

import os
from pathlib import Path

from pydantic import Field

from structlearn.ground.params import Parameters
from structlearn.recordings.topics import TopicMap

SIMULATED = "simulated"
PUBLIC_SOURCE_VARIABLE = "RECORDED_DATA"


class SourceParameters(Parameters):
    """Source of the raw demonstrations.

    Attributes:
        source: `simulated`, or the path of your own bags (see `folders.read_demonstrations`).
        topics: which topic of your bags carries which signal; not looked at when simulated.
    """

    source: str = Field(min_length=1)
    topics: TopicMap

    @property
    def simulated(self) -> bool:
        """Whether the demonstrations are simulated."""
        return self.source == SIMULATED


class RunSourceParameters(Parameters):
    """Source of further runs of the same task: executions, corrected demonstrations.

    Attributes:
        source: folder of your own bags, read with the topics of `SourceParameters`; None: simulated where the
            demonstrations are, and nothing where they are your own.
        runs: number of simulated runs, per setting where there are several.
    """

    source: str | None = Field(min_length=1)
    runs: int = Field(ge=1, le=1000)


class CorrectionSourceParameters(RunSourceParameters):
    """Source of corrected demonstrations.

    Attributes:
        settings_deg: settings of the environment, roll of the board in degrees. Your own bags of each are in
            a sub-folder that has the number as its name, e.g. `2.5`.
    """

    settings_deg: tuple[float, ...] = Field(min_length=1)


class PublicSourceParameters(Parameters):
    """Source of the public recordings.

    Attributes:
        source: folder that holds `clmc` and `slide`; the environment variable RECORDED_DATA stands in for it,
            so that the place of the data on a machine need not be written into a file under version control.
        slide_trials: the first so many trials of each material are taken.
    """

    source: str = Field(min_length=1)
    slide_trials: int = Field(ge=1)

    @property
    def folder(self) -> Path:
        """The folder to import from."""
        return Path(os.environ.get(PUBLIC_SOURCE_VARIABLE) or self.source)


def is_there(folder: Path) -> bool:
    """Whether a public set lies on this machine; if not, one line says so, and the other sets go on."""
    if not folder.is_dir():
        print(f"{folder}: is not there, so nothing is imported from it")
    return folder.is_dir()


class ClockParameters(Parameters):
    """The one clock on which all stages read the demonstrations.

    Attributes:
        rate_hz: ticks per second.
        max_gap_s: longest hole in a stream that is bridged by interpolation.
    """

    rate_hz: float = Field(gt=0, le=10_000)
    max_gap_s: float = Field(gt=0)
