"""Primitives: what was learned, over what it was learned from, and how far they are apart."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.palette import LIGHT_GREY, primitive_colour
from structlearn.primitives.fitting import FitParameters, reproduction_summary, segment_paths
from structlearn.primitives.sequence import largest_acceleration_jump
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import styled
from structlearn.reporting.movement_figures import fit_panel, sequence_figure, space_panels
from structlearn.tasks.section import Section
from structlearn.tasks.task_files import TaskFiles

TITLES = {"nominal": "Nominal", "generalised": "New situation"}


def section(files: TaskFiles) -> Section:
    """Of a task with demonstrations."""
    parameters = files.part("fit", FitParameters)
    errors = chosen_errors(files.table("primitives/reproduction"), parameters)
    sequences = {title: files.table(f"primitives/{name}") for name, title in TITLES.items()}
    left_out = errors[errors["left_out"]]
    told = left_out if len(left_out) else errors
    headings = {
        "mean_mm": "mean (mm)",
        "max_mm": "largest (mm)",
        "end_mm": "largest at the end (mm)",
        "mean_deg": "mean (°)",
        "max_deg": "largest (°)",
        "end_deg": "largest at the end (°)",
        "left_out": "demonstration",
    }
    formats = {name: ".2f" for name in headings if name != "left_out"}
    words = {"left_out": {False: "learned from", True: "left out"}}
    metrics = {f"primitives_{row.primitive}_left_out_mm": row.mean_mm for row in left_out.itertuples()}
    return Section(
        "primitives",
        "Primitives",
        "primitives.html.jinja",
        facts={
            "kernels": parameters.kernel_count,
            "worst": told.loc[told["mean_mm"].idxmax()].to_dict(),
            "jump": max(map(largest_acceleration_jump, sequences.values())),
            "names": list(errors["primitive"].unique()),
            "turns": "mean_deg" in errors,
        },
        metrics=metrics,
        tables={"errors": Table(errors, formats, headings, words=words)},
        pictures={
            "space": space_figure(files, sequences[TITLES["nominal"]]),
            "fit": fit_figure(files, parameters),
            "sequence": sequence_figure(sequences),
        },
    )


def chosen_errors(reproduction: pd.DataFrame, parameters: FitParameters) -> pd.DataFrame:
    """Errors by primitive for the regression that is used, learned from and left out."""
    summary = reproduction_summary(reproduction)
    return summary[summary["regression"] == parameters.regression].drop(columns="regression")


@styled
def space_figure(files: TaskFiles, nominal: pd.DataFrame) -> list[Figure]:
    """The nominal sequence over all demonstrations."""
    thin = {"color": LIGHT_GREY, "linewidth": 0.8}
    paths = [(one.position, thin) for one in files.runs("demonstrations")]
    for place, (name, part) in enumerate(nominal.groupby("primitive", sort=False)):
        look = {"color": primitive_colour(place), "linewidth": 2.2, "label": name}
        paths.append((part[["x", "y", "z"]].to_numpy(), look))
    return space_panels(paths)


@styled
def fit_figure(files: TaskFiles, parameters: FitParameters) -> list[Figure]:
    """Segments of all demonstrations relative to their goal, and the primitive, a panel each."""
    demonstrations, segmentation = files.runs("demonstrations"), files.segmentation()
    panels = []
    for place, primitive in enumerate(files.primitives()):
        cuts = segmentation.result(primitive.name)
        segments = segment_paths(demonstrations, cuts, parameters.smoothing_hz)
        shown = [1e3 * (path.position - path.position[-1]) for path, _ in segments]
        learned = primitive.position
        unrolled = 1e3 * (learned.unroll(1.0 / files.clock.rate_hz).position - learned.goal)
        labels = [f"{axis} (mm)" for axis in "xyz"]
        panels.append(fit_panel(primitive.name, place, shown, np.asarray(unrolled), labels))
    return panels
