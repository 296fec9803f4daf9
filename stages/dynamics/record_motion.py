"""Record an arm on sines: as in its URDF, a stand-in or your own robot, and with a payload (III.4)."""

from functools import partial

import pandas as pd

from structlearn.ground.artefacts import publish, write_table
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings.joint_log import JointLog, write_joint_log
from structlearn.simulation.arm import ArmParameters
from structlearn.testbeds.dynamics.world.arm_motion import SineParameters
from structlearn.testbeds.dynamics.world.joint_logs import (
    SIMULATED,
    MotionSourceParameters,
    ideal_log,
    log_agreement,
    own_log,
    payload_log,
    stand_in_log,
)
from structlearn.testbeds.dynamics.world.stand_in_robot import StandInParameters

RAW = "data/raw/dynamics"


def main() -> None:
    parameters = stage_parameters("record_motion", MotionSourceParameters)
    motion = stage_parameters("arm_motion", SineParameters)
    arm = stage_parameters("arm", ArmParameters)
    robot = arm.read()
    logs = {"iiwa": partial(ideal_log, robot), "payload": partial(payload_log, robot, parameters.payload)}
    if parameters.source == SIMULATED:
        logs["stand_in"] = partial(stand_in_log, robot, stage_parameters("stand_in", StandInParameters))
    else:
        _write(own_log(parameters.source, parameters.topic, robot.tree, parameters.max_gap_s), "stand_in")
    for name, log in logs.items():
        _write(log(motion, arm.engine), name, log_agreement(log, motion))


def _write(log: JointLog, name: str, agreement: pd.DataFrame | None = None) -> None:
    with publish(f"{RAW}/{name}") as folder:
        folder.mkdir()
        write_joint_log(log, folder / "log.mcap")
        if agreement is not None:
            write_table(agreement, folder / "agreement.parquet")


if __name__ == "__main__":
    run(main)
