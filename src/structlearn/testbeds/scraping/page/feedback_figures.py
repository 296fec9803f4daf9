"""Figures of what feedback is learned from, of the models compared, and of executions on the board."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, to_hex
from matplotlib.figure import Figure

from structlearn.core import signals
from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.feedback_models import POINTWISE
from structlearn.palette import AXIS_COLOURS, BLACK, BLUE, GREY, ORANGE
from structlearn.reporting.figure_style import PANEL_WIDTH, canvas, styled
from structlearn.reporting.movement_figures import headroom, shade_primitives
from structlearn.reporting.prose import capitalised
from structlearn.testbeds.scraping.names import CORRECTED, REPRESENTATIONS, RUNS, primitive_title
from structlearn.testbeds.scraping.page.board_results import BoardResults, ExecutionResults
from structlearn.testbeds.scraping.page.demonstration_figures import (
    busiest_electrodes,
    draw_electrodes,
    stacked_panels,
)
from structlearn.testbeds.scraping.page.findings import ScrapingPeople
from structlearn.testbeds.scraping.page.results import SAMPLES, FeedbackResults
from structlearn.testbeds.scraping.protocol.execution_scores import NOMINAL
from structlearn.testbeds.scraping.world.layout import hand_roll_deg, tool_roll_deg

STRUCTURES = ("pmnn_100", "pmnn_0", "ffnn_phase", "ffnn")
EMBEDDINGS = ("pmnn_100", "pmnn_6", "pca", "autoencoder")
CHANNELS_SHOWN = 2
TIME = np.linspace(0.0, 1.0, SAMPLES)  # Normalised


def panel(title: str, height: float = 3.0) -> tuple[Figure, Axes]:
    """One figure with one panel."""
    figure = canvas(height, PANEL_WIDTH)
    axes = figure.subplots()
    axes.set_title(capitalised(title))
    return figure, axes


def mean_band(axes: Axes, curves: np.ndarray, colour: str, label: str | None = None) -> None:
    """Mean of curves (R, `SAMPLES`) over normalised time, and one std on either side."""
    mean = curves.mean(axis=0)
    spread = curves.std(axis=0, ddof=1) if len(curves) > 1 else np.zeros_like(mean)
    axes.fill_between(TIME, mean - spread, mean + spread, color=colour, alpha=0.2, linewidth=0)
    axes.plot(TIME, mean, color=colour, label=label)


def demonstrated_curves(dataset: CouplingDataset, setting: float, values: np.ndarray) -> np.ndarray:
    """Values (S,) of every demonstration in a setting over normalised time, (L, `SAMPLES`)."""
    inside = dataset.setting == setting
    each = pd.Series(values[inside]).groupby(dataset.demonstration[inside])
    return np.stack([signals.time_normalised(one.to_numpy(), SAMPLES) for _, one in each])


@styled
def expected_figure(results: FeedbackResults) -> list[Figure]:
    """Mean and std of a few electrodes in the executions, with the learned expected traces."""
    moved = np.max([np.ptp(learned, axis=0) for _, learned in results.traces.values()], axis=0)
    shown = np.sort(np.argsort(-moved, kind="stable")[:CHANNELS_SHOWN])
    labels = [f"channel {channel + 1} (counts)" for channel in shown]
    look = {"color": ORANGE, "linestyle": (0, (4, 2)), "linewidth": 1.2, "label": "expected trace"}
    figures = []
    for name, (runs, learned) in results.traces.items():
        figure, rows = stacked_panels(labels, 3.4, capitalised(name))
        for axes, channel in zip(rows, shown, strict=True):
            mean_band(axes, runs[:, :, channel], BLUE, f"{len(runs)} executions")
            axes.plot(TIME, learned[:, channel], **look)
        rows[0].legend()
        figures.append(figure)
    return figures


@styled
def targets_figure(results: FeedbackResults) -> list[Figure]:
    """Coupling targets and the deviation of the most telling channel per setting, mean and std."""
    places = np.linspace(0.85, 0.0, len(results.settings_deg))
    colours = [to_hex(colormaps["viridis"](place)) for place in places]  # darker where tilted more
    figures = []
    for name in results.adapted:
        dataset, channel = results.datasets[name], results.channels[name][0]
        labels = ["coupling target (rad)", f"channel {channel + 1} (counts)"]
        figure, (target, deviation) = stacked_panels(labels, 4.2, capitalised(name))
        for setting, colour in zip(results.settings_deg, colours, strict=True):
            mean_band(target, demonstrated_curves(dataset, setting, dataset.target), colour, f"{setting:g}°")
            mean_band(deviation, demonstrated_curves(dataset, setting, dataset.deviation[:, channel]), colour)
        headroom(target)
        target.legend(ncols=3, loc="upper right")
        figures.append(figure)
    return figures


@styled
def models_figure(results: FeedbackResults, people: ScrapingPeople) -> list[Figure]:
    """Figure IV.16, top and middle: generalisation NMSE of the representations, mean and std over folds.

    At the step best for the demonstration left out, as in the dissertation; a diamond is at the step that
    validation chose, a dot the mean of one of the people on whom it is judged.
    """
    errors, figures = results.model_errors, []
    for what, chosen in (("structures", STRUCTURES), ("features inside or apart", EMBEDDINGS)):
        for name in results.adapted:
            shown = [one for one in chosen if (name, one, "generalization") in errors.index]
            figure, axes = panel(f"{name}: {what}", 2.6)
            for place, one in enumerate(reversed(shown)):
                row = errors.loc[(name, one, "generalization")]
                mean, std = row["generalization_mean"], np.nan_to_num(row["generalization_std"])
                axes.barh(place, mean, 0.62, color=REPRESENTATIONS[one].colour)
                axes.errorbar(mean, place, xerr=std, color=BLACK, linewidth=1.0, capsize=4.0)
                validated = errors.loc[(name, one, "validation"), "generalization_mean"]
                axes.plot(validated, place, "D", color=BLACK, markerfacecolor="white", markersize=5)
                if (values := people.of(one, name, "generalization_nmse", "generalization")) is not None:
                    _dots(axes, values, np.full(len(values), place - 0.22))
            names = [REPRESENTATIONS[one].name.replace(", then ", ",\nthen ") for one in reversed(shown)]
            axes.set_yticks(range(len(names)), names)
            axes.grid(axis="y", visible=False)
            axes.set(xlabel="generalisation NMSE", xlim=(0.0, None))
            figures.append(figure)
    return figures


@styled
def weights_figure(results: FeedbackResults) -> list[Figure]:
    """Figure IV.16, bottom: the hidden nodes that weigh most for each phase kernel."""
    figures, colours = [], ListedColormap([BLUE, "#f5d76e"])
    for name in results.adapted:
        dominant = results.dominant(name)
        if dominant is None:
            continue
        figure, axes = panel(f"{name}: largest weights of every kernel", 2.6)
        axes.imshow(dominant[0], cmap=colours, aspect="auto", interpolation="nearest")
        axes.set(xlabel="node of the hidden layer", ylabel="phase kernel")
        axes.grid(visible=False)
        figures.append(figure)
    return figures


@styled
def executions_figure(board: BoardResults, names: Sequence[str]) -> list[Figure]:
    """One execution without feedback and one corrected by a person: roll, force, torque, electrodes."""
    runs = {NOMINAL: board.examples[NOMINAL][0]}
    if board.corrected:
        runs[CORRECTED] = board.corrected[0]
    channels, figures = busiest_electrodes(list(runs.values())), []
    for kind, run in runs.items():
        labels = ("roll (°)", "force (N)", "torque (mN m)", "touch (counts)")
        figure, rows = stacked_panels(labels, 5.6, time="time (s)")
        roll, force, torque, touch = rows
        tool, wrench = board.example_deg + tool_roll_deg(run, board.axis), run.signal("wrench")
        roll.plot(run.time, tool, color=ORANGE, linewidth=1.0, label="tool")
        roll.plot(run.time, hand_roll_deg(run, board.axis), color=BLUE, label="hand")
        roll.axhline(board.example_deg, color=BLACK, linestyle=":", linewidth=1.2, label="board")
        roll.legend(ncols=3)
        roll.set_title(f"{capitalised(RUNS[kind].name)}, board at {board.example_deg:g}°", pad=18)
        force.plot(run.time, -wrench[:, 2], color=AXIS_COLOURS[2], linewidth=1.0)
        force.axhline(board.force_n, color=BLACK, linestyle=":", linewidth=1.2)
        torque.plot(run.time, -1e3 * wrench[:, 3:] @ board.axis, color=GREY, linewidth=0.9)
        draw_electrodes(touch, run, channels)
        for axes in rows:
            shade_primitives(axes, run.signal("true_segments"), names if axes is roll else ())
        touch.set_xlim(run.time[0], run.time[-1])
        figure.align_ylabels(rows)
        figures.append(figure)
    return figures


@styled
def closed_loop_figure(results: FeedbackResults, primitive: str) -> list[Figure]:
    """Figure IV.18: coupling term and one electrode's deviation over time, a panel per setting."""
    board, dataset = results.board, results.datasets[primitive]
    channel = results.channels[primitive][0]
    traces = board.traces[board.traces["primitive"] == primitive]
    columns = {"coupling": dataset.target, f"channel_{channel:02d}": dataset.deviation[:, channel]}
    labels = ("coupling term (rad)", f"channel {channel + 1} (counts)")
    figures: list[Figure] = []
    for setting in [one for one in board.tilted_deg if one in results.settings_deg]:
        seen = "" if setting in results.seen_deg else ", never learned from"
        figure, rows = stacked_panels(labels, 3.6, f"Board at {setting:g}°{seen}")
        here = traces[traces["setting_deg"] == setting]
        for axes, (name, values) in zip(rows, columns.items(), strict=True):
            _demonstrated_band(axes, demonstrated_curves(dataset, setting, values))
            for model in (NOMINAL, POINTWISE):
                runs = here[here["model"] == model].groupby("run")[name]
                for place, (_, run) in enumerate(runs):
                    label = RUNS[model].name if place == 0 else None
                    curve = signals.time_normalised(run.to_numpy(), SAMPLES)
                    axes.plot(TIME, curve, color=RUNS[model].colour, linewidth=0.7, label=label)
            shown = np.concatenate([values, traces[name]])
            axes.set_ylim(shown.min(), shown.max())
        if not figures:
            rows[0].legend()
        figures.append(figure)
    return figures


def _dots(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """One dot per person."""
    edge: dict[str, Any] = {"markeredgecolor": BLACK, "markeredgewidth": 0.6, "zorder": 5}
    axes.plot(x, y, linestyle="none", marker="o", markersize=2.8, markerfacecolor="white", **edge)


def _demonstrated_band(axes: Axes, curves: np.ndarray) -> None:
    """Every demonstration, and their mean with one std on either side."""
    look = RUNS[CORRECTED]
    axes.plot(TIME, curves.T, color=look.colour, linewidth=0.4, alpha=0.6)
    axes.plot([], [], color=look.colour, label=f"{look.name} (black: mean ± std)")
    mean, spread = curves.mean(axis=0), curves.std(axis=0)
    axes.plot(TIME, mean, color=BLACK, linestyle=(0, (4, 2)), linewidth=1.1)
    for edge in (mean + spread, mean - spread):
        axes.plot(TIME, edge, color=BLACK, linewidth=0.8)


@styled
def roll_figure(results: FeedbackResults) -> list[Figure]:
    """Roll of the tool against roll of the board at the end of each primitive; a point per execution."""
    board, figures = results.board, []
    largest = max(board.settings_deg)
    for primitive in board.primitives:
        figure, axes = panel(f"end of {primitive_title(results.primitives, primitive)}")
        axes.plot([0, largest], [0, largest], color=BLACK, linewidth=1.0, linestyle=":", label="flat on it")
        rows = board.scores[board.scores["primitive"] == primitive]
        for place, model in enumerate(board.models):
            own = rows[rows["model"] == model]
            beside = 0.16 * (place - 0.5 * (len(board.models) - 1))  # so that points can be told apart
            look: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 3.2, "alpha": 0.7}
            roll, kind = own["setting_deg"] + own["end_roll_deg"], RUNS[model]
            axes.plot(own["setting_deg"] + beside, roll, color=kind.colour, label=kind.name, **look)
        axes.set_xticks(board.settings_deg, [f"{setting:g}" for setting in board.settings_deg])
        axes.set(xlabel="roll of the board (°)", ylabel="roll of the tool (°)")
        axes.legend()
        figures.append(figure)
    return figures


@styled
def cost_figure(
    executed: ExecutionResults,
    names: Sequence[str],
    note: Callable[[float], str],
    people: ScrapingPeople | None = None,
) -> list[Figure]:
    """Figure IV.20: accumulated cost per setting and model, mean and std over the executions."""
    figures = []
    width = 0.8 / len(executed.models)
    costs = executed.costs.set_index(["primitive", "model"])
    for primitive in executed.primitives:
        figure, axes = panel(primitive_title(names, primitive))
        for place, model in enumerate(executed.models):
            rows = costs.loc[[(primitive, model)]].sort_values("setting_deg")
            x = np.arange(len(rows)) + width * (place - 0.5 * (len(executed.models) - 1))
            axes.bar(x, rows["mean"], 0.92 * width, color=RUNS[model].colour, label=RUNS[model].name)
            look: dict[str, Any] = {"color": BLACK, "linestyle": "none", "linewidth": 0.9, "capsize": 2.0}
            axes.errorbar(x, rows["mean"], np.nan_to_num(rows["std"]), **look)
            for at, setting in zip(x, rows["setting_deg"], strict=True):
                if people and (values := people.of("cost", model, primitive, setting)) is not None:
                    _dots(axes, np.full(len(values), at), values)
        ticks = [f"{setting:g}\n{note(setting)}" for setting in executed.settings_deg]
        axes.set_xticks(range(len(ticks)), ticks, fontsize=7.5)
        axes.grid(axis="x", visible=False)
        axes.set(xlabel="roll of the board (°)", ylabel="accumulated cost (rad)", ylim=(0.0, None))
        axes.legend()
        figures.append(figure)
    return figures
