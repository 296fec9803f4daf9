"""Figures of movements shared by several pages: cuts, noise, primitives."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator, StrMethodFormatter
from mpl_toolkits.mplot3d import Axes3D

from structlearn.core import signals
from structlearn.palette import (
    AXIS_COLOURS,
    BLACK,
    DEMONSTRATION_COLOUR,
    METHOD_COLOURS,
    METHOD_NAMES,
    REPRODUCTION_COLOUR,
    primitive_colour,
)
from structlearn.primitives.sequence import columns_of
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.figure_style import PANEL_WIDTH, canvas, finish_space, styled
from structlearn.reporting.prose import capitalised
from structlearn.segmentation.alignment import METHODS, RESULT

UNITS = ("from start (mm)", "speed (mm/s)", "accel. (m/s²)")
UNITS_OF_JOINTS = ("from start", "speed (per s)", "accel. (per s²)")
SPEED_CUTOFF_HZ = 5.0  # low-pass for drawn speeds; differences of raw positions are mostly noise


def speed(demonstration: Demonstration) -> np.ndarray:
    """Speed (T,) of the end effector in m/s, or of all joints, smoothed for drawing."""
    smooth = signals.low_pass(demonstration.position, demonstration.dt, SPEED_CUTOFF_HZ)
    return np.linalg.norm(signals.derivative(smooth, demonstration.dt), axis=1)


def shade_primitives(
    panel: Axes, segments: Sequence[tuple[float, float]] | np.ndarray, names: Sequence[str] = ()
) -> None:
    """Shade the time span of each primitive in its colour, with its name at the top."""
    for place, (start, end) in enumerate(segments):
        panel.axvspan(start, end, color=primitive_colour(place), alpha=0.13, linewidth=0)
        if names:
            where: dict[str, Any] = {"transform": panel.get_xaxis_transform(), "ha": "center", "va": "bottom"}
            panel.text(0.5 * (start + end), 1.02, names[place], **where, fontsize=8.0)


def headroom(panel: Axes, share: float = 0.5) -> None:
    """Extend the y axis upwards to make room for a legend."""
    low, high = panel.get_ylim()
    panel.set_ylim(low, high + share * (high - low))


def draw_axes(panel: Axes, time: np.ndarray, values: np.ndarray, names: Sequence[str] = "xyz") -> None:
    """Plot three columns in the colours of x, y and z, or any number of others, with their names."""
    for place, (name, column) in enumerate(zip(names, values.T, strict=True)):
        colour = AXIS_COLOURS[place] if len(names) == len(AXIS_COLOURS) else primitive_colour(place)
        panel.plot(time, column, color=colour, linewidth=1.0, label=name)
    headroom(panel, 0.25 * max(1, len(names) // 6))
    panel.legend(loc="upper left", ncols=min(len(names), 3))


def draw_cuts(panel: Axes, cuts: Sequence[tuple[float, float]], demonstration: Demonstration) -> None:
    """Draw lines at the cut points found, and dotted lines at the true ones."""
    true = () if demonstration.true_segments is None else np.unique(demonstration.true_segments)
    for places, width, line in ((np.ravel(cuts), 0.9, "-"), (true, 1.2, ":")):
        for cut in places:
            panel.axvline(cut, color=BLACK, linewidth=width, linestyle=line)


def reproduction_panel(
    name: str,
    place: int,
    demonstrated: Sequence[np.ndarray],
    unrolled: np.ndarray,
    labels: Sequence[str],
    cycles: Sequence[tuple[float, float]] | None = None,
) -> Figure:
    """Demonstrated and unrolled curves of one primitive over normalised time, one row per axis.

    `cycles`: the phase at the start and end of each curve, for a rhythmic primitive.
    """
    figure = canvas(1.4 * len(labels), PANEL_WIDTH)
    panels = figure.subplots(len(labels), 1, sharex=True, squeeze=False)[:, 0]
    grey: dict[str, Any] = {"color": DEMONSTRATION_COLOUR, "linewidth": 0.8, "alpha": 0.7}
    bold: dict[str, Any] = {"color": primitive_colour(place), "linewidth": 2.2}
    curves = [*((segment, grey) for segment in demonstrated), (unrolled, bold)]
    spans = cycles or [(0.0, 1.0)] * len(curves)
    for axis, panel in enumerate(panels):
        for (curve, look), span in zip(curves, spans, strict=True):
            panel.plot(np.linspace(*span, len(curve)), curve[:, axis], **look)
        panel.set_ylabel(labels[axis])
    panels[0].set_title(capitalised(name))
    panels[-1].set_xlabel("cycles" if cycles else "time / duration")
    figure.align_ylabels(panels)
    return figure


def space_panels(paths: Sequence[tuple[np.ndarray, Mapping[str, Any]]]) -> list[Figure]:
    """Paths (T, 3) m: one panel in 3-D, and one from above."""
    figures = [canvas(3.6, PANEL_WIDTH) for _ in range(2)]
    figures[0].set_layout_engine("none")
    space = figures[0].add_axes((0.1, 0.14, 0.8, 0.84), projection="3d")  # with room for its labels
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
    """Position, speed and acceleration of each `sequence_table`, keyed by title, with the switches.

    Of joints in their own unit.
    """
    figures = []
    for title, table in sequences.items():
        figures.append(canvas(4.6, PANEL_WIDTH))
        panels = figures[-1].subplots(3, 1, sharex=True)
        time = table["time_s"].to_numpy()
        moved = columns_of(table)
        names = [name.removeprefix("q.") for name in moved]
        factor, units = (1e3, UNITS) if names == list("xyz") else (1.0, UNITS_OF_JOINTS)
        position = factor * moved.to_numpy()
        draw_axes(panels[0], time, position - position[0], names)
        speeds = factor * np.linalg.norm(columns_of(table, "v").to_numpy(), axis=1)
        panels[1].plot(time, speeds, color=BLACK)
        draw_axes(panels[2], time, columns_of(table, "a").to_numpy(), names)
        parts = table.groupby("primitive", sort=False)["time_s"].agg(["first", "last"])
        for panel, label in zip(panels, units, strict=True):
            shade_primitives(panel, parts.to_numpy(), list(parts.index) if panel is panels[0] else ())
            panel.set_ylabel(label)
        panels[0].set_title(capitalised(title), pad=18)
        panels[-1].set(xlabel="time (s)", xlim=(time[0], time[-1]))
        figures[-1].align_ylabels(panels)
    return figures


@styled
def outputs_figure(
    nominal: pd.DataFrame, demonstrated: Mapping[str, Sequence[tuple[np.ndarray, np.ndarray]]]
) -> list[Figure]:
    """Each output of a `sequence_table` over time, with the demonstrations' stretched to its primitives.

    `demonstrated`: by column of the table, times (T,) s and values (T,).
    """
    figures = []
    time = nominal["time_s"].to_numpy()
    parts = nominal.groupby("primitive", sort=False)["time_s"].agg(["first", "last"])
    for column, curves in demonstrated.items():
        kind, _, name = column.partition(".")
        figures.append(canvas(2.0, PANEL_WIDTH))
        panel = figures[-1].subplots()
        style: dict[str, Any] = {"drawstyle": "steps-post"} if kind == "digital" else {}
        for its_time, values in curves:
            panel.plot(its_time, values, color=DEMONSTRATION_COLOUR, linewidth=0.8, alpha=0.7, **style)
        panel.plot(time, nominal[column], color=REPRODUCTION_COLOUR, linewidth=2.0, **style)
        shade_primitives(panel, parts.to_numpy(), list(parts.index))
        panel.set(xlabel="time (s)", ylabel=name, xlim=(time[0], time[-1]))
        if kind == "digital":
            panel.set(yticks=[0, 1], yticklabels=["off", "on"])
    return figures


@styled
def noise_figure(
    by_level: pd.DataFrame,
    comparison: pd.DataFrame,
    noise: str = "noise of the demonstrator (mm)",
    pair: str = "same person",
) -> list[Figure]:
    """Cut errors over noise (`errors_by_level`), and paired differences from the chosen method.

    `comparison`: of `cut_errors.paired_comparison`; `pair`: what the errors of a pair have in common.
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
    """Draw lines with error bars, shifted slightly so that the bars of methods do not overlap."""
    for number, method in enumerate(methods):
        rows = table[table["method"] == method]
        x = rows["noise_mm"].map(places) + 0.07 * (number - 0.5 * (len(methods) - 1))
        look: dict[str, Any] = {"color": METHOD_COLOURS[method], "label": METHOD_NAMES[method], "marker": "o"}
        look |= {"markersize": 3.5, "linewidth": 1.3, "elinewidth": 1.0, "capsize": 2.0}
        panel.errorbar(x, rows[mean], rows[half].fillna(0.0), **look)
