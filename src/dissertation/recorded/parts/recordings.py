"""Logs of the arm with parts of the torque."""

from pathlib import Path

from dissertation.recorded.parts.parameters import PartsParameters
from dissertation.recorded.readers.delan_characters import read_parts
from structlearn.readers.joint_log import write_log_table
from structlearn.tasks.task_import import LeftOut, read_source


def write(task: PartsParameters, folder: Path, left_out: LeftOut) -> None:
    """Write `logs`."""
    write_log_table(read_source(task, task.source, left_out, read_parts), folder / "logs.parquet")
