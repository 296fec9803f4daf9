"""The reader `lerobot`: episodes of a LeRobotDataset (v2.x, v3.x) as demonstrations of movements.

The pose is a feature with columns x, y, z and, if orientations were recorded, qw, qx, qy, qz, in any order
and among others (`topics: {pose: observation.pose}`), or is computed by a URDF from joints
(`topics: {pose: {urdf: .., tip: .., topic: observation.state}}`), with the joints' names as column names,
optionally followed by `.pos`; `units: deg` if they are in degrees. Other signals are likewise given by their
features, and `observation.state[0:7]` names columns of one (`lerobot_columns`). The frames are held against
what the set says of itself (`lerobot_frames`). Videos are not read.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from structlearn.core.artefacts import holding
from structlearn.core.errors import InputError
from structlearn.readers.clock import check_recording
from structlearn.readers.computed_pose import in_radians, joint_pose
from structlearn.readers.demonstration import Kind, Recording, Stream
from structlearn.readers.joint_streams import JointSeries, chosen
from structlearn.readers.lerobot_columns import (
    Columns,
    columns_of,
    feature_of,
    joint_columns,
    pose_columns,
    shape_fault,
    table_of,
    wrench_columns,
)
from structlearn.readers.lerobot_frames import (
    EPISODE,
    FRAME,
    INFO,
    check_episode,
    check_total,
    read_frames,
    read_info,
)
from structlearn.readers.source import JointPose, TopicMap, TransformPose

# Kind of stream by the role of a feature's topic, except for the pose
KINDS: Mapping[str, Kind] = {
    "joint_states": "joint_positions",
    "wrench": "wrench",
    "tactile": "tactile",
    "outputs": "outputs",
    "digital": "digital",
}


class Episode(NamedTuple):
    """Frames of one episode with some features."""

    name: str
    where: str  # set and name, for messages
    stamps: np.ndarray  # (T,) int64 ns from 0, by the set's frames per second
    frames: pd.DataFrame  # (T, ..)
    features: Mapping[str, Any]  # as described by the set

    def columns(self, topic: str) -> Columns:
        """Columns that a topic names."""
        first = table_of(self.frames.iloc[:1], feature_of(self.features, topic))
        return columns_of(self.features, topic, first.shape[1])

    def values(self, columns: Columns) -> np.ndarray:
        """(T, D) values of columns."""
        return table_of(self.frames, columns.feature).take(columns.places, axis=1)

    def joints(self, topic: str) -> JointSeries:
        """Joint positions as they were recorded."""
        columns = joint_columns(topic, self.columns(topic))
        return JointSeries(topic, columns.names, 0, self.stamps, {"joint_positions": self.values(columns)})

    def pose(self, source: str | JointPose) -> tuple[Stream, bool]:
        """Pose from a feature or computed from joints, and whether it has a recorded orientation."""
        if isinstance(source, JointPose):
            return joint_pose(f"{self.where}: {source.topic}", [self.joints(source.topic)], source), True
        columns = pose_columns(source, self.columns(source))
        values = self.values(columns)
        if oriented := len(columns.places) > 3:
            return Stream(source, "pose", self.stamps, values), oriented
        turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(values), 1))
        return Stream(source, "pose", self.stamps, np.hstack([values, turns])), oriented


def read_movement(folder: Path, entry: Any, left_out: dict[str, str]) -> list[Recording]:
    """Every episode, named by its number, with the signals of the entry's topics.

    Episodes that fail are left out if the entry says so (`skip_failures`). Raises InputError: an episode
    fails, or the set contradicts itself.
    """
    topics, recordings, failed = entry.topics, list[Recording](), dict[str, InputError]()
    with holding(folder, "LeRobotDataset that can be read"):
        if isinstance(topics.pose, TransformPose):
            raise InputError(f"has no transforms, so {topics.pose.topic} cannot give its pose")
        info = read_info(folder)
        features = [feature_of(info["features"], topic) for topic in topics.topics]
        for episode in read_episodes(folder, info, features, left_out, failed):
            try:
                recordings.append(_recording(folder, episode, topics))
            except InputError as error:
                failed[episode.name] = error
        if failed and not (recordings and getattr(entry, "skips_failures", False)):
            raise next(iter(failed.values()))
    left_out |= {name: str(error) for name, error in failed.items()}
    return recordings


def read_episodes(
    folder: Path,
    info: Mapping[str, Any],
    features: Sequence[str],
    left_out: dict[str, str],
    failed: dict[str, InputError],
) -> Iterator[Episode]:
    """Episodes with some features, in order.

    `left_out`: gets what else is in the folder but not read; `failed`: episodes that are incomplete.
    """
    frames = read_frames(folder, info, list(dict.fromkeys(features)), left_out)
    for feature in features:
        width = table_of(frames.iloc[:1], feature).shape[1]
        if fault := shape_fault(info["features"], feature, width):
            left_out[f"{INFO}: shape of {feature}"] = f"{folder}: {fault}"
    digits, fps = len(str(int(info["total_episodes"]) - 1)), float(info["fps"])
    for number, its in frames.groupby(EPISODE, sort=True):
        name = f"episode {number:0{digits}d}"
        try:
            check_episode(f"{folder}: {name}", its, fps)
        except InputError as error:
            failed[name] = error
            continue
        stamps = np.round(1e9 * its[FRAME].to_numpy() / fps).astype(np.int64)
        yield Episode(name, f"{folder}: {name}", stamps, its, info["features"])
    if not failed:
        check_total(folder, info, len(frames))


def _recording(folder: Path, episode: Episode, topics: TopicMap) -> Recording:
    """Recording of one episode. Raises InputError: it lacks a signal, or a signal fails its check."""
    provenance = {"origin": "recorded", "source": f"LeRobotDataset {folder.name}, {episode.name}"}
    streams, joints = list[Stream](), []
    if topics.pose is not None:
        pose, oriented = episode.pose(topics.pose)  # type: ignore[arg-type] # transforms are refused before
        if not oriented:
            provenance["orientation"] = "not recorded"
        streams.append(pose)
    place = len(streams)
    named = {topic: name for name, topic in (*topics.outputs, *topics.digital)}
    for topic, role in topics.roles():
        if role == "joint_states":
            joints.append(episode.joints(topic))
            if isinstance(topics.pose, JointPose) and topics.pose.topic == topic:
                joints[-1] = in_radians(joints[-1], topics.pose)
        elif role in KINDS:
            columns = episode.columns(topic)
            if role == "wrench":
                columns = wrench_columns(topic, columns)
            called = (named[topic],) if topic in named else ()
            if called and len(columns.places) != 1:
                raise InputError(
                    f"{episode.where}: {topic} has {len(columns.places)} columns; an output is one of them: "
                    f"{columns.feature}[..]"
                )
            streams.append(Stream(topic, KINDS[role], episode.stamps, episode.values(columns), called))
    if topics.joints is not None:
        joints, _ = chosen(episode.where, joints, topics.joints)
    streams[place:place] = [stream for series in joints for stream in series.streams()]
    recording = Recording(episode.name, tuple(streams), provenance=provenance)
    check_recording(recording)
    return recording
