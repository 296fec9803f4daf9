"""Repeat one run of each testbed with a moving arm in PyBullet, and compare the compiled engine with it."""

from collections.abc import Iterator
from contextlib import contextmanager

from dissertation.dynamics.world.arm_motion import ArmMotionParameters
from dissertation.dynamics.world.joint_logs import (
    PerturbedRobotParameters,
    RecordMotionParameters,
    perturbed_robot,
    perturbed_robot_log,
)
from dissertation.scraping.protocol.execution_scores import ExecutionParameters
from dissertation.scraping.protocol.executions import execute_run, runs_to_correct
from dissertation.scraping.world import scraping_robot
from dissertation.scraping.world.execution import Advance
from dissertation.scraping.world.scraping_world import World, load
from dissertation.scraping.world.testbed import TestbedParameters, drawn_testbed
from dissertation.simulation.arm import ArmParameters
from dissertation.simulation.bullet_arm import BulletArm, differences
from dissertation.simulation.compiled_chain import kinematics
from structlearn.core.artefacts import write_csv
from structlearn.core.params import Population
from structlearn.core.stage import run, stage_parameters
from structlearn.feedback.skill import ReactiveSkill
from structlearn.primitives.primitive_files import read_primitives
from structlearn.readers.demonstration import Recording
from structlearn.readers.joint_log import JointLog

import numpy as np
import pandas as pd

COMPARED_S = 8.0
"""Duration of the compared part of a joint log: all joints move in it, some reverse."""


def main() -> None:
    table = pd.concat([corrected_execution(), perturbed_robot_on_sines()])
    write_csv(table, "reports/engines/differences.csv")


def corrected_execution() -> pd.DataFrame:
    """Compare the engines on one execution corrected by a person on the steepest board."""
    settings = stage_parameters("record_corrections", ExecutionParameters).settings_deg
    testbed = drawn_testbed(stage_parameters("testbed", TestbedParameters))
    skill = ReactiveSkill(read_primitives("data/primitives/scraping/primitives.safetensors"))
    (one,) = runs_to_correct([max(settings)], 1)
    runs = [_felt(execute_run(one, 0, skill, testbed, engine)) for engine in (None, in_pybullet)]
    return differences(f"scraping, {max(settings):g} degrees, corrected by a person", *runs)


@contextmanager
def in_pybullet(world: World) -> Iterator[Advance]:
    """Context that yields `scraping_world.advance` with PyBullet integrating the motion."""
    robot = scraping_robot.whole()
    with BulletArm(robot.tree, robot.inertias, np.zeros(len(world.q)), world.dt) as arm:
        arm.place(world.q, world.v)

        def step_in_pybullet(torques: np.ndarray) -> None:
            for _ in range(world.substeps):
                load(world, torques)
                world.q[:], world.v[:] = arm.step(world.torques)
                kinematics(world.arrays, world.q, world.work)

        yield step_in_pybullet


def perturbed_robot_on_sines() -> pd.DataFrame:
    """Compare the engines on a robot with friction, ripple and latency that picks up a payload."""
    parameters = stage_parameters("record_motion", RecordMotionParameters)
    motion = stage_parameters("arm_motion", ArmMotionParameters).used.cut(COMPARED_S)
    perturbed = stage_parameters("perturbed_robot", PerturbedRobotParameters)
    seed = min(stage_parameters("dynamics_robots", Population).test)
    one, robot = perturbed_robot(perturbed, seed), stage_parameters("arm", ArmParameters).read()
    logs = [
        perturbed_robot_log(robot, one, motion, parameters.payload, pybullet) for pybullet in (False, True)
    ]
    return differences(f"dynamics, robot {seed} with a payload on sines", *map(_moved, logs))


def _felt(recording: Recording) -> dict[str, np.ndarray]:
    pose, torques, counts = (
        next(vars(stream)["values"] for stream in recording.streams if stream.kind == kind)
        for kind in ("pose", "joint_torques", "tactile")
    )
    return {"hand position (m)": pose[:, :3], "joint torque (N m)": torques, "electrodes (counts)": counts}


def _moved(log: JointLog) -> dict[str, np.ndarray]:
    return {"joint position (rad)": log.positions, "joint torque (N m)": log.torques}


if __name__ == "__main__":
    run(main)
