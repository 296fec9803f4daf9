"""Forest plot of the findings: each with its interval, the bound that decides it, and the published value.

Effects have units of their own, so each strip has its own axis; what makes them comparable is the bound: a
statement holds where the interval lies on the shaded side.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from structlearn.palette import BLACK, BLUE, ORANGE
from structlearn.reporting.figure_style import PANEL_WIDTH, canvas, styled

SIMULATED, RECORDED = "simulated", "recorded"
COLOURS = {SIMULATED: BLUE, RECORDED: ORANGE}
STRIP = 0.5  # inches of height
MOST_DECADES = 1.5  # of a strip whose axis is linear, if all is positive


@dataclass(frozen=True)
class Mark:
    """A number with its 95 % interval."""

    where: str  # `SIMULATED` or `RECORDED`
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Strip:
    """A finding: its cases on one axis."""

    label: str
    unit: str
    marks: Sequence[Mark]  # finite
    bounds: tuple[float, ...]  # one, or two of a range
    side: int  # +1: holds above the bound, -1: below, 0: between
    printed: tuple[float, ...] = ()  # published values


@styled
def forest_figure(strips: Sequence[Strip]) -> list[Figure]:
    """Strips in two panels, with a legend above."""
    half = (len(strips) + 1) // 2
    figures = []
    for first in range(0, len(strips), half):
        part = strips[first : first + half]
        figure = canvas(STRIP * len(part) + 0.45, PANEL_WIDTH)
        panels = figure.subplots(len(part), 1, squeeze=False)[:, 0]
        for axes, strip in zip(panels, part, strict=True):
            draw_strip(axes, strip)
        figure.legend(handles=_legend(), loc="outside upper left", ncols=5, fontsize=7.5, handlelength=1.2)
        figures.append(figure)
    return figures


def draw_strip(axes: Axes, strip: Strip) -> None:
    """Draw one finding; the side on which its statement holds is shaded."""
    ends = [end for mark in strip.marks for end in (mark.low, mark.high) if np.isfinite(end)]
    values = np.array([*ends, *(mark.value for mark in strip.marks), *strip.bounds, *strip.printed])
    if values.min() > 0.0 and np.log10(values.max() / values.min()) > MOST_DECADES:
        axes.set_xscale("log")
        low, high = values.min() / 1.3, values.max() * 1.3
    else:
        room = 0.06 * (np.ptp(values) or abs(values[0]) or 1.0)
        low, high = values.min() - room, values.max() + room
    span = {1: (strip.bounds[0], high), -1: (low, strip.bounds[0]), 0: (strip.bounds[0], strip.bounds[-1])}
    axes.axvspan(*span[strip.side], color="#e8f3ec", linewidth=0)
    for bound in strip.bounds:
        axes.axvline(bound, color=BLACK, linewidth=0.8, linestyle=(0, (3, 2)))
    for value in strip.printed:
        axes.plot(value, 0.5, marker="|", color=BLACK, markersize=11, markeredgewidth=1.6)
    heights = np.linspace(0.8, 0.2, len(strip.marks)) if len(strip.marks) > 1 else [0.5]
    for height, mark in zip(heights, strip.marks, strict=True):
        colour, drawn = COLOURS[mark.where], (max(mark.low, low), min(mark.high, high))
        axes.plot(drawn, (height, height), color=colour, linewidth=1.3, solid_capstyle="butt")
        axes.plot(mark.value, height, "o", color=colour, markersize=3.2)
    axes.set(xlim=(low, high), ylim=(0.0, 1.0), yticks=[])
    axes.grid(visible=False)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="x", labelsize=6.5, length=2, pad=1.5)
    axes.minorticks_off()
    axes.set_title(f"{strip.label} ({strip.unit})" if strip.unit else strip.label, fontsize=7.5, pad=2)


def _legend() -> list[Line2D]:
    handles = [
        Line2D([], [], color=colour, marker="o", markersize=3.5, label=name)
        for name, colour in COLOURS.items()
    ]
    tick: dict[str, Any] = {"color": BLACK, "marker": "|", "linestyle": "none", "markersize": 9}
    handles.append(Line2D([], [], label="published", **tick))
    handles.append(Line2D([], [], color=BLACK, linestyle=(0, (3, 2)), linewidth=0.8, label="bound"))
    handles.append(Line2D([], [], color="#cfe6d8", linewidth=6, label="holds"))
    return handles
