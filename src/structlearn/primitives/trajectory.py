"""Trajectories with two derivatives, which primitives are fitted to and unroll."""

from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np

from structlearn.core import quaternion, signals


@dataclass(frozen=True)
class PathBase:
    """Signals on a uniform clock that starts at 0."""

    time: np.ndarray  # (T,) s since the start

    @property
    def duration(self) -> float:
        """Time from the first to the last sample in s."""
        return float(self.time[-1])

    @property
    def dt(self) -> float:
        """Sampling interval in s."""
        return float(self.time[-1]) / (len(self.time) - 1)

    @property
    def rates(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocity and acceleration; for orientations, angular."""
        *_, velocity, acceleration = vars(self).values()
        return velocity, acceleration

    def cut(self, first: int, last: int) -> Self:
        """Samples first..last, inclusive, with the clock restarted (unbatched signals only)."""
        signals_cut = {field.name: getattr(self, field.name)[first : last + 1] for field in fields(self)[1:]}
        return type(self)(time=self.time[: last - first + 1], **signals_cut)


@dataclass(frozen=True)
class Trajectory(PathBase):
    """A vector signal (position, sensor trace, chart coordinates) with two derivatives."""

    position: np.ndarray  # (..., T, D)
    velocity: np.ndarray  # (..., T, D) per s
    acceleration: np.ndarray  # (..., T, D) per s^2

    def turned(self, axes: np.ndarray) -> Self:
        """The signals in axes given by the columns of `axes` (..., D, D)."""
        return type(self)(self.time, self.position @ axes, self.velocity @ axes, self.acceleration @ axes)

    def shifted(self, offset: np.ndarray) -> Self:
        """The path shifted by an offset (..., D)."""
        return replace(self, position=self.position + offset)


@dataclass(frozen=True)
class OrientationTrajectory(PathBase):
    """An orientation path with angular velocity and acceleration in the base frame."""

    orientation: np.ndarray  # (T, 4) unit quaternions w, x, y, z, sign-continuous
    angular_velocity: np.ndarray  # (T, 3) rad/s
    angular_acceleration: np.ndarray  # (T, 3) rad/s^2


def differentiated(position: np.ndarray, dt: float, cutoff_hz: float) -> Trajectory:
    """Low-pass a recorded signal and differentiate it twice.

    Filter a whole demonstration before cutting it: neighbouring segments then agree at the cut.

    `position`: (T, D) samples on a uniform clock. `cutoff_hz`: cut-off of the low-pass in Hz.
    """
    smooth = signals.low_pass(position, dt, cutoff_hz)
    velocity = signals.derivative(smooth, dt)
    return Trajectory(dt * np.arange(len(position)), smooth, velocity, signals.derivative(velocity, dt))


def differentiated_orientation(orientation: np.ndarray, dt: float, cutoff_hz: float) -> OrientationTrajectory:
    """Low-pass a recorded orientation path and differentiate it twice.

    The components of the sign-continuous quaternion are filtered and renormalised: unlike a logarithm they
    have no singular orientation, and for a smooth path their norm stays far from zero.

    `orientation`: (T, 4) unit quaternions on a uniform clock. `cutoff_hz`: cut-off of the low-pass in Hz.
    """
    smooth = quaternion.normalised(signals.low_pass(quaternion.sign_continuous(orientation), dt, cutoff_hz))
    rate = signals.derivative(smooth, dt)  # Qd = 1/2 [0, w] o Q, so [0, w] = 2 Qd o Q*
    velocity = 2.0 * quaternion.product(rate, quaternion.conjugate(smooth))[:, 1:]
    return OrientationTrajectory(
        dt * np.arange(len(orientation)), smooth, velocity, signals.derivative(velocity, dt)
    )
