"""Numbers that the page of the dynamics testbed names, and its metrics."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from structlearn.ground.artefacts import Metrics
from structlearn.rigid_body.inertia_parameters import STRUCTURES
from structlearn.rigid_body.model_names import STRICT, in_order
from structlearn.rigid_body.seeded_training import PLAIN
from structlearn.testbeds.dynamics.names import IDEAL, ROBOT
from structlearn.testbeds.dynamics.protocol.scored_results import DynamicsResults

HEADLINES = (
    "rnea_max_error_nm",
    *(f"epochs_{how}{model}" for how in ("plain_", "") for model in STRICT),
    "ee_velocity_nmse_ground_truth",
    "ee_velocity_nmse_cov",
    "robot_nmse_default",
    "robot_nmse_cov",
    "robot_nmse_cov_coulomb",
)
"""Metrics that stand first."""


@lru_cache
def published() -> Mapping[str, Any]:
    """What the dissertation prints, `published.yaml`."""
    return yaml.safe_load((Path(__file__).parent / "published.yaml").read_text(encoding="utf-8"))


def metrics(results: DynamicsResults) -> Metrics:
    """The flat metrics of the testbed.

    Models are those of the loss that tracks, the text's raw one. `epochs_<model>` is the mean over seeds of
    the epochs to the threshold on every joint in simulation, `epochs_plain_<model>` with plain Adam; where it
    was not reached, `epochs_limit` counts. `ee_velocity_nmse_<model>` is the mean over seeds of the NMSE of
    the tool's velocity in reaches; a run that had to be stopped counts at least 1, and is one of
    `unstable_<model>` runs, sines and reaches. `robot_...` is the same of the stand-in, `robot_nmse_<model>`
    the NMSE on its log, mean over joints and seeds. `online_nmse_<model>` is that on the whole motion after
    one pass. `engines_max_difference_...` is the largest difference of the compiled arm from PyBullet's.
    """
    values: Metrics = {
        "simulated": True,
        "rnea_max_error_nm": results.largest_disagreement,
        "engines_max_difference_rad": float(results.engines["joint_rad"].max()),
        "engines_max_difference_nm": float(results.engines["torque_n_m"].max()),
        "base_parameters": results.base["parameter"].nunique(),
        "epochs_limit": results.training.epochs.raw,
    }
    for kind in results.kinds:
        values[f"epochs_{kind}"] = results.outcome(IDEAL, kind, "raw")["epochs"].mean()
        if kind in STRUCTURES:
            values[f"epochs_plain_{kind}"] = results.outcome(IDEAL, kind, "raw", PLAIN)["epochs"].mean()
    for robot, prefix in ((IDEAL, ""), (ROBOT, "robot_")):
        for model in results.tracked(robot):
            values[f"{prefix}ee_velocity_nmse_{model}"] = results.velocity(model, robot).mean()
            values[f"{prefix}unstable_{model}"] = results.stopped(robot, model)
    for model in in_order([*results.known["model"], *results.robot_models]):
        if model in results.tracked(ROBOT) or not results.tracked(ROBOT):
            values[f"robot_nmse_{model}"] = results.robot_error(model)
    final = results.online_scores()["final"].groupby(level="model").mean()
    values |= {f"online_nmse_{model}": float(final[model]) for model in in_order(final.index)}
    values["payload_mass_error_kg"] = float(results.payload["mass_kg"].iloc[-1] - results.carried.mass_kg)
    values["payload_settling_s"] = results.settling_s
    return values


def headlines(values: Metrics) -> list[str]:
    """Those of `HEADLINES` whose models were run."""
    return [name for name in HEADLINES if name in values]
