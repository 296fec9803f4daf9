"""Export of a task's demonstrations as a LeRobotDataset (v3.0): states, actions, primitives as subtasks.

    meta/info.json, stats.json, tasks.parquet, subtasks.parquet, episodes/chunk-000/file-000.parquet
    data/chunk-000/file-000.parquet

An episode is a demonstration from the start of its first primitive to the end of its last. Its state is the
joint positions if recorded, otherwise the pose; its action is the next frame's state, as usual for
demonstrations by hand, followed by the next frame's outputs. No images are written. `meta/episodes` also has
the quality of each demonstration.
"""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow

from structlearn.core import quaternion
from structlearn.core.artefacts import publish, write_arrow
from structlearn.core.errors import InputError
from structlearn.readers.demonstration import PARTS, Demonstration
from structlearn.segmentation.quality import quality
from structlearn.segmentation.segments import Segmentation

VERSION = "v3.0"
CHUNK, FILE_MB = 1000, 100
PLACE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
COUNTERS = ("frame_index", "episode_index", "index", "task_index", "subtask_index")
POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")

Frames = dict[str, np.ndarray]  # one episode: (T, D) or (T,) by feature name


def write_lerobot(
    runs: Sequence[Demonstration],
    segmentation: Segmentation,
    target: Path,
    task: str,
    smoothing_hz: float,
    fps: int | None = None,
    robot: str | None = None,
) -> int:
    """Publish a dataset of the demonstrations that were cut; return its number of episodes.

    `task`: what is done, in words; `smoothing_hz`: low-pass of positions for the quality measures; `fps`:
    frames per second, by default the clock's rate if whole; `robot`: its name. Raises InputError: no
    demonstration was cut, signals differ between demonstrations, or `fps` is needed, not positive or above
    the clock's rate.
    """
    cuts = segmentation.results
    runs = [run for run in runs if all(run.name in table.index for table in cuts.values())]
    if not runs:
        raise InputError(f"{target}: no demonstration was cut, so there is no episode")
    rate = 1.0 / runs[0].dt
    if fps is None and abs(rate - round(rate)) > 1e-6 * rate:
        raise InputError(
            f"{target}: the clock has {rate:g} Hz; a LeRobotDataset needs a whole number, give one"
        )
    most = math.ceil(rate * (1 - 1e-6))
    if fps is not None and not 1 <= fps <= most:
        raise InputError(
            f"{target}: {fps} frames per second: give 1 to {most}, the clock's rate, above which frames are "
            "only interpolated"
        )
    fps = fps or round(rate)
    names = state_names(runs[0])
    if any(state_names(run) != names for run in runs):
        raise InputError(f"{target}: demonstrations differ in their signals or joints")
    episodes = [frames(run, cuts, fps) for run in runs]
    measured = quality(runs, cuts, smoothing_hz).set_index("demonstration")
    with publish(target) as folder:
        rows = _write_data(episodes, names, folder)
        for row, run in zip(rows, runs, strict=True):
            row |= {"tasks": [task], "demonstration": run.name}
            row |= {f"quality/{name}": measured.loc[run.name, name] for name in measured if name != "rank"}
        _write_meta(rows, episodes, names, tuple(cuts), task, fps, robot, folder)
    return len(episodes)


def state_names(run: Demonstration) -> dict[str, tuple[str, ...]]:
    """Column names of each signal's feature."""
    pose = state = POSE[: 3 if run.orientation is None else 7]
    if run.joint_positions is not None:
        count = run.joint_positions.shape[1]
        state = run.joint_names or tuple(f"joint_{place + 1}" for place in range(count))
    names = {} if run.of_joints else {"observation.pose": pose}
    names["observation.state"] = state
    if run.wrench is not None:
        names["observation.wrench"] = tuple(PARTS["wrench"])
    if run.tactile is not None:
        names["observation.tactile"] = tuple(f"electrode_{n + 1}" for n in range(run.tactile.shape[1]))
    if outputs := (*run.output_names, *run.digital_names):
        names["observation.outputs"] = outputs
    return names | {"action": (*state, *outputs)}


def frames(run: Demonstration, cuts: Mapping[str, pd.DataFrame], fps: int) -> Frames:
    """Frames of an episode; between two primitives, the earlier one continues."""
    starts = np.array([table.loc[run.name, "start_s"] for table in cuts.values()])
    end = max(table.loc[run.name, "end_s"] for table in cuts.values())
    count = int(np.floor((end - starts[0]) * fps + 1e-6)) + 1
    time = np.arange(count) / fps
    at = np.clip(starts[0] + time, run.time[0], run.time[-1])

    def sampled(values: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(at, run.time, column) for column in values.T], axis=1)

    pose = sampled(run.position)
    if run.orientation is not None:
        turned = quaternion.interpolate(at, run.time, run.orientation)
        pose = np.hstack([pose, quaternion.sign_continuous(turned)])
    state = pose if run.joint_positions is None else sampled(run.joint_positions)
    columns = {} if run.of_joints else {"observation.pose": pose}
    columns["observation.state"] = action = state
    for name in ("wrench", "tactile"):
        if (values := getattr(run, name)) is not None:
            columns[f"observation.{name}"] = sampled(values)
    outputs = [] if run.outputs is None else [sampled(run.outputs)]
    if run.digital is not None:
        outputs.append(run.digital[np.searchsorted(run.time, at, side="right") - 1])
    if outputs:
        columns["observation.outputs"] = np.hstack(outputs)
        action = np.hstack([state, *outputs])
    columns |= {"action": np.vstack([action[1:], action[-1:]]), "timestamp": time}
    columns = {name: values.astype(np.float32) for name, values in columns.items()}
    subtask = np.searchsorted(starts, at + 1e-9, side="right") - 1
    return columns | {"frame_index": np.arange(count), "subtask_index": subtask}


def _write_data(episodes: Sequence[Frames], names: Mapping[str, Any], folder: Path) -> list[dict[str, Any]]:
    """Write all frames in files of at most `FILE_MB`; return the place and statistics of each episode."""
    rows: list[dict[str, Any]] = []
    files: list[list[Frames]] = [[]]
    bytes_in_file, first = 0, 0
    for number, episode in enumerate(episodes):
        count = len(episode["timestamp"])
        episode |= {"episode_index": np.full(count, number), "index": first + np.arange(count)}
        episode["task_index"] = np.zeros(count, dtype=np.int64)
        size = sum(values.nbytes for values in episode.values())
        if files[-1] and bytes_in_file + size > FILE_MB * 2**20:
            files.append([])
            bytes_in_file = 0
        files[-1].append(episode)
        bytes_in_file += size
        chunk, file = divmod(len(files) - 1, CHUNK)
        row: dict[str, Any] = {"episode_index": number, "length": count, "dataset_from_index": first}
        row |= {"dataset_to_index": first + count, "data/chunk_index": chunk, "data/file_index": file}
        row |= {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        for name, by in statistics([episode]).items():
            row |= {f"stats/{name}/{kind}": value for kind, value in by.items()}
        rows.append(row)
        first += count
    for number, its in enumerate(files):
        columns = {}
        for name, one in its[0].items():
            flat = pyarrow.array(np.concatenate([episode[name] for episode in its]).reshape(-1))
            wide = one.ndim > 1
            columns[name] = pyarrow.FixedSizeListArray.from_arrays(flat, one.shape[1]) if wide else flat
        chunk, file = divmod(number, CHUNK)
        path = folder / "data" / PLACE.format(chunk_index=chunk, file_index=file)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_arrow(pyarrow.table(columns), path)
    return rows


def statistics(episodes: Sequence[Frames]) -> dict[str, dict[str, list[float]]]:
    """`min`, `max`, `mean`, `std` and `count` of each feature, by column."""
    statistics = {}
    for name in episodes[0]:
        values = np.concatenate([episode[name] for episode in episodes]).astype(float)
        values = values.reshape(len(values), -1)
        kinds = {kind: getattr(values, kind)(axis=0).tolist() for kind in ("min", "max", "mean", "std")}
        statistics[name] = kinds | {"count": [len(values)]}
    return statistics


def _write_meta(
    rows: Sequence[dict[str, Any]],
    episodes: Sequence[Frames],
    names: Mapping[str, tuple[str, ...]],
    subtasks: Sequence[str],
    task: str,
    fps: int,
    robot: str | None,
    folder: Path,
) -> None:
    features: dict[str, dict[str, Any]] = {
        name: {"dtype": "float32", "shape": [len(parts)], "names": list(parts)}
        for name, parts in names.items()
    }
    for name in ("timestamp", *COUNTERS):
        kind = "float32" if name == "timestamp" else "int64"
        features[name] = {"dtype": kind, "shape": [1], "names": None}
    info = {
        "codebase_version": VERSION,
        "robot_type": robot,
        "total_episodes": len(episodes),
        "total_frames": rows[-1]["dataset_to_index"],
        "total_tasks": 1,
        "chunks_size": CHUNK,
        "data_files_size_in_mb": FILE_MB,
        "video_files_size_in_mb": 2 * FILE_MB,
        "fps": fps,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": f"data/{PLACE}",
        "video_path": None,
        "features": features,
    }
    meta = folder / "meta"
    path = meta / "episodes" / PLACE.format(chunk_index=0, file_index=0)
    path.parent.mkdir(parents=True)
    write_arrow(pyarrow.Table.from_pylist(list(rows)), path)
    for name, value in (("info", info), ("stats", statistics(episodes))):
        (meta / f"{name}.json").write_text(json.dumps(value, indent=4) + "\n", encoding="utf-8")
    for kind, words in (("task", (task,)), ("subtask", subtasks)):
        numbers = pd.DataFrame({f"{kind}_index": range(len(words))}, index=pd.Index(words, name=kind))
        numbers.to_parquet(meta / f"{kind}s.parquet")
