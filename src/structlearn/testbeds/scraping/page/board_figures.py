"""Figures of the executions on the board: figures IV.18 and IV.20, and how flat the tool ends up."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from structlearn.feedback.feedback_models import POINTWISE, UNROLLED
from structlearn.ground import signals
from structlearn.palette import (
    AXIS_COLOURS,
    BLACK,
    BLUE,
    CATEGORICAL_COLOURS,
    GREEN,
    GREY,
    PURPLE,
    VERMILION,
    primitive_colour,
)
from structlearn.recordings.demonstration import Demonstration
from structlearn.reporting.figures import canvas, legend_above, styled
from structlearn.testbeds.scraping.page.board_results import BoardResults
from structlearn.testbeds.scraping.page.execution_results import (
    ExecutionResults,
    hand_roll_deg,
    tool_roll_deg,
)
from structlearn.testbeds.scraping.page.feedback_figures import demonstrated_curves
from structlearn.testbeds.scraping.page.feedback_results import SAMPLES, FeedbackResults
from structlearn.testbeds.scraping.protocol.executed_sets import NOMINAL

MODEL_COLOURS = {NOMINAL: GREEN, POINTWISE: VERMILION, UNROLLED: PURPLE}
MODEL_NAMES = {
    NOMINAL: "no feedback",
    POINTWISE: "feedback, trained pointwise",
    UNROLLED: "feedback, trained in the unroll",
}
ELECTRODES_SHOWN = 4


@styled
def executions_figure(board: BoardResults, names: list[str]) -> Figure:
    """One execution without feedback and one corrected by a person: roll, force, torque, electrodes."""
    runs = {"nominal": board.examples[NOMINAL][0]}
    if board.corrected:
        runs["corrected by a person"] = board.corrected[0]
    moved = np.max([np.ptp(run.tactile, axis=0) for run in runs.values()], axis=0)
    busiest = np.sort(np.argsort(-moved, kind="stable")[:ELECTRODES_SHOWN])
    figure = canvas(6.6)
    panels = figure.subplots(4, len(runs), sharex="col", sharey="row", squeeze=False)
    for column, (what, run) in zip(panels.T, runs.items(), strict=True):
        roll, force, torque, touch = column
        tool = board.example_deg + tool_roll_deg(run, board.axis)
        roll.plot(run.time, tool, color=VERMILION, linewidth=1.0, label="tool")
        roll.plot(run.time, hand_roll_deg(run, board.axis), color=BLUE, label="hand")
        roll.axhline(board.example_deg, color=BLACK, linestyle=":", linewidth=1.2, label="board")
        roll.set_title(f"{what[0].upper()}{what[1:]}, board at {board.example_deg:g}°")
        force.plot(run.time, -run.wrench[:, 2], color=AXIS_COLOURS[2], linewidth=1.0)
        force.axhline(board.force_n, color=BLACK, linestyle=":", linewidth=1.2)
        torque.plot(run.time, -1e3 * run.wrench[:, 3:] @ board.axis, color=GREY, linewidth=0.9)
        for colour, electrode in zip(CATEGORICAL_COLOURS, busiest, strict=False):
            counts = run.tactile[:, electrode] - run.tactile[0, electrode]
            touch.plot(run.time, counts, color=colour, linewidth=1.0, label=f"channel {electrode + 1}")
        touch.set_xlabel("time (s)")
        touch.set_xlim(run.time[0], run.time[-1])
        for panel in column:
            _shade(panel, run)
        for name, (start, end) in zip(names, run.true_segments, strict=False):
            where = {"transform": roll.get_xaxis_transform(), "ha": "center", "va": "bottom"}
            roll.text(0.5 * (start + end), 0.02, name, **where, fontsize=8.0)
    low, high = panels[0, 0].get_ylim()
    panels[0, 0].set_ylim(low - 0.2 * (high - low), high)  # room for the names
    for panel, label in zip(
        panels[:, 0], ("roll (°)", "force (N)", "roll torque\n(mN m)", "touch (counts)"), strict=True
    ):
        panel.set_ylabel(label)
    for panel in (panels[0, -1], panels[3, -1]):
        panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    figure.align_ylabels(panels[:, 0])
    return figure


def _shade(panel: Axes, run: Demonstration) -> None:
    for place, (start, end) in enumerate(run.true_segments):
        panel.axvspan(start, end, color=primitive_colour(place), alpha=0.1, linewidth=0)


@styled
def closed_loop_figure(results: FeedbackResults, primitive: str) -> Figure:
    """Figure IV.18: coupling term and one electrode's deviation over time, one column per setting."""
    board, dataset = results.board, results.datasets[primitive]
    channel = results.channels[primitive][0]
    settings = [setting for setting in board.tilted_deg if setting in results.settings_deg]
    figure = canvas(4.3)
    panels = figure.subplots(2, len(settings), sharex=True, sharey="row", squeeze=False)
    traces = board.traces[board.traces["primitive"] == primitive]
    time = np.linspace(0.0, 1.0, SAMPLES)
    columns = ("coupling", f"channel_{channel:02d}")
    for setting, column in zip(settings, panels.T, strict=True):
        here = traces[traces["setting_deg"] == setting]
        shown = (dataset.target, dataset.deviation[:, channel])
        for panel, values, name in zip(column, shown, columns, strict=True):
            curves = demonstrated_curves(dataset, setting, values)
            panel.plot(time, curves.T, color=BLUE, linewidth=0.4, alpha=0.6)
            mean, spread = curves.mean(axis=0), curves.std(axis=0)
            panel.plot(time, mean, color=BLACK, linestyle=(0, (4, 2)), linewidth=1.1)
            panel.plot(time, mean + spread, color=BLACK, linewidth=0.8)
            panel.plot(time, mean - spread, color=BLACK, linewidth=0.8)
            for model in (NOMINAL, POINTWISE):
                for _, run in here[here["model"] == model].groupby("run"):
                    curve = signals.time_normalised(run[name].to_numpy(), SAMPLES)
                    panel.plot(time, curve, color=MODEL_COLOURS[model], linewidth=0.7)
        seen = "" if setting in results.seen_deg else ", unseen"
        column[0].set_title(f"{setting:g}°{seen}")
        column[1].set_xlabel("time / duration")
        column[1].set_xticks([0.0, 0.5, 1.0], ["0", "0.5", "1"])
    panels[0, 0].set_ylabel("coupling term (rad)")
    panels[1, 0].set_ylabel(f"deviation, channel {channel + 1}\n(counts)")
    handles = [
        Line2D([], [], color=BLUE, linewidth=0.8, label="demonstrations"),
        Line2D([], [], color=BLACK, linestyle=(0, (4, 2)), label="their mean"),
        Line2D([], [], color=BLACK, linewidth=0.8, label="± std"),
        *[Line2D([], [], color=MODEL_COLOURS[m], label=MODEL_NAMES[m]) for m in (NOMINAL, POINTWISE)],
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), columnspacing=1.4)
    return figure


@styled
def roll_figure(results: FeedbackResults) -> Figure:
    """Roll of the tool against roll of the board at the end of each primitive; a point per execution."""
    board = results.board
    figure = canvas(4.0)
    panels = figure.subplots(1, len(board.primitives), sharey=True, squeeze=False)[0]
    largest = max(board.settings_deg)
    for panel, primitive in zip(panels, board.primitives, strict=True):
        panel.plot([0, largest], [0, largest], color=BLACK, linewidth=1.0, linestyle=":", label="flat on it")
        rows = board.scores[board.scores["primitive"] == primitive]
        for place, model in enumerate(board.models):
            own = rows[rows["model"] == model]
            beside = 0.16 * (place - 0.5 * (len(board.models) - 1))  # so that points can be told apart
            look = {"color": MODEL_COLOURS[model], "linestyle": "none", "marker": "o", "markersize": 3.2}
            roll = own["setting_deg"] + own["end_roll_deg"]
            panel.plot(own["setting_deg"] + beside, roll, **look, alpha=0.7, label=MODEL_NAMES[model])
        panel.set_xticks(board.settings_deg, [f"{setting:g}" for setting in board.settings_deg])
        panel.set(title=f"End of {results.number(primitive)}. {primitive}", xlabel="roll of the board (°)")
    panels[0].set_ylabel("roll of the tool (°)")
    legend_above(figure, panels[0])
    return figure


def cost_figure(results: FeedbackResults) -> Figure:
    """Figure IV.20 without reinforcement learning."""
    board = results.board
    ticks = [
        f"{setting:g}" + ("" if setting in (*results.seen_deg, 0.0) else "*")
        for setting in board.settings_deg
    ]
    titles = {name: f"{results.number(name)}. {name}" for name in board.primitives}
    looks = {model: (MODEL_NAMES[model], MODEL_COLOURS[model]) for model in board.models}
    return cost_bars(board, titles, looks, ticks, "roll of the board (°); *: not learned from")


@styled
def cost_bars(
    executed: ExecutionResults,
    titles: Mapping[str, str],
    looks: Mapping[str, tuple[str, str]],
    ticks: Sequence[str],
    what: str,
) -> Figure:
    """Figure IV.20: accumulated cost per setting and model, mean and std over the executions.

    Args:
        executed: the executions.
        titles: of the panels, by primitive.
        looks: name and colour by model.
        ticks: below the bars, by setting.
        what: the ticks are.
    """
    figure = canvas(3.6)
    panels = figure.subplots(1, len(titles), squeeze=False)[0]
    width = 0.8 / len(looks)
    costs = executed.costs.set_index(["primitive", "model"])
    for panel, (primitive, title) in zip(panels, titles.items(), strict=True):
        for place, (model, (label, colour)) in enumerate(looks.items()):
            rows = costs.loc[[(primitive, model)]].sort_values("setting_deg")
            x = np.arange(len(rows)) + width * (place - 0.5 * (len(looks) - 1))
            spread = np.nan_to_num(rows["std"])
            panel.bar(x, rows["mean"], 0.92 * width, color=colour, label=label)
            panel.errorbar(x, rows["mean"], spread, color=BLACK, linestyle="none", linewidth=0.9, capsize=2.0)
        panel.set_xticks(range(len(ticks)), ticks)
        panel.grid(axis="x", visible=False)
        panel.set(title=title, xlabel=what)
        panel.set_ylim(bottom=0.0)
    panels[0].set_ylabel("accumulated cost (rad)")
    legend_above(figure, panels[0])
    return figure
