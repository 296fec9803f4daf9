"""Results of the scraping testbed: one long table (`dissertation.evidence.results`), by person.

Values are sums, means and extremes over a person's demonstrations, folds or executions. The sweeps are over
people of their own, and every value of theirs is a row.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from dissertation.evidence.results import joined_results, long_table
from dissertation.evidence.variance_shares import trial_sums
from dissertation.scraping.protocol.board_refinement import BoardRefinementParameters
from dissertation.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL, Runs, correction_scores
from dissertation.scraping.protocol.feedback_models import POINTWISE
from dissertation.scraping.protocol.phase_dependence import dominant_nodes, shared_nodes, sharing_over_phase
from structlearn.core.metrics import matching
from structlearn.core.signals import time_normalised
from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.feedback.coupling_model import CouplingModel
from structlearn.policy_search.refinement import FEEDBACK
from structlearn.primitives.fitting import reproduction_summary
from structlearn.primitives.sequence import largest_acceleration_jump
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation import cut_errors
from structlearn.segmentation.alignment import AS_PRINTED, RESULT
from structlearn.segmentation.parameters import PrimitiveParameters
from structlearn.segmentation.segments import Segmentation

KEYS: Mapping[str, type] = {
    "person": int,  # seed of the person, sensor and executions
    "primitive": str,  # empty: all together
    "setting": float,  # roll of the board in degrees
    "model": str,
    "stopping": str,  # part of the data that chose the training step
    "method": str,  # of finding cut points, or of search
    "part": str,  # of the data, or what a setting is to the refinement
    "level": float,  # of what is swept: noise in mm, factor of the threshold, factor g; or the iteration
}
TRAINING, LEFT_OUT = "training", "left out"  # demonstrations that an error of a primitive is about
LEARNED, REFINED, UNSEEN = "learned", "refined", "unseen"  # tilts, seen from the refined models
DEMONSTRATED = "demonstrated"  # model of the coupling terms that people's corrections ask for
CONVERGED = 2  # iterations after which both primitives had converged (IV.9.4.1)
FIT_ERRORS = {
    "mean_mm": ("position_error", "mm"),
    "max_mm": ("largest_position_error", "mm"),
    "end_mm": ("end_position_error", "mm"),
    "mean_deg": ("orientation_error", "deg"),
    "end_deg": ("end_orientation_error", "deg"),
}
"""Quantity and unit of the errors of `reproduction_summary`."""

SAMPLES = 101  # of normalised time, at which sensor readings are compared

Tables = Mapping[str, pd.DataFrame]
Rows = Iterator[pd.DataFrame]


def of_cuts(
    demonstrations: Sequence[Demonstration], cuts: Segmentation, primitives: Sequence[PrimitiveParameters]
) -> Rows:
    """Errors of the cut points against the true ones, and closeness of the aligned segments, by method."""
    stage = "scraping_segment"
    errors = cut_errors.mean_cut_errors_ms(cut_errors.cut_errors(demonstrations, cuts))
    yield long_table(stage, "cut_error", errors["mean_ms"], "ms")
    was_cut = [one for one in demonstrations if one.name in set(cuts.cuts["demonstration"])]
    with_axis = [one for one in primitives if one.axis != "between"]
    found = cut_errors.alignment_comparison(was_cut, cuts, with_axis).set_index(["primitive", "method"])
    yield long_table(stage, "spread", found["spread_mm"], "mm")
    yield long_table(stage, "alignment_gain", found["gain_mm"], "mm")


def of_person(
    person: int,
    demonstrations: Sequence[Demonstration],
    cuts: Segmentation,
    corrections: Runs,
    unrolls: Sequence[Demonstration],
) -> Rows:
    """How a person demonstrates and corrects, as sums over trials for `variance_shares`.

    `log_movement_s`: log of the time of a demonstration in primitives with cut points of their own.
    `demonstration_cut_error`: mean over both cut points. `half_correction` and `roll_error`: see
    `execution_scores.correction_scores`; the person corrects from the second primitive on.
    """
    stage, errors = "scraping_segment", matching(cut_errors.cut_errors(demonstrations, cuts), method=RESULT)
    found = [cuts.result(name) for name in errors["primitive"].unique()]
    times = sum(one["end_s"] - one["start_s"] for one in found)
    trials = pd.DataFrame({"person": person, "log_movement_s": np.log(times)})
    yield from trial_sums(stage, "log_movement_s", trials, "person")
    ends = 1e3 * errors[["start_error_s", "end_error_s"]].abs().mean(axis=1)
    trials = errors[["primitive"]].assign(person=person, demonstration_cut_error=ends)
    yield from trial_sums(stage, "demonstration_cut_error", trials, "person", ["primitive"], "ms")
    scores = correction_scores(corrections, unrolls, cuts.primitives, cuts.primitives[1])
    names = {"half_s": "half_correction", "roll_error_deg": "roll_error"}
    trials = scores.rename(columns=names).assign(person=person)
    for quantity, unit in (("half_correction", "s"), ("roll_error", "deg")):
        yield from trial_sums("scraping_import_corrections", quantity, trials, "person", ["setting"], unit)


def of_sweep(tables: Tables) -> Rows:
    """Cut errors by noise and by threshold, work and shift by down-sampling factor; of the sweep's people."""
    stage, who = "scraping_sweep", {"seed": "person", "noise_mm": "level", "factor": "level"}
    for name, quantity in (("noise", "cut_error_at_noise"), ("thresholds", "cut_error_at_threshold")):
        if len(tables[name]):
            each = cut_errors.errors_by_seed(tables[name].rename(columns={"factor": "noise_mm"}))
            each = each.rename(columns=who).set_index(["person", "level", "method"])["error_ms"]
            yield long_table(stage, quantity, each, "ms")
    effect = tables["downsampling_people"]
    if len(effect):
        coarse = effect["factor"] / effect["factor"].min()
        each = effect.assign(work=effect["work"] * coarse**2)[coarse > 1].rename(columns=who)
        each = each.set_index(["person", "level"])
        yield long_table(stage, "downsampled_work", each["work"])
        for column, method in (("shift_samples", RESULT), ("shift_samples_published", AS_PRINTED)):
            yield long_table(stage, "downsampled_shift", each[column], "coarse samples", method=method)


def of_primitives(tables: Tables, regression: str) -> Rows:
    """Distances of demonstrations from their primitive, and jumps of the acceleration at its ends."""
    stage = "scraping_fit_primitives"
    summary = matching(reproduction_summary(tables["reproduction"]), regression=regression)
    for left_out, part in ((False, TRAINING), (True, LEFT_OUT)):
        errors = summary[summary["left_out"] == left_out].set_index("primitive")
        for column in (one for one in FIT_ERRORS if one in errors):
            quantity, unit = FIT_ERRORS[column]
            yield long_table(stage, quantity, errors[column].dropna(), unit, part=part)
    for name in ("nominal", "generalised"):
        yield long_table(stage, "acceleration_jump", largest_acceleration_jump(tables[name]), part=name)


def of_models(tables: Tables, networks: Mapping[str, CouplingModel]) -> Rows:
    """Generalisation NMSE of the representations, mean over folds; dominant nodes of the pointwise model."""
    keys = ["primitive", "representation", "stopping"]
    errors = tables["comparison"].groupby(keys, sort=False)["generalization"].mean()
    yield long_table("scraping_compare_models", "nmse", errors.rename_axis(index={"representation": "model"}))
    for primitive, network in networks.items():
        dominant = dominant_nodes(network)
        if dominant is not None:
            of_network = {"stage": "scraping_train_feedback", "primitive": primitive}
            shared = float(shared_nodes(dominant)[0].mean())
            yield long_table(quantity="shared_nodes", values=shared, **of_network)
            over_phase = sharing_over_phase(dominant)
            yield long_table(quantity="shared_nodes_over_phase", values=over_phase, **of_network)


def of_executions(tables: Tables, datasets: Mapping[str, CouplingDataset], force_n: float) -> Rows:
    """Costs of executions, and what the model does and feels, means over executions."""
    stage, scores = "scraping_evaluate_feedback", _by_setting(tables["scores"])
    yield long_table(stage, "cost", mean_costs(tables["scores"]), "rad")
    error = 100.0 * (scores["force_n"] / force_n - 1.0).abs().max()
    yield long_table(stage, "largest_force_error", error, "%")
    nominal = matching(scores, model=NOMINAL).groupby(["primitive", "setting"], sort=False)
    torque = nominal["roll_torque_mn_m"].mean()
    yield long_table(stage, "smallest_torque_step", _smallest_steps(torque), "mN m")
    fed = _by_setting(matching(tables["traces"], model=POINTWISE))
    each = fed.groupby(["primitive", "setting", "run"], sort=False)["coupling"].mean()
    coupling = each.groupby(["primitive", "setting"], sort=False).mean()
    yield long_table(stage, "smallest_coupling_step", _smallest_steps(coupling), "rad")
    yield long_table(stage, "coupling", coupling, "rad", model=POINTWISE)
    for name in scores["primitive"].unique():
        keys = {"stage": stage, "primitive": name}
        yield long_table(
            quantity="coupling", values=_mean_targets(datasets[name]), unit="rad", model=DEMONSTRATED, **keys
        )
        left = deviations_left(tables["traces"], name, datasets[name])
        yield long_table(quantity="deviation_left", values=left, **keys)


def of_refinement(tables: Tables, parameters: BoardRefinementParameters) -> Rows:
    """Costs by iteration, before and after refinement, and relative to each other and to no feedback."""
    history = matching(tables["history"], kind=FEEDBACK).rename(columns={"iteration": "level"})
    curves = history.groupby(["primitive", "level"], sort=False)["cost_rad"].mean()
    yield long_table("scraping_refine", "cost_of_iteration", curves, "rad")
    wide = _wide(curves, "level")
    later = wide.loc[:, wide.columns > CONVERGED].min(axis=1)
    if later.notna().any():
        yield long_table("scraping_refine", "later_gain", (wide[CONVERGED] - later) / wide[0])
    stage, costs = "scraping_evaluate_refinement", mean_costs(tables["refined_scores"])
    yield long_table(stage, "refined_cost", costs, "rad")
    total = _wide(costs.groupby(["setting", "model"]).sum(), "model")
    if 0.0 in total.index:
        level = total.loc[0.0, AFTER] / total.loc[0.0, NOMINAL]
        yield long_table(stage, "level_cost_ratio", level)
    total = total[total.index > 0.0]
    for setting, ratio in (total[AFTER] / total[BEFORE]).items():
        role = role_of(float(setting), parameters)
        yield long_table(stage, "refined_cost_ratio", ratio, setting=setting, part=role)
    tilted = _wide(costs[costs.index.get_level_values("setting") > 0.0], "model")
    over = tilted[[BEFORE, AFTER]].div(tilted[NOMINAL], axis=0).max(axis=1)
    yield long_table(stage, "largest_ratio_to_nominal", over.groupby("primitive", sort=False).max())
    margins = _margins_between(costs, parameters)
    if len(margins):
        yield long_table(stage, "margin_between", margins, "rad")


def of_searches(tables: Tables) -> Rows:
    """Cost of the mean policy at the end of the searches; none of a search whose last mean policy failed."""
    trials = tables["search"]
    if len(trials):
        ends = trials.groupby(["primitive", "method", "seed"], sort=False).tail(1)
        costs = ends.groupby(["primitive", "method"], sort=False)["cost_rad"].agg(_mean_of_all)
        yield long_table("scraping_compare_search", "search_cost", costs.dropna(), "rad")


def mean_costs(scores: pd.DataFrame) -> pd.Series:
    """Mean accumulated cost of executions in rad, by `primitive`, `model` and `setting`."""
    return _by_setting(scores).groupby(["primitive", "model", "setting"], sort=False)["cost_rad"].mean()


def role_of(setting_deg: float, parameters: BoardRefinementParameters) -> str:
    """How the refined models relate to a tilt, in one word."""
    if setting_deg == parameters.setting_deg:
        return REFINED
    return LEARNED if setting_deg in parameters.settings_deg else UNSEEN


def deviations_left(traces: pd.DataFrame, primitive: str, dataset: CouplingDataset) -> pd.Series:
    """Distance of the readings with feedback from those of corrected demonstrations, by setting.

    Rms over channels and normalised time between the mean deviations, relative to the distance without
    feedback (figure IV.18, bottom).
    """
    channels = [name for name in traces if name.startswith("channel_")]
    own, found = traces[traces["primitive"] == primitive], {}
    for setting in np.unique(dataset.setting):
        here = dataset.setting == setting
        theirs = pd.DataFrame(dataset.deviation[here], columns=channels)
        meant = _mean_over_time(theirs.groupby(dataset.demonstration[here]))
        runs = own[own["setting_deg"] == setting]
        by_model = {
            model: _mean_over_time(matching(runs, model=model).groupby("run")[channels])
            for model in (NOMINAL, POINTWISE)
        }
        with_feedback, without = (
            np.sqrt(np.mean((by_model[model] - meant) ** 2)) for model in (POINTWISE, NOMINAL)
        )
        found[float(setting)] = with_feedback / without
    return pd.Series(found).rename_axis("setting")


def _mean_over_time(runs: "pd.api.typing.DataFrameGroupBy") -> np.ndarray:
    return np.mean([time_normalised(run.to_numpy(), SAMPLES) for _, run in runs], axis=0)


def _wide(values: pd.Series, column: str) -> pd.DataFrame:
    """One column per value of a level of the index; its other levels stay."""
    others = [name for name in values.index.names if name != column]
    return values.rename("value").reset_index().pivot_table("value", others, column, sort=False)


def _by_setting(table: pd.DataFrame) -> pd.DataFrame:
    return table.rename(columns={"setting_deg": "setting"})


def _mean_of_all(costs: pd.Series) -> float:
    return float(costs.mean(skipna=False))


def _mean_targets(dataset: CouplingDataset) -> pd.Series:
    """Mean coupling target over the demonstrations, by `setting`."""
    each = pd.Series(dataset.target).groupby([dataset.setting, dataset.demonstration]).mean()
    return each.groupby(level=0).mean().rename_axis("setting")


def _smallest_steps(values: pd.Series) -> pd.Series:
    """Smallest step by `primitive` from `setting` to setting; negative if not monotonic."""

    def smallest(its: pd.Series) -> float:
        steps = np.diff(its.droplevel("primitive").sort_index(kind="stable"))
        return float((np.sign(steps.sum()) * steps).min()) if len(steps) else 0.0

    return values.groupby("primitive", sort=False).apply(smallest)


def _margins_between(costs: pd.Series, parameters: BoardRefinementParameters) -> pd.Series:
    """Distance by which costs at an unseen tilt lie between those at its neighbours, by `primitive`, `model`.

    The smallest over both neighbours and all unseen tilts; negative if some cost does not lie between.
    """
    wide = _wide(costs[costs.index.get_level_values("setting") > 0.0], "setting").sort_index(
        axis=1, kind="stable"
    )
    tilts, found = list(wide.columns), []
    for below, tilt, above in zip(tilts, tilts[1:], tilts[2:], strict=False):
        if role_of(tilt, parameters) == UNSEEN:
            ends = wide[[below, above]]
            sides = [wide[tilt] - ends.min(axis=1), ends.max(axis=1) - wide[tilt]]
            found.append(pd.concat(sides, axis=1).min(axis=1))
    if not found:
        return pd.Series(dtype=float)
    return pd.concat(found, axis=1).min(axis=1).drop(NOMINAL, level="model", errors="ignore")


def scraping_results(person: int, parts: Sequence[Rows], sweep: Rows) -> pd.DataFrame:
    """Table of results of a person (`parts`) and of the sweep's people."""
    own = [rows.assign(person=person) for part in parts for rows in part]
    return joined_results([*own, *sweep], KEYS)
