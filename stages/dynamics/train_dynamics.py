"""Learn inverse dynamics from sines: all models, losses and seeds (tables III.1, III.2)."""

import pandas as pd

from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings.joint_log import JointLog, read_joint_log
from structlearn.rigid_body.base_parameters import base_parameters
from structlearn.rigid_body.inertia_tables import base_table, link_table
from structlearn.rigid_body.model_files import write_dynamics_models
from structlearn.rigid_body.motion import Motion, measured_motion
from structlearn.rigid_body.seeded_training import DynamicsTrainingParameters, train, trainings
from structlearn.simulation.arm import ArmParameters

RAW = "data/raw/dynamics"


def main() -> None:
    parameters = stage_parameters("train_dynamics", DynamicsTrainingParameters)
    robot = stage_parameters("arm", ArmParameters).read()
    ideal, own = (read_joint_log(f"{RAW}/{name}/log.mcap") for name in ("iiwa", "stand_in"))
    motions = {
        "iiwa": _motion(ideal),
        "stand_in": _motion(own, parameters.smoothing_hz),
    }
    limits = parameters.epochs.by_loss
    work = trainings("iiwa", ("none",), limits, parameters)
    limits = dict.fromkeys(limits, parameters.epochs.robot)
    work += trainings("stand_in", ("viscous", "coulomb"), limits, parameters)
    models, errors, outcomes = train(work, motions, robot.tree, parameters)

    base = base_parameters(robot.tree)
    links, combinations = [], []
    for name, learned in models.items():
        if name.startswith("iiwa/") and learned.structured:
            keys = {"model": learned.kind, "loss": name.split("/")[1]}
            inertias = learned.inertias()
            links.append(link_table(robot.tree, inertias, robot.inertias).assign(**keys))
            combinations.append(base_table(robot.tree, base, inertias, robot.inertias).assign(**keys))
    with publish("data/dynamics/models") as folder:
        for name, learned in models.items():
            write_dynamics_models(learned, folder / f"{name}.safetensors")
        write_table(errors, folder / "errors.parquet")
        write_table(outcomes, folder / "outcomes.parquet")
        write_table(pd.concat(links, ignore_index=True), folder / "links.parquet")
        write_table(pd.concat(combinations, ignore_index=True), folder / "base_parameters.parquet")


def _motion(log: JointLog, cutoff_hz: float = float("inf")) -> Motion:
    return measured_motion(
        log.name, log.time, log.positions, log.velocities, log.torques, cutoff_hz=cutoff_hz
    )


if __name__ == "__main__":
    run(main)
