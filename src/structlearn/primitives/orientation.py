"""Quaternion primitive, as published: errors are logarithms of the shorter rotation (eq. IV.2, IV.9, IV.11).

    tau^2 wd = ALPHA (BETA 2 log(Q_g o Q*) - tau w) + f + c        Q(t + dt) = exp(w dt / 2) o Q(t)
    tau w_g = ALPHA_G 2 log(Q_G o Q_g*)

Suitable for movements that turn by less than 180 degrees; beyond, see `twist_swing`. One step uses the exact
transition of the vector system in the tangent space of the current orientation, so a rotation about a fixed
axis is integrated exactly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from structlearn.core import quaternion
from structlearn.core.compilation import numba
from structlearn.primitives import canonical, kernels, rhythmic
from structlearn.primitives.rhythmic import Rhythm
from structlearn.primitives.trajectory import OrientationTrajectory
from structlearn.primitives.transformation import ALPHA, ALPHA_G, BETA, Array, Coupling, step_matrix
from structlearn.primitives.vector import Boundaries, ForcedPrimitive, SubsetFit


@dataclass(frozen=True)
class QuaternionPrimitive(ForcedPrimitive[OrientationTrajectory]):
    """Learned orientation movement of less than half a turn; coordinates are rad instead of m."""

    def forcing(self, times: np.ndarray, duration: float) -> np.ndarray:
        """Forcing term (..., T, 3) at times (T,) s of a movement that takes `duration` s."""
        return self.features_at(times, duration) @ self.weights_towards(self.start, self.goal)

    def weights_towards(self, start: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """Weights (..., N, 3) of `features` for a movement from `start` to `goal` (4,)."""
        if self.rhythm is None:
            return self.weights
        return rhythmic.with_baseline(self.weights, quaternion.difference(start, goal), np.zeros(3))

    def repeated(self, cycles: float, amplitude: float = 1.0, first: float | None = None) -> Self:
        """As `ForcedPrimitive.repeated`; both ends follow in the tangent space at the start."""
        way = quaternion.difference(self.goal, self.start)
        fields, moved, way = self._repeated(way, cycles, amplitude, first)
        start, goal = (
            quaternion.product(quaternion.from_rotation_vector(vector), self.start)
            for vector in (moved, moved + way)
        )
        return replace(self, start=start, goal=goal, **fields)

    def _integrated(
        self, start: np.ndarray, goal: np.ndarray, features: np.ndarray, *system: Any
    ) -> OrientationTrajectory:
        return unroll(start, goal, features @ self.weights_towards(start, goal), *system)


def fit_quaternion(
    demonstrations: Sequence[OrientationTrajectory],
    method: kernels.Regression = "joint",
    kernel_count: int = kernels.KERNEL_COUNT,
) -> QuaternionPrimitive:
    """Fit a quaternion primitive to one or several demonstrations of any durations.

    `demonstrations`: each with (T_l, 4) orientations.
    """
    weights = kernels.forcing_weights(_forcing_targets(demonstrations), None, method, kernel_count)
    return _fitted(Boundaries.of(demonstrations), weights)


def fit_quaternion_subsets(
    demonstrations: Sequence[OrientationTrajectory], kernel_count: int = kernels.KERNEL_COUNT
) -> SubsetFit[QuaternionPrimitive]:
    """As `fit_quaternion`, for some of the demonstrations at a time; samples are read only once."""
    ends = Boundaries.of(demonstrations)
    equations = kernels.NormalEquations.of(_forcing_targets(demonstrations), kernel_count)

    def fit(used: np.ndarray, method: kernels.Regression) -> QuaternionPrimitive:
        return _fitted(ends.of_some(used), equations.weights(used, None, method))

    return fit


def fit_rhythmic_quaternion(
    demonstrations: Sequence[OrientationTrajectory],
    rhythms: Sequence[Rhythm],
    kernel_count: int = kernels.KERNEL_COUNT,
) -> QuaternionPrimitive:
    """As `vector.fit_rhythmic`, in the tangent space of the orientation, and with amplitudes of 1."""
    rows, targets = [], []
    for path, rhythm in zip(demonstrations, rhythms, strict=True):
        tau = path.duration / rhythm.cycles
        rows.append(rhythmic.features(path.time / tau, rhythm, kernel_count))
        baseline = rows[-1][:, -1:] * quaternion.difference(path.orientation[0], path.orientation[-1])
        targets.append(forcing_target(path, tau, forcing=baseline[0]) - baseline)
    amplitudes = np.ones(len(rows))
    weights = rhythmic.fitted(rows, targets, amplitudes)
    ends = Boundaries.of(demonstrations)
    origin = quaternion.mean(ends.start)
    starts, goals = (quaternion.difference(turns, origin) for turns in (ends.start, ends.goal))
    typical, *vectors = rhythmic.mean_ends(weights, amplitudes, rhythms, starts, goals)
    start, goal = (quaternion.product(quaternion.from_rotation_vector(vector), origin) for vector in vectors)
    return QuaternionPrimitive(weights, start, goal, *ends.over(rhythms, typical), rhythm=typical)


def _forcing_targets(demonstrations: Sequence[OrientationTrajectory]) -> list[np.ndarray]:
    return [forcing_target(path, canonical.time_constant(path.duration)) for path in demonstrations]


def _fitted(ends: Boundaries, weights: np.ndarray) -> QuaternionPrimitive:
    start, goal = quaternion.mean(ends.start), quaternion.mean(ends.goal)
    return QuaternionPrimitive(weights, start, goal, *ends.initial_state)


def initial_goal(
    orientation: np.ndarray,
    velocity: np.ndarray | float,
    acceleration: np.ndarray | float,
    tau: float,
    forcing: np.ndarray | float = 0.0,
) -> np.ndarray:
    """Evolving goal Q_g0 (..., 4) at which the system starts with a given acceleration (eq. IV.13, IV.14).

    The initial acceleration is met while |(tau^2 wd - f) / ALPHA + tau w| / BETA < pi, since a goal further
    than half a turn away is indistinguishable from one on the other side. `orientation`: (..., 4).
    `velocity`, `acceleration`: (..., 3) rad/s, rad/s^2. `forcing`: (..., 3) f + c at the start.
    """
    vector = ((tau**2 * np.asarray(acceleration) - forcing) / ALPHA + tau * np.asarray(velocity)) / BETA
    return quaternion.product(quaternion.from_rotation_vector(vector), orientation)


def goal_path(goal: np.ndarray, first: np.ndarray, times: np.ndarray, tau: float) -> np.ndarray:
    """Evolving goal Q_g (..., T, 4) over time, along the geodesic to the steady goal (eq. IV.11).

    `goal`: (4,) steady goal Q_G. `first`: (..., 4) initial goal Q_g0. `times`: (T,) s.
    """
    remaining = quaternion.difference(first, goal)[..., None, :] * np.exp(-ALPHA_G * times / tau)[:, None]
    return quaternion.product(quaternion.from_rotation_vector(remaining), goal)


def forcing_target(
    path: OrientationTrajectory,
    tau: float,
    goal: np.ndarray | None = None,
    forcing: np.ndarray | float = 0.0,
) -> np.ndarray:
    """Forcing term (T, 3) that reproduces a demonstration (eq. IV.9).

    `goal`: (4,), default its end. `forcing`: (3,) the term at the start, as in `initial_goal`.
    """
    state = path.orientation[0], path.angular_velocity[0], path.angular_acceleration[0]
    first = initial_goal(*state, tau, forcing)
    goal = path.orientation[-1] if goal is None else goal
    error = quaternion.difference(goal_path(goal, first, path.time, tau), path.orientation)
    return tau**2 * path.angular_acceleration - ALPHA * (BETA * error - tau * path.angular_velocity)


def unroll(
    start: np.ndarray,
    goal: np.ndarray,
    forcing: np.ndarray,
    dt: float,
    tau: float,
    velocity: np.ndarray | float = 0.0,
    acceleration: np.ndarray | float = 0.0,
    coupling: Coupling | None = None,
) -> OrientationTrajectory:
    """Integrate the orientation system (eq. IV.3), for one movement or a batch of forcing terms (..., T, 3).

    As `transformation.unroll`, from `start` to `goal` (4,); `velocity`, `acceleration`: (3,) rad/s, rad/s^2.
    Returns (..., T, 4) orientations.
    """
    batch, samples = forcing.shape[:-2], forcing.shape[-2]
    times = dt * np.arange(samples)
    q = np.array(np.broadcast_to(start, (*batch, 4)), dtype=float)
    v = np.array(np.broadcast_to(tau * np.asarray(velocity), (*batch, 3)), dtype=float)
    first = 0.0 if coupling is None else coupling(0, q.copy(), v / tau)
    first_goal = initial_goal(q, v / tau, acceleration, tau, forcing[..., 0, :] + first)
    remaining = quaternion.difference(first_goal, goal).reshape(-1, 3)
    steady = np.array(np.broadcast_to(goal, (len(remaining), 4)), dtype=float)
    flat = np.ascontiguousarray(forcing, dtype=float).reshape(-1, samples, 3)
    orientation = np.empty((*batch, samples, 4))
    rates = np.empty((2, *batch, samples, 3))  # tau w, tau^2 wd
    arguments = (step_matrix(dt / tau), q.reshape(-1, 4), v.reshape(-1, 3), remaining, flat, steady)
    outputs = (orientation.reshape(-1, samples, 4), rates.reshape(2, -1, samples, 3))
    if coupling is None:
        _unroll(*arguments, *outputs)
    else:
        for k in range(samples):
            c = np.broadcast_to(first if k == 0 else coupling(k, q.copy(), v / tau), v.shape)
            step_batch(k, *arguments, c.reshape(-1, 3), *outputs)
    return OrientationTrajectory(times, orientation, rates[0] / tau, rates[1] / tau**2)


_product = numba.njit(cache=True)(quaternion.product_components)


Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""Return types of compiled functions: unlike arrays, tuples need no allocation."""


@numba.njit(cache=True)
def compiled_difference(target: np.ndarray | Quaternion, q: np.ndarray | Quaternion) -> Vector:
    """Rotation vector from q to the target along the shorter rotation; `quaternion.difference` compiled."""
    r, x, y, z = _product(target, (q[0], -q[1], -q[2], -q[3]))
    sine = np.sqrt(x * x + y * y + z * z)
    factor = 2.0 if sine < 1e-12 else 2.0 * np.arctan2(sine, abs(r)) / sine
    if r < 0.0:
        factor = -factor
    return factor * x, factor * y, factor * z


@numba.njit(cache=True)
def turned(q: np.ndarray, vector: np.ndarray | Vector) -> Quaternion:
    """Q rotated by a rotation vector, normalised."""
    angle = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    factor = 0.5 if angle < 1e-12 else np.sin(0.5 * angle) / angle
    step = (np.cos(0.5 * angle), factor * vector[0], factor * vector[1], factor * vector[2])
    r, x, y, z = _product(step, q)
    norm = np.sqrt(r * r + x * x + y * y + z * z)
    return r / norm, x / norm, y / norm, z / norm


@numba.njit(cache=True)
def step_batch(
    k: int,
    matrix: Array,
    q: Array,
    v: Array,
    remaining: Array,
    forcing: Array,
    goal: Array,
    coupling: Array,
    orientation: Array,
    rates: Array,
) -> None:
    """Record sample k, then advance q (B, 4), v = tau w (B, 3) and the evolving goal by one step in place.

    The goal's remaining error, a rotation vector (B, 3) from the steady goal (B, 4), keeps its direction and
    decays exponentially (eq. IV.11). In the tangent space at q the orientation is the origin and the error a
    known input, while the system's matrix accounts for the rotation of q.
    """
    batch, samples, _ = forcing.shape
    following = min(k + 1, samples - 1)
    angle, rate, turn = matrix[0], matrix[1], np.empty(3)
    for b in range(batch):
        error = compiled_difference(turned(goal[b], remaining[b]), q[b])
        for d in range(3):
            f = forcing[b, k, d] + coupling[b, d]
            change = forcing[b, following, d] - forcing[b, k, d]
            fall = remaining[b, d]
            steady = f + ALPHA * BETA * (error[d] - fall)
            rates[0, b, k, d] = v[b, d]
            rates[1, b, k, d] = f + ALPHA * BETA * error[d] - ALPHA * v[b, d]
            turn[d] = angle[1] * v[b, d] + angle[2] * fall + angle[3] * steady + angle[4] * change
            v[b, d] = rate[1] * v[b, d] + rate[2] * fall + rate[3] * steady + rate[4] * change
            remaining[b, d] = matrix[2, 2] * fall
        orientation[b, k] = q[b]
        q[b] = turned(q[b], turn)


@numba.njit(cache=True)
def _unroll(
    matrix: Array,
    q: Array,
    v: Array,
    remaining: Array,
    forcing: Array,
    goal: Array,
    orientation: Array,
    rates: Array,
) -> None:
    """All steps without feedback."""
    no_coupling = np.zeros_like(v)
    for k in range(forcing.shape[1]):
        step_batch(k, matrix, q, v, remaining, forcing, goal, no_coupling, orientation, rates)
