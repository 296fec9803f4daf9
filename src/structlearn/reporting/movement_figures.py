"""Movement figures shared by several pages: cut signals, alignment (IV.14, IV.15), noise, primitives."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator, StrMethodFormatter
from mpl_toolkits.mplot3d import Axes3D

from structlearn.core import signals
from structlearn.palette import (
    AXIS_COLOURS,
    BLACK,
    BLUE,
    DEMONSTRATION_COLOUR,
    METHOD_COLOURS,
    METHOD_NAMES,
    OCHRE,
    ORANGE,
    REFERENCE_COLOUR,
    primitive_colour,
)
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.figure_style import PANEL_WIDTH, canvas, finish_space, styled
from structlearn.reporting.prose import capitalised
from structlearn.segmentation.alignment import METHODS, RESULT
from structlearn.segmentation.cut_errors import aligned_segments, spread_mm
from structlearn.segmentation.parameters import AXES, PrimitiveParameters
from structlearn.segmentation.segments import Segmentation

SPEED_CUTOFF_HZ = 5.0  # low-pass of the drawn speeds; differences of raw positions are mostly noise
PAIRS_SHOWN = 16
TOP_PAIRS = 8
APART = 0.03  # least distance of top pairs as a fraction of the reference segment


def speed(demonstration: Demonstration) -> np.ndarray:
    """Speed of the end effector for drawing, (T,) in m/s."""
    smooth = signals.low_pass(demonstration.position, demonstration.dt, SPEED_CUTOFF_HZ)
    return np.linalg.norm(signals.derivative(smooth, demonstration.dt), axis=1)


def shade_primitives(
    panel: Axes, segments: Sequence[tuple[float, float]] | np.ndarray, names: Sequence[str] = ()
) -> None:
    """Shade the time of every primitive in its colour, with its name at the top."""
    for place, (start, end) in enumerate(segments):
        panel.axvspan(start, end, color=primitive_colour(place), alpha=0.13, linewidth=0)
        if names:
            where: dict[str, Any] = {"transform": panel.get_xaxis_transform(), "ha": "center", "va": "bottom"}
            panel.text(0.5 * (start + end), 1.02, names[place], **where, fontsize=8.0)


def headroom(panel: Axes, share: float = 0.5) -> None:
    """Extend the y axis upwards to make room for a legend."""
    low, high = panel.get_ylim()
    panel.set_ylim(low, high + share * (high - low))


def draw_axes(panel: Axes, time: np.ndarray, values: np.ndarray) -> None:
    """Draw three columns in the colours of the axes."""
    for name, column, colour in zip("xyz", values.T, AXIS_COLOURS, strict=True):
        panel.plot(time, column, color=colour, linewidth=1.0, label=name)
    headroom(panel, 0.25)
    panel.legend(loc="upper left", ncols=3)


def draw_cuts(panel: Axes, cuts: Sequence[tuple[float, float]], demonstration: Demonstration) -> None:
    """Draw lines at the found cut points, and dotted lines at the true ones."""
    true = () if demonstration.true_segments is None else np.unique(demonstration.true_segments)
    for places, width, line in ((np.ravel(cuts), 0.9, "-"), (true, 1.2, ":")):
        for cut in places:
            panel.axvline(cut, color=BLACK, linewidth=width, linestyle=line)


def fit_panel(
    name: str, place: int, demonstrated: Sequence[np.ndarray], unrolled: np.ndarray, labels: Sequence[str]
) -> Figure:
    """One primitive over normalised time, one row per axis."""
    figure = canvas(4.2, PANEL_WIDTH)
    panels = figure.subplots(3, 1, sharex=True)
    grey: dict[str, Any] = {"color": DEMONSTRATION_COLOUR, "linewidth": 0.8, "alpha": 0.7}
    bold: dict[str, Any] = {"color": primitive_colour(place), "linewidth": 2.2}
    for axis, panel in enumerate(panels):
        for curve, look in [*((segment, grey) for segment in demonstrated), (unrolled, bold)]:
            panel.plot(np.linspace(0.0, 1.0, len(curve)), curve[:, axis], **look)
        panel.set_ylabel(labels[axis])
    panels[0].set_title(capitalised(name))
    panels[-1].set_xlabel("time / duration")
    figure.align_ylabels(panels)
    return figure


def space_panels(paths: Sequence[tuple[np.ndarray, Mapping[str, Any]]]) -> list[Figure]:
    """Paths (T, 3) in m: a panel in 3-D, and one from above."""
    figures = [canvas(3.6, PANEL_WIDTH) for _ in range(2)]
    figures[0].set_layout_engine("none")
    space = figures[0].add_axes((0.1, 0.14, 0.8, 0.84), projection="3d")  # leaves room for its labels
    assert isinstance(space, Axes3D)
    above = figures[1].add_subplot()
    for path, look in paths:
        space.plot(*(1e3 * path.T), **look)
        above.plot(1e3 * path[:, 1], 1e3 * path[:, 0], **look)
    finish_space(space, above, 1e3 * np.concatenate([path for path, _ in paths]))
    above.legend()
    return figures


@styled
def sequence_figure(sequences: Mapping[str, pd.DataFrame]) -> list[Figure]:
    """Position, speed and acceleration of each `sequence_table` by title, with the switches."""
    figures = []
    for title, table in sequences.items():
        figures.append(canvas(4.6, PANEL_WIDTH))
        panels = figures[-1].subplots(3, 1, sharex=True)
        time = table["time_s"].to_numpy()
        position = 1e3 * table[["x", "y", "z"]].to_numpy()
        draw_axes(panels[0], time, position - position[0])
        speeds = 1e3 * np.linalg.norm(table[["vx", "vy", "vz"]].to_numpy(), axis=1)
        panels[1].plot(time, speeds, color=BLACK)
        draw_axes(panels[2], time, table[["ax", "ay", "az"]].to_numpy())
        parts = table.groupby("primitive", sort=False)["time_s"].agg(["first", "last"])
        for panel, label in zip(panels, ("from start (mm)", "speed (mm/s)", "accel. (m/s²)"), strict=True):
            shade_primitives(panel, parts.to_numpy(), list(parts.index) if panel is panels[0] else ())
            panel.set_ylabel(label)
        panels[0].set_title(capitalised(title), pad=18)
        panels[-1].set(xlabel="time (s)", xlim=(time[0], time[-1]))
        figures[-1].align_ylabels(panels)
    return figures


def top_pairs(pairs: pd.DataFrame) -> pd.DataFrame:
    """Pairs with the largest weight in one demonstration and primitive (`Segmentation.pairs`), by time."""
    distance = APART * np.ptp(pairs["reference_s"].to_numpy())
    chosen: list[int] = []
    times = pairs["reference_s"].to_numpy()
    for place in np.argsort(-pairs["weight"].to_numpy(), kind="stable"):
        if len(chosen) == TOP_PAIRS or pairs["weight"].iloc[place] <= 0.0:
            break
        if all(abs(times[place] - times[other]) >= distance for other in chosen):
            chosen.append(int(place))
    return pairs.iloc[sorted(chosen)]


@styled
def correspondence_figure(
    reference: Demonstration, guess: Demonstration, segmentation: Segmentation, primitive: PrimitiveParameters
) -> list[Figure]:
    """Figure IV.14: pairs without weights, pairs with the largest weight, and refined segments."""
    chosen = segmentation.pairs["primitive"] == primitive.name
    pairs = segmentation.pairs[chosen & (segmentation.pairs["demonstration"] == guess.name)]
    some = pairs.iloc[np.linspace(0, len(pairs) - 1, min(PAIRS_SHOWN, len(pairs))).round().astype(int)]
    figures = [canvas(3.4, PANEL_WIDTH) for _ in range(3)]
    every, top, refined = (figure.subplots() for figure in figures)
    _draw_pairs(every, (reference, guess), pairs, some, primitive.axis)
    every.set_title(f"(a) Every {len(pairs) // max(len(some) - 1, 1)}th pair, no weights")
    lines = [("reference", REFERENCE_COLOUR, 1.8), ("guess", DEMONSTRATION_COLOUR, 1.8)]
    lines += [("pair", BLUE, 0.8), ("pair, near-zero velocity", ORANGE, 0.8)]
    handles = [Line2D([], [], color=colour, linewidth=width, label=label) for label, colour, width in lines]
    every.legend(handles=handles, handlelength=1.2, fontsize=7.5)
    best = top_pairs(pairs)
    _draw_pairs(top, (reference, guess), pairs, best, primitive.axis)
    top.set_title(f"(b) {len(best)} pairs of largest weight")
    curves = {}
    for method in ("ls", "wls_published", "wls"):
        segments, names = aligned_segments(
            [reference, guess], segmentation, primitive.name, method, primitive.shown_by
        )
        curves["reference"] = segments[names.index(reference.name)]
        curves[method] = segments[names.index(guess.name)]
    time = np.linspace(0.0, 1.0, len(curves["reference"]))
    for name, curve in curves.items():
        label, colour = METHOD_NAMES.get(name, name), METHOD_COLOURS.get(name, REFERENCE_COLOUR)
        labels = [label, *[None] * (curve.shape[1] - 1)]  # one legend entry for several axes
        refined.plot(time, 1e3 * (curve - curve.mean(axis=0)), color=colour, label=labels)
    refined.set(title="(c) Refined and stretched", xlabel="time / duration of the segment")
    refined.set_ylabel(f"{primitive.axis} from its mean (mm)")
    refined.legend(handlelength=1.2, fontsize=7.5)
    return figures


def _draw_pairs(
    panel: Axes,
    demonstrations: tuple[Demonstration, Demonstration],
    pairs: pd.DataFrame,
    shown: pd.DataFrame,
    axis: str,
) -> None:
    """Draw segments of the reference (above) and the guess over time, with lines between some pairs.

    For several axes, the one with the largest movement of the reference is drawn.
    """
    column = max(AXES[axis], key=lambda column: np.ptp(demonstrations[0].position[:, column]))
    segments, ends = [], []  # time and value of samples, and of the pairs' ends
    for demonstration, times in zip(demonstrations, ("reference_s", "guess_s"), strict=True):
        time, values = demonstration.time, 1e3 * demonstration.position[:, column]
        inside = (time >= pairs[times].min()) & (time <= pairs[times].max())
        start = time[inside][0]
        segments.append((time[inside] - start, values[inside]))
        ends.append((shown[times] - start, np.interp(shown[times], time, values)))
    (_, above), (_, below) = segments
    lifts = (0.75 * np.ptp(above) + below.max() - above.max(), 0.0)
    colours = (REFERENCE_COLOUR, DEMONSTRATION_COLOUR)
    for (time, values), lift, colour in zip(segments, lifts, colours, strict=True):
        panel.plot(time, values + lift, color=colour, linewidth=1.8)
    x, y = (np.stack([one[part] for one in ends], axis=1) for part in (0, 1))  # (N, 2) each
    for place, weight in enumerate(shown["weight"]):
        look: dict[str, Any] = {"color": ORANGE if weight == 0.0 else BLUE, "marker": "o", "markersize": 2.6}
        panel.plot(x[place], y[place] + lifts, linewidth=0.8, **look)
    panel.set_xlabel("time in the extended segment (s)")
    panel.set_ylabel(f"{'xyz'[column]}, shifted (mm)")


@styled
def alignment_figure(
    demonstrations: Sequence[Demonstration],
    segmentation: Segmentation,
    primitives: Sequence[PrimitiveParameters],
) -> list[Figure]:
    """Figure IV.15a, b: segments of all demonstrations at one duration, before and after refining."""
    figures = []
    for primitive in primitives:
        figures.append(canvas(4.6, PANEL_WIDTH))
        grid = figures[-1].subplots(2, 2, sharex=True, sharey=True)
        for panel, method in zip(grid.ravel(), ("zvc", "ls", "wls_published", "wls"), strict=True):
            arguments = (demonstrations, segmentation, primitive.name, method, primitive.shown_by)
            segments, names = aligned_segments(*arguments)
            curves = 1e3 * (segments - segments.mean(axis=1, keepdims=True))
            time = np.linspace(0.0, 1.0, curves.shape[1])
            for place in np.argsort(np.equal(names, segmentation.reference), kind="stable"):
                first = names[place] == segmentation.reference
                colour = REFERENCE_COLOUR if first else METHOD_COLOURS[method]
                for column in curves[place].T:
                    panel.plot(time, column, color=colour, linewidth=1.5 if first else 0.8)
            if len(names) > 1:
                rises = curves[:, -1].mean() > curves[:, 0].mean()
                x, side = (0.05, "left") if rises else (0.97, "right")
                spread = f"spread {spread_mm(segments):.2f} mm"
                panel.text(x, 0.95, spread, transform=panel.transAxes, ha=side, va="top")
            panel.set_title(METHOD_NAMES[method], fontweight="normal")
        figures[-1].suptitle(capitalised(primitive.name), fontsize=9.5, weight="bold")
        figures[-1].supylabel(f"{primitive.axis} from its mean (mm)", fontsize=9.0)
        figures[-1].supxlabel("time / duration", fontsize=9.0)
    return figures


@styled
def noise_figure(
    by_level: pd.DataFrame,
    comparison: pd.DataFrame,
    noise: str = "noise of the demonstrator (mm)",
    pair: str = "same person",
) -> list[Figure]:
    """Cut errors over the noise (`errors_by_level`), and paired differences to the result's method.

    `comparison`: from `cut_errors.paired_comparison`; `pair`: what the errors of a difference have in common.
    """
    figures = [canvas(3.6, PANEL_WIDTH) for _ in range(2)]
    errors, differences = (figure.subplots() for figure in figures)
    levels = sorted(by_level["noise_mm"].unique())
    places = {level: place for place, level in enumerate(levels)}
    _draw_methods(errors, by_level, places, "mean_ms", "half_width_ms", METHODS)
    errors.set_yscale("log")
    errors.yaxis.set_minor_locator(NullLocator())
    low, high = by_level["mean_ms"].min(), by_level["mean_ms"].max()
    ticks = (1, 2, 5, 10, 20, 30, 50, 70, 100, 150, 200, 300, 500, 1000, 2000)
    errors.set_yticks([tick for tick in ticks if 0.7 * low <= tick <= 1.4 * high])
    errors.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    errors.set(title="Mean cut error", ylabel="mean absolute error (ms)")
    close = [method for method in ("zvc", "ls", "wls_published") if method in set(comparison["method"])]
    halves = comparison.assign(half_ms=comparison["high_ms"] - comparison["difference_ms"])
    _draw_methods(differences, halves, places, "difference_ms", "half_ms", close)
    differences.axhline(0.0, color=METHOD_COLOURS[RESULT], linewidth=1.4)
    differences.set(title=f"Error minus that of “{METHOD_NAMES[RESULT]}”", ylabel=f"difference, {pair} (ms)")
    for panel in (errors, differences):
        panel.set_xticks(range(len(levels)), [f"{level:g}" for level in levels])
        panel.set_xlabel(noise)
        panel.grid(axis="x", visible=False)
    errors.set_ylim(top=2.5 * high)
    errors.legend(loc="upper left", ncols=2)
    return figures


def _draw_methods(
    panel: Axes, table: pd.DataFrame, places: dict[float, int], mean: str, half: str, methods: Sequence[str]
) -> None:
    """Draw lines with error bars, shifted slightly so that they do not overlap."""
    for number, method in enumerate(methods):
        rows = table[table["method"] == method]
        x = rows["noise_mm"].map(places) + 0.07 * (number - 0.5 * (len(methods) - 1))
        look: dict[str, Any] = {"color": METHOD_COLOURS[method], "label": METHOD_NAMES[method], "marker": "o"}
        look |= {"markersize": 3.5, "linewidth": 1.3, "elinewidth": 1.0, "capsize": 2.0}
        panel.errorbar(x, rows[mean], rows[half].fillna(0.0), **look)


@styled
def downsampling_figure(effect: pd.DataFrame) -> list[Figure]:
    """Work of the time warping and shift of the cut points over the down-sampling factor g (appendix C)."""
    figures = [canvas(2.9, PANEL_WIDTH) for _ in range(2)]
    work, shift = (figure.subplots() for figure in figures)
    work.plot(effect["factor"], effect["work"], color=BLUE, marker="o", markersize=4)
    work.set_yscale("log")
    work.set(title="Work", ylabel="cells of the warping table,\nrelative to the first g")
    work.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    for column, label, colour in (("max_shift_ms", "largest", OCHRE), ("mean_shift_ms", "mean", BLUE)):
        shift.plot(effect["factor"], effect[column], color=colour, marker="o", markersize=4, label=label)
    shift.set(title="Shift of the cut points", ylabel="shift (ms)")
    shift.set_ylim(bottom=0.0)
    shift.legend(loc="upper left")
    for panel in (work, shift):
        panel.set_xscale("log", base=2)
        panel.set_xticks(effect["factor"], [f"{factor}" for factor in effect["factor"]])
        panel.xaxis.set_minor_locator(NullLocator())
        panel.yaxis.set_minor_locator(NullLocator())
        panel.set_xlabel("down-sampling factor g")
    return figures
