"""The skin of a task: a latent space whose map is the skin, tried on touches that it did not learn from."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from structlearn.ground.artefacts import Metrics
from structlearn.palette import place_colours
from structlearn.reporting.claims import Evidence, mean
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import Raster, styled
from structlearn.reporting.panels import panel
from structlearn.reporting.prose import interval, rounded
from structlearn.testbeds.own.files import TaskFiles
from structlearn.testbeds.own.page.section import Section
from structlearn.testbeds.own.protocol.own_touch_parameters import TouchParameters

MODELS = {
    "structured": "structured latent space",
    "reconstruction only": "latent space without structure",
    "3 principal components": "3 principal components",
}
OURS, PLAIN, COMPONENTS = MODELS


class Measure(NamedTuple):
    """An error of latent spaces."""

    heading: str
    number: str


MEASURES = {
    "reconstruction": Measure("channels, NMSE", ".2g"),
    "worst_channel": Measure("worst channel, NMSE", ".2g"),
    "distances": Measure("distances on the map, NMSE", ".2g"),
    "pressure": Measure("pressure, NMSE", ".2g"),
    "laid_mm": Measure("map laid down (mm)", ".1f"),
}


def section(files: TaskFiles) -> Section:
    """Of a task with touches."""
    parameters = files.part("touch", TouchParameters)
    errors, lies, recordings = (files.table(f"touch/{name}") for name in ("errors", "map", "recordings"))
    found = {name: of_folds(errors, OURS, name) for name in MEASURES}
    facts = {
        "recordings": len(recordings),
        "touches": len(lies),
        "folds": errors["fold"].nunique(),
        "block_mm": parameters.block_mm,
        "probe": parameters.places == "probe",
        "laid": found["laid_mm"],
        "distances": found["distances"],
        "distances_plain": of_folds(errors, PLAIN, "distances"),
        "reconstruction": found["reconstruction"],
        "reconstruction_components": of_folds(errors, COMPONENTS, "reconstruction"),
        "file": f"{files.folder}/touch/latent.safetensors",
    }
    metrics: Metrics = {f"touch_{name}": its.value for name, its in found.items()}
    return Section(
        "touch",
        "The skin",
        "touch.html.jinja",
        facts=facts,
        metrics=metrics | {"touch_samples": len(lies)},
        tables={
            "touch_errors": errors_table(errors),
            "touch_recordings": Table(recordings),
        },
        pictures={"touch": map_panels(lies)},
    )


def of_folds(errors: pd.DataFrame, model: str, measure: str) -> Evidence:
    """An error with its interval over folds; mean over seeds."""
    its = errors[errors["model"] == model].groupby("fold")[measure].mean()
    return mean(its.to_numpy())


def errors_table(errors: pd.DataFrame) -> Table:
    """One row per model."""
    rows = []
    for model in MODELS:
        row: dict[str, str | None] = {"model": model}
        for name, measure in MEASURES.items():
            its = of_folds(errors, model, name)
            ends = interval(max(its.low, 0.0), its.high, measure.number)
            text = f"{rounded(its.value, measure.number)} {ends}"
            row[measure.heading] = text if np.isfinite(its.value) else None
        rows.append(row)
    return Table(pd.DataFrame(rows), strong=frozenset({0}), words={"model": MODELS})


@styled
def map_panels(lies: pd.DataFrame) -> list[Raster]:
    """Where touches were, and where they lie in maps that had not seen their blocks."""
    places, mapped = (1e3 * lies[columns].to_numpy() for columns in (["x_m", "y_m"], ["map_x_m", "map_y_m"]))
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
    half = 0.6 * np.ptp(places, axis=0).max()
    colours, figures = place_colours(places) / 255.0, []
    for title, points in (
        ("Where touches were", places - middle),
        ("Where they lie in the map", mapped - middle),
    ):
        figure, axes = panel(title, 4.4, xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
        axes.set(xlim=(-half, half), ylim=(-half, half))
        axes.scatter(points[:, 0], points[:, 1], s=5.0, c=colours, linewidths=0)
        figures.append(Raster(figure))
    return figures
