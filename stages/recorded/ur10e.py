"""Identify a recorded UR10e from its motors' currents, and weigh the load that it carries (III.4)."""

from structlearn.core.artefacts import filled, publish
from structlearn.core.stage import or_empty, run, stage_parameters
from structlearn.tasks.motion.joint_motion import arm_of, learn_motion, logs_of
from structlearn.tasks.motion.motion_parameters import MotionParameters
from structlearn.tasks.public import PARAMETER_FILE


def main() -> None:
    parameters = stage_parameters("recorded_ur10e", MotionParameters, PARAMETER_FILE)
    filled(parameters.source)
    robot, urdf = arm_of(parameters)
    logs = logs_of(parameters, robot.tree)
    with publish("data/recorded/ur10e") as folder:
        folder.mkdir()
        learn_motion(robot, logs, parameters, urdf, folder)


if __name__ == "__main__":
    run(or_empty(main, "data/recorded/ur10e"))
