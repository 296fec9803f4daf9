"""What was found for the claims on learned dynamics.

Differences and ratios are taken seed by seed. Of a network that never met the text's criterion nothing
follows (`UNKNOWN`): the text trained until it was met. A model that was not run is no case.
"""

from collections.abc import Callable, Collection, Iterable

import pandas as pd

from structlearn.reporting.claims import UNKNOWN, Evidence, Found, counted, exact, geometric_mean, mean
from structlearn.rigid_body.model_names import COULOMB, DEFAULT, GROUND_TRUTH, model_name
from structlearn.rigid_body.seeded_training import PLAIN, SCHEDULED
from structlearn.testbeds.dynamics.names import IDEAL, REACH, ROBOT
from structlearn.testbeds.dynamics.page.results import published
from structlearn.testbeds.dynamics.protocol.scored_results import DynamicsResults

NETWORKS, RIVALS = ("mlp", "delan"), ("mlp", "delan", "nostr", "symm")
"""The text's models that are no inertias, and all that are less constrained than SPD, Tri and Cov."""

Scores = Callable[[str], pd.Series]
"""Of a model, by seed."""


def evidence(results: DynamicsResults) -> dict[str, Found]:
    """By the names of `claims.yaml`."""
    agreement = exact(results.largest_disagreement, len(results.agreement))
    return {"agreement": agreement} | _in_simulation(results) | _online(results) | _of_robot(results)


def unmet(results: DynamicsResults, robot: str) -> list[str]:
    """Networks that were trained, but not until the text's criterion was met.

    It is an NMSE of every joint in simulation, and of their mean on the robot's log.
    """
    found = {model: results.outcome(robot, model) for model in NETWORKS}
    errors = {model: its["nmse_mean"].mean() for model, its in found.items() if len(its)}
    if robot == IDEAL:
        return [model for model in errors if not found[model]["reached"].all()]
    return [model for model, error in errors.items() if not error < published()["network_nmse"]]


def _in_simulation(results: DynamicsResults) -> dict[str, Found]:
    tracked = results.tracked(IDEAL)
    over_strict = _ratios(results.velocity, _among(RIVALS, tracked), _among(results.strict, tracked))
    over_truth = _ratios(results.velocity, _among(NETWORKS, tracked), [GROUND_TRUTH])
    return {
        "epochs_plain": _slowest(results, PLAIN),
        "epochs_scheduled": _slowest(results, SCHEDULED),
        "epochs_more_plain": _epochs_more(results, PLAIN),
        "epochs_more_scheduled": _epochs_more(results, SCHEDULED),
        "above_truth": {
            model_name(model): _excess(results, model) for model in _among(results.strict, tracked)
        },
        "networks_over_strict": _if_met(results, IDEAL, over_strict, NETWORKS),
        "all_over_strict": over_strict,
        "networks_oscillate": _if_met(results, IDEAL, over_truth, NETWORKS),
    }


def _online(results: DynamicsResults) -> dict[str, Found]:
    """NMSE on the whole motion of the others over that of SPD, Tri and Cov, and of these alone."""
    scores = results.online_scores()
    course, final = 10.0 ** scores["speed"], scores["final"]
    there = scores.index.unique("model")
    strict, rivals = _among(results.strict, there), _among(RIVALS, there)
    scaled = {"over the course": course, "after one pass": final} if "mlp_scaled" in there else {}
    return {
        "online_course": _ratios(course.__getitem__, rivals, strict),
        "online_final": _ratios(final.__getitem__, rivals, strict),
        "online_absolute": {model_name(model): geometric_mean(final[model]) for model in strict},
        "online_scaled": {
            when: found
            for when, score in scaled.items()
            for found in _ratios(score.__getitem__, ["mlp_scaled"], strict).values()
        },
    }


def _of_robot(results: DynamicsResults) -> dict[str, Found]:
    errors = {model: results.outcome(ROBOT, model)["nmse_mean"] for model in results.robot_models}
    structured, default = _among(("symm", *results.strict), errors), results.robot_error(DEFAULT)
    gains = {model_name(model): geometric_mean(default / errors[model]) for model in structured}
    tracked, runs = results.tracked(ROBOT), results.runs(ROBOT, "delan", REACH)
    over_default = _ratios(lambda model: results.velocity(model, ROBOT), tracked, _among([DEFAULT], tracked))
    ran = counted(len(runs) - results.stopped(ROBOT, "delan", REACH), len(runs)) if len(runs) else UNKNOWN
    return {
        "robot_gain": gains,
        "robot_least_gain": min(gains.values(), key=lambda gain: gain.low, default=UNKNOWN),
        "robot_networks": {model_name(model): mean(errors[model]) for model in _among(NETWORKS, errors)},
        "robot_delan_ran": _if_met(results, ROBOT, {model_name("delan"): ran}, ["delan"]),
        "robot_mlp_oscillates": _if_met(results, ROBOT, over_default, ["mlp"]),
        "robot_reaches": {name: over_default[name] for name in gains if name in over_default},
        "static_friction": {
            model_name(model): mean(errors[model] - errors[f"{model}{COULOMB}"])
            for model in results.strict
            if f"{model}{COULOMB}" in errors
        },
    }


def _among(models: Iterable[str], there: Collection[str]) -> list[str]:
    return [model for model in models if model in there]


def _if_met(
    results: DynamicsResults, robot: str, found: dict[str, Evidence], models: Iterable[str]
) -> dict[str, Evidence]:
    """Of all models of a claim; nothing is known where one did not meet the criterion, or was not run."""
    missing = unmet(results, robot)
    return {
        model_name(model): UNKNOWN if model in missing else found.get(model_name(model), UNKNOWN)
        for model in models
    }


def _ratios(score: Scores, models: Iterable[str], references: list[str]) -> dict[str, Evidence]:
    """Error of models over the geometric mean of others; a seed that only one of both has is left out."""
    if not references:
        return {}
    reference = 1.0
    for model in references:
        reference = reference * score(model) ** (1.0 / len(references))
    return {model_name(model): geometric_mean((score(model) / reference).dropna()) for model in models}


def _epochs(results: DynamicsResults, model: str, optimiser: str) -> pd.Series:
    """To the criterion in simulation, raw loss; the networks have one optimiser, plain Adam."""
    return results.outcome(IDEAL, model, "raw", SCHEDULED if model in NETWORKS else optimiser)["epochs"]


def _slowest(results: DynamicsResults, optimiser: str) -> dict[str, Evidence]:
    every = {model: _epochs(results, model, optimiser) for model in results.strict}
    return {model_name(model): exact(epochs.max(), len(epochs)) for model, epochs in every.items()}


def _epochs_more(results: DynamicsResults, optimiser: str) -> dict[str, Evidence]:
    """Epochs that less constrained models need more than SPD, Tri and Cov on average."""
    strict = [_epochs(results, model, optimiser) for model in results.strict]
    rivals = _among(RIVALS, results.kinds) if strict else []
    return {
        model_name(model): mean(_epochs(results, model, optimiser) - sum(strict) / len(strict))
        for model in rivals
    }


def _excess(results: DynamicsResults, model: str) -> Evidence:
    """NMSE in reaches above the ground truth's, of position or velocity, whichever may be the larger."""
    columns = ["position_nmse", "velocity_nmse"]
    its, truth = (results.runs(IDEAL, name, REACH)[columns] for name in (model, GROUND_TRUTH))
    both = (its - truth).dropna()
    return max((mean(both[column]) for column in columns), key=lambda one: one.high)
