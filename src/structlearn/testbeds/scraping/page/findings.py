"""Findings of the three scraping pages: what their sentences and claims name.

Claims and sentences are over people. For each the whole branch was run anew, demonstrations, sensor,
corrections, models, executions and refinement, by the study `scraping/people`, once with the parameters as
they are (`OURS`) and once as in the text (`TEXT`). So people are independent, which folds and executions of
one person are not. Rows of the person of this run are what the study gathers; they decide nothing.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from structlearn.policy_search.sample_efficiency import CMA_ES, PI2
from structlearn.reporting.claims import UNKNOWN, Evidence, difference, mean
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import level_name
from structlearn.reporting.studies import People, Study
from structlearn.segmentation.alignment import METHODS, RESULT
from structlearn.segmentation.cut_errors import errors_by_seed, wins_at_every_noise_level
from structlearn.testbeds.scraping.names import CUT_METHODS
from structlearn.testbeds.scraping.page.execution_results import ALL
from structlearn.testbeds.scraping.page.feedback_results import (
    MODEL_KEYS,
    REPRESENTATION_KEYS,
    STEP_KEYS,
    FeedbackResults,
    sharing_over_phase,
)
from structlearn.testbeds.scraping.page.refinement_results import RefinementResults
from structlearn.testbeds.scraping.page.segmentation_results import SegmentationResults
from structlearn.testbeds.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL

STUDY = "scraping/people"
OURS, TEXT = "ours", "text"  # variants of the study

MODEL_PAIRS = {
    "order_of_structures": (("pmnn_100", "pmnn_0"), ("pmnn_0", "ffnn_phase"), ("ffnn_phase", "ffnn")),
    "phase_helps": (("ffnn_phase", "ffnn"),),
    "features_inside": tuple(
        (pmnn, other) for pmnn in ("pmnn_100", "pmnn_6") for other in ("pca", "autoencoder")
    ),
    "more_nodes": (("pmnn_100", "pmnn_6"),),
}
"""Pairs (better, worse) of representations that a claim is made of."""

VALIDATED = "_validated"
"""Ends the names of findings at the step that validation chose; else it is the dissertation's."""

FIT_COLUMNS = {
    "fit": (False, ("mean_mm", "max_mm", "end_mm", "mean_deg", "end_deg")),
    "left_one_out": (True, ("mean_mm", "mean_deg")),
}
"""By name: whether of demonstrations left out, and what is found of each primitive."""

HEADLINES_OF_ONE: dict[str, bool | Collection[str]] = {
    "cut_error_ms": ("wls",),
    "left_one_out": ("down_mean_mm",),
    "pmnn_prim2_generalization_nmse_best_step": True,
    "pmnn_prim3_generalization_nmse_best_step": True,
    "cost_ratio_feedback_over_nominal": ("0", "10"),
    "cost_ratio_level_over_nominal": ("0", "10"),
    "rl_cost_ratio": ("prim2", "prim3"),
}
"""Where people were not studied with these parameters: by these one compares experiments."""

Numbers = np.ndarray | None
"""(P,) one per person; None where the study was not run, or kept no such number."""


@dataclass(frozen=True)
class ScrapingPeople(People):
    """Numbers of the study's people, also by primitive, model and setting."""

    primitives: Sequence[str]  # names of all primitives in order of time

    def of(self, key: str, primitive: str) -> Numbers:
        """Of a primitive: `rl_cost_ratio_prim2`, counted as in the dissertation."""
        return self.numbers(f"{key}_{prim(primitive, self.primitives)}")

    def nmse(self, representation: str, primitive: str, stopping: str = "generalization") -> Numbers:
        """Generalisation NMSE, mean over folds; `stopping` is of `representation_orderings.STOPPINGS`.

        The default is the dissertation's: the step at which this very error is lowest (IV.9.3).
        """
        return self.numbers(nmse_key(representation, prim(primitive, self.primitives), stopping))

    def cost(self, model: str, primitive: str, setting_deg: float) -> Numbers:
        """Accumulated cost in rad, mean over executions."""
        number = prim(primitive, self.primitives)
        return self.numbers(f"cost_{MODEL_KEYS[model]}_{number}_{level_name(setting_deg)}")

    def over_nominal(self, model: str, setting_deg: float) -> Numbers:
        """Accumulated cost of all primitives relative to that without feedback."""
        return self.numbers(f"cost_ratio_{MODEL_KEYS[model]}_over_nominal_{level_name(setting_deg)}")


def prim(name: str, primitives: Sequence[str]) -> str:
    """`prim2`."""
    return f"prim{list(primitives).index(name) + 1}"


def nmse_key(representation: str, number: str, stopping: str) -> str:
    """`pmnn_prim2_generalization_nmse_best_step`."""
    return f"{REPRESENTATION_KEYS[representation]}_{number}_generalization_nmse{STEP_KEYS[stopping]}"


def findings(
    segmentation: SegmentationResults,
    feedback: FeedbackResults,
    refinement: RefinementResults,
    study: Study | None,
    person: int,
) -> Findings:
    """All of the three pages; `study` over people, None where not run; `person`: seed of that of this run."""
    find, primitives = Findings(f"person {person}"), feedback.primitives
    segmentation_of_one(find, segmentation)
    feedback_of_one(find, feedback)
    refinement_of_one(find, refinement, primitives)
    people = ScrapingPeople(study, OURS, primitives)
    if not people.count:
        find.mark(HEADLINES_OF_ONE)
    its = find.among("people", STUDY)
    its.exact("people", people.count or np.nan, headline=True)
    segmentation_of_people(its, people, [one.name for one in segmentation.found_primitives])
    feedback_of_people(its, people, feedback.adapted, feedback.board.settings_deg)
    for form in (TEXT, OURS):
        refinement_of_people(its, ScrapingPeople(study, form, primitives), refinement)
    return find


def segmentation_of_one(find: Findings, results: SegmentationResults) -> None:
    """Rows of cuts and primitives; what the sweep decides is over other people than those of the study."""
    find.exact("demonstrations", len(results.was_cut))
    find.exact("demonstrations_left_out", len(results.segmentation.left_out))
    if (errors := results.errors_of_cuts) is not None:
        find.exact("cut_error_ms", dict(zip(errors["method"], errors["mean_ms"], strict=True)))
    if (rows := results.alignment) is not None:
        cases = rows["method"] + "_" + rows["primitive"]
        find.exact("spread_mm", dict(zip(cases, rows["spread_mm"], strict=True)))
        find.exact("alignment_gain_mm", dict(zip(cases, rows["gain_mm"], strict=True)))
    for name, (left_out, columns) in FIT_COLUMNS.items():
        fitted = results.fitted(left_out).set_index("primitive")
        known = [column for column in columns if column in fitted]
        cases = {f"{row}_{column}": fitted.loc[row, column] for row in fitted.index for column in known}
        find.exact(name, cases)
    jumps = results.acceleration_jumps.values()
    find.exact("acceleration_jump", dict(zip(("nominal", "generalised"), jumps, strict=False)))
    sweep, swept = find.among("people of the sweep"), results.sweep
    cases = swept["method"] + "_" + swept["noise_mm"].map(level_name) + "mm"
    sweep.exact("sweep_cut_error_ms", dict(zip(cases, swept["mean_ms"], strict=True)))
    sweep.exact("wls_wins_at_every_noise_level", wins_at_every_noise_level(swept))
    least_cut_error(sweep, results)
    worst = results.downsampling_worst  # empty of one factor g
    sweep.mean("downsampling_work_g2", worst["work"])
    sweep.mean("downsampling_shift_samples", worst["shift_samples"])
    sweep.mean("downsampling_shift_samples_text", worst["shift_samples_text"])


def least_cut_error(find: Findings, results: SegmentationResults) -> None:
    """How much better the result's cuts are than each other method's, in pairs, at the least clear level."""
    wide = errors_by_seed(results.noise).pivot_table(
        index=["noise_mm", "seed"], columns="method", values="error_ms"
    )
    wide = wide[wide.index.get_level_values("noise_mm") > 0]
    levels = wide.index.unique("noise_mm")
    others = [method for method in METHODS if method in wide and method != RESULT]
    found = {
        CUT_METHODS[other].name: weakest(
            difference(rows[other], rows[RESULT], comparisons=len(others) * len(levels))
            for _, rows in wide[[other, RESULT]].dropna().groupby(level="noise_mm")
        )
        for other in others
    }
    find.add("least_cut_error", found if len(wide) else UNKNOWN)


def feedback_of_one(find: Findings, results: FeedbackResults) -> None:
    """Rows of models and executions.

    `<model>_prim<number>_generalization_nmse` is the mean over folds at the step that validation chose, with
    the suffix `_best_step` at the best step for the demonstration left out, as in the dissertation.
    `cost_ratio_<model>_over_nominal_<degrees>` is of all primitives, `feedback` being the pointwise model of
    the text and `level` ours; `cost_<model>_prim<number>_<degrees>` is in rad. Smallest steps are from tilt
    to tilt, of the roll torque without feedback and of the pointwise model's mean coupling term.
    `shared_nodes`: how many of ten dominant nodes any two phase kernels share.
    """

    def number(name: str) -> str:
        return prim(name, results.primitives)

    for row in results.model_errors.itertuples():
        key = nmse_key(row.representation, number(row.primitive), row.stopping)
        find.exact(key, row.generalization_mean)
    dominant = {number(one): its for one in results.networks if (its := results.dominant(one))}
    find.exact("shared_nodes", {name: its[2] for name, its in dominant.items()})
    over_phase = {name: sharing_over_phase(its[0]) for name, its in dominant.items()}
    find.exact("shared_nodes_over_phase", over_phase)
    board = results.board
    for model in board.models:
        if model != NOMINAL:
            ratios = board.ratio(model)["ratio"].items()
            name = f"cost_ratio_{MODEL_KEYS[model]}_over_nominal"
            find.exact(name, {level_name(setting): ratio for setting, ratio in ratios})
        rows = board.costs[board.costs["model"] == model].itertuples()
        costs = {f"{number(row.primitive)}_{level_name(row.setting_deg)}": row.mean for row in rows}
        find.exact(f"cost_{MODEL_KEYS[model]}", costs)
    find.exact("force_largest_error_percent", board.force_error_percent)
    for place, name in enumerate(("roll_torque_smallest_step", "coupling_smallest_step")):
        find.exact(name, {number(one): steps[place] for one, steps in board.smallest_steps.items()})


def refinement_of_one(find: Findings, results: RefinementResults, primitives: Sequence[str]) -> None:
    """Rows of refinement by trial; what was not executed is left out.

    `rl_cost_...` is at the tilt refined on, in rad, `rl_cost_ratio` after over before; `rl_cost_ratio_at` is
    of all primitives at any tilt, `seen_cost_ratio_after_over_before_max` the largest at the settings learned
    from. `rl_over_nominal_max`: largest ratio to the cost without feedback over all tilts, before and after;
    `rl_over_nominal_0`: after, on the level board. `rl_between_<model>`: by how many rad a tilt never seen
    costs more than the cheaper and less than the dearer of its neighbours, whichever is less.
    """

    def by_number(value: Callable[[str], float], names: Sequence[str]) -> dict[str, float]:
        return {prim(name, primitives): value(name) for name in names}

    def cost(model: str, name: str) -> float:
        return float(results.run_costs(model, results.example_deg, name).mean())

    refined = results.refined if results.evaluated else []
    find.exact("rl_cost_before", by_number(lambda name: cost(BEFORE, name), refined))
    find.exact("rl_cost_after", by_number(lambda name: cost(AFTER, name), refined))
    find.exact("rl_cost_ratio", by_number(lambda name: cost(AFTER, name) / cost(BEFORE, name), refined))
    ratios = results.ratio(AFTER, BEFORE, ALL)["ratio"]
    find.exact("rl_cost_ratio_at", {level_name(tilt): ratios[tilt] for tilt in results.tilted_deg})
    seen = ratios[results.seen_deg].max() if results.seen_deg else np.nan
    find.exact("seen_cost_ratio_after_over_before_max", seen)

    def over_nominal(name: str) -> float:
        its = [results.ratio(one, NOMINAL, name)["ratio"][results.tilted_deg] for one in (BEFORE, AFTER)]
        return max(float(ratio.max()) for ratio in its)

    executed = results.primitives if results.tilted_deg else []
    find.exact("rl_over_nominal_max", by_number(over_nominal, executed))
    level = results.ratio(AFTER)["ratio"].get(0.0, np.nan)
    find.exact("rl_over_nominal_0", level)
    between: dict[str, float] = {}
    for row in results.between.itertuples():
        low, high = sorted((row.mean_below, row.mean_above))
        key = f"{row.model}_{prim(row.primitive, primitives)}"
        between[key] = min(between.get(key, np.inf), row.mean - low, high - row.mean)
    find.exact("rl_between", between)
    find.exact("rl_kept_iteration", by_number(results.kept.__getitem__, results.refined))
    find.exact("rl_later_gain", by_number(results.later_gain, results.refined))
    find.exact("rl_rollouts", len(results.history))
    find.exact("rl_failed_rollouts", int(results.faults["rollouts"].sum()))
    for method in (PI2, CMA_ES) if results.searched_primitives else ():
        ends = results.searched["mean"].xs(method, level="method")
        numbers = {prim(name, primitives): cost for name, cost in ends.items()}
        find.exact(f"search_cost_{method}", numbers)


def segmentation_of_people(find: Findings, people: ScrapingPeople, aligned: Sequence[str]) -> None:
    """Of the page on segmentation and primitives; `aligned` are the primitives that have an axis."""
    numbers = people.numbers
    for name, method in (("aligned_as_printed", "wls_text"), ("aligned_with_crossings", RESULT)):
        find.mean(name, {one: numbers(f"alignment_gain_mm_{method}_{one}") for one in aligned})
    jumps = {"as demonstrated": "nominal", "new situation": "generalised"}
    find.mean(
        "smooth", {name: ratio(numbers(f"acceleration_jump_{key}"), 0.01) for name, key in jumps.items()}
    )
    find.mean("people_cut_error_ms", numbers("cut_error_ms_wls"), unit="ms", headline=True)
    for name in FIT_COLUMNS:
        errors = {one: numbers(f"{name}_{one}_mean_mm") for one in people.primitives}
        headline = people.primitives[:1] if name == "left_one_out" else False
        find.mean(f"people_{name}_mean_mm", errors, unit="mm", headline=headline)
    for column in ("end_mm", "end_deg"):
        ends = [its for one in people.primitives if (its := numbers(f"fit_{one}_{column}")) is not None]
        largest = np.max(ends) if ends else np.nan
        find.exact(f"people_fit_{column}_largest", largest, people.count)


def feedback_of_people(
    find: Findings, people: ScrapingPeople, adapted: Sequence[str], settings_deg: Sequence[float]
) -> None:
    """Of the page on feedback models; `settings_deg`: rolls of the board on which models were executed."""
    for stopping, ending in (("generalization", ""), ("validation", VALIDATED)):
        for name, pairs in MODEL_PAIRS.items():
            found = {}
            for one in adapted:
                both = [[people.nmse(model, one, stopping) for model in reversed(pair)] for pair in pairs]
                found[one] = least_clear(difference, both, len(pairs) * len(adapted))
            find.add(f"{name}{ending}", found)
        errors = {one: people.nmse("pmnn_100", one, stopping) for one in adapted}
        find.mean(f"level_of_error{ending}", errors, headline=not ending)
    for name, key in (
        ("phase_dependent", "shared_nodes_over_phase"),
        ("tells_tilts_apart", "coupling_smallest_step"),
        ("torque_monotone", "roll_torque_smallest_step"),
    ):
        find.mean(name, {one: people.of(key, one) for one in adapted})
    find.mean("force_held", people.numbers("force_largest_error_percent"))
    tilted = [setting for setting in settings_deg if setting != 0.0]
    found = {}
    for one in adapted:
        costs = [(people.cost("pointwise", one, tilt), people.cost(NOMINAL, one, tilt)) for tilt in tilted]
        found[one] = share_left([ratio(*its) for its in costs], len(tilted) * len(adapted))
    find.add("lower_cost", found)
    for name, model in (("kept_at_tilts", "level"), ("in_the_unroll", "unrolled")):
        its = [[people.over_nominal(one, tilt) for one in (model, "pointwise")] for tilt in tilted]
        find.add(name, share_left([ratio(*both) for both in its], len(tilted)))
    largest = level_name(max(settings_deg, default=0.0))
    for ending, model in (("", "pointwise"), ("_ours", "level")):
        level = [people.over_nominal(model, 0.0)] if 0.0 in settings_deg else []
        find.add(f"level_board{ending}", share_left(level), headline=True)
        tilt = people.over_nominal(model, tilted[-1]) if tilted else None
        name = f"people_cost_ratio_{MODEL_KEYS[model]}_over_nominal_{largest}"
        find.geometric_mean(name, tilt, headline=not ending)


def refinement_of_people(find: Findings, people: ScrapingPeople, results: RefinementResults) -> None:
    """Of the page on refinement, in one form; `results` say what was executed and decide nothing."""
    form, refined, executed = people.variant, results.refined, results.primitives
    lower = {name: people.of("rl_cost_ratio", name) for name in refined}
    find.geometric_mean(f"lower_{form}", lower, headline=True)
    worst = {name: np.nan if its is None or not len(its) else its.max() for name, its in lower.items()}
    find.exact(f"rl_cost_ratio_worst_{form}", worst)
    find.mean(f"converged_{form}", {name: people.of("rl_later_gain", name) for name in refined})
    at_tilts = {
        f"{tilt:g}°": people.numbers(f"rl_cost_ratio_at_{level_name(tilt)}") for tilt in results.tilted_deg
    }
    seen = [f"{tilt:g}°" for tilt in results.seen_deg]
    find.geometric_mean(f"seen_{form}", {tilt: at_tilts[tilt] for tilt in seen})
    find.geometric_mean(f"rl_cost_ratio_at_tilts_{form}", at_tilts)
    largest = people.numbers("seen_cost_ratio_after_over_before_max")
    find.geometric_mean(f"seen_cost_ratio_{form}", largest)
    models = (BEFORE, AFTER) if form == TEXT else (AFTER,)  # before, both forms are the same
    between = {
        f"{name}, {model}": people.of(f"rl_between_{model}", name) for name in executed for model in models
    }
    find.mean(f"between_{form}", between)
    find.geometric_mean(f"level_board_refined_{form}", people.numbers("rl_over_nominal_0"))
    searched = {one: [people.of(f"search_cost_{method}", one) for method in (PI2, CMA_ES)] for one in refined}
    find.geometric_mean(f"search_{form}", {one: ratio(*costs) for one, costs in searched.items()})
    if form == TEXT:  # before refinement both forms are the same, and cost more than after
        costs = {name: people.of("rl_over_nominal_max", name) for name in executed}
        find.geometric_mean("nominal_is_worst_text", costs)


def ratio(first: Numbers, second: np.ndarray | float | None) -> Numbers:
    """Of numbers by person; None where one of both is not known."""
    return None if first is None or second is None else first / second


def least_clear(
    make: Callable[..., Evidence], samples: Iterable[Sequence[Numbers]], comparisons: int
) -> Evidence:
    """`weakest` of several numbers, each from some samples; not known where a sample is not."""
    samples = list(samples)
    if any(one is None for its in samples for one in its):
        return UNKNOWN
    return weakest(make(*its, comparisons=comparisons) for its in samples)


def weakest(found: Iterable[Evidence]) -> Evidence:
    """Of several numbers that all should be above zero the one that decides.

    That is one that is not known; else the clearest of those that are below zero; else that whose interval
    reaches lowest.
    """
    found = list(found)
    unknown = [one for one in found if not np.isfinite([one.value, one.low, one.high]).all()]
    refuted = [one for one in found if one.high <= 0.0]
    if not found or unknown:
        return unknown[0] if unknown else UNKNOWN
    return min(refuted, key=lambda one: one.high) if refuted else min(found, key=lambda one: one.low)


def share_left(ratios: Sequence[Numbers], comparisons: int = 1) -> Evidence:
    """Geometric mean over people of the ratio of costs (P,), of several the one least clearly below 1."""
    logs = [[None if one is None else -np.log(one)] for one in ratios]
    saved = least_clear(mean, logs, comparisons)
    value, low, high = (float(np.exp(-one)) for one in (saved.value, saved.high, saved.low))
    return Evidence(value, low, high, saved.n)
