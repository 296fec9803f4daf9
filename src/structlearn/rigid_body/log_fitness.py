"""Whether a log is fit to identify an arm from, asked before anything is learned from it.

A log can be too slow, have gaps, hold torques of other times than positions, run into torque limits, or move
too little; then some parameters are not determined, whatever the model. How well each combination of inertias
is determined follows from least squares with intervals from blocks of the log (`base_parameters.fit_base`).
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from structlearn.core import signals
from structlearn.rigid_body.base_parameters import BaseFit
from structlearn.rigid_body.drives import current_delays
from structlearn.rigid_body.friction import FrictionTerm
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.tree import Robot

YES, DOUBTFUL, NO = "yes", "doubtful", "no"

LARGEST_DELAY_S, DELAY_STEP_S = 0.04, 0.0025
"""Delays of the torque that are tried, in whole samples: values between samples would have less noise."""

MOST_SAMPLES = 20_000
"""Of a motion whose delays are looked for; more would not change them."""

SATURATED, STILL_RAD = 0.99, 0.1
"""Share of its limit from which a torque may be cut off; range in which a joint hardly moves."""

BOUNDS = {
    "samples per period of the fastest signal kept": (4.0, 2.0),
    "largest gap (periods of it)": (0.5, 1.0),
    "delay of the torque (% of its std)": (5.0, 20.0),
    "torque at its limit (% of samples)": (0.1, 2.0),
    "range (rad)": (2.0 * STILL_RAD, STILL_RAD),
    "condition number": (100.0, 1000.0),
    "parameters not determined (%)": (75.0, 90.0),
}
"""By question: where the answer becomes doubtful, and where it becomes no. Many inertias of an arm are so
small that no log determines them."""

DETERMINED_PERCENT, KNOWN_PERCENT = 100.0, 10.0
"""Half width of an interval, of the parameter's size: beyond, its sign is open; below, it is well known."""


def log_fitness(
    robot: Robot,
    stamps: Sequence[np.ndarray],
    motion: Motion,
    clock_hz: tuple[float, float],
    fit: BaseFit,
    friction: Sequence[FrictionTerm],
) -> pd.DataFrame:
    """Answers for the logs that a motion is cut from, before it is learned from.

    Args:
        robot: n joints.
        stamps: (T,) s of each log, as it was recorded.
        motion: on the clock, filtered.
        clock_hz: rate of the clock, and cut-off of the filter.
        fit: of base parameters to this motion, with `friction`.
        friction: terms.

    Returns:
        `question`, in the order of `BOUNDS`, `joint` (from 1; 0: all), `value`, `verdict` (yes: fit).
    """
    rate_hz, cutoff_hz = clock_hz
    cutoff_hz = min(cutoff_hz, 0.5 * rate_hz)
    steps = np.concatenate([np.diff(its) for its in stamps])
    effort = np.where(robot.model.effortLimit > 0.0, robot.model.effortLimit, np.inf)
    delay, effect = torque_delays(robot, motion, rate_hz, friction)
    undetermined = parameter_percent(fit) > DETERMINED_PERCENT
    values = {
        "samples per period of the fastest signal kept": 1.0 / float(np.median(steps)) / cutoff_hz,
        "largest gap (periods of it)": float(steps.max()) * cutoff_hz,
        "delay of the torque (% of its std)": effect,
        "torque at its limit (% of samples)": 100.0
        * (np.abs(motion.torque) >= SATURATED * effort).mean(axis=0),
        "range (rad)": np.ptp(motion.q, axis=0),
        "condition number": fit.condition,
        "parameters not determined (%)": 100.0 * float(undetermined.mean()),
    }
    rows = [
        (question, joint if np.ndim(values[question]) else 0, value, _verdict(value, *BOUNDS[question]))
        for question in BOUNDS
        for joint, value in enumerate(np.atleast_1d(values[question]), start=1)
    ]
    table = pd.DataFrame(rows, columns=["question", "joint", "value", "verdict"])
    own = table["question"] == "delay of the torque (% of its std)"
    table.loc[own, "delay_ms"] = 1e3 * delay
    return table


def fitness_lines(table: pd.DataFrame) -> list[str]:
    """The answers in words, a line per question: the worst verdict, then the values of all joints."""
    lines = []
    for question, its in table.groupby("question", sort=False):
        worst = max(its["verdict"], key=[YES, DOUBTFUL, NO].index)
        lines.append(f"  {worst:8}  {question}: {', '.join(f'{value:.3g}' for value in its['value'])}")
    return lines


def torque_delays(
    robot: Robot, motion: Motion, rate_hz: float, friction: Sequence[FrictionTerm]
) -> tuple[np.ndarray, np.ndarray]:
    """By how many s (n,) each joint's torque is later than the motion, and what that changes of it.

    The change is the delay times the root mean square of the torque's rate, in % of the torque's std.
    """
    step = max(1, round(DELAY_STEP_S * rate_hz))
    count = max(1, round(LARGEST_DELAY_S * rate_hz / step))
    shifts = step * np.arange(-count, count + 1)
    kept = np.arange(shifts[-1], len(motion) - shifts[-1], max(1, len(motion) // MOST_SAMPLES))
    torques = np.array([motion.torque[kept + shift] for shift in shifts])
    states, blocks = motion.part(kept), (max(1, len(kept) // 20), 2, 0)  # their intervals are not used
    delay, _, _ = current_delays(robot.tree, states, torques, shifts / rate_hz, friction, *blocks)
    rate = signals.derivative(motion.torque, 1.0 / rate_hz)
    return delay, 100.0 * np.abs(delay) * np.sqrt((rate**2).mean(axis=0)) / motion.torque.std(axis=0)


def parameter_percent(fit: BaseFit) -> np.ndarray:
    """(r,) half width of each base parameter's 95 % interval, in % of its size."""
    return 50.0 * (fit.high - fit.low) / np.maximum(np.abs(fit.parameters), np.finfo(float).tiny)


def parameter_table(names: Sequence[str], fit: BaseFit) -> pd.DataFrame:
    """`parameter` (its formula), `percent` of `parameter_percent`, and `determined`, best known first."""
    percent = parameter_percent(fit)
    verdicts = [_verdict(value, KNOWN_PERCENT, DETERMINED_PERCENT) for value in percent]
    table = pd.DataFrame({"parameter": names, "percent": percent, "determined": verdicts})
    return table.sort_values("percent", ignore_index=True)


def _verdict(value: float, doubtful: float, wrong: float) -> str:
    """Where `wrong` is below `doubtful`, small values are the wrong ones."""
    if wrong < doubtful:
        value, doubtful, wrong = -value, -doubtful, -wrong
    return YES if value <= doubtful else DOUBTFUL if value <= wrong else NO
