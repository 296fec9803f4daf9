"""The skin of a task: a latent space whose map is the skin, tried on touches that it did not learn from."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from structlearn.core.artefacts import Metrics
from structlearn.reporting.claims import Evidence, mean
from structlearn.reporting.document import Table
from structlearn.reporting.panels import map_panels
from structlearn.reporting.prose import interval, rounded
from structlearn.tasks.section import Section
from structlearn.tasks.task_entry import TouchEntry
from structlearn.tasks.task_files import TaskFiles

MODELS = {
    "structured": "structured latent space",
    "reconstruction only": "latent space without structure",
    "3 principal components": "3 principal components",
    "Gaussian process": "Gaussian process on all channels",
}
OURS, PLAIN, COMPONENTS, _ = MODELS
NEW_BLOCKS = "new blocks"
TITLES = ("Where touches were", "Where they lie in the map")


class Measure(NamedTuple):
    """An error of latent spaces: its column, heading and number of digits."""

    column: str
    heading: str
    number: str


MEASURES = {
    "reconstruction": Measure("signal_nmse", "channels, NMSE", ".2g"),
    "worst_channel": Measure("worst_nmse", "worst channel, NMSE", ".2g"),
    "distances": Measure("map_nmse", "distances on the map, NMSE", ".2g"),
    "pressure": Measure("pressure_nmse", "pressure, NMSE", ".2g"),
    "laid_mm": Measure("laid_mm", "map laid down (mm)", ".1f"),
    "place_mm": Measure("latent_mm", "place read (mm)", ".1f"),
    "depth": Measure("depth_nmse", "depth, NMSE", ".2g"),
}


def section(files: TaskFiles) -> Section:
    """Of a task with touches."""
    parameters = files.entry(TouchEntry)
    errors, lies, recordings = (files.table(f"touch/{name}") for name in ("errors", "map", "recordings"))
    errors = errors[~errors["learned_from"].isin(parameters.tuned_on)]
    held_out = errors[errors["new"] == NEW_BLOCKS]
    found = {name: over_blocks(held_out, OURS, measure) for name, measure in MEASURES.items()}
    facts = {
        "recordings": len(recordings),
        "touches": len(lies),
        "folds": parameters.folds,
        "block_mm": parameters.block_mm,
        "probe": parameters.places == "probe",
        "laid": found["laid_mm"],
        "distances": found["distances"],
        "distances_plain": over_blocks(held_out, PLAIN, MEASURES["distances"]),
        "reconstruction": found["reconstruction"],
        "reconstruction_components": over_blocks(held_out, COMPONENTS, MEASURES["reconstruction"]),
        "apart": parameters.apart,
        "file": f"{files.folder}/touch/{'models' if parameters.apart else 'latent.safetensors'}",
    }
    metrics: Metrics = {f"touch_{name}": its.value for name, its in found.items() if np.isfinite(its.value)}
    tables = {"touch_errors": errors_table(errors), "touch_recordings": Table(recordings)}
    for name, keys, values in (
        ("force", ["new", "model"], ["rms_n", "worst_n"]),
        ("servo", ["model", "controller"], ["arrived", "left_mm", "length_ratio"]),
    ):
        if (files.folder / f"touch/{name}.parquet").is_file():
            its = files.table(f"touch/{name}").groupby(keys, sort=False)[values].mean().reset_index()
            tables[f"touch_{name}"] = Table(its, dict.fromkeys(values, ".2f"), words={"model": MODELS})
    return Section(
        "touch",
        "The skin",
        "touch.html.jinja",
        lead="touch_lead.html.jinja",
        facts=facts | {"further": [name for name in ("touch_force", "touch_servo") if name in tables]},
        metrics=metrics | {"touch_samples": len(lies)},
        tables=tables,
        pictures={"touch": map_panels(lies, TITLES, 4.4, 0.1e3 * np.ptp(lies[["x_m", "y_m"]], axis=0).max())},
    )


def over_blocks(errors: pd.DataFrame, model: str, measure: Measure) -> Evidence:
    """An error with its interval over blocks of places; mean over seeds."""
    its = errors[errors["model"] == model].groupby(["learned_from", "asked_about", "block"])
    return mean(its[measure.column].mean().to_numpy())


def errors_table(errors: pd.DataFrame) -> Table:
    """One row per model, on blocks held out and on other recordings."""
    rows = []
    for new, asked in errors.groupby("new", sort=False):
        for model in MODELS:
            row: dict[str, str | None] = {"tested on": str(new), "model": model}
            for measure in MEASURES.values():
                its = over_blocks(asked, model, measure)
                ends = interval(max(its.low, 0.0), its.high, measure.number)
                text = f"{rounded(its.value, measure.number)} {ends}"
                row[measure.heading] = text if np.isfinite(its.value) else None
            rows.append(row)
    frame = pd.DataFrame(rows).dropna(axis=1, how="all")
    strong = frozenset(np.flatnonzero(frame["model"] == OURS).tolist())
    return Table(frame, strong=strong, words={"model": MODELS})
