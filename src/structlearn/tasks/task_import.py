"""Import of a task's recordings by its reader: checked, on the task's clock, and named by their purpose.

A reader is a module with a function per kind of data, `read_KIND`; it has the name of a module of
`structlearn.readers`, e.g. `lerobot`, or its own dotted name:

    read_movement(folder, entry, left_out) -> list[Recording]
    read_motion(folder, entry, left_out) -> list[JointLog] | list[DriveLog]
    read_obstacles(folder, entry, left_out) -> list[Recording], with shapes, and `person` in their provenance
    read_touch(folder, entry, left_out) -> list[TouchLog], or list[Recording] if `entry.surfaces`

`entry` has the task's parameters; `left_out[file] = reason` records what could not be read. A generator does
as well as a list: recordings are written one by one. The reader `bags` is the kind's own, for all formats of
`readers.source_files`.
"""

import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from operator import itemgetter
from pathlib import Path
from typing import Any

import pandas as pd

from structlearn.core.artefacts import publish, write_csv
from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers import Recording, synchronise
from structlearn.readers.demonstration import Demonstration, write_streams
from structlearn.readers.source import ClockParameters, SourceParameters
from structlearn.tasks.kinds import module_of
from structlearn.tasks.task_files import LEFT_OUT, is_public, leave_out, local_path

BAGS = "bags"

LeftOut = dict[str, str]  # reasons why files could not be read, by file name
Frames = dict[str, tuple[str, str]]  # frame of each topic, and the first recording that has it
Read = Callable[[Path, Any, LeftOut], Any]


def import_task(task: SourceParameters, target: Path) -> None:
    """Publish a task's recordings in a folder, with `left_out.csv`.

    If a public set is missing or cannot be read, the folder says why, and the pipeline continues. Raises
    InputError: a lab's recordings cannot be read or fail their checks.
    """
    left_out, public = LeftOut(), f"{local_path('$DATA')}/"
    with publish(target) as folder:
        folder.mkdir()
        try:
            module_of(task.kind, "recordings").write(task, folder, left_out)
        except InputError as error:
            if not is_public(task.source):
                raise
            reason = str(error).replace(public, "")
            shutil.rmtree(folder)  # may be incomplete
            leave_out(folder, reason)
            if not isinstance(error, MissingInputError):
                left_out[""] = reason
        rows = [(file, reason.replace(public, "")) for file, reason in left_out.items()]
        write_csv(pd.DataFrame(rows, columns=["file", "reason"]), folder / LEFT_OUT)
    for _, reason in rows:
        print(f"{target}: left out: {reason}", file=sys.stderr)


def reader(task: SourceParameters, bags: Read) -> Read:
    """Reader of a task; `bags`: its kind's own.

    Raises InputError: there is no such reader, or it does not support this kind.
    """
    if task.reader == BAGS:
        return bags
    module = task.reader if "." in task.reader else f"structlearn.readers.{task.reader}"
    function = f"read_{task.kind.rpartition('.')[2]}"
    try:
        read = getattr(import_module(module), function, None)
    except ModuleNotFoundError as error:
        if not module.startswith(str(error.name)):
            raise
        read = None
    if read is None:
        raise InputError(f"reader '{task.reader}': there is no {function} in {module}")
    return read


def read_source(task: SourceParameters, source: str, left_out: LeftOut, bags: Read) -> Any:
    """Read a file or folder with a task's reader.

    Raises MissingInputError: a public set is not here. InputError: it cannot be read.
    """
    path = local_path(source)
    if is_public(source) and not path.exists():
        raise MissingInputError(f"{source}: not recorded here")
    return reader(task, bags)(path, task, left_out)


def write_checked_streams(
    task: SourceParameters, recordings: Iterable[Recording], folder: Path, left_out: LeftOut
) -> None:
    """Write `streams` at the sensors' own rates, of recordings that can be put on one clock."""
    checked = _resampled(task, recordings, None, left_out)
    write_streams(map(itemgetter(0), checked), folder / "streams.parquet")


def on_clock(
    task: SourceParameters,
    recordings: Iterable[Recording],
    clock: ClockParameters | None,
    left_out: LeftOut,
    refuse_jumps: bool = True,
) -> Iterator[Demonstration]:
    """Resample recordings to a clock, one by one; failing ones are left out or an error, see `goes_on`."""
    return map(itemgetter(1), _resampled(task, recordings, clock, left_out, refuse_jumps))


def _resampled(
    task: SourceParameters,
    recordings: Iterable[Recording],
    clock: ClockParameters | None,
    left_out: LeftOut,
    refuse_jumps: bool = True,
) -> Iterator[tuple[Recording, Demonstration]]:
    """Recordings and what `on_clock` makes of them."""
    on, empty = clock.model_dump() if clock else {}, True  # default: the rate of the poses
    frames: Frames = {}
    for recording in recordings:
        try:
            check_same_frames(recording, frames)
            run = synchronise(recording, **on, refuse_jumps=refuse_jumps)
        except InputError as error:
            if not goes_on(task):
                raise InputError(f"{task.source}: {error}") from error
            left_out[recording.name] = str(error)
        else:
            empty = False
            yield recording, run
            del run
        del recording  # before the next one is read
    if empty:
        raise InputError(f"{task.source}: holds no recording that can be read")


def check_same_frames(recording: Recording, frames: Frames) -> None:
    """Raise InputError if a topic has another frame than in the recordings before, whose frames are kept."""
    for stream in recording.streams:
        if stream.frame:
            frame, name = frames.setdefault(stream.topic, (stream.frame, recording.name))
            if frame != stream.frame:
                raise InputError(
                    f"{recording.name}: {stream.topic}: frame_id is {stream.frame}, in {name} it is {frame}"
                )


def goes_on(task: SourceParameters) -> bool:
    """Whether failing recordings are left out: for public sets, or if the entry says so."""
    return is_public(task.source) or task.skips_failures


def subfolders(source: Path) -> list[Path]:
    """Folders inside a folder except hidden ones, sorted by name."""
    inside = sorted(source.iterdir()) if source.is_dir() else []
    return [path for path in inside if path.is_dir() and not path.name.startswith(".")]
