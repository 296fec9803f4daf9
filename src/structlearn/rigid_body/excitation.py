"""Trajectories that excite an arm for its identification: D-optimal Fourier series within its limits.

Each joint follows a periodic series (Swevers et al. 1997) that starts and ends at rest,

    q(t) = q0 + sum_k (a_k sin(k w t) - b_k cos(k w t)) / (k w)        sum a_k = 0, sum k b_k = 0

Torques are linear in the parameters to identify, tau = Y theta + noise. With noise proportional to each
joint's torque limit (if the URDF has one), the information on theta is sum Y^T W Y. Maximising its
log-determinant minimises the volume of the confidence ellipsoid, independent of the parameters' units.

A series is scaled into the limits of position and velocity before its evaluation, so these hold for any free
parameters. Excessive torques are penalised, and what excess remains is removed by a longer period.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from pydantic import Field, NonNegativeInt

from structlearn.core.errors import InputError
from structlearn.core.parallel import parallel_map
from structlearn.core.params import Parameters
from structlearn.rigid_body.base_parameters import BaseParameters, base_parameters
from structlearn.rigid_body.friction import FrictionTerm, friction_regressor
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import torque_regressor
from structlearn.rigid_body.robot import Robot
from structlearn.rigid_body.tree import KinematicTree

SAMPLES_PER_WAVE = 20  # per period of the highest harmonic; peaks are underestimated by <= 1.2 %
DIFFERENCE = 1e-6  # step of the free parameters for forward differences
TORQUE_COST = 100.0  # weight of a joint's squared relative excess over its torque limit
STRETCH, STRETCHES = 1.02, 100  # factor per step by which the period grows until torques fit; most steps


class ExcitationParameters(Parameters):
    """Design of an excitation trajectory. Fields: `structlearn defaults`, `excite`."""

    harmonics: int = Field(ge=2)
    period_s: float = Field(gt=0)
    rate_hz: float = Field(gt=0)
    share: float = Field(gt=0, lt=0.988)
    starts: int = Field(ge=1)
    iterations: int = Field(ge=1)
    seed: NonNegativeInt


@dataclass(frozen=True)
class DesignProblem:
    """Design problem: the arm, its limits, and the parameters to identify."""

    tree: KinematicTree  # n joints
    base: BaseParameters  # the r parameters to identify, besides friction
    theta: np.ndarray  # (r,) their values in the URDF, to predict torques
    effort: np.ndarray  # (n,) N m, torque limits; infinite where the URDF has none
    friction: tuple[FrictionTerm, ...]  # friction terms to identify
    harmonics: int  # K
    period_s: float
    share: float  # usable share of velocity and torque limits
    reach: float  # usable share of the position range, about its middle

    @property
    def free(self) -> tuple[int, int]:
        """Shape of the free parameters: per joint a_k, b_k, offset within the range, and amplitude."""
        return len(self.tree.names), 2 * self.harmonics + 2


def design_problem(
    robot: Robot, parameters: ExcitationParameters, friction: Sequence[FrictionTerm] = ()
) -> DesignProblem:
    """Design problem of a robot, with limits and inertias of its URDF."""
    base, effort = base_parameters(robot.tree), robot.model.effortLimit
    return DesignProblem(
        robot.tree,
        base,
        theta=base.values(robot.inertias),
        effort=np.where((effort > 0.0) & np.isfinite(effort), effort, np.inf),
        friction=tuple(friction),
        harmonics=parameters.harmonics,
        period_s=parameters.period_s,
        share=parameters.share,
        reach=parameters.share,
    )


def series(
    problem: DesignProblem, free: np.ndarray, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and accelerations (..., T, n) for free parameters (..., n, 2 K + 2).

    Every series is within the limits of position and velocity.
    """
    order = np.arange(1, problem.harmonics + 1)
    a, b = free[..., : problem.harmonics], free[..., problem.harmonics : -2]
    a = a - a.mean(axis=-1, keepdims=True)  # start at rest: zero velocity and acceleration
    b = b - (b * order).sum(axis=-1, keepdims=True) * order / (order**2).sum()
    place, size = 1.0 / (1.0 + np.exp(-free[..., -2])), 1.0 / (1.0 + np.exp(-free[..., -1]))
    waves = order * 2.0 * np.pi / problem.period_s

    def unscaled(when: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        sine, cosine = np.sin(np.outer(waves, when)), np.cos(np.outer(waves, when))  # (K, T)
        q = (a / waves) @ sine - (b / waves) @ cosine
        return q, a @ cosine + b @ sine, (b * waves) @ cosine - (a * waves) @ sine

    q, qd, _ = unscaled(_rated_times(problem))
    least, span = q.min(axis=-1), np.ptp(q, axis=-1)
    lower, upper = problem.tree.ranges
    room, middle = problem.reach * (upper - lower), 0.5 * (lower + upper)
    fits = np.minimum(room / span, problem.share * problem.tree.velocity / np.abs(qd).max(axis=-1))
    scale = size * fits
    offset = middle - 0.5 * room + place * (room - scale * span) - scale * least
    q, qd, qdd = (np.swapaxes(scale[..., None] * values, -1, -2) for values in unscaled(times))
    return q + offset[..., None, :], qd, qdd


def information(problem: DesignProblem, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Information matrix (..., P, P) of states (..., T, n), for base parameters, then friction."""
    return _rated(problem, q, qd, qdd)[0]


def log_determinant(information: np.ndarray) -> np.ndarray:
    """Log-determinant (...) of information (..., P, P), with columns prescaled; -inf if singular."""
    size = np.sqrt(np.diagonal(information, axis1=-2, axis2=-1))
    size = np.where(size > 0.0, size, 1.0)
    sign, value = np.linalg.slogdet(information / (size[..., :, None] * size[..., None, :]))
    return np.where(sign > 0.0, value + 2.0 * np.log(size).sum(axis=-1), -np.inf)


def design(problem: DesignProblem, starts: int, iterations: int, seed: int) -> list[np.ndarray]:
    """Free parameters of local optima from random starts, sorted from most to least informative."""
    optimised = parallel_map(
        partial(_improved, problem, iterations), random_series(problem, starts, seed), "excitation"
    )
    return [free for _, free in sorted(optimised, key=lambda item: item[0])]


def random_series(problem: DesignProblem, count: int, seed: int) -> np.ndarray:
    """Free parameters (count, n, 2 K + 2) of random series with full amplitude in every joint."""
    free = np.random.default_rng(seed).normal(size=(count, *problem.free))
    free[..., -1] = 3.0
    return free


def limited_motion(problem: DesignProblem, free: np.ndarray, rate_hz: float) -> tuple[np.ndarray, Motion]:
    """Times (T,) s and motion of one period, slowed down until the URDF's torques are within the limits.

    Raises InputError: torques exceed the limits however slowly the arm moves.
    """
    for stretch in STRETCH ** np.arange(STRETCHES):
        slower = replace(problem, period_s=stretch * problem.period_s)
        times = np.arange(int(np.floor(slower.period_s * rate_hz)) + 1) / rate_hz
        states = series(slower, free, times)
        torque = torque_regressor(problem.tree, *states)[..., problem.base.columns] @ problem.theta
        if np.all(np.abs(torque) <= problem.share * problem.effort):
            return times, Motion(*states, torque)
    raise InputError("the arm's torque limits are exceeded by its own weight, however slowly it moves")


def parameter_errors(
    problem: DesignProblem, motion: Motion, noise: np.ndarray, draws: int, seed: int
) -> np.ndarray:
    """RMS errors (P,) of base parameters, then friction, identified by least squares from noisy logs.

    Each log is the motion plus normal torque noise with std (n,) N m; the errors do not depend on the truth.
    """
    rows = _columns(problem, motion.q, motion.qd, motion.qdd) / noise[:, None]
    rows = rows.reshape(-1, rows.shape[-1])
    size = np.linalg.norm(rows, axis=0)
    generator = np.random.default_rng(seed)
    errors = np.linalg.lstsq(rows / size, generator.normal(size=(len(rows), draws)), rcond=None)[0]
    return np.sqrt((errors**2).mean(axis=1)) / size


def _rated_times(problem: DesignProblem) -> np.ndarray:
    count = SAMPLES_PER_WAVE * problem.harmonics
    return np.arange(count) * problem.period_s / count


def _columns(problem: DesignProblem, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Regressor (N, n, P) of base parameters and friction."""
    columns = torque_regressor(problem.tree, q, qd, qdd)[..., problem.base.columns]
    return np.concatenate([columns, friction_regressor(q, qd, problem.friction)], axis=-1)


def _rated(
    problem: DesignProblem, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Information (..., P, P), and the URDF's torques (..., T, n) in N m."""
    columns = _columns(problem, *(values.reshape(-1, q.shape[-1]) for values in (q, qd, qdd)))
    torque = (columns[..., : len(problem.theta)] @ problem.theta).reshape(q.shape)
    weights = np.where(np.isfinite(problem.effort), 1.0 / problem.effort, 1.0)
    rows = (columns * weights[:, None]).reshape(*q.shape[:-2], -1, columns.shape[-1])
    return np.swapaxes(rows, -1, -2) @ rows, torque


def _costs(problem: DesignProblem, free: np.ndarray) -> np.ndarray:
    """Cost (B,) of free parameters (B, n, 2 K + 2): minus mean log-determinant, plus torque excess."""
    known, torque = _rated(problem, *series(problem, free, _rated_times(problem)))
    excess = np.maximum(np.abs(torque).max(axis=-2) / (problem.share * problem.effort) - 1.0, 0.0)
    return TORQUE_COST * (excess**2).sum(axis=-1) - log_determinant(known) / known.shape[-1]


def _improved(problem: DesignProblem, iterations: int, start: np.ndarray) -> tuple[float, np.ndarray]:
    """Cost and free parameters of a local optimum, by L-BFGS with forward differences from a start."""
    from scipy.optimize import minimize

    steps = DIFFERENCE * np.vstack([np.zeros(start.size), np.eye(start.size)])

    def cost(values: np.ndarray) -> tuple[float, np.ndarray]:
        costs = _costs(problem, (values + steps).reshape(-1, *problem.free))
        return costs[0], (costs[1:] - costs[0]) / DIFFERENCE

    optimum = minimize(cost, start.ravel(), jac=True, method="L-BFGS-B", options={"maxiter": iterations})
    return float(optimum.fun), optimum.x.reshape(problem.free)
