"""Findings on the scraping testbed for the sentences and claims of its three pages.

Claims and sentences generalise over people. For each person, the study `scraping/people` repeats the whole
testbed (demonstrations, sensor, corrections, models, executions and refinement), once with this project's
parameters (`OURS`) and once as published (`PUBLISHED`). People are independent samples; folds and executions
of one person are not. Rows on the person of this run exist for the study to gather; no verdict uses them.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from dissertation.evidence.studies import OURS, People
from dissertation.scraping.names import CUT_METHODS
from dissertation.scraping.page.stored import PEOPLE, Stored, sharing_over_phase
from dissertation.scraping.page.tables import (
    Frames,
    downsampling_worst,
    kept,
    later_gain,
    overall_ratio,
    run_costs,
    settings,
)
from dissertation.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL
from dissertation.scraping.protocol.feedback_models import LEVEL, POINTWISE, REPRESENTATIONS, UNROLLED
from dissertation.scraping.protocol.sample_efficiency import CMA_ES, PI2
from structlearn.reporting.evidence import UNKNOWN, Evidence, difference, geometric_mean, largest
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import level_name
from structlearn.segmentation.alignment import METHODS, RESULT
from structlearn.segmentation.cut_errors import errors_by_seed, wins_at_every_noise_level

PUBLISHED = "published"  # variant of the study, beside `OURS`

WORDS = {POINTWISE: "feedback", "pmnn_100": "pmnn", "validation": "", "generalization": "best_step"}
"""Replacements in finding names; training steps are chosen by validation unless a name says otherwise."""

MODEL_PAIRS = {
    "order_of_structures": (("pmnn_100", "pmnn_0"), ("pmnn_0", "ffnn_phase"), ("ffnn_phase", "ffnn")),
    "phase_helps": (("ffnn_phase", "ffnn"),),
    "features_inside": tuple(
        (pmnn, other) for pmnn in ("pmnn_100", "pmnn_6") for other in ("pca", "autoencoder")
    ),
    "more_nodes": (("pmnn_100", "pmnn_6"),),
}
"""Pairs (better, worse) of representations that each claim compares."""

FIT_COLUMNS = {
    "fit": (False, ("mean_mm", "max_mm", "end_mm", "mean_deg", "end_deg")),
    "left_one_out": (True, ("mean_mm", "mean_deg")),
}
"""Whether a finding is about demonstrations left out, and its columns for each primitive."""

HEADLINES_OF_ONE: dict[str, bool | Collection[str]] = {
    "cut_error_ms": ("wls",),
    "left_one_out": ("down_mean_mm",),
    "pmnn_prim2_generalization_nmse_best_step": True,
    "pmnn_prim3_generalization_nmse_best_step": True,
    "cost_ratio_feedback_over_nominal": ("0", "10"),
    "cost_ratio_level_over_nominal": ("0", "10"),
    "rl_cost_ratio": ("prim2", "prim3"),
}
"""Headlines for comparing experiments when the study was not run with these parameters."""

Numbers = np.ndarray | None
"""(P,) one value per person; None if the study was not run or has no such finding."""


def key(primitives: Sequence[str], *parts: str | float) -> str:
    """Name of a finding, e.g. `cost_feedback_prim2_10`.

    `parts`: primitives are numbered as in the dissertation, models and representations are renamed by
    `WORDS`, settings are degrees (floats); anything else is kept.
    """
    words = {name: f"prim{number}" for number, name in enumerate(primitives, 1)} | WORDS
    texts = [words.get(part, part) if isinstance(part, str) else level_name(part) for part in parts]
    return "_".join(text for text in texts if text)


def by_key(primitives: Sequence[str], values: pd.Series | Mapping[Any, float]) -> dict[str, float]:
    """Values keyed by the finding names (`key`) of their index, which may have several levels."""
    levels = ((its if isinstance(its, tuple) else (its,), value) for its, value in values.items())
    return {key(primitives, *parts): value for parts, value in levels}


@dataclass(frozen=True)
class ScrapingPeople(People):
    """Findings of the study's people, looked up by the parts of their names."""

    primitives: Sequence[str]  # names of all primitives in temporal order

    def of(self, *parts: str | float) -> Numbers:
        """Values (P,) of the finding with this `key`."""
        return self.numbers(key(self.primitives, *parts))


def people_of(stored: Stored, form: str = OURS) -> ScrapingPeople:
    """People of the study, in one form."""
    return ScrapingPeople(stored.study, form, stored.names)


def findings(stored: Stored, frames: Frames) -> Findings:
    """All findings of the three pages; `frames`: tables of `tables.derived`."""
    people = people_of(stored)
    find = Findings(f"person {stored.parameters['scraping_people'].shown}")
    segmentation_of_one(find, stored, frames)
    feedback_of_one(find, stored, frames)
    refinement_of_one(find, stored, frames)
    if not people.count:
        find.mark(HEADLINES_OF_ONE)
    its = find.among("people", PEOPLE)
    its.exact("people", people.count or np.nan, headline=True)
    segmentation_of_people(its, people, [one.name for one in stored.found_primitives])
    feedback_of_people(its, people, stored)
    for form in (PUBLISHED, OURS):
        refinement_of_people(its, people_of(stored, form), stored)
    return find


def segmentation_of_one(find: Findings, stored: Stored, frames: Frames) -> None:
    """Add findings on cuts and primitives of the person of this run, and on the people of the sweep."""
    find.exact("demonstrations", len(stored.was_cut))
    find.exact("demonstrations_left_out", len(stored.segmentation.left_out))
    if "cut_errors" in frames:
        find.exact("cut_error_ms", frames["cut_errors"].set_index("method")["mean_ms"].to_dict())
    if "alignment" in frames:
        rows = frames["alignment"]
        rows = rows.set_index(rows["method"] + "_" + rows["primitive"])
        find.exact("spread_mm", rows["spread_mm"].to_dict())
        find.exact("alignment_gain_mm", rows["gain_mm"].to_dict())
    fit = frames["reproduction"]
    chosen = fit[fit["regression"] == stored.parameters["fit_primitives"].regression]
    for name, (left_out, columns) in FIT_COLUMNS.items():
        fitted = chosen[chosen["left_out"] == left_out].set_index("primitive")
        known = [column for column in columns if column in fitted]
        cases = {f"{row}_{column}": fitted.loc[row, column] for row in fitted.index for column in known}
        find.exact(name, cases)
    jumps = zip(("nominal", "generalised"), stored.acceleration_jumps, strict=False)
    find.exact("acceleration_jump", dict(jumps))
    sweep, swept = find.among("people of the sweep"), frames["noise_sweep"]
    cases = swept["method"] + "_" + swept["noise_mm"].map(level_name) + "mm"
    sweep.exact("sweep_cut_error_ms", swept.set_index(cases)["mean_ms"].to_dict())
    sweep.exact("wls_wins_at_every_noise_level", wins_at_every_noise_level(swept))
    least_cut_error(sweep, errors_by_seed(stored.tables["noise"]))
    worst = downsampling_worst(stored.tables["downsampling_people"])  # empty if there is only one factor
    sweep.mean("downsampling_work_g2", worst["work"])
    for column in ("shift_samples", "shift_samples_published"):
        sweep.mean(f"downsampling_{column}", worst[column])


def least_cut_error(find: Findings, errors: pd.DataFrame) -> None:
    """Add the result's paired gain in cut error over each other method, at the least clear noise level."""
    noisy = errors.query("noise_mm > 0")
    wide = noisy.pivot_table(index=["noise_mm", "seed"], columns="method", values="error_ms")
    others = [method for method in METHODS if method in wide and method != RESULT]
    comparisons = len(others) * wide.index.unique("noise_mm").size
    found = {
        CUT_METHODS[other].name: weakest(
            difference(rows[other], rows[RESULT], comparisons)
            for _, rows in wide[[other, RESULT]].dropna().groupby(level="noise_mm")
        )
        for other in others
    }
    find.add("least_cut_error", found if len(wide) else UNKNOWN)


def feedback_of_one(find: Findings, stored: Stored, frames: Frames) -> None:
    """Add findings on models and executions of the person of this run.

    `<model>_prim<number>_generalization_nmse`: mean over folds at the step chosen by validation; with the
    suffix `_best_step` at the best step for the demonstration left out, as in the dissertation.
    `cost_ratio_<model>_over_nominal_<degrees>`: over all primitives, where `feedback` is the published
    pointwise model and `level` ours. `cost_<model>_prim<number>_<degrees>`: in rad. `..._smallest_step`: from
    one tilt to the next, of the roll torque without feedback and of the pointwise model's mean coupling term.
    `shared_nodes`: how many of ten dominant nodes two phase kernels share on average.
    """
    named, cases = partial(key, stored.names), partial(by_key, stored.names)
    errors = frames["model_errors"].set_index(["primitive", "representation", "stopping"])
    for (primitive, model, stopping), error in errors["generalization_mean"].items():
        find.exact(named(model, primitive, "generalization_nmse", stopping), error)
    dominant = {one: its for one in stored.networks if (its := stored.dominant(one))}
    find.exact("shared_nodes", cases({one: its[2] for one, its in dominant.items()}))
    over_phase = {one: sharing_over_phase(its[0]) for one, its in dominant.items()}
    find.exact("shared_nodes_over_phase", cases(over_phase))
    costs = frames["board_costs"].set_index(["model", "primitive", "setting_deg"])["mean"]
    scores = stored.tables["scores"]
    for model in scores["model"].unique():
        if model != NOMINAL:
            ratios = overall_ratio(frames["board_cost_ratios"], model)
            find.exact(named("cost_ratio", model, "over_nominal"), cases(ratios))
        find.exact(named("cost", model), cases(costs[model]))
    force = scores["force_n"] / stored.parameters["testbed"].control.force_n
    find.exact("force_largest_error_percent", 100.0 * (force - 1.0).abs().max())
    keys = ["setting_deg", "primitive"]
    torque = frames["board_nominal"].set_index(keys)["roll_torque_mn_m"]
    coupling = frames["board_coupling"].set_index(keys)["mean"]
    for name, values in (("roll_torque", torque), ("coupling", coupling)):
        steps = {one: smallest_step(values.xs(one, level="primitive")) for one in stored.adapted}
        find.exact(f"{name}_smallest_step", cases(steps))


def refinement_of_one(find: Findings, stored: Stored, frames: Frames) -> None:
    """Add findings on refinement by trial of the person of this run; what was not executed is left out.

    `rl_cost_...`: at the tilt refined on, in rad; `rl_cost_ratio`: after over before. `rl_cost_ratio_at`:
    over all primitives by tilt; `seen_cost_ratio_after_over_before_max`: the largest at the training
    settings. `rl_over_nominal_max`: largest ratio to the cost without feedback over all tilts, before and
    after; `rl_over_nominal_0`: after, on the level board. `rl_between_<model>`: margin in rad by which the
    cost at an unseen tilt lies between those at its neighbouring tilts, the smaller of both sides.
    """
    named, cases = partial(key, stored.names), partial(by_key, stored.names)
    scores, history, every = (
        stored.tables["refined_scores"],
        stored.tables["history"],
        frames["refinement_curves"],
    )
    refined, tilted = history["primitive"].unique(), settings(scores, tilted=True)
    known = refined if stored.refined_deg in settings(scores) else []
    before, after = (
        {name: float(run_costs(scores, model, stored.refined_deg, name).mean()) for name in known}
        for model in (BEFORE, AFTER)
    )
    find.exact("rl_cost_before", cases(before))
    find.exact("rl_cost_after", cases(after))
    find.exact("rl_cost_ratio", cases({name: after[name] / before[name] for name in known}))
    table = frames["refinement_cost_ratios"]
    ratios = overall_ratio(table, AFTER, BEFORE)
    find.exact("rl_cost_ratio_at", cases(ratios[tilted]))
    find.exact("seen_cost_ratio_after_over_before_max", ratios[seen(stored)].max())
    over_nominal = table[(table["baseline"] == NOMINAL) & table["setting_deg"].isin(tilted)]
    largest = over_nominal.groupby("primitive")["ratio"].max()
    find.exact("rl_over_nominal_max", cases(largest[stored.adapted if tilted else []]))
    find.exact("rl_over_nominal_0", overall_ratio(table, AFTER).get(0.0, np.nan))
    between: dict[str, float] = {}
    for row in frames["refinement_between"].itertuples():
        low, high = sorted((row.mean_below, row.mean_above))
        case = named(row.model, row.primitive)
        between[case] = min(between.get(case, np.inf), row.mean - low, high - row.mean)
    find.exact("rl_between", between)
    find.exact("rl_kept_iteration", cases({name: kept(every, name) for name in refined}))
    find.exact("rl_later_gain", cases({name: later_gain(every, name) for name in refined}))
    find.exact("rl_rollouts", len(history))
    find.exact("rl_failed_rollouts", int(frames["refinement_faults"]["rollouts"].sum()))
    if "searches" in frames:
        ends = frames["searches"].set_index(["primitive", "method"])["mean"]
        for method in (PI2, CMA_ES):
            find.exact(f"search_cost_{method}", cases(ends.xs(method, level="method")))


def seen(stored: Stored) -> list[float]:
    """Settings executed in the refinement evaluation whose demonstrations the models were trained on."""
    learned = stored.parameters["refine"].settings_deg
    return [setting for setting in settings(stored.tables["refined_scores"]) if setting in learned]


def segmentation_of_people(find: Findings, people: ScrapingPeople, aligned: Sequence[str]) -> None:
    """Add the study's findings on segmentation and primitives; `aligned`: primitives that have an axis."""
    numbers = people.numbers
    for name, method in (("aligned_as_printed", "wls_published"), ("aligned_with_crossings", RESULT)):
        find.mean(name, {one: numbers(f"alignment_gain_mm_{method}_{one}") for one in aligned})
    jumps = {"as demonstrated": "nominal", "new situation": "generalised"}
    percent = {name: ratio(numbers(f"acceleration_jump_{one}"), 0.01) for name, one in jumps.items()}
    find.mean("smooth", percent)
    find.mean("people_cut_error_ms", numbers("cut_error_ms_wls"), unit="ms", headline=True)
    for name in FIT_COLUMNS:
        errors = {one: numbers(f"{name}_{one}_mean_mm") for one in people.primitives}
        headline = people.primitives[:1] if name == "left_one_out" else False
        find.mean(f"people_{name}_mean_mm", errors, unit="mm", headline=headline)
    for column in ("end_mm", "end_deg"):
        ends = [its for one in people.primitives if (its := numbers(f"fit_{one}_{column}")) is not None]
        largest = np.max(ends) if ends else np.nan
        find.exact(f"people_fit_{column}_largest", largest, people.count)


def feedback_of_people(find: Findings, people: ScrapingPeople, stored: Stored) -> None:
    """Add the study's findings on feedback models; `stored` only says what was executed.

    Names that end in `_validated` are at the step chosen by validation, others at the dissertation's choice:
    the step at which the error on the demonstration left out is lowest (IV.9.3).
    """
    of, adapted, settings_deg = people.of, stored.adapted, settings(stored.tables["scores"])
    for stopping, ending in (("generalization", ""), ("validation", "_validated")):
        nmse = {
            (model, one): of(model, one, "generalization_nmse", stopping)
            for model in REPRESENTATIONS
            for one in adapted
        }
        for name, pairs in MODEL_PAIRS.items():
            found = {}
            for one in adapted:
                both = [(nmse[worse, one], nmse[better, one]) for better, worse in pairs]
                found[one] = least_clear(difference, both, len(pairs) * len(adapted))
            find.add(f"{name}{ending}", found)
        errors = {one: nmse["pmnn_100", one] for one in adapted}
        find.mean(f"level_of_error{ending}", errors, headline=not ending)
    for name, number in (
        ("phase_dependent", "shared_nodes_over_phase"),
        ("tells_tilts_apart", "coupling_smallest_step"),
        ("torque_monotone", "roll_torque_smallest_step"),
    ):
        find.mean(name, {one: of(number, one) for one in adapted})
    find.mean("force_held", of("force_largest_error_percent"))
    tilted = [setting for setting in settings_deg if setting != 0.0]
    found = {}
    for one in adapted:
        costs = [ratio(*(of("cost", model, one, tilt) for model in (POINTWISE, NOMINAL))) for tilt in tilted]
        found[one] = share_left(costs, len(tilted) * len(adapted))
    find.add("lower_cost", found)
    over = {
        (model, tilt): of("cost_ratio", model, "over_nominal", tilt)
        for model in (POINTWISE, LEVEL, UNROLLED)
        for tilt in settings_deg
    }
    for name, model in (("kept_at_tilts", LEVEL), ("in_the_unroll", UNROLLED)):
        its = [ratio(over[model, tilt], over[POINTWISE, tilt]) for tilt in tilted]
        find.add(name, share_left(its, len(tilted)))
    largest = max(settings_deg, default=0.0)
    for ending, model in (("", POINTWISE), ("_ours", LEVEL)):
        level = [over[model, 0.0]] if 0.0 in settings_deg else []
        find.add(f"level_board{ending}", share_left(level), headline=True)
        name = f"people_{key(people.primitives, 'cost_ratio', model, 'over_nominal', largest)}"
        find.geometric_mean(name, over[model, tilted[-1]] if tilted else None, headline=not ending)


def refinement_of_people(find: Findings, people: ScrapingPeople, stored: Stored) -> None:
    """Add the study's findings on refinement in one form; `stored` only says what was executed."""
    form, of, executed = people.variant, people.of, stored.adapted
    refined = stored.tables["history"]["primitive"].unique()
    lower = {name: of("rl_cost_ratio", name) for name in refined}
    find.geometric_mean(f"lower_{form}", lower, headline=True)
    worst = {name: np.nan if its is None or not len(its) else its.max() for name, its in lower.items()}
    find.exact(f"rl_cost_ratio_worst_{form}", worst)
    find.mean(f"converged_{form}", {name: of("rl_later_gain", name) for name in refined})
    at_tilts = {
        tilt: of("rl_cost_ratio_at", tilt) for tilt in settings(stored.tables["refined_scores"], tilted=True)
    }
    find.geometric_mean(f"seen_{form}", {f"{tilt:g}°": at_tilts[tilt] for tilt in seen(stored)})
    every = {f"{tilt:g}°": its for tilt, its in at_tilts.items()}
    find.geometric_mean(f"rl_cost_ratio_at_tilts_{form}", every)
    find.geometric_mean(f"seen_cost_ratio_{form}", of("seen_cost_ratio_after_over_before_max"))
    models = (BEFORE, AFTER) if form == PUBLISHED else (AFTER,)  # before, both forms are the same
    between = {f"{name}, {model}": of("rl_between", model, name) for name in executed for model in models}
    find.mean(f"between_{form}", between)
    find.geometric_mean(f"level_board_refined_{form}", of("rl_over_nominal_0"))
    searched = {one: ratio(*(of("search_cost", method, one) for method in (PI2, CMA_ES))) for one in refined}
    find.geometric_mean(f"search_{form}", searched)
    if form == PUBLISHED:  # before refinement both forms are the same, and cost more than after
        costs = {name: of("rl_over_nominal_max", name) for name in executed}
        find.geometric_mean("nominal_is_worst_published", costs)


def ratio(first: Numbers, second: np.ndarray | float | None) -> Numbers:
    """Ratio of values by person; None if either is unknown."""
    return None if first is None or second is None else first / second


def smallest_step(values: np.ndarray) -> float:
    """Smallest step of values (N,) that should be monotonic; negative if they are not."""
    steps = np.diff(values)
    return float((np.sign(steps.sum()) * steps).min()) if len(steps) else 0.0


def least_clear(
    make: Callable[..., Evidence], samples: Iterable[Sequence[Numbers]], comparisons: int
) -> Evidence:
    """`weakest` of the evidence made from each group of samples; unknown if any sample is."""
    samples = list(samples)
    if any(one is None for its in samples for one in its):
        return UNKNOWN
    return weakest(make(*its, comparisons=comparisons) for its in samples)


def weakest(found: Iterable[Evidence]) -> Evidence:
    """Deciding evidence among several that should all be above zero.

    An unknown one, if any; otherwise the clearest of those below zero; otherwise the one with the lowest
    interval bound.
    """
    found = list(found)
    unknown = [one for one in found if not np.isfinite([one.value, one.low, one.high]).all()]
    refuted = [one for one in found if one.high <= 0.0]
    if not found or unknown:
        return unknown[0] if unknown else UNKNOWN
    return min(refuted, key=lambda one: one.high) if refuted else min(found, key=lambda one: one.low)


def share_left(ratios: Sequence[Numbers], comparisons: int = 1) -> Evidence:
    """Geometric mean over people of cost ratios (P,); of several, the largest."""
    return largest(UNKNOWN if one is None else geometric_mean(one, comparisons) for one in ratios)
