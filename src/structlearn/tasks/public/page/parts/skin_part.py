"""A magnetic skin that was pressed at known places: is its map the skin, and can one servo in it?"""

import numpy as np
import pandas as pd

from structlearn.core.artefacts import Metrics
from structlearn.reporting.claims import Evidence
from structlearn.reporting.document import Table
from structlearn.reporting.prose import listing
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page.parts.part import Part, of
from structlearn.tasks.public.page.parts.skin_evidence import STRUCTURED, SkinRuns, skin_evidence
from structlearn.tasks.public.page.parts.skin_figures import skin_pictures
from structlearn.tasks.public.page.recorded_results import RecordedResults
from structlearn.tasks.touch.touch_parameters import TouchParameters

RIVALS = {
    "reconstruction only": "plain",
    "3 principal components": "components",
    "Gaussian process": "process",
}
"""Ends of the metrics' names."""

ERRORS = {
    "map_nmse": "map, NMSE",
    "laid_mm": "map laid down (mm)",
    "latent_mm": "place read (mm)",
    "pressure_nmse": "pressure, NMSE",
    "depth_nmse": "depth, NMSE",
    "signal_nmse": "channels, NMSE",
}


def skin_metrics(runs: SkinRuns) -> Metrics:
    """Flat, with intervals as `_low` and `_high`."""
    values: Metrics = {}

    def add(name: str, found: Evidence) -> None:
        if np.isfinite(found.value):
            values[name] = found.value
        if np.isfinite(found.low) and found.low != found.high:
            values.update({f"{name}_low": found.low, f"{name}_high": found.high})

    for key, error, cross in (
        ("eflesh_map_nmse", "map_nmse", False),
        ("eflesh_latent_mm", "latent_mm", False),
        ("eflesh_laid_mm", "laid_mm", False),
        ("eflesh_pressure_nmse", "pressure_nmse", False),
        ("eflesh_signal_nmse", "signal_nmse", False),
        ("eflesh_latent_cross_run_mm", "latent_mm", True),
        ("eflesh_laid_cross_run_mm", "laid_mm", True),
        ("eflesh_map_cross_run_nmse", "map_nmse", True),
    ):
        of = runs.across if cross else runs.tested
        add(key, of(error))
        for model, ending in RIVALS.items():
            add(f"{key}_{ending}", of(error, model))
    add("eflesh_depth_nmse", runs.depth())
    add("eflesh_depth_nmse_process", runs.depth("Gaussian process"))
    add("eflesh_force_n", runs.force(public_names.SKIN_NEW_RUN))
    add("eflesh_force_new_presses_n", runs.force(public_names.SKIN_NEW_PRESSES))
    add("eflesh_force_n_process", runs.force(public_names.SKIN_NEW_RUN, "Gaussian process"))
    add("eflesh_force_n_pressure", runs.force(public_names.SKIN_NEW_RUN, "pressure alone"))
    add("eflesh_servo_success", runs.arrived())
    add("eflesh_servo_success_plain", runs.arrived(model="reconstruction only"))
    add("eflesh_servo_length_ratio", runs.way())
    return values


def skin_tables(runs: SkinRuns) -> dict[str, Table]:
    """By name: errors by model, trials of servoing, forces, and what stands behind the figures."""
    looks = {name: look.name for name, look in public_names.SKIN_MODELS.items()}
    errors = runs["errors"].groupby(["new", "learned_from", "asked_about", "model"], sort=False)[[*ERRORS]]
    frame = errors.mean().dropna(axis=1, how="all").reset_index()
    formats = {name: ".2f" if name.endswith("_mm") else ".4f" for name in ERRORS}
    words = {"model": looks}
    spoken = {"new": "what is new", "learned_from": "learned from", "asked_about": "asked about"}
    shown = {"skin_errors": Table(frame, formats, spoken | ERRORS, words=words)}
    if "servo" in runs.tables:
        keys = ["learned_from", "asked_about", "model", "controller"]
        by = runs["servo"].groupby(keys, sort=False)
        frame = by.agg(
            arrived=("arrived", "mean"),
            left_mm=("left_mm", "median"),
            length_ratio=("length_ratio", "median"),
        ).reset_index()
        heads = spoken | {"left_mm": "left (mm)", "length_ratio": "way, over the straight one"}
        shapes = {"arrived": ".0%", "left_mm": ".2f", "length_ratio": ".2f"}
        shown["skin_servo"] = Table(frame, shapes, heads, words=words)
    if "force" in runs.tables:
        by = runs["force"].groupby(["new", "learned_from", "asked_about", "model"], sort=False)
        frame = by.agg(
            presses=("press", "size"), rms_n=("rms_n", "mean"), worst_n=("worst_n", "max")
        ).reset_index()
        heads = spoken | {"rms_n": "RMS, mean over presses (N)", "worst_n": "largest (N)"}
        shapes = {"rms_n": ".2f", "worst_n": ".1f"}
        looks = {name: look.name for name, look in public_names.SKIN_FORCE.items()}
        shown["skin_force"] = Table(frame, shapes, heads, words={"model": looks})
        heads = {
            "signals_s": "channels lag (s)",
            "force_s": "scale lags (s)",
            "readings": "readings of the scale",
        }
        shown["skin_lags"] = Table(runs["lags"], {"signals_s": ".2f", "force_s": ".2f"}, heads)
    return shown


def skin_facts(runs: SkinRuns, parameters: TouchParameters) -> dict[str, object]:
    """Values for the sentences besides the metrics."""
    errors = runs["errors"]
    presses = errors[(errors["new"] == public_names.SKIN_NEW_BLOCKS) & (errors["model"] == STRUCTURED)]
    presses = presses[presses["seed"] == 0].groupby("learned_from")["presses"].sum()
    lags = runs.tables.get("lags", pd.DataFrame({"signals_s": [], "force_s": []}))
    return {
        "runs": listing(f"{number} is {name}" for name, number in runs.numbers.items()),
        "run_count": len(runs.places),
        "presses": int(presses.iloc[0]),
        "blocks": int(errors[errors["new"] == public_names.SKIN_NEW_BLOCKS]["block"].nunique()),
        "tuned": listing(runs.numbers.get(name, name) for name in runs.tuned_on),
        "depth_runs": listing(sorted(set(runs.depth_runs())), "no run"),
        "judged": len(runs.held_out("map_nmse")) > 0,
        "crossed": "maps" in runs.tables,
        "weighed": "traces" in runs.tables,
        "lag_signals": listing(f"{lag:.2f}" for lag in lags["signals_s"]),
        "lag_force": listing(f"{lag:.2f}" for lag in lags["force_s"]),
        "mean_force": runs.force(public_names.SKIN_NEW_RUN),
        "worst_press": runs.worst_press(),
        "settings": parameters,
    }


KEY = "recorded_skin"


def found(results: RecordedResults) -> SkinRuns:
    """Output of the stage, and the runs that it was tuned on."""
    return SkinRuns(results.of_set("skin_"), results.parameters[KEY].tuned_on)


def facts(results: RecordedResults) -> dict[str, object]:
    """Values for its sentences, under one name."""
    return {"skin": skin_facts(found(results), results.parameters[KEY])}


PART = Part(
    name="skin",
    heading="A magnetic skin",
    page="skin",
    needs=("skin_errors",),
    parameters=(KEY,),
    metrics=of(found, skin_metrics),
    evidence=of(found, skin_evidence),
    facts=facts,
    tables=of(found, skin_tables),
    pictures=of(found, skin_pictures),
)
