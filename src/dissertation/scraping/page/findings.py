"""Findings on the scraping testbed for the sentences and claims of its three pages.

Claims and sentences generalise over people. For each person, the study `scraping/people` repeats the whole
testbed (demonstrations, sensor, corrections, models, executions and refinement), once with this project's
parameters (`OURS`) and once with a refinement as published (`PUBLISHED`). People are independent samples;
folds and executions of one person are not. The sweeps are over people of their own, in every run.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import partial
from itertools import product

import pandas as pd

from dissertation.evidence.results import Register, Results, with_study
from dissertation.evidence.studies import OURS, Study
from dissertation.evidence.variance_shares import between_share, sums_of
from dissertation.scraping.names import CUT_METHODS, REPRESENTATIONS
from dissertation.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL
from dissertation.scraping.protocol.feedback_models import LEVEL, POINTWISE, UNROLLED
from dissertation.scraping.protocol.results import (
    CONVERGED,
    DEMONSTRATED,
    LEARNED,
    LEFT_OUT,
    REFINED,
    TRAINING,
    UNSEEN,
)
from dissertation.scraping.protocol.sample_efficiency import CMA_ES, PI2
from structlearn.reporting.evidence import Evidence, geometric_mean, maximum, mean, share
from structlearn.reporting.findings import Findings
from structlearn.segmentation.alignment import AS_PRINTED, RESULT

STUDY = "scraping/people"  # behind the verdicts
PUBLISHED = "published"  # variant of the study, beside `OURS`
WHO = "person"

MODEL_PAIRS = {
    "order_of_structures": (("pmnn_100", "pmnn_0"), ("pmnn_0", "ffnn_phase"), ("ffnn_phase", "ffnn")),
    "phase_helps": (("ffnn_phase", "ffnn"),),
    "features_inside": tuple(product(("pmnn_100", "pmnn_6"), ("pca", "autoencoder"))),
    "more_nodes": (("pmnn_100", "pmnn_6"),),
}
"""Pairs (better, worse) of representations that each claim compares."""

Samples = Mapping[str, pd.Series]  # one value per person, by case


def findings(own: pd.DataFrame, study: Study | None, swept: Collection[int]) -> Findings:
    """All findings of the three pages, from this run's results and those of the study; `swept`: of sweeps."""
    ours, published = (with_study(own, study, WHO, swept, variant=form) for form in (OURS, PUBLISHED))
    find = Findings("people")
    find.exact("people", ours.results.each("cut_error", method=RESULT).size, headline=True)
    PEOPLE.evaluate(find, ours)
    REFINEMENT[OURS].evaluate(find, ours)
    nobody = replace(published, one=Results(own.iloc[:0], WHO))  # this run is not in the published form
    REFINEMENT[PUBLISHED].evaluate(find, nobody)
    return find


def by(results: Results, quantity: str, key: str, case: str = "{}", **keys: object) -> dict[str, pd.Series]:
    """Values of a quantity by the values of a key, named by `case`."""
    return {case.format(name): its for name, its in results.wide(quantity, key, **keys).items()}


def degrees(setting: float) -> str:
    """Case of a tilt, e.g. `7.5°`."""
    return f"{setting:g}°"


def share_of(holds: pd.Series) -> Evidence:
    """Share of people for whom it holds (N,)."""
    return share(int(holds.sum()), len(holds))


PEOPLE = Register()
finding = PEOPLE.finding


@finding(mean, unit="ms", headline=True)
def people_cut_error_ms(results: Results) -> pd.Series:
    """Mean cut error, over a person's demonstrations."""
    return results.each("cut_error", method=RESULT)


BEHAVIOURS = {
    "movement time": "log_movement_s",
    "cut error": "demonstration_cut_error",
    "half time": "half_correction",
    "roll error": "roll_error",
}
"""Quantities of single trials, by the name of their case."""


@finding(between_share, unit="of the variance")
def between_people(results: Results) -> dict[str, pd.DataFrame]:
    """Share between people of the variance of what they do in the same primitive or at the same tilt."""
    return {case: sums_of(results, quantity) for case, quantity in BEHAVIOURS.items()}


@finding(mean, unit="mm")
def aligned_as_printed(results: Results) -> Samples:
    """Distance from the reference gained over ordinary least squares, as printed."""
    return by(results, "alignment_gain", "primitive", method=AS_PRINTED)


@finding(mean, unit="mm")
def aligned_with_crossings(results: Results) -> Samples:
    """The same of our variant."""
    return by(results, "alignment_gain", "primitive", method=RESULT)


def cut_error_gains(results: Results) -> pd.DataFrame:
    """Error of every other method minus that of the result in ms, paired by person; columns method, level."""
    errors = results.wide("cut_error_at_noise", ["method", "level"])
    errors = errors.loc[:, errors.columns.get_level_values("level") > 0.0] if len(errors.columns) else errors
    if RESULT not in errors.columns.get_level_values(0):
        return pd.DataFrame()
    others = [one for one in CUT_METHODS if one in errors.columns.unique("method") and one != RESULT]
    return pd.concat({one: errors[one] - errors[RESULT] for one in others}, axis=1)


@finding(mean, unit="ms")
def least_cut_error(results: Results) -> Samples:
    """`cut_error_gains` by method and level."""
    return {
        f"{CUT_METHODS[method].name}, {level:g} mm": gain
        for (method, level), gain in cut_error_gains(results).items()
    }


@finding(mean, unit="ms")
def mean_cut_error(results: Results) -> Samples:
    """`cut_error_gains` by method, mean over the levels."""
    gains = cut_error_gains(results)
    names = gains.columns.unique(0) if len(gains.columns) else ()
    return {CUT_METHODS[method].name: gains[method].dropna().mean(axis=1) for method in names}


@finding(mean, unit="ms")
def less_sensitive(results: Results) -> Samples:
    """Change of the error of the crossing over thresholds, minus that of alignment."""
    errors = results.wide("cut_error_at_threshold", ["method", "level"])
    if not len(errors.columns):
        return {}
    change = {one: errors[one].max(axis=1) - errors[one].min(axis=1) for one in errors.columns.unique(0)}
    return {CUT_METHODS[one].name: change["zvc"] - change[one] for one in (AS_PRINTED, RESULT)}


@finding(mean)
def downsampling_work_g2(results: Results) -> pd.Series | None:
    """Work times g² at the factor where it is furthest from 1."""
    work = results.wide("downsampled_work", "level")
    if not len(work):
        return None
    return work.apply(lambda row: row[(row - 1.0).abs().idxmax()], axis=1)


def few_samples(method: str, results: Results) -> pd.Series | None:
    """Whether each person's cut points shift by at most one coarse sample, whatever the factor."""
    shift = results.wide("downsampled_shift", "level", method=method)
    return shift.max(axis=1) <= 1.0 if len(shift) else None


finding(share_of, name="downsampling_shift_samples_published")(partial(few_samples, AS_PRINTED))
finding(share_of, name="downsampling_shift_samples")(partial(few_samples, RESULT))


@finding(mean, unit="%")
def smooth(results: Results) -> Samples:
    """Jump of the acceleration where primitives join, relative to its largest value."""
    jumps, words = results.wide("acceleration_jump", "part"), ("as demonstrated", "new situation")
    return {name: 100.0 * jumps[one] for name, one in zip(words, jumps, strict=False)}


finding(mean, unit="mm", name="people_fit_mean_mm")(
    partial(by, quantity="position_error", key="primitive", part=TRAINING)
)
finding(mean, unit="mm", headline=("down",), name="people_left_one_out_mean_mm")(
    partial(by, quantity="position_error", key="primitive", part=LEFT_OUT)
)


def largest_end(quantity: str, results: Results) -> pd.Series | None:
    """Largest distance from the goal over demonstrations and primitives, by person."""
    errors = results.wide(quantity, "primitive", part=TRAINING)
    return errors.max(axis=1) if len(errors) else None


finding(maximum, unit="mm", name="people_fit_end_mm_largest")(partial(largest_end, "end_position_error"))
finding(maximum, unit="°", name="people_fit_end_deg_largest")(partial(largest_end, "end_orientation_error"))


def times_the_nmse(pairs: Collection[tuple[str, str]], stopping: str, results: Results) -> Samples:
    """Generalisation NMSE of the worse representation over that of the better, by primitive and pair."""
    errors = results.wide("nmse", ["primitive", "model"], stopping=stopping)
    name = {model: look.name for model, look in REPRESENTATIONS.items()}
    return {
        f"{primitive}, {name[worse]} / {name[better]}": errors[primitive, worse] / errors[primitive, better]
        for primitive in (errors.columns.unique("primitive") if len(errors.columns) else ())
        for better, worse in pairs
        if {(primitive, better), (primitive, worse)} <= set(errors.columns)
    }


for stopping, ending in (("generalization", ""), ("validation", "_validated")):
    for claim, pairs in MODEL_PAIRS.items():
        finding(geometric_mean, unit="times", name=f"{claim}{ending}")(
            partial(times_the_nmse, pairs, stopping)
        )
    finding(geometric_mean, headline=not ending, name=f"level_of_error{ending}")(
        partial(by, quantity="nmse", key="primitive", model="pmnn_100", stopping=stopping)
    )

finding(mean, name="phase_dependent")(partial(by, quantity="shared_nodes_over_phase", key="primitive"))
finding(mean, unit="rad", name="tells_tilts_apart")(
    partial(by, quantity="smallest_coupling_step", key="primitive")
)
finding(mean, unit="mN m", name="torque_monotone")(
    partial(by, quantity="smallest_torque_step", key="primitive")
)
finding(mean, unit="%", name="force_held")(lambda results: results.each("largest_force_error"))


@finding(geometric_mean)
def as_much_as_people(results: Results) -> Samples:
    """Mean coupling term of the model over that of corrections, at their largest tilt."""
    terms = results.wide("coupling", ["model", "primitive", "setting"])
    models = terms.columns.unique("model") if len(terms.columns) else ()
    if not {POINTWISE, DEMONSTRATED} <= set(models):
        return {}
    fed, theirs = terms[POINTWISE], terms[DEMONSTRATED]
    most = max(theirs.columns.unique("setting"))
    return {f"{one}, {most:g}°": fed[one, most] / theirs[one, most] for one in theirs.columns.unique(0)}


@finding(geometric_mean)
def closer_to_demonstrations(results: Results) -> Samples:
    """Distance of readings from those of demonstrations, relative to no feedback."""
    left = results.wide("deviation_left", ["primitive", "setting"])
    return {f"{primitive}, {setting:g}°": its for (primitive, setting), its in left.items()}


def costs_of(results: Results, model: str, quantity: str = "cost") -> pd.DataFrame:
    """Costs of a model in rad, a row per person; columns primitive and setting, or empty."""
    costs = results.wide(quantity, ["primitive", "setting"], model=model)
    return costs if len(costs) else pd.DataFrame(columns=pd.MultiIndex.from_product([[], []]))


def total_of(results: Results, model: str) -> pd.DataFrame:
    """The same over all primitives, a column per setting."""
    return costs_of(results, model).T.groupby(level=1).sum(min_count=1).T


@finding(geometric_mean)
def lower_cost(results: Results) -> Samples:
    """Cost with feedback over that without, by primitive and tilt."""
    left = costs_of(results, POINTWISE) / costs_of(results, NOMINAL)
    return {f"{primitive}, {setting:g}°": its for (primitive, setting), its in left.items() if setting > 0.0}


def cost_left(model: str, baseline: str, results: Results) -> Samples:
    """Cost over all primitives relative to a baseline, by tilt other than the default."""
    left = total_of(results, model) / total_of(results, baseline)
    return {degrees(setting): its for setting, its in left.items() if setting > 0.0}


finding(geometric_mean, name="kept_at_tilts")(partial(cost_left, LEVEL, POINTWISE))
finding(geometric_mean, name="in_the_unroll")(partial(cost_left, UNROLLED, POINTWISE))


def of_setting(
    measure: Callable[[pd.Series, pd.Series], pd.Series], model: str, largest: bool, results: Results
) -> pd.Series | None:
    """Measure of a model's total cost and that without feedback, on the level board or the most tilted."""
    with_feedback, without = total_of(results, model), total_of(results, NOMINAL)
    setting = max(without.columns, default=0.0) if largest else 0.0
    if setting not in with_feedback or setting not in without:
        return None
    return measure(with_feedback[setting], without[setting])


for model, ending in ((POINTWISE, ""), (LEVEL, "_ours")):
    finding(geometric_mean, headline=True, name=f"level_board{ending}")(
        partial(of_setting, pd.Series.div, model, False)
    )
    finding(mean, unit="rad", name=f"level_board_added{ending}")(
        partial(of_setting, pd.Series.sub, model, False)
    )
    finding(geometric_mean, headline=not ending, name=f"cost_left_at_largest{ending}")(
        partial(of_setting, pd.Series.div, model, True)
    )
finding(mean, unit="rad", name="saved_at_largest")(
    partial(of_setting, lambda fed, without: without - fed, POINTWISE, True)
)
finding(geometric_mean, unit="rad", name="level_cost")(
    partial(of_setting, lambda _, without: without, POINTWISE, False)
)


def refined_costs(results: Results, model: str) -> Mapping[str, pd.Series]:
    """Cost at the tilt of the refinement by primitive."""
    tilts = list(results.rows("refined_cost_ratio", part=REFINED)["setting"].unique())
    return by(results, "refined_cost", "primitive", model=model, setting=tilts)


def refined_cost_left(results: Results) -> Samples:
    """Cost after refinement over that before, at the tilt of the refinement."""
    before, after = (refined_costs(results, model) for model in (BEFORE, AFTER))
    return {primitive: after[primitive] / before[primitive] for primitive in after}


def last_gain(results: Results) -> Samples:
    """Cost of the second iteration minus that of the last, as a share of the initial cost."""
    costs = results.wide("cost_of_iteration", ["primitive", "level"])
    names = costs.columns.unique("primitive") if len(costs.columns) else ()
    by_name = {name: costs[name] for name in names}
    return {
        name: (its[CONVERGED] - its[max(its)]) / its[0]
        for name, its in by_name.items()
        if CONVERGED in its and max(its) > CONVERGED
    }


def ratios_at_tilts(results: Results, **roles: str) -> Samples:
    """Cost after refinement over that before, over all primitives, by tilt."""
    ratios = results.wide("refined_cost_ratio", "setting", **roles)
    return {degrees(setting): ratio for setting, ratio in ratios.items()}


def margins_between(models: Collection[str], results: Results) -> Samples:
    """Smaller of both distances of the cost at an unseen tilt to those at its neighbours."""
    margins = results.wide("margin_between", ["primitive", "model"])
    return {f"{one}, {model}": its for (one, model), its in margins.items() if model in models}


def places_between(models: Collection[str], results: Results) -> Samples:
    """Place of the cost at an unseen tilt between those at its neighbours: from -1 to 1.

    Its distance from their middle, relative to half of their mean difference over people.
    """
    tilts = results.rows("refined_cost_ratio").drop_duplicates("setting").set_index("setting")["part"]
    ordered, found = sorted(tilts.index), {}
    for model, below, unseen, above in (
        (model, *three)
        for model in models
        for three in zip(ordered, ordered[1:], ordered[2:], strict=False)
        if tilts[three[1]] == UNSEEN
    ):
        costs = costs_of(results, model, "refined_cost")
        for primitive in costs.columns.unique(0):
            its = costs[primitive]
            if {below, unseen, above} <= set(its):
                half = abs((its[above] - its[below]).mean()) / 2.0
                middle = (its[above] + its[below]) / 2.0
                found[f"{primitive}, {model}, {unseen:g}°"] = (its[unseen] - middle) / half
    return found


def searched(results: Results) -> Samples:
    """Cost at the end of PI2-CMA over that of CMA-ES."""
    ends = results.wide("search_cost", ["method", "primitive"])
    if not len(ends.columns):
        return {}
    return {one: ends[PI2, one] / ends[CMA_ES, one] for one in ends.columns.unique("primitive")}


def refinement(form: str) -> Register:
    """Findings on the refinement in one form, named `..._<form>`."""
    its, models = Register(), (BEFORE, AFTER) if form == PUBLISHED else (AFTER,)  # before, both are the same
    for statistic, name, samples in (
        (geometric_mean, "lower", refined_cost_left),
        (mean, "converged", partial(by, quantity="later_gain", key="primitive")),
        (mean, "last_gain", last_gain),
        (geometric_mean, "seen", partial(ratios_at_tilts, part=LEARNED)),
        (geometric_mean, "rl_cost_ratio_at_tilts", ratios_at_tilts),
        (mean, "between", partial(margins_between, models)),
        (mean, "place_between", partial(places_between, models)),
        (geometric_mean, "level_board_refined", lambda results: results.each("level_cost_ratio")),
        (geometric_mean, "search", searched),
    ):
        its.finding(statistic, headline=name == "lower", name=f"{name}_{form}")(samples)
    if form == PUBLISHED:  # before refinement both forms are the same, and cost more than after
        worst = partial(by, quantity="largest_ratio_to_nominal", key="primitive")
        its.finding(geometric_mean, name="nominal_is_worst_published")(worst)
    return its


REFINEMENT = {form: refinement(form) for form in (PUBLISHED, OURS)}
