"""Reaches of a task past obstacles: what was learned, beside no coupling and the planned way."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.core.artefacts import Metrics
from structlearn.palette import DEMONSTRATION_COLOUR, SCENE_WAYS, Look
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import styled
from structlearn.reporting.panels import legend, panel
from structlearn.reporting.prose import interval, percent, rounded
from structlearn.reporting.scene_ways import NONE, OURS, PLANNED, RECORDED, TEXT, SceneWays
from structlearn.tasks.section import Section
from structlearn.tasks.task_files import TaskFiles

FEWEST = 20
"""Reaches, below which the page says that they are few."""


def section(files: TaskFiles) -> Section:
    """Of a task with reaches past obstacles."""
    tables = ("reaches", "errors", "left_out", "paths", "shapes")
    found = SceneWays({name: files.table(f"obstacles/{name}") for name in tables})
    own, left_out = found.of(OURS), found["left_out"]
    hits = {way: found.share("hit", way) for way in found.ways}
    path_mm = {way: found.mean_path(way).value for way in found.ways}
    facts = {
        "reaches": len(own),
        "people": own["person"].nunique(),
        "folds": own["fold"].nunique(),
        "blocked": int(own["blocked"].sum()),
        "left_out": len(left_out),
        "fewest": FEWEST,
        "touches": {way: percent(int(found.of(way)["hit"].sum()), its.n) for way, its in hits.items()},
        "path_mm": path_mm,
        "goal_mm": own["left_mm"].max(),
    }
    pictures = [paths_panel(found, reach) for reach in found["paths"]["reach"].unique()[:1]]
    metrics: Metrics = {"obstacles_goal_max_mm": facts["goal_mm"]}
    for way, end in ((OURS, ""), (NONE, "_none"), (TEXT, "_text"), (PLANNED, "_planned")):
        metrics |= {f"obstacles_hits{end}": hits[way].value, f"obstacles_path{end}_mm": path_mm[way]}
    return Section(
        "obstacles",
        "Reaches past obstacles",
        "obstacles.html.jinja",
        lead="obstacles_lead.html.jinja",
        facts=facts,
        metrics=metrics,
        tables={
            "obstacles_ways": ways_table(found),
            "obstacles_left_out": Table(left_out),
        },
        pictures={"obstacles": [*pictures, distance_panel(found)]},
    )


def ways_table(found: SceneWays) -> Table:
    """One row per way."""
    sums = found["errors"].groupby("way")[["squared", "variance"]].sum()
    nmse = sums["squared"] / sums["variance"]
    rows = []
    for way in found.ways:
        its, blocked = found.of(way), found.of(way, blocked=True)
        hit, path = found.share("hit", way), found.mean_path(way)
        rows.append(
            {
                "way": SCENE_WAYS[way].name,
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
    return Table(pd.DataFrame(rows), formats, strong=frozenset({found.ways.index(OURS)}))


@styled
def paths_panel(found: SceneWays, reach: str) -> Figure:
    """One reach from above, with those of ways that had never seen its recording."""
    figure, axes = panel(f"From above: {reach}", 4.4, xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    found.draw_paths(axes, reach, Look(RECORDED, DEMONSTRATION_COLOUR))
    axes.margins(0.1)
    return legend(figure)


@styled
def distance_panel(found: SceneWays) -> Figure:
    """Distance from the recorded paths, a stroke per person or recording."""
    figure, axes = panel("Distance from the recorded path", 4.4, xlabel="mean of a person or recording (mm)")
    found.draw_distances(axes)
    found.name_ways(axes)
    axes.set_xlim(left=0.0)
    return figure
