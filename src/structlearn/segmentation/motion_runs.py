"""Runs of motion: stretches of a demonstration with speed above a threshold, the candidates for primitives.

A dip below the threshold may be a pause between two primitives or a hesitation within one, and the dip alone
does not tell. So runs with short dips between them are candidates both separately and joined, and
`run_assignment` decides.

Start and end of a movement are found by zero-velocity crossing (IV.5, IV.9.1.3). A heavily smoothed speed
finds the movement, a lightly smoothed one places the cut: heavy smoothing spreads an onset over a tenth of a
second, while light smoothing leaves crossings in the noise of a resting hand.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from structlearn.core import quaternion, signals
from structlearn.core.errors import InputError
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.parameters import AXES, Axis, BoundParameters, SegmentParameters

REST_FRACTION = 0.2
"""Fraction of the threshold below which the hand rests. The descent to the local minimum stops there, since
within a rest it would only follow the noise."""


def moving_interval(
    smooth_speed: np.ndarray, speed: np.ndarray, threshold: float, bridge: int, first: int = 0
) -> tuple[int, int]:
    """First and last sample s, e of the largest movement from sample `first` on.

    The run of heavily smoothed speed (T,) above the threshold h that contains its maximum is joined with
    neighbouring runs across dips of at most `bridge` samples (hesitations). From its crossings, the cut
    points descend the lightly smoothed speed (T,) to its local minimum or to rest. Raises ValueError: the
    speed does not cross the threshold; the caller adds whose speed it is.
    """
    above = np.flatnonzero(smooth_speed[first:] > threshold) + first
    if len(above) == 0:
        peak = smooth_speed[first:].max(initial=0.0)
        raise ValueError(f"its speed never exceeds {threshold:g} m/s (largest {peak:.3g} m/s)")
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
    if len(moving) > 0:  # smoothing widens the run: return to the crossing itself
        s, e = s + int(moving[0]), s + int(moving[-1])
    return _descend(speed, s, -1, limits[0], rest), _descend(speed, e, +1, limits[1], rest)


def _descend(speed: np.ndarray, sample: int, step: int, limit: int, rest: float) -> int:
    """Follow the falling speed outwards to its local minimum, to rest or to the limit."""
    while sample != limit and speed[sample] > rest and speed[sample + step] < speed[sample]:
        sample += step
    return sample


FRACTIONS = (0.05, 0.08, 0.13, 0.18, 0.25)
"""Default thresholds, relative to the pace. Below the first, a resting hand already moves; the last is for
pauses of a third of a second, in which the smoothed speed does not fall far."""

LED, STRAYED = 0.02, 0.1
"""Conditions at each dip of a joined candidate, relative to its path length: it has come nearer to its end by
the first, or is away from its start by the second, and likewise backwards. A hesitation lies within a move;
motion that returns, or hardly leaves, is a twitch or noise of a hand beside a move."""

SPARE_RUNS = 8  # longest runs kept beyond the number of primitives; others are noise above a low threshold


MOVED = 0.05
"""Shortest run that counts as other motion, not sway of a resting hand, relative to the path of a move."""


@dataclass(frozen=True)
class AxisMotion:
    """Path and speeds along one axis of a demonstration with T samples."""

    path: np.ndarray  # (T, D) heavily smoothed, m or rad
    smooth_speed: np.ndarray  # (T,) heavily smoothed, m/s or rad/s
    speed: np.ndarray  # (T,) lightly smoothed
    turns: bool  # whether the path is a rotation in rad


@dataclass(frozen=True)
class Strokes:
    """A run of at least two strokes."""

    ends: np.ndarray  # (N, 2) first and last sample of each
    share: np.ndarray  # (N,) of half a cycle that each covers: 1, but for the ends of a round run
    way: np.ndarray  # (D,) m, displacement of the first; 0 of a round run

    @property
    def number(self) -> float:
        """Number of strokes, two per cycle."""
        return float(self.share.sum())

    @property
    def samples(self) -> float:
        """Samples per stroke; the period is two strokes."""
        return float(self.ends[-1, 1] - self.ends[0, 0] + 1) / self.number


@dataclass(frozen=True)
class Candidates:
    """G candidate stretches of one demonstration for one primitive."""

    first: np.ndarray  # (G,) sample of the cut
    last: np.ndarray  # (G,)
    paused_s: np.ndarray  # (G,) s of dips counted as hesitations
    duration: np.ndarray  # (G,) s
    path_length: np.ndarray  # (G,) m or rad, path length
    path: np.ndarray  # (T, D) m or rad, heavily smoothed
    travelled: np.ndarray  # (T,) path length up to a sample, without the drift of a resting hand
    runs: np.ndarray  # (R, 2) first and last samples of the runs at the lowest threshold
    turns: bool  # whether the path is a rotation in rad
    # (G,) strokes of which each consists, else empty; duration and path length are then those of a stroke
    strokes: tuple[Strokes, ...] = ()

    @property
    def displacement(self) -> np.ndarray:
        """(G, D) from start to end; of strokes, of the first one."""
        if self.strokes:
            return np.array([strokes.way for strokes in self.strokes])
        return self.path[self.last] - self.path[self.first]


def path(demonstration: Demonstration, axis: Axis) -> np.ndarray:
    """Path along an axis: (T, D) m of the position; for `rot` (T, 3) rad, the sum of sample-to-sample turns.

    The sum of small rotations in the base frame is not an orientation, but its derivative is the angular
    velocity, and it does not jump at half a turn. Raises InputError: the orientation was not recorded.
    """
    if axis != "rot":
        position = demonstration.position
        return position[:, AXES.get(axis, list(range(position.shape[1])))]
    if demonstration.orientation is None:
        raise InputError(f"{demonstration.name}: has no orientation to find a primitive by")
    q = demonstration.orientation
    return np.vstack([np.zeros(3), np.cumsum(quaternion.difference(q[1:], q[:-1]), axis=0)])


def motion(demonstration: Demonstration, axis: Axis, parameters: SegmentParameters) -> AxisMotion:
    """Path and speeds of one axis. Raises InputError: as `path`."""
    raw, dt = path(demonstration, axis), demonstration.dt
    smooth = signals.low_pass(raw, dt, parameters.guess_cutoff_hz)
    light = signals.low_pass(raw, dt, parameters.cut_cutoff_hz)
    speeds = [np.linalg.norm(signals.derivative(filtered, dt), axis=1) for filtered in (smooth, light)]
    if parameters.assigns_runs:  # the largest movement is found regardless of the ends
        cutoffs_hz = (parameters.guess_cutoff_hz, parameters.cut_cutoff_hz)
        speeds = [_without_ends(*pair, dt) for pair in zip(speeds, cutoffs_hz, strict=True)]
    smooth_speed, speed = speeds
    return AxisMotion(smooth, smooth_speed, speed, turns=axis == "rot")


def _without_ends(speed: np.ndarray, cutoff_hz: float, dt: float) -> np.ndarray:
    """Speed, limited near the ends of a recording to its value half a low-pass period inside.

    At its ends the low-pass is one-sided and follows noise, so that a resting hand seems to move.
    """
    count = min(round(0.5 / (cutoff_hz * dt)), len(speed) - 1)
    limited = speed.copy()
    limited[:count] = np.minimum(speed[:count], speed[count])
    limited[-count - 1 :] = np.minimum(limited[-count - 1 :], limited[-count - 1])
    return limited


def pace(motions: Sequence[AxisMotion]) -> float:
    """Typical speed of the movements of a set of demonstrations, m/s or rad/s: median of path-weighted means.

    Weighting by path instead of time makes rests and twitches almost irrelevant, however long or quick.
    """
    means = [np.sum(motion.smooth_speed**2) / max(np.sum(motion.smooth_speed), 1e-300) for motion in motions]
    return float(np.median(means))


def events(demonstration: Demonstration, until: BoundParameters) -> np.ndarray:
    """Samples (E,) at which a signal passes a value in one direction. Raises InputError: not recorded."""
    values = _signal(demonstration, until.signal)
    passed = values > until.above if until.above is not None else values < until.below
    return np.flatnonzero(passed[1:] & ~passed[:-1]) + 1


def _signal(demonstration: Demonstration, name: str) -> np.ndarray:
    """(T,) one of the signals of `parameters.BoundParameters`."""
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

    `most`: number of runs kept, the longest. `breaks`: samples at which a new run begins.
    """
    above = smooth_speed > threshold
    starts = above & ~np.append(False, above[:-1])
    starts[[sample for sample in breaks if above[sample]]] = True
    ends = above & np.append(starts[1:] | ~above[1:], True)
    runs = np.stack([np.flatnonzero(starts), np.flatnonzero(ends)], axis=1)
    travelled = np.append(0.0, np.cumsum(smooth_speed))
    path_length = travelled[runs[:, 1] + 1] - travelled[runs[:, 0]]
    return runs[np.sort(np.argsort(-path_length, kind="stable")[:most])]


@dataclass(frozen=True)
class CandidateSearch:
    """Parameters of the search for candidates."""

    thresholds: Sequence[float]  # of the speed, in rising order
    dt: float  # s
    bridge: int  # longest dip in samples that may be a hesitation
    most: int  # number of runs considered, see `runs_of_motion`
    breaks: Sequence[int] = ()  # samples at which runs end, whatever the speed
    # (E,) samples of the events that end the primitive: a candidate extends to the first event before the
    # next run, and is dropped if there is none. None: it ends with its last run.
    ends: np.ndarray | None = None
    # samples of the events that begin it: all motion up to the next of `ends` is then a candidate, including
    # strokes back and forth
    begins: Sequence[int] | np.ndarray = ()


def run_candidates(moved: AxisMotion, search: CandidateSearch) -> Candidates:
    """Candidates: runs at every threshold, and neighbouring runs joined, each cut at its ends; may be empty.

    Long pauses show at all thresholds, short ones only at a high threshold.
    """
    step = np.linalg.norm(np.diff(moved.path, axis=0, prepend=moved.path[:1]), axis=1)
    travelled = np.cumsum(np.where(moved.smooth_speed > search.thresholds[0], step, 0.0))
    paused: dict[tuple[int, int], int] = {}  # by ends: the shortest rest over the thresholds
    for threshold in search.thresholds:
        runs = runs_of_motion(moved.smooth_speed, threshold, search.most, search.breaks)
        for i, j, dips in _joined(runs, search.bridge):
            if not _leads(moved.path, travelled, runs[i : j + 1]):
                continue
            ends = _ends(moved, runs, i, j, threshold, search)
            if ends is not None:
                paused[ends] = min(dips, paused.get(ends, dips))
    paused |= dict.fromkeys(_between_events(moved, search), 0)
    first, last = np.array(sorted(paused), dtype=int).reshape(-1, 2).T
    path_length = np.maximum(travelled[last] - travelled[first], search.dt * search.thresholds[0])  # > 0
    return Candidates(
        first,
        last,
        search.dt * np.array([paused[ends] for ends in sorted(paused)]),
        search.dt * (last - first + 1),
        path_length,
        moved.path,
        travelled,
        runs_of_motion(moved.smooth_speed, search.thresholds[0], search.most),
        moved.turns,
    )


def _between_events(moved: AxisMotion, search: CandidateSearch) -> Iterator[tuple[int, int]]:
    """First moving sample after each event that begins a primitive, and the next event that ends it."""
    ends = np.array([], dtype=int) if search.ends is None else search.ends
    for begin in search.begins:
        for end in ends[ends > begin][:1]:
            moving = np.flatnonzero(moved.smooth_speed[begin:end] > search.thresholds[0])
            if len(moving):
                yield int(begin + moving[0]), int(end)


def _joined(runs: np.ndarray, bridge: int) -> Iterator[tuple[int, int, int]]:
    """First and last run of neighbours joined across short dips, and the total length of the dips."""
    for i in range(len(runs)):
        dips = 0
        for j in range(i, len(runs)):
            dip = int(runs[j, 0] - runs[j - 1, 1]) - 1 if j > i else 0
            if dip > bridge:
                break
            dips += dip
            yield i, j, dips


def _leads(path: np.ndarray, travelled: np.ndarray, runs: np.ndarray) -> bool:
    """Whether joined runs make progress before and after each dip between them (`LED`)."""
    start, end = path[runs[0, 0]], path[runs[-1, 1]]
    path_length = travelled[runs[-1, 1]] - travelled[runs[0, 0]]
    for dips, here, there in ((path[runs[1:, 0]], start, end), (path[runs[:-1, 1]], end, start)):
        led = np.linalg.norm(here - there) - np.linalg.norm(dips - there, axis=1)
        strayed = np.linalg.norm(dips - here, axis=1)
        if np.any((led < LED * path_length) & (strayed < STRAYED * path_length)):
            return False
    return True


def _ends(
    moved: AxisMotion, runs: np.ndarray, i: int, j: int, threshold: float, search: CandidateSearch
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
