"""Learn online: once through the sines without shuffling (figure III.2), and payloads picked up mid-way."""

from functools import partial
from pathlib import Path

import pandas as pd

from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.parallel import parallel_map
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings.joint_log import JointLog, read_joint_log
from structlearn.rigid_body.learner import LearningParameters
from structlearn.rigid_body.motion import Motion, measured_motion
from structlearn.rigid_body.online_learning import (
    OnlineParameters,
    learn_once_through,
    learn_payload,
)
from structlearn.simulation.arm import ArmParameters

RAW = Path("data/raw/dynamics")


def main() -> None:
    parameters = stage_parameters("online", OnlineParameters)
    learning = stage_parameters("train_dynamics.learning", LearningParameters)
    robot = stage_parameters("arm", ArmParameters).read()
    sines = read_joint_log(RAW / "iiwa" / "log.mcap")
    errors = learn_once_through(robot.tree, _motion(sines), parameters, learning)
    carrying = {path.name: read_joint_log(path / "log.mcap") for path in sorted((RAW / "payload").iterdir())}
    logs = [(_motion(log), log.time[-1] / (len(log.time) - 1)) for log in carrying.values()]
    learn = partial(learn_payload, tree=robot.tree, inertias=robot.inertias, parameters=parameters.payload)
    found = zip(carrying, parallel_map(learn, logs, "payloads"), strict=True)
    payload = pd.concat([table.assign(seed=int(name)) for name, table in found], ignore_index=True)
    with publish("data/dynamics/online") as folder:
        folder.mkdir()
        write_table(errors, folder / "errors.parquet")
        write_table(payload, folder / "payload.parquet")


def _motion(log: JointLog) -> Motion:
    return measured_motion(log.name, log.time, log.positions, log.velocities, log.torques)


if __name__ == "__main__":
    run(main)
