"""Samples of joint logs that are far beyond the URDF's limits, such as uninitialised memory.

A few efforts of 1e6 N m among thousands decide what is identified, and no later check would name them. They
are left out, and the log is interpolated there like a gap of its clock. Many of them are no accident but
another unit or wrong limits, and are refused.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError
from structlearn.readers.clock import at_row
from structlearn.readers.joint_log import UNITS, Log, MotionLog, signals_of
from structlearn.rigid_body.robot import Robot

FAR = 2.0  # times the limit, or half the range about its middle; real torques exceed limits by less
# Times the magnitude that 99 % of a joint's samples keep, for signals without a limit
UNUSUAL, USUAL = 100.0, 0.99
NO_LIMIT = 1e5  # rad, rad/s, N m, A: no arm has more, and a larger limit of a URDF means none
MOST_SHARE = 0.01  # of a log's samples that may be left out

WORDS = {
    "positions": "position",
    "velocities": "velocity",
    "torques": "effort",
    "currents": "current",
    "desired_currents": "desired current",
    "target_torques": "target torque",
}
RIGHT_UNITS = UNITS | {"positions": "rad, not degrees", "velocities": "rad/s, not degrees/s"}


def possible_samples(robot: Robot, logs: Mapping[str, Log]) -> tuple[dict[str, Log], pd.DataFrame]:
    """Logs without impossible samples, and what was left out.

    `logs`: by name, with joints in the robot's order. The table has a row per log, signal and joint: `log`,
    `samples` (their number), `text` (log, row, joint, value and limit of the first).

    Raises InputError: more than `MOST_SHARE` of a log's samples are impossible.
    """
    bounds = {signal: _bounds(robot, signal, logs) for signal in signals_of(type(next(iter(logs.values()))))}
    kept, rows = {}, []
    for name, log in logs.items():
        beyond = {
            signal: np.abs(getattr(log, signal) - middle) > far for signal, (middle, _, far) in bounds.items()
        }
        left = np.any(list(beyond.values()), axis=(0, 2))
        found = [
            (name, int(places[:, joint].sum()), _first(log, signal, places, joint, *bounds[signal][1:]))
            for signal, places in beyond.items()
            for joint in np.flatnonzero(places.any(axis=0)).tolist()
        ]
        if (share := left.mean()) > MOST_SHARE:
            unit = RIGHT_UNITS[next(signal for signal, places in beyond.items() if places.any())]
            raise InputError(
                f"{found[0][2]}; {100 * share:.3g} % of its samples are as far off, and only "
                f"{100 * MOST_SHARE:g} % may be left out: is it in {unit}, and is the limit right (0: none)?"
            )
        kept[name] = _part(log, ~left) if found else log
        rows += found
    return kept, pd.DataFrame(rows, columns=["log", "samples", "text"])


def _bounds(robot: Robot, signal: str, logs: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middle, limit (0: none) and largest possible distance from the middle of a signal, (n,) each."""
    tree, none = robot.tree, np.zeros(len(robot.tree.names))
    ranged = tree.upper - tree.lower < 2.0 * NO_LIMIT
    lower, upper = np.where(ranged, tree.lower, 0.0), np.where(ranged, tree.upper, 0.0)
    limits = {"positions": 0.5 * (upper - lower), "velocities": tree.velocity}
    limits |= dict.fromkeys(("torques", "target_torques"), robot.model.effortLimit)
    limit = limits.get(signal, none)
    limit = np.where(limit < NO_LIMIT, limit, 0.0)
    middle = 0.5 * (lower + upper) if signal == "positions" else none
    values = np.concatenate([np.abs(getattr(log, signal) - middle) for log in logs.values()])
    usual = np.quantile(values, USUAL, axis=0, method="lower")
    usual = np.where(usual > 0.0, np.minimum(UNUSUAL * usual, NO_LIMIT), NO_LIMIT)
    return middle, limit, np.where(limit > 0.0, FAR * limit, usual)


def _first(
    log: MotionLog, signal: str, places: np.ndarray, joint: int, limits: np.ndarray, far: np.ndarray
) -> str:
    """What is wrong with the first of the places (T, n) of a joint."""
    row, unit, limit = int(np.argmax(places[:, joint])), UNITS[signal], limits[joint]
    value = f"{WORDS[signal]} of joint '{log.joints[joint]}' is {getattr(log, signal)[row, joint]:.4g} {unit}"
    if limit <= 0.0 and far[joint] < NO_LIMIT:
        known = f"{UNUSUAL:g} times what {USUAL:.0%} of its samples stay below"
    elif limit <= 0.0:
        known = "any arm has"
    elif signal == "positions":
        known = f"{FAR:g} times half the URDF's range ({limit:.4g} {unit}) from its middle"
    else:
        known = f"{FAR:g} times the URDF's limit of {limit:.4g} {unit}"
    more = places[:, joint].sum() - 1
    others = f" (and {more} more)" if more else ""
    return f"{log.name}: {at_row(row, log.stamps)}: {value}, more than {known}{others}"


def _part(log: Log, rows: np.ndarray) -> Log:
    columns: dict[str, Any] = {name: getattr(log, name)[rows] for name in ("stamps", *signals_of(type(log)))}
    return replace(log, **columns)
