"""Let the arm and the stand-in follow sines and reaches with every model (tables III.1 and III.2)."""

import pandas as pd

from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.rigid_body.model_files import read_dynamics_models
from structlearn.simulation.arm import ArmParameters, Mechanics, ideal
from structlearn.testbeds.dynamics.protocol.tracking import (
    Testbed,
    TrackingParameters,
    engine_agreement,
    known,
    learned,
    track,
)
from structlearn.testbeds.dynamics.world.arm_motion import SineParameters
from structlearn.testbeds.dynamics.world.controlled_arm import SimulatedArm
from structlearn.testbeds.dynamics.world.joint_logs import SIMULATED, MotionSourceParameters
from structlearn.testbeds.dynamics.world.stand_in_robot import StandInParameters, stand_in

MODELS = "data/dynamics/models"


def main() -> None:
    parameters = stage_parameters("track", TrackingParameters)
    motion = stage_parameters("arm_motion", SineParameters)
    arm = stage_parameters("arm", ArmParameters)
    robot = arm.read()

    def testbed(name: str, mechanics: Mechanics) -> Testbed:
        moved = SimulatedArm(robot, mechanics, 1.0 / motion.rate_hz, arm.engine)
        return Testbed(name, moved, motion, parameters.reaching)

    beds = [(testbed("iiwa", ideal(robot.inertias)), parameters.models)]
    if stage_parameters("record_motion", MotionSourceParameters).source == SIMULATED:
        mechanics = stand_in(robot.tree, robot.inertias, stage_parameters("stand_in", StandInParameters))
        beds.append((testbed("stand_in", mechanics), parameters.models + parameters.robot_models))
    tables = []
    for bed, names in beds:
        files = {name: f"{MODELS}/{bed.name}/{parameters.loss}/{name}.safetensors" for name in names}
        models = {name: read_dynamics_models(file) for name, file in files.items()}
        agreement = engine_agreement(bed)  # first: it also compiles, once, what all processes run
        tables.append((agreement, *track(bed, [*known(bed, parameters.seeds), *learned(bed, models)])))
    agreement, scores, paths = (pd.concat(parts, ignore_index=True) for parts in zip(*tables, strict=True))
    with publish("data/dynamics/tracking") as folder:
        folder.mkdir()
        write_table(scores, folder / "scores.parquet")
        write_table(paths, folder / "paths.parquet")
        write_table(agreement, folder / "agreement.parquet")


if __name__ == "__main__":
    run(main)
