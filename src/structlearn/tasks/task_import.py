"""Import of a task's recordings by its reader: checked, on the task's clock, and named by their purpose.

A reader is a module of `structlearn.readers` with a function for each kind of data it supports:

    read_movement(folder, entry, left_out) -> list[Recording]
    read_motion(folder, entry, left_out) -> list[JointLog] | list[DriveLog]
    read_obstacles(folder, entry, left_out) -> list[Recording], with shapes, and `person` in their provenance
    read_touch(folder, entry, left_out) -> list[TouchLog], or list[Recording] if `entry.over_time`

`entry` has the task's parameters; `left_out[file] = reason` records what could not be read.
"""

import importlib
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

import numpy as np
import pandas as pd

from dissertation.recorded.coupling_samples import RecordedSamples
from structlearn import readers
from structlearn.avoidance.avoidance_dataset import to_table
from structlearn.core.artefacts import publish, write_csv, write_metrics, write_table
from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.params import home_path
from structlearn.readers import Recording, read_recordings, synchronise
from structlearn.readers.bag_recording import read_joint_logs
from structlearn.readers.demonstration import Demonstration, write_runs, write_streams
from structlearn.readers.foreign_tables import read_each
from structlearn.readers.joint_log import JointLog, write_log_table
from structlearn.readers.source import ClockParameters, SourceParameters, recording_files, setting_label
from structlearn.readers.user_tables import (
    TouchLog,
    read_touch_table,
    touch_of,
    touch_tables,
    write_touch_logs,
)
from structlearn.segmentation.repeats import split
from structlearn.tasks.motion.motion_parameters import MotionParameters
from structlearn.tasks.movement.movement_parameters import MovementEntry
from structlearn.tasks.task_entry import ObstacleEntry
from structlearn.tasks.task_files import LEFT_OUT, is_public, leave_out, local_path
from structlearn.tasks.touch.touch_parameters import TouchParameters

# Readers in other modules; `bags`: at the end of this one, for all formats of `readers.source`
OTHERS = {"bags": __name__, "coupling_samples": "dissertation.recorded.coupling_samples"}

LeftOut = dict[str, str]  # reasons why files could not be read, by file name


def import_task(task: SourceParameters, target: Path) -> None:
    """Publish a task's recordings in a folder, with `left_out.csv`.

    If a public set is missing or cannot be read, the folder says why, and the pipeline continues. Raises
    InputError: a lab's recordings cannot be read or fail their checks.
    """
    left_out, public = LeftOut(), f"{local_path('$DATA')}/"
    with publish(target) as folder:
        folder.mkdir()
        try:
            WRITERS[task.kind](task, folder, left_out)
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


def reader(task: SourceParameters) -> Callable[[Path, Any, LeftOut], Any]:
    """Reader function of a task for its kind of data.

    Raises InputError: there is no such reader, or it does not support this kind.
    """
    name, function = task.reader, f"read_{task.kind}"
    modules = {one.name: f"{readers.__name__}.{one.name}" for one in iter_modules(readers.__path__)} | OTHERS
    found = getattr(importlib.import_module(modules[name]), function, None) if name in modules else None
    if found is None:
        raise InputError(f"reader '{name}': there is no {function} in structlearn/readers/{name}.py")
    return found


def read_source(task: SourceParameters, source: str, left_out: LeftOut) -> Any:
    """Read a file or folder with a task's reader.

    Raises MissingInputError: a public set is not here. InputError: it cannot be read.
    """
    path = local_path(source)
    if is_public(source) and not path.exists():
        raise MissingInputError(f"{source}: not recorded here")
    return reader(task)(path, task, left_out)


def _movements(task: MovementEntry, folder: Path, left_out: LeftOut) -> None:
    """Write `demonstrations`, `executions`, `corrections/SETTING`, `corrected`, `recordings`, `repeats`."""
    recordings = {"demonstrations": read_source(task, task.source, left_out)}
    if task.feedback is not None:
        recordings["executions"] = read_source(task, task.feedback.executions, left_out)
        corrections = setting_folders(local_path(task.feedback.corrections), task.feedback.settings)
        for label, path in corrections.items():
            recordings[f"corrections/{label}"] = reader(task)(path, task, left_out)
    if task.corrections is not None:
        other = task.model_copy(update={"part": task.corrections.part})
        try:
            recordings["corrected"] = read_source(other, task.corrections.source, left_out)
        except MissingInputError as missing:  # a public set may still have the other movements
            print(missing)
    for name, its in recordings.items():
        runs = _on_clock(task, its, task.clock, left_out)
        if name == "demonstrations" and task.repeats != 1 and task.segment is not None:
            count = None if task.repeats == "auto" else task.repeats
            runs, repeats = split(runs, task.segment, count)
            write_table(repeats, folder / "repeats.parquet")
        write_runs(runs, folder / f"{name}.parquet")
    write_table(recording_table(recordings), folder / "recordings.parquet")


def _logs(task: MotionParameters, folder: Path, left_out: LeftOut) -> None:
    """Write `logs`."""
    logs = read_source(task, task.source, left_out)
    if not logs:
        raise MissingInputError(f"{task.source}: holds no log that can be read")
    write_log_table(logs, folder / "logs.parquet")


def _touches(task: TouchParameters, folder: Path, left_out: LeftOut) -> None:
    """Write `touches`, or, for a finger over time, `streams` at the sensors' own rates."""
    found = read_source(task, task.source, left_out)
    if task.over_time:
        checked = {one.name for one in _on_clock(task, found, None, left_out)}
        write_streams([one for one in found if one.name in checked], folder / "streams.parquet")
    else:
        write_touch_logs(found, folder / "touches.parquet")


def _reaches(task: ObstacleEntry, folder: Path, left_out: LeftOut) -> None:
    """Write `reaches` (runs), or `samples` of the coupling term with their `provenance`."""
    found = read_source(task, task.source, left_out)
    if isinstance(found, RecordedSamples):
        write_table(to_table(found.samples), folder / "samples.parquet")
        write_metrics(found.provenance, folder / "provenance.json")
    else:
        runs = _on_clock(task, found, task.clock, left_out, refuse_jumps=False)  # the protocol reports jumps
        write_runs(runs, folder / "reaches.parquet")


# Functions by kind that read with the task's reader and write to a folder
WRITERS: dict[str, Callable[[Any, Path, LeftOut], None]] = {
    "movement": _movements,
    "motion": _logs,
    "touch": _touches,
    "obstacles": _reaches,
}


def _on_clock(
    task: SourceParameters,
    recordings: list[Recording],
    clock: ClockParameters | None,
    left_out: LeftOut,
    refuse_jumps: bool = True,
) -> list[Demonstration]:
    """Resample recordings to a clock; failing ones are left out or an error, see `_goes_on`."""
    on = clock.model_dump() if clock else {}  # default: the rate of the poses
    runs = []
    for one in recordings:
        try:
            runs.append(synchronise(one, **on, refuse_jumps=refuse_jumps))
        except InputError as error:
            if not _goes_on(task):
                raise InputError(f"{task.source}: {error}") from error
            left_out[one.name] = str(error)
    if not runs:
        raise InputError(f"{task.source}: holds no recording that can be read")
    return runs


def recording_table(recordings: Mapping[str, list[Recording]]) -> pd.DataFrame:
    """Per recording: `set`, `recording`, `duration_s`, `pose_hz`, `largest_gap_ms`, `signals`, `stamps`."""
    rows = []
    for name, one in ((name.replace("/", ", "), one) for name, its in recordings.items() for one in its):
        pose = next(stream for stream in one.streams if stream.kind == "pose")
        kinds = dict.fromkeys(stream.kind.replace("_", " ") for stream in one.streams)
        seconds, rate_hz = (
            1e-9 * float(pose.stamps[-1] - pose.stamps[0]),
            1.0 / np.median(1e-9 * np.diff(pose.stamps)),
        )
        gap_ms = max(1e-6 * np.diff(stream.stamps).max() for stream in one.streams)
        stamps = one.provenance.get("stamps", "")
        rows.append((name, one.name, seconds, rate_hz, gap_ms, ", ".join(kinds), stamps))
    columns = ["set", "recording", "duration_s", "pose_hz", "largest_gap_ms", "signals", "stamps"]
    return pd.DataFrame(rows, columns=columns)


def read_movement(folder: Path, entry: Any, left_out: LeftOut) -> list[Recording]:
    """Read recordings with the signals of the entry's topics."""
    paths, skipped = [file.path for file in recording_files(folder)], left_out if _goes_on(entry) else None
    return read_each(lambda path: read_recordings(path, entry.topics, entry.stamps)[0], paths, skipped)


def _goes_on(task: SourceParameters) -> bool:
    """Whether failing recordings are left out: for public sets, or if the entry says so."""
    cutting = task.segment if isinstance(task, MovementEntry) else None
    return is_public(task.source) or (cutting is not None and cutting.skip_failures)


def read_motion(folder: Path, entry: Any, left_out: LeftOut) -> Sequence[JointLog]:
    """Read joint logs, with the joints of the entry's URDF."""
    from structlearn.tasks.motion.joint_motion import arm_of

    robot, _ = arm_of(entry)
    in_urdf, recorded = dict(entry.joints), {name: its for its, name in entry.joints}
    asked = [recorded.get(name, name) for name in robot.tree.names]
    logs = read_joint_logs(folder, entry.topic, asked, entry.stamps)
    return [replace(log, joints=tuple(in_urdf.get(name, name) for name in log.joints)) for log in logs]


def read_obstacles(folder: Path, entry: Any, left_out: LeftOut) -> list[Recording]:
    """Read reaches of a folder, each by its own person, or of its subfolders, one per person."""
    people = [path for path in subfolders(folder) if not (path / "metadata.yaml").exists()]  # not bags
    found = []
    for one in people or [folder]:
        for reach in read_recordings(one, entry.topics, entry.stamps):
            name, person = (f"{one.name} {reach.name}", one.name) if people else (reach.name, reach.name)
            found.append(replace(reach, name=name, provenance={**reach.provenance, "person": person}))
    return found


def read_touch(folder: Path, entry: Any, left_out: LeftOut) -> Sequence[TouchLog | Recording]:
    """Read tables of touches, or else bags with a tactile signal and the pose of what touches."""
    logs = [log for path in touch_tables(folder) for log in read_touch_table(path, entry.channels)]
    if logs:
        return logs
    recordings = read_recordings(folder, entry.topics, entry.stamps)
    if entry.over_time:
        return recordings
    return [touch_of(synchronise(one, **entry.clock.model_dump())) for one in recordings]


def setting_folders(source: str | Path, named: Sequence[str]) -> dict[str, Path]:
    """Folders of a source by setting label: the named ones first, then all others.

    Raises InputError: there is no such folder, two of its folders have the same setting, or a named one is
    missing.
    """
    source, found = home_path(source), dict[str, Path]()
    if not source.is_dir():
        raise InputError(f"{source}: no such folder")
    for path in subfolders(source):
        label = setting_label(path.name)
        if label in found:
            raise InputError(f"{path}: the setting {label} has another folder, {found[label].name}, too")
        found[label] = path
    if missing := ", ".join(label for label in named if label not in found):
        there = ", ".join(found) or "none"
        raise InputError(f"{source}: nothing was recorded in the setting {missing}; there are {there}")
    return {label: found[label] for label in dict.fromkeys((*named, *found))}


def subfolders(source: Path) -> list[Path]:
    """Folders inside a folder except hidden ones, sorted by name."""
    inside = sorted(source.iterdir()) if source.is_dir() else []
    return [path for path in inside if path.is_dir() and not path.name.startswith(".")]
