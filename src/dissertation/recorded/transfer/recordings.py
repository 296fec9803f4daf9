"""Recorded touches of a finger over time."""

from pathlib import Path

from dissertation.recorded.readers.biotac import read_transfer
from dissertation.recorded.transfer.parameters import TransferParameters
from structlearn.tasks.task_import import LeftOut, read_source, write_checked_streams


def write(task: TransferParameters, folder: Path, left_out: LeftOut) -> None:
    """Write `streams` at the sensors' own rates."""
    write_checked_streams(task, read_source(task, task.source, left_out, read_transfer), folder, left_out)
