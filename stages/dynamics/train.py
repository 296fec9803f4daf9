"""Learn inverse dynamics from sines: all models, forms, seeds and robots (tables III.1, III.2)."""

from pathlib import Path

import pandas as pd

from structlearn.ground.artefacts import publish, write_metrics, write_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings.joint_log import read_joint_log
from structlearn.rigid_body.base_parameters import base_parameters, base_table, link_table
from structlearn.rigid_body.dynamics_models import write_dynamics_models
from structlearn.rigid_body.model_names import IDEAL, ROBOT
from structlearn.rigid_body.motion import Motion, measured_motion
from structlearn.rigid_body.training_grid import DynamicsTrainingParameters, scores, train, trainings
from structlearn.simulation.arm import ArmParameters

RAW = Path("data/raw/dynamics")


def main() -> None:
    parameters = stage_parameters("train_dynamics", DynamicsTrainingParameters)
    robot = stage_parameters("arm", ArmParameters).read()
    robots = sorted(int(path.name) for path in (RAW / ROBOT).iterdir())
    motions = {IDEAL: _motion(IDEAL)}
    motions |= {f"{ROBOT}/{seed}": _motion(f"{ROBOT}/{seed}", parameters.smoothing_hz) for seed in robots}
    models, errors, outcomes = train(trainings(robots, parameters), motions, robot.tree, parameters)

    base = base_parameters(robot.tree)
    links, combinations, seeds = [], [], dict(enumerate(parameters.seeds))
    for name, learned in models.items():
        if name.startswith(f"{IDEAL}/") and learned.structured:
            keys = {"model": learned.kind, "form": name.split("/")[1]}
            inertias = learned.inertias()
            for tables, made in (
                (links, link_table(robot.tree, inertias, robot.inertias)),
                (combinations, base_table(robot.tree, base, inertias, robot.inertias)),
            ):
                tables.append(made.assign(**keys, seed=made["seed"].map(seeds)))
    with publish("data/dynamics/models") as folder:
        for name, learned in models.items():
            write_dynamics_models(learned, folder / f"{name}.safetensors")
        write_table(errors, folder / "errors.parquet")
        write_table(outcomes, folder / "outcomes.parquet")
        write_table(pd.concat(links, ignore_index=True), folder / "links.parquet")
        write_table(pd.concat(combinations, ignore_index=True), folder / "base_parameters.parquet")
        write_metrics(scores(outcomes, parameters.epochs.simulation), folder / "scores.json")


def _motion(name: str, cutoff_hz: float = float("inf")) -> Motion:
    log = read_joint_log(RAW / name / "log.mcap")
    return measured_motion(
        log.name, log.time, log.positions, log.velocities, log.torques, cutoff_hz=cutoff_hz
    )


if __name__ == "__main__":
    run(main)
