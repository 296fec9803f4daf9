"""Track sines and reaches with the arm and perturbed robots under every model (tables III.1 and III.2)."""

from collections.abc import Sequence
from functools import cache

from dissertation.dynamics.protocol.tracking import Testbed, TrackingParameters, known, learned, track
from dissertation.dynamics.world.arm_motion import ArmMotionParameters
from dissertation.dynamics.world.controlled_arm import SimulatedArm
from dissertation.dynamics.world.joint_logs import (
    PerturbedRobotParameters,
    perturbed_mechanics,
    perturbed_robot,
)
from dissertation.simulation.arm import ArmParameters, Mechanics, ideal
from structlearn.core.artefacts import publish, read_table, write_table
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.rigid_body.dynamics_models import DynamicsModels, read_dynamics_models
from structlearn.rigid_body.model_names import IDEAL, ROBOT

import pandas as pd

MODELS = "data/dynamics/models"


def main() -> None:
    parameters = stage_parameters("track", TrackingParameters)
    motion = stage_parameters("arm_motion", ArmMotionParameters).used.cut(parameters.sine_s)
    robots = stage_parameters("dynamics_robots", Population).test
    arm = stage_parameters("arm", ArmParameters)
    robot = arm.read()
    outcomes = read_table(f"{MODELS}/outcomes.parquet")

    def testbed(name: str, seeds: Sequence[int], shown: int, mechanics: Mechanics) -> Testbed:
        moved = SimulatedArm(robot, mechanics, 1.0 / motion.rate_hz)
        return Testbed(name, tuple(seeds), shown, moved, motion, parameters.reaching)

    seeds = [int(seed) for seed in outcomes[outcomes["arm"] == IDEAL]["seed"].unique()]
    beds = [(testbed(IDEAL, seeds, seeds[0], ideal(robot.inertias)), IDEAL, parameters.models)]
    perturbed = stage_parameters("perturbed_robot", PerturbedRobotParameters)
    for seed in robots:
        mechanics = perturbed_mechanics(robot.tree, robot.inertias, perturbed_robot(perturbed, seed))
        bed = testbed(ROBOT, [seed], robots[0], mechanics)
        beds.append((bed, f"{ROBOT}/{seed}", parameters.models + parameters.robot_models))
    tables = []
    for bed, folder, names in beds:

        @cache
        def read(form: str, name: str, folder: str = folder) -> DynamicsModels:
            return read_dynamics_models(f"{MODELS}/{folder}/{form}/{name}.safetensors")

        its = (outcomes["arm"] == bed.name) & outcomes["model"].isin(names) & outcomes["seed"].isin(bed.seeds)
        tables.append(track(bed, [*known(bed), *learned(bed, outcomes[its], read)]))
    scores, paths = (pd.concat(parts, ignore_index=True) for parts in zip(*tables, strict=True))
    with publish("data/dynamics/tracking") as folder:
        folder.mkdir()
        write_table(scores, folder / "scores.parquet")
        write_table(paths, folder / "paths.parquet")


if __name__ == "__main__":
    run(main)
