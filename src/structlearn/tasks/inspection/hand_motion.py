"""Motion of the hand in recordings without a task entry: the source of its poses, and its number of moves.

No single speed threshold suits all tasks, so the thresholds of the segmentation are tried. At each, a
demonstration is a sequence of long and short runs. The sequence that most demonstrations share is the task;
short runs count if they, too, occur at the same positions in it.
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
from structlearn.segmentation.motion_runs import FRACTIONS, Motion, pace, runs_of_motion
from structlearn.tasks.inspection.clocks import Stamps, stamps_of

# Hz, low-pass of the positions before differentiation: that of the method for finding movements.
SPEED_HZ = 2.0
MOST_TICKS = 10**7  # of a uniform clock; more mean that a stamp is years away from the others
LEAST_EXTENT_M = 0.01  # least extent of a hand's motion; less is sway

# Share of the longest path above which frames of one tree move alike: then the likeliest name is taken.
ALIKE = 0.9

# Index of the preferred threshold among equally good ones: low, to keep slow moves, and above the sway.
PREFERRED = 1
BRIDGE_S = 0.2  # s; shorter dips in speed are hesitations: deliberate stops last longer

# Share of a demonstration's longest run below which a run is short: ignored, unless all demonstrations have
# it.
SHORT_SHARE = 0.1

PoseSource = str | TransformPose | JointPose
# Types of pose sources, the likeliest first; a string is a topic of poses.
KINDS = (str, TransformPose, JointPose)


class HandPath(NamedTuple):
    """Positions (T, 3) m and speeds (T,) m/s from one source of poses in one file, on a uniform clock.

    `orientation` (T, 4) is None if a quaternion has norm 0.
    """

    dt: float
    position: np.ndarray
    speed: np.ndarray
    orientation: np.ndarray | None
    stamps: Stamps

    @property
    def extent_m(self) -> float:
        """Diagonal of the path's bounding box."""
        return float(np.linalg.norm(np.ptp(self.position, axis=0)))


def hand_path(stream: Stream) -> HandPath:
    """Path of a stream of poses; stamps are sorted, and values that are not finite left out.

    Raises InputError: fewer than three samples are left, or stamps are too far apart for a clock.
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
    raw = np.stack([np.interp(ticks, time, column) for column in values[:, :3].T], axis=1)
    position = signals.low_pass(raw, dt, SPEED_HZ)
    speed = np.linalg.norm(signals.derivative(position, dt), axis=1)
    norms = np.linalg.norm(values[:, 3:], axis=1)
    turned = None
    if (norms > 0.0).all():
        turned = quaternion.interpolate(np.minimum(ticks, time[-1]), time, values[:, 3:] / norms[:, None])
    return HandPath(dt, position, speed, turned, stamps_of(stream.stamps))


class Candidate(NamedTuple):
    """A source of poses with its path per file, and their median extent and length in m."""

    source: PoseSource
    paths: dict[str, HandPath]
    extent: float
    travelled: float

    @property
    def moves(self) -> bool:
        """Whether it moves by more than sway."""
        return self.extent >= LEAST_EXTENT_M


def pose_words(source: PoseSource) -> str:
    """Description of a source of poses."""
    if isinstance(source, TransformPose):
        return f"{source.parent} -> {source.child} in {source.topic}"
    return source if isinstance(source, str) else f"{source.tip} by the joints in {source.topic}"


def candidates(hands: Mapping[str, Mapping[PoseSource, HandPath]]) -> list[Candidate]:
    """All sources of poses with a path in some file, the likeliest for the hand first.

    Sorted by: moves in most of its files; topics of poses before transforms before joints; occurs in more
    files; frame named like a hand; longer path.
    """
    every = []
    for source in dict.fromkeys(source for by_source in hands.values() for source in by_source):
        paths = {name: by_source[source] for name, by_source in hands.items() if source in by_source}
        sizes = [(path.extent_m, float(path.speed.sum() * path.dt)) for path in paths.values()]
        every.append(Candidate(source, paths, *np.median(sizes, axis=0).tolist()))

    def rank(one: Candidate) -> tuple:
        """Sort key: small is likely; ties keep the order of discovery, by name."""
        kind, way = type(one.source), one.travelled
        farthest = max(other.travelled for other in every if type(other.source) is kind)
        if kind is not str and way >= ALIKE * farthest:
            way = farthest
        named = isinstance(one.source, TransformPose) and HANDS.search(one.source.child)
        unlikely = not one.moves or 2 * len(one.paths) <= len(hands)
        return unlikely, KINDS.index(kind), -len(one.paths), not named, -way

    return sorted(every, key=rank)


class MotionRun(NamedTuple):
    """A run with speed above a threshold: start and end in s since the first pose, and length in m."""

    start_s: float
    end_s: float
    way: float
    short: bool


class MotionSurvey(NamedTuple):
    """Runs of motion of all demonstrations, at the threshold (m/s) at which most agree."""

    threshold: float
    runs: Mapping[str, Sequence[MotionRun]]
    with_short: bool
    number: int  # of runs in most of the demonstrations
    agreeing: tuple[str, ...]  # names of these demonstrations
    turns_deg: tuple[float, ...] = ()  # median turns between consecutive runs; empty without orientations

    def counted(self, name: str) -> list[MotionRun]:
        """Runs of a demonstration, without short ones unless they count."""
        return [run for run in self.runs[name] if self.with_short or not run.short]


def survey_motion(paths: Mapping[str, HandPath]) -> MotionSurvey:
    """Runs of motion of the named demonstrations, and the number on which most agree."""
    moved = [Motion(path.position, path.speed, path.speed, False) for path in paths.values()]
    choices = []
    for (place, fraction), with_short in product(enumerate(FRACTIONS), (True, False)):
        threshold = fraction * pace(moved)
        runs = {name: motion_runs(path, threshold) for name, path in paths.items()}
        rows = {}
        for name, its in runs.items():
            rows[name] = tuple(run.short for run in its if with_short or not run.short)
        row, count = max(Counter(rows.values()).items(), key=lambda item: (item[1], len(item[0])))
        agreeing = tuple(name for name in rows if rows[name] == row)
        rank = (count, len(row) > 0, with_short, -abs(place - PREFERRED))
        choices.append((rank, MotionSurvey(threshold, runs, with_short, len(row), agreeing)))
    best = max(choices, key=lambda choice: choice[0])[1]
    turns = [turns_between(paths[name], best.counted(name)) for name in best.agreeing]
    return best._replace(turns_deg=tuple(np.median(turns, axis=0).tolist()))


def turns_between(path: HandPath, runs: Sequence[MotionRun]) -> list[float]:
    """Degrees by which the hand turns between the end of each run and the start of the next."""
    if path.orientation is None:
        return []
    ends = np.array([run.end_s for run in runs[:-1]]) / path.dt
    starts = np.array([run.start_s for run in runs[1:]]) / path.dt
    before, after = (path.orientation[np.round(at).astype(int)] for at in (ends, starts))
    return np.degrees(quaternion.angle_between(before, after)).tolist()


def motion_runs(path: HandPath, threshold: float) -> list[MotionRun]:
    """Runs of a path's speed above a threshold, joined across hesitations, in order."""
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
