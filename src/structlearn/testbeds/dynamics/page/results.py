"""Numbers that the page of the dynamics testbed names, and its metrics."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from structlearn.ground.artefacts import Metrics
from structlearn.ground.params import read_values
from structlearn.rigid_body.model_names import DEFAULT, GROUND_TRUTH, STRICT, in_order
from structlearn.rigid_body.training_grid import OURS, TEXT
from structlearn.testbeds.dynamics.names import IDEAL, ROBOT
from structlearn.testbeds.dynamics.protocol.scored_results import DynamicsResults

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

    `..._plain` is the text's form, without it ours. `epochs_<model>` is the mean over seeds of the epochs to
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
