"""The files of the obstacle testbed, read typed: where they lie, for the stages that show results.

The computing stages name their own files and use only what writes and reads recordings and the baseline.
"""

from collections.abc import Sequence
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
BASELINE_FILE = "data/obstacles/dataset/baseline.safetensors"
SAMPLES_FILE = "data/obstacles/dataset/samples.parquet"
ERRORS_FILE = "data/obstacles/models/errors.parquet"
SCORES_FILE = "data/obstacles/evaluation/scores.parquet"
PATHS_FILE = "data/obstacles/evaluation/paths.parquet"
PEOPLE_FILE = "data/obstacles/evaluation/demonstrations.parquet"

REPORT, RECORDINGS = "reports/obstacles", "reports/recordings/obstacles"

BASELINE = "baseline"
"""Folder of the demonstrations without obstacle, and name of the primitive learned from them."""


@dataclass(frozen=True)
class Evaluation:
    """What the models were put to.

    Attributes:
        scores: of every unroll, see `avoidance_protocols.evaluate`.
        paths: of the unrolls with limits at the goal, see there.
        people: scores of the demonstrations, see `avoidance_protocols.demonstration_scores`.
    """

    scores: pd.DataFrame
    paths: pd.DataFrame
    people: pd.DataFrame


def read_evaluation() -> Evaluation:
    """Tables of the stage `obstacle_evaluate`. Raises InputError where one is missing, as all here."""
    return Evaluation(read_table(SCORES_FILE), read_table(PATHS_FILE), read_table(PEOPLE_FILE))


def read_samples() -> pd.DataFrame:
    """What the models learn from, of the stage `obstacle_dataset`."""
    return read_table(SAMPLES_FILE)


def read_errors() -> pd.DataFrame:
    """How well the models fit, of the stage `obstacle_train`; see `avoidance_fits.learn`."""
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


def write_baseline(baseline: PositionPrimitive, path: str | Path) -> None:
    """Publish the primitive of the unhindered reach."""
    write_primitives([PosePrimitive(BASELINE, baseline)], path)


def read_baseline(path: str | Path = BASELINE_FILE) -> PositionPrimitive:
    """Read the primitive of the unhindered reach.

    Raises:
        InputError: the file is missing or holds something else.
    """
    primitives = read_primitives(path)
    if [primitive.name for primitive in primitives] != [BASELINE]:
        raise InputError(f"{path}: holds no baseline")
    return primitives[0].position


def _record(
    scenario: Scenario | None, scene: SceneParameters, person: AvoiderParameters, folder: Path
) -> None:
    recordings = demonstrate([scenario], scene, person)[0]
    write_recordings(recordings, folder / (BASELINE if scenario is None else scenario.name))
