"""Learn inverse dynamics from sines: all models, forms, seeds and robots (tables III.1 and III.2)."""

from dissertation.dynamics.files import as_motion, read_logs
from dissertation.dynamics.protocol.trainings import CHOSEN, DynamicsTrainingParameters, train_all, trainings
from dissertation.dynamics.protocol.truth import FRICTION_MODELS, friction_table, known_errors
from dissertation.dynamics.world.joint_logs import (
    PerturbedRobotParameters,
    perturbed_mechanics,
    perturbed_robot,
)
from dissertation.simulation.arm import ArmParameters
from structlearn.core.artefacts import publish, write_table
from structlearn.core.stage import run, stage_parameters
from structlearn.rigid_body.base_parameters import base_parameters, base_table, link_table
from structlearn.rigid_body.dynamics_models import write_dynamics_models
from structlearn.rigid_body.model_names import IDEAL, ROBOT

import pandas as pd


def main() -> None:
    parameters = stage_parameters("train_dynamics", DynamicsTrainingParameters)
    robot = stage_parameters("arm", ArmParameters).read()
    robots = read_logs(ROBOT)
    motions = {IDEAL: as_motion(read_logs(IDEAL)[IDEAL])}
    motions |= {f"{ROBOT}/{seed}": as_motion(log, parameters.smoothing_hz) for seed, log in robots.items()}
    models, errors, outcomes = train_all(
        trainings([int(seed) for seed in robots], parameters), motions, robot.tree, parameters
    )

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
    perturbed = stage_parameters("perturbed_robot", PerturbedRobotParameters)
    known, friction = [], []
    for seed in map(int, robots):
        its = f"{ROBOT}/{seed}"
        true = perturbed_mechanics(robot.tree, robot.inertias, perturbed_robot(perturbed, seed))
        learned = {name: models[f"{its}/{CHOSEN}/{name}"] for name in FRICTION_MODELS}
        known.append(known_errors(robot, true, motions[its]).assign(seed=seed))
        friction.append(friction_table(learned, true).assign(seed=seed))
    with publish("data/dynamics/models") as folder:
        for name, learned in models.items():
            write_dynamics_models(learned, folder / f"{name}.safetensors")
        write_table(errors, folder / "errors.parquet")
        write_table(outcomes, folder / "outcomes.parquet")
        write_table(pd.concat(links, ignore_index=True), folder / "links.parquet")
        write_table(pd.concat(combinations, ignore_index=True), folder / "base_parameters.parquet")
        write_table(pd.concat(known, ignore_index=True), folder / "known.parquet")
        write_table(pd.concat(friction, ignore_index=True), folder / "friction.parquet")


if __name__ == "__main__":
    run(main)
