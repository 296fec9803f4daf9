"""Figures of feedback models, of executions on the board, and of the refinement by trial (IV.16 to IV.21)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator

from dissertation.evidence.results import Results
from dissertation.scraping.names import (
    CORRECTED,
    REPRESENTATIONS,
    ROLLOUTS,
    RUNS,
    SEARCHES,
    primitive_title,
)
from dissertation.scraping.page.demonstration_figures import (
    busiest_electrodes,
    draw_electrodes,
    stacked_panels,
)
from dissertation.scraping.page.stored import SAMPLES, Stored
from dissertation.scraping.page.tables import curve, moments, settings
from dissertation.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL
from dissertation.scraping.protocol.feedback_models import POINTWISE, STOPPINGS
from dissertation.scraping.protocol.phase_dependence import dominant_nodes
from dissertation.scraping.protocol.results import CONVERGED
from dissertation.scraping.world import layout
from structlearn.core import signals
from structlearn.core.metrics import matching
from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.palette import AXIS_COLOURS, BLACK, BLUE, GREY
from structlearn.policy_search.refinement import FEEDBACK, IMPROVED, SAMPLE
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.evidence import geometric_mean
from structlearn.reporting.figure_style import PANEL_WIDTH, canvas, styled
from structlearn.reporting.movement_figures import headroom, shade_primitives
from structlearn.reporting.prose import capitalised, rounded

STRUCTURES = ("pmnn_100", "pmnn_0", "ffnn_phase", "ffnn")
EMBEDDINGS = ("pmnn_100", "pmnn_6", "pca", "autoencoder")
CHANNELS_SHOWN = 2
TIME = np.linspace(0.0, 1.0, SAMPLES)  # normalised


def panel(title: str, height: float = 3.0) -> tuple[Figure, Axes]:
    """Figure of panel width with one set of axes; height in inches."""
    figure = canvas(height, PANEL_WIDTH)
    axes = figure.subplots()
    axes.set_title(capitalised(title))
    return figure, axes


def mean_band(axes: Axes, curves: np.ndarray, colour: str, label: str | None = None) -> None:
    """Plot the mean of curves (R, `SAMPLES`) over normalised time, with a band of one std."""
    mean = curves.mean(axis=0)
    spread = curves.std(axis=0, ddof=1) if len(curves) > 1 else np.zeros_like(mean)
    axes.fill_between(TIME, mean - spread, mean + spread, color=colour, alpha=0.2, linewidth=0)
    axes.plot(TIME, mean, color=colour, label=label)


def demonstrated_curves(dataset: CouplingDataset, setting: float, values: np.ndarray) -> np.ndarray:
    """Resample values (S,) of each demonstration in a setting to normalised time, (L, `SAMPLES`)."""
    inside = dataset.setting == setting
    each = pd.Series(values[inside]).groupby(dataset.demonstration[inside])
    return np.stack([signals.time_normalised(one.to_numpy(), SAMPLES) for _, one in each])


@styled
def expected_figure(stored: Stored) -> list[Figure]:
    """Mean and std of a few electrodes over executions, with the learned expected traces."""
    moved = np.max([np.ptp(learned, axis=0) for _, learned in stored.felt.values()], axis=0)
    shown = np.sort(np.argsort(-moved, kind="stable")[:CHANNELS_SHOWN])
    labels = [f"channel {channel + 1} (counts)" for channel in shown]
    look = {"color": BLACK, "linestyle": (0, (4, 2)), "linewidth": 1.2, "label": "expected trace"}
    figures = []
    for name, (runs, learned) in stored.felt.items():
        figure, rows = stacked_panels(labels, 3.4, capitalised(name))
        for axes, channel in zip(rows, shown, strict=True):
            mean_band(axes, runs[:, :, channel], BLUE, f"{len(runs)} executions")
            axes.plot(TIME, learned[:, channel], **look)
        rows[0].legend()
        figures.append(figure)
    return figures


@styled
def targets_figure(stored: Stored) -> list[Figure]:
    """Coupling targets and deviation of the most informative channel by setting, mean and std."""
    places = np.linspace(0.85, 0.0, len(stored.corrected_deg))
    colours = [to_hex(colormaps["viridis"](place)) for place in places]  # darker for larger tilts
    figures = []
    for name in stored.adapted:
        dataset, channel = stored.datasets[name], stored.channels[name][0]
        labels = ["coupling target (rad)", f"channel {channel + 1} (counts)"]
        figure, (target, deviation) = stacked_panels(labels, 4.2, capitalised(name))
        for setting, colour in zip(stored.corrected_deg, colours, strict=True):
            mean_band(target, demonstrated_curves(dataset, setting, dataset.target), colour, f"{setting:g}°")
            mean_band(deviation, demonstrated_curves(dataset, setting, dataset.deviation[:, channel]), colour)
        headroom(target)
        target.legend(ncols=3, loc="upper right")
        figures.append(figure)
    return figures


@styled
def models_figure(results: Results) -> list[Figure]:
    """Figure IV.16, top and middle: generalisation NMSE of the representations, geometric mean over people.

    Bars are at the best step for the demonstration left out, as in the dissertation; diamonds at the step
    chosen by validation; dots are single people.
    """
    errors = results.wide("nmse", ["primitive", "model", "stopping"])
    figures, primitives = [], errors.columns.unique("primitive") if len(errors.columns) else ()
    for what, chosen in (("structures", STRUCTURES), ("features inside or apart", EMBEDDINGS)):
        for name in primitives:
            shown = [one for one in chosen if (name, one, "generalization") in errors]
            figure, axes = panel(f"{name}: {what}", 2.6)
            for place, one in enumerate(reversed(shown)):
                best, validated = (errors[name, one, step].dropna() for step in reversed(STOPPINGS))
                axes.barh(place, central(best), 0.62, color=REPRESENTATIONS[one].colour)
                axes.plot(central(validated), place, "D", color=BLACK, markerfacecolor="white", markersize=5)
                _dots(axes, best.to_numpy(), np.full(len(best), place - 0.22))
            names = [REPRESENTATIONS[one].name.replace(", then ", ",\nthen ") for one in reversed(shown)]
            axes.set_yticks(range(len(names)), names)
            axes.grid(axis="y", visible=False)
            axes.set(xlabel="generalisation NMSE", xlim=(0.0, None))
            figures.append(figure)
    return figures


def central(values: pd.Series) -> float:
    """Geometric mean over people, since NMSE and costs are skewed."""
    return float(np.exp(np.log(values).mean()))


@styled
def weights_figure(stored: Stored) -> list[Figure]:
    """Figure IV.16, bottom: hidden nodes with the largest weights for each phase kernel."""
    figures, colours = [], ListedColormap([BLUE, "#f5d76e"])
    for name in stored.adapted:
        dominant = dominant_nodes(stored.networks[name])
        if dominant is None:
            continue
        figure, axes = panel(f"{name}: largest weights of every kernel", 2.6)
        axes.imshow(dominant, cmap=colours, aspect="auto", interpolation="nearest")
        axes.set(xlabel="node of the hidden layer", ylabel="phase kernel")
        axes.grid(visible=False)
        figures.append(figure)
    return figures


@styled
def executions_figure(stored: Stored) -> list[Figure]:
    """An execution without feedback and one corrected by a person: roll, force, torque, electrodes."""
    shown = {kind: stored.tilted[kind] for kind in (NOMINAL, CORRECTED)}
    runs = {kind: its[0] for kind, its in shown.items() if its}
    channels, figures = busiest_electrodes(list(runs.values())), []
    for kind, run in runs.items():
        labels = ("roll (°)", "force (N)", "torque (mN m)", "touch (counts)")
        figure, rows = stacked_panels(labels, 5.6, time="time (s)")
        roll, force, torque, touch = rows
        tool, wrench = stored.tilt_deg + layout.tool_roll_deg(run, stored.axis), run.signal("wrench")
        roll.plot(run.time, tool, color=BLUE, linewidth=1.0, label="tool")
        roll.plot(run.time, layout.hand_roll_deg(run, stored.axis), color=GREY, label="hand")
        roll.axhline(stored.tilt_deg, color=BLACK, linestyle=":", linewidth=1.2, label="board")
        roll.legend(ncols=3)
        roll.set_title(f"{capitalised(RUNS[kind].name)}, board at {stored.tilt_deg:g}°", pad=18)
        force.plot(run.time, -wrench[:, 2], color=AXIS_COLOURS[2], linewidth=1.0)
        force.axhline(stored.parameters["testbed"].control.force_n, color=BLACK, linestyle=":", linewidth=1.2)
        torque.plot(run.time, -1e3 * wrench[:, 3:] @ stored.axis, color=GREY, linewidth=0.9)
        draw_electrodes(touch, run, channels)
        for axes in rows:
            shade_primitives(axes, run.signal("true_segments"), stored.names if axes is roll else ())
        touch.set_xlim(run.time[0], run.time[-1])
        figure.align_ylabels(rows)
        figures.append(figure)
    return figures


@styled
def closed_loop_figure(stored: Stored, primitive: str) -> list[Figure]:
    """Figure IV.18: coupling term and an electrode's deviation over time, mean and std, by setting."""
    dataset, channel = stored.datasets[primitive], stored.channels[primitive][0]
    traces = matching(stored.tables["traces"], primitive=primitive)
    known = stored.parameters["coupling_dataset"].settings_deg
    columns = {"coupling": dataset.target, f"channel_{channel:02d}": dataset.deviation[:, channel]}
    labels = ("coupling term (rad)", f"channel {channel + 1} (counts)")
    figures: list[Figure] = []
    for setting in [one for one in settings(traces, tilted=True) if one in stored.corrected_deg]:
        seen = "" if setting in known else ", never learned from"
        figure, rows = stacked_panels(labels, 4.6, f"Board at {setting:g}°{seen}")
        here = traces[traces["setting_deg"] == setting]
        for axes, (name, values) in zip(rows, columns.items(), strict=True):
            curves = {CORRECTED: demonstrated_curves(dataset, setting, values)}
            for model in (NOMINAL, POINTWISE):
                runs = here[here["model"] == model].groupby("run")[name]
                curves[model] = np.stack(
                    [signals.time_normalised(run.to_numpy(), SAMPLES) for _, run in runs]
                )
            for kind, its in curves.items():
                mean_band(axes, its, RUNS[kind].colour, RUNS[kind].name)
            shown = np.concatenate([values, traces[name]])
            axes.set_ylim(shown.min(), shown.max())
        figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper left", fontsize=7.5)
        figures.append(figure)
    return figures


def _dots(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Draw one dot per person."""
    edge: dict[str, Any] = {"markeredgecolor": BLACK, "markeredgewidth": 0.6, "zorder": 5}
    axes.plot(x, y, linestyle="none", marker="o", markersize=2.8, markerfacecolor="white", **edge)


@styled
def roll_figure(stored: Stored) -> list[Figure]:
    """Roll of the tool against roll of the board at the end of each primitive, one point per execution."""
    scores, figures = stored.tables["scores"], []
    models, tilts = list(scores["model"].unique()), settings(scores)
    for primitive in stored.adapted:
        figure, axes = panel(f"end of {primitive_title(stored.names, primitive)}")
        ends = [0, max(tilts)]
        axes.plot(ends, ends, color=BLACK, linewidth=1.0, linestyle=":", label="flat on it")
        for place, model in enumerate(models):
            own = matching(scores, primitive=primitive, model=model)
            beside = 0.16 * (place - 0.5 * (len(models) - 1))  # offset, so that models do not overlap
            look: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 3.2, "alpha": 0.7}
            roll, kind = own["setting_deg"] + own["end_roll_deg"], RUNS[model]
            axes.plot(own["setting_deg"] + beside, roll, color=kind.colour, label=kind.name, **look)
        axes.set_xticks(tilts, [f"{setting:g}" for setting in tilts])
        axes.set(xlabel="roll of the board (°)", ylabel="roll of the tool (°)")
        axes.legend()
        figures.append(figure)
    return figures


@styled
def cost_figure(
    stored: Stored, results: Results, one: Results, quantity: str, note: Callable[[float], str]
) -> list[Figure]:
    """Figure IV.20: cost by setting and model, geometric mean over people with its 95 % interval.

    The cost, an angle summed over ticks, is drawn as its integral over time. `one`: results of the person
    shown, hollow; alone where `results` are hers.
    """
    people, shown = (its.wide(quantity, ["primitive", "model", "setting"]) for its in (results, one))
    figures, primitives = [], people.columns.unique("primitive") if len(people.columns) else ()
    for primitive in primitives:
        own = np.degrees(people[primitive]) * stored.reference.dt
        models, tilts = own.columns.unique("model"), sorted(own.columns.unique("setting"))
        figure, axes = panel(primitive_title(stored.names, primitive))
        for place, model in enumerate(models):
            x = np.arange(len(tilts)) + 0.13 * (place - 0.5 * (len(models) - 1))
            found = [geometric_mean(own[model, tilt].dropna().to_numpy()) for tilt in tilts]
            values, low, high = np.array([(its.value, its.low, its.high) for its in found]).T
            look: dict[str, Any] = {"color": RUNS[model].colour, "label": RUNS[model].name, "linewidth": 1.0}
            bars = np.nan_to_num([values - low, high - values], posinf=0.0)
            axes.errorbar(x, values, bars, marker="o", markersize=3.5, elinewidth=1.6, **look)
            if (primitive, model, tilts[-1]) in shown:
                her = np.degrees(shown[primitive][model][tilts].mean()) * stored.reference.dt
                axes.plot(x, her, "o", color=RUNS[model].colour, markersize=6.5, fillstyle="none", zorder=1)
        ticks = [f"{setting:g}\n{note(setting)}" for setting in tilts]
        axes.set_xticks(range(len(ticks)), ticks, fontsize=7.5)
        axes.grid(axis="x", visible=False)
        axes.set(xlabel="roll of the board (°)", ylabel="angle off, over time (° s)", ylim=(0.0, None))
        axes.legend()
        figures.append(figure)
    return figures


CLOUD_WIDTH = 0.26
"""Width, in iterations, over which samples are spread halfway between two executions of the network."""

# Lengths in mm. Outlines (N, 2): x along the pinch, z up, origin at the grasp between the finger tips.
EDGE, HALF_EDGE, HAND = 1e3 * layout.EDGE_M, 0.5e3 * layout.EDGE_WIDTH_M, 1e3 * layout.GRASP_M
TOOL = np.array(
    [(-6, 9), (6, 9), (6, -9), (4, -11), (HALF_EDGE, -EDGE), (-HALF_EDGE, -EDGE), (-4, -11), (-6, -9)]
)
FINGER = np.array([(6, -7), (9, -11), (13, -10), (16, -4), (21, HAND), (10, HAND), (7, 12), (6, 8)])
PALM = np.array(
    [(-25, HAND), (25, HAND), (25, HAND + 10), (19, HAND + 18), (-19, HAND + 18), (-25, HAND + 10)]
)
PARTS = (PALM, FINGER, FINGER * (-1, 1))

BOARD_LENGTH, BOARD_THICKNESS = 96.0, 5.0
BOARD_COLOUR = "#d9cdb8"
HAND_COLOURS = {BEFORE: "#d3d9df", AFTER: "#6b7681"}
HEIGHT_DRAWN = 13.0
"""Largest drawn height of a hovering tool above the board, so that angles stay visible."""

VIEW, CLOSE_UP = (-48.0, 48.0, -17.0, 98.0), (-9.0, 9.0, -2.6, 4.0)  # mm, left, right, bottom, top


@styled
def learning_figure(stored: Stored, curves: pd.DataFrame) -> list[Figure]:
    """Figure IV.19: cost over iterations of the network, of the improved policies and of the samples."""
    figures, history = [], stored.tables["history"]
    for name in history["primitive"].unique():
        figure, axes = panel(primitive_title(stored.names, name))
        own = matching(history, primitive=name)
        look: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 3.0, "markeredgewidth": 0}
        colour = ROLLOUTS[SAMPLE].colour
        for iteration, rows in own[own["kind"] == SAMPLE].groupby("iteration"):
            # spread by number from left to right instead of random jitter
            x = iteration - 0.5 + CLOUD_WIDTH * (np.arange(len(rows)) / max(len(rows) - 1, 1) - 0.5)
            label = ROLLOUTS[SAMPLE].name if iteration == 1 else None
            axes.plot(x, rows["cost_rad"], color=colour, label=label, **look)
        for kind, beside, marker, line in ((IMPROVED, -0.18, "D", "none"), (FEEDBACK, 0.0, "o", "-")):
            rows = curve(curves, name, kind)
            look = {"color": ROLLOUTS[kind].colour, "marker": marker, "linestyle": line, "capsize": 3.0}
            bars = np.nan_to_num(rows["std"])
            axes.errorbar(rows.index + beside, rows["mean"], bars, label=ROLLOUTS[kind].name, **look)
        failed = own[own["fault"] != ""]
        if len(failed):
            look = {"transform": axes.get_xaxis_transform(), "clip_on": False, "label": "failed rollouts"}
            axes.plot(failed["iteration"] - 0.5, np.ones(len(failed)), "x", color=BLACK, **look)
        look = {"color": BLACK, "linestyle": ":", "linewidth": 1.0, "zorder": 1}
        axes.axvline(CONVERGED, **look, label="converged, as published")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.grid(axis="x", visible=False)
        axes.set(xlabel="iteration", ylabel="accumulated cost (rad)", ylim=(0.0, 1.5 * axes.get_ylim()[1]))
        axes.legend(ncols=2)
        figures.append(figure)
    return figures


@styled
def search_figure(stored: Stored, searches: pd.DataFrame) -> list[Figure]:
    """Cost of the mean policy over rollouts used, PI2-CMA and CMA-ES; mean and range over searches."""
    figures = []
    for name in stored.adapted:
        rows = matching(searches, primitive=name)
        if rows.empty:
            continue
        figure, axes = panel(primitive_title(stored.names, name), 2.6)
        for method, (label, colour) in SEARCHES.items():
            own = rows[rows["method"] == method]
            axes.fill_between(own["rollouts"], own["low"], own["high"], color=colour, alpha=0.18, linewidth=0)
            axes.plot(own["rollouts"], own["mean"], "o-", color=colour, markersize=4, label=label)
        axes.set(xlabel="rollouts used", ylabel="cost of the mean policy (rad)", ylim=(0.0, None))
        axes.legend()
        figures.append(figure)
    return figures


@dataclass(frozen=True)
class Snapshot:
    """One moment of an execution, seen along the roll axis."""

    hand_deg: float  # roll of the hand
    tool_deg: float  # roll of the tool
    off_deg: float  # angle between tool and board
    grasp: np.ndarray  # (2,) mm from the nominal contact point, x to the right and z up


def snapshots(run: Demonstration, board_deg: float, axis: np.ndarray) -> list[Snapshot]:
    """Snapshots of an execution at its start and at the end of every primitive.

    The angles are as recorded. Hand and tool are raised to compensate for the compliance of board and grasp,
    so that the edge lies on the board, not in it; hovering tools are lowered to `HEIGHT_DRAWN`.

    `axis`: (3,) roll axis.
    """
    hand, off = layout.hand_roll_deg(run, axis), layout.tool_roll_deg(run, axis)
    normal = turned(np.array([0.0, 1.0]), board_deg)
    found = []
    for moment in moments(run):
        edge = 1e3 * (run.position[moment] - layout.CONTACT_M)[[0, 2]]
        grasp = edge + turned(np.array([0.0, EDGE]), hand[moment])
        tool_deg = board_deg + off[moment]
        corners = grasp + turned(np.array([[-HALF_EDGE, -EDGE], [HALF_EDGE, -EDGE]]), tool_deg)
        height = float((corners @ normal).min())
        grasp[1] += (np.clip(height, 0.0, HEIGHT_DRAWN) - height) / normal[1]
        found.append(Snapshot(float(hand[moment]), float(tool_deg), float(abs(off[moment])), grasp))
    return found


def turned(points: np.ndarray, roll_deg: float) -> np.ndarray:
    """Rotate points (..., 2) clockwise about the roll axis, which points away from the viewer."""
    cos, sin = np.cos(np.radians(roll_deg)), np.sin(np.radians(roll_deg))
    return points @ np.array([[cos, -sin], [sin, cos]])


def typical_pair(stored: Stored) -> list[Demonstration]:
    """Executions before and after refinement under equal conditions, from the pair with the mean gain."""
    rows = matching(stored.tables["refined_scores"], setting_deg=stored.refined_deg)
    total = rows.groupby(["model", "run"])["cost_rad"].sum()
    gain = total[BEFORE] - total[AFTER]
    name = (gain - gain.mean()).abs().idxmin()
    return [run for model in (BEFORE, AFTER) for run in stored.refined[model] if run.name == name]


@styled
def snapshots_figure(stored: Stored) -> list[Figure]:
    """Figure IV.21: hand and tool before and after refinement, two moments a panel, with close-ups."""
    runs = [snapshots(run, stored.refined_deg, stored.axis) for run in typical_pair(stored)]
    titles = ["before the first", *(f"end of {name}" for name in stored.names)]
    moments_shown = list(zip(titles, *runs, strict=True))
    figures = []
    for first in range(0, len(moments_shown), 2):
        figures.append(canvas(4.2, PANEL_WIDTH))
        columns = figures[-1].subplots(2, 2, height_ratios=(VIEW[3] - VIEW[2], 40.0)).T
        for (wide, close), (title, before, after) in zip(
            columns, moments_shown[first : first + 2], strict=False
        ):
            for axes, view in ((wide, VIEW), (close, CLOSE_UP)):
                axes.set(xlim=view[:2], ylim=view[2:], aspect="equal")
                _draw_board(axes, stored.refined_deg)
                for model, shot in ((BEFORE, before), (AFTER, after)):
                    _draw_shot(axes, model, shot)
            wide.set_title(f"{capitalised(title)}\nhand {_change(before.hand_deg, after.hand_deg)}")
            close.set_title(f"tool off by {_change(before.off_deg, after.off_deg)}", fontsize=8.5)
        for axes in columns.ravel():
            axes.set_axis_off()
    figures[0].axes[2].legend(loc="upper right", fontsize=7.5)  # where the board is still empty
    return figures


def _draw_shot(axes: Axes, model: str, shot: Snapshot) -> None:
    """Draw hand and tool at one moment; lighter before refinement."""
    opacity = 0.9 if model == BEFORE else 0.75
    look: dict[str, Any] = {"edgecolor": "white", "linewidth": 0.6, "alpha": opacity}
    for outline in PARTS:
        corners = shot.grasp + turned(outline, shot.hand_deg)
        axes.add_patch(Polygon(corners, facecolor=HAND_COLOURS[model], **look))
    tool = shot.grasp + turned(TOOL, shot.tool_deg)
    axes.add_patch(Polygon(tool, facecolor=RUNS[model].colour, label=RUNS[model].name, **look))
    axes.add_patch(Polygon(tool, fill=False, edgecolor=RUNS[model].colour, linewidth=1.4, zorder=3))


def _draw_board(axes: Axes, board_deg: float) -> None:
    half = 0.5 * BOARD_LENGTH
    outline = [(-half, 0.0), (half, 0.0), (half, -BOARD_THICKNESS), (-half, -BOARD_THICKNESS)]
    axes.add_patch(Polygon(turned(np.array(outline), board_deg), facecolor=BOARD_COLOUR, linewidth=0))
    surface = turned(np.array([(-half, 0.0), (half, 0.0)]), board_deg)
    axes.plot(*surface.T, color=BLACK, linewidth=1.0, zorder=1)
    axes.text(0.8 * half, 2.0, f"{board_deg:g}°", ha="right", fontsize=8.5, clip_on=True)


def _change(old: float, new: float) -> str:
    """Change such as `3.1° → 1.0°`; a single number if both round to the same."""
    before, after = rounded(old, ".1f"), rounded(new, ".1f")
    return f"{before}°" if before == after else f"{before}° → {after}°"
