"""The files of the obstacle stages: recordings by scenario, and the baseline learned from them."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from structlearn.ground.errors import InputError
from structlearn.ground.parallel import parallel_map
from structlearn.primitives.position import PositionPrimitive
from structlearn.primitives.primitive_files import read_primitives, write_primitives
from structlearn.primitives.sequence import PosePrimitive
from structlearn.recordings import read_demonstrations, write_recordings
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.obstacles.world.reaching_person import AvoiderParameters, demonstrate
from structlearn.testbeds.obstacles.world.scenarios import Scenario, SceneParameters

BASELINE = "baseline"
"""Folder of the demonstrations without obstacle, and name of the primitive learned from them."""


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


def read_scenarios(scenarios: Sequence[Scenario], folder: str | Path) -> list[list[Demonstration]]:
    """Demonstrations of every scenario, from the folders of `record_scenarios`.

    Raises:
        InputError: a folder is missing, or a file cannot be read.
    """
    folders = [Path(folder) / scenario.name for scenario in scenarios]
    return parallel_map(read_demonstrations, folders, "read demonstrations", local=True)


def write_baseline(baseline: PositionPrimitive, path: str | Path) -> None:
    """Publish the primitive of the unhindered reach."""
    write_primitives([PosePrimitive(BASELINE, baseline)], path)


def read_baseline(path: str | Path) -> PositionPrimitive:
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
