"""The files of the obstacle testbed, read typed: where they lie, for the stages that show results.

The computing stages name their own files and use only what writes and reads recordings and the baseline.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pandas as pd

from structlearn.ground.artefacts import read_table
from structlearn.ground.errors import InputError
from structlearn.ground.parallel import parallel_map
from structlearn.primitives.position import PositionPrimitive
from structlearn.primitives.primitive_files import read_primitives, write_primitives
from structlearn.primitives.sequence import PosePrimitive
from structlearn.recordings import read_demonstrations, write_recordings
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.obstacles.world.reaching_person import AvoiderParameters, demonstrate
from structlearn.testbeds.obstacles.world.scenarios import Scenario, SceneParameters

RAW = "data/raw/obstacles"
BASELINES_FILE = "data/obstacles/dataset/baselines.safetensors"
SAMPLES_FILE = "data/obstacles/dataset/samples.parquet"
PEOPLE_FILE = "data/obstacles/dataset/demonstrations.parquet"
ERRORS_FILE = "data/obstacles/models/errors.parquet"
SCORES_FILE = "data/obstacles/evaluation/scores.parquet"
PATHS_FILE = "data/obstacles/evaluation/paths.parquet"

REPORT, RECORDINGS = "reports/obstacles", "reports/recordings/obstacles"

BASELINE = "baseline"
"""Folder of the demonstrations without obstacle, and name of the primitives learned from them."""


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
    """Tables of the stages `obstacle_evaluate` and, of people, `obstacle_dataset`.

    Raises:
        InputError: one is missing, as all here.
    """
    return Evaluation(read_table(SCORES_FILE), read_table(PATHS_FILE), read_table(PEOPLE_FILE))


def read_samples() -> pd.DataFrame:
    """What the models learn from, by `person`, of the stage `obstacle_dataset`."""
    return read_table(SAMPLES_FILE)


def read_errors() -> pd.DataFrame:
    """How well the models fit, by `person`, of the stage `obstacle_train`; see `avoidance_fits.learn`."""
    return read_table(ERRORS_FILE)


def record_scenarios(
    scenarios: Sequence[Scenario],
    scene: SceneParameters,
    person: AvoiderParameters,
    folder: str | Path,
) -> None:
    """Demonstrate the baseline and every scenario, over processes, into a folder each.

    Args:
        scenarios: where; their names become folders, e.g. `sphere/07`.
        scene: start and goal.
        person: who demonstrates.
        folder: of the folders.

    Raises:
        InputError: an obstacle contains start or goal.
    """
    record = partial(_record, scene=scene, person=person, folder=Path(folder))
    parallel_map(record, [None, *scenarios], "demonstrations past obstacles", local=True)


def read_scenarios(scenarios: Sequence[Scenario], folder: str | Path = RAW) -> list[list[Demonstration]]:
    """Demonstrations of every scenario, from the folders of `record_scenarios`.

    Raises:
        InputError: a folder is missing, or a file cannot be read.
    """
    folders = [Path(folder) / scenario.name for scenario in scenarios]
    return parallel_map(read_demonstrations, folders, "read demonstrations", local=True)


def read_unhindered() -> list[Demonstration]:
    """Demonstrations without obstacle."""
    return read_demonstrations(f"{RAW}/{BASELINE}")


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


def _record(
    scenario: Scenario | None, scene: SceneParameters, person: AvoiderParameters, folder: Path
) -> None:
    recordings = demonstrate([scenario], scene, person)[0]
    write_recordings(recordings, folder / (BASELINE if scenario is None else scenario.name))
