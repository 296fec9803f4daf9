"""Motion of the hand in recordings without an entry: source of its poses, and number of moves.

No speed threshold suits all tasks, so the same candidates are tried as in cutting. At each threshold, a
demonstration is a sequence of long and short runs. The sequence common to most demonstrations is the task;
short runs count if they occur at the same places too.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from structlearn.core import quaternion, signals
from structlearn.core.errors import InputError
from structlearn.readers.demonstration import Stream
from structlearn.readers.source import JointPose, TransformPose
from structlearn.rigid_body.urdf import HANDS
from structlearn.segmentation.motion_runs import FRACTIONS, AxisMotion, pace, runs_of_motion
from structlearn.tasks.inspection.clocks import Stamps, stamp_statistics

# Hz, low-pass of positions before differentiation: as used for finding a movement
SPEED_HZ = 2.0
MOST_TICKS = 10**7  # of a uniform clock; more indicate stamps years apart
LEAST_EXTENT_M = 0.01  # least extent of a hand's motion; less is sway

# Share of the largest distance travelled from which frames of a tree count as alike; names then decide
ALIKE = 0.9

# Index of the preferred threshold among equally good ones: low, to keep slow moves, but above sway
PREFERRED = 1
BRIDGE_S = 0.2  # s; shorter dips in speed are hesitations, since intended stops last longer

# Share of a demonstration's longest run below which a run is short: idle, unless all demonstrations have it
SHORT_SHARE = 0.1


class JointMotion(NamedTuple):
    """The joints on a topic, in place of a pose: nothing else tells how the hand moves."""

    topic: str


PoseSource = str | TransformPose | JointPose | JointMotion
# Types of pose sources, the most likely for the hand first; a string is a topic of poses
KINDS = (str, TransformPose, JointPose, JointMotion)


class HandPath(NamedTuple):
    """Positions (T, 3) m and speeds (T,) m/s of one pose source in one file, on a uniform clock.

    `recorded` (T, 3) m: positions before they are smoothed. `orientation` (T, 4) is None if a quaternion has
    norm 0. Of joints (T, J), without orientation, in their unit instead of m.
    """

    dt: float
    position: np.ndarray
    speed: np.ndarray
    orientation: np.ndarray | None
    stamps: Stamps
    recorded: np.ndarray

    @property
    def extent_m(self) -> float:
        """Diagonal of the path's bounding box in m."""
        return float(np.linalg.norm(np.ptp(self.position, axis=0)))


def hand_path(stream: Stream) -> HandPath:
    """Path of a stream of poses or joints; disordered stamps are sorted, non-finite values left out.

    Raises InputError: fewer than three samples remain, or stamps are too far apart for a uniform clock.
    """
    finite = np.isfinite(stream.values).all(axis=1)
    stamps, places = np.unique(stream.stamps[finite], return_index=True)
    values, topic = stream.values[finite][places], stream.topic
    if len(stamps) < 3:
        raise InputError(f"{topic} has {len(stamps)} samples, fewer than three")
    dt = 1e-9 * float(np.median(np.diff(stamps)))
    time = 1e-9 * (stamps - stamps[0])
    if time[-1] > MOST_TICKS * dt:
        raise InputError(f"{topic} has stamps that lie {time[-1]:.3g} s apart, {dt:.3g} s as a rule")
    ticks = np.arange(int(time[-1] / dt) + 1) * dt
    if len(ticks) < 3:
        raise InputError(f"{topic} has samples at fewer than three ticks of {dt:.3g} s")
    of_joints = stream.kind != "pose"
    columns = values if of_joints else values[:, :3]
    raw = np.stack([np.interp(ticks, time, column) for column in columns.T], axis=1)
    position = signals.low_pass(raw, dt, SPEED_HZ)
    speed = np.linalg.norm(signals.derivative(position, dt), axis=1)
    norms = np.linalg.norm(values[:, 3:], axis=1)
    turned = None
    if not of_joints and (norms > 0.0).all():
        turned = quaternion.interpolate(np.minimum(ticks, time[-1]), time, values[:, 3:] / norms[:, None])
    return HandPath(dt, position, speed, turned, stamp_statistics(stream.stamps), raw)


class HandCandidate(NamedTuple):
    """A pose source with its paths by file, and the medians of their extents and lengths in m."""

    source: PoseSource
    paths: dict[str, HandPath]
    extent: float
    travelled: float

    @property
    def moves(self) -> bool:
        """Whether the motion is more than sway."""
        return self.extent >= LEAST_EXTENT_M


def pose_words(source: PoseSource) -> str:
    """Describe a pose source in words."""
    if isinstance(source, TransformPose):
        return f"{source.parent} -> {source.child} in {source.topic}"
    if isinstance(source, JointMotion):
        return f"the joints in {source.topic} themselves"
    return source if isinstance(source, str) else f"{source.tip} by the joints in {source.topic}"


def hand_candidates(hands: Mapping[str, Mapping[PoseSource, HandPath]]) -> list[HandCandidate]:
    """All pose sources with a path in some file, the most likely for the hand first.

    Sources that move, in most of the files, come first; then topics of poses before transforms before
    joints; then sources in more files; then frames named like a hand; then longer paths.
    """
    every = []
    for source in dict.fromkeys(source for by_source in hands.values() for source in by_source):
        paths = {name: by_source[source] for name, by_source in hands.items() if source in by_source}
        sizes = [(path.extent_m, float(path.speed.sum() * path.dt)) for path in paths.values()]
        every.append(HandCandidate(source, paths, *np.median(sizes, axis=0).tolist()))

    def rank(candidate: HandCandidate) -> tuple:
        """Sort key, small for likely sources; ties keep the order of names."""
        kind, path_length = type(candidate.source), candidate.travelled
        farthest = max(other.travelled for other in every if type(other.source) is kind)
        if kind is not str and path_length >= ALIKE * farthest:
            path_length = farthest
        named = isinstance(candidate.source, TransformPose) and HANDS.search(candidate.source.child)
        unlikely = not candidate.moves or 2 * len(candidate.paths) <= len(hands)
        return unlikely, KINDS.index(kind), -len(candidate.paths), not named, -path_length

    return sorted(every, key=rank)


class MotionRun(NamedTuple):
    """Speed above a threshold from start to end (s since the first pose); `path_length` in m."""

    start_s: float
    end_s: float
    path_length: float
    short: bool


class MotionSurvey(NamedTuple):
    """Runs of motion of all demonstrations at the threshold (m/s) at which most of them agree."""

    threshold: float
    runs: Mapping[str, Sequence[MotionRun]]
    with_short: bool
    number: int  # of runs in most demonstrations
    agreeing: tuple[str, ...]  # names of these demonstrations
    turns_deg: tuple[float, ...] = ()  # median rotation between runs; empty without orientations

    def counted(self, name: str) -> list[MotionRun]:
        """Runs of a demonstration, without short ones unless they count."""
        return [run for run in self.runs[name] if self.with_short or not run.short]


def survey_motion(paths: Mapping[str, HandPath]) -> MotionSurvey:
    """Find the runs of motion of demonstrations by name, and their most common number."""
    moved = [AxisMotion(path.position, path.speed, path.speed, False) for path in paths.values()]
    choices = []
    for (place, fraction), with_short in product(enumerate(FRACTIONS), (True, False)):
        threshold = fraction * pace(moved)
        runs = {name: motion_runs(path, threshold) for name, path in paths.items()}
        rows = {}
        for name, moves in runs.items():
            rows[name] = tuple(run.short for run in moves if with_short or not run.short)
        row, count = max(Counter(rows.values()).items(), key=lambda item: (item[1], len(item[0])))
        agreeing = tuple(name for name in rows if rows[name] == row)
        rank = (count, len(row) > 0, with_short, -abs(place - PREFERRED))
        choices.append((rank, MotionSurvey(threshold, runs, with_short, len(row), agreeing)))
    best = max(choices, key=lambda choice: choice[0])[1]
    turns = [turns_between(paths[name], best.counted(name)) for name in best.agreeing]
    return best._replace(turns_deg=tuple(np.median(turns, axis=0).tolist()))


def turns_between(path: HandPath, runs: Sequence[MotionRun]) -> list[float]:
    """Rotation of the hand in degrees from the end of each run to the start of the next."""
    if path.orientation is None:
        return []
    ends = np.array([run.end_s for run in runs[:-1]]) / path.dt
    starts = np.array([run.start_s for run in runs[1:]]) / path.dt
    before, after = (path.orientation[np.round(at).astype(int)] for at in (ends, starts))
    return np.degrees(quaternion.angle_between(before, after)).tolist()


def motion_runs(path: HandPath, threshold: float) -> list[MotionRun]:
    """Runs of a path's speed above a threshold in temporal order, joined across hesitations."""
    runs = joined_runs(path.speed, threshold, path.dt)
    if not len(runs):
        return []
    first, last = runs.T
    lengths = [float(path.speed[a : b + 1].sum() * path.dt) for a, b in zip(first, last, strict=True)]
    return [
        MotionRun(
            float(a * path.dt), float(b * path.dt), path_length, path_length < SHORT_SHARE * max(lengths)
        )
        for a, b, path_length in zip(first, last, lengths, strict=True)
    ]


def joined_runs(speed: np.ndarray, threshold: float, dt: float) -> np.ndarray:
    """First and last samples (R, 2) of the runs above a threshold, joined across hesitations."""
    runs = runs_of_motion(speed, threshold, most=len(speed))
    if not len(runs):
        return runs
    pauses = np.flatnonzero((runs[1:, 0] - runs[:-1, 1]) * dt > BRIDGE_S)
    return np.stack([runs[np.append(0, pauses + 1), 0], runs[np.append(pauses, len(runs) - 1), 1]], axis=1)
