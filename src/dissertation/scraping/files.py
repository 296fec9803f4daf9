"""Files of the scraping testbed, with typed readers."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.core.artefacts import read_table
from structlearn.core.errors import InputError
from structlearn.feedback.coupling_dataset import CouplingDataset, from_table
from structlearn.primitives.primitive_files import read_vector_primitive
from structlearn.primitives.vector import VectorPrimitive
from structlearn.readers.demonstration import Demonstration, read_runs

CHECKS = "checks_"
"""File name prefix of the check tables beside the data sets, one per primitive."""

TABLES = {
    "noise": "segments/scraping_sweep/noise",
    "thresholds": "segments/scraping_sweep/thresholds",
    "downsampling": "segments/scraping_sweep/downsampling",
    "downsampling_people": "segments/scraping_sweep/downsampling_people",
    "reproduction": "primitives/scraping/reproduction",
    "nominal": "primitives/scraping/nominal",
    "generalised": "primitives/scraping/generalised",
    "comparison": "feedback/scraping/comparison/scores",
    "orderings": "feedback/scraping/comparison/orderings",
    "scores": "feedback/scraping/evaluation/scores",
    "traces": "feedback/scraping/evaluation/traces",
    "path_errors": "feedback/scraping/evaluation/path_errors",
    "history": "feedback/scraping/refinement/history",
    "rollouts": "feedback/scraping/refinement/rollouts",
    "refined_scores": "feedback/scraping/refined/scores",
    "refined_traces": "feedback/scraping/refined/traces",
    "search": "feedback/scraping/search/trials",
}
"""Paths of the stages' tables relative to the data folder, without suffix."""

CLOSED_LOOP, REFINED, CORRECTIONS = "closed_loop", "refined", "corrections"
"""Folders of runs at several tilts; the first two have a subfolder per model."""


@dataclass(frozen=True)
class ScrapingFiles:
    """Outputs of the stages in a data folder."""

    data: Path = Path("data")

    def table(self, name: str) -> pd.DataFrame:
        """Read one of `TABLES`; empty if the stage had nothing to write."""
        path = self.data / f"{TABLES[name]}.parquet"
        return read_table(path) if path.exists() else pd.DataFrame()

    def runs(self, name: str) -> list[Demonstration]:
        """Read a set of runs: `nominal` (demonstrations), `unrolls` or `level` (on the level board)."""
        return read_runs(self.data / f"runs/scraping/{name}.parquet")

    def runs_at(self, setting_deg: float, kind: str, model: str = "") -> list[Demonstration]:
        """Read runs of a kind at one tilt, of a model if any; empty if the tilt was not run."""
        path = self.data / "runs/scraping" / kind / model / f"{setting_deg:g}.parquet"
        return read_runs(path) if path.exists() else []


def read_settings(folder: str | Path) -> dict[float, list[Demonstration]]:
    """Runs by setting in degrees, ascending, from `<setting>.parquet`.

    Raises InputError: there is no such folder, or a file cannot be read.
    """
    paths = sorted(_written(folder).glob("*.parquet"), key=lambda path: float(path.stem))
    return {float(path.stem): read_runs(path) for path in paths}


def read_expected(folder: str | Path) -> dict[str, VectorPrimitive]:
    """Expected traces by primitive, from `<primitive>.safetensors`; empty without sensors.

    Raises InputError: there is no such folder, or a file is not readable.
    """
    files = sorted(_written(folder).glob("*.safetensors"))
    return {path.stem: read_vector_primitive(path) for path in files}


def read_datasets(folder: str | Path, settings: Sequence[float] | None = None) -> dict[str, CouplingDataset]:
    """Supervised data by primitive, for some settings in degrees or for all.

    Raises InputError: there is no such folder, a file is not readable, or a setting was not recorded.
    """
    datasets = {}
    for path in sorted(_written(folder).glob("*.parquet")):
        if path.stem.startswith(CHECKS):
            continue
        try:
            dataset = from_table(read_table(path))
        except KeyError as error:
            raise InputError(f"{path}: holds no supervised data (missing {error})") from error
        if settings is not None:
            if missing := sorted(set(settings) - set(dataset.setting)):
                names = ", ".join(f"{setting:g}" for setting in missing)
                raise InputError(f"{path}: has no corrections in the settings {names}")
            dataset = dataset.where(np.isin(dataset.setting, settings))
        datasets[path.stem] = dataset
    return datasets


def _written(folder: str | Path) -> Path:
    """Check that an earlier stage wrote a folder; it may be empty."""
    if not Path(folder).is_dir():
        raise InputError(f"{folder}: no such folder; run the stage that writes it")
    return Path(folder)
