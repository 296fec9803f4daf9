"""Files of the obstacle testbed that several stages read."""

import re
from collections.abc import Mapping
from pathlib import Path

from structlearn.core.errors import InputError
from structlearn.primitives.position import PositionPrimitive
from structlearn.primitives.primitive_files import read_primitives, write_primitives
from structlearn.primitives.sequence import PosePrimitive

RUNS = "data/runs/obstacles"
BASELINES_FILE = "data/obstacles/dataset/baselines.safetensors"
SAMPLES_FILE = "data/obstacles/dataset/samples.parquet"
PEOPLE_FILE = "data/obstacles/dataset/demonstrations.parquet"
ERRORS_FILE = "data/obstacles/models/errors.parquet"
SCORES_FILE = "data/obstacles/evaluation/scores.parquet"
PATHS_FILE = "data/obstacles/evaluation/paths.parquet"

REPORT, RECORDINGS = "reports/obstacles", "reports/rerun/obstacles"

BASELINE = "baseline"
"""Name of the demonstrations without obstacle, and prefix of the primitives learned from them."""


def write_baselines(baselines: Mapping[int, PositionPrimitive], path: str | Path) -> None:
    """Write each person's primitive of the reach without obstacle."""
    write_primitives([PosePrimitive(f"{BASELINE}_{person}", its) for person, its in baselines.items()], path)


def read_baselines(path: str | Path = BASELINES_FILE) -> dict[int, PositionPrimitive]:
    """Read each person's primitive of the reach without obstacle.

    Raises InputError: the file holds other primitives.
    """
    primitives = read_primitives(path)
    if not all(re.fullmatch(rf"{BASELINE}_\d+", primitive.name) for primitive in primitives):
        raise InputError(f"{path}: holds other primitives than baselines")
    return {int(primitive.name.rpartition("_")[2]): primitive.position for primitive in primitives}
