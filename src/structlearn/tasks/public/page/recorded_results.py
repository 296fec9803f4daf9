"""What the pages of the recorded data show, as far as it is there: tables, and what figures draw."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from structlearn.primitives.fitting import FitParameters, Segment, segment_paths, whole
from structlearn.primitives.sequence import PosePrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.tasks.public import public_files

AXES = ["x", "y", "z"]


@dataclass(frozen=True)
class RecordedResults:
    """All that the pages show.

    Attributes:
        tables: by the names of `public_files.TABLES`, those for which there were data, as
            the protocols return.
        reach_segments: the reaches.
        reach_primitives: the one that is learned from all of them.
        unscrewing_segments: the logs.
        unscrewing_primitives: the one that is learned from all of them.
        execution: recorded parts of the scraping execution in order.
        left_out: `set`, `file` and `reason` of what could not be read.
        parameters: that they were made with, by their key in `params.yaml`.
    """

    tables: Mapping[str, pd.DataFrame]
    reach_segments: Sequence[Segment] = ()
    reach_primitives: Sequence[PosePrimitive] = ()
    unscrewing_segments: Sequence[Segment] = ()
    unscrewing_primitives: Sequence[PosePrimitive] = ()
    execution: Sequence[Demonstration] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)
    left_out: pd.DataFrame = field(default_factory=pd.DataFrame)

    def __getitem__(self, name: str) -> pd.DataFrame:
        return self.tables[name]

    def of_set(self, prefix: str) -> dict[str, pd.DataFrame]:
        """The tables of a set that all begin with its name, without it."""
        found = self.tables.items()
        return {name.removeprefix(prefix): table for name, table in found if name.startswith(prefix)}


def read_results(stored: public_files.RecordedFiles, parameters: Mapping[str, Any]) -> RecordedResults:
    """Outputs of the stages; parameters by their key in `params.yaml`."""
    reaches = _movements(stored, public_files.REACHES, parameters["recorded_reaches"].fit)
    turns = _movements(stored, public_files.UNSCREWING, parameters["recorded_unscrewing"])
    execution = stored.runs(public_files.SCRAPING) if stored.learned(public_files.SCRAPING) else ()
    return RecordedResults(stored.tables(), *reaches, *turns, execution, parameters, stored.left_out())


def _movements(
    stored: public_files.RecordedFiles, name: str, fit: FitParameters
) -> tuple[Sequence[Segment], Sequence[PosePrimitive]]:
    """A set of movements and its primitive; nothing where there were no data."""
    if not stored.learned(name):
        return (), ()
    movements = stored.runs(name)
    return segment_paths(movements, whole(movements), fit.smoothing_hz), stored.primitives(name)
