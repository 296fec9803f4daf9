"""The recordings of a task, read once: checked, put on its clock, named by what they are for."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError
from structlearn.core.params import local_path
from structlearn.readers import Recording, StampPolicy, TopicMap, read_recordings, synchronise
from structlearn.readers.clock import ClockParameters
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.settings import setting_folders
from structlearn.tasks.task_entry import TaskParameters
from structlearn.tasks.task_files import RUNS

WORDS = {
    "joint_positions": "joint positions",
    "joint_velocities": "joint velocities",
    "joint_torques": "joint torques",
    "tool_to_board": "tool to board",
}
"""What kinds of streams are called, where it is not their name."""

Runs = dict[str, dict[str, list[Demonstration]]]
"""By kind (a folder of the task's data), then by name of the file there."""


def task_runs(task: TaskParameters) -> tuple[dict[str, list[Recording]], Runs]:
    """Read all recordings of a task's movements.

    Returns:
        Recordings as they came, by set; and the runs of demonstrations, executions, corrections (by setting)
        and reaches past obstacles (named PERSON RECORDING, with the person in their provenance).

    Raises:
        InputError: a recording cannot be read or fails its checks.
    """
    recordings: dict[str, list[Recording]] = {}
    runs: Runs = {"demonstrations": {}, "executions": {}, "corrections": {}, "reaches": {}}
    if task.source is not None and task.topics is not None:
        recordings["demonstrations"] = read_recordings(local_path(task.source), task.topics, task.stamps)
        runs["demonstrations"][RUNS] = _on_clock(task.source, recordings["demonstrations"], task.clock)
    if task.feedback is not None and task.topics is not None:
        source = task.feedback.executions
        recordings["executions"] = read_recordings(local_path(source), task.topics, task.stamps)
        runs["executions"][RUNS] = _on_clock(source, recordings["executions"], task.clock)
        folders = setting_folders(task.feedback.corrections, task.feedback.settings)
        for label, folder in folders.items():
            its = read_recordings(folder, task.topics, task.stamps)
            recordings[f"corrections, {label}"] = its
            runs["corrections"][label] = _on_clock(str(folder), its, task.clock)
    if task.obstacles is not None:
        reaches = _reaches(local_path(task.obstacles.source), task.obstacles.topics, task.stamps)
        runs["reaches"][RUNS] = _on_clock(task.obstacles.source, reaches, task.clock)
    return recordings, runs


def _on_clock(source: str, recordings: list[Recording], clock: ClockParameters) -> list[Demonstration]:
    runs = []
    for recording in recordings:
        try:
            runs.append(synchronise(recording, clock.rate_hz, clock.max_gap_s))
        except InputError as error:
            raise InputError(f"{source}: {error}") from error
    return runs


def _reaches(source: Path, topics: TopicMap, stamps: StampPolicy) -> list[Recording]:
    """Reaches of a folder, or of its sub-folders, one per person; else each is a person of its own."""
    inside = sorted(source.iterdir()) if source.is_dir() else []
    people = [path for path in inside if path.is_dir() and not path.name.startswith(".")]
    people = [path for path in people if not (path / "metadata.yaml").exists()]  # those are bags
    found = []
    for folder in people or [source]:
        for one in read_recordings(folder, topics, stamps):
            name, person = (f"{folder.name} {one.name}", folder.name) if people else (one.name, one.name)
            found.append(replace(one, name=name, provenance={**one.provenance, "person": person}))
    return found


def came_in(recordings: Mapping[str, list[Recording]]) -> pd.DataFrame:
    """Per recording: `set`, `recording`, `duration_s`, `pose_hz`, `largest_gap_ms`, `signals`, `stamps`."""
    rows = []
    for kind, its in recordings.items():
        for one in its:
            pose = next(stream for stream in one.streams if stream.kind == "pose")
            kinds = dict.fromkeys(stream.kind for stream in one.streams)
            rows.append(
                {
                    "set": kind,
                    "recording": one.name,
                    "duration_s": 1e-9 * float(pose.stamps[-1] - pose.stamps[0]),
                    "pose_hz": 1.0 / np.median(1e-9 * np.diff(pose.stamps)),
                    "largest_gap_ms": max(1e-6 * np.diff(stream.stamps).max() for stream in one.streams),
                    "signals": ", ".join(WORDS.get(one, one) for one in kinds),
                    "stamps": one.provenance.get("stamps", ""),
                }
            )
    return pd.DataFrame(rows)
