"""Evidence for the claims on learned dynamics.

Differences and ratios are taken in pairs: in simulation seed by seed, on robots robot by robot. The
dissertation's claims are decided by the published form; results of our form have separate claims. Of a
model that did not meet the criterion nothing follows (`UNMET`): the text trained until it was met.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import pandas as pd

from structlearn.core.artefacts import Metrics
from structlearn.core.params import read_values
from structlearn.reporting.claims import Evidence, Found, by_case, exact, geometric_mean, mean, share, unknown
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, STRICT, in_order, model_name
from structlearn.rigid_body.training_grid import OURS, TEXT, Form
from structlearn.testbeds.dynamics.names import IDEAL, REACH, ROBOT
from structlearn.testbeds.dynamics.protocol.scored_results import DynamicsResults

NETWORKS = ("mlp", "delan")
"""The published models without inertias."""

RIVALS = {TEXT: (*NETWORKS, "nostr", "symm"), OURS: ("mlp", "mlp_scaled", "delan", "nostr", "symm")}
"""All that are less constrained than SPD, Tri and Cov, by form."""

UNMET = unknown("no network of this kind met the criterion")
"""Of models that were not put to the test."""

Scores = Callable[[str], pd.Series]
"""Of a model, by seed."""


def evidence(results: DynamicsResults) -> dict[str, Found]:
    """By the names of `claims.yaml`."""
    found: dict[str, Found] = {
        "agreement": exact(results.largest_disagreement, len(results.agreement)),
        "payload": mean(results.mass_errors),
    }
    for form in (TEXT, OURS):
        its = _in_simulation(results, form) | _of_robots(results, form)
        found |= {f"{name}_{form}": its[name] for name in its}
    return found | _online(results)


def unmet(results: DynamicsResults, arm: str, form: Form) -> list[str]:
    """Networks that did not meet the criterion with some seed or on some robot."""
    every = {model: results.outcome(arm, model, form)["met"] for model in RIVALS[form]}
    return [model for model, met in every.items() if len(met) and not met.all()]


def _in_simulation(results: DynamicsResults, form: Form) -> dict[str, Found]:
    def epochs(model: str) -> pd.Series:
        return results.outcome(IDEAL, model, form)["epochs"]

    def velocity(model: str) -> pd.Series:
        return results.velocity(IDEAL, model, form)

    strict = results.strict
    tracked_rivals = NETWORKS if form == TEXT else RIVALS[form]
    return {
        "epochs": _cases(geometric_mean, {model: epochs(model) for model in strict}),
        "epochs_more": _ratios(epochs, RIVALS[form], strict),
        "above_truth": _cases(_largest, {model: _excess(results, model, form) for model in strict}),
        "over_strict": _ratios(velocity, tracked_rivals, strict),
    }


def _of_robots(results: DynamicsResults, form: Form) -> dict[str, Found]:
    def error(model: str) -> pd.Series:
        return results.robot_error(model, form)

    def velocity(model: str) -> pd.Series:
        return results.velocity(ROBOT, model, form)

    structured = [model for model in ("symm", *results.strict) if model in results.kinds]
    lacking = {model: error(model) - error(f"{model}{COULOMB}") for model in results.strict}
    # one run of each robot: trials are independent, so a plain share
    stopped = results.runs(ROBOT, "delan", REACH, form)["stopped"] != ""
    return {
        "robot_gain": _cases(geometric_mean, {model: error(DEFAULT) / error(model) for model in structured}),
        "robot_networks": _cases(mean, {model: error(model) for model in NETWORKS}),
        "robot_delan_stopped": share(int(stopped.sum()), len(stopped)) if len(stopped) else UNMET,
        "robot_mlp": _ratios(velocity, ["mlp"], [DEFAULT]),
        "robot_reaches": _ratios(velocity, structured, [DEFAULT]),
        "static_friction": _cases(mean, lacking),
    }


def _online(results: DynamicsResults) -> dict[str, Found]:
    """NMSE on the whole motion of the others over that of SPD, Tri and Cov."""
    scores = results.online_scores()

    def course(model: str) -> pd.Series:
        return 10.0 ** scores["speed"].get(model, _NONE)

    def final(model: str) -> pd.Series:
        return scores["final"].get(model, _NONE)

    scaled = {
        when: _ratios(score, ["mlp_scaled"], results.strict)[model_name("mlp_scaled")]
        for when, score in (("over the course", course), ("after one pass", final))
    }
    return {
        "online_course": _ratios(course, RIVALS[TEXT], results.strict),
        "online_final": _ratios(final, RIVALS[TEXT], results.strict),
        "online_scaled": scaled,
    }


_NONE = pd.Series(dtype=float)


def _cases(
    make: Callable[..., Evidence], samples: Mapping[str, pd.Series | pd.DataFrame]
) -> dict[str, Evidence]:
    """A case per model; `UNMET` where it has no samples. All cases together cover with 95 %."""
    there = {model: its.dropna() for model, its in samples.items()}
    found = by_case(make, {model: (its,) for model, its in there.items() if len(its)})
    return {model_name(model): found.get(model, UNMET) for model in samples}


def _ratios(score: Scores, models: Iterable[str], references: Sequence[str]) -> dict[str, Evidence]:
    """Scores of models over the geometric mean of others; a seed that only one of both has is left out."""
    reference = 1.0
    for model in references:
        reference = reference * score(model) ** (1.0 / len(references))
    return _cases(geometric_mean, {model: score(model) / reference for model in models})


def _excess(results: DynamicsResults, model: str, form: Form) -> pd.DataFrame:
    """NMSE in reaches above the ground truth's, of position and velocity, by seed."""
    columns = ["position_nmse", "velocity_nmse"]
    return (
        results.runs(IDEAL, model, REACH, form)[columns] - results.runs(IDEAL, GROUND_TRUTH, REACH)[columns]
    )


def _largest(samples: pd.DataFrame, comparisons: int) -> Evidence:
    """Mean of the column that may be the largest."""
    return max((mean(samples[column], comparisons) for column in samples), key=lambda one: one.high)


SUFFIXES = {OURS: "", TEXT: "_plain"}
"""Of metrics, by form; the text's has plain Adam and the plain loss."""

HEADLINES = (
    "rnea_max_error_nm",
    *(f"epochs_{model}_plain" for model in STRICT),
    *(f"epochs_{model}" for model in ("mlp", "delan", "cov")),
    "ee_velocity_nmse_ground_truth",
    "ee_velocity_nmse_cov_plain",
    "robot_nmse_default",
    "robot_nmse_cov_plain",
    "robot_nmse_cov_coulomb_plain",
)
"""Metrics that stand first."""


@lru_cache
def published() -> Mapping[str, Any]:
    """What the dissertation prints, `published.yaml`."""
    return read_values(Path(__file__).with_name("published.yaml"))


def metrics(results: DynamicsResults) -> Metrics:
    """The flat metrics of the testbed.

    `..._plain` is as published, without it ours. `epochs_<model>` is the mean over seeds of the epochs to
    the threshold on every joint in simulation; where it was not reached, `epochs_limit` counts.
    `ee_velocity_nmse_<model>` is the mean over seeds of the NMSE of the tool's velocity in reaches; a run
    that had to be stopped counts at least 1, and is one of `unstable_<model>` runs, sines and reaches; a
    model that did not meet the criterion with any seed has neither. `robot_...` is the same of the `robots`,
    `robot_nmse_<model>` the NMSE on their logs, mean over joints and robots. `online_nmse_<model>` is that
    on the whole motion after one pass. `payload_settling_s_...` is over the `payload_settled` robots where
    the mass stays right.
    """
    values: Metrics = {
        "simulated": True,
        "robots": len(results.robots),
        "rnea_max_error_nm": results.largest_disagreement,
        "base_parameters": results.base["parameter"].nunique(),
        "epochs_limit": results.training.epochs.simulation,
    }
    for form, suffix in SUFFIXES.items():
        for kind in results.kinds:
            if len(outcome := results.outcome(IDEAL, kind, form)):
                values[f"epochs_{kind}{suffix}"] = outcome["epochs"].mean()
        for robot, prefix in ((IDEAL, ""), (ROBOT, "robot_")):
            for model in results.tracked(robot):
                if len(velocity := results.velocity(robot, model, form)):
                    name = f"{model}{'' if model in (GROUND_TRUTH, DEFAULT) else suffix}"
                    values[f"{prefix}ee_velocity_nmse_{name}"] = velocity.mean()
                    values[f"{prefix}unstable_{name}"] = results.stopped(robot, model, form)
        for model in results.robot_models:
            if len(error := results.robot_error(model, form)):
                values[f"robot_nmse_{model}{suffix}"] = error.mean()
    for model in in_order(results.known["model"].unique()):
        values[f"robot_nmse_{model}"] = results.robot_error(model).mean()
    final = results.online_scores()["final"].groupby(level="model").mean()
    values |= {f"online_nmse_{model}": float(final[model]) for model in in_order(final.index)}
    values["payload_mass_error_share"] = results.mass_errors.mean()
    settled = results.settling_s.dropna()
    values["payload_settled"] = len(settled)
    for name, of in (("median", settled.median), ("min", settled.min), ("max", settled.max)):
        values[f"payload_settling_s_{name}"] = of() if len(settled) else None
    return values


def headlines(values: Metrics) -> list[str]:
    """Those of `HEADLINES` whose models were run."""
    return [name for name in HEADLINES if name in values]
