"""Our files against those of the library's own writer, which takes one message at a time."""

import json
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap_ros2.writer import Writer
from recordings_bags import header, make_recording, pose_rows, ros_pose, ros_quaternion, vector

from structlearn.ground.errors import InputError
from structlearn.recordings import Recording, Stream, write_recording
from structlearn.recordings.bag_writer import CHUNK_BYTES
from structlearn.recordings.joint_log import JointLog, write_joint_log
from structlearn.recordings.schemas import MESSAGE_TYPES, definition

FINITE = st.floats(allow_nan=False, allow_infinity=False)


def own_header(stamp):
    return header(stamp) | {"frame_id": "base"}


def joints(field):
    return lambda stamp, row: {
        "header": own_header(stamp),
        "name": [f"joint_{joint + 1}" for joint in range(len(row))],
        field: row.tolist(),
    }


MESSAGES = {
    "pose": lambda stamp, row: {"header": own_header(stamp), "pose": ros_pose(row)},
    "twist": lambda stamp, row: {
        "header": own_header(stamp),
        "twist": {"linear": vector(row[:3]), "angular": vector(row[3:])},
    },
    "wrench": lambda stamp, row: {
        "header": own_header(stamp),
        "wrench": {"force": vector(row[:3]), "torque": vector(row[3:])},
    },
    "joint_positions": joints("position"),
    "joint_velocities": joints("velocity"),
    "joint_torques": joints("effort"),
    "tactile": lambda _, row: {"data": row.tolist()},
    "tool_to_board": lambda stamp, row: {"header": own_header(stamp), "quaternion": ros_quaternion(row)},
}


def write_one_by_one(path, metadata, topics):
    """Reference: topics are (name, type, stamps, messages)."""
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.add_metadata("structlearn", metadata)
        schemas = {}
        for _, message_type, _, _ in topics:
            if message_type not in schemas:
                schemas[message_type] = writer.register_msgdef(message_type, definition(message_type))
        rows = [
            (stamp, name, message_type, message)
            for name, message_type, stamps, messages in topics
            for stamp, message in zip(stamps.tolist(), messages, strict=True)
        ]
        for stamp, name, message_type, message in sorted(rows, key=lambda row: row[0]):
            writer.write_message(name, schemas[message_type], message, stamp, stamp)
        writer.finish()
    content = path.read_bytes()
    end = content.index(b"\x0f\x04" + bytes(11))  # of the data: a checksum that this writer leaves out
    return content[: end + 9] + zlib.crc32(content[:end]).to_bytes(4, "little") + content[end + 13 :]


def reference(path, recording):
    topics = [
        (
            stream.topic,
            MESSAGE_TYPES[stream.kind],
            stream.stamps,
            [MESSAGES[stream.kind](*row) for row in zip(stream.stamps.tolist(), stream.values, strict=True)],
        )
        for stream in recording.streams
    ]
    metadata = {"provenance": json.dumps(recording.provenance, sort_keys=True), "true_segments": "null"}
    return write_one_by_one(path, metadata, topics)


def written(path, recording):
    write_recording(recording, path)
    return path.read_bytes()


@pytest.mark.parametrize("count", [2, 40, 1500])
def test_files_are_those_of_the_library_byte_by_byte(tmp_path, count):
    recording = make_recording(count=count)
    content = written(tmp_path / "ours.mcap", recording)
    assert content == reference(tmp_path / "theirs.mcap", recording)


def test_topics_that_begin_in_a_later_chunk_and_equal_stamps(tmp_path):
    stamps = np.arange(6000) * 10**7
    late = Stream("/wrench", "wrench", stamps[-100:], np.ones((100, 6)))
    joints = Stream("/joint_states/torques", "joint_torques", stamps, np.ones((6000, 7)))
    pose = Stream("/pose", "pose", stamps, pose_rows(6000))
    recording = Recording("long", (late, joints, pose), None, {"origin": "recorded"})
    assert sum(stream.values.nbytes for stream in recording.streams) < CHUNK_BYTES  # beside names and heads
    content = written(tmp_path / "ours.mcap", recording)
    assert content == reference(tmp_path / "theirs.mcap", recording)


@pytest.mark.parametrize("kind", MESSAGES)
@settings(max_examples=20, deadline=None)
@given(data=st.data())
def test_any_message_is_that_of_the_library(tmp_path_factory, kind, data):
    widths = {"pose": 7, "twist": 6, "wrench": 6, "tool_to_board": 4}
    width = widths.get(kind) or data.draw(st.integers(1, 9))
    elements = st.floats(width=32, allow_nan=False, allow_infinity=False) if kind == "tactile" else FINITE
    values = data.draw(arrays(float, (2, width), elements=elements))
    start, step = data.draw(st.integers(0, 2**31 * 10**9 - 2)), data.draw(st.integers(1, 10**10))
    stamps = np.array([start, min(start + step, 2**31 * 10**9 - 1)])
    if kind in ("pose", "tool_to_board"):
        values[:, -4:] = pose_rows(2, seed=width)[:, 3:]
    streams = [Stream("/pose", "pose", stamps, pose_rows(2))] * (kind != "pose")
    topic = {
        "joint_positions": "/joint_states/positions",
        "joint_velocities": "/joint_states/velocities",
        "joint_torques": "/joint_states/torques",
        "tactile": "/tactile/0",
    }.get(kind, f"/{kind}")
    recording = Recording(
        "any", (*streams, Stream(topic, kind, stamps, values)), None, {"origin": "simulated"}
    )
    folder = tmp_path_factory.mktemp("any")
    assert written(folder / "ours.mcap", recording) == reference(folder / "theirs.mcap", recording)


def test_joint_logs_are_those_of_the_library(tmp_path):
    rng = np.random.default_rng(0)
    stamps, values = np.arange(5) * 10**6, rng.normal(size=(3, 5, 2))
    names = ["shoulder", "the other one"]
    write_joint_log(JointLog("log", tuple(names), stamps, *values), tmp_path / "ours.mcap")
    messages = [
        {"header": own_header(s), "name": names, "position": p, "velocity": v, "effort": e}
        for s, (p, v, e) in zip(stamps.tolist(), values.transpose(1, 0, 2).tolist(), strict=True)
    ]
    topic = ("/joint_states", MESSAGE_TYPES["joint_positions"], stamps, messages)
    theirs = write_one_by_one(tmp_path / "theirs.mcap", {"provenance": "{}"}, [topic])
    assert (tmp_path / "ours.mcap").read_bytes() == theirs


@pytest.mark.parametrize(
    ("kind", "value", "stamp", "complaint"),
    [
        ("tactile", 1e39, 0, "demo: /tactile/0: a count is too large for float32"),
        ("wrench", 1.0, 2**31 * 10**9, r"demo: /pose: stamps beyond 2\^31 s cannot be written"),
        ("wrench", 1.0, -5, "demo: /pose: stamps before 0 cannot be written"),
    ],
)
def test_what_does_not_fit_into_a_message_is_named(tmp_path, kind, value, stamp, complaint):
    stamps = np.array([0, 1]) + stamp
    other = Stream("/other", kind, stamps, np.full((2, 6), value))
    with pytest.raises(InputError, match=complaint):
        write_recording(
            Recording("demo", (Stream("/pose", "pose", stamps, pose_rows(2)), other)), tmp_path / "demo.mcap"
        )
    assert not (tmp_path / "demo.mcap").exists()
