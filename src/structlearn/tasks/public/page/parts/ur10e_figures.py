"""Figures of the UR10e: the load found over time, errors of models, delays of currents, gains."""

from collections.abc import Sequence
from textwrap import fill

import numpy as np
from matplotlib.figure import Figure

from structlearn.core.block_bootstrap import percentiles
from structlearn.palette import BLACK, BLUE, CATEGORICAL_COLOURS, GREY, LIGHT_GREY, VERMILION
from structlearn.reporting.figure_style import Drawing, styled
from structlearn.reporting.panels import legend, panel
from structlearn.tasks.public.page.parts.panda_part import joint_errors_panel, torque_panel
from structlearn.tasks.public.page.parts.ur10e_results import Ur10eResults, chosen

TRACED_JOINTS = (2, 5)

STAGES = {
    "empty, learned from": ("empty:\nlearned from", LIGHT_GREY),
    "empty, another motion": ("empty: another\nmotion", "#ffffff"),
    "with the load": ("with the load", "#e3eef5"),
}
"""What the arm does while the load is followed, and the ground behind it."""


def ur10e_pictures(results: Ur10eResults) -> dict[str, Drawing | Sequence[Drawing]]:
    """All figures by name."""
    test = results.tested
    traces = [
        torque_panel(results["traces"], joint, f"Joint {joint}, test motion", "time of the motion (s)")
        for joint in TRACED_JOINTS
    ]
    drawn: dict[str, Drawing | Sequence[Drawing]] = {
        "ur10e_errors": [joint_errors_panel(results.errors[test]), traces[0]],
        "ur10e_drives": [delay_panel(results), gain_panel(results)],
    }
    if results.load_logs:
        drawn["ur10e_load"] = [load_panel(results, log) for log in results.load_logs]
        drawn["ur10e_weighed"] = [weighed_panel(results), traces[1]]
    return drawn


@styled
def load_panel(results: Ur10eResults, log: str) -> Figure:
    """Mass in the hand over time, as it is found while the arm moves."""
    title = f"Log {results.load_logs.index(log) + 1}: the load found over time"
    figure, axes = panel(title, 3.6, xlabel="time (s)", ylabel="mass in the hand (kg)")
    its, true = chosen(results["carried"], log=log), results.of_load.known_kg
    top = 1.25 * max(true, its["mass_kg"].max())
    for stage, part in its.groupby("stage", sort=False):
        words, ground = STAGES[stage]
        start, end = part["time_s"].iloc[0] - part["since_s"].iloc[0], part["time_s"].iloc[-1]
        axes.axvspan(start, end, color=ground, alpha=0.6, linewidth=0)
        axes.text(0.5 * (start + end), 0.97 * top, words, ha="center", va="top", fontsize=8)
        if stage == "with the load":
            axes.fill_between([start, end], 0.95 * true, 1.05 * true, color=GREY, alpha=0.35, linewidth=0)
            axes.plot([start, end], [true, true], color=BLACK, linewidth=2.0, label=f"published: {true:g} kg")
            settled = start + results.of_load.settled_s
            if settled < end:
                axes.axvline(settled, ymax=0.9, color=BLACK, linestyle=":", linewidth=1.0)  # below the words
    axes.plot(its["time_s"], its["mass_kg"], color=VERMILION, linewidth=1.8, label="found so far")
    axes.axhline(0.0, color=BLACK, linewidth=0.7)
    axes.set(xlim=(0.0, its["time_s"].max()), ylim=(min(-0.3, 1.1 * its["mass_kg"].min()), top))
    return legend(figure)


@styled
def weighed_panel(results: Ur10eResults) -> Figure:
    """The load by least squares, by logs and gains, with intervals."""
    figure, axes = panel("The load by least squares", 3.5, xlabel="mass (kg)")
    true, loads = results.of_load.known_kg, results["loads"]
    axes.axvspan(0.98 * true, 1.02 * true, color=GREY, alpha=0.35, linewidth=0)
    axes.axvline(true, color=BLACK, linewidth=1.5)
    pairs = list(dict.fromkeys(loads["pair"]))
    for gains, colour, offset in (("found", BLUE, -0.12), ("quoted", VERMILION, 0.12)):
        for place, pair in enumerate(pairs):
            its = results.load(pair, gains).evidence()
            low, value, high = results.load_kg(its)
            label = None if place else f"with the gains {gains}"
            bars = [[value - low], [high - value]]
            axes.errorbar(value, place + offset, xerr=bars, fmt="o", color=colour, label=label)
    axes.set_yticks(range(len(pairs)), [fill(pair, 12) for pair in pairs], fontsize=7)
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    return legend(figure)


@styled
def delay_panel(results: Ur10eResults) -> Figure:
    """What is left of each joint's torque by the delay that is assumed of its current."""
    figure, axes = panel(
        "How late the currents are", 3.4, xlabel="delay assumed (ms)", ylabel="squares / least"
    )
    its = chosen(results["delay_curves"], log=results.train)
    for colour, (joint, curve) in zip(CATEGORICAL_COLOURS, its.groupby("joint"), strict=False):
        axes.plot(1e3 * curve["delay_s"], curve["squares"], color=colour, label=f"joint {joint}")
        found = results.drive("delay", results.train, joint, 1e3)
        axes.plot(found.value, 1.0, "o", color=colour, markersize=5)
    axes.set_ylim(0.99, 1.0 + 0.7 * (its["squares"].max() - 1.0))
    return legend(figure, 3)


@styled
def gain_panel(results: Ur10eResults) -> Figure:
    """Gains found at rest and in motion, and those quoted."""
    figure, axes = panel("Gains of the drives", 3.4, xlabel="joint", ylabel="gain (N m/A)")
    gains, train = results["gains"], results.train
    known = gains[~gains["assumed"]]
    axes.plot(gains["joint"] + 0.2, gains["quoted"], "x", color=VERMILION, label="quoted")
    if results.of_drives.rest is not None:
        axes.plot(known["joint"] - 0.2, known["found"], "o", color=BLUE, label="at rest")
    assumed = gains[gains["assumed"]]
    if len(assumed):
        axes.plot(
            assumed["joint"] - 0.2, assumed["found"], "o", color=BLUE, fillstyle="none", label="assumed"
        )
    moving = [results.drive("gain in motion", train, joint) for joint in gains["joint"]]
    values = np.array([one.value for one in moving])
    low, high = np.array([percentiles(one.draws) for one in moving]).T
    bars = [values - low, high - values]
    axes.errorbar(gains["joint"], values, yerr=bars, fmt="s", markersize=4, color=GREY, label="in motion")
    axes.set_xticks(gains["joint"])
    return legend(figure, 4)
