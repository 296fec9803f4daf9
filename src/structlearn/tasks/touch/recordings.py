"""Recorded touches of a task."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from structlearn.readers import Recording, synchronise
from structlearn.readers.bag_recording import each_recording
from structlearn.readers.touch_log import TouchLog, read_touch_table, touch_of, touch_tables, write_touch_logs
from structlearn.tasks.task_import import LeftOut, read_source, write_checked_streams
from structlearn.tasks.touch.parameters import TouchParameters


def write(task: TouchParameters, folder: Path, left_out: LeftOut) -> None:
    """Write `touches`, or, for slides over surfaces, `streams` at the sensors' own rates."""
    found = read_source(task, task.source, left_out, read)
    if task.surfaces is not None:
        write_checked_streams(task, found, folder, left_out)
    else:
        write_touch_logs(found, folder / "touches.parquet")


def read(folder: Path, entry: Any, left_out: LeftOut) -> Iterable[TouchLog | Recording]:
    """Read tables of touches, or else bags with a tactile signal and the pose of what touches."""
    logs = [log for path in touch_tables(folder) for log in read_touch_table(path, entry.channels)]
    if logs:
        return logs
    recordings = each_recording(folder, entry.topics, entry.stamps)
    if entry.surfaces is not None:
        return recordings
    return (touch_of(synchronise(one, **entry.clock.model_dump())) for one in recordings)
