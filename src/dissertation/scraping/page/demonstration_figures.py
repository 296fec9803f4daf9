"""Figures of demonstrations, primitives and sequences; each figure is a list of panels."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dissertation.scraping.page.stored import Stored
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
from structlearn.primitives.sequence import PosePrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.figure_style import PANEL_WIDTH, canvas, styled
from structlearn.reporting.movement_figures import (
    draw_axes,
    draw_cuts,
    headroom,
    reproduction_panel,
    shade_primitives,
    space_panels,
    speed,
)

ELECTRODES_SHOWN = 4
FORCING_SAMPLES = 300
LINES = ("-", (0, (4, 1.5)))  # line styles of the sequences in one figure


def stacked_panels(
    labels: Sequence[str], height: float, title: str = "", time: str = "time / duration"
) -> tuple[Figure, np.ndarray]:
    """Figure with vertically stacked panels that share a time axis; `labels` are their y labels."""
    figure = canvas(height, PANEL_WIDTH)
    panels = figure.subplots(len(labels), 1, sharex=True, squeeze=False)[:, 0]
    for panel, label in zip(panels, labels, strict=True):
        panel.set_ylabel(label)
    panels[0].set_title(title)
    panels[-1].set_xlabel(time)
    return figure, panels


def busiest_electrodes(runs: Sequence[Demonstration]) -> np.ndarray:
    """Channels whose counts change most in any run, ascending."""
    moved = np.max([np.ptp(run.signal("tactile"), axis=0) for run in runs], axis=0)
    return np.sort(np.argsort(-moved, kind="stable")[:ELECTRODES_SHOWN])


def draw_electrodes(panel: Axes, run: Demonstration, channels: np.ndarray) -> None:
    """Plot counts of channels relative to their first reading."""
    tactile = run.signal("tactile")
    for colour, channel in zip(CATEGORICAL_COLOURS, channels, strict=False):
        counts = tactile[:, channel] - tactile[0, channel]
        panel.plot(run.time, counts, color=colour, linewidth=1.0, label=f"{channel + 1}")
    headroom(panel)
    panel.legend(title="channel", ncols=4, loc="upper left")


@styled
def demonstrations_figure(stored: Stored) -> list[Figure]:
    """Position per axis and speed of all demonstrations over time, with the reference in front."""
    labels = [["x (mm)", "y (mm)"], ["z (mm)", "speed (mm/s)"]]
    figures, rows = zip(*(stacked_panels(pair, 3.6, time="time (s)") for pair in labels), strict=True)
    panels = np.concatenate(rows)
    for one in sorted(stored.demonstrations, key=lambda one: one.name == stored.reference.name):
        look: dict[str, Any] = {"color": DEMONSTRATION_COLOUR, "linewidth": 0.8}
        if one.name == stored.reference.name:
            look = {"color": REFERENCE_COLOUR, "linewidth": 1.4, "label": f"reference ({one.name})"}
        for panel, values in zip(panels, (*one.position.T, speed(one)), strict=True):
            panel.plot(one.time, 1e3 * values, **look)
    panels[0].legend()
    return list(figures)


@styled
def one_demonstration_figure(stored: Stored) -> list[Figure]:
    """Position, speed and, if recorded, force and touch of one demonstration with its cut points."""
    one, segmentation = (stored.guesses or [stored.reference])[0], stored.segmentation
    names, wrench = segmentation.primitives, one.wrench
    pairs = [["from start (mm)", "speed (mm/s)"]]
    felt = ["force (N)"] * (wrench is not None) + ["touch (counts)"] * (one.tactile is not None)
    pairs += [felt] if felt else []
    cuts = [segmentation.result(name).loc[one.name, ["start_s", "end_s"]] for name in names]
    figures = []
    for labels in pairs:
        figure, panels = stacked_panels(labels, 0.5 + 1.7 * len(labels), time="time (s)")
        for panel, label in zip(panels, labels, strict=True):
            if label == "from start (mm)":
                draw_axes(panel, one.time, 1e3 * (one.position - one.position[0]))
            elif label == "speed (mm/s)":
                panel.plot(one.time, 1e3 * speed(one), color=BLACK)
            elif label == "force (N)" and wrench is not None:
                draw_axes(panel, one.time, wrench[:, :3])
            else:
                draw_electrodes(panel, one, busiest_electrodes([one]))
            shade_primitives(panel, cuts, names if panel is panels[0] else ())
            draw_cuts(panel, cuts, one)
        panels[-1].set_xlim(one.time[0], one.time[-1])
        figures.append(figure)
    return figures


@styled
def space_figure(stored: Stored) -> list[Figure]:
    """Figure IV.15c: segments of all demonstrations in space, coloured by primitive."""
    paths = []
    for one in stored.was_cut:
        for place, name in enumerate(stored.segmentation.primitives):
            cuts = stored.segmentation.result(name)
            if one.name in cuts.index:
                start, end = cuts.loc[one.name, ["start_s", "end_s"]]
                part = one.position[(one.time >= start) & (one.time <= end)]
                label = name if one.name == stored.reference.name else None
                look = {"color": primitive_colour(place), "linewidth": 1.0, "label": label}
                paths.append((part, look))
    return space_panels(paths)


@styled
def sequence_space_figure(sequences: Mapping[str, pd.DataFrame]) -> list[Figure]:
    """Unrolled sequences in space, coloured by primitive; one line style per sequence."""
    paths = []
    for number, (line, (title, table)) in enumerate(zip(LINES, sequences.items(), strict=False)):
        for place, (name, part) in enumerate(table.groupby("primitive", sort=False)):
            label = f"{name}, {title}" if number == 0 or place == 0 else None
            look = {"color": primitive_colour(place), "linestyle": line, "linewidth": 2.0, "label": label}
            paths.append((part[["x", "y", "z"]].to_numpy(), look))
    return space_panels(paths)


@styled
def position_fit_figure(stored: Stored) -> list[Figure]:
    """Segments of all demonstrations relative to their goal, with the unrolled primitive."""
    labels = [f"{axis} (mm)" for axis in "xyz"]
    figures = []
    for place, one in enumerate(stored.primitives):
        paths = [1e3 * (path.position - path.position[-1]) for path, _ in stored.segments[one.name]]
        unrolled = 1e3 * (one.position.unroll(stored.reference.dt).position - one.position.goal)
        figures.append(reproduction_panel(one.name, place, paths, unrolled, labels))
    return figures


@styled
def orientation_fit_figure(stored: Stored) -> list[Figure]:
    """Orientations of all segments as rotation vectors from the goal (°), with the unrolled primitive."""
    labels = [f"about {axis} (°)" for axis in "xyz"]
    figures = []
    for place, one in enumerate(stored.primitives):
        if one.orientation is not None:
            turns = [turn.orientation for _, turn in stored.segments[one.name] if turn is not None]
            paths = [np.degrees(quaternion.difference(turn, turn[-1])) for turn in turns]
            unrolled = one.orientation.unroll(stored.reference.dt).orientation
            from_goal = np.degrees(quaternion.difference(unrolled, one.orientation.goal))
            figures.append(reproduction_panel(one.name, place, paths, from_goal, labels))
    return figures


@styled
def forcing_figure(primitives: Sequence[PosePrimitive]) -> list[Figure]:
    """Forcing terms of the primitives in their local frames, and the phase that fades them out."""
    fraction = np.linspace(0.0, 1.0, FORCING_SAMPLES)
    p, u = canonical.phase(fraction, canonical.time_constant(1.0))
    curves = {}
    for one in primitives:
        local, times = one.position.local, fraction * one.duration
        rows = {"position, local\nframe (m)": local.forcing(times, local.start, local.goal, one.duration)}
        if isinstance(one.orientation, QuaternionPrimitive):
            rows["orientation, base\nframe (rad)"] = one.orientation.forcing(times, one.duration)
        curves[f"Forcing terms: {one.name}"] = rows
    curves["Canonical system"] = {"phase p": p, "phase velocity u": u}
    figures = []
    for title, rows in curves.items():
        figure, panels = stacked_panels(list(rows), 3.4, title)
        for panel, values in zip(panels, rows.values(), strict=True):
            if values.ndim == 1:
                panel.plot(fraction, values, color=GREY)
            else:
                draw_axes(panel, fraction, values)
        figures.append(figure)
    return figures
