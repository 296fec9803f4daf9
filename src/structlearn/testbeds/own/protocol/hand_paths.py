"""How the hand moves in recordings that nobody has described yet: its way, its speed, its noise.

Where there are joint states and no robot to compute poses with, the joints stand in for the hand.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from structlearn.ground import quaternion, signals
from structlearn.ground.errors import InputError
from structlearn.recordings.checks import check_speed
from structlearn.recordings.recording import Stream

SPEED_HZ = 2.0
"""Hz, low-pass of the positions before they are differentiated: the method's for finding a movement."""

MOST_TICKS = 10**7
"""Of a uniform clock; more of them mean that a stamp lies years away from the others."""

TO_DEVIATION = 1.4826
"""Standard deviation of normal numbers over the median of their sizes."""

THIRD_DIFFERENCES = np.sqrt(20.0)
"""Their standard deviation over that of white noise; what is as smooth as a hand has none to speak of."""


@dataclass(frozen=True)
class HandPath:
    """Positions of one source of poses in one file, on a uniform clock.

    Attributes:
        unit: m, or rad where it is joints that move; below, m stands for either.
        dt: s between ticks.
        start_s: s, of the first tick on the recording's clock.
        position: (T, D) m, without what is above `SPEED_HZ`.
        speed: (T,) m/s of it.
        orientation: (T, 4) w, x, y, z of norm 1; None where there is none.
        noise_m: m, std per axis of the sensor's noise, by third differences, which hardly show motion.
        norm_error: largest difference of a quaternion's norm from 1.
        fault: what no hand does, e.g. a jump, or values that are no numbers; empty where there is nothing.
    """

    unit: Literal["m", "rad"]
    dt: float
    start_s: float
    position: np.ndarray
    speed: np.ndarray
    orientation: np.ndarray | None
    noise_m: float
    norm_error: float
    fault: str

    @property
    def travelled_m(self) -> float:
        """Length of the way."""
        return float(self.speed.sum() * self.dt)

    @property
    def extent_m(self) -> float:
        """Diagonal of the box that holds it."""
        return float(np.linalg.norm(np.ptp(self.position, axis=0)))

    @property
    def peak_m_s(self) -> float:
        """Largest speed."""
        return float(self.speed.max())


def hand_path(stream: Stream) -> HandPath:
    """The path of a stream of poses; stamps in disorder are sorted, and values that are no numbers left out.

    Raises:
        InputError: fewer than three samples are left, or stamps lie too far apart for a clock.
    """
    finite = np.isfinite(stream.values).all(axis=1)
    stamps, values = _in_order(stream.stamps[finite], stream.values[finite])
    path = _path("m", stream.topic, stamps, values[:, :3])
    norms = np.linalg.norm(values[:, 3:], axis=1)
    turns = values[:, 3:] / norms[:, None] if (norms > 0.0).all() else None
    return replace(
        path,
        orientation=None if turns is None else _turned(path, stamps, turns),
        norm_error=float(np.abs(norms - 1.0).max()),
        fault=_fault(finite, Stream(stream.topic, "pose", stamps, values)),
    )


def _turned(path: HandPath, stamps: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Orientations (T, 4) at a path's ticks."""
    ticks, times = np.arange(len(path.speed)) * path.dt, 1e-9 * (stamps - stamps[0])
    return quaternion.interpolate(np.minimum(ticks, times[-1]), times, turns)


def joint_path(topic: str, stamps: np.ndarray, positions: np.ndarray) -> HandPath:
    """The path of joints, as `hand_path`: (T,) int64 ns, (T, J) rad."""
    return _path("rad", topic, *_in_order(stamps, positions))


def _in_order(stamps: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    ordered, places = np.unique(stamps, return_index=True)
    return ordered, values[places]


def _path(unit: Literal["m", "rad"], topic: str, stamps: np.ndarray, values: np.ndarray) -> HandPath:
    if len(stamps) < 3:
        raise InputError(f"{topic} has {len(stamps)} samples, fewer than three")
    dt = 1e-9 * float(np.median(np.diff(stamps)))
    time = 1e-9 * (stamps - stamps[0])
    if time[-1] > MOST_TICKS * dt:
        raise InputError(f"{topic} has stamps that lie {time[-1]:.3g} s apart, {dt:.3g} s as a rule")
    ticks = np.arange(int(time[-1] / dt) + 1) * dt
    if len(ticks) < 3:
        raise InputError(f"{topic} has samples at fewer than three ticks of {dt:.3g} s")
    raw = np.stack([np.interp(ticks, time, column) for column in values.T], axis=1)
    position = signals.low_pass(raw, dt, SPEED_HZ)
    speed = np.linalg.norm(signals.derivative(position, dt), axis=1)
    differences = np.abs(np.diff(raw, 3, axis=0)) if len(raw) > 3 else np.zeros((1, 1))
    noise_m = TO_DEVIATION * float(np.median(differences)) / THIRD_DIFFERENCES
    start_s = 1e-9 * int(stamps[0])
    return HandPath(unit, dt, start_s, position, speed, None, noise_m, norm_error=0.0, fault="")


def _fault(finite: np.ndarray, ordered: Stream) -> str:
    if not finite.all():
        return f"{int((~finite).sum())} of {len(finite)} poses have values that are no numbers"
    try:
        check_speed("", ordered)
    except InputError as error:
        return str(error).removeprefix(f": {ordered.topic}: ")
    return ""
