"""Where the files of the scraping testbed lie, and what they hold, for all who read them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.feedback.coupling_dataset import CouplingDataset, from_table
from structlearn.feedback.coupling_model import CouplingModel, read_networks
from structlearn.ground.artefacts import read_table
from structlearn.ground.errors import InputError
from structlearn.primitives.primitive_files import read_primitives, read_vector_primitive
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.vector import VectorPrimitive
from structlearn.recordings import read_demonstrations
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.source import ClockParameters

CHECKS = "checks_"
"""Prefix of the tables beside the datasets that say how well these hold together."""

TABLES = {
    "noise": "segments/scraping_sweep/noise",
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
"""Tables of the stages by name, below the folder of all data, without their ending."""

CLOSED_LOOP, REFINED, CORRECTIONS = "closed_loop", "refined", "corrections"
"""Folders of runs at several tilts; the first two hold a folder per model, those of corrections do not."""


@dataclass(frozen=True)
class ScrapingFiles:
    """What the stages wrote, read.

    Attributes:
        clock: on which runs are read.
        data: folder of all data.
    """

    clock: ClockParameters
    data: Path = Path("data")

    @property
    def segments(self) -> Path:
        """Folder of the segmentation, for `segments.read_segmentation`."""
        return self.data / "segments/scraping"

    def table(self, name: str) -> pd.DataFrame:
        """One of `TABLES`; empty where a stage had nothing to write."""
        path = self.data / f"{TABLES[name]}.parquet"
        return read_table(path) if path.exists() else pd.DataFrame()

    def demonstrations(self) -> list[Demonstration]:
        """Nominal demonstrations."""
        return self._runs(self.data / "raw/scraping/nominal")

    def unrolls(self) -> list[Demonstration]:
        """Executions of the nominal primitives on the level board."""
        return self._runs(self.data / "raw/scraping/unrolls")

    def level_runs(self) -> list[Demonstration]:
        """All of them: those that the expected traces are of, and further ones."""
        further = self.data / "raw/scraping/level"
        return [*self.unrolls(), *(self._runs(further) if any(further.glob("*.mcap")) else [])]

    def runs(
        self, kind: str, setting_deg: float, model: str = "", count: int | None = None
    ) -> list[Demonstration]:
        """Runs at one tilt in the order of their names; none where there was nothing to run.

        Args:
            kind: `CLOSED_LOOP`, `REFINED` or `CORRECTIONS`.
            setting_deg: roll of the board.
            model: that ran, or "nominal"; not of corrections.
            count: how many are read, default all.
        """
        files = sorted((self.data / "raw/scraping" / kind / model / f"{setting_deg:g}").glob("*.mcap"))
        return [self._runs(file)[0] for file in files[:count]]

    def primitives(self) -> list[PosePrimitive]:
        """Movement primitives in order of time."""
        return read_primitives(self.data / "primitives/scraping/primitives.safetensors")

    def expected(self) -> dict[str, VectorPrimitive]:
        """See `read_expected`."""
        return read_expected(self.data / "feedback/scraping/expected")

    def datasets(self, settings: Sequence[float] | None = None) -> dict[str, CouplingDataset]:
        """See `read_datasets`."""
        return read_datasets(self.data / "feedback/scraping/dataset", settings)

    def checks(self, primitive: str) -> pd.DataFrame:
        """Checks of a primitive's supervised data, of `supervision.coupling_dataset`."""
        return read_table(self.data / f"feedback/scraping/dataset/{CHECKS}{primitive}.parquet")

    def networks(self, model: str) -> dict[str, CouplingModel]:
        """Networks of a trained model by primitive."""
        return read_networks(self.data / f"feedback/scraping/models/{model}.safetensors")

    def _runs(self, path: Path) -> list[Demonstration]:
        return read_demonstrations(path, **self.clock.model_dump())


def read_sets(folder: str | Path, clock: ClockParameters) -> dict[float, list[Demonstration]]:
    """Runs by setting, from sub-folders that have the setting's number as their name.

    Args:
        folder: of the sub-folders; none where nothing was recorded.
        clock: on which the runs are read.

    Returns:
        By setting in degrees, in rising order.

    Raises:
        InputError: there is no such folder, a sub-folder's name is no number or the same number as another's,
            or its files cannot be read.
    """
    sets = {}
    for path in sorted(_written(folder).iterdir()):
        if path.is_dir():
            setting = _setting(path)
            if setting in sets:
                raise InputError(f"{path}: the setting {setting:g} has another folder too")
            sets[setting] = read_demonstrations(path, **clock.model_dump())
    return dict(sorted(sets.items()))


def read_expected(folder: str | Path) -> dict[str, VectorPrimitive]:
    """Expected traces by the primitive's name, from `<primitive>.safetensors`; none if nothing was felt.

    Raises:
        InputError: there is no such folder, or a file is not readable.
    """
    files = sorted(_written(folder).glob("*.safetensors"))
    return {path.stem: read_vector_primitive(path) for path in files}


def read_datasets(folder: str | Path, settings: Sequence[float] | None = None) -> dict[str, CouplingDataset]:
    """Supervised data by the primitive's name.

    Args:
        folder: of the coupling_dataset stage.
        settings: degrees; those that are kept, default all.

    Raises:
        InputError: there is no such folder, a file is not readable, or a setting was not recorded.
    """
    datasets = {}
    for path in sorted(_written(folder).glob("*.parquet")):
        if not path.stem.startswith(CHECKS):
            dataset = _dataset(path)
            if settings is not None:
                missing = sorted(set(settings) - set(dataset.setting))
                if missing:
                    names = ", ".join(f"{setting:g}" for setting in missing)
                    raise InputError(f"{path}: has no corrections in the settings {names}")
                dataset = dataset.where(np.isin(dataset.setting, settings))
            datasets[path.stem] = dataset
    return datasets


def _written(folder: str | Path) -> Path:
    """The folder of an earlier stage; one without files means that there was nothing to write."""
    if not Path(folder).is_dir():
        raise InputError(f"{folder}: no such folder; run the stage that writes it")
    return Path(folder)


def _setting(path: Path) -> float:
    try:
        setting = float(path.name)
    except ValueError:
        setting = np.nan
    if not np.isfinite(setting):
        raise InputError(f"{path}: a setting's folder has a number as its name")
    return setting


def _dataset(path: Path) -> CouplingDataset:
    try:
        return from_table(read_table(path))
    except KeyError as error:
        raise InputError(f"{path}: holds no supervised data (missing {error})") from error
