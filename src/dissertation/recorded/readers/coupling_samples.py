"""Reader of public samples of the coupling term past obstacles: three text files.

Samples of many demonstrations, drawn at random and shuffled, in the local frame: 17 features, three
coupling terms, 25 phase kernels times the phase velocity. They have no times and no demonstration numbers;
the phase is recovered from the kernels.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dissertation.recorded.readers.clmc import SOURCE
from structlearn.avoidance import features
from structlearn.avoidance.avoidance_dataset import AvoidanceDataset
from structlearn.core.errors import InputError, MissingInputError
from structlearn.primitives import canonical, kernels
from structlearn.readers.foreign_tables import read_text_table

FOLDER = "obs_avoid/pmnn_unroll_test_dataset"
# parts of the files' names, and numbers of columns
FILES = {
    "features": ("X_raw", 17),
    "target": ("Ct_target", 3),
    "modulation": ("normalized_phase_PSI_mult_phase_V", kernels.KERNEL_COUNT),
}
# between the kernels of a sample, up to 4.6, and those of the nearest time; the files are within 0.05
LARGEST_PHASE_ERROR = 0.2
GRID = np.linspace(0.0, 1.05, 4201)  # candidate times in a movement of duration one


class RecordedSamples(NamedTuple):
    """Samples of the coupling term, and their origin."""

    samples: AvoidanceDataset
    provenance: Mapping[str, str]


def read_coupling(folder: Path, entry: Any = None, left_out: Any = None) -> RecordedSamples:
    """Dataset of one scenario in which every row is a separate demonstration; `time` is a fraction.

    Raises MissingInputError: there are no files. Raises InputError: a file is missing, has other columns or
    another number of rows; the distance to the centre is not the length of its vector, or no time of a
    movement has the phase kernels.
    """
    paths = sample_files(folder)
    if not any(path.exists() for path in paths.values()):
        raise MissingInputError(f"{folder / FOLDER}: holds no samples of obstacle avoidance")
    seen, target, modulation = (read_text_table(paths[name], columns) for name, (_, columns) in FILES.items())
    for name, table in zip(FILES, (seen, target, modulation), strict=True):
        if len(table) != len(seen):
            raise InputError(
                f"{paths[name]}: has {len(table)} rows, {paths['features'].name} has {len(seen)}"
            )
    distance, stated = np.linalg.norm(seen[:, features.TO_CENTRE], axis=1), seen[:, features.CENTRE_DISTANCE]
    wrong = np.flatnonzero(np.abs(distance - stated) > 1e-6)
    if len(wrong):
        raise InputError(
            f"{paths['features']}: row {wrong[0]}: distance to the centre is "
            f"{stated[wrong[0]]:.6g} m, its vector says {distance[wrong[0]]:.6g} m"
        )
    time, error = phase_times(modulation)
    if error.max() > LARGEST_PHASE_ERROR:
        raise InputError(
            f"{paths['modulation']}: row {error.argmax()}: no time of a movement has these phase kernels "
            f"(the nearest is {error.max():.3g} off)"
        )
    p, _ = canonical.phase(time, canonical.time_constant(1.0))
    samples = AvoidanceDataset(
        features=seen,
        target=target,
        phase=p,
        phase_velocity=modulation.sum(axis=1),  # kernels are normalised: their sum is u
        scenario=np.zeros(len(seen), dtype=int),
        demonstration=np.arange(len(seen)),
        time=time,
    )
    return RecordedSamples(samples, SOURCE.provenance(folder, list(paths.values())))


def sample_files(folder: Path) -> dict[str, Path]:
    """Path of each table, keyed as in `FILES`."""
    stem = "subsampled_test_unroll_prim_1_{}_obs_avoid.txt"
    return {name: folder / FOLDER / stem.format(part) for name, (part, _) in FILES.items()}


def phase_times(modulation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fractions of the movement (S,) with kernels times phase velocity nearest to (S, N), and distances."""
    p, u = canonical.phase(GRID, canonical.time_constant(1.0))
    grid = kernels.features(p, u, modulation.shape[1])
    squared = (modulation**2).sum(axis=1)[:, None] - 2.0 * modulation @ grid.T + (grid**2).sum(axis=1)
    nearest = squared.argmin(axis=1)
    return GRID[nearest], np.linalg.norm(modulation - grid[nearest], axis=1)
