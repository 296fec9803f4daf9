"""Tables of the page of the recorded data: those that it shows, and those behind its figures."""

import numpy as np
import pandas as pd

from structlearn.palette import METHOD_NAMES
from structlearn.reporting.document import Table
from structlearn.reporting.prose import with_interval, with_spread
from structlearn.segmentation.method_comparison import paired_comparison
from structlearn.segmentation.result import METHODS
from structlearn.testbeds.recorded import names
from structlearn.testbeds.recorded.page.results import (
    AXES,
    STRONG_RANGE,
    RecordedResults,
    best_representation,
    by_axis,
)

UNITS = {
    "_n_m": (" (N m)", ".2f"),
    "_mm": (" (mm)", ".2f"),
    "_ms": (" (ms)", ".1f"),
    "_kg": (" (kg)", ".2f"),
    "_m": (" (m)", ".3f"),
    "_deg": (" (°)", ".2f"),
    "_counts": (" (counts)", ".1f"),
    "_share": (" (share)", ".1%"),
    "": ("", ".3g"),
}
"""By the end of a column's name: what is written instead in its heading, and how its numbers are written."""

WORDS = {"max": "largest", "nmse": "NMSE", "rms": "RMS"}
"""Of columns' names, that a heading writes otherwise."""

STRONG = {"strong": f"electrodes beyond {STRONG_RANGE} counts", "strong_nmse": "their mean NMSE"}
"""Columns of the electrodes' errors that need more words."""

STREAM_UNITS = {
    "pose": "m",
    "joint_positions": "rad",
    "joint_velocities": "rad/s",
    "joint_torques": "N m",
    "wrench": "N, N m",
    "tactile": "counts",
}


def shown(frame: pd.DataFrame, strong: frozenset[int] = frozenset(), **formats: str) -> Table:
    """A table whose headings and formats follow from the names of its columns; `formats` are exceptions."""
    headings, found = {}, {}
    for name in frame:
        ending = next(ending for ending in UNITS if str(name).endswith(ending))
        unit, found[name] = UNITS[ending]
        words = str(name).removesuffix(ending).split("_")
        headings[name] = " ".join(WORDS.get(word, word) for word in words) + unit
        if pd.api.types.is_integer_dtype(frame[name]):
            found[name] = ""
    return Table(frame, found | formats, headings, strong)


def tables(results: RecordedResults) -> dict[str, Table]:
    """By name; all become CSV files, those of raw numbers too that no page shows."""
    raw = {
        "reach_cut_errors": results.by_level,
        "reach_comparison": paired_comparison(results.by_seed),
        "reach_reproduction": results["reach_errors"],
        "corrected_reaches": results["coupling_distances"],
        "coupling_scores": results["coupling_scores"],
        "electrodes": results["electrode_scores"],
        "slide_deviations": results["slide_deviations"],
        "slide_left_one_out": results["slide_left_one_out"],
        "avoidance": results["avoidance_scores"],
        "avoidance_phase": results["avoidance_phase"],
        "latent_touch": results["touch_errors"],
        "panda_friction": results["panda_friction"],
        "panda_links": results["panda_links"],
    }
    return {
        **{name: Table(frame) for name, frame in raw.items()},
        "reach_cuts": _cuts(results),
        "reach_fit": shown(results.reach_fit, max_mm=".1f", end_max_mm=".3f"),
        "coupling_paths": shown(_coupling_paths(results)),
        "coupling_axes": shown(_coupling_axes(results), largest_m=".1f", spread_m=".1f"),
        "unscrewing": shown(results["unscrewing_errors"]),
        "execution": shown(results["sequence_errors"]),
        "electrode_errors": shown(results.electrodes.rename(columns=STRONG)),
        "slide_clock": shown(
            results["clock_errors"].assign(unit=results["clock_errors"]["kind"].map(STREAM_UNITS))
        ),
        "slides": shown(results.slides),
        **_avoidance(results),
        "touch_scores": Table(_touch_scores(results)),
        "latent_touch_sets": shown(results["touch_sets"]),
        "latent_touch_likeness": shown(results["touch_likeness"]),
        **_arms(results),
    }


def _cuts(results: RecordedResults) -> Table:
    wide = results.by_level.pivot_table(index="noise_mm", columns="method", values="mean_ms")
    headings = {method: f"{name} (ms)" for method, name in METHOD_NAMES.items()}
    formats = dict.fromkeys(METHODS, ".1f")
    return Table(wide[list(METHODS)].reset_index(), formats, headings | {"noise_mm": "noise (mm)"})


def _coupling_paths(results: RecordedResults) -> pd.DataFrame:
    """Distance of left-out reaches from every path: mean and std over the splits, and the largest."""
    distances = results["coupling_distances"]
    rows = []
    for key in ("nominal", "coupling", "spread"):
        means = distances.groupby("split")[f"{key}_mm"].mean()
        rows.append((names.PATHS[key].name, means.mean(), means.std(), distances[f"{key}_mm"].max()))
    return pd.DataFrame(rows, columns=["distance_from", "mean_mm", "std_mm", "furthest_mm"])


def _coupling_axes(results: RecordedResults) -> pd.DataFrame:
    """Per local axis: largest mean target, its root mean square spread, and the network on left-out ones."""
    targets, scores = (results[name].groupby("axis") for name in ("coupling_targets", "coupling_scores"))
    frame = pd.DataFrame(
        {
            "largest_m": targets["mean"].agg(lambda values: values.abs().max()),
            "spread_m": targets["std"].agg(lambda values: np.sqrt((values**2).mean())),
            "nmse": scores["nmse"].mean(),
            "nmse_std": scores["nmse"].std(),
            "target_at_the_end_share": scores["target_end_share"].mean(),
            "error_at_the_end_share": scores["residual_end_share"].mean(),
        }
    )
    return frame.loc[AXES].reset_index()


def _touch_scores(results: RecordedResults) -> pd.DataFrame:
    """Mean and std over parts and seeds, as text, by what was asked."""
    rows = []
    for key in names.TOUCH_ASKED:
        found = results.touch_scores.loc[key]
        row = {"learned from": key[0], "asked about": key[1] if key[2] == "new set" else key[2]}
        for model, look in names.TOUCH_MODELS.items():
            row[f"reconstruction, {look.name}"] = _spread(found.loc[model], "reconstruction")
        row |= {
            f"{error}, structured": _spread(found.loc["structured"], error)
            for error in ("distances", "pressure")
        }
        rows.append(row)
    return pd.DataFrame(rows)


def _spread(found: pd.Series, error: str) -> str:
    return with_spread(found[error], found[f"{error}_std"], ".2f")


def _avoidance(results: RecordedResults) -> dict[str, Table]:
    held_out, train = (by_axis(results["avoidance_scores"], column) for column in ("nmse", "train"))
    wide = held_out.join(train.add_suffix(", learned from"))
    gains, halves = (by_axis(results["avoidance_phase"], column) for column in ("gain", "half_width"))
    worth = pd.DataFrame({axis: list(map(_gain, gains[axis], halves[axis])) for axis in AXES}, gains.index)
    best = frozenset({held_out.index.get_loc(best_representation(results))})
    return {
        "avoidance_models": shown(_named(wide), best, **dict.fromkeys(wide, ".2f")),
        "avoidance_gains": shown(_named(worth.loc[[key for key in held_out.index if key in worth.index]])),
    }


def _gain(middle: float, half_width: float) -> str:
    return with_interval(middle, half_width, ".3f")


def _named(wide: pd.DataFrame) -> pd.DataFrame:
    """Rows by representation and inputs, with names for people."""
    models = [names.REPRESENTATIONS[name] for name, _ in wide.index]
    sees = [names.INPUTS[inputs].name for _, inputs in wide.index]
    return pd.concat([pd.DataFrame({"model": models, "sees": sees}), wide.reset_index(drop=True)], axis=1)


def _arms(results: RecordedResults) -> dict[str, Table]:
    test = results.panda
    numbers = test.add_prefix("joint_").assign(mean=test.mean(axis=1))
    models = [names.DYNAMICS_MODELS[model] for model, _ in test.index]
    frictions = [names.FRICTIONS[friction] for _, friction in test.index]
    keys = pd.DataFrame({"model": models, "friction": frictions})
    plain = frozenset(np.flatnonzero(test.index.get_level_values("model") == "least_squares").tolist())
    rubbing = _of_cov(results["panda_friction"]).pivot_table(index="joint", columns="term", values="value")
    centre = [f"centre_{axis}_m" for axis in AXES]
    return {
        "panda": shown(pd.concat([keys, numbers.reset_index(drop=True)], axis=1), plain),
        "panda_rubbing": shown(rubbing.reset_index()[["joint", "viscous", "coulomb"]]),
        "panda_bodies": shown(_of_cov(results["panda_links"])[["link", "mass_kg", "true_mass_kg", *centre]]),
        "slide_torques": shown(results["slide_torques"]),
        "slide_payloads": shown(results["slide_payloads"]),
    }


def _of_cov(table: pd.DataFrame) -> pd.DataFrame:
    """Rows of the structure Cov with viscous and Coulomb friction."""
    return table[(table["model"] == "cov") & (table["friction"] == "coulomb")]
