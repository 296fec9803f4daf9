"""Paths of the files of the recorded data, and typed readers."""

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from structlearn.core.artefacts import filled, read_csv, read_table
from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers import Recording
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.joint_log import DriveLog, read_log_table
from structlearn.readers.runs import read_runs, read_streams

RAW = "raw/recorded"
LEFT_OUT = "data/raw/recorded/left_out.csv"

SLIDES = "slides"

BOXES, UR10E = "boxes", "ur10e"

SETS = {
    BOXES: ("reaches", "errors", "people", "left_out", "paths", "shapes"),
    UR10E: (
        *("drives", "drive_draws", "gains", "delay_curves", "motions", "errors", "blocks", "links"),
        *("traces", "choice", "loads", "load_draws", "carried", "bodies", "written"),
    ),
}
"""Tables of sets that have a folder and a stage of their own."""

TABLES = {
    "avoidance_scores": "avoidance/scores",
    "avoidance_folds": "avoidance/folds",
    "avoidance_phase": "avoidance/phase_worth",
    "panda_errors": "dynamics/errors",
    "panda_friction": "dynamics/friction",
    "panda_links": "dynamics/links",
    "panda_traces": "dynamics/traces",
    "slide_torques": "dynamics/slide_torques",
    "slide_payloads": "dynamics/slide_payloads",
} | {f"{name}_{table}": f"{name}/{table}" for name, tables in SETS.items() for table in tables}
"""Tables that a page shows, by name."""


@dataclass(frozen=True)
class RecordedFiles:
    """Outputs of the stages, read.

    Attributes:
        data: folder of all data.
    """

    data: Path = Path("data")

    def runs(self, name: str, at_least: int = 1) -> list[Demonstration]:
        """A set of movements on one clock.

        Raises:
            MissingInputError: there are fewer.
        """
        runs = read_runs(filled(self.data / RAW / name) / "runs.parquet")
        if len(runs) < at_least:
            raise MissingInputError(f"{self.data / RAW / name} holds {len(runs)} runs, {at_least} are needed")
        return runs

    def left_out(self) -> pd.DataFrame:
        """`set`, `file` and `reason` of what the import could not read."""
        return read_csv(self.data / RAW / "left_out.csv", keep_default_na=False)

    def imported(self, name: str) -> bool:
        """Whether a set is there."""
        return any((self.data / RAW / name).iterdir())

    def streams(self, name: str) -> list[Recording]:
        """A set of recordings whose streams have clocks of their own."""
        return read_streams(filled(self.data / RAW / name) / "streams.parquet")

    def tables(self) -> dict[str, pd.DataFrame]:
        """Those of `TABLES` for which there were data."""
        return {name: self._table(path) for name, path in TABLES.items() if self._has(f"{path}.parquet")}

    def shown(self, name: str) -> bool:
        """Whether there is something of a set to look at."""
        return any(self._has(f"{name}/{table}.parquet") for table in SETS[name])

    def of_set(self, name: str) -> dict[str, pd.DataFrame]:
        """Those of the tables of one of `SETS` for which there were data, by their own names."""
        there = [table for table in SETS[name] if self._has(f"{name}/{table}.parquet")]
        return {table: self._table(f"{name}/{table}") for table in there}

    def ur10e_log(self, name: str) -> DriveLog:
        """One log of the UR10e."""
        logs = read_log_table(self.data / RAW / "ur10e/logs.parquet", DriveLog)
        return next(log for log in logs if log.name == name)

    @property
    def ur10e_urdf(self) -> Path:
        """The URDF that was identified."""
        return self.data / "recorded/ur10e/identified.urdf"

    def _has(self, path: str) -> bool:
        """Whether a stage that ran wrote a file; where it had no data its folder is empty."""
        file = self.data / "recorded" / path
        if not file.parent.is_dir():
            raise InputError(f"{file.parent}: no such folder; run the stage that writes it")
        return file.exists()

    def _table(self, path: str) -> pd.DataFrame:
        return read_table(self.data / f"recorded/{path}.parquet")
