"""Reaches of your own past obstacles: cut, learned from fold by fold, tried in the scenes left out (IV.8)."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from structlearn.avoidance.scene_folds import SceneResults, judge_folds
from structlearn.avoidance.scene_unroll import SceneReach, cut_reach
from structlearn.avoidance.shapes import recorded_obstacle
from structlearn.ground.errors import InputError
from structlearn.primitives.trajectory import differentiated
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.shape_table import FILE
from structlearn.testbeds.own.protocol.own_obstacles_parameters import ObstacleParameters

EVERYBODY = ""
"""Of recordings that are nobody's in particular: each then counts as a person of its own."""

OPEN = "has no obstacles"
"""Why a reach is left out."""


def learn_past_obstacles(
    recordings: Mapping[str, Sequence[Demonstration]], parameters: ObstacleParameters
) -> SceneResults:
    """Cut the reaches, learn from all but those of a fold, and try everything in the scenes left out.

    Args:
        recordings: by person, or all under `EVERYBODY`.
        parameters: see there.

    Raises:
        InputError: no recording has obstacles, fewer than two people or recordings have reaches, or none of
            a fold's reaches to learn from is straight.
    """
    reaches, left_out = own_reaches(recordings, parameters)
    people = by_bend(reaches)
    if len(people) < 2:
        raise InputError(
            f"{parameters.source}: of {len(people)} people or recordings with reaches none can be left out"
        )
    count = min(parameters.folds, len(people))
    return judge_folds(reaches, left_out, [people[fold::count] for fold in range(count)], parameters)


def by_bend(reaches: Sequence[SceneReach]) -> list[str]:
    """People by how far their straightest reach leaves the straight line.

    Dealt out in this order, all folds have straight reaches, of which the baseline is learned, where there
    are enough.
    """
    bends: dict[str, float] = {}
    for reach in reaches:
        bend = float(np.linalg.norm(reach.path.position[:, 1:], axis=1).max() / reach.goal[0])
        bends[reach.person] = min(bend, bends.get(reach.person, np.inf))
    return sorted(bends, key=bends.__getitem__)


def own_reaches(
    recordings: Mapping[str, Sequence[Demonstration]], parameters: ObstacleParameters
) -> tuple[list[SceneReach], pd.DataFrame]:
    """The reach of each recording, and which were left out.

    A reach lasts from where the hand's speed first exceeds a share of its peak to where it last does. One in
    the open shows nothing of avoidance and is left out.

    Returns:
        The reaches, and per recording left out `trial`, `person` and `reason`.

    Raises:
        InputError: no recording has obstacles.
    """
    reaches, left_out = [], []
    for person, its in recordings.items():
        for one in its:
            name = f"{person} {one.name}" if person else one.name
            found = _reach(one, name, person or one.name, parameters)
            if isinstance(found, str):
                left_out.append((name, person or one.name, found))
            else:
                reaches.append(found)
    if left_out and not reaches and all(reason == OPEN for _, _, reason in left_out):
        raise InputError(
            f"{left_out[0][0]}: {OPEN}, nor have the others; name their topic, or put {FILE} beside them"
        )
    return reaches, pd.DataFrame(left_out, columns=["trial", "person", "reason"])


def _reach(one: Demonstration, name: str, person: str, parameters: ObstacleParameters) -> SceneReach | str:
    obstacles = tuple(
        recorded_obstacle(shape) for shape in one.shapes if not shape.name.startswith(parameters.ignored)
    )
    if not obstacles:
        return OPEN
    cutting = parameters.reaches
    smooth = differentiated(one.position, one.dt, cutting.smoothing_hz)
    speed = np.linalg.norm(smooth.velocity, axis=1)
    moving = np.flatnonzero(speed >= cutting.onset_share * speed.max())
    part = slice(max(int(moving[0]) - 1, 0), int(moving[-1]) + 2)
    return cut_reach(one, name, person, smooth, part, obstacles, (), cutting)
