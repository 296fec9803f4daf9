"""Recordings and their files, one by one and in sets: messages of topics become streams, streams messages."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from structlearn.core.errors import InputError
from structlearn.readers.bag import Bag, RawMessages, damage_named, write_bag
from structlearn.readers.bag_files import (
    RecordingFile,
    as_recording_file,
    check_names,
    open_bag,
    recording_files,
)
from structlearn.readers.clock import AS_WRITTEN, MAX_GAP_S, StampPolicy, synchronise
from structlearn.readers.computed_pose import joint_pose, transform_pose
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.joint_log import JointSeries, chosen, joint_series
from structlearn.readers.messages import check_readable, shapes_message, to_messages, to_shapes, to_stream
from structlearn.readers.pose_table import read_shapes, shape_file
from structlearn.readers.recording import JOINT_KINDS, NamedShape, Recording, Stream, check_recording
from structlearn.readers.topics import MAX_FINGERS, OWN_TOPICS, JointPose, Role, TopicMap, TransformPose

_TOPICS: dict[str, str] = {role: topic for topic, role in OWN_TOPICS.roles()}
_TOPICS.update(zip(JOINT_KINDS, OWN_TOPICS.joint_states, strict=True))


def write_recording(recording: Recording, path: str | Path) -> None:
    """Write a recording as an MCAP file of ROS 2 messages on `OWN_TOPICS`.

    Log and publish time are the stamp. Shapes stand in one message at the first of all stamps. The same
    recording gives the same bytes. Tactile counts are written as float32 (whole numbers up to 2^24 are
    exact), everything else as float64. The name is that of the file. It is written in place: whoever calls
    publishes it or the folder that it is in (`structlearn.core.artefacts.publish`). Raises InputError: the
    recording fails `check_recording`, a stamp is negative or after 2^31 s, a tactile count is beyond float32,
    or there are more than `MAX_FINGERS` tactile streams.
    """
    check_recording(recording)
    if sum(stream.kind == "tactile" for stream in recording.streams) > MAX_FINGERS:
        raise InputError(f"{recording.name}: has more than {MAX_FINGERS} tactile streams")
    tactile = iter(OWN_TOPICS.tactile)
    messages = []
    for stream in recording.streams:
        topic = next(tactile) if stream.kind == "tactile" else _TOPICS[stream.kind]
        messages.append((topic, to_messages(f"{recording.name}: {topic}", stream)))
    if recording.shapes:
        start = min(int(stream.stamps[0]) for stream in recording.streams)
        messages.append((_TOPICS["obstacles"], shapes_message(start, recording.shapes)))
    write_bag(path, to_metadata(recording), messages)


def to_metadata(recording: Recording) -> dict[str, str]:
    """The metadata record, values as JSON with sorted keys; numbers keep all their digits."""
    segments = recording.true_segments
    return {
        "provenance": json.dumps(dict(recording.provenance), sort_keys=True),
        "true_segments": json.dumps(None if segments is None else np.asarray(segments, dtype=float).tolist()),
    }


def read_recording(
    file: str | Path | RecordingFile, topics: TopicMap = OWN_TOPICS, stamps: StampPolicy = AS_WRITTEN
) -> Recording:
    """Read a recording from a file of any format (`bag_files`), message types as `messages` says.

    Returns:
        The recording, named after the file's stem, streams in the order of the topic map. A file without our
        metadata has the provenance origin "recorded" and its file name as source. Provenance also says, under
        `stamps`, what was done about stamps that do not increase, under `clock`, whether log times were
        wanted, and under `joints`, which joints of a topic are left out.

    Raises:
        InputError: the file is missing, of another kind, cut off or damaged; a topic is missing, empty or of
            a type that cannot be read as its signal; messages differ in length; stamps are not in order and
            that is not allowed; two topics give the same signal; or the pose cannot be computed. The message
            names file and topic.
    """
    if not isinstance(file, RecordingFile):
        file = as_recording_file(Path(file))
    bag = open_bag(file, topics.topics)
    with damage_named(file.path):
        known = None if bag.metadata is None else json.loads(bag.metadata["true_segments"])
        segments = None if known is None else np.array(known, dtype=float).reshape(-1, 2)
    read = _Reading(file, bag, topics, stamps)
    streams = read.streams()
    provenance = bag.provenance(file.path) | read.remarks()
    table = shape_file(file.path, file.name)
    shapes = read.shapes() + (read_shapes(table) if table else ())
    return Recording(file.name, tuple(streams), segments, provenance, shapes)


def read_demonstrations(
    source: str | Path,
    topics: TopicMap = OWN_TOPICS,
    rate_hz: float | None = None,
    max_gap_s: float = MAX_GAP_S,
    stamps: StampPolicy = AS_WRITTEN,
) -> list[Demonstration]:
    """Read demonstrations, each on a uniform clock (`clock.synchronise`), in natural order of their names.

    Args:
        source: see `bag_files.recording_files`.
        topics: which topic carries which signal.
        rate_hz: ticks per second of all demonstrations; None: each has the median rate of its pose stream.
        max_gap_s: longest hole in s that is bridged by interpolation.
        stamps: how stamps are taken.

    Raises:
        InputError: the source fails `bag_files.recording_files`, or a recording `read_recording` or
            `synchronise`; the message names it.
    """
    found = []
    for file in recording_files(source):
        recording = read_recording(file, topics, stamps)
        try:
            found.append(synchronise(recording, rate_hz, max_gap_s))
        except InputError as error:
            raise InputError(f"{file.path}: {error}") from error
    return found


def read_recordings(
    source: str | Path, topics: TopicMap = OWN_TOPICS, stamps: StampPolicy = AS_WRITTEN
) -> list[Recording]:
    """Read recordings as they are, each stream with its own clock; arguments as of `read_demonstrations`.

    Raises InputError: as `read_demonstrations`, but for the clock; or a recording fails `check_recording`.
    """
    found = []
    for file in recording_files(source):
        found.append(read_recording(file, topics, stamps))
        try:
            check_recording(found[-1])
        except InputError as error:
            raise InputError(f"{file.path}: {error}") from error
    return found


def write_recordings(recordings: Sequence[Recording], folder: str | Path) -> None:
    """Write recordings as folder/NAME.mcap; numbers as names are padded with zeros to equal length.

    The folder is made if missing. Publish it as a whole. Raises InputError: names repeat or are no file
    names, or a recording fails `write_recording`.
    """
    names = [recording.name for recording in recordings]
    digits = max((len(name) for name in names if name.isdecimal()), default=0)
    stems = [name.zfill(digits) if name.isdecimal() else name for name in names]
    check_names(stems, str(folder))
    Path(folder).mkdir(parents=True, exist_ok=True)
    for recording, stem in zip(recordings, stems, strict=True):
        write_recording(recording, Path(folder) / f"{stem}.mcap")


class _Reading:
    """What is read of one bag, and what is to be said of it."""

    def __init__(self, file: RecordingFile, bag: Bag, topics: TopicMap, policy: StampPolicy) -> None:
        self._path = file.path
        self._bag, self._topics, self._policy = bag, topics, policy
        self._of_topic: dict[str, list[JointSeries]] = {}
        self._mended: dict[str, str | None] = {}
        self._left_out: list[str] = []

    def streams(self) -> list[Stream]:
        """All streams in the order of the topic map."""
        pose = self._topics.pose
        streams = [] if isinstance(pose, str) else [self._computed_pose(pose)]
        joints: list[JointSeries] = []
        place = 0
        for topic, role in self._topics.roles():
            if role == "obstacles" or (messages := self._messages(topic, role)) is None:
                continue
            if role == "joint_states":
                place = place if joints else len(streams)
                joints += self._joints(topic)
            else:
                stream, self._mended[topic] = to_stream(
                    self._where(topic), topic, role, messages, self._policy
                )
                streams.append(stream)
        if joints:
            streams[place:place] = self._joint_streams(joints)
        return streams

    def shapes(self) -> tuple[NamedShape, ...]:
        """Solids on the topic that is named for them."""
        topics = [topic for topic, role in self._topics.roles() if role == "obstacles"]
        found = [(topic, self._messages(topic, "obstacles")) for topic in topics]
        return sum((to_shapes(self._where(topic), its) for topic, its in found if its is not None), ())

    def remarks(self) -> dict[str, str]:
        """What provenance is to say of how the bag was read."""
        remarks = {
            "stamps": "; ".join(f"{topic}: {note}" for topic, note in self._mended.items() if note),
            "clock": "log" if self._policy.clock == "log" else "",
            "joints": "; ".join(self._left_out),
        }
        return {key: remark for key, remark in remarks.items() if remark}

    def _computed_pose(self, pose: TransformPose | JointPose) -> Stream:
        if isinstance(pose, JointPose):
            return joint_pose(self._where(pose.topic), self._series(pose.topic), pose)
        for topic in pose.topics:
            if topic == pose.topic or topic in self._bag.messages:
                self._readable(topic, "transforms")
        stream, note = transform_pose(str(self._path), self._bag.messages, pose, self._policy)
        self._mended[pose.topic] = note
        return stream

    def _series(self, topic: str) -> list[JointSeries]:
        """All joint states of a topic, which has to be there; it may give the pose too."""
        if topic not in self._of_topic:
            messages = self._readable(topic, "joint_states")
            found = joint_series(self._where(topic), topic, messages, self._policy)
            self._of_topic[topic], self._mended[topic] = found
        return self._of_topic[topic]

    def _joints(self, topic: str) -> list[JointSeries]:
        """Joint states of a topic; of several publishers those of the largest, unless joints are named.

        Files of ours have what was wanted when they were written.
        """
        series = self._series(topic)
        if not self._topics.must_exist or self._topics.joints is not None or not series[0].names:
            return series
        series, others = chosen(self._where(topic), series, None)
        if others:
            self._left_out.append(f"{topic}: without {', '.join(others)}")
        return series

    def _joint_streams(self, series: Sequence[JointSeries]) -> list[Stream]:
        """Streams of joint states of all topics; a kind of signal that some joints lack is left out."""
        named = all(one.names for one in series)
        if self._topics.joints is not None:
            where = f"{self._path}: {', '.join(dict.fromkeys(one.topic for one in series))}"
            series, _ = chosen(where, series, self._topics.joints)
        streams = [stream for one in series for stream in one.streams()]
        joints = {kind: [n for s in streams if s.kind == kind for n in s.joints] for kind in JOINT_KINDS}
        for kind, names in joints.items():
            topics = [stream.topic for stream in streams if stream.kind == kind]
            if len(topics) > 1 and (not named or len(set(names)) < len(names)):
                listing = ", ".join(dict.fromkeys(topics))
                raise InputError(f"{self._path}: {kind} come from several topics: {listing}")
        if not named:
            return streams
        most = {name for names in joints.values() for name in names}
        for kind, names in joints.items():
            if names and set(names) != most:
                lacking = ", ".join(sorted(most - set(names)))
                self._left_out.append(f"{kind} are not of {lacking} and left out")
        kept = [stream for stream in streams if set(joints[stream.kind]) == most]
        if not kept:
            listing = ", ".join(sorted(most))
            raise InputError(f"{self._path}: no signal is of all joints {listing}: name some under `joints`")
        return kept

    def _messages(self, topic: str, role: Role) -> RawMessages | None:
        """Messages of a topic; None where it is not there and need not be."""
        optional = not self._topics.must_exist and role != "pose"
        return None if optional and topic not in self._bag.topics else self._readable(topic, role)

    def _readable(self, topic: str, role: Role | Literal["transforms"]) -> RawMessages:
        """Messages of a topic, which is there, and can be read in the role."""
        types = self._bag.topics.get(topic)
        if types is None:
            present = sorted(self._bag.topics.items())
            listing = ", ".join(f"{name} ({' and '.join(its)})" for name, its in present) or "no topics"
            raise InputError(f"{self._path}: has no topic '{topic}' for {role}; it has {listing}")
        check_readable(self._where(topic), role, types)
        if topic not in self._bag.messages:
            raise InputError(f"{self._where(topic)} has no messages")
        return self._bag.messages[topic]

    def _where(self, topic: str) -> str:
        return f"{self._path}: topic '{topic}'"
