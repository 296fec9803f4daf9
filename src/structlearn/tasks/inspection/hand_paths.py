"""How the hand moves in recordings without an entry, and which source of poses is the hand's."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from structlearn.core import quaternion, signals
from structlearn.core.errors import InputError
from structlearn.readers.recording import Stream, check_speed
from structlearn.readers.survey import Stamps, stamps_of
from structlearn.readers.topics import JointPose, TransformPose
from structlearn.rigid_body.urdf import HANDS

SPEED_HZ = 2.0
"""Hz, low-pass of the positions before they are differentiated: the method's for finding a movement."""

MOST_TICKS = 10**7
"""Of a uniform clock; more of them mean that a stamp lies years away from the others."""

LEAST_EXTENT_M = 0.01
"""How far a hand gets at least: less is sway."""

ALIKE = 0.9
"""Share of the largest way from which on frames of one tree move alike: then the likeliest name is taken."""

PoseSource = str | TransformPose | JointPose


@dataclass(frozen=True)
class HandPath:
    """Positions (T, 3) m and speeds (T,) m/s of one source of poses in one file, on a uniform clock.

    `orientation` (T, 4) is None without unit quaternions, `norm_error` the largest difference of a norm from
    1, `fault` what no hand does (a jump, values that are no numbers), or empty.
    """

    dt: float
    position: np.ndarray
    speed: np.ndarray
    orientation: np.ndarray | None
    norm_error: float
    fault: str
    stamps: Stamps

    @property
    def travelled_m(self) -> float:
        """Length of the path."""
        return float(self.speed.sum() * self.dt)

    @property
    def extent_m(self) -> float:
        """Diagonal of the box that holds it."""
        return float(np.linalg.norm(np.ptp(self.position, axis=0)))


def hand_path(stream: Stream) -> HandPath:
    """The path of a stream of poses; stamps in disorder are sorted, and values that are no numbers left out.

    Raises:
        InputError: fewer than three samples are left, or stamps lie too far apart for a clock.
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
    fault = ""
    if not finite.all():
        fault = f"{int((~finite).sum())} of {len(finite)} poses have values that are no numbers"
    else:
        try:
            check_speed("", Stream(topic, "pose", stamps, values))
        except InputError as error:
            fault = str(error).removeprefix(f": {topic}: ")
    norm_error = float(np.abs(norms - 1.0).max())
    return HandPath(dt, position, speed, turned, norm_error, fault, stamps_of(stream.stamps))


@dataclass(frozen=True)
class Candidate:
    """A source of poses with its paths by file, the medians of their extents and lengths in m."""

    source: PoseSource
    paths: dict[str, HandPath]
    extent: float
    travelled: float

    @property
    def moves(self) -> bool:
        """Whether it is more than sway."""
        return self.extent >= LEAST_EXTENT_M

    @property
    def words(self) -> str:
        """What it is."""
        return pose_words(self.source)


def pose_words(source: PoseSource) -> str:
    """A source of poses in words."""
    if isinstance(source, str):
        return source
    if isinstance(source, TransformPose):
        return f"{source.parent} -> {source.child} in {source.topic}"
    return f"{source.tip} by the joints in {source.topic}"


def candidates(hands: Mapping[str, Mapping[PoseSource, HandPath]]) -> list[Candidate]:
    """All sources of poses that have a path in some file, the likeliest for the hand's first.

    One that moves, in most of the files, comes before all others; then topics of poses before transforms and
    those before joints; then what is in more files; then frames that are called like a hand; then what goes
    the longer way.
    """
    found: dict[PoseSource, dict[str, HandPath]] = {}
    for name, by_source in hands.items():
        for source, path in by_source.items():
            found.setdefault(source, {})[name] = path
    every = []
    for source, paths in found.items():
        sizes = [(path.extent_m, path.travelled_m) for path in paths.values()]
        every.append(Candidate(source, paths, *np.median(sizes, axis=0).tolist()))
    return sorted(every, key=lambda one: _rank(one, every, len(hands)))


def _rank(one: Candidate, every: Sequence[Candidate], files: int) -> tuple:
    """Small is likely; the order in which sources of one kind were found, by their names, breaks ties."""
    kind = _kind(one.source)
    farthest = max(other.travelled for other in every if _kind(other.source) == kind)
    way = farthest if kind and one.travelled >= ALIKE * farthest else one.travelled
    named = isinstance(one.source, TransformPose) and HANDS.search(one.source.child)
    return not (one.moves and 2 * len(one.paths) > files), kind, -len(one.paths), not named, -way


def _kind(source: PoseSource) -> int:
    return 0 if isinstance(source, str) else 1 if isinstance(source, TransformPose) else 2
