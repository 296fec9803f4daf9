"""One recording in one MCAP file of ROS 2 messages, ours or a robot's."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from structlearn.ground.errors import InputError
from structlearn.recordings.bag_reader import damage_named, own_provenance, read_bag
from structlearn.recordings.bag_writer import write_bag
from structlearn.recordings.checks import check_recording
from structlearn.recordings.messages import (
    JOINT_KINDS,
    check_readable,
    shapes_topic,
    to_shapes,
    to_streams,
    to_topic,
)
from structlearn.recordings.recording import Kind, Recording
from structlearn.recordings.topics import MAX_FINGERS, OWN_TOPICS, TopicMap


def write_recording(recording: Recording, path: str | Path) -> None:
    """Write a recording as an MCAP file of ROS 2 messages on `OWN_TOPICS`.

    Messages stand in the order of their stamps, at equal stamps in the order of the streams; log and publish
    time are the stamp. Shapes stand in one message at the first of all stamps. The same recording gives the
    same bytes. Tactile counts are written as float32 (whole numbers up to 2^24 are exact), everything else as
    float64. The file is written in place: whoever calls publishes it or the folder that it is in
    (`structlearn.ground.artefacts.publish`).

    Args:
        recording: at least two samples per stream; its name is not written, the file's stem is the name.
        path: the file; its folder exists.

    Raises:
        InputError: the recording fails `check_recording`, a stamp is negative or after 2^31 s, a tactile
            count is beyond float32, or there are more than `MAX_FINGERS` tactile streams.
    """
    check_recording(recording)
    topics = _own_topics(recording)
    pairs = zip(topics, recording.streams, strict=True)
    raw = [to_topic(f"{recording.name}: {topic}", topic, stream) for topic, stream in pairs]
    if recording.shapes:
        start = min(int(stream.stamps[0]) for stream in recording.streams)
        raw.append(shapes_topic(OWN_TOPICS.obstacles, start, recording.shapes))
    write_bag(path, to_metadata(recording), raw)


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
    roles = topics.roles()
    bag = read_bag(path, [topic for topic, _ in roles])
    with damage_named(path):
        segments = _true_segments(bag.metadata)
    streams, shapes = [], ()
    for topic, role in roles:
        where = f"{path}: topic '{topic}'"
        if topic in bag.topics:
            check_readable(where, role, bag.topics[topic])
            if topic not in bag.messages:
                raise InputError(f"{where} has no messages")
            if role == "obstacles":
                shapes = to_shapes(where, bag.messages[topic])
            else:
                streams += to_streams(where, topic, role, bag.messages[topic])
        elif topics.must_exist or role == "pose":
            listing = ", ".join(
                f"{name} ({' and '.join(types)})" for name, types in sorted(bag.topics.items())
            )
            raise InputError(f"{path}: has no topic '{topic}' for {role}; it has {listing or 'no topics'}")
    for kind in JOINT_KINDS:
        sources = [stream.topic for stream in streams if stream.kind == kind]
        if len(sources) > 1:
            raise InputError(f"{path}: {kind} come from several topics: {', '.join(sources)}")
    return Recording(path.stem, tuple(streams), segments, own_provenance(bag, path), shapes)


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


def to_metadata(recording: Recording) -> dict[str, str]:
    """The metadata record, values as JSON with sorted keys; numbers keep all their digits."""
    segments = recording.true_segments
    return {
        "provenance": json.dumps(dict(recording.provenance), sort_keys=True),
        "true_segments": json.dumps(None if segments is None else np.asarray(segments, dtype=float).tolist()),
    }


def _true_segments(metadata: Mapping[str, str] | None) -> np.ndarray | None:
    segments = None if metadata is None else json.loads(metadata["true_segments"])
    return None if segments is None else np.array(segments, dtype=float).reshape(-1, 2)
