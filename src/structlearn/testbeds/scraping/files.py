"""The files of the feedback stages: sets of runs by setting, expected traces, datasets."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from structlearn.feedback.coupling_dataset import CouplingDataset, from_table
from structlearn.ground.artefacts import read_table
from structlearn.ground.errors import InputError
from structlearn.primitives.primitive_files import read_vector_primitive
from structlearn.primitives.vector import VectorPrimitive
from structlearn.recordings import read_demonstrations
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.source import ClockParameters

CHECKS = "checks_"
"""Prefix of the tables beside the datasets that say how well these hold together."""


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
