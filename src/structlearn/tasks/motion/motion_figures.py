"""Figures of joint logs: errors by joint, torques, loads over time, delays of the drives."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.core.metrics import matching
from structlearn.palette import BLACK, BLUE, CATEGORICAL_COLOURS, GREY, OCHRE
from structlearn.reporting.figure_style import Drawing, legend, panel, styled
from structlearn.rigid_body.motion import Motion
from structlearn.tasks.motion.motion_results import BEST, BOUNDS, LOOKS, URDF, MotionResults
from structlearn.tasks.motion.parameters import CARRYING, DELAY, EMPTY, LEARNED

# Models whose torques are drawn beside the measured ones
TRACED = (URDF, ("mlp", "none"), (BEST, "viscous"), (BEST, "coulomb"))
TRACED_JOINTS = 4  # number of joints with drawn torques: those with the largest errors

# Stages while a load is followed: label and background colour
STAGES = {
    LEARNED: ("empty:\nlearned from", "#e9ebee"),
    EMPTY: ("empty: another\nmotion", "#ffffff"),
    CARRYING: ("with the load", "#e3eef5"),
}


def motion_figures(results: MotionResults) -> dict[str, Drawing | Sequence[Drawing]]:
    """All figures, keyed by name."""
    worst = results.test.loc[results.best].sort_values(ascending=False, kind="stable").index[:TRACED_JOINTS]
    first, *others = [torque_panel(results, joint) for joint in worst]
    drawn: dict[str, Drawing | Sequence[Drawing]] = {"motion": [joint_errors_panel(results), first]}
    if others:
        drawn["motion_torques"] = others
    if "gains" in results:
        drawn["motion_drives"] = delay_panel(results)
    if results.carried_logs:
        drawn["motion_load"] = [load_panel(results, log) for log in results.carried_logs]
    return drawn


@styled
def joint_errors_panel(results: MotionResults) -> Figure:
    """NMSE by joint and model, with intervals for the model written as URDF."""
    figure, axes = panel("Held-out motion", 3.5, xlabel="joint", ylabel="NMSE", yscale="log")
    for key, look in LOOKS.items():
        if key in results.test.index and (key[0] != BOUNDS or key == results.bounds):
            style: dict[str, Any] = {"marker": "o", "markersize": 4, "color": look.colour, "label": look.name}
            axes.plot(results.joints, results.test.loc[key], "--" if key[0] == BOUNDS else "-", **style)
    best = [drawn.evidence() for drawn in results.joint_nmse(results.tested, results.best).values()]
    ends, colour = (
        ([evidence.low for evidence in best], [evidence.high for evidence in best]),
        LOOKS[results.best].colour,
    )
    axes.vlines(results.joints, *ends, color=colour, linewidth=2.5, alpha=0.5)
    axes.set_xticks(results.joints)
    return legend(figure)


@styled
def torque_panel(results: MotionResults, joint: int) -> Figure:
    """Torque of one joint, measured and predicted."""
    title = f"Joint {joint}: {results.names[joint - 1]}"
    figure, axes = panel(title, 3.5, xlabel="time of the motion (s)", ylabel="torque (N m)")
    traces = matching(results["traces"], joint=joint)
    axes.plot(traces["time_s"], traces["measured"], color=BLACK, linewidth=2.4, alpha=0.35, label="measured")
    for key in dict.fromkeys((*TRACED, results.best)):
        name = "_".join(key).removesuffix("_none")
        if name in traces:
            axes.plot(
                traces["time_s"], traces[name], color=LOOKS[key].colour, linewidth=1.0, label=LOOKS[key].name
            )
    low, high = traces["measured"].min(), traces["measured"].max()
    axes.set_ylim(low - 0.5 * (high - low), high + 0.5 * (high - low))
    return legend(figure)


@styled
def load_panel(results: MotionResults, log: str) -> Figure:
    """Estimated mass in the hand over time."""
    load = results.parameters.load
    assert load is not None
    title = f"Log {results.carried_logs.index(log) + 1}: estimated load over time"
    figure, axes = panel(title, 3.6, xlabel="time (s)", ylabel="mass in the hand (kg)")
    carried, true = matching(results["carried"], log=log), load.known_kg
    top = 1.25 * max(true, carried["mass_kg"].max())
    for stage, part in carried.groupby("stage", sort=False):
        words, background = STAGES[stage]
        start, end = part["time_s"].iloc[0] - part["since_s"].iloc[0], part["time_s"].iloc[-1]
        axes.axvspan(start, end, color=background, alpha=0.6, linewidth=0)
        axes.text(0.5 * (start + end), 0.97 * top, words, ha="center", va="top", fontsize=8)
        if stage == CARRYING:
            axes.fill_between([start, end], 0.95 * true, 1.05 * true, color=GREY, alpha=0.35, linewidth=0)
            axes.plot([start, end], [true, true], color=BLACK, linewidth=2.0, label=f"published: {true:g} kg")
            if start + load.settled_s < end:  # ends below the text
                axes.axvline(start + load.settled_s, ymax=0.9, color=BLACK, linestyle=":", linewidth=1.0)
    axes.plot(carried["time_s"], carried["mass_kg"], color=BLUE, linewidth=1.8, label="found so far")
    axes.axhline(0.0, color=BLACK, linewidth=0.7)
    axes.set(xlim=(0.0, carried["time_s"].max()), ylim=(min(-0.3, 1.1 * carried["mass_kg"].min()), top))
    return legend(figure)


@styled
def torque_check_panels(table: pd.DataFrame) -> list[Figure]:
    """Mean torque of each joint by the URDF over the measured one, by sign; `table`: `payload_torques`."""
    figures, ends = [], np.array([-1.05, 1.05]) * table["measured_n_m"].abs().max()
    for payload, title in ((False, "URDF alone"), (True, "URDF with the best payload")):
        figure, axes = panel(title, xlabel="measured, mean (N m)", ylabel="model, mean (N m)")
        axes.plot(ends, ends, color=GREY, linewidth=0.9, zorder=0)
        for sign, words, colour in ((1, "sign as recorded", OCHRE), (-1, "sign reversed", BLUE)):
            its = matching(table, payload=payload, sign=sign)
            axes.plot(its["measured_n_m"], its["model_n_m"], "o", color=colour, markersize=4.5, label=words)
        figures.append(legend(figure))
    return figures


@styled
def delay_panel(results: MotionResults) -> Figure:
    """Torque residual of each joint over the assumed delay of its current."""
    labels = {"xlabel": "delay assumed (ms)", "ylabel": "squares / least"}
    figure, axes = panel("Delay of the currents", 3.4, **labels)
    curves = matching(results["delay_curves"], log=results.train_log)
    for colour, (joint, curve) in zip(CATEGORICAL_COLOURS, curves.groupby("joint"), strict=False):
        axes.plot(1e3 * curve["delay_s"], curve["squares"], color=colour, label=f"joint {joint}")
        axes.plot(results.drive(DELAY, joint).value, 1.0, "o", color=colour, markersize=5)
    axes.set_ylim(0.99, 1.0 + 0.7 * (curves["squares"].max() - 1.0))
    return legend(figure, 3)


@styled
def share_panels(joints: pd.DataFrame, times: np.ndarray, motion: Motion) -> list[Figure]:
    """Positions within their ranges, velocities and torques relative to their limits."""
    lower, upper = joints["lower"].replace(-np.inf, -np.pi), joints["upper"].replace(np.inf, np.pi)
    middle, half = 0.5 * (upper + lower), 0.5 * (upper - lower)
    shares = {
        "position": (motion.q - middle.to_numpy()) / half.to_numpy(),
        "velocity": motion.qd / joints["velocity_limit"].to_numpy(),
        "torque of the URDF": motion.torque / joints["torque_limit_n_m"].to_numpy(),
    }
    figures = []
    for name, values in shares.items():
        figure, axes = panel(name, xlabel="time (s)", ylabel="share of the limit", ylim=(-1.05, 1.05))
        for place, joint in enumerate(joints["joint"]):
            colour = CATEGORICAL_COLOURS[place % len(CATEGORICAL_COLOURS)]
            axes.plot(times, values[:, place], color=colour, linewidth=1.2, label=joint)
        figures.append(legend(figure, 3))
    return figures


@styled
def gain_panel(gains: pd.DataFrame) -> Figure:
    """Errors after random trajectories relative to those after the designed one."""
    figure, axes = panel(
        "Errors after random trajectories", xlabel="random trajectory", ylabel="times larger"
    )
    axes.bar(gains["random_trajectory"], np.sort(gains["gain"])[::-1], color=BLUE)
    axes.axhline(1.0, color=GREY, linewidth=1.5)
    return figure
