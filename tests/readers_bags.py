"""Bags as a user's robot writes them, and small recordings; definitions are not those of the package."""

import os
from pathlib import Path

import numpy as np
import pytest
from committed import topic_map
from mcap.writer import Writer as McapWriter
from mcap_ros2.writer import Writer
from rosbags.typesys import Stores, get_typestore

from structlearn.core import quaternion
from structlearn.readers import Recording, Stream, read_recording

STORE = get_typestore(Stores.LATEST)
"""Definitions of ROS 2 as the library `rosbags` has them."""


def write_bag(path, messages, empty=(), **options):
    """Write (topic, type, message, log time in ns) in the given order; `empty` lists (topic, type).

    Options are those of the library's writer.
    """
    with open(path, "wb") as file:
        writer = Writer(file)
        if options:
            file.seek(0)
            writer._writer = McapWriter(file, **options)
            writer._writer.start(profile="ros2", library="tests")
        schemas = {}
        for message_type in [row[1] for row in (*messages, *empty)]:
            if message_type not in schemas:
                name = message_type.replace("/msg/", "/").replace("/", "/msg/")
                text, _ = STORE.generate_msgdef(name, ros_version=2)
                schemas[message_type] = writer.register_msgdef(message_type, text)
        for topic, message_type in empty:
            writer._writer.register_channel(topic, "cdr", schemas[message_type].id)
        for topic, message_type, message, log_time in messages:
            writer.write_message(topic, schemas[message_type], message, log_time, log_time)
        writer.finish()


def read_messages(path, messages, *policy, **topics):
    """The recording of a bag with these messages and roles of topics; `/tool` is the pose unless said."""
    write_bag(path, messages)
    return read_recording(path, topic_map(**{"pose": "/tool"} | topics), *policy)


def foreign_bag(path, schema, messages, encoding="cdr", **options):
    """A bag as other programs write one: its schema (name, language, text), and (stamp, bytes) on /tool."""
    with open(path, "wb") as stream:
        writer = McapWriter(stream, **options)
        writer.start()
        channel = writer.register_channel("/tool", encoding, writer.register_schema(*schema))
        for stamp, content in messages:
            writer.add_message(channel, stamp, content, stamp)
        writer.finish()
    return path


def header(stamp):
    return {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": "base_link"}


def vector(values):
    return dict(zip("xyz", map(float, values), strict=True))


def ros_quaternion(row):
    """Orientation of a row qw, qx, qy, qz."""
    w, x, y, z = map(float, row)
    return {"x": x, "y": y, "z": z, "w": w}


def ros_pose(row):
    """Pose of a row x, y, z, qw, qx, qy, qz."""
    return {"position": vector(row[:3]), "orientation": ros_quaternion(row[3:])}


def pose_messages(stamps, rows, topic="/tool", logged=None):
    """Poses, logged when they are stamped or at times of their own."""
    kind = "geometry_msgs/msg/PoseStamped"
    return [
        (topic, kind, {"header": header(stamp), "pose": ros_pose(row)}, log_time)
        for stamp, row, log_time in zip(stamps, rows, stamps if logged is None else logged, strict=True)
    ]


def joint_messages(stamps, names, positions, topic="/joint_states", **fields):
    """Joint states; `positions` (T, J), and of the other fields what is given."""
    rows = {"position": positions} | fields
    return [
        (
            topic,
            "sensor_msgs/msg/JointState",
            {"header": header(s), "name": list(names)} | {f: list(map(float, rows[f][i])) for f in rows},
            s,
        )
        for i, s in enumerate(stamps)
    ]


def transform_messages(stamps, parent, child, rows, topic="/tf"):
    """Transforms with rows x, y, z, qw, qx, qy, qz, a message each."""
    return [
        (topic, "tf2_msgs/msg/TFMessage", {"transforms": [transform_stamped(s, parent, child, row)]}, s)
        for s, row in zip(stamps, rows, strict=True)
    ]


def transform_stamped(stamp, parent, child, row):
    transform = {"translation": vector(row[:3]), "rotation": ros_quaternion(row[3:])}
    return {"header": header(stamp) | {"frame_id": parent}, "child_frame_id": child, "transform": transform}


def assert_same_poses(values, expected, atol=1e-12):
    """Of rows x, y, z, qw .., whatever the signs of the quaternions."""
    np.testing.assert_allclose(values[:, :3], expected[:, :3], atol=atol)
    assert quaternion.angle_between(values[:, 3:], expected[:, 3:]).max() < 1e-7


def pose_rows(count, seed=0):
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(scale=1e-3, size=(count, 3)), axis=0)
    turns = np.array([1.0, 0.0, 0.0, 0.0]) + rng.normal(scale=0.03, size=(count, 4))
    return np.hstack([path, quaternion.normalised(turns)])


def make_recording(name="demo", seed=0, count=40, fingers=2, provenance=None, segments=None, start=5 * 10**9):
    """A recording with every kind of stream, each with an irregular clock of its own."""
    rng = np.random.default_rng(seed)

    def clock(rate_hz):
        steps = rng.uniform(0.5, 1.5, size=count) / rate_hz
        return start + np.round(np.cumsum(steps) * 1e9).astype(np.int64)

    def stream(topic, kind, width):
        return Stream(topic, kind, clock(100), rng.normal(size=(count, width)))

    streams = [
        Stream("/pose", "pose", clock(100), pose_rows(count, seed)),
        stream("/twist", "twist", 6),
        stream("/joint_states/positions", "joint_positions", 7),
        stream("/joint_states/velocities", "joint_velocities", 7),
        stream("/joint_states/torques", "joint_torques", 7),
        stream("/wrench", "wrench", 6),
    ]
    streams += [
        Stream(f"/tactile/{f}", "tactile", clock(100), rng.integers(-500, 4000, (count, 19)).astype(float))
        for f in range(fingers)
    ]
    turns = quaternion.normalised(rng.normal(size=(count, 4)))
    streams.append(Stream("/tool_to_board", "tool_to_board", clock(100), turns))
    return Recording(name, tuple(streams), segments, provenance or {"origin": "simulated", "seed": str(seed)})


def as_recorded(recordings):
    """The same streams as a robot would have recorded them: nobody knows where the primitives lie."""
    return [Recording(one.name, one.streams, None, {"origin": "recorded"}) for one in recordings]


def recorded_data(name):
    """Folder of a public data set: below RECORDED_DATA, by default beside the repository in `shared`."""
    default = Path(__file__).resolve().parents[1] / ".." / "shared"
    folder = Path(os.environ.get("RECORDED_DATA", default)) / name
    if not folder.is_dir():
        pytest.skip(f"no recorded data in {folder}; RECORDED_DATA names their folder")
    return folder


def write_older(writer, stamps, poses, angles, ros1):
    """A bag of ROS 1, or of ROS 2 before MCAP, by the library `rosbags`; nobody asks for its `/chatter`."""
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    serialise = store.serialize_ros1 if ros1 else store.serialize_cdr
    time, head = (store.types[name] for name in ("builtin_interfaces/msg/Time", "std_msgs/msg/Header"))
    point, turn, pose, posed = (
        store.types[f"geometry_msgs/msg/{name}"] for name in ("Point", "Quaternion", "Pose", "PoseStamped")
    )
    state, words = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/String"]
    nothing, counter = np.zeros(0), (7,) if ros1 else ()
    kinds = {"/tool": posed, "/joint_states": state, "/chatter": words}
    with writer:
        topics = {t: writer.add_connection(t, k.__msgtype__, typestore=store) for t, k in kinds.items()}
        for stamp, (x, y, z, qw, *q), row in zip(stamps, poses.tolist(), angles, strict=True):
            header = head(*counter, time(*divmod(stamp, 10**9)), "base_link")
            tool = posed(header, pose(point(x, y, z), turn(*q, qw)))
            joints = state(header, ["a", "b"], row, nothing, nothing)
            for topic, message in zip(kinds, (tool, joints, words("hello")), strict=True):
                writer.write(topics[topic], stamp, serialise(message, message.__msgtype__))
