"""Findings on learned dynamics: what sentences and claims of the page name.

n counts seeds in simulation and robots elsewhere; ratios and differences are taken in pairs. Claims of the
dissertation are decided by the published form, our form has claims of its own. Nothing follows from a model
that did not meet the criterion (`UNMET`): the dissertation trained until it was met.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import pandas as pd

from structlearn.core.params import read_values
from structlearn.reporting.claims import Evidence, Found, geometric_mean, mean, unknown
from structlearn.reporting.findings import Findings
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, STRICT, in_order, model_name
from structlearn.rigid_body.training_grid import OURS, TEXT, Form
from structlearn.testbeds.dynamics.names import IDEAL, REACH, ROBOT
from structlearn.testbeds.dynamics.protocol.scored_results import DynamicsResults

NETWORKS = ("mlp", "delan")
"""The published models without inertias."""

RIVALS = {TEXT: (*NETWORKS, "nostr", "symm"), OURS: ("mlp", "mlp_scaled", "delan", "nostr", "symm")}
"""All that are less constrained than SPD, Tri and Cov, by form."""

UNMET = "no network of this kind met the criterion"

SUFFIXES = {OURS: "", TEXT: "_plain"}
"""Of cases, by form: the published one has plain Adam and the plain loss."""

HEADLINES = (*(f"{model}_plain" for model in STRICT), "mlp", "delan", "cov")
"""Models whose epochs stand in `metrics.json`."""

Scores = Callable[[str], pd.Series]
"""Of a model, by seed or robot; empty where it was not run."""


@lru_cache
def published() -> Mapping[str, Any]:
    """What the dissertation prints, `published.yaml`."""
    return read_values(Path(__file__).with_name("published.yaml"))


def findings(results: DynamicsResults) -> Findings:
    """All of the page.

    `epochs`: to the threshold on every joint in simulation, `epochs_limit` where it was not reached.
    `ee_velocity_nmse`: of the tool's velocity in reaches; a run that had to be stopped counts at least 1, and
    as one of the `unstable` runs, sines and reaches. `robot_...`: the same of robots; `robot_nmse` on their
    logs, mean over joints. `online_nmse`: on the whole motion after one pass. `payload_settling_s_...`: over
    the `payload_settled` robots where the learned mass stays right.
    """
    find = Findings("seeds")
    robots = find.among("simulated robots")
    robots.exact("robots", results.outcomes.loc[results.outcomes["arm"] == ROBOT, "seed"].nunique())
    differences = results.agreement[["recursion_n_m", "regressor_n_m", "compiled_n_m"]].to_numpy()
    find.among("URDFs").exact(
        "rnea_max_error_nm", differences.max(), len(differences), unit="N m", headline=True
    )
    find.exact("base_parameters", results.base["parameter"].nunique())
    find.exact("epochs_limit", results.chosen["train_dynamics"].epochs.simulation)
    _models(find, robots, results)
    for form in (TEXT, OURS):
        _in_simulation(find, results, form)
        _of_robots(robots, results, form)
    _online(find, results)
    robots.mean("payload_mass_error_share", results.mass_errors)
    settled = results.settling_s.dropna()
    robots.counted("payload_settled", len(settled), len(results.settling_s))
    for name in ("median", "min", "max"):  # NaN where no robot's settled
        robots.exact(f"payload_settling_s_{name}", settled.agg(name), len(settled), unit="s")
    return find


def unmet(results: DynamicsResults, arm: str, form: Form) -> list[str]:
    """Networks that did not meet the criterion with some seed or on some robot."""
    every = {model: results.outcome(arm, model, form)["met"] for model in RIVALS[form]}
    return [model for model, met in every.items() if len(met) and not met.all()]


def _models(find: Findings, robots: Findings, results: DynamicsResults) -> None:
    """Scores of every model that was run, in both forms."""
    epochs, errors = {}, {name: results.robot_error(name) for name in results.known["model"].unique()}
    for form, suffix in SUFFIXES.items():
        epochs |= {f"{kind}{suffix}": results.outcome(IDEAL, kind, form)["epochs"] for kind in results.kinds}
        errors |= {f"{model}{suffix}": results.robot_error(model, form) for model in results.robot_models}
    find.mean("epochs", _run(epochs), headline=HEADLINES)
    robots.mean("robot_nmse", _run(errors), headline=(DEFAULT, "cov_plain", f"cov{COULOMB}_plain"))
    for robot, its, prefix in ((IDEAL, find, ""), (ROBOT, robots, "robot_")):
        tried = {
            f"{model}{'' if model in (GROUND_TRUTH, DEFAULT) else suffix}": (robot, model, form)
            for form, suffix in SUFFIXES.items()
            for model in results.tracked(robot)
        }
        velocity = _run({case: _velocity(results, *key) for case, key in tried.items()})
        marked = (GROUND_TRUTH, "cov_plain") if robot == IDEAL else ()
        its.mean(f"{prefix}ee_velocity_nmse", velocity, headline=marked)
        its.counted(f"{prefix}unstable", {case: results.stopped(*tried[case]) for case in velocity})


def _in_simulation(find: Findings, results: DynamicsResults, form: Form) -> None:
    def epochs(model: str) -> pd.Series:
        return results.outcome(IDEAL, model, form)["epochs"]

    def excess(model: str) -> pd.DataFrame:
        """NMSE in reaches above the ground truth's, of position and velocity, by seed."""
        columns = ["position_nmse", "velocity_nmse"]
        its, truth = (results.runs(IDEAL, one, REACH, form)[columns] for one in (model, GROUND_TRUTH))
        return (its - truth).dropna()

    strict = _strict(results)
    _cases(find.geometric_mean, f"epochs_{form}", {model: epochs(model) for model in strict})
    _ratios(find, f"epochs_more_{form}", epochs, RIVALS[form], strict)
    above = {model_name(model): excess(model) for model in strict}
    find.by(_largest, f"above_truth_{form}", above, missing=UNMET)
    velocity = partial(_velocity, results, IDEAL, form=form)
    _ratios(find, f"over_strict_{form}", velocity, NETWORKS if form == TEXT else RIVALS[form], strict)


def _of_robots(find: Findings, results: DynamicsResults, form: Form) -> None:
    error, velocity = partial(results.robot_error, form=form), partial(_velocity, results, ROBOT, form=form)
    strict = _strict(results)
    structured = [model for model in ("symm", *strict) if model in results.kinds]
    gains = {model: error(DEFAULT) / error(model) for model in structured}
    lacking = {model: error(model) - error(f"{model}{COULOMB}") for model in strict}
    stopped = results.runs(ROBOT, "delan", REACH, form)["stopped"] != ""
    _cases(find.geometric_mean, f"robot_gain_{form}", gains)
    _cases(find.mean, f"robot_networks_{form}", {model: error(model) for model in NETWORKS})
    if len(stopped):  # one run of each robot: trials are independent, so a plain share
        find.share(f"robot_delan_stopped_{form}", int(stopped.sum()), len(stopped))
    else:
        find.unknown(f"robot_delan_stopped_{form}", UNMET)
    _ratios(find, f"robot_mlp_{form}", velocity, ["mlp"], [DEFAULT])
    _ratios(find, f"robot_reaches_{form}", velocity, structured, [DEFAULT])
    _cases(find.mean, f"static_friction_{form}", lacking)


def _online(find: Findings, results: DynamicsResults) -> None:
    """NMSE on the whole motion of the others over that of SPD, Tri and Cov."""
    scores, strict, nothing = results.online_scores(), _strict(results), pd.Series(dtype=float)

    def course(model: str) -> pd.Series:
        return 10.0 ** scores["speed"].get(model, nothing)

    def final(model: str) -> pd.Series:
        return scores["final"].get(model, nothing)

    find.mean("online_nmse", {model: final(model) for model in in_order(scores.index.unique("model"))})
    _ratios(find, "online_course", course, RIVALS[TEXT], strict)
    _ratios(find, "online_final", final, RIVALS[TEXT], strict)
    found: dict[str, Evidence] = {}
    for when, score in (("over the course", course), ("after one pass", final)):
        ratio = _over(score, "mlp_scaled", strict).dropna()
        found[when] = geometric_mean(ratio) if len(ratio) else unknown(UNMET)
    find.add("online_scaled", found)


def _strict(results: DynamicsResults) -> list[str]:
    """Those of `STRICT` that were trained."""
    return [kind for kind in results.kinds if kind in STRICT]


def _velocity(results: DynamicsResults, arm: str, model: str, form: Form) -> pd.Series:
    """NMSE of the tool's velocity in reaches, by seed."""
    return results.runs(arm, model, REACH, form)["velocity_nmse"]


def _run(samples: Mapping[str, pd.Series]) -> Mapping[str, pd.Series]:
    """Those of models that were run."""
    return {model: its for model, its in samples.items() if len(its)}


def _cases(found: Callable[..., Found], name: str, samples: Mapping[str, pd.Series]) -> None:
    """A case per model; `UNMET` where it has no samples."""
    found(name, {model_name(model): its.dropna() for model, its in samples.items()}, missing=UNMET)


def _over(score: Scores, model: str, references: Sequence[str]) -> pd.Series:
    """Scores of a model over the geometric mean of others, by seed; NaN where one of them lacks a seed."""
    reference = 1.0
    for one in references:
        reference = reference * score(one) ** (1.0 / len(references))
    return score(model) / reference


def _ratios(
    find: Findings, name: str, score: Scores, models: Iterable[str], references: Sequence[str]
) -> None:
    """Scores of models over the geometric mean of others; a seed that only one of both has is left out."""
    _cases(find.geometric_mean, name, {model: _over(score, model, references) for model in models})


def _largest(samples: pd.DataFrame, comparisons: int) -> Evidence:
    """Mean of the column that may be the largest."""
    return max((mean(samples[column], comparisons) for column in samples), key=lambda one: one.high)
