"""Fitness of a log for identification, checked before a model learns from it.

A log can be sampled too slowly, have gaps, hold torques that lag the positions, run into torque limits, or
move too little; then some parameters are not determined, whatever the model. How well each combination of
inertias is determined follows from least squares with intervals from blocks (`base_parameters.fit_base`).
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

MOST_SAMPLES = 20_000  # of a motion whose delays are estimated; more would not change them
SATURATED = 0.99  # share of its limit from which a torque may be cut off
STILL_RAD = 0.1  # range in which a joint hardly moves

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
    """Answers for the logs of a motion: `question`, `joint` (from 1; 0: all), `value`, `verdict`.

    Stamps (T,) s of each log are as recorded; the motion is on the clock and filtered, `clock_hz` the rate of
    the clock and the cut-off of the filter, `fit` the base parameters of this motion, with `friction`.
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
    """Answers as text, a line per question: the worst verdict, then the values of all joints."""
    lines = []
    for question, its in table.groupby("question", sort=False):
        worst = max(its["verdict"], key=[YES, DOUBTFUL, NO].index)
        lines.append(f"  {worst:8}  {question}: {', '.join(f'{value:.3g}' for value in its['value'])}")
    return lines


def torque_delays(
    robot: Robot, motion: Motion, rate_hz: float, friction: Sequence[FrictionTerm]
) -> tuple[np.ndarray, np.ndarray]:
    """Delay (n,) s of each joint's torque against the motion, and its effect in % of the torque's std.

    The effect is the delay times the root mean square of the torque's rate.
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
    """Verdict on a value; small values are wrong where `wrong` is below `doubtful`."""
    if wrong < doubtful:
        value, doubtful, wrong = -value, -doubtful, -wrong
    return YES if value <= doubtful else DOUBTFUL if value <= wrong else NO
