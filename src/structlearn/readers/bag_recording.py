"""Reading and writing of recordings and joint logs: messages of topics to streams, and back."""

import json
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from structlearn.core.errors import InputError
from structlearn.core.used_files import require_file
from structlearn.readers.clock import MAX_GAP_S, check_recording, non_finite, synchronise
from structlearn.readers.computed_pose import in_radians, joint_pose, transform_pose
from structlearn.readers.definitions import short_name
from structlearn.readers.demonstration import (
    JOINT_KINDS,
    Demonstration,
    NamedShape,
    Recording,
    Stream,
)
from structlearn.readers.joint_log import JointLog
from structlearn.readers.joint_streams import JointSeries, chosen, joint_series
from structlearn.readers.messages import (
    READERS,
    joint_messages,
    shapes_message,
    to_messages,
    to_shapes,
    to_stream,
)
from structlearn.readers.raw_messages import Bag, RawMessages, damage_named, read_bags, write_bag
from structlearn.readers.source import (
    AS_WRITTEN,
    MAX_FINGERS,
    OWN_TOPICS,
    JointPose,
    Role,
    StampPolicy,
    TopicMap,
    column_of,
)
from structlearn.readers.source_files import (
    METADATA,
    RecordingFile,
    as_recording_file,
    check_names,
    listed_counts,
    recording_files,
)
from structlearn.readers.transform_sources import check_transforms
from structlearn.readers.user_tables import read_pose_table, read_shapes, shape_file

JOINT_STATES = "/joint_states"  # default topic of drivers

_TOPICS: dict[str, str] = {role: topic for topic, role in OWN_TOPICS.roles()}
_TOPICS.update(zip(JOINT_KINDS, OWN_TOPICS.joint_states, strict=True))


def open_bag(file: RecordingFile, topics: Collection[str]) -> Bag:
    """Topics with their types, and the requested messages (CDR), of a file of any format."""
    for path in file.paths:
        if path.exists():
            require_file(path, whole=False)
    if file.format == "table":
        return read_pose_table(file.paths[0])
    bag, counts = read_bags(file, topics), listed_counts(file)
    for topic, messages in bag.messages.items():
        if (count := len(messages.data)) != (listed := counts.get(topic, count)):
            raise InputError(
                f"{file.path}: topic '{topic}' has {count} messages, {METADATA} says {listed}; if the bag is "
                "as it should be, `ros2 bag reindex` mends the description"
            )
    return bag


def write_recording(recording: Recording, path: str | Path) -> None:
    """Write a recording as an MCAP file of ROS 2 messages on `OWN_TOPICS`.

    Log and publish time equal the stamp. Shapes are one message at the earliest stamp. Equal recordings give
    equal bytes. Tactile counts are written as float32 (integers up to 2^24 are exact), everything else as
    float64. The recording's name is the file's. The file is written in place; the caller publishes it or its
    folder (`structlearn.core.artefacts.publish`).

    Raises:
        InputError: the recording fails `check_recording`, a stamp is negative or after 2^31 s, a tactile
            count exceeds float32, or there are more than `MAX_FINGERS` tactile streams.
    """
    check_recording(recording)
    if recording.leading.kind != "pose":
        raise InputError(f"{recording.name}: has no pose stream")
    if outputs := (*recording.joints_of("outputs"), *recording.joints_of("digital")):
        raise InputError(f"{recording.name}: has the outputs {', '.join(outputs)}, which are not written")
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
    """Metadata record: values as JSON with sorted keys; numbers keep all digits."""
    segments = recording.true_segments
    return {
        "provenance": json.dumps(dict(recording.provenance), sort_keys=True),
        "true_segments": json.dumps(None if segments is None else np.asarray(segments, dtype=float).tolist()),
    }


def read_recording(
    file: str | Path | RecordingFile, topics: TopicMap = OWN_TOPICS, stamps: StampPolicy = AS_WRITTEN
) -> Recording:
    """Read a recording from a file of any format (`source_files`); `messages` lists the types.

    Returns:
        The recording, named after the file's stem, with streams in the order of the topic map. A file without
        our metadata has the provenance origin "recorded" and its file name as source. Provenance also states,
        under `stamps`, how stamps that do not increase were handled, under `clock`, whether log times were
        requested, under `joints`, which joints of a topic are left out, and under `orientation`, if the
        quaternions of a topic of poses are 0 or NaN throughout, that it was not recorded.

    Raises:
        InputError: the file is missing, of another kind, truncated or damaged; a topic is missing, empty or
            of a type that its role does not support; messages differ in length; stamps are not in order and
            that is not allowed, or the clock was set back; two topics give the same signal; the frame of a
            topic changes; two sources of a signal contradict each other (`one_source`); or the pose cannot be
            computed. The message names file and topic.
    """
    file = as_recording_file(file)
    outputs = {topic for _, topic in (*topics.outputs, *topics.digital)}
    wanted = [column_of(topic)[0] if topic in outputs else topic for topic in topics.topics]
    bag = open_bag(file, list(dict.fromkeys(wanted)))
    with damage_named(file.path):
        known = None if bag.metadata is None else json.loads(bag.metadata["true_segments"])
        segments = None if known is None else np.array(known, dtype=float).reshape(-1, 2)
    read = _Reading(file.path, bag, topics, stamps)
    streams = read.streams()
    remarks = {
        "stamps": "; ".join(f"{topic}: {note}" for topic, note in read.mended.items() if note),
        "clock": "log" if stamps.clock == "log" else "",
        "joints": "; ".join(read.left_out),
        "orientation": "" if read.oriented else "not recorded",
    }
    provenance = bag.provenance(file.path) | {key: remark for key, remark in remarks.items() if remark}
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
        source: see `source_files.recording_files`.
        topics: topics of the signals.
        rate_hz: sampling rate of all demonstrations; None: the median rate of each pose stream.
        max_gap_s: longest gap in s that is bridged by interpolation.
        stamps: which stamps are used, and how disorder is handled.

    Raises:
        InputError: the source fails `source_files.recording_files`, or a recording `read_recording` or
            `synchronise`; the message names it.
    """
    return list(each_demonstration(source, topics, rate_hz, max_gap_s, stamps))


def each_demonstration(
    source: str | Path,
    topics: TopicMap = OWN_TOPICS,
    rate_hz: float | None = None,
    max_gap_s: float = MAX_GAP_S,
    stamps: StampPolicy = AS_WRITTEN,
) -> Iterator[Demonstration]:
    """As `read_demonstrations`, one after the other: a single recording is in memory."""
    for file in recording_files(source):
        recording = read_recording(file, topics, stamps)
        try:
            demonstration = synchronise(recording, rate_hz, max_gap_s)
        except InputError as error:
            raise InputError(f"{file.path}: {error}") from error
        yield demonstration
        del recording, demonstration  # before the next one is read


def read_recordings(
    source: str | Path, topics: TopicMap = OWN_TOPICS, stamps: StampPolicy = AS_WRITTEN
) -> list[Recording]:
    """Read recordings, each stream on its own clock; arguments as in `read_demonstrations`.

    Raises InputError: as `read_demonstrations`, except for the clock; or a recording fails
    `check_recording`.
    """
    return list(each_recording(source, topics, stamps))


def each_recording(
    source: str | Path, topics: TopicMap = OWN_TOPICS, stamps: StampPolicy = AS_WRITTEN
) -> Iterator[Recording]:
    """As `read_recordings`, one after the other."""
    for file in recording_files(source):
        recording = read_recording(file, topics, stamps)
        try:
            check_recording(recording)
        except InputError as error:
            raise InputError(f"{file.path}: {error}") from error
        yield recording
        del recording  # before the next one is read


def write_recordings(recordings: Sequence[Recording], folder: str | Path) -> None:
    """Write recordings as folder/NAME.mcap; numeric names are zero-padded to equal length.

    The folder is created if missing; publish it as a whole.
    """
    names = [recording.name for recording in recordings]
    digits = max((len(name) for name in names if name.isdecimal()), default=0)
    stems = [name.zfill(digits) if name.isdecimal() else name for name in names]
    check_names(stems, str(folder))
    Path(folder).mkdir(parents=True, exist_ok=True)
    for recording, stem in zip(recordings, stems, strict=True):
        write_recording(recording, Path(folder) / f"{stem}.mcap")


def write_joint_log(log: JointLog, path: str | Path) -> None:
    """Write a log as an MCAP file, named after the log; the caller publishes it."""
    values = dict(zip(JOINT_KINDS, (log.positions, log.velocities, log.torques), strict=True))
    messages = joint_messages(f"{log.name}: {JOINT_STATES}", log.joints, log.stamps, values)
    provenance = json.dumps(dict(log.provenance), sort_keys=True)
    write_bag(path, {"provenance": provenance}, [(JOINT_STATES, messages)])


def read_joint_logs(
    source: str | Path,
    topic: str = JOINT_STATES,
    joints: Sequence[str] | None = None,
    stamps: StampPolicy = AS_WRITTEN,
) -> list[JointLog]:
    """Read the logs of a source (`source_files.recording_files`), in natural order of their names."""
    return [read_joint_log(file, topic, joints, stamps) for file in recording_files(source)]


def read_joint_log(
    path: str | Path | RecordingFile,
    topic: str = JOINT_STATES,
    joints: Sequence[str] | None = None,
    stamps: StampPolicy = AS_WRITTEN,
) -> JointLog:
    """Read a log, named after its file, from a file of any format, ours or a robot's.

    Columns are the named joints or, without names, all joints of the publisher with the most, in the order of
    its first message. Raises InputError: something that a dynamics model needs is missing.
    """
    file = as_recording_file(path)
    bag = open_bag(file, [topic])
    where, messages = readable(file.path, bag, topic, "joint_states")
    series, note = joint_series(where, topic, messages, stamps)
    if not series[0].names:
        raise InputError(f"{where} does not name the joints")
    series, others = chosen(where, series, joints)
    if len(series) > 1:
        parts = " and ".join(", ".join(part.names) for part in series)
        raise InputError(f"{where} has joints that come at different times: {parts}")
    (joint_states,) = series
    if missing := [kind for kind in JOINT_KINDS if kind not in joint_states.values]:
        raise InputError(
            f"{where} has no {missing[0].replace('_', ' ')}; a dynamics model is learned from "
            "position, velocity and effort"
        )
    provenance = bag.provenance(file.path)
    if note is not None:
        provenance["stamps"] = f"{topic}: {note}"
    if others:
        provenance["joints"] = f"{topic}: without {', '.join(others)}"
    signals = (joint_states.values[kind] for kind in JOINT_KINDS)
    return JointLog(file.name, joint_states.names, joint_states.stamps, *signals, provenance=provenance)


def readable(path: Path, bag: Bag, topic: str, role: Role | Literal["transforms"]) -> tuple[str, RawMessages]:
    """Description (file and topic) and messages. Raises InputError: not readable in this role."""
    where = f"{path}: topic '{topic}'"
    if topic not in bag.topics:
        present = sorted(bag.topics.items())
        listing = ", ".join(f"{name} ({' and '.join(types)})" for name, types in present) or "no topics"
        raise InputError(f"{path}: has no topic '{topic}' for {role}; it has {listing}")
    if len(types := bag.topics[topic]) > 1:
        raise InputError(f"{where} has messages of several types: {', '.join(types)}")
    if short_name(types[0]) not in READERS[role]:
        listing = ", ".join(READERS[role])
        raise InputError(f"{where} has messages of type {types[0]}; {role} can be read from {listing}")
    if topic not in bag.messages:
        raise InputError(f"{where} has no messages")
    return where, bag.messages[topic]


def _unknown_position(series: Sequence[JointSeries]) -> str:
    """Description of the first position of a joint that is not finite, of one that others are, if any."""
    known = [stream for part in series for stream in part.streams() if stream.kind == "joint_positions"]
    whole = [
        Stream(part.topic, kind, part.stamps, signal, part.names)
        for part in series
        for kind, signal in part.values.items()
        if kind == "joint_positions"
    ]
    return next(fault for stream in (*known, *whole) if (fault := non_finite(stream)))


class _Reading:
    """Streams of a bag, with remarks: `mended`, stamps corrected per topic, and `left_out` joints."""

    def __init__(self, path: Path, bag: Bag, topics: TopicMap, policy: StampPolicy) -> None:
        self._path, self._bag, self._topics, self._policy = path, bag, topics, policy
        self._series: dict[str, list[JointSeries]] = {}
        self.mended: dict[str, str | None] = {}
        self.left_out: list[str] = []
        self.oriented = True

    def streams(self) -> list[Stream]:
        """All streams in the order of the topic map."""
        streams = self._computed_pose()
        joints: list[JointSeries] = []
        place = 0
        for topic, role in self._topics.roles():
            if role == "obstacles" or self._is_absent(topic, role):
                continue
            if role == "joint_states":
                place = place if joints else len(streams)
                joints += self._joints(topic)
            elif role in ("outputs", "digital"):
                streams.append(self._output(topic, role))
            else:
                where, messages = readable(self._path, self._bag, topic, role)
                stream, self.mended[topic] = to_stream(where, topic, role, messages, self._policy)
                if role == "pose" and not np.nan_to_num(stream.values[:, 3:]).any():
                    self.oriented = False
                    stream.values[:, 3:] = 1.0, 0.0, 0.0, 0.0
                streams.append(stream)
        if joints:
            streams[place:place] = self._joint_streams(joints)
        return streams

    def shapes(self) -> tuple[NamedShape, ...]:
        """Solids on the obstacles topic."""
        for topic, role in self._topics.roles():
            if role == "obstacles" and not self._is_absent(topic, role):
                return to_shapes(*readable(self._path, self._bag, topic, role))
        return ()

    def _is_absent(self, topic: str, role: Role) -> bool:
        """Whether an optional topic is absent."""
        return not self._topics.must_exist and role != "pose" and topic not in self._bag.topics

    def _computed_pose(self) -> list[Stream]:
        pose = self._topics.pose
        if isinstance(pose, str | None):
            return []
        if isinstance(pose, JointPose):
            where = f"{self._path}: topic '{pose.topic}'"
            series = self._joint_series(pose.topic)
            stream = joint_pose(where, series, pose)
            if not np.isfinite(stream.values).all():
                raise InputError(f"{where}: {_unknown_position(series)}")
            return [stream]
        for topic in pose.topics:
            if topic == pose.topic or topic in self._bag.messages:
                readable(self._path, self._bag, topic, "transforms")
        check_transforms(str(self._path), self._bag.messages, pose, self._policy)
        stream, self.mended[pose.topic] = transform_pose(
            str(self._path), self._bag.messages, pose, self._policy
        )
        return [stream]

    def _joint_series(self, topic: str) -> list[JointSeries]:
        """All joint states of a topic, cached, since the pose may need them too."""
        if topic not in self._series:
            where, messages = readable(self._path, self._bag, topic, "joint_states")
            self._series[topic], self.mended[topic] = joint_series(where, topic, messages, self._policy)
        return self._series[topic]

    def _joints(self, topic: str) -> list[JointSeries]:
        """Joint states of a topic: of named joints or, in a user's bag, of the largest publisher."""
        series, pose = self._joint_series(topic), self._topics.pose
        if isinstance(pose, JointPose) and pose.topic == topic:
            series = [in_radians(part, pose) for part in series]
        if not self._topics.must_exist or self._topics.joints is not None or not series[0].names:
            return series
        series, others = chosen(f"{self._path}: topic '{topic}'", series, None)
        if others:
            self.left_out.append(f"{topic}: without {', '.join(others)}")
        return series

    def _output(self, topic: str, role: Literal["outputs", "digital"]) -> Stream:
        """A number over time, of a topic or the position of a joint, under the output's name."""
        named = {its: name for name, its in (*self._topics.outputs, *self._topics.digital)}
        source, joint = column_of(topic)
        if not joint:
            where, messages = readable(self._path, self._bag, source, role)
            stream, self.mended[source] = to_stream(where, topic, role, messages, self._policy)
            return replace(stream, joints=(named[topic],))
        where = f"{self._path}: topic '{source}'"
        (series,), _ = chosen(where, self._joint_series(source), [joint])
        if "joint_positions" not in series.values:
            raise InputError(f"{where} has no position of joint {joint}")
        return Stream(topic, role, series.stamps, series.values["joint_positions"], (named[topic],))

    def _joint_streams(self, series: Sequence[JointSeries]) -> list[Stream]:
        """Streams of the joint states of all topics; signals that some joints lack are left out."""
        named = all(part.names for part in series)
        if self._topics.joints is not None:
            where = f"{self._path}: {', '.join(dict.fromkeys(part.topic for part in series))}"
            series, _ = chosen(where, series, self._topics.joints)
        streams = [stream for part in series for stream in part.streams()]
        joints = {kind: [n for s in streams if s.kind == kind for n in s.joints] for kind in JOINT_KINDS}
        for kind, names in joints.items():
            topics = [stream.topic for stream in streams if stream.kind == kind]
            if len(topics) > 1 and (not named or len(set(names)) < len(names)):
                listing = ", ".join(dict.fromkeys(topics))
                raise InputError(f"{self._path}: {kind} come from several topics: {listing}")
        if not named:
            return streams
        recorded = {name for names in joints.values() for name in names}
        most = set(joints["joint_positions"]) or recorded
        if unplaced := sorted(recorded - most):
            self.left_out.append(f"without {', '.join(unplaced)}, whose position was not recorded")
        for kind, names in joints.items():
            if names and not most.issubset(names):
                lacking = ", ".join(sorted(most - set(names)))
                self.left_out.append(f"{kind} are not of {lacking} and left out")
        whole = [stream for stream in streams if most.issubset(joints[stream.kind])]
        kept = [part for stream in whole if (part := stream.of_joints(most)).joints]
        if not kept:
            listing = ", ".join(sorted(most))
            raise InputError(f"{self._path}: no signal is of all joints {listing}: name some under `joints`")
        return kept
