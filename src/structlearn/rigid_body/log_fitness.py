"""Whether a log is fit for learning dynamics, and the gains and delays of its drives.

    tau = k i(t + d)        k: gain in N m/A, d: delay of the measured current in s

At rest the controller commands the current for its model's torque, so k is their ratio. In motion the current
also overcomes friction, which is modelled as a smooth function of the velocity.

A log can be sampled too slowly, have gaps, contain torques that lag the positions, reach torque limits, or
move too little; then some parameters are not identifiable by any model. How well each base parameter is
determined follows from least squares with block-bootstrap intervals (`base_parameters.fit_base`).
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from structlearn.core import signals
from structlearn.core.metrics import block_count, block_sums, drawn_counts
from structlearn.rigid_body.base_parameters import BaseFit
from structlearn.rigid_body.friction import FrictionTerm, friction_columns
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import torque_regressor
from structlearn.rigid_body.robot import Robot
from structlearn.rigid_body.tree import KinematicTree

LEAST_CURRENT_A = 0.01  # below it the gain cannot be measured: the axis is vertical, or carries nothing
TURNING_RAD_S = 0.02  # below it the sign of the velocity, and so of the friction, is uncertain
STRIBECK_RAD_S = 0.1  # velocity at which static friction has decayed
INDEPENDENT = 1e-7  # singular values of a regressor below this share of the largest are rounding errors

YES, DOUBTFUL, NO = "yes", "doubtful", "no"

LARGEST_DELAY_S, DELAY_STEP_S = 0.04, 0.0025
"""Largest delay and step of the grid of torque delays, in whole samples: interpolation would reduce noise."""

MOST_SAMPLES = 20_000  # used to estimate delays; more would not change the result
SATURATED = 0.99  # share of the limit above which a torque counts as saturated
STILL_RAD = 0.1  # range below which a joint counts as not moving

DELAY = "delay of the torque (% of its std)"
BOUNDS = {
    "samples per period of the fastest signal kept": (4.0, 2.0),
    "largest gap (periods of it)": (0.5, 1.0),
    DELAY: (5.0, 20.0),
    "torque at its limit (% of samples)": (0.1, 2.0),
    "range (rad)": (2.0 * STILL_RAD, STILL_RAD),
    "condition number": (100.0, 1000.0),
    "parameters not determined (%)": (75.0, 90.0),
}
"""Per question: the bounds at which the answer becomes doubtful, and no. Many inertias of an arm are so
small that no log determines them."""

DETERMINED_PERCENT, KNOWN_PERCENT = 100.0, 10.0
"""Half width of an interval in % of the parameter: above the first, even its sign is undetermined; below the
second, it is well determined."""


def log_fitness(
    robot: Robot,
    stamps: Sequence[np.ndarray],
    motion: Motion,
    clock_hz: tuple[float, float],
    fit: BaseFit,
    friction: Sequence[FrictionTerm],
) -> pd.DataFrame:
    """Fitness of a motion's logs for learning: `question`, `joint` (from 1; 0: all), `value`, `verdict`.

    `stamps` (T,) s are those recorded in each log; `motion` is resampled and filtered; `clock_hz` is the
    sampling rate and the filter's cut-off; `fit` holds the motion's base parameters, fitted with `friction`.
    """
    rate_hz, cutoff_hz = clock_hz
    cutoff_hz = min(cutoff_hz, 0.5 * rate_hz)
    steps = np.concatenate([np.diff(log) for log in stamps])
    effort = np.where(robot.model.effortLimit > 0.0, robot.model.effortLimit, np.inf)
    delay, effect = torque_delays(robot, motion, rate_hz, friction)
    undetermined = parameter_percent(fit) > DETERMINED_PERCENT
    values = (
        1.0 / float(np.median(steps)) / cutoff_hz,
        float(steps.max()) * cutoff_hz,
        effect,
        100.0 * (np.abs(motion.torque) >= SATURATED * effort).mean(axis=0),
        np.ptp(motion.q, axis=0),
        fit.condition,
        100.0 * float(undetermined.mean()),
    )
    rows = [
        (question, joint if np.ndim(numbers) else 0, value, _verdict(value, *bounds))
        for (question, bounds), numbers in zip(BOUNDS.items(), values, strict=True)
        for joint, value in enumerate(np.atleast_1d(numbers), start=1)
    ]
    table = pd.DataFrame(rows, columns=["question", "joint", "value", "verdict"])
    table.loc[table["question"] == DELAY, "delay_ms"] = 1e3 * delay
    return table


def fitness_lines(table: pd.DataFrame) -> list[str]:
    """Text, one line per question: the worst verdict, then the values of all joints."""
    lines = []
    for question, answers in table.groupby("question", sort=False):
        worst = max(answers["verdict"], key=[YES, DOUBTFUL, NO].index)
        lines.append(f"  {worst:8}  {question}: {', '.join(f'{value:.3g}' for value in answers['value'])}")
    return lines


def torque_delays(
    robot: Robot, motion: Motion, rate_hz: float, friction: Sequence[FrictionTerm]
) -> tuple[np.ndarray, np.ndarray]:
    """Delay (n,) s of each joint's torque against the motion, and its effect in % of the torque's std.

    The effect is the delay times the RMS of the torque's time derivative.
    """
    step = max(1, round(DELAY_STEP_S * rate_hz))
    count = max(1, round(LARGEST_DELAY_S * rate_hz / step))
    shifts = step * np.arange(-count, count + 1)
    kept = np.arange(shifts[-1], len(motion) - shifts[-1], max(1, len(motion) // MOST_SAMPLES))
    torques = np.array([motion.torque[kept + shift] for shift in shifts])
    states, blocks = motion.part(kept), (max(1, len(kept) // 20), 2, 0)  # no intervals are needed
    delay, _, _ = current_delays(robot.tree, states, torques, shifts / rate_hz, friction, *blocks)
    rate = signals.derivative(motion.torque, 1.0 / rate_hz)
    return delay, 100.0 * np.abs(delay) * np.sqrt((rate**2).mean(axis=0)) / motion.torque.std(axis=0)


def parameter_percent(fit: BaseFit) -> np.ndarray:
    """(r,) half width of each base parameter's 95 % interval, in % of its size."""
    return 50.0 * (fit.high - fit.low) / np.maximum(np.abs(fit.parameters), np.finfo(float).tiny)


def identified_table(names: Sequence[str], fit: BaseFit) -> pd.DataFrame:
    """Base parameters from best to worst determined: `parameter` (formula), `percent`, `determined`."""
    percent = parameter_percent(fit)
    verdicts = [_verdict(value, KNOWN_PERCENT, DETERMINED_PERCENT) for value in percent]
    table = pd.DataFrame({"parameter": names, "percent": percent, "determined": verdicts})
    return table.sort_values("percent", kind="stable", ignore_index=True)


def _verdict(value: float, doubtful: float, wrong: float) -> str:
    """Verdict on a value; if `wrong` is below `doubtful`, small values are the bad ones."""
    if wrong < doubtful:
        value, doubtful, wrong = -value, -doubtful, -wrong
    return YES if value <= doubtful else DOUBTFUL if value <= wrong else NO


def resting_gains(
    current: np.ndarray, torque: np.ndarray, length: int, draws: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Drive gains from an arm at rest: torque over current, by least squares through zero.

    `current` (N, n) A is as commanded, `torque` (N, n) N m that of the controller's model. The bootstrap
    resamples blocks of `length` samples. Returns (n,) N m/A and (draws, n); NaN where no current flows.
    """
    products = block_sums(np.stack([current * torque, current**2], axis=1), length)  # (B, 2, n)
    counts = drawn_counts(len(products), draws, seed)
    flowing = np.abs(current).max(axis=0) > LEAST_CURRENT_A

    def ratio(sums: np.ndarray) -> np.ndarray:
        safe = np.where(flowing, sums[..., 1, :], 1.0)
        return np.where(flowing, sums[..., 0, :] / safe, np.nan)

    return ratio(products.sum(axis=0)), ratio(np.tensordot(counts, products, 1))


def moving_gains(
    current: np.ndarray, torque: np.ndarray, velocity: np.ndarray, length: int, draws: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Drive gains from a moving arm, `velocity` (N, n) rad/s; friction is a smooth function of the velocity.

    Otherwise as `resting_gains`; torques are those of the links.
    """
    drawn_blocks = drawn_counts(block_count(len(current), length), draws, seed)
    counts = np.vstack([np.ones_like(drawn_blocks[:1]), drawn_blocks])  # first row: all blocks once
    gains, drawn = [], []
    for its_current, its_torque, speed in zip(current.T, torque.T, velocity.T, strict=True):
        sign, turning = np.sign(speed), np.abs(speed) > TURNING_RAD_S
        columns = [its_torque, speed, speed * np.abs(speed), speed**3, sign]
        columns += [sign * np.exp(-np.abs(speed) / STRIBECK_RAD_S), its_current]
        rows = np.stack(columns, axis=1) * turning[:, None]
        size = np.sqrt((rows**2).sum(axis=0))  # equal column norms keep the normal equations accurate
        products = block_sums(np.einsum("np,nq->npq", rows / size, rows / size), length)
        sums = np.tensordot(counts, products, 1)
        coefficients = np.linalg.solve(sums[:, :-1, :-1], sums[:, :-1, -1:])[:, 0, 0] * size[-1] / size[0]
        gains.append(1.0 / coefficients[0])
        drawn.append(1.0 / coefficients[1:])
    return np.array(gains), np.array(drawn).T


def current_delays(
    tree: KinematicTree,
    states: Motion,
    torques: np.ndarray,
    delays_s: np.ndarray,
    friction: Sequence[FrictionTerm],
    length: int,
    draws: int,
    seed: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Delay of each joint's measured current against the motion it drives.

    At every delay (K,) s of a uniform grid, each joint is fitted with its own parameters by least squares to
    the torques (K, N, n) of the currents shifted back by that delay. The delay minimises the squared error,
    interpolated by a parabola through three grid points. The bootstrap resamples blocks of `length` squared
    errors with fixed parameters. The torques of `states` are not used.

    Returns:
        Delays (n,) and (draws, n) in s, and squared errors (K, n) relative to the minimum.
    """
    columns = torque_regressor(tree, states.q, states.qd, states.qdd)
    friction_torques = friction_columns(states.q, states.qd, friction)
    counts = drawn_counts(block_count(len(states), length), draws, seed)
    delays, drawn, curves = [], [], []
    for joint in range(states.joints):
        rows = np.column_stack([columns[:, joint], friction_torques[:, joint]])
        basis, strength, _ = np.linalg.svd(rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-12), False)
        basis = basis[:, strength > INDEPENDENT * strength[0]]
        measured = torques[:, :, joint].T  # (N, K)
        squares = block_sums((measured - basis @ (basis.T @ measured)) ** 2, length)  # (B, K)
        whole = squares.sum(axis=0)
        delays.append(_least(delays_s, whole[None])[0])
        drawn.append(_least(delays_s, counts @ squares))
        curves.append(whole / whole.min())
    return np.array(delays), np.array(drawn).T, np.array(curves).T


def _least(grid: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Minimiser of each row (M, K) by a parabola, or the end of the grid."""
    place = np.clip(values.argmin(axis=1), 1, len(grid) - 2)
    before, here, after = (values[np.arange(len(values)), place + step] for step in (-1, 0, 1))
    bend = before - 2.0 * here + after
    shift = np.where(bend > 0.0, 0.5 * (before - after) / np.where(bend > 0.0, bend, 1.0), 0.0)
    return grid[place] + np.clip(shift, -1.0, 1.0) * (grid[1] - grid[0])
