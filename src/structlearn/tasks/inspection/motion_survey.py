"""How many moves the demonstrations of one task have: the runs of motion in which most of them agree.

A threshold that is right for one task is wrong for the next, so those are tried that the cutting tries. At
each, a demonstration is a row of long and short runs. What most demonstrations show alike is the task; short
runs count if they, too, stand at the same places.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from structlearn.core import quaternion
from structlearn.segmentation.motion_runs import FRACTIONS, Motion, pace, runs_of_motion
from structlearn.tasks.inspection.hand_paths import HandPath

PREFERRED = 1
"""Which threshold is taken where they serve alike: low, so that no slow move is lost, and above the sway."""

BRIDGE_S = 0.2
"""s; a shorter dip in speed is a hesitation: people who stop on purpose do for longer."""

SHORT_SHARE = 0.1
"""Of the longest run of a demonstration, below which a run is short: idle, unless all have it."""


class MotionRun(NamedTuple):
    """Speed above a threshold from start to end (s since the first pose) over a distance in m."""

    start_s: float
    end_s: float
    way: float
    short: bool


@dataclass(frozen=True)
class MotionSurvey:
    """Runs of motion of all demonstrations at the threshold (m/s) at which most agree.

    `number` of runs in most of them, whose names are `agreeing`; `turns_deg`: by which the hand turns between
    one of these runs and the next, medians; none where orientations are not known.
    """

    threshold: float
    runs: Mapping[str, Sequence[MotionRun]]
    with_short: bool
    number: int
    agreeing: tuple[str, ...]
    turns_deg: tuple[float, ...] = ()

    def counted(self, name: str) -> list[MotionRun]:
        """Runs of a demonstration, without short ones where they do not count."""
        return [run for run in self.runs[name] if self.with_short or not run.short]


def survey_motion(paths: Mapping[str, HandPath]) -> MotionSurvey:
    """Runs of motion of demonstrations by name, and the number in which most agree."""
    moved = [Motion(path.position, path.speed, path.speed, False) for path in paths.values()]
    choices = []
    for (place, fraction), with_short in product(enumerate(FRACTIONS), (True, False)):
        threshold = fraction * pace(moved)
        runs = {name: motion_runs(path, threshold) for name, path in paths.items()}
        shorts = {name: [run.short for run in its] for name, its in runs.items()}
        rows = {name: tuple(one for one in its if with_short or not one) for name, its in shorts.items()}
        row, count = max(Counter(rows.values()).items(), key=lambda item: (item[1], len(item[0])))
        agreeing = tuple(name for name in rows if rows[name] == row)
        rank = (count, len(row) > 0, with_short, -abs(place - PREFERRED))
        choices.append((rank, MotionSurvey(threshold, runs, with_short, len(row), agreeing)))
    best = max(choices, key=lambda choice: choice[0])[1]
    turns = [turns_between(paths[name], best.counted(name)) for name in best.agreeing]
    return replace(best, turns_deg=tuple(np.median(turns, axis=0).tolist()))


def turns_between(path: HandPath, runs: Sequence[MotionRun]) -> list[float]:
    """Degrees by which the hand turns from the end of each run to the start of the next."""
    if path.orientation is None:
        return []
    ends = np.array([run.end_s for run in runs[:-1]]) / path.dt
    starts = np.array([run.start_s for run in runs[1:]]) / path.dt
    before, after = (path.orientation[np.round(at).astype(int)] for at in (ends, starts))
    return np.degrees(quaternion.angle_between(before, after)).tolist()


def motion_runs(path: HandPath, threshold: float) -> list[MotionRun]:
    """Runs of a path's speed above a threshold, joined across hesitations, in their order."""
    runs = runs_of_motion(path.speed, threshold, most=len(path.speed))
    if not len(runs):
        return []
    pauses = np.flatnonzero((runs[1:, 0] - runs[:-1, 1]) * path.dt > BRIDGE_S)
    first, last = runs[np.append(0, pauses + 1), 0], runs[np.append(pauses, len(runs) - 1), 1]
    ways = [float(path.speed[a : b + 1].sum() * path.dt) for a, b in zip(first, last, strict=True)]
    return [
        MotionRun(float(a * path.dt), float(b * path.dt), way, way < SHORT_SHARE * max(ways))
        for a, b, way in zip(first, last, ways, strict=True)
    ]
