"""Tables of the three pages: derived from the stored tables, and formatted for display."""

import re
from collections.abc import Mapping, Sequence
from itertools import combinations, pairwise, product
from typing import Any

import numpy as np
import pandas as pd

from dissertation.scraping import names
from dissertation.scraping.names import CORRECTED, primitive_title
from dissertation.scraping.page.stored import Stored
from dissertation.scraping.protocol.execution_scores import (
    AFTER,
    BEFORE,
    NOMINAL,
    cost_ratios,
    execution_scores,
    nominal_orientation,
)
from dissertation.scraping.protocol.feedback_models import POINTWISE, REPRESENTATIONS, STOPPINGS, UNROLLED
from dissertation.scraping.world.layout import hand_roll_deg
from structlearn.core.metrics import matching, mean_interval, verdict
from structlearn.feedback.coupling_dataset import PARTS
from structlearn.policy_search.refinement import FEEDBACK
from structlearn.primitives.fitting import reproduction_summary
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.document import Table
from structlearn.reporting.evidence import UNKNOWN, Evidence
from structlearn.reporting.prose import with_spread
from structlearn.segmentation import cut_errors
from structlearn.segmentation.alignment import RESULT
from structlearn.segmentation.segments import commanded_cuts

ALL = "all"  # in ratio tables: cost summed over primitives
PUBLISHED_ITERATIONS = 2
"""Iterations after which both primitives had converged (IV.9.4.1); `published.yaml` has it for sentences."""

Frames = Mapping[str, pd.DataFrame]
"""Tables by name; empty ones are not shown."""


def derived(stored: Stored, printed: Mapping[str, Any]) -> dict[str, pd.DataFrame]:
    """Derived tables of all pages; `printed`: values of the dissertation, see `page.published`."""
    return cut_tables(stored) | board_tables(stored, printed) | refinement_tables(stored, printed)


def cut_tables(stored: Stored) -> dict[str, pd.DataFrame]:
    """Tables of the page on segmentation and primitives."""
    cuts, by_seed = stored.segmentation, cut_errors.errors_by_seed(stored.tables["noise"])
    tables = {
        "demonstrations_left_out": cuts.left_out,
        "cut_points": cuts.cuts,
        "noise_sweep": cut_errors.errors_by_level(by_seed),
        "noise_sweep_comparison": cut_errors.paired_comparison(by_seed),
        "downsampling": stored.tables["downsampling"],
        "reproduction": reproduction_summary(stored.tables["reproduction"]),
    }
    guesses, primitives, count = stored.guesses, stored.found_primitives, len(cuts.primitives)
    if guesses:
        tables["alignment"] = cut_errors.alignment_comparison(stored.was_cut, cuts, primitives)
    if guesses and all(one.true_segments is not None and len(one.true_segments) == count for one in guesses):
        errors = cut_errors.cut_errors(stored.demonstrations, cuts)
        tables["cut_errors"] = cut_errors.mean_cut_errors_ms(errors).reset_index()
    return tables


def downsampling_worst(effect: pd.DataFrame) -> pd.DataFrame:
    """Worst values of `cut_sweep.downsampling_sweep` by person; empty if there is only one factor g.

    `work`: value of work times g² furthest from 1; largest `shift_samples` and `shift_samples_published`.
    """
    first = effect["factor"].min()
    rest = effect[effect["factor"] > first]
    by_person = rest.assign(work=rest["work"] * (rest["factor"] / first) ** 2).groupby("seed")
    work = by_person["work"].agg(lambda work: work.loc[(work - 1.0).abs().idxmax()])
    return by_person[["work", "shift_samples", "shift_samples_published"]].max().assign(work=work)


def board_tables(stored: Stored, printed: Mapping[str, Any]) -> dict[str, pd.DataFrame]:
    """Tables of the page on feedback models."""
    tables, scores = stored.tables, stored.tables["scores"]
    errors = model_errors(tables["comparison"], stored.adapted)
    runs = {model: stored.tilted[model] for model in (NOMINAL, POINTWISE)}
    return {
        "coupling_checks": tables["checks"],
        "model_errors": errors.reset_index(),
        "model_orderings": tables["orderings"],
        "model_nmse": nmse_beside_published(errors, stored, printed["nmse"]),
        "board_nominal": nominal_means(scores),
        "board_costs": costs(scores),
        "board_cost_ratios": ratios(scores),
        "board_coupling": coupling_steps(tables["traces"]),
        "path_errors": path_comparison(tables["path_errors"], stored),
        "hand_roll": hand_rolls(runs, stored.tilt_deg, stored, printed["hand"]),
    }


def refinement_tables(stored: Stored, printed: Mapping[str, Any]) -> dict[str, pd.DataFrame]:
    """Tables of the page on refinement."""
    scores, history, search = (stored.tables[name] for name in ("refined_scores", "history", "search"))
    tables = {
        "refinement_curves": curves(history),
        "refinement_progress": progress(history),
        "refinement_costs": costs(scores),
        "refinement_cost_ratios": ratios(scores),
        "refinement_between": between(scores, stored),
        "refinement_faults": faults(history),
    }
    if stored.refined:
        own = stored.refined, stored.refined_deg
        tables["hand_roll_refined"] = hand_rolls(*own, stored, printed["hand"])
    if len(search):
        found = searches(search)
        tables |= {"search_efficiency": found, "searches": ends_of_searches(search, found)}
    return tables


def settings(scores: pd.DataFrame, tilted: bool = False) -> list[float]:
    """Rolls of the board in executions, ascending; `tilted`: without the level board."""
    return [setting for setting in np.unique(scores["setting_deg"]).tolist() if setting or not tilted]


def costs(scores: pd.DataFrame) -> pd.DataFrame:
    """Mean and std over runs of the accumulated cost, by `primitive`, `model` and `setting_deg`."""
    grouped = scores.groupby(["primitive", "model", "setting_deg"], sort=False)["cost_rad"]
    return grouped.agg(["mean", "std"]).reset_index()


def ratios(scores: pd.DataFrame) -> pd.DataFrame:
    """Accumulated cost of each model relative to each earlier model, paired by run name.

    One row per `primitive` ("all": their sum), `model`, `baseline` and `setting_deg`: columns of
    `execution_scores.cost_ratios`, and the `verdict` on the model.
    """
    tables = []
    models = combinations(scores["model"].unique(), 2)
    for name, (baseline, model) in product((*scores["primitive"].unique(), ALL), models):
        table = cost_ratios(scores if name == ALL else matching(scores, primitive=name), model, baseline)
        low, high = table["lower_rad"] - table["half_width"], table["lower_rad"] + table["half_width"]
        keys = {"primitive": name, "model": model, "baseline": baseline}
        tables.append(table.assign(**keys, verdict=verdict(low, high)))
    return pd.concat(tables, ignore_index=True)


def overall_ratio(table: pd.DataFrame, model: str, baseline: str = NOMINAL) -> pd.Series:
    """Cost ratios over all primitives by setting, from a table of `ratios`."""
    rows = matching(table, model=model, baseline=baseline, primitive=ALL)
    return rows.set_index("setting_deg")["ratio"]


def run_costs(scores: pd.DataFrame, model: str, setting_deg: float, primitive: str) -> np.ndarray:
    """Accumulated costs (R,) in rad, in the order of run names."""
    runs = matching(scores, model=model, setting_deg=setting_deg, primitive=primitive)
    return runs.sort_values("run")["cost_rad"].to_numpy()


def nominal_means(scores: pd.DataFrame) -> pd.DataFrame:
    """Means over executions without feedback, by `setting_deg` and `primitive`."""
    rows = matching(scores, model=NOMINAL).drop(columns=["run", "model"])
    return rows.groupby(["setting_deg", "primitive"]).mean().reset_index()


def demonstrated_costs(stored: Stored) -> pd.DataFrame:
    """Scores of the corrected demonstrations, see `execution_scores`."""
    corrected, cuts = stored.tilted[CORRECTED], commanded_cuts(stored.tilted[CORRECTED], stored.names)
    scored = {name: cuts[name] for name in stored.adapted}
    return execution_scores(corrected, scored, nominal_orientation(stored.unrolls), stored.axis)


def felt_counts(traces: pd.DataFrame) -> pd.Series:
    """Rms deviation from the expected trace over channels and time, in counts, by `setting_deg`.

    Executions without feedback only: on the level board it shows how much contacts vary.
    """
    nominal = matching(traces, model=NOMINAL)
    squares = nominal.filter(like="channel_").pow(2).mean(axis=1)
    return squares.groupby(nominal["setting_deg"]).mean().pow(0.5)


def coupling_steps(traces: pd.DataFrame) -> pd.DataFrame:
    """Mean coupling term of the pointwise model over each primitive, and its step between settings.

    One row per `primitive` and `setting_deg`: `mean`, `std` over runs; `step` from the next smaller setting
    with its 95 % interval `low`, `high` (Welch; runs are independent).
    """
    fed, tilts = matching(traces, model=POINTWISE), settings(traces)
    each = fed.groupby(["primitive", "setting_deg", "run"])["coupling"].mean()
    rows = []
    for name in fed["primitive"].unique():
        values = [each[name, setting] for setting in tilts]
        steps = [UNKNOWN, *(welch(above, below) for below, above in pairwise(values))]
        for setting, its, step in zip(tilts, values, steps, strict=True):
            rows.append((name, setting, its.mean(), its.std(), step.value, step.low, step.high))
    return pd.DataFrame(rows, columns=["primitive", "setting_deg", "mean", "std", "step", "low", "high"])


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


def path_comparison(path_errors: pd.DataFrame, stored: Stored) -> pd.DataFrame:
    """Errors of unrolled paths, pointwise against unrolled training, in training and other settings.

    One row per `primitive` and `seen`: `count` of demonstrations, mean and std of both models, the mean
    paired difference `lower_deg` (pointwise minus unrolled), and the `verdict` on the unrolled model.
    """
    keys = ["primitive", "setting_deg", "demonstration"]
    wide = path_errors.pivot_table("error_deg", keys, "model").reset_index()
    known = wide["setting_deg"].isin(list(stored.parameters["coupling_dataset"].settings_deg))
    rows = []
    for name, seen in product(stored.adapted, (True, False)):
        part = wide[(wide["primitive"] == name) & (known == seen)]
        if len(part):
            row: dict[str, object] = {"primitive": name, "seen": seen, "count": len(part)}
            for model in (POINTWISE, UNROLLED):
                row |= {f"{model}_deg": part[model].mean(), f"{model}_std": part[model].std()}
            lower, half_width, word = gain(part[POINTWISE] - part[UNROLLED])
            rows.append(row | {"lower_deg": lower, "half_width": half_width, "verdict": word})
    return pd.DataFrame(rows)


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


def kept(table: pd.DataFrame, primitive: str) -> int:
    """Iteration whose network is kept: fewest failures, then lowest mean cost; `table`: of `curves`."""
    return int(curve(table, primitive).sort_values(["failed", "mean"]).index[0])


def later_gain(table: pd.DataFrame, primitive: str) -> float:
    """Gain of the best iteration after `PUBLISHED_ITERATIONS`, as a share of the initial cost.

    Negative if all later iterations cost more; NaN if there are none. `table`: of `curves`.
    """
    cost = curve(table, primitive)["mean"]
    later = cost[cost.index > PUBLISHED_ITERATIONS]
    return float((cost[PUBLISHED_ITERATIONS] - later.min()) / cost[0]) if len(later) else np.nan


def progress(history: pd.DataFrame) -> pd.DataFrame:
    """Gain of each iteration, paired by run number: equal numbers meet equal conditions in all iterations.

    One row per `primitive` and `iteration` from 1: mean paired difference `lower_rad` to the previous
    iteration, and `since_lower_rad` to iteration `PUBLISHED_ITERATIONS` (NaN up to it), each with half-width
    and verdict.
    """
    rows = []
    for name in history["primitive"].unique():
        runs = matching(history, primitive=name, kind=FEEDBACK)
        wide = runs.pivot_table("cost_rad", "number", "iteration")
        for iteration in wide.columns[1:]:
            later = iteration > PUBLISHED_ITERATIONS
            since = gain(wide[PUBLISHED_ITERATIONS] - wide[iteration]) if later else (np.nan,) * 3
            rows.append((name, iteration, *gain(wide[iteration - 1] - wide[iteration]), *since))
    gained = ["lower_rad", "half_width", "verdict"]
    columns = ["primitive", "iteration", *gained, *(f"since_{part}" for part in gained)]
    return pd.DataFrame(rows, columns=columns)


def between(scores: pd.DataFrame, stored: Stored) -> pd.DataFrame:
    """Whether the cost at an unseen tilt lies between those at its neighbours.

    One row per `primitive`, `model` (before, after) and `setting_deg`: `below_deg`, `above_deg`, the nearest
    tilts; `mean`, `mean_below`, `mean_above` in rad; the `verdict` on the less favourable of both margins.
    Intervals are Welch's, since runs at different tilts are not paired.
    """
    tilts, rows = settings(scores, tilted=True), []
    for below, setting, above in zip(tilts, tilts[1:], tilts[2:], strict=False):
        unseen = stored.adapted if stored.role(setting) == "unseen" else ()
        for name, model in product(unseen, (BEFORE, AFTER)):
            found = [run_costs(scores, model, one, name) for one in (below, setting, above)]
            low, high = sorted((found[0], found[2]), key=np.mean)
            margins = welch(found[1], low), welch(high, found[1])
            ends = np.min([(one.low, one.high) for one in margins], axis=0)
            means = dict(zip(("mean_below", "mean", "mean_above"), map(np.mean, found), strict=True))
            keys = {"primitive": name, "model": model, "setting_deg": setting}
            tilts_beside = {"below_deg": below, "above_deg": above}
            rows.append({**keys, **tilts_beside, **means, "verdict": str(verdict(*ends))})
    return pd.DataFrame(rows)


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


def welch(first: np.ndarray, second: np.ndarray) -> Evidence:
    """Difference in means of two independent samples, with Welch's interval (NaN for single runs)."""
    from scipy import stats

    value, count = float(np.mean(first) - np.mean(second)), min(len(first), len(second))
    if count < 2:
        return Evidence(value, np.nan, np.nan, count)
    found = stats.ttest_ind(first, second, equal_var=False).confidence_interval()
    return Evidence(value, float(found.low), float(found.high), count)


def gain(difference: pd.Series) -> tuple[float, float, str]:
    """Mean of paired differences, half-width and verdict; pairs with a failed run are left out."""
    known = difference.dropna().to_numpy()
    lower, half_width = mean_interval(known) if len(known) else (np.nan, np.nan)
    return lower, half_width, str(verdict(lower - half_width, lower + half_width))


LOOKS = names.CUT_METHODS | names.REPRESENTATIONS | names.RUNS | names.SEARCHES | names.ROLLOUTS
WORDS: Mapping[str, Mapping[Any, str]] = {
    column: {key: look.name for key, look in LOOKS.items()}
    for column in ("method", "model", "baseline", "representation", "better", "worse", "kind")
} | {
    "left_out": {False: "all", True: "all but the held-out one"},
    "seen": {True: "learned from", False: "never learned from"},
    "stopping": {"validation": "validation", "generalization": "the held-out demonstration"},
}
"""Displayed text for each key, by column; the same names as in figures and recordings."""

DECIMALS = {
    2: "spread_mm distance_mm gain_mm low_mm high_mm mean_mm mean_deg end_deg ratio reproduction_deg "
    "roll_torque_mn_m mean_shift_ms pointwise_deg pointwise_std unrolled_deg unrolled_std std_deg norm_rad "
    "others shift_samples shift_samples_published",
    1: "mean_ms max_shift_ms max_mm max_deg difference_ms low_ms high_ms half_width_ms mean std low high "
    "step lower_rad since_lower_rad since_half_width end_roll_deg cost_rad mean_below mean_above",
    3: "end_mm smoothing_deg difference lower_deg force_n force_std_n "
    + " ".join(f"{part}_{what}" for part in PARTS for what in ("mean", "std")),
    0: "max_ms",
}
FORMATS = {name: f".{digits}f" for digits, names in DECIMALS.items() for name in names.split()}
FORMATS |= {
    "half_width": ".3g",
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
    "lower_rad": "lower by (rad)",
    "since_lower_rad": "lower than iteration 2 (rad)",
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
