"""Tables of the three pages: derived from the stored tables, and formatted for display."""

import re
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from dissertation.scraping import names
from dissertation.scraping.names import primitive_title
from dissertation.scraping.page.stored import Stored
from dissertation.scraping.protocol.execution_scores import NOMINAL
from dissertation.scraping.protocol.feedback_models import POINTWISE, REPRESENTATIONS, STOPPINGS
from dissertation.scraping.world.layout import hand_roll_deg
from dissertation.simulation.individuals import Individual, differences
from structlearn.core.metrics import matching
from structlearn.feedback.coupling_dataset import PARTS
from structlearn.policy_search.refinement import FEEDBACK
from structlearn.primitives.fitting import reproduction_summary
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.document import Table
from structlearn.reporting.prose import with_spread
from structlearn.segmentation import cut_errors
from structlearn.segmentation.alignment import RESULT

Frames = Mapping[str, pd.DataFrame]
"""Tables by name; empty ones are not shown."""


def derived(stored: Stored, printed: Mapping[str, Any]) -> dict[str, pd.DataFrame]:
    """Derived tables of all pages; `printed`: values of the dissertation, see `page.published`."""
    return cut_tables(stored) | board_tables(stored, printed) | refinement_tables(stored, printed)


def cut_tables(stored: Stored) -> dict[str, pd.DataFrame]:
    """Tables of the page on segmentation and primitives."""
    cuts, by_seed = stored.segmentation, cut_errors.errors_by_seed(stored.tables["noise"])
    its = stored.parameters
    tables = {
        "demonstrating_people": differing(demonstrates=its["simulate"], guides=its["testbed"].guidance),
        "demonstrations_left_out": cuts.left_out,
        "cut_points": cuts.cuts,
        "noise_sweep": cut_errors.errors_by_level(by_seed),
        "noise_sweep_comparison": cut_errors.paired_comparison(by_seed),
        "downsampling": stored.tables["downsampling"],
        "reproduction": reproduction_summary(stored.tables["reproduction"]),
    }
    errors = cut_errors.cut_errors(stored.demonstrations, cuts)
    tables["alignment"] = cut_errors.alignment_comparison(stored.was_cut, cuts, stored.found_primitives)
    tables["cut_errors"] = cut_errors.mean_cut_errors_ms(errors).reset_index()
    return tables


def board_tables(stored: Stored, printed: Mapping[str, Any]) -> dict[str, pd.DataFrame]:
    """Tables of the page on feedback models."""
    tables, scores = stored.tables, stored.tables["scores"]
    errors = model_errors(tables["comparison"], stored.adapted)
    runs = {model: stored.tilted[model] for model in (NOMINAL, POINTWISE)}
    testbed = stored.parameters["testbed"]
    return {
        "correcting_people": differing(person=testbed.corrector, fingers=testbed.touch),
        "coupling_checks": tables["checks"],
        "model_errors": errors.reset_index(),
        "model_orderings": tables["orderings"],
        "model_nmse": nmse_beside_published(errors, stored, printed["nmse"]),
        "board_nominal": nominal_means(scores),
        "board_costs": costs(scores),
        "path_errors": path_comparison(tables["path_errors"]),
        "hand_roll": hand_rolls(runs, stored.tilt_deg, stored, printed["hand"]),
    }


def refinement_tables(stored: Stored, printed: Mapping[str, Any]) -> dict[str, pd.DataFrame]:
    """Tables of the page on refinement."""
    scores, history, search = (stored.tables[name] for name in ("refined_scores", "history", "search"))
    tables = {
        "refinement_curves": curves(history),
        "refinement_costs": costs(scores),
        "refinement_faults": faults(history),
    }
    if stored.refined:
        own = stored.refined, stored.refined_deg
        tables["hand_roll_refined"] = hand_rolls(*own, stored, printed["hand"])
    if len(search):
        found = searches(search)
        tables |= {"search_efficiency": found, "searches": ends_of_searches(search, found)}
    return tables


def differing(**populations: Individual) -> pd.DataFrame:
    """Rows of `individuals.differences` of several populations, with the name of each as `which`."""
    return pd.concat([differences(its).assign(which=name) for name, its in populations.items()])[
        ["which", "parameter", "median", "lowest", "highest", "source"]
    ]


def settings(scores: pd.DataFrame, tilted: bool = False) -> list[float]:
    """Rolls of the board in executions, ascending; `tilted`: without the level board."""
    return [setting for setting in sorted(scores["setting_deg"].unique()) if setting or not tilted]


def costs(scores: pd.DataFrame) -> pd.DataFrame:
    """Mean and std over runs of the accumulated cost, by `primitive`, `model` and `setting_deg`."""
    grouped = scores.groupby(["primitive", "model", "setting_deg"], sort=False)["cost_rad"]
    return grouped.agg(["mean", "std"]).reset_index()


def nominal_means(scores: pd.DataFrame) -> pd.DataFrame:
    """Means over executions without feedback, by `setting_deg` and `primitive`."""
    rows = matching(scores, model=NOMINAL).drop(columns=["run", "model"])
    return rows.groupby(["setting_deg", "primitive"]).mean().reset_index()


def model_errors(comparison: pd.DataFrame, adapted: Sequence[str]) -> pd.DataFrame:
    """NMSE over folds by primitive, representation and stopping, and mean `dimensions` of the code.

    Columns: `<part>_mean` and `<part>_std`.
    """
    grouped = comparison.groupby(["primitive", "representation", "stopping"])
    errors = {f"{part}_{how}": (part, how) for part in PARTS for how in ("mean", "std")}
    found = grouped.agg(**errors, dimensions=("dimensions", "mean"))
    order = product(adapted, REPRESENTATIONS, STOPPINGS)
    return found.loc[[key for key in order if key in found.index]]


def nmse_beside_published(errors: pd.DataFrame, stored: Stored, published: Mapping) -> pd.DataFrame:
    """Table IV.5: NMSE of PMNN with 100 nodes, mean ± std over folds; `errors`: of `model_errors`."""
    rows = []
    for name in stored.adapted:
        title = primitive_title(stored.names, name)
        if printed := published.get(name, {}):
            cells = {part: with_spread(mean, std, ".2f") for part in PARTS for mean, std in [printed[part]]}
            rows.append({"primitive": title, "which": "published"} | cells)
        for stopping, rule in (("generalization", ", as published"), ("validation", "")):
            error = errors.loc[(name, "pmnn_100", stopping)]
            cells = {part: with_spread(error[f"{part}_mean"], error[f"{part}_std"], ".3f") for part in PARTS}
            which = f"here, best step for {WORDS['stopping'][stopping]}{rule}"
            rows.append({"primitive": title, "which": which} | cells)
    return pd.DataFrame(rows)


def path_comparison(path_errors: pd.DataFrame) -> pd.DataFrame:
    """Errors of unrolled paths in degrees by `primitive`, `setting_deg` and trained model, a column each."""
    wide = path_errors.pivot_table("error_deg", ["primitive", "setting_deg"], "model", sort=False)
    return wide.add_suffix("_deg").reset_index()


def moments(run: Demonstration) -> list[int]:
    """Sample indices of an execution's start, and of the end of every primitive."""
    last = len(run.time) - 1
    return [0, *(min(round(end / run.dt), last) for end in run.signal("true_segments")[:, 1])]


def hand_readings(runs: Sequence[Demonstration], axis: np.ndarray) -> pd.DataFrame:
    """Mean and std over runs of the hand's roll in degrees (0: flat on a level board), one row per moment."""
    readings = pd.DataFrame([hand_roll_deg(run, axis)[moments(run)] for run in runs])
    return pd.DataFrame({"mean": readings.mean(), "std": readings.std()})


def hand_rolls(
    executed: Mapping[str, Sequence[Demonstration]], setting_deg: float, stored: Stored, published: Mapping
) -> pd.DataFrame:
    """Figure IV.17: hand roll in degrees, with the published protractor readings at the same tilt."""
    columns = ["start", *(f"end of {name}" for name in stored.names)]
    rows = []
    if setting_deg == published["setting_deg"]:
        for model, words in ((NOMINAL, "no feedback"), (POINTWISE, "with feedback")):
            readings = [f"{reading:.1f}" for reading in published[model]]
            rows.append({"which": f"published, {words}"} | dict(zip(columns, readings, strict=False)))
    for model, runs in executed.items():
        cells = [with_spread(*reading) for reading in hand_readings(runs, stored.axis).to_numpy()]
        rows.append({"which": f"here, {names.RUNS[model].name}"} | dict(zip(columns, cells, strict=True)))
    return pd.DataFrame(rows)


def curves(history: pd.DataFrame) -> pd.DataFrame:
    """Figure IV.19: cost over iterations, from rollouts that did not fail.

    One row per `primitive`, `iteration` and `kind`: `mean`, `std`, `low` and `high` (extremes) of the
    accumulated cost in rad, `count` of rollouts, `norm_rad` (mean), number `failed`.
    """
    failed = history["fault"] != ""
    grouped = history.assign(failed=failed).groupby(["primitive", "iteration", "kind"], sort=False)
    return grouped.agg(
        mean=("cost_rad", "mean"),
        std=("cost_rad", "std"),
        low=("cost_rad", "min"),
        high=("cost_rad", "max"),
        count=("fault", "size"),
        norm_rad=("norm_rad", "mean"),
        failed=("failed", "sum"),
    ).reset_index()


def curve(table: pd.DataFrame, primitive: str, kind: str = FEEDBACK) -> pd.DataFrame:
    """Rows of `curves` by iteration; for the network, iteration 0 is before refinement."""
    return matching(table, primitive=primitive, kind=kind).set_index("iteration")


def faults(history: pd.DataFrame) -> pd.DataFrame:
    """Failed rollouts: `primitive`, `fault` with its numbers removed, `rollouts`."""
    failed = history[history["fault"] != ""]
    kinds = failed["fault"].map(lambda fault: re.sub(r"\d+(\.\d+)?", "…", fault)).rename("fault")
    return failed.groupby(["primitive", kinds], sort=False).size().rename("rollouts").reset_index()


def searches(search: pd.DataFrame) -> pd.DataFrame:
    """Cost of the mean policy by number of rollouts: mean, `low` and `high` over searches.

    One row per `primitive`, `method` and `rollouts`; `known`: searches whose mean policy did not fail.
    """
    grouped = search.groupby(["primitive", "method", "rollouts"])["cost_rad"]
    return grouped.agg(mean="mean", low="min", high="max", known="count").reset_index()


def ends_of_searches(search: pd.DataFrame, found: pd.DataFrame) -> pd.DataFrame:
    """Final state of the searches, by `primitive` and `method`.

    The last rows of `found` (from `searches`), with `seeds` (number of searches), total `updates` and
    `failed` rollouts, `start_rad` (cost of the initial policy) and `best_rad` (cost of the best rollout).
    """
    keys = ["primitive", "method"]
    begun = search[search["update"] == 0].groupby(keys)
    ended = search.groupby([*keys, "seed"]).tail(1).groupby(keys)
    last = found.groupby(keys).tail(1).set_index(keys)
    return last.assign(
        seeds=ended.size(),
        updates=ended["update"].max(),
        failed=ended["failed"].sum(),
        start_rad=begun["cost_rad"].mean(),
        best_rad=ended["best_rad"].min(),
    ).reset_index()


LOOKS = names.CUT_METHODS | names.REPRESENTATIONS | names.RUNS | names.SEARCHES | names.ROLLOUTS
WORDS: Mapping[str, Mapping[Any, str]] = {
    column: {key: look.name for key, look in LOOKS.items()}
    for column in ("method", "model", "representation", "better", "worse", "kind")
} | {
    "left_out": {False: "all", True: "all but the held-out one"},
    "stopping": {"validation": "validation", "generalization": "the held-out demonstration"},
}
"""Displayed text for each key, by column; the same names as in figures and recordings."""

DECIMALS = {
    2: "spread_mm distance_mm gain_mm low_mm high_mm mean_mm mean_deg end_deg reproduction_deg "
    "roll_torque_mn_m mean_shift_ms pointwise_deg level_deg unrolled_deg norm_rad others shift_samples "
    "shift_samples_published",
    1: "mean_ms max_shift_ms max_mm max_deg difference_ms low_ms high_ms half_width_ms mean std low high "
    "end_roll_deg cost_rad",
    3: "end_mm smoothing_deg difference force_n force_std_n "
    + " ".join(f"{part}_{what}" for part in PARTS for what in ("mean", "std")),
    0: "max_ms",
}
FORMATS = {name: f".{digits}f" for digits, names in DECIMALS.items() for name in names.split()}
FORMATS |= {
    "half_width": ".3g",
    "median": ".3g",
    "lowest": ".3g",
    "highest": ".3g",
    "noise_mm": "g",
    "setting_deg": "g",
    "work": ".2g",
    "p_value": ".2g",
    "dimensions": ".2g",
}
UNITS = {"mm": "mm", "ms": "ms", "deg": "°", "rad": "rad", "n": "N", "s": "s"}
HEADINGS = {
    "factor": "g",
    "which": "",
    "setting_deg": "board (°)",
    "better": "first",
    "worse": "second",
    "low": "from",
    "high": "to",
    "left_out": "learned from",
    "others": "other axes",
    "shift_samples": "largest, coarse samples",
    "shift_samples_published": "as printed, coarse samples",
    "roll_torque_mn_m": "roll torque (mN m)",
    "generalization": "generalisation",
}


def tables(frames: Frames) -> dict[str, Table]:
    """Non-empty tables, as displayed."""
    return {name: _shown(frame) for name, frame in frames.items() if len(frame)}


def _shown(frame: pd.DataFrame) -> Table:
    """Displayed table with names and headings; rows of the method used further on are bold."""
    headings = {name: HEADINGS.get(name, _heading(name)) for name in frame.columns}
    strong = frozenset(place for place, one in enumerate(frame.get("method", ())) if one == RESULT)
    return Table(frame, FORMATS, headings, strong, WORDS)


def _heading(column: str) -> str:
    """Heading of a column, e.g. `mean (ms)` for `mean_ms`."""
    name, _, unit = column.rpartition("_")
    return f"{name.replace('_', ' ')} ({UNITS[unit]})" if name and unit in UNITS else column.replace("_", " ")
