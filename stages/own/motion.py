"""Identify the arm of a task from logs of its joints (dissertation III.4).

What loads slowly is imported where it is needed: most tasks have no such logs.
"""

from structlearn.core.artefacts import publish
from structlearn.readers.stamps import StampPolicy
from structlearn.tasks.motion.motion_parameters import MotionParameters
from structlearn.tasks.task_files import TaskFiles, run_for_task


def main(files: TaskFiles) -> None:
    from structlearn.tasks.motion.joint_motion import arm_of, learn_motion, logs_of

    parameters = files.part("motion", MotionParameters)
    robot, urdf = arm_of(parameters)
    logs = logs_of(parameters, robot.tree, files.part("stamps", StampPolicy))
    with publish(files.folder / "motion") as folder:
        folder.mkdir()
        learn_motion(robot, logs, parameters, urdf, folder)


if __name__ == "__main__":
    run_for_task(main, "motion", "motion")
