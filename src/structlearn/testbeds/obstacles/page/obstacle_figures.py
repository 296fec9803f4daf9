"""Figures of the obstacle testbed's numbers: figure IV.10, and how near the models come to obstacles."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from structlearn.avoidance.learned_models import HUMAN_INSPIRED, NETWORK, PHASE_MODULATED, SETTING
from structlearn.avoidance.shapes import SHAPES
from structlearn.palette import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILION
from structlearn.reporting.figures import canvas, legend_above, styled
from structlearn.testbeds.obstacles.page.obstacle_published import LARGEST_NMSE
from structlearn.testbeds.obstacles.page.obstacle_results import FITS, ObstacleResults
from structlearn.testbeds.obstacles.page.obstacle_tables import NAMES, model_name
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import (
    GOAL_CHANGE,
    MOVING,
    NO_MODEL,
    PAIR,
    TRAINED,
    UNSEEN,
)

PARTS = {"train": ("learned from", SKY), "test": ("held out", BLUE)}
"""Name and colour of the demonstrations of an error."""

BINS = np.linspace(0.0, 1.2, 13)
"""Of NMSE; what is above the last edge is counted in the last bin."""

KIND_COLOURS = {NO_MODEL: BLACK, NETWORK: BLUE, PHASE_MODULATED: GREEN, HUMAN_INSPIRED: ORANGE}
SHAPE_MARKERS = dict(zip(SHAPES, ("o", "s", "^"), strict=True))

GRID_TITLES = {
    UNSEEN: "Unseen",
    MOVING: "Moving",
    PAIR: "Two at once",
    GOAL_CHANGE: "Moving goal",
}

FARTHEST = 4.0
"""Radii; what keeps farther off is drawn there."""


@styled
def fit_figure(results: ObstacleResults) -> Figure:
    """Figure IV.10: over how many scenarios a model that learned one scenario has which error."""
    figure = canvas(5.6)
    kinds = (NETWORK, HUMAN_INSPIRED)
    panels = figure.subplots(len(FITS), len(kinds), sharex=True, sharey="row")
    for row, (column, over) in enumerate(FITS.items()):
        for panel, kind in zip(panels[row], kinds, strict=True):
            its = results.per_setting_fits[results.per_setting_fits["model"] == kind]
            for place, (part, (label, colour)) in enumerate(PARTS.items()):
                errors = its.loc[its["part"] == part, column].dropna().clip(upper=BINS[-1] - 1e-9)
                counts, _ = np.histogram(errors, BINS)
                width = 0.42 * (BINS[1] - BINS[0])
                left = BINS[:-1] + (0.08 + 0.42 * place) * (BINS[1] - BINS[0])
                panel.bar(left, counts, width, align="edge", color=colour, label=label)
            panel.axvline(LARGEST_NMSE, color=VERMILION, linestyle="--", linewidth=1.2)
            panel.grid(axis="x", visible=False)
            panel.set_title(f"{NAMES[kind].capitalize() if kind == NETWORK else NAMES[kind]}, {over}")
        panels[row, 0].set_ylabel("scenarios")
    ticks = np.arange(0.1, BINS[-1], 0.2)
    labels = [f"{tick:.1f}" for tick in ticks]
    for panel in panels[-1]:
        panel.set_xlim(BINS[0], BINS[-1])
        panel.set_xticks(ticks, labels)
        panel.set_xlabel(f"NMSE; the last bar: {BINS[-2]:.1f} and above")
    handles = [Patch(color=colour, label=label) for label, colour in PARTS.values()]
    handles.append(
        Line2D(
            [],
            [],
            color=VERMILION,
            linestyle="--",
            linewidth=1.2,
            label=f"published: network {LARGEST_NMSE:g} or lower in all scenarios",
        )
    )
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), columnspacing=1.6)
    return figure


@styled
def people_figure(results: ObstacleResults) -> Figure:
    """Closest distance of the unroll over that of people, a dot for each scenario; a panel for each model."""
    people = results.people.groupby(["obstacle", "scenario"])["obstacle_distance"].mean()
    contenders = (
        ("No avoidance", NO_MODEL, ("",)),
        ("Rai et al., per setting", HUMAN_INSPIRED, (SETTING,)),
        ("Network, per setting", NETWORK, (SETTING,)),
        ("Network, per shape", NETWORK, SHAPES),
    )
    figure = canvas(2.9)
    panels = figure.subplots(1, len(contenders), sharex=True, sharey=True)
    top = 1.05 * float(people.max())
    for panel, (title, kind, sources) in zip(panels, contenders, strict=True):
        panel.plot([-1, top], [-1, top], color=GREY, linewidth=0.9)
        panel.axhline(0.0, color=VERMILION, linestyle="--", linewidth=1.1)
        scored = results.rows(TRAINED, kind, sources).set_index(["obstacle", "scenario"])
        for shape, marker in SHAPE_MARKERS.items():
            its = scored.loc[[shape], "obstacle_distance"]
            look = {"marker": marker, "linestyle": "none", "markersize": 4, "markeredgewidth": 0}
            panel.plot(people.loc[its.index], its, color=KIND_COLOURS[kind], alpha=0.65, label=shape, **look)
        # most of what matters is below two radii: a scale that is linear there and shrinks the rest
        for axis in (panel.set_xscale, panel.set_yscale):
            axis("symlog", linthresh=2.0, linscale=1.0)
        panel.set(title=title, xlabel="people (radii)", xlim=(-1, top), ylim=(-1, top))
        ticks = [-1, 0, 1, 2, 5, 10]
        panel.set_xticks(ticks, [f"{tick:g}".replace("-", "\N{MINUS SIGN}") for tick in ticks])
        panel.set_yticks(ticks, [f"{tick:g}".replace("-", "\N{MINUS SIGN}") for tick in ticks])
        panel.minorticks_off()
    panels[0].set_ylabel("closest distance (radii)")
    legend_above(figure, panels[0])
    return figure


@styled
def distances_figure(results: ObstacleResults) -> Figure:
    """Closest distance on the grid of spheres, a dot for each unroll, hits counted; a panel per situation."""
    pairs = results.contenders
    figure = canvas(0.9 + 0.3 * len(pairs))
    panels = figure.subplots(1, len(GRID_TITLES), sharey=True, sharex=True)
    for panel, (protocol, title) in zip(panels, GRID_TITLES.items(), strict=True):
        count = 0
        for row, (kind, source) in enumerate(pairs):
            its = results.rows(protocol, kind, source)
            count = len(its)
            _dots(panel, row, its, KIND_COLOURS[kind])
        panel.axvline(0.0, color=VERMILION, linestyle="--", linewidth=1.1)
        panel.grid(axis="y", visible=False)
        panel.set(title=f"{title} ({count})", xlabel="closest distance (radii)", xlim=(-1.1, FARTHEST + 1.2))
        panel.text(0.99, 1.0 - 0.1 / len(pairs), "hits", ha="right", va="top", transform=panel.transAxes)
    panels[0].set_yticks(range(len(pairs)), [model_name(*pair) for pair in pairs])
    panels[0].set_ylim(len(pairs) - 0.4, -1.2)
    return figure


def _dots(panel: Axes, row: int, scored: pd.DataFrame, colour: str) -> None:
    """Unrolls of one model beside each other, hits in red, their number at the right."""
    # number by number from top to bottom: nothing is drawn at random
    height = row + 0.5 * (np.arange(len(scored)) / max(len(scored) - 1, 1) - 0.5)
    distance = scored["obstacle_distance"].clip(upper=FARTHEST)
    colours = np.where(scored["hit"], VERMILION, colour)
    panel.scatter(distance, height, s=5, c=colours, linewidths=0, alpha=0.75)
    hits = int(scored["hit"].sum())
    weight = "bold" if hits else "normal"
    panel.text(
        FARTHEST + 1.1, row, str(hits), ha="right", va="center", fontsize=8.5, weight=weight, color=BLACK
    )
