"""What the pages of the recorded data show, as far as it is there: tables, and what figures draw."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import pandas as pd

from structlearn.ground.params import Parameters
from structlearn.primitives.fitting import Segment, segment_paths, whole
from structlearn.primitives.sequence import PosePrimitive
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.recorded import files

AXES = ["x", "y", "z"]


@dataclass(frozen=True)
class RecordedResults:
    """All that the pages show.

    Attributes:
        tables: of the stages, by the names of `files.TABLES`, those for which there were data; they are what
            the protocols return.
        reach_segments: the reaches.
        reach_primitive: learned from all of them.
        unscrewing_segments: the logs.
        unscrewing_primitive: learned from all of them.
        execution: recorded parts of the scraping execution in order.
        parameters: that they were made with, by their key in `params.yaml`.
    """

    tables: Mapping[str, pd.DataFrame]
    reach_segments: Sequence[Segment] = ()
    reach_primitive: PosePrimitive | None = None
    unscrewing_segments: Sequence[Segment] = ()
    unscrewing_primitive: PosePrimitive | None = None
    execution: Sequence[Demonstration] = ()
    parameters: Mapping[str, Parameters] = field(default_factory=dict)

    def __getitem__(self, name: str) -> pd.DataFrame:
        return self.tables[name]

    def of_set(self, prefix: str) -> dict[str, pd.DataFrame]:
        """The tables of a set that all begin with its name, without it."""
        found = self.tables.items()
        return {name.removeprefix(prefix): table for name, table in found if name.startswith(prefix)}


def read_results(stored: files.RecordedFiles, parameters: Mapping[str, Parameters]) -> RecordedResults:
    """What the stages wrote; parameters by their key in `params.yaml`."""
    found: dict[str, object] = {}
    fits = {
        files.REACHES: parameters["recorded_reaches"].fit,
        files.UNSCREWING: parameters["recorded_unscrewing"],
    }
    for (name, fit), prefix in zip(fits.items(), ("reach", "unscrewing"), strict=True):
        if stored.learned(name):
            movements = stored.demonstrations(name)
            segments = segment_paths(movements, whole(movements), fit.smoothing_hz)
            found |= {f"{prefix}_segments": segments, f"{prefix}_primitive": stored.primitives(name)[0]}
    if stored.learned(files.SCRAPING):
        found["execution"] = stored.demonstrations(files.SCRAPING)
    return RecordedResults(stored.tables(), **found, parameters=parameters)
