"""Recordings of movements, named by their purpose."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.artefacts import write_table
from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.params import home_path
from structlearn.readers import Recording, read_recordings
from structlearn.readers.demonstration import write_runs
from structlearn.readers.foreign_tables import read_each
from structlearn.readers.source import setting_label
from structlearn.readers.source_files import recording_files
from structlearn.segmentation.repeats import split_repeats
from structlearn.tasks.movement.parameters import MovementEntry
from structlearn.tasks.task_files import local_path
from structlearn.tasks.task_import import LeftOut, goes_on, on_clock, read_source, subfolders


def write(task: MovementEntry, folder: Path, left_out: LeftOut) -> None:
    """Write `demonstrations`, `executions`, `corrections/SETTING`, `corrected`, `recordings`, `repeats`."""
    recordings = {"demonstrations": read_source(task, task.source, left_out, read)}
    if task.feedback is not None:
        recordings["executions"] = read_source(task, task.feedback.executions, left_out, read)
        corrections = setting_folders(local_path(task.feedback.corrections), task.feedback.settings)
        for label, path in corrections.items():
            recordings[f"corrections/{label}"] = read_source(task, str(path), left_out, read)
    if task.corrections is not None:
        other = task.model_copy(update={"part": task.corrections.part})
        try:
            recordings["corrected"] = read_source(other, task.corrections.source, left_out, read)
        except MissingInputError as missing:  # a public set may still have the other movements
            print(missing)
    for name, its in recordings.items():
        runs = on_clock(task, its, task.clock, left_out)
        if name == "demonstrations" and task.repeats != 1 and task.segment is not None:
            count = None if task.repeats == "auto" else task.repeats
            runs, repeats = split_repeats(runs, task.segment, count)
            write_table(repeats, folder / "repeats.parquet")
        write_runs(runs, folder / f"{name}.parquet")
    write_table(recording_table(recordings), folder / "recordings.parquet")


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


def read(folder: Path, entry: Any, left_out: LeftOut) -> list[Recording]:
    """Read recordings with the signals of the entry's topics."""
    paths, skipped = [file.path for file in recording_files(folder)], left_out if goes_on(entry) else None
    return read_each(lambda path: read_recordings(path, entry.topics, entry.stamps)[0], paths, skipped)


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
