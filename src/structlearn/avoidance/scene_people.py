"""Learn from some people how to reach past obstacles, and try it in the scenes of others (IV.8)."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from structlearn.avoidance.scene_folds import SceneResults, judge_folds
from structlearn.avoidance.scene_unroll import SceneLearningParameters, SceneReach, cut_reach
from structlearn.avoidance.shapes import recorded_obstacle
from structlearn.core.errors import InputError, MissingInputError
from structlearn.primitives.trajectory import differentiated
from structlearn.readers.demonstration import Demonstration

OPEN = "has no obstacles"
"""Why a reach is left out: in the open it shows nothing of avoidance."""


class ScenePeopleParameters(SceneLearningParameters):
    """Whose reaches are learned from, and which shapes are obstacles.

    Attributes:
        tuned_on: people on whom constants were chosen: learned from, never judged on.
        ignored: beginnings of names of shapes that are in nobody's way.
        walls: likewise, of what the hand could meet but does not reach past.
    """

    tuned_on: tuple[str, ...]
    ignored: tuple[str, ...]
    walls: tuple[str, ...]


def learn_past_obstacles(runs: Sequence[Demonstration], parameters: ScenePeopleParameters) -> SceneResults:
    """Cut the reaches, learn fold by fold, and try everything in the scenes left out.

    Raises:
        InputError: as `reaches_past_obstacles`.
        MissingInputError: people are too few.
    """
    reaches, left_out = reaches_past_obstacles(runs, parameters)
    return judge_folds(reaches, left_out, folds_of_people(reaches, parameters), parameters)


def folds_of_people(reaches: Sequence[SceneReach], parameters: ScenePeopleParameters) -> list[list[str]]:
    """People on whom nothing was chosen, dealt out in turn; fewer are fewer folds.

    Where all are judged they are dealt out by how far their straightest reach leaves the straight line, so
    that all folds have straight reaches, of which the baseline is learned, if there are enough. Others are
    dealt out by name, since those who are always learned from have straight ones.

    Raises:
        MissingInputError: there is nobody to judge, or nobody else to learn from.
    """
    bends: dict[str, float] = {}
    for reach in reaches:
        bend = float(np.linalg.norm(reach.path.position[:, 1:], axis=1).max() / reach.goal[0])
        bends[reach.person] = min(bend, bends.get(reach.person, np.inf))
    people = sorted(bends) if parameters.tuned_on else sorted(bends, key=bends.__getitem__)
    judged = [person for person in people if person not in parameters.tuned_on]
    if not judged or len(people) < 2:
        raise MissingInputError(
            f"reaches of {len(people)} people, {len(judged)} of them on whom nothing was chosen: one is "
            "needed to be judged, and another person to learn from"
        )
    count = min(parameters.folds, len(judged))
    return [judged[number::count] for number in range(count)]


def reaches_past_obstacles(
    runs: Sequence[Demonstration], parameters: ScenePeopleParameters
) -> tuple[list[SceneReach], pd.DataFrame]:
    """The reach of each run, and which were left out.

    A reach lasts from where the hand's speed first exceeds a share of its peak to where it last does. Where a
    run says when the hand had moved, well after it began to, and when it reached its target (`moved_s` and
    `reached_s` in its provenance), the reach begins where the speed, looked at backwards from there, first is
    below that share, or with the slowest sample if the run began too late for that, and ends at the target.

    Args:
        runs: with shapes, and with the `person` in their provenance.
        parameters: see there.

    Returns:
        The reaches, and per run left out `trial`, `person` and `reason`.

    Raises:
        InputError: no run has obstacles, or one does not say whose it is.
    """
    reaches, left_out = [], []
    for run in runs:
        found = _reach(run, parameters)
        if isinstance(found, str):
            left_out.append((run.name, run.provenance["person"], found))
        else:
            reaches.append(found)
    if left_out and not reaches and all(reason == OPEN for _, _, reason in left_out):
        raise InputError(
            f"{left_out[0][0]}: {OPEN}, nor have the others; name their topic, or put obstacles.csv beside "
            "them"
        )
    return reaches, pd.DataFrame(left_out, columns=["trial", "person", "reason"])


def _reach(run: Demonstration, parameters: ScenePeopleParameters) -> SceneReach | str:
    """The reach of a run, or why there is none."""
    if "person" not in run.provenance:
        raise InputError(f"{run.name}: its provenance does not say whose reach it is")
    walls = tuple(recorded_obstacle(one) for one in run.shapes if one.name.startswith(parameters.walls))
    others = parameters.walls + parameters.ignored
    obstacles = tuple(recorded_obstacle(one) for one in run.shapes if not one.name.startswith(others))
    if not obstacles:
        return OPEN
    cutting = parameters.reaches
    smooth = differentiated(run.position, run.dt, cutting.smoothing_hz)
    speed = np.linalg.norm(smooth.velocity, axis=1)
    if "moved_s" in run.provenance:
        times = [float(run.provenance[key]) for key in ("moved_s", "reached_s")]
        begins, ends = (int(np.searchsorted(run.time, at - 1e-6)) for at in times)
        ends = min(ends, len(run.time) - 1)
        if begins >= ends:
            return "does not move before it ends"
        before = speed[: begins + 1]
        slow = np.flatnonzero(before < cutting.onset_share * speed[begins : ends + 1].max())
        part = slice(int(slow[-1]) if len(slow) else int(before.argmin()), ends + 1)
    else:
        moving = np.flatnonzero(speed >= cutting.onset_share * speed.max())
        part = slice(max(int(moving[0]) - 1, 0), int(moving[-1]) + 2)
    return cut_reach(run, run.name, run.provenance["person"], smooth, part, obstacles, walls, cutting)
