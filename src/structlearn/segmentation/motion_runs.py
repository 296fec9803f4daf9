"""Runs of motion: stretches of a demonstration above a threshold of the speed, which may be a primitive.

A dip below the threshold may be a pause between two primitives or a hesitation within one; the dip alone does
not tell. So runs with short dips between them are candidates both alone and joined, and `run_assignment`
decides.

Start and end of a movement are found by zero-velocity crossing (IV.5, IV.9.1.3). A heavily smoothed speed
finds the movement, a lightly smoothed one places the cut: heavy smoothing spreads an onset over a tenth of a
second, light smoothing leaves crossings in the noise of a hand at rest.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from structlearn.core import quaternion, signals
from structlearn.core.errors import InputError
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.parameters import AXES, Axis, BoundParameters, SegmentParameters

REST_FRACTION = 0.2
"""Fraction of the threshold below which the point rests; the descent to the local minimum stops there, since
within a resting hand it would continue to the next minimum of the noise."""


def moving_interval(
    smooth_speed: np.ndarray, speed: np.ndarray, threshold: float, bridge: int, first: int = 0
) -> tuple[int, int]:
    """First and last sample s, e of the largest movement from the sample `first` on.

    The run of heavily smoothed speed (T,) above the threshold h that holds its maximum is joined with
    neighbouring runs across dips of at most `bridge` samples (a hesitation is not an end). From its crossings
    the cut points descend the lightly smoothed speed (T,) to its local minimum, or to rest. Raises
    InputError: the speed does not cross the threshold; the caller adds whose speed it is.
    """
    above = np.flatnonzero(smooth_speed[first:] > threshold) + first
    if len(above) == 0:
        peak = smooth_speed[first:].max(initial=0.0)
        raise InputError(f"its speed never exceeds {threshold:g} m/s (largest {peak:.3g} m/s)")
    runs = np.split(above, np.flatnonzero(np.diff(above) > bridge + 1) + 1)
    run = max(runs, key=lambda samples: smooth_speed[samples].max())
    rest = REST_FRACTION * threshold
    return cut_points(speed, (int(run[0]), int(run[-1])), threshold, rest, (first, len(speed) - 1))


def cut_points(
    speed: np.ndarray, run: tuple[int, int], threshold: float, rest: float, limits: tuple[int, int]
) -> tuple[int, int]:
    """First and last sample of a movement, from a run of its heavily smoothed speed above the threshold.

    `speed`: (T,) lightly smoothed. `rest`: speed below which it counts as resting.
    """
    s, e = run
    moving = np.flatnonzero(speed[s : e + 1] > threshold)
    if len(moving) > 0:  # smoothing reaches beyond the movement: come back to the crossing itself
        s, e = s + int(moving[0]), s + int(moving[-1])
    return _descend(speed, s, -1, limits[0], rest), _descend(speed, e, +1, limits[1], rest)


def _descend(speed: np.ndarray, sample: int, step: int, limit: int, rest: float) -> int:
    """Follow the falling speed outwards to its local minimum, to rest or to the limit."""
    while sample != limit and speed[sample] > rest and speed[sample + step] < speed[sample]:
        sample += step
    return sample


FRACTIONS = (0.05, 0.08, 0.13, 0.18, 0.25)
"""Of the pace, the thresholds if none is given. Below the first, a hand at rest moves; the last is for pauses
of a third of a second, in which the smoothed speed does not fall far."""

LED, STRAYED = 0.02, 0.1
"""In ways of a candidate: at each of its dips it has come nearer to its end by the first, or is away from its
start by the second, and likewise backwards. A hesitation lies within a move; what comes back, or hardly
leaves, is a twitch or the noise of a hand beside one."""

SPARE_RUNS = 8  # kept beyond the number of primitives, the longest; others are noise above a low threshold


MOVED = 0.05
"""Shortest way of a run, in ways of a move, that is other motion beside it, and no sway of a resting hand."""


@dataclass(frozen=True)
class Motion:
    """Path and speeds of one axis of one demonstration; T samples."""

    path: np.ndarray  # (T, D) heavily smoothed, m or rad
    smooth_speed: np.ndarray  # (T,) of it, m/s or rad/s
    speed: np.ndarray  # (T,) lightly smoothed
    turns: bool  # whether it is a turn in rad


@dataclass(frozen=True)
class Candidates:
    """G stretches of one demonstration that may be one primitive."""

    first: np.ndarray  # (G,) sample, where it is cut
    last: np.ndarray  # (G,)
    rested: np.ndarray  # (G,) s of dips that are taken for hesitations
    duration: np.ndarray  # (G,) s
    way: np.ndarray  # (G,) m or rad, along the path
    path: np.ndarray  # (T, D) m or rad, heavily smoothed
    travelled: np.ndarray  # (T,) way up to a sample, without the drift of a hand at rest
    runs: np.ndarray  # (R, 2) first and last samples of the runs at the lowest threshold
    turns: bool  # whether it is a turn in rad


def path(demonstration: Demonstration, axis: Axis) -> np.ndarray:
    """(T, D) m of the position; of `rot` (T, 3) rad, the rotations from sample to sample added up.

    The sum of small rotations in the base frame is no orientation, but its derivative is the angular
    velocity, and it has no half turn at which it would jump. Raises InputError: the orientation is asked for
    and was not recorded.
    """
    if axis != "rot":
        return demonstration.position[:, AXES[axis]]
    if demonstration.orientation is None:
        raise InputError(f"{demonstration.name}: has no orientation to find a primitive by")
    q = demonstration.orientation
    return np.vstack([np.zeros(3), np.cumsum(quaternion.difference(q[1:], q[:-1]), axis=0)])


def motion(demonstration: Demonstration, axis: Axis, parameters: SegmentParameters) -> Motion:
    """Path and speeds of one axis. Raises InputError: as `path`."""
    raw, dt = path(demonstration, axis), demonstration.dt
    smooth = signals.low_pass(raw, dt, parameters.guess_cutoff_hz)
    light = signals.low_pass(raw, dt, parameters.cut_cutoff_hz)
    speeds = [np.linalg.norm(signals.derivative(one, dt), axis=1) for one in (smooth, light)]
    if parameters.assigns_runs:  # the largest movement is found whatever the ends show
        cutoffs_hz = (parameters.guess_cutoff_hz, parameters.cut_cutoff_hz)
        speeds = [_without_ends(*pair, dt) for pair in zip(speeds, cutoffs_hz, strict=True)]
    smooth_speed, speed = speeds
    return Motion(smooth, smooth_speed, speed, turns=axis == "rot")


def _without_ends(speed: np.ndarray, cutoff_hz: float, dt: float) -> np.ndarray:
    """A speed limited near a recording's ends to its value half a period of the low-pass inside.

    At the ends the low-pass sees one side alone and follows its noise: a hand at rest seems to move.
    """
    count = min(round(0.5 / (cutoff_hz * dt)), len(speed) - 1)
    limited = speed.copy()
    limited[:count] = np.minimum(speed[:count], speed[count])
    limited[-count - 1 :] = np.minimum(limited[-count - 1 :], limited[-count - 1])
    return limited


def pace(motions: Sequence[Motion]) -> float:
    """Speed of the movements of a set of demonstrations, m/s or rad/s: median of the mean along the way.

    In an average over the way, not over time, rests and twitches hardly count, however long or quick.
    """
    means = [np.sum(one.smooth_speed**2) / max(np.sum(one.smooth_speed), 1e-300) for one in motions]
    return float(np.median(means))


def events(demonstration: Demonstration, until: BoundParameters) -> np.ndarray:
    """Samples (E,) at which a signal passes a value in one direction; InputError if it was not recorded."""
    values = _signal(demonstration, until.signal)
    passed = values > until.above if until.above is not None else values < until.below
    return np.flatnonzero(passed[1:] & ~passed[:-1]) + 1


def _signal(demonstration: Demonstration, name: str) -> np.ndarray:
    """(T,) of one of `parameters.BoundParameters`."""
    if name == "force" and demonstration.wrench is not None:
        return np.linalg.norm(demonstration.wrench[:, :3], axis=1)
    if name == "tactile" and demonstration.tactile is not None:
        return np.abs(demonstration.tactile - demonstration.tactile[0]).max(axis=1)
    if name in demonstration.joint_names and demonstration.joint_positions is not None:
        return demonstration.joint_positions[:, demonstration.joint_names.index(name)]
    joints = ", ".join(demonstration.joint_names) or "none"
    raise InputError(
        f"{demonstration.name}: no '{name}' was recorded to find the end of a primitive by; joints: {joints}"
    )


def runs_of_motion(
    smooth_speed: np.ndarray, threshold: float, most: int, breaks: Sequence[int] = ()
) -> np.ndarray:
    """First and last samples (R, 2) of the runs of speed (T,) above a threshold, in order of time.

    `most`: number of runs kept, those of the longest way. `breaks`: samples at which the next run begins.
    """
    above = smooth_speed > threshold
    starts = above & ~np.append(False, above[:-1])
    starts[[sample for sample in breaks if above[sample]]] = True
    ends = above & np.append(starts[1:] | ~above[1:], True)
    found = np.stack([np.flatnonzero(starts), np.flatnonzero(ends)], axis=1)
    travelled = np.append(0.0, np.cumsum(smooth_speed))
    way = travelled[found[:, 1] + 1] - travelled[found[:, 0]]
    return found[np.sort(np.argsort(-way, kind="stable")[:most])]


@dataclass(frozen=True)
class Search:
    """Parameters of the search for candidates."""

    thresholds: Sequence[float]  # of the speed, the lowest first
    dt: float  # s
    bridge: int  # longest dip in samples that may be a hesitation
    most: int  # runs that are looked at, see `runs_of_motion`
    breaks: Sequence[int] = ()  # samples at which runs end, whatever the speed
    # (E,) samples, at one of which the primitive ends: a candidate reaches on to the first one before the
    # next run, and is none if there is none. None: it ends where its last run does.
    ends: np.ndarray | None = None
    # samples, at one of which it begins: then whatever moves up to the next of `ends` is a candidate, also
    # strokes to and fro that lead nowhere
    begins: Sequence[int] | np.ndarray = ()


def candidates(moved: Motion, search: Search) -> Candidates:
    """Runs at every threshold, and neighbouring runs joined, each cut at its ends; there may be none.

    Long pauses show at all thresholds, short ones at a high threshold alone.
    """
    step = np.linalg.norm(np.diff(moved.path, axis=0, prepend=moved.path[:1]), axis=1)
    travelled = np.cumsum(np.where(moved.smooth_speed > search.thresholds[0], step, 0.0))
    rested: dict[tuple[int, int], int] = {}  # by ends, at the threshold at which it rests least
    for threshold in search.thresholds:
        runs = runs_of_motion(moved.smooth_speed, threshold, search.most, search.breaks)
        for i, j, dips in _joined(runs, search.bridge):
            if not _leads(moved.path, travelled, runs[i : j + 1]):
                continue
            ends = _ends(moved, runs, i, j, threshold, search)
            if ends is not None:
                rested[ends] = min(dips, rested.get(ends, dips))
    rested |= dict.fromkeys(_between_events(moved, search), 0)
    first, last = np.array(sorted(rested), dtype=int).reshape(-1, 2).T
    way = np.maximum(travelled[last] - travelled[first], search.dt * search.thresholds[0])  # > 0
    return Candidates(
        first,
        last,
        search.dt * np.array([rested[ends] for ends in sorted(rested)]),
        search.dt * (last - first + 1),
        way,
        moved.path,
        travelled,
        runs_of_motion(moved.smooth_speed, search.thresholds[0], search.most),
        moved.turns,
    )


def _between_events(moved: Motion, search: Search) -> Iterator[tuple[int, int]]:
    """First moving sample after each event that begins a primitive, and the next event that ends it."""
    ends = np.array([], dtype=int) if search.ends is None else search.ends
    for begin in search.begins:
        for end in ends[ends > begin][:1]:
            moving = np.flatnonzero(moved.smooth_speed[begin:end] > search.thresholds[0])
            if len(moving):
                yield int(begin + moving[0]), int(end)


def _joined(runs: np.ndarray, bridge: int) -> Iterator[tuple[int, int, int]]:
    """First and last run of neighbours with short dips between them, and the total length of the dips."""
    for i in range(len(runs)):
        dips = 0
        for j in range(i, len(runs)):
            dip = int(runs[j, 0] - runs[j - 1, 1]) - 1 if j > i else 0
            if dip > bridge:
                break
            dips += dip
            yield i, j, dips


def _leads(path: np.ndarray, travelled: np.ndarray, runs: np.ndarray) -> bool:
    """Whether joined runs lead somewhere before, and after, each dip between them (`LED`)."""
    start, end = path[runs[0, 0]], path[runs[-1, 1]]
    way = travelled[runs[-1, 1]] - travelled[runs[0, 0]]
    for dips, here, there in ((path[runs[1:, 0]], start, end), (path[runs[:-1, 1]], end, start)):
        led = np.linalg.norm(here - there) - np.linalg.norm(dips - there, axis=1)
        strayed = np.linalg.norm(dips - here, axis=1)
        if np.any((led < LED * way) & (strayed < STRAYED * way)):
            return False
    return True


def _ends(
    moved: Motion, runs: np.ndarray, i: int, j: int, threshold: float, search: Search
) -> tuple[int, int] | None:
    """First and last sample of a primitive of runs i to j; None if no event ends it that should."""
    last_sample = len(moved.path) - 1
    limits = int(runs[i - 1, 1]) if i else 0, int(runs[j + 1, 0]) if j + 1 < len(runs) else last_sample
    run = int(runs[i, 0]), int(runs[j, 1])
    first, last = cut_points(moved.speed, run, threshold, REST_FRACTION * search.thresholds[0], limits)
    first = run[0] if run[0] in search.breaks else first
    last = run[1] + 1 if run[1] + 1 in search.breaks else last
    if search.ends is None:
        return first, last
    passed = search.ends[(search.ends >= run[1]) & (search.ends <= limits[1])]
    return (first, int(passed[0])) if len(passed) else None
