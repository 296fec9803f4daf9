"""One recording in one MCAP file of ROS 2 messages, ours or a robot's."""

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.reader import McapReader, make_reader
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import MCAP0_MAGIC
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer

from structlearn.ground.errors import InputError
from structlearn.recordings.checks import check_recording
from structlearn.recordings.messages import JOINT_KINDS, TopicCollector
from structlearn.recordings.recording import Kind, Recording
from structlearn.recordings.schemas import MESSAGE_TYPES, definition, to_messages
from structlearn.recordings.topics import MAX_FINGERS, OWN_TOPICS, TopicMap

METADATA = "structlearn"
"""Name of the metadata record with provenance and true segments."""


def write_recording(recording: Recording, path: str | Path) -> None:
    """Write a recording as an MCAP file of ROS 2 messages on `OWN_TOPICS`.

    Messages stand in the order of their stamps, at equal stamps in the order of the streams; log and publish
    time are the stamp. The same recording gives the same bytes. Tactile counts are written as float32 (whole
    numbers up to 2^24 are exact), everything else as float64. The file is written in place: whoever calls
    publishes it or the folder that it is in (`structlearn.ground.artefacts.publish`).

    Args:
        recording: at least two samples per stream; its name is not written, the file's stem is the name.
        path: the file; its folder exists.

    Raises:
        InputError: the recording fails `check_recording`, a stamp is negative, or there are more than
            `MAX_FINGERS` tactile streams.
    """
    check_recording(recording)
    topics = _own_topics(recording)
    stamps = np.concatenate([stream.stamps for stream in recording.streams])
    if stamps.min() < 0:
        raise InputError(
            f"{recording.name}: stamps before 0 cannot be written, the first is {stamps.min()} ns"
        )
    owners = np.repeat(np.arange(len(topics)), [len(stream.stamps) for stream in recording.streams])
    order = np.argsort(stamps, kind="stable")
    queues = [to_messages(stream) for stream in recording.streams]
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.add_metadata(METADATA, _to_metadata(recording))
        types = [MESSAGE_TYPES[stream.kind] for stream in recording.streams]
        schemas = {name: writer.register_msgdef(name, definition(name)) for name in dict.fromkeys(types)}
        for owner, stamp in zip(owners[order].tolist(), stamps[order].tolist(), strict=True):
            writer.write_message(topics[owner], schemas[types[owner]], next(queues[owner]), stamp, stamp)
        writer.finish()


def read_recording(path: str | Path, topics: TopicMap = OWN_TOPICS) -> Recording:
    """Read a recording from an MCAP file of ROS 2 messages.

    Which message types are understood, and which clock stamps a message, is told in `messages`.

    Args:
        path: an MCAP file, as `ros2 bag record -s mcap` or `write_recording` leaves it.
        topics: which topic carries which signal.

    Returns:
        The recording, named after the file's stem, streams in the order of the topic map. A file without our
        metadata has the provenance origin "recorded" and its file name as source.

    Raises:
        InputError: the file is missing, not an MCAP file, cut off or damaged; a topic is missing, empty or of
            a type that cannot be read as its signal; messages differ in length; two topics give the same
            signal. The message names file and topic.
    """
    path = Path(path)
    try:
        with open(path, "rb") as file:
            _check_complete(path, file)
            with _damage_named(path):
                reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
                present = _file_topics(reader)
                metadata = _from_metadata(reader)
            collectors = _collectors(path, present, topics)
            _collect(path, reader, collectors)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    streams = [stream for collector in collectors.values() for stream in collector.streams()]
    for kind in JOINT_KINDS:
        sources = [stream.topic for stream in streams if stream.kind == kind]
        if len(sources) > 1:
            raise InputError(f"{path}: {kind} come from several topics: {', '.join(sources)}")
    provenance, segments = metadata or ({"origin": "recorded", "source": path.name}, None)
    return Recording(path.stem, tuple(streams), segments, provenance)


def _own_topics(recording: Recording) -> list[str]:
    """Topic of each stream in our own files; tactile streams are numbered in their order."""
    topics: dict[Kind, str] = {
        "pose": OWN_TOPICS.pose,
        "twist": OWN_TOPICS.twist,
        "wrench": OWN_TOPICS.wrench,
        "tool_to_board": OWN_TOPICS.tool_to_board,
    }
    topics |= dict(zip(JOINT_KINDS, OWN_TOPICS.joint_states, strict=True))
    tactile = iter(OWN_TOPICS.tactile)
    if sum(stream.kind == "tactile" for stream in recording.streams) > MAX_FINGERS:
        raise InputError(f"{recording.name}: has more than {MAX_FINGERS} tactile streams")
    return [
        next(tactile) if stream.kind == "tactile" else topics[stream.kind] for stream in recording.streams
    ]


def _to_metadata(recording: Recording) -> dict[str, str]:
    """The metadata record, values as JSON with sorted keys; numbers keep all their digits."""
    segments = recording.true_segments
    return {
        "provenance": json.dumps(dict(recording.provenance), sort_keys=True),
        "true_segments": json.dumps(None if segments is None else np.asarray(segments, dtype=float).tolist()),
    }


def _from_metadata(reader: McapReader) -> tuple[Mapping[str, str], np.ndarray | None] | None:
    """Provenance and true segments; None where the file is not ours."""
    for record in reader.iter_metadata():
        if record.name == METADATA:
            segments = json.loads(record.metadata["true_segments"])
            array = None if segments is None else np.array(segments, dtype=float).reshape(-1, 2)
            return json.loads(record.metadata["provenance"]), array
    return None


def _check_complete(path: Path, file: BinaryIO) -> None:
    """A complete MCAP file starts and ends with the magic bytes; a killed recorder leaves no end."""
    size = len(MCAP0_MAGIC)
    if file.read(size) != MCAP0_MAGIC:
        raise InputError(f"{path}: not an MCAP file")
    file.seek(max(size, path.stat().st_size - size))
    if file.read() != MCAP0_MAGIC:
        raise InputError(f"{path}: the MCAP file is cut off at its end; `mcap recover` saves what is there")
    file.seek(0)


@contextmanager
def _damage_named(path: Path) -> Iterator[None]:
    """Turn whatever the MCAP library raises on damaged bytes into an InputError; only its calls go inside."""
    try:
        yield
    except Exception as error:
        raise InputError(f"{path}: damaged MCAP file: {type(error).__name__}: {error}") from error


def _decoded(path: Path, reader: McapReader, topics: Iterable[str]) -> Iterator[tuple]:
    """Schema, channel, record and decoded message of the topics, in the order of the file.

    The library's own sorting by log time costs a third more; collectors sort once per topic. Errors of
    whoever takes the messages are not raised in here.
    """
    with _damage_named(path):
        yield from reader.iter_decoded_messages(set(topics), log_time_order=False)


def _collect(path: Path, reader: McapReader, collectors: Mapping[str, TopicCollector]) -> None:
    """Give every message of the wanted topics to its collector."""
    try:
        for _, channel, message, decoded in _decoded(path, reader, collectors):
            collectors[channel.topic].add(decoded, message.log_time)
    except AttributeError as error:
        raise InputError(f"{path}: a message lacks a field of its type: {error}") from error


def _collectors(path: Path, present: Mapping[str, list[str]], topics: TopicMap) -> dict[str, TopicCollector]:
    """One collector per topic of the map that the file has, in the order of the map."""
    collectors = {}
    for topic, role in topics.roles():
        if topic in present:
            types = present[topic]
            if len(types) > 1:
                raise InputError(f"{path}: topic '{topic}' has messages of several types: {', '.join(types)}")
            collectors[topic] = TopicCollector(str(path), topic, role, types[0])
        elif topics.must_exist or role == "pose":
            listing = ", ".join(f"{name} ({' and '.join(types)})" for name, types in sorted(present.items()))
            raise InputError(f"{path}: has no topic '{topic}' for {role}; it has {listing or 'no topics'}")
    return collectors


def _file_topics(reader: McapReader) -> dict[str, list[str]]:
    """Topics of a file with the types of their messages; what is not a ROS 2 message says so in its type."""
    summary = reader.get_summary()
    if summary is not None and summary.channels:
        pairs = [(channel, summary.schemas.get(channel.schema_id)) for channel in summary.channels.values()]
    else:  # the index at the end of the file is optional
        pairs = [(channel, schema) for schema, channel, _ in reader.iter_messages(log_time_order=False)]
    present: dict[str, list[str]] = {}
    for channel, schema in pairs:
        name = schema.name if schema is not None else "unknown"
        if channel.message_encoding != MessageEncoding.CDR or (
            schema and schema.encoding != SchemaEncoding.ROS2
        ):
            encodings = f"{channel.message_encoding}, {schema.encoding if schema else 'no schema'}"
            name = f"{name} [{encodings}: not ROS 2 messages with ros2msg definitions]"
        types = present.setdefault(channel.topic, [])
        if name not in types:
            types.append(name)
    return present
