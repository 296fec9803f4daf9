"""Figures of reaches past boxes."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from structlearn.palette import GREY, LIGHT_GREY
from structlearn.reporting.figure_style import Drawing, styled
from structlearn.reporting.panels import legend, panel
from structlearn.testbeds.recorded import names
from structlearn.testbeds.recorded.page.parts.boxes_results import OURS, BoxesFound

PATHS = {"recorded": 3.5, "none": 1.0, "text": 1.3, OURS: 1.8, "planned": 1.0}
"""Ways that are drawn, with the width of their lines."""

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
    for row in found["shapes"].query("reach == @reach").itertuples():
        corner = 1e3 * np.array([row.x_m - 0.5 * row.width_m, row.y_m - 0.5 * row.depth_m])
        colour = GREY if row.box else LIGHT_GREY
        axes.add_patch(Rectangle(corner, 1e3 * row.width_m, 1e3 * row.depth_m, color=colour, linewidth=0))
    paths = found["paths"].query("reach == @reach")
    for way, width in PATHS.items():
        its, look = paths[paths["way"] == way], names.BOX_WAYS[way]
        colour = LIGHT_GREY if way == "recorded" else look.colour
        line = "--" if way == "none" else "-"
        axes.plot(1e3 * its["x_m"], 1e3 * its["y_m"], line, color=colour, linewidth=width, label=look.name)
    ends = paths[paths["way"] == "recorded"].iloc[[0, -1]]
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
            style = {"color": names.BOX_WAYS[way].colour, "fillstyle": fill, "markersize": 5}
            axes.errorbar(100 * rate.value, place + 0.3 * offset - 0.15, xerr=bars, fmt="o", **style)
        axes.plot([], [], "o", color=GREY, fillstyle=fill, label=label)
    _ways_down(axes, found)
    axes.set_xlim(-2, 102)
    return legend(figure)


@styled
def distance_panel(found: BoxesFound) -> Figure:
    """Distance from people's own paths, one point per person; a line where two people are apart."""
    figure, axes = panel("Distance from the person's path", 3.6, xlabel="mean of a person (mm)")
    for place, way in enumerate(found.ways):
        means = found.of(way).groupby("person")["path_mm"].mean()
        axes.plot(means, np.full(len(means), place), "|", color=names.BOX_WAYS[way].colour, markersize=11)
        axes.plot(means.mean(), place, "o", color=names.BOX_WAYS[way].colour, markersize=5)
    if len(found["people"]):
        apart = found["people"]["path_mm"].mean()
        axes.axvline(apart, color=GREY, linestyle="--", linewidth=1.0, label="two people in one scene")
    _ways_down(axes, found)
    axes.set_xlim(left=0.0)
    return legend(figure) if len(found["people"]) else figure


def _ways_down(axes: Axes, found: BoxesFound) -> None:
    labels = [names.BOX_WAYS[way].name.replace(" (", "\n(").replace(", ", ",\n") for way in found.ways]
    axes.set_yticks(range(len(labels)), labels)
    axes.grid(axis="y", visible=False)
    axes.invert_yaxis()
