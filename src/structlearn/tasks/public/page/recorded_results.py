"""What the pages of the recorded data show, as far as it is there: tables, and what figures draw."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from structlearn.tasks.public import public_files

AXES = ["x", "y", "z"]


@dataclass(frozen=True)
class RecordedResults:
    """All that the pages show.

    Attributes:
        tables: by the names of `public_files.TABLES`, those for which there were data, as
            the protocols return.
        left_out: `set`, `file` and `reason` of what could not be read.
        parameters: that they were made with, by their key in `params.yaml`.
    """

    tables: Mapping[str, pd.DataFrame]
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
    return RecordedResults(stored.tables(), parameters, stored.left_out())
