"""Identify the arm of a task from logs of its joints (dissertation III.4).

What loads slowly is imported where it is needed: most tasks have no such logs.
"""

from structlearn.core.artefacts import publish
from structlearn.readers.joint_log import DriveLog, JointLog, read_log_table
from structlearn.tasks.task_entry import MotionEntry
from structlearn.tasks.task_files import TaskFiles, run_for_task


def main(files: TaskFiles) -> None:
    from structlearn.tasks.motion.joint_motion import arm_of, learn_motion

    parameters = files.entry(MotionEntry)
    robot, urdf = arm_of(parameters)
    kind = JointLog if parameters.drives is None else DriveLog
    logs = {log.name: log for log in read_log_table(files.recorded / "logs.parquet", kind)}
    with publish(files.folder / "motion") as folder:
        folder.mkdir()
        learn_motion(robot, logs, parameters, urdf, folder)


if __name__ == "__main__":
    run_for_task(main, out="motion")
