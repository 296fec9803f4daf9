"""One recording written as an MCAP file of ROS 2 messages; `bag_recording` reads it."""

import json
from pathlib import Path

import numpy as np

from structlearn.ground.errors import InputError
from structlearn.recordings.bag_writer import write_bag
from structlearn.recordings.checks import check_recording
from structlearn.recordings.messages import shapes_topic, to_topic
from structlearn.recordings.recording import JOINT_KINDS, Recording
from structlearn.recordings.topics import MAX_FINGERS, OWN_TOPICS

_TOPICS: dict[str, str] = {role: topic for topic, role in OWN_TOPICS.roles()}
_TOPICS.update(zip(JOINT_KINDS, OWN_TOPICS.joint_states, strict=True))


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
        raw.append(shapes_topic(_TOPICS["obstacles"], start, recording.shapes))
    write_bag(path, to_metadata(recording), raw)


def _own_topics(recording: Recording) -> list[str]:
    """Topic of each stream in our own files; tactile streams are numbered in their order."""
    tactile = iter(OWN_TOPICS.tactile)
    if sum(stream.kind == "tactile" for stream in recording.streams) > MAX_FINGERS:
        raise InputError(f"{recording.name}: has more than {MAX_FINGERS} tactile streams")
    return [
        next(tactile) if stream.kind == "tactile" else _TOPICS[stream.kind] for stream in recording.streams
    ]


def to_metadata(recording: Recording) -> dict[str, str]:
    """The metadata record, values as JSON with sorted keys; numbers keep all their digits."""
    segments = recording.true_segments
    return {
        "provenance": json.dumps(dict(recording.provenance), sort_keys=True),
        "true_segments": json.dumps(None if segments is None else np.asarray(segments, dtype=float).tolist()),
    }
