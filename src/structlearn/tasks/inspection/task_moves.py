"""Moves of a task without an entry: repeats in a session, turns in place, strokes without pauses.

The survey of motion counts runs of translation. Here, turns between them become primitives of their own, a
sequence that recurs becomes repeats, and the cutter itself judges the number: if it warns, more moves are
tried, since a hand that goes to and fro need not rest, and then strokes of any number.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from structlearn.core import quaternion, signals
from structlearn.core.errors import InputError
from structlearn.core.params import merged
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.motion_runs import FRACTIONS
from structlearn.segmentation.repeats import split_repeats
from structlearn.segmentation.segments import cut
from structlearn.tasks.inspection.hand_motion import (
    PREFERRED,
    SHORT_SHARE,
    SPEED_HZ,
    HandPath,
    MotionRun,
    MotionSurvey,
    joined_runs,
)
from structlearn.tasks.kinds import kind_defaults
from structlearn.tasks.movement.parameters import TaskSegmentParameters

OWN_TURN_DEG = 15.0  # net rotation from which a turn in place is a primitive; hands sway by less
OVERLAP = 0.3  # share of a turn's duration that may be translation, since hands turn before they have arrived

FEWEST_REPEATS = 3  # of a sequence of moves in each recording, for repeats; strokes go to and fro twice
ALIKE = 0.35  # mean difference of displacements between repeats, relative to their mean length

BACK = -0.5  # cosine of the angle between two strokes below which the hand turns back
MORE_MOVES = 8  # moves tried beyond the runs of motion
AROUND_STROKES = ((1, 1), (1, 0), (0, 1), (0, 0), (2, 1), (1, 2), (2, 2))  # moves before and after, as tried
VARYING_CYCLES = 0.4  # difference between demonstrations: a stroke is half a cycle
TRIED = 12  # demonstrations tried, spread evenly
TRIAL_DT_S = 0.01


class TaskMoves(NamedTuple):
    """Primitives of a task in temporal order, as in an entry, and how often each recording repeats them."""

    primitives: int | list[dict[str, str]]
    repeats: int = 0  # in all recordings; 0: they are not split
    more: int = 0  # moves beyond the runs of motion
    flagged: int = 0  # demonstrations of those tried with a cut warning or without a cut
    tried: int = 0


def task_moves(paths: Mapping[str, HandPath], motion: MotionSurvey | None) -> TaskMoves:
    """Moves of a task by its hand's paths and their runs of motion."""
    if motion is None or motion.number == 0:
        return TaskMoves(1)
    names = list(paths)
    runs = [_demonstration(name, paths[name]) for name in names[:: -(-len(names) // TRIED)]]
    for moves in range(2, motion.number // FEWEST_REPEATS + 1):
        if repeats := _repeats(paths, motion, moves, runs):
            return TaskMoves(moves, repeats)
    turns = turns_in_place(paths, motion)
    if any(turns):
        axes = ["xyz"] * motion.number
        for place, count in reversed(list(enumerate(turns))):
            axes[place:place] = ["rot"] * count
        named = _named(axes)
        return TaskMoves(named, flagged=_flagged(runs, named), tried=len(runs))
    flagged = _flagged(runs, motion.number)
    back = Counter(reversals(paths[name], motion.counted(name)) for name in motion.agreeing)
    ((most, _),) = back.most_common(1)
    for more in dict.fromkeys([most or 1, *range(1, MORE_MOVES + 1)]) if flagged else ():
        if not _flagged(runs, motion.number + more):
            return TaskMoves(motion.number + more, more=more, tried=len(runs))
    for before, after in AROUND_STROKES if flagged else ():
        axes = [*["xyz"] * before, "strokes", *["xyz"] * after]
        if _strokes_vary(runs, named := _named(axes)):
            return TaskMoves(named, tried=len(runs))
    return TaskMoves(motion.number, flagged=flagged, tried=len(runs))


def _named(axes: Sequence[str]) -> list[dict[str, str]]:
    """Primitives of an entry, by their axes."""
    return [{"name": f"move_{place}", "axis": axis} for place, axis in enumerate(axes, start=1)]


def reversals(path: HandPath, moves: Sequence[MotionRun]) -> int:
    """Number of times that the hand turns back within its runs of motion, without a rest."""
    count = 0
    for move in moves:
        first, last = round(move.start_s / path.dt), round(move.end_s / path.dt)
        inner = path.speed[first + 1 : last]
        slow = (inner <= path.speed[first : last - 1]) & (inner < path.speed[first + 2 : last + 1])
        ends = np.array([first, *(first + 1 + np.flatnonzero(slow)), last])
        steps = np.diff(path.position[ends], axis=0)
        steps = steps[np.linalg.norm(steps, axis=1) > SHORT_SHARE * move.path_length]
        headings = steps / np.linalg.norm(steps, axis=1, keepdims=True)
        count += int(np.sum(np.sum(headings[1:] * headings[:-1], axis=1) < BACK))
    return count


def turns_in_place(paths: Mapping[str, HandPath], motion: MotionSurvey) -> tuple[int, ...]:
    """Number of turns before each run and after the last, in most of the agreeing demonstrations."""
    seen = [paths[name] for name in motion.agreeing]
    if any(path.orientation is None for path in seen):
        return ()
    speeds = [_angular_speed(path) for path in seen]
    pace = float(np.median([np.sum(speed**2) / max(np.sum(speed), 1e-300) for speed in speeds]))
    choices = []
    for place, fraction in enumerate(FRACTIONS):
        rows = Counter(
            _turns(path, joined_runs(speed, fraction * pace, path.dt), motion.counted(name))
            for name, path, speed in zip(motion.agreeing, seen, speeds, strict=True)
        )
        row, count = max(rows.items(), key=lambda item: (item[1], sum(item[0])))
        choices.append(((count, -abs(place - PREFERRED)), row))
    return max(choices)[1]


def _turns(path: HandPath, turns: np.ndarray, moves: Sequence[MotionRun]) -> tuple[int, ...]:
    """Number of turns (R, 2) in place before each move and after the last."""
    counts = [0] * (len(moves) + 1)
    assert path.orientation is not None
    for first, last in turns.tolist():
        turned = float(quaternion.angle_between(path.orientation[first], path.orientation[last]))
        start, end = first * path.dt, last * path.dt
        moved = sum(max(0.0, min(end, move.end_s) - max(start, move.start_s)) for move in moves)
        if np.degrees(turned) >= OWN_TURN_DEG and moved <= OVERLAP * (end - start):
            counts[sum(move.end_s < 0.5 * (start + end) for move in moves)] += 1
    return tuple(counts)


def _angular_speed(path: HandPath) -> np.ndarray:
    """(T,) rad/s, smoothed as the hand's speed is."""
    assert path.orientation is not None
    steps = quaternion.difference(path.orientation[1:], path.orientation[:-1])
    turned = signals.low_pass(np.vstack([np.zeros(3), np.cumsum(steps, axis=0)]), path.dt, SPEED_HZ)
    return np.linalg.norm(signals.derivative(turned, path.dt), axis=1)


def _repeats(
    paths: Mapping[str, HandPath], motion: MotionSurvey, moves: int, runs: Sequence[Demonstration]
) -> int:
    """Number of repeats of so many moves in all recordings; 0 if the moves do not recur."""
    total = 0
    for name, path in paths.items():
        seen = motion.counted(name)
        if len(seen) % moves or len(seen) < FEWEST_REPEATS * moves:
            return 0
        ends = np.array([(run.start_s, run.end_s) for run in seen]) / path.dt
        first, last = path.position[ends.round().astype(int)].swapaxes(0, 1)
        displacement = last - first
        unlike = np.linalg.norm(displacement[moves:] - displacement[:-moves], axis=1).mean()
        if unlike > ALIKE * np.linalg.norm(displacement, axis=1).mean():
            return 0
        total += len(seen) // moves
    try:
        _, table = split_repeats(runs, _cutting(moves), None)
    except InputError:
        return 0
    wanted = sum(len(motion.counted(run.name)) // moves for run in runs)
    return total if len(table) == wanted else 0


def _flagged(runs: Sequence[Demonstration], primitives: int | list[dict[str, str]]) -> int:
    """Number of demonstrations that cannot be cut, or only with a warning."""
    try:
        cuts = cut(runs, _cutting(primitives))
    except InputError:
        return len(runs)
    return len(set(cuts.warnings["demonstration"]) | set(cuts.left_out["demonstration"]))


def uncut(paths: Mapping[str, HandPath], moves: TaskMoves) -> dict[str, str]:
    """Demonstrations that cannot be cut into these moves, with the reasons.

    None if most cannot, since then the cutter refuses all, nor of recordings to be split into repeats.
    """
    if moves.repeats or moves.tried == 0:
        return {}
    try:
        cuts = cut([_demonstration(*pair) for pair in paths.items()], _cutting(moves.primitives))
    except InputError:
        return {}
    return dict(zip(cuts.left_out["demonstration"], cuts.left_out["reason"], strict=True))


def _strokes_vary(runs: Sequence[Demonstration], primitives: list[dict[str, str]]) -> bool:
    """Whether all demonstrations can be cut without a warning, and differ in their number of strokes."""
    try:
        cuts = cut(runs, _cutting(primitives))
    except InputError:
        return False
    cycles = cuts.strokes.groupby("demonstration")["cycle"].agg(np.ptp)
    return not len(cuts.warnings) and len(cycles) == len(runs) and float(np.ptp(cycles)) > VARYING_CYCLES


def _cutting(primitives: int | list[dict[str, str]]) -> TaskSegmentParameters:
    own = {"primitives": primitives, "skip_failures": True}
    return TaskSegmentParameters.model_validate(merged(kind_defaults("movement")["segment"], own))


def _demonstration(name: str, path: HandPath) -> Demonstration:
    """A path on the clock of trials."""
    own = np.arange(len(path.recorded)) * path.dt
    time = np.arange(round(own[-1] / TRIAL_DT_S)) * TRIAL_DT_S
    position = np.stack([np.interp(time, own, column) for column in path.recorded.T], axis=1)
    turned = None if path.orientation is None else quaternion.interpolate(time, own, path.orientation)
    return Demonstration(name, time, position, turned)
