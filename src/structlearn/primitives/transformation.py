"""Transformation system with goal evolution, for positions and sensor traces (eq. IV.1, IV.10, IV.12).

    tau^2 xdd = ALPHA (BETA (g - x) - tau xd) + f + c        tau gd = ALPHA_G (G - g)

Given the forcing term f the system is linear, so a step is exact for forcing that is linear between samples
(first-order hold). The coupling term c, known only when the sensor is read, is held over the step. Steps of
any length are stable, and the unrolled path does not depend on the sampling rate.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.linalg import expm

from structlearn.core.compilation import numba
from structlearn.primitives.trajectory import Trajectory

Array = np.ndarray  # in signatures of compiled functions

ALPHA = 25.0
BETA = ALPHA / 4.0
ALPHA_G = ALPHA / 2.0

Coupling = Callable[[int, np.ndarray, np.ndarray], np.ndarray]
"""Coupling term in the loop: (step, x (..., D), xd (..., D)) -> c (..., D). The arrays x and xd are reused
and overwritten by the next step."""


def initial_goal(
    x: np.ndarray, xd: np.ndarray, xdd: np.ndarray | float, tau: float, forcing: np.ndarray | float = 0.0
) -> np.ndarray:
    """Evolving goal at which the system starts with the given acceleration (eq. IV.12).

    All (..., D); `forcing`: f + c at the start, 0 when the phase starts at 1. Returns g_0.
    """
    return x + ((tau**2 * xdd - forcing) / ALPHA + tau * xd) / BETA


compiled_initial_goal: Callable[..., Any] = numba.njit(cache=True)(initial_goal)


def goal_path(goal: np.ndarray, first: np.ndarray, times: np.ndarray, tau: float) -> np.ndarray:
    """Evolving goal g (..., T, D) over time, closed-form (eq. IV.10).

    `goal`: (..., D) steady goal G. `first`: (..., D) initial goal g_0. `times`: (T,) s.
    """
    decay = np.exp(-ALPHA_G * times / tau)[:, None]
    return goal[..., None, :] + decay * (first - goal)[..., None, :]


def forcing_target(trajectory: Trajectory, tau: float) -> np.ndarray:
    """Forcing term f_target (T, D) that reproduces a demonstration (eq. IV.8).

    The goal evolves from the demonstration's own initial state to its last position, as when unrolled.
    """
    path = (trajectory.time, trajectory.position, trajectory.velocity, trajectory.acceleration)
    time, position, velocity, acceleration = (np.ascontiguousarray(signal, dtype=float) for signal in path)
    target = np.empty(position.shape)
    _write_forcing_target(time, position, velocity, acceleration, float(tau), target)
    return target


def unroll(
    start: np.ndarray,
    goal: np.ndarray,
    forcing: np.ndarray,
    dt: float,
    tau: float,
    velocity: np.ndarray | float = 0.0,
    acceleration: np.ndarray | float = 0.0,
    coupling: Coupling | None = None,
) -> Trajectory:
    """Integrate the transformation system, for one movement or a batch of them.

    Args:
        start: (..., D) initial position.
        goal: (..., D) steady goal G.
        forcing: (..., T, D) forcing term at the samples.
        dt: sampling interval in s.
        tau: time constant in s, common to the batch.
        velocity: (..., D) initial velocity.
        acceleration: (..., D) initial acceleration; it sets the initial goal (eq. IV.12).
        coupling: feedback in the loop, called once per step for the whole batch.

    Returns:
        Trajectory with (..., T, D) signals; its first sample is the initial state.
    """
    batch = np.broadcast(start, goal, forcing[..., 0, :]).shape
    samples, axes = forcing.shape[-2:]
    forcing = np.ascontiguousarray(np.broadcast_to(forcing, (*batch[:-1], samples, axes)), dtype=float)
    (steady, x, xd), state = np.empty((3, *batch)), np.empty((3, *batch))
    steady[...], x[...], xd[...] = goal, start, velocity
    first = 0.0 if coupling is None else coupling(0, x, xd)
    state[0], state[1] = x - steady, tau * xd
    state[2] = initial_goal(x, xd, acceleration, tau, forcing[..., 0, :] + first) - steady
    path = np.empty((3, *forcing.shape))  # x, xd, xdd: written once, so large batches cost no copies
    arguments = (
        step_matrix(dt / tau),
        float(tau),
        steady.reshape(-1, axes),
        state.reshape(3, -1, axes),
        forcing.reshape(-1, samples, axes),
    )
    flat_path = path.reshape(3, -1, samples, axes)
    if coupling is None:
        _unroll(*arguments, flat_path)
    else:
        held = np.empty(batch)
        for k in range(samples):
            held[...] = first if k == 0 else coupling(k, x, xd)
            step_batch(k, *arguments, held.reshape(-1, axes), flat_path)
            np.add(state[0], steady, out=x)
            np.divide(state[1], tau, out=xd)
    return Trajectory(dt * np.arange(samples), *path)


@lru_cache
def step_matrix(step: float) -> np.ndarray:
    """Exact transition (3, 5) of the state (x - G, tau xd, g - G) for inputs (f, change of f) over one step.

    `step`: dt / tau, dimensionless. From the exponential of the system extended by its inputs.
    """
    rates = np.zeros((5, 5))
    rates[0, 1] = 1.0
    rates[1, :4] = [-ALPHA * BETA, -ALPHA, ALPHA * BETA, 1.0]
    rates[2, 2] = -ALPHA_G
    rates[3, 4] = 1.0 / step  # f changes by its increment over the step
    matrix = np.ascontiguousarray(expm(rates * step)[:3])
    matrix.flags.writeable = False
    return matrix


@numba.njit(cache=True)
def _advance(
    b: int,
    k: int,
    d: int,
    matrix: Array,
    tau: float,
    goal: Array,
    state: Array,
    forcing: Array,
    coupling: float,
    path: Array,
) -> None:
    """Record sample k of axis d of movement b in the path (3, B, T, D), then advance its state in place.

    goal: (B, D).   state: (3, B, D).   forcing: (B, T, D).   coupling: held over the step.
    """
    x, v, g = state[0, b, d], state[1, b, d], state[2, b, d]
    change = forcing[b, min(k + 1, forcing.shape[1] - 1), d] - forcing[b, k, d]
    f = forcing[b, k, d] + coupling
    path[0, b, k, d] = x + goal[b, d]
    path[1, b, k, d] = v / tau
    path[2, b, k, d] = (ALPHA * (BETA * (g - x) - v) + f) / tau**2
    for row in range(3):
        state[row, b, d] = (
            matrix[row, 0] * x
            + matrix[row, 1] * v
            + matrix[row, 2] * g
            + matrix[row, 3] * f
            + matrix[row, 4] * change
        )


@numba.njit(cache=True)
def step_batch(
    k: int, matrix: Array, tau: float, goal: Array, state: Array, forcing: Array, coupling: Array, path: Array
) -> None:
    """One step of the whole batch with its coupling (B, D)."""
    batch, _, axes = forcing.shape
    for b in range(batch):
        for d in range(axes):
            _advance(b, k, d, matrix, tau, goal, state, forcing, coupling[b, d], path)


@numba.njit(cache=True)
def _unroll(matrix: Array, tau: float, goal: Array, state: Array, forcing: Array, path: Array) -> None:
    """All steps without feedback, one movement after the other, since each is contiguous in memory."""
    batch, samples, axes = forcing.shape
    for b in range(batch):
        for k in range(samples):
            for d in range(axes):
                _advance(b, k, d, matrix, tau, goal, state, forcing, 0.0, path)


@numba.njit(cache=True)
def _write_forcing_target(times: Array, x: Array, xd: Array, xdd: Array, tau: float, target: Array) -> None:
    """Write `forcing_target` of times (T,) and signals (T, D) without temporary arrays."""
    samples, axes = x.shape
    first = np.empty(axes)
    for d in range(axes):
        first[d] = compiled_initial_goal(x[0, d], xd[0, d], xdd[0, d], tau, 0.0) - x[-1, d]
    for k in range(samples):
        decay = np.exp(-ALPHA_G * times[k] / tau)
        for d in range(axes):
            g = x[-1, d] + decay * first[d]
            target[k, d] = tau**2 * xdd[k, d] - ALPHA * (BETA * (g - x[k, d]) - tau * xd[k, d])
