"""Forest plot of the findings: each with its interval, the bound that decides it, and the published value.

Effects have units of their own, so each strip has its own axis; what makes them comparable is the bound: a
statement holds where the interval lies on the shaded side.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, StrMethodFormatter

from structlearn.palette import BLACK, BLUE, OCHRE
from structlearn.reporting.figure_style import PANEL_WIDTH, canvas, styled

SIMULATED, RECORDED = "simulated", "recorded"
COLOURS = {SIMULATED: BLUE, RECORDED: OCHRE}
MOST_DECADES = 1.5  # of a strip whose axis is linear, if all is positive

# Inches of a panel. Labels stand left of the axes, questions above them.
TOP, LINE, TICKS, GAP = 0.28, 0.11, 0.125, 0.045
LEAST_STRIP = 0.125
LABEL_WIDTH, MARGIN = 1.75, 0.1
LABEL_LETTERS, QUESTION_LETTERS = 36, 78  # that fit a line
LABEL_SIZE, QUESTION_SIZE = 6.5, 7.2  # points


@dataclass(frozen=True)
class Mark:
    """A number with its 95 % interval."""

    where: str  # `SIMULATED` or `RECORDED`
    value: float
    low: float  # infinite if there is no interval
    high: float


@dataclass(frozen=True)
class Strip:
    """A finding: its cases on one axis."""

    question: str
    labels: tuple[str, ...]  # simulated, or the data sets; a case if the bounds of cases differ
    unit: str
    marks: Sequence[Mark]  # with finite values
    bounds: tuple[float, ...]  # one, or two of a range
    side: int  # +1: holds above the bound, -1: below, 0: between
    printed: tuple[float, ...] = ()  # published values

    @property
    def words(self) -> list[str]:
        """Lines of the label."""
        words = "; ".join(self.labels) + (f" ({self.unit})" if self.unit else "")
        return wrap(words, LABEL_LETTERS)

    @property
    def height(self) -> float:
        """Inches of the strip with its ticks."""
        return max(LEAST_STRIP + TICKS, LINE * len(self.words)) + GAP


@styled
def forest_figure(strips: Sequence[Strip]) -> list[Figure]:
    """Strips below their questions, in two panels of one height; the first has the legend."""
    groups: list[list[Strip]] = []
    for strip in strips:
        if groups and groups[-1][0].question == strip.question:
            groups[-1].append(strip)
        else:
            groups.append([strip])
    ends = np.cumsum([_height(group) for group in groups])
    half = int(np.argmin(np.abs(2.0 * ends - ends[-1]))) + 1
    parts = [part for part in (groups[:half], groups[half:]) if part]
    height = TOP + max(sum(map(_height, part)) for part in parts)
    return [_panel(part, height, legend=not place) for place, part in enumerate(parts)]


def _height(group: Sequence[Strip]) -> float:
    lines = len(wrap(group[0].question, QUESTION_LETTERS))
    return LINE * lines + GAP + sum(strip.height for strip in group)


def _panel(groups: Sequence[Sequence[Strip]], total: float, legend: bool) -> Figure:
    figure = canvas(total, PANEL_WIDTH)
    figure.set_layout_engine("none")
    if legend:
        figure.legend(handles=_legend(), loc="upper left", ncols=5, fontsize=7.0, handlelength=1.2)
    left, top = MARGIN / PANEL_WIDTH, total - TOP
    for group in groups:
        question = wrap(group[0].question, QUESTION_LETTERS)
        words = "\n".join(question)
        figure.text(left, top / total, words, fontsize=QUESTION_SIZE, fontweight="bold", va="top")
        top -= LINE * len(question) + GAP
        for strip in group:
            figure.text(left, top / total, "\n".join(strip.words), fontsize=LABEL_SIZE, va="top")
            height = strip.height - GAP - TICKS
            width = PANEL_WIDTH - LABEL_WIDTH - 2.0 * MARGIN
            box = ((LABEL_WIDTH + MARGIN) / PANEL_WIDTH, (top - height) / total)
            axes = figure.add_axes((*box, width / PANEL_WIDTH, height / total))
            draw_strip(axes, strip)
            top -= strip.height
    return figure


def draw_strip(axes: Axes, strip: Strip) -> None:
    """Draw one finding; the side on which its statement holds is shaded."""
    ends = [end for mark in strip.marks for end in (mark.low, mark.high) if np.isfinite(end)]
    values = np.array([*ends, *(mark.value for mark in strip.marks), *strip.bounds, *strip.printed])
    if values.min() > 0.0 and np.log10(values.max() / values.min()) > MOST_DECADES:
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(numticks=4))
        low, high = values.min() / 1.3, values.max() * 1.3
    else:
        axes.xaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))
        room = 0.06 * (np.ptp(values) or abs(values[0]) or 1.0)
        low, high = values.min() - room, values.max() + room
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    span = {1: (strip.bounds[0], high), -1: (low, strip.bounds[0]), 0: (strip.bounds[0], strip.bounds[-1])}
    axes.axvspan(*span[strip.side], color="#e0efe6", linewidth=0)
    for bound in strip.bounds:
        axes.axvline(bound, color=BLACK, linewidth=0.8, linestyle=(0, (3, 2)))
    for value in strip.printed:
        axes.plot(value, 0.5, marker="|", color=BLACK, markersize=9, markeredgewidth=1.6)
    heights = np.linspace(0.85, 0.15, len(strip.marks)) if len(strip.marks) > 1 else [0.5]
    for height, mark in zip(heights, strip.marks, strict=True):
        colour, drawn = COLOURS[mark.where], (max(mark.low, low), min(mark.high, high))
        line = "-" if np.isfinite(mark.high - mark.low) else ":"
        axes.plot(drawn, (height, height), color=colour, linewidth=1.1, linestyle=line, dash_capstyle="butt")
        axes.plot(mark.value, height, "o", color=colour, markersize=2.4)
    axes.set(xlim=(low, high), ylim=(0.0, 1.0), yticks=[])
    axes.grid(visible=False)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="x", which="major", labelsize=6.0, length=2, pad=1.0)
    axes.minorticks_off()


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
