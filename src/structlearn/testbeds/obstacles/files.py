"""The files of the obstacle testbed that several of its stages read."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from structlearn.core.artefacts import read_table
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
"""Name of the demonstrations without obstacle, and of the primitives learned from them."""


@dataclass(frozen=True)
class Evaluation:
    """What the models were put to.

    Attributes:
        scores: of every unroll, see `avoidance_protocols.evaluate`, with a column `person`.
        paths: of the unrolls with limits at the goal, see there, of the person that is shown.
        people: scores of the demonstrations, see `avoidance_protocols.demonstration_scores`, by `person`.
    """

    scores: pd.DataFrame
    paths: pd.DataFrame
    people: pd.DataFrame


def read_evaluation() -> Evaluation:
    """Tables of the stages `obstacles_evaluate` and, of people, `obstacles_dataset`."""
    return Evaluation(read_table(SCORES_FILE), read_table(PATHS_FILE), read_table(PEOPLE_FILE))


def write_baselines(baselines: Mapping[int, PositionPrimitive], path: str | Path) -> None:
    """Publish the primitives of the unhindered reach, by person."""
    write_primitives([PosePrimitive(f"{BASELINE}_{person}", its) for person, its in baselines.items()], path)


def read_baselines(path: str | Path = BASELINES_FILE) -> dict[int, PositionPrimitive]:
    """Read the primitives of the unhindered reach, by person.

    Raises:
        InputError: the file is missing or holds something else.
    """
    primitives = read_primitives(path)
    if not all(re.fullmatch(rf"{BASELINE}_\d+", primitive.name) for primitive in primitives):
        raise InputError(f"{path}: holds other primitives than baselines")
    return {int(primitive.name.rpartition("_")[2]): primitive.position for primitive in primitives}
