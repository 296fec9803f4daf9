"""Runs of motion: stretches of a demonstration in which a signal moves, and which may be a primitive.

A run lies above a threshold of the speed. A dip below it may be a pause between two primitives or a
hesitation within one; which of them it is, nobody can tell from the dip. So runs with short dips between them
are candidates both alone and joined, and `run_assignment` decides.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from structlearn.ground import quaternion, signals
from structlearn.ground.errors import InputError
from structlearn.recordings.demonstration import Demonstration
from structlearn.segmentation.parameters import AXES, Axis, BoundParameters, SegmentParameters

FRACTIONS = (0.05, 0.08, 0.13, 0.18, 0.25)
"""Of the pace, tried as thresholds where none is given. Below the first, a hand at rest moves; the last is
for pauses of a third of a second, in which the smoothed speed does not fall far."""

SPARE_RUNS = 8
"""More runs than primitives, of which the longest are kept: the others are the noise of a low threshold."""


@dataclass(frozen=True)
class Motion:
    """What one axis of one demonstration shows; T samples.

    Attributes:
        path: (T, D) heavily smoothed, m or rad.
        smooth_speed: (T,) of it, m/s or rad/s.
        speed: (T,) lightly smoothed.
        turns: whether it is a turn in rad.
    """

    path: np.ndarray
    smooth_speed: np.ndarray
    speed: np.ndarray
    turns: bool


@dataclass(frozen=True)
class Candidates:
    """Stretches of one demonstration that may be one primitive; G of them.

    Attributes:
        first, last: (G,) samples.
        rested: (G,) s of dips that are taken for hesitations.
        duration: (G,) s.
        way: (G,) m or rad, along the path.
        path: (T, D) m or rad, heavily smoothed.
        travelled: (T,) way up to a sample, without what a hand drifts at rest.
        runs: (R, 2) first and last samples of all runs.
        turns: whether it is a turn in rad.
    """

    first: np.ndarray
    last: np.ndarray
    rested: np.ndarray
    duration: np.ndarray
    way: np.ndarray
    path: np.ndarray
    travelled: np.ndarray
    runs: np.ndarray
    turns: bool


def path(demonstration: Demonstration, axis: Axis) -> np.ndarray:
    """(T, D) m of the position; of `rot` (T, 3) rad, the rotations from sample to sample added up.

    The sum of small rotations in the base frame is no orientation, but its derivative is the angular
    velocity, and it has no half turn at which it would jump.

    Raises:
        InputError: the orientation is asked for and was not recorded.
    """
    if axis != "rot":
        return demonstration.position[:, AXES[axis]]
    if demonstration.orientation is None:
        raise InputError(f"{demonstration.name}: has no orientation to find a primitive by")
    q = demonstration.orientation
    return np.vstack([np.zeros(3), np.cumsum(quaternion.difference(q[1:], q[:-1]), axis=0)])


def motion(demonstration: Demonstration, axis: Axis, parameters: SegmentParameters) -> Motion:
    """Path and speeds of one axis.

    Raises:
        InputError: as `path`.
    """
    raw, dt = path(demonstration, axis), demonstration.dt
    smooth = signals.low_pass(raw, dt, parameters.guess_cutoff_hz)
    light = signals.low_pass(raw, dt, parameters.cut_cutoff_hz)
    speeds = [np.linalg.norm(signals.derivative(one, dt), axis=1) for one in (smooth, light)]
    return Motion(smooth, *speeds, turns=axis == "rot")


def pace(motions: Sequence[Motion]) -> float:
    """Speed of the movements of a set of demonstrations, m/s or rad/s: median of the mean along the way.

    Averaged over the way and not over time, rests and twitches hardly count, however long or quick they are.
    """
    means = [np.sum(one.smooth_speed**2) / max(np.sum(one.smooth_speed), 1e-300) for one in motions]
    return float(np.median(means))


def events(demonstration: Demonstration, until: BoundParameters) -> np.ndarray:
    """(E,) samples at which a signal passes a value in the direction asked for.

    Raises:
        InputError: the signal was not recorded.
    """
    values = _signal(demonstration, until.signal)
    passed = values > until.above if until.above is not None else values < until.below
    return np.flatnonzero(passed[1:] & ~passed[:-1]) + 1


def _signal(demonstration: Demonstration, name: str) -> np.ndarray:
    """(T,) of one of `parameters.BoundParameters`."""
    if name == "force" and demonstration.wrench is not None:
        return np.linalg.norm(demonstration.wrench[:, :3], axis=1)
    if name == "tactile" and demonstration.tactile is not None:
        return np.abs(demonstration.tactile - demonstration.tactile[0]).max(axis=1)
    if name in demonstration.joint_names:
        return demonstration.joint_positions[:, demonstration.joint_names.index(name)]
    joints = ", ".join(demonstration.joint_names) or "none"
    raise InputError(
        f"{demonstration.name}: no '{name}' was recorded to find the end of a primitive by; joints: {joints}"
    )


def runs_of_motion(
    smooth_speed: np.ndarray, threshold: float, most: int, breaks: Sequence[int] = ()
) -> np.ndarray:
    """Runs of speed above a threshold.

    Args:
        smooth_speed: (T,) heavily smoothed.
        threshold: in the unit of the speed.
        most: of how many runs the ones of the longest way are kept.
        breaks: samples at which a run ends and the next one begins.

    Returns:
        (R, 2) first and last sample of each, in order of time.
    """
    above = smooth_speed > threshold
    starts = above & ~np.append(False, above[:-1])
    starts[[sample for sample in breaks if above[sample]]] = True
    ends = above & np.append(starts[1:] | ~above[1:], True)
    found = np.stack([np.flatnonzero(starts), np.flatnonzero(ends)], axis=1)
    travelled = np.append(0.0, np.cumsum(smooth_speed))
    way = travelled[found[:, 1] + 1] - travelled[found[:, 0]]
    return found[np.sort(np.argsort(-way, kind="stable")[:most])]


def candidates(
    moved: Motion,
    runs: np.ndarray,
    dt: float,
    bridge: int,
    resting: float,
    ends: np.ndarray | None = None,
) -> Candidates:
    """Runs, and neighbouring runs joined.

    Args:
        moved: the axis.
        runs: (R, 2) of `runs_of_motion`.
        dt: s.
        bridge: longest dip in samples that may be a hesitation.
        resting: speed below which a way does not count: the lowest threshold that is tried, whichever the
            runs are of, so that what a higher one hides is missed all the same.
        ends: (E,) samples, at one of which the primitive ends: a candidate reaches on to the first one before
            the next run, and is none if there is none. None: it ends where its last run does.

    Returns:
        All candidates; there may be none.
    """
    step = np.linalg.norm(np.diff(moved.path, axis=0, prepend=moved.path[:1]), axis=1)
    travelled = np.cumsum(np.where(moved.smooth_speed > resting, step, 0.0))
    rows = []
    for i in range(len(runs)):
        rested = 0
        for j in range(i, len(runs)):
            dip = runs[j, 0] - runs[j - 1, 1] - 1 if j > i else 0
            if dip > bridge:
                break
            rested += dip
            last = runs[j, 1]
            if ends is not None:
                limit = runs[j + 1, 0] if j + 1 < len(runs) else len(step) - 1
                passed = ends[(ends >= last) & (ends <= limit)]
                if len(passed) == 0:
                    continue
                last = passed[0]
            rows.append((runs[i, 0], last, rested))
    first, last, rested = np.array(rows, dtype=int).reshape(-1, 3).T
    return Candidates(
        first,
        last,
        dt * rested,
        dt * (last - first + 1),
        np.maximum(travelled[last] - travelled[first], dt * moved.smooth_speed[first]),  # of one sample: > 0
        moved.path,
        travelled,
        runs,
        moved.turns,
    )
