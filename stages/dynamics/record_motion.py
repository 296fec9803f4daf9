"""Record an arm on sines: as in its URDF, a stand-in or your own robot, and with a payload (III.4)."""

from structlearn.ground.artefacts import publish
from structlearn.ground.stage import run, stage_parameters
from structlearn.recordings.joint_log import JointLog, write_joint_log
from structlearn.simulation.arm import ArmParameters
from structlearn.testbeds.dynamics.world.arm_motion import SineParameters
from structlearn.testbeds.dynamics.world.joint_logs import (
    SIMULATED,
    MotionSourceParameters,
    ideal_log,
    own_log,
    payload_log,
    stand_in_log,
)
from structlearn.testbeds.dynamics.world.stand_in_robot import StandInParameters

RAW = "data/raw/dynamics"


def main() -> None:
    parameters = stage_parameters("record_motion", MotionSourceParameters)
    motion = stage_parameters("arm_motion", SineParameters)
    robot = stage_parameters("arm", ArmParameters).read()
    if parameters.source == SIMULATED:
        robot_log = stand_in_log(robot, motion, stage_parameters("stand_in", StandInParameters))
    else:
        robot_log = own_log(parameters.source, parameters.topic, robot.tree, parameters.max_gap_s)
    _write(robot_log, "stand_in")
    _write(ideal_log(robot, motion), "iiwa")
    _write(payload_log(robot, motion, parameters.payload), "payload")


def _write(log: JointLog, name: str) -> None:
    with publish(f"{RAW}/{name}") as folder:
        folder.mkdir()
        write_joint_log(log, folder / "log.mcap")


if __name__ == "__main__":
    run(main)
