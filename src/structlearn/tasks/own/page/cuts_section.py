"""Cuts: where each primitive lies in each demonstration, what was left out and what is doubtful."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.palette import BLACK
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import PANEL_WIDTH, canvas, styled
from structlearn.reporting.movement_figures import draw_cuts, shade_primitives, speed
from structlearn.segmentation.segments import Segmentation
from structlearn.tasks.section import Section
from structlearn.tasks.task_files import TaskFiles

DRAWN = 12
"""Demonstrations whose speed is drawn; of more, the doubtful ones first."""


def section(files: TaskFiles) -> Section:
    """Of a task with demonstrations."""
    demonstrations, segmentation = files.runs("demonstrations"), files.segmentation()
    by_name = {one.name: one for one in demonstrations}
    cut = [name for name in by_name if name in segmentation.result(segmentation.primitives[0]).index]
    doubted = set(segmentation.doubts["demonstration"])
    shown = sorted(cut, key=lambda name: name not in doubted)[:DRAWN]
    lengths = primitive_lengths(by_name, segmentation)
    headings = {"duration_s": "mean (s)", "shortest_s": "shortest (s)", "longest_s": "longest (s)"}
    formats = {"duration_s": ".2f", "shortest_s": ".2f", "longest_s": ".2f", "way_mm": ".0f"}
    points = pd.concat([segmentation.result(name).reset_index() for name in segmentation.primitives])
    return Section(
        "cuts",
        "Cuts",
        "cuts.html.jinja",
        lead="cuts_lead.html.jinja",
        facts={
            "cut": len(cut),
            "drawn": len(shown),
            "reference": segmentation.reference,
            "left_out": len(segmentation.left_out),
            "doubts": len(segmentation.doubts),
            "true": any(one.true_segments is not None for one in demonstrations),
        },
        metrics={
            "cuts_demonstrations": len(cut),
            "cuts_left_out": len(segmentation.left_out),
            "cuts_doubtful": len(segmentation.doubts),
        },
        tables={
            "lengths": Table(lengths, formats, headings | {"way_mm": "mean distance from start to end (mm)"}),
            "left_out": Table(segmentation.left_out),
            "doubts": Table(segmentation.doubts, {"number": ".2f"}),
            "cut_points": Table(
                points[["demonstration", "primitive", "start_s", "end_s"]].sort_values(
                    ["demonstration", "start_s"]
                ),
                {"start_s": ".3f", "end_s": ".3f"},
                {"start_s": "start (s)", "end_s": "end (s)"},
            ),
        },
        pictures={"cuts": [speed_panel(by_name[name], segmentation) for name in shown]},
    )


def primitive_lengths(demonstrations: dict[str, Demonstration], segmentation: Segmentation) -> pd.DataFrame:
    """How long and how far primitives are, one row each."""
    rows = []
    for name, cuts in segmentation.results.items():
        durations = cuts["end_s"] - cuts["start_s"]
        ways = [_way_mm(demonstrations[one], cut) for one, cut in cuts.iterrows()]
        rows.append(
            {
                "primitive": name,
                "duration_s": durations.mean(),
                "shortest_s": durations.min(),
                "longest_s": durations.max(),
                "way_mm": np.mean(ways),
            }
        )
    return pd.DataFrame(rows)


def _way_mm(demonstration: Demonstration, cut: pd.Series) -> float:
    ticks = [min(round(cut[end] / demonstration.dt), len(demonstration.time) - 1) for end in ENDS]
    start, end = demonstration.position[ticks]
    return 1e3 * float(np.linalg.norm(end - start))


ENDS = ("start_s", "end_s")


@styled
def speed_panel(demonstration: Demonstration, segmentation: Segmentation) -> Figure:
    """Speed of one demonstration with its primitives."""
    figure = canvas(1.8, PANEL_WIDTH)
    panel = figure.subplots()
    panel.plot(demonstration.time, 1e3 * speed(demonstration), color=BLACK)
    names = segmentation.primitives
    cuts: Sequence[tuple[float, float]] = [
        tuple(segmentation.result(name).loc[demonstration.name, list(ENDS)]) for name in names
    ]
    shade_primitives(panel, cuts, names)
    draw_cuts(panel, cuts, demonstration)
    panel.set(
        xlim=demonstration.time[[0, -1]], xlabel=f"{demonstration.name}: time (s)", ylabel="speed (mm/s)"
    )
    return figure
