"""Joint logs of a task."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from structlearn.core.errors import MissingInputError
from structlearn.readers.bag_recording import read_joint_logs
from structlearn.readers.joint_log import JointLog, write_log_table
from structlearn.tasks.motion.parameters import MotionParameters
from structlearn.tasks.task_import import LeftOut, read_source


def write(task: MotionParameters, folder: Path, left_out: LeftOut) -> None:
    """Write `logs`."""
    logs = read_source(task, task.source, left_out, read)
    if not logs:
        raise MissingInputError(f"{task.source}: holds no log that can be read")
    write_log_table(logs, folder / "logs.parquet")


def read(folder: Path, entry: MotionParameters, left_out: LeftOut) -> Sequence[JointLog]:
    """Read joint logs, with the joints of the entry's URDF."""
    from structlearn.tasks.motion.learning import read_task_arm  # slow to load

    robot, _ = read_task_arm(entry)
    in_urdf, recorded = dict(entry.joints), {name: its for its, name in entry.joints}
    joints = [recorded.get(name, name) for name in robot.tree.names]
    logs = read_joint_logs(folder, entry.topic, joints, entry.stamps)
    return [replace(log, joints=tuple(in_urdf.get(name, name) for name in log.joints)) for log in logs]
