"""Figures of the primitives: how they fit, what drives them, and the sequence they form."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from structlearn.ground import quaternion
from structlearn.palette import AXIS_COLOURS, BLACK, DEMONSTRATION_COLOUR, GREY, primitive_colour
from structlearn.primitives import canonical
from structlearn.primitives.fitting import Segment
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.primitives.sequence import PosePrimitive
from structlearn.reporting.figures import canvas, finish_space, legend_above, space_panels, styled

FORCING_SAMPLES = 300
LINES = ("-", (0, (4, 1.5)), ":", "-.")
"""Line styles of the sequences in one figure."""


@styled
def position_fit_figure(
    primitives: Sequence[PosePrimitive], segments: Mapping[str, Sequence[Segment]], dt: float
) -> Figure:
    """Segments of all demonstrations relative to their goal, and the primitives unrolled, per axis.

    Args:
        primitives: learned from the segments.
        segments: by name of the primitive.
        dt: sampling interval in s.
    """
    demonstrated = {
        name: [1e3 * (position.position - position.position[-1]) for position, _ in paths]
        for name, paths in segments.items()
    }
    unrolled = [
        1e3 * (primitive.position.unroll(dt).position - primitive.position.goal) for primitive in primitives
    ]
    return _fit_figure(primitives, demonstrated, unrolled, [f"{axis} (mm)" for axis in "xyz"])


@styled
def orientation_fit_figure(
    primitives: Sequence[PosePrimitive], segments: Mapping[str, Sequence[Segment]], dt: float
) -> Figure:
    """The same for orientations, as rotation vectors from the goal in the base frame.

    All primitives and segments must have an orientation.
    """
    demonstrated = {
        name: [_from_goal(turn.orientation, turn.orientation[-1]) for _, turn in paths]
        for name, paths in segments.items()
    }
    unrolled = [
        _from_goal(primitive.orientation.unroll(dt).orientation, primitive.orientation.goal)
        for primitive in primitives
    ]
    return _fit_figure(primitives, demonstrated, unrolled, [f"turn about {axis} (°)" for axis in "xyz"])


def _from_goal(orientation: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Rotation vectors (T, 3) in degrees that turn the goal into the orientations (T, 4)."""
    return np.degrees(quaternion.difference(orientation, goal))


def _fit_figure(
    primitives: Sequence[PosePrimitive],
    demonstrated: Mapping[str, Sequence[np.ndarray]],
    unrolled: Sequence[np.ndarray],
    labels: Sequence[str],
) -> Figure:
    """One row per primitive, one column per axis, over normalised time."""
    figure = canvas(0.6 + 1.75 * len(primitives))
    panels = figure.subplots(len(primitives), 3, sharex=True, squeeze=False)
    for place, (row, primitive, path) in enumerate(zip(panels, primitives, unrolled, strict=True)):
        for axis, panel in enumerate(row):
            for segment in demonstrated[primitive.name]:
                time = np.linspace(0.0, 1.0, len(segment))
                panel.plot(time, segment[:, axis], color=DEMONSTRATION_COLOUR, linewidth=0.8, alpha=0.7)
            time = np.linspace(0.0, 1.0, len(path))
            panel.plot(time, path[:, axis], color=primitive_colour(place), linewidth=2.2)
            panel.set_ylabel(labels[axis])
        row[0].set_title(primitive.name)
    for panel in panels[-1]:
        panel.set_xlabel("time / duration")
    figure.align_ylabels(panels)
    handles = [Line2D([], [], color=DEMONSTRATION_COLOUR, linewidth=0.8, label="demonstrations")]
    handles += [
        Line2D([], [], color=primitive_colour(place), linewidth=2.2, label=f"primitive {primitive.name}")
        for place, primitive in enumerate(primitives)
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles))
    return figure


@styled
def forcing_figure(primitives: Sequence[PosePrimitive]) -> Figure:
    """Forcing terms of the primitives in their local frames, and the phase that fades them out."""
    turning = any(isinstance(primitive.orientation, QuaternionPrimitive) for primitive in primitives)
    figure = canvas(4.7 if turning else 3.1)
    panels = figure.subplots(2 if turning else 1, len(primitives) + 1, sharex=True, squeeze=False)
    fraction = np.linspace(0.0, 1.0, FORCING_SAMPLES)
    p, u = canonical.phase(fraction, canonical.time_constant(1.0))
    for place, primitive in enumerate(primitives):
        local, times = primitive.position.local, fraction * primitive.duration
        values = local.forcing(times, local.start, local.goal, primitive.duration)
        for axis, colour in enumerate(AXIS_COLOURS):
            panels[0, place].plot(fraction, values[:, axis], color=colour, label="xyz"[axis])
        panels[0, place].set_title(primitive.name)
        if isinstance(primitive.orientation, QuaternionPrimitive):
            turn = primitive.orientation.forcing(times, primitive.duration)
            for axis, colour in enumerate(AXIS_COLOURS):
                panels[1, place].plot(fraction, turn[:, axis], color=colour)
    panels[0, 0].set_ylabel("forcing term of position\nin the local frame (m)")
    phase = panels[0, -1]
    phase.plot(fraction, p, color=BLACK)
    phase.plot(fraction, u, color=GREY)
    phase.text(0.38, 0.45, "phase p", color=BLACK, va="bottom")
    phase.text(0.44, -3.6, "phase\nvelocity u", color=GREY, va="center")
    phase.set_title("canonical system")
    if turning:
        panels[1, 0].set_ylabel("forcing term of orientation\nin the base frame (rad)")
        panels[1, -1].remove()
        phase.tick_params(labelbottom=True)
        phase.set_xlabel("time / duration")
    for panel in panels[-1, :-1] if turning else panels[-1]:
        panel.set_xlabel("time / duration")
    legend_above(figure, panels[0, 0])
    return figure


@styled
def sequence_figure(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """Position, speed and acceleration of unrolled sequences over time, with the switches.

    Args:
        tables: by title, of `primitives.sequence.sequence_table`; one column each.
    """
    figure = canvas(5.6)
    panels = figure.subplots(3, len(tables), sharex="col", sharey="row", squeeze=False)
    for column, (title, table) in zip(panels.T, tables.items(), strict=True):
        time = table["time_s"].to_numpy()
        position = 1e3 * table[["x", "y", "z"]].to_numpy()
        acceleration = table[["ax", "ay", "az"]].to_numpy()
        velocity = 1e3 * np.linalg.norm(table[["vx", "vy", "vz"]].to_numpy(), axis=1)
        column[1].plot(time, velocity, color=BLACK)
        for axis, colour in enumerate(AXIS_COLOURS):
            column[0].plot(time, position[:, axis] - position[0, axis], color=colour, label="xyz"[axis])
            column[2].plot(time, acceleration[:, axis], color=colour)
        for place, (name, part) in enumerate(table.groupby("primitive", sort=False)):
            start, end = part["time_s"].iloc[[0, -1]]
            for panel in column:
                panel.axvspan(start, end, color=primitive_colour(place), alpha=0.12, linewidth=0)
                if place > 0:
                    panel.axvline(start, color=BLACK, linewidth=0.8)
            column[0].text(
                0.5 * (start + end),
                1.02,
                name,
                transform=column[0].get_xaxis_transform(),
                ha="center",
                color=BLACK,
                fontsize=8.5,
            )
        column[0].set_title(title, pad=18)
        column[-1].set(xlabel="time (s)", xlim=(time[0], time[-1]))
    for panel, label in zip(
        panels[:, 0], ("way from\nstart (mm)", "speed\n(mm/s)", "acceleration\n(m/s²)"), strict=True
    ):
        panel.set_ylabel(label)
    panels[1, 0].set_ylim(bottom=0.0)
    figure.align_ylabels(panels[:, 0])
    legend_above(figure, panels[0, 0])
    return figure


@styled
def sequence_space_figure(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """Unrolled sequences in space, coloured by primitive; one line style each.

    Args:
        tables: by title, of `primitives.sequence.sequence_table`.
    """
    figure = canvas(4.5)
    space, above = space_panels(figure)
    points, handles = [], []
    for line, (title, table) in zip(LINES, tables.items(), strict=False):
        for place, (_, part) in enumerate(table.groupby("primitive", sort=False)):
            way = 1e3 * part[["x", "y", "z"]].to_numpy()
            look = {"color": primitive_colour(place), "linestyle": line, "linewidth": 2.0}
            space.plot(*way.T, **look)
            above.plot(way[:, 1], way[:, 0], **look)
            points.append(way)
        end = points[-1][-1]
        space.plot(*end[:, None], color=BLACK, marker="o", markersize=4)
        above.plot(end[1], end[0], color=BLACK, marker="o", markersize=4)
        handles.append(Line2D([], [], color=BLACK, linestyle=line, label=title))
    names = next(iter(tables.values()))["primitive"].unique()
    handles += [
        Line2D([], [], color=primitive_colour(place), linewidth=2.0, label=name)
        for place, name in enumerate(names)
    ]
    handles.append(Line2D([], [], color=BLACK, marker="o", linestyle="none", markersize=4, label="end"))
    finish_space(space, above, np.concatenate(points))
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles))
    return figure
