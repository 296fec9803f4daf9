"""Orientation primitive for turns of any size, in a twist-swing chart about a dominant axis.

The text's quaternion primitive is driven by the logarithm of the shorter rotation, which jumps at half a
turn; and rotation vectors cannot be unwrapped past a full turn, where the exponential map is singular. Here
an orientation relative to the goal is split into a twist about a fixed axis and a swing perpendicular to it,

    Q o Q_G* = exp(s / 2) o exp(theta a / 2),        s perpendicular to a,

the twist angle theta is unwrapped over time, and ordinary primitives run on (theta, s_1, s_2). The goal is
the origin of the chart. The chart is singular only where the axis itself is turned upside down.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from structlearn.core import quaternion
from structlearn.primitives import kernels
from structlearn.primitives.trajectory import OrientationTrajectory, Trajectory
from structlearn.primitives.transformation import Coupling
from structlearn.primitives.vector import VectorPrimitive, fit_vector


@dataclass(frozen=True)
class TwistSwingPrimitive:
    """Learned movement of an orientation that may turn any number of times."""

    # movement of (theta, s_1, s_2) in rad; its start says how many turns remain
    chart: VectorPrimitive
    axes: np.ndarray  # (3, 3) columns: dominant axis, and two perpendicular ones, in the base frame
    start: np.ndarray  # (4,) mean start of the demonstrations
    goal: np.ndarray  # (4,) mean goal of the demonstrations

    @property
    def duration(self) -> float:
        """Mean duration of the demonstrations in s."""
        return self.chart.duration

    def unroll(
        self,
        dt: float,
        start: np.ndarray | None = None,
        goal: np.ndarray | None = None,
        duration: float | None = None,
        velocity: np.ndarray | float | None = None,
        acceleration: np.ndarray | float | None = None,
        coupling: Coupling | None = None,
        until: float | None = None,
    ) -> OrientationTrajectory:
        """Generate the movement, (T, 4) orientations; arguments as in `QuaternionPrimitive.unroll`.

        Of the possible numbers of turns from start to goal, the one nearest to the demonstrations is taken.
        `coupling`: in chart coordinates: (step, (..., 3), rates) -> (..., 3). Raises ValueError: only one of
        velocity and acceleration is given; the chart needs both.
        """
        if (velocity is None) != (acceleration is None):
            raise ValueError("velocity and acceleration must be given together")
        start = self.start if start is None else np.asarray(start, dtype=float)
        goal = self.goal if goal is None else np.asarray(goal, dtype=float)
        coordinates = to_chart(quaternion.product(start, quaternion.conjugate(goal)), self.axes)
        coordinates[0] += 2.0 * np.pi * np.round((self.chart.start[0] - coordinates[0]) / (2.0 * np.pi))
        rates = accelerations = None
        if velocity is not None and acceleration is not None:
            motion = np.broadcast_to(velocity, 3), np.broadcast_to(acceleration, 3)
            rates, accelerations = chart_rates(coordinates, *motion, self.axes)
        path = self.chart.unroll(
            dt, coordinates, np.zeros(3), duration, rates, accelerations, coupling, until
        )
        orientation = quaternion.product(from_chart(path.position, self.axes), goal)
        orientation = np.where(orientation[..., :1, :] @ start[:, None] < 0, -orientation, orientation)
        velocities = angular_rates(path.position, path.velocity, path.acceleration, self.axes)
        return OrientationTrajectory(path.time, quaternion.sign_continuous(orientation), *velocities)


def fit_twist_swing(
    demonstrations: Sequence[OrientationTrajectory],
    method: kernels.Regression = "joint",
    kernel_count: int = kernels.KERNEL_COUNT,
) -> TwistSwingPrimitive:
    """Fit an orientation primitive in the chart about the demonstrations' dominant axis.

    The chart, and with it every sample's coordinates, depends on which demonstrations are used. So, unlike
    for the other primitives, leaving some out means to fit again, and leave-one-out grows quadratically.

    `demonstrations`: (T_l, 4) orientations each, sign-continuous.
    """
    axes = dominant_axes(demonstrations)
    return TwistSwingPrimitive(
        chart=fit_vector([on_chart(path, axes) for path in demonstrations], None, method, kernel_count),
        axes=axes,
        start=quaternion.mean(np.array([path.orientation[0] for path in demonstrations])),
        goal=quaternion.mean(np.array([path.orientation[-1] for path in demonstrations])),
    )


@dataclass(frozen=True)
class Turns:
    """What the dominant axis of L demonstrations follows from."""

    second_moment: np.ndarray  # (L, 3, 3) sum of w w^T over the samples
    mean: np.ndarray  # (L, 3) rad/s, mean angular velocity
    duration: np.ndarray  # (L,) s

    @classmethod
    def of(cls, demonstrations: Sequence[OrientationTrajectory]) -> Self:
        """Of demonstrations with (T_l, 3) angular velocities."""
        velocities = [path.angular_velocity for path in demonstrations]
        return cls(
            np.array([velocity.T @ velocity for velocity in velocities]),
            np.array([velocity.mean(axis=0) for velocity in velocities]),
            np.array([path.duration for path in demonstrations]),
        )

    def of_some(self, used: np.ndarray) -> Self:
        """Those of the demonstrations in a mask (L,)."""
        return type(self)(**{name: values[used] for name, values in vars(self).items()})

    @property
    def axis(self) -> np.ndarray:
        """(3,) principal axis of the angular velocities, directed along the net turn."""
        axis = np.linalg.eigh(self.second_moment.sum(axis=0))[1][:, -1]
        return axis if axis @ self.mean.sum(axis=0) >= 0 else -axis

    @property
    def largest(self) -> float:
        """Largest net turn about the dominant axis in rad."""
        axis = self.axis
        return max(
            abs(float(mean @ axis) * duration)
            for mean, duration in zip(self.mean, self.duration.tolist(), strict=True)
        )


def dominant_axes(demonstrations: Sequence[OrientationTrajectory]) -> np.ndarray:
    """Axis about which the demonstrations turn most, and two axes perpendicular to it, (3, 3) columns.

    The first is `Turns.axis`; all are orthonormal and right-handed.
    """
    axis = Turns.of(demonstrations).axis
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    second = np.cross(axis, helper) / np.linalg.norm(np.cross(axis, helper))
    return np.column_stack([axis, second, np.cross(axis, second)])


def largest_turn(demonstrations: Sequence[OrientationTrajectory]) -> float:
    """Largest net turn of any demonstration about the dominant axis, in rad."""
    return Turns.of(demonstrations).largest


def on_chart(path: OrientationTrajectory, axes: np.ndarray) -> Trajectory:
    """A demonstration in chart coordinates relative to its own goal; the twist is unwrapped to end at 0."""
    relative = quaternion.product(path.orientation, quaternion.conjugate(path.orientation[-1]))
    coordinates = to_chart(relative, axes)
    coordinates[:, 0] = np.unwrap(coordinates[::-1, 0])[::-1]
    rates = chart_rates(coordinates, path.angular_velocity, path.angular_acceleration, axes)
    return Trajectory(path.time, coordinates, *rates)


def to_chart(relative: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Twist in [-pi, pi] and two swing components (..., 3), in rad, of orientations Q o Q_G* (..., 4).

    `axes`: (3, 3) columns: dominant axis and two perpendicular ones.
    """
    along = relative[..., 1:] @ axes[:, 0]
    twist = 2.0 * np.arctan2(along, relative[..., 0])
    twist = np.arctan2(np.sin(twist), np.cos(twist))
    untwisted = quaternion.product(relative, quaternion.from_rotation_vector(-twist[..., None] * axes[:, 0]))
    swing = quaternion.rotation_vector(untwisted) @ axes[:, 1:]
    return np.concatenate([twist[..., None], swing], axis=-1)


def from_chart(coordinates: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Orientations relative to the goal, the inverse of `to_chart`: (..., 3) rad -> (..., 4)."""
    swing = quaternion.from_rotation_vector(coordinates[..., 1:] @ axes[:, 1:].T)
    twist = quaternion.from_rotation_vector(coordinates[..., :1] * axes[:, 0])
    return quaternion.product(swing, twist)


def angular_rates(
    coordinates: np.ndarray, rates: np.ndarray, accelerations: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Angular velocity and acceleration (..., 3) in the base frame, from chart rates (..., 3)."""
    matrix, bias = _chart_jacobian(coordinates, rates, axes)
    velocity = (matrix @ rates[..., None])[..., 0]
    return velocity, (matrix @ accelerations[..., None])[..., 0] + bias


def chart_rates(
    coordinates: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rates and accelerations (..., 3) on the chart, the inverse of `angular_rates`."""
    matrix, _ = _chart_jacobian(coordinates, np.zeros_like(coordinates), axes)
    rates = np.linalg.solve(matrix, velocity[..., None])[..., 0]
    _, bias = _chart_jacobian(coordinates, rates, axes)
    return rates, np.linalg.solve(matrix, (acceleration - bias)[..., None])[..., 0]


def _chart_jacobian(
    coordinates: np.ndarray, rates: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """M (..., 3, 3) and M' rates (..., 3) with w = M rates, wd = M accelerations + M' rates.

    With S = exp(s / 2) the swing and J its left Jacobian, w = J sd + thetad S a.
    """
    swing, swing_rate = coordinates[..., 1:] @ axes[:, 1:].T, rates[..., 1:] @ axes[:, 1:].T
    jacobian, jacobian_rate = _left_jacobian(swing, swing_rate)
    turned_axis = quaternion.rotate(quaternion.from_rotation_vector(swing), axes[:, 0])
    matrix = np.concatenate([turned_axis[..., None], jacobian @ axes[:, 1:]], axis=-1)
    swing_velocity = (jacobian @ swing_rate[..., None])[..., 0]
    bias = (jacobian_rate @ swing_rate[..., None])[..., 0]
    return matrix, bias + rates[..., :1] * np.cross(swing_velocity, turned_axis)


def _left_jacobian(vector: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Left Jacobian (..., 3, 3) of the rotation exp(v), v (..., 3), and its time derivative.

    J = 1 + A [v]x + B [v]x^2,  A = (1 - cos n) / n^2,  B = (n - sin n) / n^3,  n = |v|; near n = 0, where
    these cancel, their series are used.
    """
    square = np.sum(vector**2, axis=-1)
    small = square < 1e-2
    n2 = np.where(small, 1.0, square)
    n = np.sqrt(n2)
    a = np.where(small, 1 / 2 - square / 24 + square**2 / 720, (1 - np.cos(n)) / n2)
    b = np.where(small, 1 / 6 - square / 120 + square**2 / 5040, (n - np.sin(n)) / (n * n2))
    a_slope = np.where(  # dA / dn / n
        small, -1 / 12 + square / 180 - square**2 / 6720, (n * np.sin(n) - 2 * (1 - np.cos(n))) / n2**2
    )
    b_slope = np.where(  # dB / dn / n
        small,
        -1 / 60 + square / 1260 - square**2 / 60480,
        (3 * np.sin(n) - n * np.cos(n) - 2 * n) / (n * n2**2),
    )
    growth = np.sum(vector * rate, axis=-1)  # n dn/dt
    cross, cross_rate = _cross_matrix(vector), _cross_matrix(rate)

    def times(factor: np.ndarray, matrix: np.ndarray) -> np.ndarray:
        return factor[..., None, None] * matrix

    jacobian = np.eye(3) + times(a, cross) + times(b, cross @ cross)
    jacobian_rate = (
        times(a_slope * growth, cross)
        + times(a, cross_rate)
        + times(b_slope * growth, cross @ cross)
        + times(b, cross_rate @ cross + cross @ cross_rate)
    )
    return jacobian, jacobian_rate


def _cross_matrix(vector: np.ndarray) -> np.ndarray:
    """Matrices [v]x with [v]x w = v x w: (..., 3) -> (..., 3, 3)."""
    return np.cross(vector[..., None, :], np.eye(3)).swapaxes(-1, -2)
