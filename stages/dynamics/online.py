"""Learn online: once through the sines without shuffling (figure III.2), and payloads picked up mid-way."""

from functools import partial
from pathlib import Path

import pandas as pd

from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.parallel import parallel_map
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings.joint_log import JointLog, read_joint_log
from structlearn.rigid_body.model_learning import LearningParameters
from structlearn.rigid_body.motion import Motion, measured_motion
from structlearn.rigid_body.online_learning import (
    OnlineParameters,
    PayloadLearningParameters,
    follow_payload,
    identify_empty,
    learn_once_through,
)
from structlearn.rigid_body.tree import Robot
from structlearn.simulation.arm import ArmParameters

RAW = Path("data/raw/dynamics")


def main() -> None:
    parameters = stage_parameters("online", OnlineParameters)
    learning = stage_parameters("train_dynamics.learning", LearningParameters)
    robot = stage_parameters("arm", ArmParameters).read()
    sines = read_joint_log(RAW / "iiwa" / "log.mcap")
    errors = learn_once_through(robot.tree, _motion(sines), parameters, learning)
    robots = sorted(path.name for path in (RAW / "payload").iterdir())
    follow = partial(_followed, robot=robot, parameters=parameters.payload)
    payload = pd.concat(parallel_map(follow, robots, "payloads"), ignore_index=True)
    with publish("data/dynamics/online") as folder:
        folder.mkdir()
        write_table(errors, folder / "errors.parquet")
        write_table(payload, folder / "payload.parquet")


def _followed(name: str, robot: Robot, parameters: PayloadLearningParameters) -> pd.DataFrame:
    log = read_joint_log(RAW / "payload" / name / "log.mcap")
    motion, dt = _motion(log), log.time[-1] / (len(log.time) - 1)
    links, friction = identify_empty(robot.tree, robot.inertias, motion, dt, parameters)
    rigid = Motion(motion.q, motion.qd, motion.qdd, motion.torque - friction)
    return follow_payload(robot.tree, links, rigid, dt, parameters).assign(seed=int(name))


def _motion(log: JointLog) -> Motion:
    return measured_motion(log.name, log.time, log.positions, log.velocities, log.torques)


if __name__ == "__main__":
    run(main)
