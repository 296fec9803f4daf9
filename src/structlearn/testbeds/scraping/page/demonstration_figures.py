"""Figures of demonstrations, primitives and their sequences; a figure is a list of panels."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from structlearn.core import quaternion
from structlearn.palette import (
    BLACK,
    CATEGORICAL_COLOURS,
    DEMONSTRATION_COLOUR,
    GREY,
    REFERENCE_COLOUR,
    primitive_colour,
)
from structlearn.primitives import canonical
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.figure_style import PANEL_WIDTH, canvas, styled
from structlearn.reporting.movement_figures import (
    draw_axes,
    draw_cuts,
    fit_panel,
    headroom,
    shade_primitives,
    space_panels,
    speed,
)
from structlearn.segmentation.segments import Segmentation
from structlearn.testbeds.scraping.page.segmentation_results import SegmentationResults

ELECTRODES_SHOWN = 4
FORCING_SAMPLES = 300
LINES = ("-", (0, (4, 1.5)))  # Line styles of the sequences in one figure


def busiest_electrodes(runs: Sequence[Demonstration]) -> np.ndarray:
    """Channels whose counts change most in any of the runs, rising."""
    moved = np.max([np.ptp(run.signal("tactile"), axis=0) for run in runs], axis=0)
    return np.sort(np.argsort(-moved, kind="stable")[:ELECTRODES_SHOWN])


def draw_electrodes(panel: Axes, run: Demonstration, channels: np.ndarray) -> None:
    """Counts of channels relative to their first reading."""
    tactile = run.signal("tactile")
    for colour, channel in zip(CATEGORICAL_COLOURS, channels, strict=False):
        counts = tactile[:, channel] - tactile[0, channel]
        panel.plot(run.time, counts, color=colour, linewidth=1.0, label=f"{channel + 1}")
    headroom(panel)
    panel.legend(title="channel", ncols=4, loc="upper left")


@styled
def demonstrations_figure(results: SegmentationResults) -> list[Figure]:
    """Position per axis and speed of all demonstrations over time; the reference in front."""
    figures = [canvas(3.6, PANEL_WIDTH) for _ in range(2)]
    panels = [panel for figure in figures for panel in figure.subplots(2, 1, sharex=True)]
    for one in sorted(results.demonstrations, key=lambda one: one.name == results.reference.name):
        first = one.name == results.reference.name
        look: dict[str, Any] = {
            "color": REFERENCE_COLOUR if first else DEMONSTRATION_COLOUR,
            "linewidth": 1.4 if first else 0.8,
            "label": f"reference ({one.name})" if first else None,
        }
        for panel, values in zip(panels, (*one.position.T, speed(one)), strict=True):
            panel.plot(one.time, 1e3 * values, **look)
    for panel, label in zip(panels, ("x (mm)", "y (mm)", "z (mm)", "speed (mm/s)"), strict=True):
        panel.set_ylabel(label)
    for panel in panels[1::2]:
        panel.set_xlabel("time (s)")
    panels[0].legend()
    return figures


@styled
def one_demonstration_figure(demonstration: Demonstration, segmentation: Segmentation) -> list[Figure]:
    """Position, speed and, where recorded, force and touch of one demonstration with its cut points."""
    time, names = demonstration.time, segmentation.primitives
    draws: list[Callable[[Axes], object]] = [
        lambda panel: draw_axes(panel, time, 1e3 * (demonstration.position - demonstration.position[0])),
        lambda panel: panel.plot(time, 1e3 * speed(demonstration), color=BLACK),
    ]
    labels = ["from start (mm)", "speed (mm/s)"]
    wrench = demonstration.wrench
    if wrench is not None:
        draws.append(lambda panel: draw_axes(panel, time, wrench[:, :3]))
        labels.append("force (N)")
    if demonstration.tactile is not None:
        channels = busiest_electrodes([demonstration])
        draws.append(lambda panel: draw_electrodes(panel, demonstration, channels))
        labels.append("touch (counts)")
    cuts = [segmentation.result(name).loc[demonstration.name, ["start_s", "end_s"]] for name in names]
    figures = []
    for first in range(0, len(draws), 2):
        part = draws[first : first + 2]
        figures.append(canvas(0.5 + 1.7 * len(part), PANEL_WIDTH))
        panels = figures[-1].subplots(len(part), 1, sharex=True, squeeze=False)[:, 0]
        for place, (panel, draw) in enumerate(zip(panels, part, strict=True)):
            draw(panel)
            panel.set_ylabel(labels[first + place])
            shade_primitives(panel, cuts, names if place == 0 else ())
            draw_cuts(panel, cuts, demonstration)
        panels[-1].set(xlabel="time (s)", xlim=(time[0], time[-1]))
    return figures


@styled
def space_figure(results: SegmentationResults) -> list[Figure]:
    """Figure IV.15c: the segments of all demonstrations in space, coloured by primitive."""
    paths = []
    for one in results.was_cut:
        for place, name in enumerate(results.segmentation.primitives):
            cuts = results.segmentation.result(name)
            if one.name in cuts.index:
                start, end = cuts.loc[one.name, ["start_s", "end_s"]]
                part = one.position[(one.time >= start) & (one.time <= end)]
                label = name if one.name == results.reference.name else None
                look = {"color": primitive_colour(place), "linewidth": 1.0, "label": label}
                paths.append((part, look))
    return space_panels(paths)


@styled
def sequence_space_figure(sequences: Mapping[str, pd.DataFrame]) -> list[Figure]:
    """Unrolled sequences in space, coloured by primitive; one line style each."""
    paths = []
    for number, (line, (title, table)) in enumerate(zip(LINES, sequences.items(), strict=False)):
        for place, (name, part) in enumerate(table.groupby("primitive", sort=False)):
            label = f"{name}, {title}" if number == 0 or place == 0 else None
            look = {"color": primitive_colour(place), "linestyle": line, "linewidth": 2.0, "label": label}
            paths.append((part[["x", "y", "z"]].to_numpy(), look))
    return space_panels(paths)


@styled
def position_fit_figure(results: SegmentationResults) -> list[Figure]:
    """Segments of all demonstrations relative to their goal, and the primitives unrolled, per primitive."""
    dt = results.reference.dt
    return [
        fit_panel(
            one.name,
            place,
            [1e3 * (path.position - path.position[-1]) for path, _ in results.segments[one.name]],
            1e3 * (one.position.unroll(dt).position - one.position.goal),
            [f"{axis} (mm)" for axis in "xyz"],
        )
        for place, one in enumerate(results.primitives)
    ]


@styled
def orientation_fit_figure(results: SegmentationResults) -> list[Figure]:
    """The same for orientations, as rotation vectors from the goal in the base frame."""
    dt = results.reference.dt
    return [
        fit_panel(
            one.name,
            place,
            [
                _from_goal(turn.orientation, turn.orientation[-1])
                for _, turn in results.segments[one.name]
                if turn is not None
            ],
            _from_goal(one.orientation.unroll(dt).orientation, one.orientation.goal),
            [f"about {axis} (°)" for axis in "xyz"],
        )
        for place, one in enumerate(results.primitives)
        if one.orientation is not None
    ]


def _from_goal(orientation: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Rotation vectors (T, 3) in degrees that turn the goal into the orientations (T, 4)."""
    return np.degrees(quaternion.difference(orientation, goal))


@styled
def forcing_figure(results: SegmentationResults) -> list[Figure]:
    """Forcing terms of the primitives in their local frames, and the phase that fades them out."""
    fraction = np.linspace(0.0, 1.0, FORCING_SAMPLES)
    figures = []
    for one in results.primitives:
        local, times = one.position.local, fraction * one.duration
        rows = {"position, local\nframe (m)": local.forcing(times, local.start, local.goal, one.duration)}
        if isinstance(one.orientation, QuaternionPrimitive):
            rows["orientation, base\nframe (rad)"] = one.orientation.forcing(times, one.duration)
        figures.append(_rows(f"Forcing terms: {one.name}", rows, fraction))
    p, u = canonical.phase(fraction, canonical.time_constant(1.0))
    figures.append(_rows("Canonical system", {"phase p": p, "phase velocity u": u}, fraction))
    return figures


def _rows(title: str, rows: Mapping[str, np.ndarray], fraction: np.ndarray) -> Figure:
    """Curves (T,) or (T, 3) below each other over normalised time."""
    figure = canvas(3.4, PANEL_WIDTH)
    panels = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for panel, (label, values) in zip(panels, rows.items(), strict=True):
        if values.ndim == 1:
            panel.plot(fraction, values, color=GREY)
        else:
            draw_axes(panel, fraction, values)
        panel.set_ylabel(label)
    panels[0].set_title(title)
    panels[-1].set_xlabel("time / duration")
    return figure
