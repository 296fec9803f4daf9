"""Figures of the dynamics testbed's numbers: learning in epochs and online (figure III.2), and tracking."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from structlearn.palette import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION
from structlearn.reporting.figures import canvas, legend_above, styled
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, NAMES, model_name
from structlearn.rigid_body.seeded_training import SCHEDULED
from structlearn.testbeds.dynamics.page.dynamics_results import IDEAL, REACH, ROBOT, DynamicsResults

LOOKS = {
    GROUND_TRUTH: (BLACK, "-"),
    DEFAULT: (GREY, "-"),
    "mlp": (VERMILION, "-"),
    "mlp_scaled": (ORANGE, "-"),
    "delan": (PURPLE, "-"),
    "nostr": (SKY, "-"),
    "symm": (GREEN, "-"),
    "spd": (BLUE, ":"),
    "tri": (BLUE, "--"),
    "cov": (BLUE, "-"),
}
"""Colour and line of each model."""

LOSS_TITLES = {"raw": "Raw loss", "normalised": "Loss normalised per joint"}

ROBOT_TITLES = {IDEAL: "Arm as in its URDF", ROBOT: "Stand-in for the robot"}

HIGHEST_NMSE = 1e6
"""What diverges leaves the picture there."""

SHOWN_REACH = ("mlp", "delan", "nostr", "cov")
"""Learned models whose reaches are drawn beside those of the ground truth."""


def look(model: str) -> dict[str, str]:
    """Colour and line of a model."""
    colour, line = LOOKS[model.removesuffix(COULOMB)]
    return {"color": colour, "linestyle": line}


@styled
def training_figure(results: DynamicsResults) -> Figure:
    """NMSE, mean over joints and geometric mean over seeds, over the epochs in simulation."""
    rows = results.errors
    rows = rows[(rows["data"] == IDEAL) & (rows["optimiser"] == SCHEDULED)]
    keys = ["loss", "model", "seed", "epoch"]
    curves = rows.groupby(keys, sort=False)["nmse"].mean().reset_index()
    figure = _curves(results, curves, "epoch", results.training.losses)
    for panel in figure.axes:
        panel.axhline(results.training.learning.threshold, color=BLACK, linestyle="--", linewidth=0.9)
        panel.set_xscale("symlog", linthresh=1.0)
        panel.set_xticks(ticks := [0, 1, 2, 5, 10, 20, 40, 64], [str(tick) for tick in ticks])
        panel.minorticks_off()
        panel.set_xlim(0, curves["epoch"].max())
    return figure


@styled
def online_figure(results: DynamicsResults) -> Figure:
    """Figure III.2: NMSE on the whole motion while models go through it once."""
    return _curves(results, results.online_curves, "batch", results.learning_online.losses)


@styled
def tracking_figure(results: DynamicsResults) -> Figure:
    """NMSE of the tool's velocity in reaches, a dot per seed; hollow ones had to be stopped."""
    robots = [robot for robot in ROBOT_TITLES if results.tracked(robot)]
    figure = canvas(3.4)
    panels = figure.subplots(1, len(robots), squeeze=False)[0]
    for panel, robot in zip(panels, robots, strict=True):
        models = results.tracked(robot)
        for row, model in enumerate(models):
            runs = results.runs(robot, model, REACH)
            offsets = np.linspace(-0.22, 0.22, len(runs)) if len(runs) > 1 else [0.0]
            for offset, run in zip(offsets, runs.itertuples(), strict=True):
                fill = "none" if run.stopped else "full"
                colour = look(model)["color"]
                panel.plot(run.velocity_nmse, row + offset, "o", color=colour, fillstyle=fill, markersize=5)
        panel.set_yticks(range(len(models)), [model_name(model) for model in models])
        panel.set(title=ROBOT_TITLES[robot], xscale="log", xlabel="NMSE of the tool's velocity in reaches")
        panel.invert_yaxis()
        panel.grid(axis="y", visible=False)
    dot = {"marker": "o", "markersize": 5, "linestyle": "", "color": BLACK}
    handles = [
        Line2D([], [], label="ran through", **dot),
        Line2D([], [], label="had to be stopped", fillstyle="none", **dot),
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=2)
    return figure


@styled
def reach_figure(results: DynamicsResults) -> Figure:
    """Distance of the tool from where it should be, and its speed, in the reaches of the first seed."""
    robots = [robot for robot in ROBOT_TITLES if results.tracked(robot)]
    figure = canvas(4.6)
    panels = figure.subplots(2, len(robots), squeeze=False, sharex=True, sharey="row")
    for column, robot in zip(panels.T, robots, strict=True):
        column[0].set_title(ROBOT_TITLES[robot])
        first = DEFAULT if robot == ROBOT else GROUND_TRUTH
        chosen = [name for name in (first, *SHOWN_REACH) if name in results.tracked(robot)]
        for model in chosen:
            reach = results.path(robot, model, REACH)
            away = 1e3 * np.linalg.norm(_points(reach, "tool") - _points(reach, "wanted"), axis=1)
            column[0].plot(reach["time_s"], np.maximum(away, 1e-2), label=NAMES[model], **look(model))
            column[1].plot(reach["time_s"][1:], _speed(reach, "tool"), **look(model))
        wanted = results.path(robot, first, REACH)
        column[1].plot(wanted["time_s"][1:], _speed(wanted, "wanted"), color=BLACK, linewidth=2.5, alpha=0.3)
        column[1].set_xlabel("time (s)")
    panels[0, 0].set(ylabel="tool off (mm)", yscale="log")
    panels[1, 0].set(ylabel="speed of the tool (m/s)", ylim=(0.0, _highest_speed(results, robots)))
    _legend_of_all(figure, panels[0])
    return figure


def pictures(results: DynamicsResults) -> dict[str, Figure]:
    """The figures of this module by name."""
    return {
        "training": training_figure(results),
        "tracking": tracking_figure(results),
        "reaches": reach_figure(results),
        "online": online_figure(results),
    }


def _curves(results: DynamicsResults, curves: pd.DataFrame, step: str, losses: tuple[str, ...]) -> Figure:
    """A panel per loss with the geometric mean over seeds of each model, and the range of the seeds."""
    figure = canvas(3.6)
    panels = figure.subplots(1, len(losses), sharey=True, squeeze=False)[0]
    for panel, loss in zip(panels, losses, strict=True):
        for model in results.kinds:
            its = curves[(curves["loss"] == loss) & (curves["model"] == model)]
            if its.empty:
                continue
            wide = np.log10(its.pivot_table(index=step, columns="seed", values="nmse")).ffill()
            panel.plot(wide.index, 10.0 ** wide.mean(axis=1), label=NAMES[model], **look(model))
            low, high = 10.0 ** wide.min(axis=1), 10.0 ** wide.max(axis=1)
            panel.fill_between(wide.index, low, high, color=look(model)["color"], alpha=0.12, linewidth=0)
        panel.set(title=LOSS_TITLES[loss], yscale="log", xlabel=step)
    panels[0].set_ylabel("NMSE, mean over joints")
    panels[0].set_ylim(top=min(panels[0].get_ylim()[1], HIGHEST_NMSE))
    legend_above(figure, panels[0], columns=len(results.kinds))
    return figure


def _points(path: pd.DataFrame, prefix: str) -> np.ndarray:
    return path[[f"{prefix}_{axis}" for axis in "xyz"]].to_numpy()


def _speed(path: pd.DataFrame, prefix: str) -> np.ndarray:
    """(T - 1,) m/s."""
    steps = np.linalg.norm(np.diff(_points(path, prefix), axis=0), axis=1)
    return steps / np.diff(path["time_s"])


def _highest_speed(results: DynamicsResults, robots: list[str]) -> float:
    """Limit of the axis: twice the highest wanted speed."""
    highest = [
        _speed(results.path(robot, results.tracked(robot)[0], REACH), "wanted").max() for robot in robots
    ]
    return 2.0 * float(max(highest))


def _legend_of_all(figure: Figure, panels: np.ndarray) -> None:
    """One legend above the figure of what is labelled in any of the panels."""
    found: dict[str, Line2D] = {}
    for panel in panels:
        axes: Axes = panel
        found |= {label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    found["wanted"] = Line2D([], [], color=BLACK, linewidth=2.5, alpha=0.3)
    figure.legend(found.values(), found.keys(), loc="outside upper left", ncols=len(found))
