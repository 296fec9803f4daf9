"""The reader `lerobot`: episodes of a LeRobotDataset v3.0 as demonstrations of movements.

The pose is a feature with columns x, y, z and, if orientations were recorded, qw, qx, qy, qz
(`topics: {pose: observation.pose}`), or is computed by a URDF from joints
(`topics: {pose: {urdf: .., tip: .., topic: observation.state}}`), with the joints' names as column names,
optionally followed by `.pos`. Other signals are likewise given by the names of their features. Videos are not
read.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.artefacts import holding
from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers.clock import check_recording
from structlearn.readers.computed_pose import joint_pose
from structlearn.readers.demonstration import Kind, Recording, Stream
from structlearn.readers.foreign_tables import read_parquet, read_text
from structlearn.readers.joint_streams import JointSeries
from structlearn.readers.source import JointPose

VERSION = "v3."
POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
GROUPED_BY = "episode_index"
# Kind of stream by the role of a feature's topic, except for the pose
KINDS: Mapping[str, Kind] = {"joint_states": "joint_positions", "wrench": "wrench", "tactile": "tactile"}


def read_movement(folder: Path, entry: Any, left_out: dict[str, str]) -> list[Recording]:
    """Every episode, named by its number, with the signals of the entry's topics."""
    topics, recordings = entry.topics, []
    with holding(folder, "LeRobotDataset that can be read"):
        info = read_info(folder)
        features = info["features"]
        for name in topics.topics:
            if name not in features:
                raise InputError(f"{folder}: has no feature {name}; it has {', '.join(features)}")
        signals = [(KINDS[role], name) for name, role in topics.roles() if role in KINDS]
        digits = len(str(info["total_episodes"] - 1))
        for number, frames in read_frames(folder, topics.topics).groupby(GROUPED_BY, sort=True):
            name = f"episode {number:0{digits}d}"
            stamps = np.round(1e9 * frames["frame_index"].to_numpy() / float(info["fps"])).astype(np.int64)
            columns = {name: np.stack(frames[name].to_numpy()).astype(float) for name in topics.topics}
            provenance = {"origin": "recorded", "source": f"LeRobotDataset {folder.name}, {name}"}
            where = f"{folder}: {name}"
            if isinstance(topics.pose, JointPose):
                angles: dict[Kind, np.ndarray] = {"joint_positions": columns[topics.pose.topic]}
                joints = _joints(features[topics.pose.topic])
                series = JointSeries(topics.pose.topic, joints, 0, stamps, angles)
                pose = joint_pose(where, [series], topics.pose).values  # noqa: PD011 - of a stream
            elif (axes := tuple(features[topics.pose]["names"] or ())) in (POSE, POSE[:3]):
                pose = columns[topics.pose]
            else:
                listing = f"{topics.pose} has the columns {', '.join(axes)}"
                raise InputError(f"{where}: {listing}, not {', '.join(POSE)}")
            if pose.shape[1] == 3:  # orientation not recorded
                pose = np.hstack([pose, np.tile([1.0, 0.0, 0.0, 0.0], (len(stamps), 1))])
                provenance["orientation"] = "not recorded"
            streams = [Stream("pose", "pose", stamps, pose)]
            for kind, feature in signals:
                joints = _joints(features[feature]) if kind == "joint_positions" else ()
                streams.append(Stream(feature, kind, stamps, columns[feature], joints))
            recordings.append(Recording(name, tuple(streams), provenance=provenance))
            check_recording(recordings[-1])
    return recordings


def read_info(folder: Path) -> Mapping[str, Any]:
    """`meta/info.json`."""
    path = folder / "meta/info.json"
    if not path.exists():
        raise MissingInputError(f"{path}: no such file, so this is no LeRobotDataset")
    try:
        info = json.loads(read_text(path))
        version, _ = str(info["codebase_version"]), info["features"]
        if not (1e-3 < float(info["fps"]) < 1e6 and 0 < int(info["total_episodes"]) < 1e9):
            raise ValueError("fps and total_episodes must be positive, and less than 1e6 and 1e9")
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise InputError(f"{path}: not the description of a LeRobotDataset: {error!r}") from error
    if not version.startswith(VERSION):
        raise InputError(f"{path}: is of version {version}, not {VERSION}0; lerobot converts it")
    return info


def read_frames(folder: Path, features: list[str]) -> pd.DataFrame:
    """Some features of all frames in order."""
    files = sorted((folder / "data").glob("chunk-*/file-*.parquet"))
    if not files:
        raise InputError(f"{folder}/data: holds no file of frames")
    numbered, parts = [GROUPED_BY, "frame_index"], []
    for file in files:
        frames = read_parquet(file, [*numbered, *features])
        if not all(pd.api.types.is_integer_dtype(frames[name]) for name in numbered):
            raise InputError(f"{file}: {' or '.join(numbered)} has something that is no whole number")
        parts.append(frames)
    return pd.concat(parts, ignore_index=True).sort_values(numbered, kind="stable")


def _joints(feature: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(str(name).removesuffix(".pos") for name in feature["names"] or ())
