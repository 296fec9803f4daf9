"""Figures of movements that several pages share: signals with cuts, primitives over segments, sequences."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

from structlearn.core import signals
from structlearn.palette import AXIS_COLOURS, BLACK, DEMONSTRATION_COLOUR, primitive_colour
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.figure_style import PANEL_WIDTH, canvas, finish_space, styled
from structlearn.reporting.prose import capitalised

SPEED_CUTOFF_HZ = 5.0  # low-pass of the speeds that are drawn; differences of raw positions are mostly noise


def speed(demonstration: Demonstration) -> np.ndarray:
    """Speed of the end effector for drawing, (T,) in m/s."""
    smooth = signals.low_pass(demonstration.position, demonstration.dt, SPEED_CUTOFF_HZ)
    return np.linalg.norm(signals.derivative(smooth, demonstration.dt), axis=1)


def shade_primitives(
    panel: Axes, segments: Sequence[tuple[float, float]] | np.ndarray, names: Sequence[str] = ()
) -> None:
    """Colour the time of every primitive; write their names at the top."""
    for place, (start, end) in enumerate(segments):
        panel.axvspan(start, end, color=primitive_colour(place), alpha=0.13, linewidth=0)
        if names:
            where: dict[str, Any] = {"transform": panel.get_xaxis_transform(), "ha": "center", "va": "bottom"}
            panel.text(0.5 * (start + end), 1.02, names[place], **where, fontsize=8.0)


def headroom(panel: Axes, share: float = 0.5) -> None:
    """Room for a legend above what is drawn."""
    low, high = panel.get_ylim()
    panel.set_ylim(low, high + share * (high - low))


def draw_axes(panel: Axes, time: np.ndarray, values: np.ndarray) -> None:
    """Three columns in the colours of the axes."""
    for name, column, colour in zip("xyz", values.T, AXIS_COLOURS, strict=True):
        panel.plot(time, column, color=colour, linewidth=1.0, label=name)
    headroom(panel, 0.25)
    panel.legend(loc="upper left", ncols=3)


def draw_cuts(panel: Axes, cuts: Sequence[tuple[float, float]], demonstration: Demonstration) -> None:
    """Lines at the cut points found, dotted ones at the true cut points."""
    for cut in np.ravel(cuts):
        panel.axvline(cut, color=BLACK, linewidth=0.9)
    if demonstration.true_segments is not None:
        for cut in np.unique(demonstration.true_segments):
            panel.axvline(cut, color=BLACK, linewidth=1.2, linestyle=":")


def fit_panel(
    name: str, place: int, demonstrated: Sequence[np.ndarray], unrolled: np.ndarray, labels: Sequence[str]
) -> Figure:
    """One primitive, one row per axis, over normalised time."""
    figure = canvas(4.2, PANEL_WIDTH)
    panels = figure.subplots(3, 1, sharex=True)
    for axis, panel in enumerate(panels):
        for segment in demonstrated:
            time = np.linspace(0.0, 1.0, len(segment))
            panel.plot(time, segment[:, axis], color=DEMONSTRATION_COLOUR, linewidth=0.8, alpha=0.7)
        time = np.linspace(0.0, 1.0, len(unrolled))
        panel.plot(time, unrolled[:, axis], color=primitive_colour(place), linewidth=2.2)
        panel.set_ylabel(labels[axis])
    panels[0].set_title(capitalised(name))
    panels[-1].set_xlabel("time / duration")
    figure.align_ylabels(panels)
    return figure


def space_panels(paths: Sequence[tuple[np.ndarray, Mapping[str, Any]]]) -> list[Figure]:
    """Paths (T, 3) in m: a panel in 3-D, and one from above."""
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
    """Position, speed and acceleration of unrolled sequences over time, with the switches; a panel each.

    `sequences`: by title, of `primitives.sequence.sequence_table`.
    """
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
        for panel in panels:
            segments = parts.itertuples(index=False, name=None)
            shade_primitives(panel, list(segments), list(parts.index) if panel is panels[0] else ())
        for panel, label in zip(panels, ("from start (mm)", "speed (mm/s)", "accel. (m/s²)"), strict=True):
            panel.set_ylabel(label)
        panels[0].set_title(capitalised(title), pad=18)
        panels[-1].set(xlabel="time (s)", xlim=(time[0], time[-1]))
        figures[-1].align_ylabels(panels)
    return figures
