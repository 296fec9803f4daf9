"""Figures of an arm's logs: errors by joint, torques, the load over time, delays and gains of the drives."""

from collections.abc import Sequence
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.core.metrics import percentiles
from structlearn.palette import BLACK, BLUE, CATEGORICAL_COLOURS, GREY, ORANGE
from structlearn.reporting.figure_style import Drawing, legend, panel, styled
from structlearn.tasks.motion.motion_results import (
    BEST,
    BOUNDS,
    CARRYING,
    EMPTY,
    FRICTIONS,
    LEARNED,
    LOOKS,
    URDF,
    MotionResults,
    chosen,
)

TRACED = (URDF, ("mlp", "none"), (BEST, "viscous"), (BEST, "coulomb"), (BEST, "offset"))
"""Models whose torques are drawn beside the measured ones."""

TRACED_JOINTS = 4
"""Joints that are predicted worst, whose torques are drawn."""

STAGES = {
    LEARNED: ("empty:\nlearned from", "#e9ebee"),
    EMPTY: ("empty: another\nmotion", "#ffffff"),
    CARRYING: ("with the load", "#e3eef5"),
}
"""What the arm does while the load is followed, and the ground behind it."""


def motion_figures(results: MotionResults) -> dict[str, Drawing | Sequence[Drawing]]:
    """All figures by name."""
    worst = results.test.loc[results.best].sort_values(ascending=False).index[:TRACED_JOINTS]
    first, *others = [torque_panel(results, joint) for joint in worst]
    drawn: dict[str, Drawing | Sequence[Drawing]] = {"motion": [errors_panel(results), first]}
    if others:
        drawn["motion_torques"] = others
    if "gains" in results.tables:
        drawn["motion_drives"] = [delay_panel(results), gain_panel(results)]
    if results.carried_logs:
        drawn["motion_load"] = [load_panel(results, log) for log in results.carried_logs]
        drawn["motion_weighed"] = weighed_panel(results)
    return drawn


@styled
def errors_panel(results: MotionResults) -> Figure:
    """NMSE over the joints by model; intervals for the model that is written."""
    figure, axes = panel("Motion not learned from", 3.5, xlabel="joint", ylabel="NMSE", yscale="log")
    others = {(BOUNDS, friction) for friction in FRICTIONS} - {results.bounds}
    for key in (key for key in LOOKS if key in results.test.index and key not in others):
        its, line = results.test.loc[key], "--" if key[0] == BOUNDS else "-"
        axes.plot(
            its.index, its, line, marker="o", markersize=4, color=LOOKS[key].colour, label=LOOKS[key].name
        )
    _, draws, _ = results.nmse(results.tested, results.best)
    axes.vlines(
        results.joints, *percentiles(draws), color=LOOKS[results.best].colour, linewidth=2.5, alpha=0.5
    )
    axes.set_xticks(results.joints)
    return legend(figure)


@styled
def torque_panel(results: MotionResults, joint: int) -> Figure:
    """Torque of one joint, measured and predicted."""
    title = f"Joint {joint}: {results.names[joint - 1]}"
    figure, axes = panel(title, 3.5, xlabel="time of the motion (s)", ylabel="torque (N m)")
    its = chosen(results["traces"], joint=joint)
    axes.plot(its["time_s"], its["measured"], color=BLACK, linewidth=2.4, alpha=0.35, label="measured")
    for key in TRACED:
        name = "_".join(key).removesuffix("_none")
        if name in its and (key[1] != "offset" or key == results.best):
            axes.plot(its["time_s"], its[name], color=LOOKS[key].colour, linewidth=1.0, label=LOOKS[key].name)
    low, high = its["measured"].min(), its["measured"].max()
    axes.set_ylim(low - 0.5 * (high - low), high + 0.5 * (high - low))
    return legend(figure)


@styled
def load_panel(results: MotionResults, log: str) -> Figure:
    """Mass in the hand over time, as it is found while the arm moves."""
    title = f"Log {results.carried_logs.index(log) + 1}: the load found over time"
    figure, axes = panel(title, 3.6, xlabel="time (s)", ylabel="mass in the hand (kg)")
    its, true = chosen(results["carried"], log=log), results.of_load.known_kg
    top = 1.25 * max(true, its["mass_kg"].max())
    for stage, part in its.groupby("stage", sort=False):
        words, ground = STAGES[stage]
        start, end = part["time_s"].iloc[0] - part["since_s"].iloc[0], part["time_s"].iloc[-1]
        axes.axvspan(start, end, color=ground, alpha=0.6, linewidth=0)
        axes.text(0.5 * (start + end), 0.97 * top, words, ha="center", va="top", fontsize=8)
        if stage == CARRYING:
            axes.fill_between([start, end], 0.95 * true, 1.05 * true, color=GREY, alpha=0.35, linewidth=0)
            axes.plot([start, end], [true, true], color=BLACK, linewidth=2.0, label=f"published: {true:g} kg")
            settled = start + results.of_load.settled_s
            if settled < end:
                axes.axvline(settled, ymax=0.9, color=BLACK, linestyle=":", linewidth=1.0)  # below the words
    axes.plot(its["time_s"], its["mass_kg"], color=ORANGE, linewidth=1.8, label="found so far")
    axes.axhline(0.0, color=BLACK, linewidth=0.7)
    axes.set(xlim=(0.0, its["time_s"].max()), ylim=(min(-0.3, 1.1 * its["mass_kg"].min()), top))
    return legend(figure)


@styled
def weighed_panel(results: MotionResults) -> Figure:
    """The load by least squares, by logs and gains, with intervals."""
    figure, axes = panel("The load by least squares", 3.5, xlabel="mass (kg)")
    true, loads = results.of_load.known_kg, results["loads"]
    axes.axvspan(0.98 * true, 1.02 * true, color=GREY, alpha=0.35, linewidth=0)
    axes.axvline(true, color=BLACK, linewidth=1.5)
    pairs = list(dict.fromkeys(loads["pair"]))
    for gains, colour, offset in (("found", BLUE, -0.12), ("quoted", ORANGE, 0.12)):
        its = [results.load_error(pair, gains) for pair in chosen(loads, gains=gains)["pair"]]
        masses = np.array([one.scaled(0.01 * true, true).value for one in its])
        ends = np.array([percentiles(one.scaled(0.01 * true, true).draws) for one in its]).reshape(-1, 2).T
        places = np.arange(len(its)) + offset
        label = f"with the gains {gains}" if len(its) else None
        axes.errorbar(masses, places, xerr=np.abs(ends - masses), fmt="o", color=colour, label=label)
    axes.set_yticks(range(len(pairs)), [fill(pair, 12) for pair in pairs], fontsize=7)
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    return legend(figure)


@styled
def delay_panel(results: MotionResults) -> Figure:
    """What is left of each joint's torque by the delay that is assumed of its current."""
    figure, axes = panel(
        "How late the currents are", 3.4, xlabel="delay assumed (ms)", ylabel="squares / least"
    )
    its = chosen(results["delay_curves"], log=results.train_log)
    for colour, (joint, curve) in zip(CATEGORICAL_COLOURS, its.groupby("joint"), strict=False):
        axes.plot(1e3 * curve["delay_s"], curve["squares"], color=colour, label=f"joint {joint}")
        found = 1e3 * results.drive("delay", results.train_log, joint).value
        axes.plot(found, 1.0, "o", color=colour, markersize=5)
    axes.set_ylim(0.99, 1.0 + 0.7 * (its["squares"].max() - 1.0))
    return legend(figure, 3)


@styled
def gain_panel(results: MotionResults) -> Figure:
    """Gains found at rest and in motion, and those quoted."""
    figure, axes = panel("Gains of the drives", 3.4, xlabel="joint", ylabel="gain (N m/A)")
    gains: pd.DataFrame = results["gains"]
    axes.plot(gains["joint"] + 0.2, gains["quoted"], "x", color=ORANGE, label="quoted")
    known = gains[~gains["assumed"]] if results.rest_log else gains[:0]
    axes.plot(known["joint"] - 0.2, known["found"], "o", color=BLUE, label="at rest")
    assumed = gains[gains["assumed"]]
    axes.plot(assumed["joint"] - 0.2, assumed["found"], "o", color=BLUE, fillstyle="none", label="assumed")
    moving = [results.drive("gain in motion", results.train_log, joint) for joint in gains["joint"]]
    values = np.array([one.value for one in moving])
    bars = np.abs(np.array([percentiles(one.draws) for one in moving]).T - values)
    axes.errorbar(gains["joint"], values, yerr=bars, fmt="s", markersize=4, color=GREY, label="in motion")
    axes.set_xticks(gains["joint"])
    return legend(figure, 4)
