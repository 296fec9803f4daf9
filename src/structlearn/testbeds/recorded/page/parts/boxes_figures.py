"""Figures of reaches past boxes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from structlearn.palette import GREY, LIGHT_GREY
from structlearn.reporting.figure_style import Drawing, styled
from structlearn.reporting.panels import legend, panel
from structlearn.reporting.scene_ways import RECORDED
from structlearn.testbeds.recorded import names
from structlearn.testbeds.recorded.page.parts.boxes_results import BoxesFound

FIRST = 2
"""Panels of the picture at the top; the others stand in a fold."""


def boxes_pictures(found: BoxesFound) -> dict[str, Drawing | Sequence[Drawing]]:
    """All figures by name."""
    made: dict[str, Drawing | Sequence[Drawing]] = {
        "boxes_rates": [rates_panel(found), distance_panel(found)]
    }
    panels = [paths_panel(found, reach) for reach in found["paths"]["reach"].unique()]
    if panels:
        made |= {"boxes_paths": panels[:FIRST], "boxes_more_paths": panels[FIRST:]}
    return made


@styled
def paths_panel(found: BoxesFound, reach: str) -> Figure:
    """One reach from above: boxes, the person's path and those of ways that had never seen the person."""
    title = f"From above: {reach.replace('_', ' ')}"
    figure, axes = panel(title, 4.6, xlabel="to the right (mm)", ylabel="forward (mm)", aspect="equal")
    found.draw_paths(axes, reach, names.BOX_WAYS[RECORDED]._replace(colour=LIGHT_GREY))
    ends = found["paths"].query("reach == @reach and way == @RECORDED").iloc[[0, -1]]
    axes.plot(1e3 * ends["x_m"], 1e3 * ends["y_m"], "o", color="black", markersize=4)
    axes.set(xlim=(-380, 380), ylim=(-330, 270))
    return legend(figure)


@styled
def rates_panel(found: BoxesFound) -> Figure:
    """Share of reaches that touch a box, over all reaches and over the blocked ones."""
    figure, axes = panel("Reaches that touch a box", 3.6, xlabel="share (%)")
    for offset, (label, blocked, fill) in enumerate(
        (("all reaches", False, "full"), ("blocked ones", True, "none"))
    ):
        for place, way in enumerate(found.ways):
            rate = found.share("hit", way, blocked)
            bars = 100 * np.array([[rate.value - rate.low], [rate.high - rate.value]])
            style: dict[str, Any] = {"color": names.BOX_WAYS[way].colour, "fillstyle": fill, "markersize": 5}
            axes.errorbar(100 * rate.value, place + 0.3 * offset - 0.15, xerr=bars, fmt="o", **style)
        axes.plot([], [], "o", color=GREY, fillstyle=fill, label=label)
    found.name_ways(axes)
    axes.set_xlim(-2, 102)
    return legend(figure)


@styled
def distance_panel(found: BoxesFound) -> Figure:
    """Distance from people's own paths, one point per person; a line where two people are apart."""
    figure, axes = panel("Distance from the person's path", 3.6, xlabel="mean of a person (mm)")
    found.draw_distances(axes)
    if len(found["people"]):
        apart = found["people"]["path_mm"].mean()
        axes.axvline(apart, color=GREY, linestyle="--", linewidth=1.0, label="two people in one scene")
    found.name_ways(axes)
    axes.set_xlim(left=0.0)
    return legend(figure) if len(found["people"]) else figure
