"""Recordings of movements, named by their purpose."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.artefacts import write_table
from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.params import home_path
from structlearn.readers import Recording, read_recordings
from structlearn.readers.demonstration import Demonstration, each_run, read_runs, write_runs
from structlearn.readers.foreign_tables import each_readable
from structlearn.readers.source import setting_label
from structlearn.readers.source_files import recording_files
from structlearn.segmentation.repeats import excerpt, split_repeats
from structlearn.tasks.movement.parameters import MovementEntry
from structlearn.tasks.task_files import local_path
from structlearn.tasks.task_import import LeftOut, goes_on, on_clock, read_source, subfolders


def write(task: MovementEntry, folder: Path, left_out: LeftOut) -> None:
    """Write `demonstrations`, `executions`, `corrections/SETTING`, `corrected`, `recordings`, `repeats`."""
    sets: dict[str, Iterable[Recording]] = {"demonstrations": read_source(task, task.source, left_out, read)}
    if task.feedback is not None:
        sets["executions"] = read_source(task, task.feedback.executions, left_out, read)
        corrections = setting_folders(local_path(task.feedback.corrections), task.feedback.settings)
        for label, path in corrections.items():
            sets[f"corrections/{label}"] = read_source(task, str(path), left_out, read)
    if task.corrections is not None:
        other = task.model_copy(update={"part": task.corrections.part})
        try:
            sets["corrected"] = read_source(other, task.corrections.source, left_out, read)
        except MissingInputError as missing:  # a public set may still have the other movements
            print(missing)
    table: list[tuple[Any, ...]] = []
    for name, recordings in sets.items():
        path = folder / f"{name}.parquet"
        write_runs(on_clock(task, _listed(name, recordings, table), task.clock, left_out), path)
        if name == "demonstrations" and task.repeats != 1 and task.segment is not None:
            count = None if task.repeats == "auto" else task.repeats
            _, repeats = split_repeats(read_runs(path, ()), task.segment, count)
            write_table(repeats, folder / "repeats.parquet")
            write_runs(_split(each_run(path), repeats), path)
    write_table(pd.DataFrame(table, columns=COLUMNS), folder / "recordings.parquet")


COLUMNS = ["set", "recording", "duration_s", "pose_hz", "largest_gap_ms", "signals", "stamps"]


def _listed(name: str, recordings: Iterable[Recording], table: list[tuple[Any, ...]]) -> Iterator[Recording]:
    """Recordings of a set, each with a row of `COLUMNS` in a table."""
    for one in recordings:
        pose = one.leading
        kinds = dict.fromkeys(stream.kind.replace("_", " ") for stream in one.streams)
        seconds = 1e-9 * float(pose.stamps[-1] - pose.stamps[0])
        rate_hz = 1.0 / np.median(1e-9 * np.diff(pose.stamps))
        gaps = (np.diff(stream.stamps) for stream in one.streams if stream.kind != "digital")
        gap_ms = max(1e-6 * gap.max() for gap in gaps)
        stamps = one.provenance.get("stamps", "")
        row = (name.replace("/", ", "), one.name, seconds, rate_hz, gap_ms, ", ".join(kinds), stamps)
        table.append(row)
        yield one
        del one, pose  # before the next one is read


def _split(recordings: Iterable[Demonstration], repeats: pd.DataFrame) -> Iterator[Demonstration]:
    """Demonstrations of one repeat each; `repeats`: table of `split_repeats`."""
    for recording in recordings:
        for row in repeats[repeats["recording"] == recording.name].itertuples():
            first, last = np.searchsorted(recording.time, [row.start_s, row.end_s]).tolist()
            yield excerpt(recording, row.demonstration, first, last)


def read(folder: Path, entry: Any, left_out: LeftOut) -> Iterator[Recording]:
    """Read recordings with the signals of the entry's topics."""
    paths, skipped = [file.path for file in recording_files(folder)], left_out if goes_on(entry) else None
    return each_readable(lambda path: read_recordings(path, entry.topics, entry.stamps)[0], paths, skipped)


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
