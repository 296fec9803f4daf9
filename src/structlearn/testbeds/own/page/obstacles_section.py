"""Reaches of a task past obstacles: what was learned, beside no coupling and the planned way."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from structlearn.ground.artefacts import Metrics
from structlearn.palette import BLACK, BLUE, DEMONSTRATION_COLOUR, GREEN, GREY, ORANGE, PURPLE, VERMILION
from structlearn.reporting.claims import Evidence, clustered_share, mean
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import styled
from structlearn.reporting.panels import legend, panel
from structlearn.reporting.prose import interval, percent, rounded
from structlearn.testbeds.own.files import TaskFiles
from structlearn.testbeds.own.page.section import Section

WAYS = {
    "none": "baseline alone",
    "human_inspired": "human-inspired (Rai et al.)",
    "text": "17 features, as published",
    "text_ensemble": "17 features, our training",
    "scene": "look ahead at the scene",
    "planned": "planned path, followed",
}
"""Who or what moves the hand, in the order of tables."""

FEWEST = 20
"""Reaches, below which the page says that they are few."""

OURS, NONE, RECORDED = "scene", "none", "recorded"
COLOURS = {
    RECORDED: DEMONSTRATION_COLOUR,
    "none": BLACK,
    "human_inspired": ORANGE,
    "text": VERMILION,
    "text_ensemble": PURPLE,
    "scene": BLUE,
    "planned": GREEN,
}
PATHS = {RECORDED: 3.5, "none": 1.0, "text": 1.3, OURS: 1.8, "planned": 1.0}
"""Ways that are drawn, with the width of their lines."""


def section(files: TaskFiles) -> Section:
    """Of a task with reaches past obstacles."""
    reaches, errors, left_out, paths, shapes = (
        files.table(f"obstacles/{name}") for name in ("reaches", "errors", "left_out", "paths", "shapes")
    )
    found = {way: _found(reaches[reaches["way"] == way]) for way in WAYS}
    own = reaches[reaches["way"] == OURS]
    facts = {
        "reaches": len(own),
        "people": own["person"].nunique(),
        "folds": own["fold"].nunique(),
        "blocked": int(own["blocked"].sum()),
        "left_out": len(left_out),
        "fewest": FEWEST,
        "touches": {way: percent(its["hit"].count, its["hit"].n) for way, its in found.items()},
        "path_mm": {way: its["path_mm"].value for way, its in found.items()},
        "goal_mm": own["left_mm"].max(),
    }
    drawn = list(paths["reach"].unique())
    pictures = [distance_panel(reaches)]
    if drawn:
        pictures.insert(0, paths_panel(paths, shapes, drawn[0]))
    metrics: Metrics = {"obstacles_goal_max_mm": facts["goal_mm"]}
    for way, end in ((OURS, ""), (NONE, "_none"), ("text", "_text"), ("planned", "_planned")):
        metrics[f"obstacles_hits{end}"] = found[way]["hit"].value
        metrics[f"obstacles_path{end}_mm"] = found[way]["path_mm"].value
    return Section(
        "obstacles",
        "Reaches past obstacles",
        "obstacles.html.jinja",
        facts=facts,
        metrics=metrics,
        tables={
            "obstacles_ways": ways_table(reaches, errors, found),
            "obstacles_reaches": Table(reaches, words={"way": WAYS}),
            "obstacles_left_out": Table(left_out),
        },
        pictures={"obstacles": pictures},
    )


def _found(its: pd.DataFrame) -> dict[str, Evidence]:
    """Share of reaches that touch, and distance from the recorded path, with intervals over people."""
    people = its.groupby("person")
    hits = people["hit"]
    return {
        "hit": clustered_share(hits.sum().to_numpy(int), hits.size().to_numpy()),
        "path_mm": mean(people["path_mm"].mean().to_numpy()),
    }


def ways_table(reaches: pd.DataFrame, errors: pd.DataFrame, found: dict[str, dict[str, Evidence]]) -> Table:
    """One row per way."""
    sums = errors.groupby("way")[["squared", "variance"]].sum()
    nmse = sums["squared"] / sums["variance"]
    rows = []
    for way in WAYS:
        its, path = reaches[reaches["way"] == way], found[way]["path_mm"]
        hit = found[way]["hit"]
        blocked = its[its["blocked"]]
        rows.append(
            {
                "way": way,
                "touches (%)": f"{100 * hit.value:.0f} {interval(100 * hit.low, 100 * hit.high, '.0f')}",
                "of blocked ones (%)": 100 * blocked["hit"].mean() if len(blocked) else np.nan,
                "goal (mm)": its["left_mm"].max(),
                "path (mm)": f"{rounded(path.value, '.1f')} {interval(max(path.low, 0.0), path.high)}",
                "same gaps (%)": 100 * its["same_gaps"].mean(),
                "coupling, NMSE": nmse.get(way, np.nan),
            }
        )
    formats = {
        "of blocked ones (%)": ".0f",
        "goal (mm)": ".0f",
        "same gaps (%)": ".0f",
        "coupling, NMSE": ".2f",
    }
    strong = frozenset({list(WAYS).index(OURS)})
    return Table(pd.DataFrame(rows), formats, strong=strong, words={"way": WAYS})


@styled
def paths_panel(paths: pd.DataFrame, shapes: pd.DataFrame, reach: str) -> Figure:
    """One reach from above, with those of ways that had never seen its recording."""
    figure, axes = panel(f"From above: {reach}", 4.4, xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    for row in shapes[shapes["reach"] == reach].itertuples():
        corner = 1e3 * np.array([row.x_m - 0.5 * row.width_m, row.y_m - 0.5 * row.depth_m])
        axes.add_patch(Rectangle(corner, 1e3 * row.width_m, 1e3 * row.depth_m, color=GREY, linewidth=0))
    of_reach = paths[paths["reach"] == reach]
    for way, width in PATHS.items():
        its, line = of_reach[of_reach["way"] == way], "--" if way == NONE else "-"
        label = WAYS.get(way, way)
        axes.plot(1e3 * its["x_m"], 1e3 * its["y_m"], line, color=COLOURS[way], linewidth=width, label=label)
    axes.margins(0.1)
    return legend(figure)


@styled
def distance_panel(reaches: pd.DataFrame) -> Figure:
    """Distance from the recorded paths, a stroke per person or recording."""
    figure, axes = panel("Distance from the recorded path", 4.4, xlabel="mean of a person or recording (mm)")
    for place, way in enumerate(WAYS):
        means = reaches[reaches["way"] == way].groupby("person")["path_mm"].mean()
        axes.plot(means, np.full(len(means), place), "|", color=COLOURS[way], markersize=11)
        axes.plot(means.mean(), place, "o", color=COLOURS[way], markersize=5)
    axes.set_yticks(
        range(len(WAYS)), [name.replace(" (", "\n(").replace(", ", ",\n") for name in WAYS.values()]
    )
    axes.grid(axis="y", visible=False)
    axes.invert_yaxis()
    axes.set_xlim(left=0.0)
    return figure
