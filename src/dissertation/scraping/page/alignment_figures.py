"""Figures IV.14, IV.15 and appendix C: pairs of time warping, aligned segments, down-sampling."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator, StrMethodFormatter

from structlearn.palette import (
    BAD,
    BLUE,
    DEMONSTRATION_COLOUR,
    METHOD_COLOURS,
    METHOD_NAMES,
    OCHRE,
    REFERENCE_COLOUR,
)
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.figure_style import PANEL_WIDTH, canvas, styled
from structlearn.reporting.prose import capitalised
from structlearn.segmentation.cut_errors import aligned_segments, spread_mm
from structlearn.segmentation.parameters import AXES, PrimitiveParameters
from structlearn.segmentation.segments import Segmentation

PAIRS_SHOWN = 16
TOP_PAIRS = 8
APART = 0.03  # least distance between top pairs as a fraction of the reference segment


def top_pairs(pairs: pd.DataFrame) -> pd.DataFrame:
    """Pairs of largest weight of one demonstration and primitive (`Segmentation.pairs`), ordered by time."""
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
    """Figure IV.14: pairs without weights, pairs of largest weight, and refined segments."""
    chosen = segmentation.pairs["primitive"] == primitive.name
    pairs = segmentation.pairs[chosen & (segmentation.pairs["demonstration"] == guess.name)]
    some = pairs.iloc[np.linspace(0, len(pairs) - 1, min(PAIRS_SHOWN, len(pairs))).round().astype(int)]
    figures = [canvas(3.4, PANEL_WIDTH) for _ in range(3)]
    every, top, refined = (figure.subplots() for figure in figures)
    _draw_pairs(every, (reference, guess), pairs, some, primitive.axis)
    every.set_title(f"(a) Every {len(pairs) // max(len(some) - 1, 1)}th pair, no weights")
    lines = [("reference", REFERENCE_COLOUR, 1.8), ("guess", DEMONSTRATION_COLOUR, 1.8)]
    lines += [("pair", BLUE, 0.8), ("pair, near-zero velocity", BAD, 0.8)]
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

    Of several axes, the one along which the reference moves most is drawn.
    """
    column = max(AXES[axis], key=lambda column: np.ptp(demonstrations[0].position[:, column]))
    segments, ends = [], []  # times and values of samples, and of the pairs' ends
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
        look: dict[str, Any] = {"color": BAD if weight == 0.0 else BLUE, "marker": "o", "markersize": 2.6}
        panel.plot(x[place], y[place] + lifts, linewidth=0.8, **look)
    panel.set_xlabel("time in the extended segment (s)")
    panel.set_ylabel(f"{'xyz'[column]}, shifted (mm)")


@styled
def alignment_figure(
    demonstrations: Sequence[Demonstration],
    segmentation: Segmentation,
    primitives: Sequence[PrimitiveParameters],
) -> list[Figure]:
    """Figure IV.15a, b: segments of all demonstrations at one duration, before and after refinement."""
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
def downsampling_figure(effect: pd.DataFrame) -> list[Figure]:
    """Cost of time warping and shift of the cut points over the down-sampling factor g (appendix C)."""
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
