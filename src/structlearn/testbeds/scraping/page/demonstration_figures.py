"""Figures of what was recorded."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from structlearn.ground import signals
from structlearn.palette import (
    AXIS_COLOURS,
    BLACK,
    CATEGORICAL_COLOURS,
    DEMONSTRATION_COLOUR,
    REFERENCE_COLOUR,
    primitive_colour,
)
from structlearn.recordings.demonstration import Demonstration
from structlearn.reporting.figures import canvas, finish_space, legend_above, space_panels, styled
from structlearn.segmentation.result import Segmentation

SPEED_CUTOFF_HZ = 5.0
"""Low-pass of the speeds that are drawn; differences of raw positions are mostly noise."""

ELECTRODES_SHOWN = 4


def speed(demonstration: Demonstration) -> np.ndarray:
    """Speed of the end effector for drawing, (T,) in m/s."""
    smooth = signals.low_pass(demonstration.position, demonstration.dt, SPEED_CUTOFF_HZ)
    return np.linalg.norm(signals.derivative(smooth, demonstration.dt), axis=1)


@styled
def demonstrations_figure(demonstrations: Sequence[Demonstration], reference: str) -> Figure:
    """Position per axis and speed of all demonstrations over time; the reference in front."""
    figure = canvas(4.6)
    panels = figure.subplots(2, 2, sharex=True).ravel()
    for demonstration in sorted(demonstrations, key=lambda one: one.name == reference):
        first = demonstration.name == reference
        colour = REFERENCE_COLOUR if first else DEMONSTRATION_COLOUR
        look = {"color": colour, "linewidth": 1.5 if first else 0.9, "alpha": 1.0 if first else 0.75}
        for axis, panel in enumerate(panels[:3]):
            panel.plot(demonstration.time, 1e3 * demonstration.position[:, axis], **look)
        panels[3].plot(demonstration.time, 1e3 * speed(demonstration), **look)
    for axis, panel in zip("xyz", panels[:3], strict=True):
        panel.set(title=f"Position {axis}", ylabel=f"{axis} (mm)")
    panels[3].set(title="Speed", ylabel="speed (mm/s)")
    panels[3].set_ylim(bottom=0.0)
    for panel in panels[2:]:
        panel.set_xlabel("time (s)")
    figure.legend(
        handles=[
            Line2D([], [], color=REFERENCE_COLOUR, label=f"reference ({reference})"),
            Line2D([], [], color=DEMONSTRATION_COLOUR, label="other demonstrations"),
        ],
        loc="outside upper left",
        ncols=2,
    )
    return figure


@styled
def one_demonstration_figure(demonstration: Demonstration, segmentation: Segmentation) -> Figure:
    """Position, speed and, where recorded, force and touch of one demonstration with its cut points."""
    rows = [_draw_position, _draw_speed]
    rows += [_draw_force] if demonstration.wrench is not None else []
    rows += [_draw_electrodes] if demonstration.tactile is not None else []
    figure = canvas(0.7 + 1.35 * len(rows))
    panels = figure.subplots(len(rows), 1, sharex=True)
    for panel, draw in zip(panels, rows, strict=True):
        draw(panel, demonstration)
        _draw_cuts(panel, demonstration, segmentation)
        if panel.get_legend_handles_labels()[0]:
            panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    panels[-1].set_xlabel("time (s)")
    panels[-1].set_xlim(demonstration.time[0], demonstration.time[-1])
    figure.align_ylabels(panels)
    names = segmentation.primitives
    handles = [
        Patch(color=primitive_colour(i), alpha=0.22, linewidth=0, label=n) for i, n in enumerate(names)
    ]
    handles.append(Line2D([], [], color=BLACK, linewidth=1.0, label="cut points found"))
    if demonstration.true_segments is not None:
        handles.append(Line2D([], [], color=BLACK, linewidth=1.2, linestyle=":", label="true cut points"))
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles))
    return figure


def _draw_position(panel: Axes, demonstration: Demonstration) -> None:
    for axis, colour in enumerate(AXIS_COLOURS):
        moved = demonstration.position[:, axis] - demonstration.position[0, axis]
        panel.plot(demonstration.time, 1e3 * moved, color=colour, label="xyz"[axis])
    panel.set_ylabel("way from\nstart (mm)")


def _draw_speed(panel: Axes, demonstration: Demonstration) -> None:
    panel.plot(demonstration.time, 1e3 * speed(demonstration), color=BLACK)
    panel.set_ylabel("speed\n(mm/s)")


def _draw_force(panel: Axes, demonstration: Demonstration) -> None:
    for axis, colour in enumerate(AXIS_COLOURS):
        panel.plot(
            demonstration.time,
            demonstration.wrench[:, axis],
            color=colour,
            linewidth=1.0,
            label=f"$F_{'xyz'[axis]}$",
        )
    panel.set_ylabel("force (N)")


def _draw_electrodes(panel: Axes, demonstration: Demonstration) -> None:
    counts = demonstration.tactile - demonstration.tactile[0]
    busiest = np.sort(np.argsort(-np.ptp(counts, axis=0), kind="stable")[:ELECTRODES_SHOWN])
    for colour, electrode in zip(CATEGORICAL_COLOURS, busiest, strict=False):
        label = f"channel {electrode + 1}"
        panel.plot(demonstration.time, counts[:, electrode], color=colour, linewidth=1.0, label=label)
    panel.set_ylabel("touch\n(counts)")


def _draw_cuts(panel: Axes, demonstration: Demonstration, segmentation: Segmentation) -> None:
    for place, name in enumerate(segmentation.primitives):
        start, end = segmentation.result(name).loc[demonstration.name, ["start_s", "end_s"]]
        panel.axvspan(start, end, color=primitive_colour(place), alpha=0.13, linewidth=0)
        for cut in (start, end):
            panel.axvline(cut, color=BLACK, linewidth=0.9)
    if demonstration.true_segments is not None:
        for cut in np.unique(demonstration.true_segments):
            panel.axvline(cut, color=BLACK, linewidth=1.2, linestyle=":")


@styled
def space_figure(demonstrations: Sequence[Demonstration], segmentation: Segmentation) -> Figure:
    """Figure IV.15c: the segments of all demonstrations in space, coloured by primitive."""
    figure = canvas(4.5)
    space, above = space_panels(figure)
    points = []
    for demonstration in demonstrations:
        for place, name in enumerate(segmentation.primitives):
            cuts = segmentation.result(name)
            if demonstration.name not in cuts.index:
                continue
            start, end = cuts.loc[demonstration.name, ["start_s", "end_s"]]
            inside = (demonstration.time >= start) & (demonstration.time <= end)
            part = 1e3 * demonstration.position[inside]
            label = name if demonstration.name == segmentation.reference else None
            space.plot(*part.T, color=primitive_colour(place), linewidth=1.0, label=label)
            above.plot(part[:, 1], part[:, 0], color=primitive_colour(place), linewidth=1.0)
            points.append(part)
    finish_space(space, above, np.concatenate(points))
    legend_above(figure, space)
    return figure
