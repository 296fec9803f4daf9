"""Between raw ROS 2 messages and streams: what each message type means.

Stamps. A topic whose messages have a header is stamped by the header: when the sample was taken. Where no
header stamp of the topic is set (all are zero), for types without a header, and where the user says so, the
log time stands in: when the recorder got it. The choice is made per topic, so that a simulator's clock may
start at zero. Joint states are told apart by joint, see `joint_series`.

Shapes. A topic of markers gives named shapes: cubes, spheres and cylinders at rest. Its first message counts.

Frames. Poses, twists and wrenches are taken as published; that their frame is the robot's base is up to the
user, unless the pose is named by its frames (see `transforms`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from io import BytesIO
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
from mcap.reader import make_reader

from structlearn.ground import quaternion
from structlearn.ground.errors import InputError
from structlearn.recordings import cdr
from structlearn.recordings.bag_reader import RawMessages, damage_named
from structlearn.recordings.bag_writer import RawTopic
from structlearn.recordings.decoding import (
    decoded,
    fields_named,
    header_stamps,
    sample_stamps,
    sequence,
    table,
)
from structlearn.recordings.recording import JOINT_KINDS, Form, Kind, NamedShape, Stream
from structlearn.recordings.schemas import MESSAGE_TYPES, SHAPES_TYPE, definition
from structlearn.recordings.stamps import StampPolicy, in_order
from structlearn.recordings.topics import Role

FRAME = "base"
"""Frame of the poses, twists, wrenches and joint states that we write: the robot's base."""

LAST_STAMP = 2**31 * 10**9 - 1
"""ns: seconds of a header are int32."""


def check_readable(where: str, role: Role | Literal["transforms"], types: Sequence[str]) -> None:
    """Check that messages can be read as what the user says the topic is.

    Args:
        where: file and topic, for error messages.
        role: what the user says the topic is.
        types: of the topic's messages, `package/msg/Type` or `package/Type`.

    Raises:
        InputError: there are several types, or messages of the type cannot be read in that role.
    """
    if len(types) > 1:
        raise InputError(f"{where} has messages of several types: {', '.join(types)}")
    if cdr.short_name(types[0]) not in READERS[role]:
        raise InputError(
            f"{where} has messages of type {types[0]}; {role} can be read from {', '.join(READERS[role])}"
        )


def to_stream(
    where: str, topic: str, role: Kind, messages: RawMessages, policy: StampPolicy
) -> tuple[Stream, str | None]:
    """Stream of one topic.

    Args:
        where: file and topic, for error messages.
        topic: its name.
        role: what the topic is, one in which its messages can be read; joint states and shapes are not of
            them.
        messages: its messages.
        policy: how stamps are taken.

    Returns:
        The stream, and what was done about its stamps, if anything (`stamps.in_order`).

    Raises:
        InputError: a message cannot be decoded, lacks a field of its type or has another length than the
            first one, or stamps do not increase; the error names the row.
    """
    with damage_named(where, "message"):
        groups = decoded(messages)
    short = cdr.short_name(next(iter(messages.schemas.values())).name)
    read = READERS[role][short]
    with fields_named(where):
        header = None if short in WITHOUT_HEADER else header_stamps(groups)
        parts = [(group.rows, read(group.message)) for group in groups]
    stamps = sample_stamps(messages.log_times, header, policy)
    values = table(where, stamps, parts)
    if values.shape[1] == 0:
        raise InputError(f"{where}: messages have no values")
    if role == "pose":
        values = np.hstack([values[:, :3], quaternion.from_xyzw(values[:, 3:])])
    elif role == "tool_to_board":
        values = quaternion.from_xyzw(values)
    rows, note = in_order(where, stamps, policy)
    if note is not None:
        stamps, values = stamps[rows], values[rows]
    return Stream(topic, role, stamps, values), note


def to_topic(where: str, topic: str, stream: Stream) -> RawTopic:
    """Messages of a stream, one per row, for `write_bag`.

    Counts of tactile sensors are float32 in their message: whole numbers up to 2^24 are exact. All other
    values keep their 64 bits.

    Args:
        where: whose stream it is, and its topic, for error messages.
        topic: to write on.
        stream: stamps in ns; the stamp goes into the header where the type has one.

    Raises:
        InputError: a stamp is negative or beyond what a header holds, a tactile count beyond float32.
    """
    values = stream.values
    if stream.kind in JOINT_KINDS:
        names = stream.joints or [f"joint_{joint + 1}" for joint in range(values.shape[1])]
        return joint_topic(where, topic, names, stream.stamps, {stream.kind: values})
    if stream.kind == "pose":
        values = np.hstack([values[:, :3], quaternion.to_xyzw(values[:, 3:])])
    elif stream.kind == "tool_to_board":
        values = quaternion.to_xyzw(values)
    lengths = {"data": values.shape[1]} if stream.kind == "tactile" else {}
    raw, columns = _blank(where, topic, MESSAGE_TYPES[stream.kind], stream.stamps, (), lengths)
    places = READERS[stream.kind][cdr.short_name(raw.message_type)](columns)
    with np.errstate(over="ignore"):
        for place, column in zip(places, values.T, strict=True):
            place[:] = column
    if np.isinf(places).any():
        raise InputError(f"{where}: a count is too large for float32")
    return raw


def joint_topic(
    where: str, topic: str, names: Sequence[str], stamps: np.ndarray, values: Mapping[Kind, np.ndarray]
) -> RawTopic:
    """Messages of joint states, one per row, for `write_bag`.

    Args:
        where: whose joints they are, and the topic, for error messages.
        topic: to write on.
        names: (J,) of the joints.
        stamps: (T,) int64 ns.
        values: (T, J) of each kind that is filled.

    Raises:
        InputError: a stamp is negative or beyond what a header holds.
    """
    fields = {("position", "velocity", "effort")[JOINT_KINDS.index(kind)]: values[kind] for kind in values}
    lengths = {field: columns.shape[1] for field, columns in fields.items()}
    raw, columns = _blank(where, topic, MESSAGE_TYPES["joint_positions"], stamps, names, lengths)
    for field, its in fields.items():
        getattr(columns, field)[:] = its
    return raw


def to_shapes(where: str, messages: RawMessages) -> tuple[NamedShape, ...]:
    """Shapes of the first message of a topic of markers, in their order.

    A marker is named by its namespace, with its number behind it where several have the same. Markers of
    other types (arrows, text, meshes) are passed over.

    Args:
        where: file and topic, for error messages.
        messages: its messages.

    Raises:
        InputError: a message cannot be decoded or lacks a field of its type, or a shape is not finite, has no
            extent, or no orientation.
    """
    with damage_named(where, "message"):
        (first,) = decoded(replace(messages, channels=messages.channels[:1], data=messages.data[:1]))
    short = cdr.short_name(next(iter(messages.schemas.values())).name)
    with fields_named(where):
        markers = [one for one in READERS["obstacles"][short](first.message) if one[2] in FORMS]
    spaces = [space for space, *_ in markers]
    shapes = []
    for space, number, kind, values in markers:
        name = space if spaces.count(space) == 1 else f"{space} {number}"
        position, orientation, size = np.split(np.array(values), (3, 7))
        if not (np.isfinite(values).all() and (size > 0).all()):
            raise InputError(f"{where}: shape '{name}' needs a finite pose and a positive size")
        length = np.linalg.norm(orientation)
        if not length > 0:
            raise InputError(f"{where}: shape '{name}' has the orientation 0, 0, 0, 0")
        turned = quaternion.from_xyzw(orientation / length)
        shapes.append(NamedShape(name, FORMS[kind], position, turned, size))
    return tuple(shapes)


def shapes_topic(topic: str, stamp: int, shapes: Sequence[NamedShape]) -> RawTopic:
    """One message of markers with all shapes, for `write_bag`.

    Args:
        topic: to write on.
        stamp: ns, when they are there; also in the headers.
        shapes: with different names, which become the markers' namespaces.
    """
    seconds, rest = divmod(int(stamp), 10**9)
    header = {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": FRAME}
    markers = [
        {
            "header": header,
            "ns": shape.name,
            "type": _MARKERS[shape.form],
            "pose": {
                "position": dict(zip("xyz", map(float, shape.position), strict=True)),
                "orientation": dict(zip("wxyz", map(float, shape.orientation), strict=True)),
            },
            "scale": dict(zip("xyz", map(float, shape.size), strict=True)),
            "color": dict.fromkeys("rgb", 0.5) | {"a": 1.0},  # transparent is invisible
        }
        for shape in shapes
    ]
    data = np.frombuffer(_encoded(SHAPES_TYPE, {"markers": markers}), dtype=np.uint8)
    return RawTopic(topic, SHAPES_TYPE, definition(SHAPES_TYPE), np.array([stamp]), data[None])


def _blank(
    where: str,
    topic: str,
    message_type: str,
    stamps: np.ndarray,
    names: Sequence[str],
    lengths: Mapping[str, int],
) -> tuple[RawTopic, SimpleNamespace]:
    """Messages with stamps, joints' names and sequences of zeros, and columns to fill in the numbers."""
    if stamps.min() < 0 or stamps.max() > LAST_STAMP:
        fault = "before 0" if stamps.min() < 0 else "beyond 2^31 s"
        raise InputError(f"{where}: stamps {fault} cannot be written")
    template = _template(message_type, tuple(names), tuple(lengths.items()))
    messages = np.tile(np.frombuffer(template, dtype=np.uint8), (len(stamps), 1))
    columns = cdr.columns(message_type, definition(message_type), messages)
    assert columns is not None  # all are copies of one template
    if hasattr(columns, "header"):
        stamp = columns.header.stamp
        stamp.sec[:], stamp.nanosec[:] = np.divmod(stamps, 10**9)
    return RawTopic(topic, message_type, definition(message_type), stamps, messages), columns


@cache
def _template(message_type: str, names: Sequence[str], lengths: Sequence[tuple[str, int]]) -> bytes:
    """A message with these names and sequences of zeros."""
    message = {"header": {"frame_id": FRAME}, "name": names}  # what a type does not have is passed over
    return _encoded(message_type, message | {field: [0.0] * length for field, length in lengths})


def _encoded(message_type: str, message: Mapping[str, Any]) -> bytes:
    """A message as the library encodes it; fields that are not given are zero or empty."""
    from mcap_ros2.writer import Writer  # whoever only reads starts sooner without

    file = BytesIO()
    writer = Writer(file)
    writer.write_message("/", writer.register_msgdef(message_type, definition(message_type)), message, 0)
    writer.finish()
    file.seek(0)
    ((_, _, record),) = make_reader(file).iter_messages()
    return record.data


def _of_pose(pose: Any) -> Sequence:
    """x, y, z, then the quaternion in ROS's order x, y, z, w."""
    p, q = pose.position, pose.orientation
    return (p.x, p.y, p.z, q.x, q.y, q.z, q.w)


def _of_transform(message: Any) -> Sequence:
    p, q = message.transform.translation, message.transform.rotation
    return (p.x, p.y, p.z, q.x, q.y, q.z, q.w)


def _of_quaternion(q: Any) -> Sequence:
    return (q.x, q.y, q.z, q.w)


def _of_twist(message: Any) -> Sequence:
    v, w = message.twist.linear, message.twist.angular
    return (v.x, v.y, v.z, w.x, w.y, w.z)


def _of_wrench(message: Any) -> Sequence:
    f, m = message.wrench.force, message.wrench.torque
    return (f.x, f.y, f.z, m.x, m.y, m.z)


def _of_array(message: Any) -> Sequence | np.ndarray:
    return sequence(message.data)


def _of_markers(markers: Sequence[Any]) -> list[tuple[str, int, int, list[float]]]:
    """Namespace, number, type, and pose and size as 10 numbers of each marker of one message."""
    rows = []
    for one in markers:
        numbers = [one.id, one.type, *_of_pose(one.pose), one.scale.x, one.scale.y, one.scale.z]
        number, kind, *values = (float(np.ravel(value)[0]) for value in numbers)  # a column of one row, or it
        rows.append((one.ns, int(number), int(kind), values))
    return rows


FORMS: Mapping[int, Form] = {1: "cube", 2: "sphere", 3: "cylinder"}
"""What a marker's type says; the others are no solids."""

_MARKERS = {form: kind for kind, form in FORMS.items()}


WITHOUT_HEADER = frozenset(
    {"geometry_msgs/Pose"}
    | {f"std_msgs/{number}MultiArray" for number in ("Float32", "Float64", "Int16", "Int32", "UInt16")}
)
"""Understood types that have no header."""

READERS: Mapping[Role | Kind | Literal["transforms"], Mapping[str, Callable[[Any], Any]]] = {
    "pose": {
        "geometry_msgs/PoseStamped": lambda message: _of_pose(message.pose),
        "geometry_msgs/PoseWithCovarianceStamped": lambda message: _of_pose(message.pose.pose),
        "geometry_msgs/TransformStamped": _of_transform,
        # An odometry's twist is given in the child frame, ours in the base frame: only the pose is taken.
        "nav_msgs/Odometry": lambda message: _of_pose(message.pose.pose),
        "geometry_msgs/Pose": _of_pose,
    },
    "twist": {"geometry_msgs/TwistStamped": _of_twist},
    "joint_states": {"sensor_msgs/JointState": lambda message: message},
    "transforms": dict.fromkeys(("tf2_msgs/TFMessage", "tf/tfMessage"), lambda message: message.transforms),
    "wrench": {"geometry_msgs/WrenchStamped": _of_wrench},
    "tactile": {
        f"std_msgs/{number}MultiArray": _of_array
        for number in ("Float32", "Float64", "Int16", "Int32", "UInt16")
    },
    "tool_to_board": {
        "geometry_msgs/QuaternionStamped": lambda message: _of_quaternion(message.quaternion),
        "geometry_msgs/PoseStamped": lambda message: _of_quaternion(message.pose.orientation),
        "geometry_msgs/TransformStamped": lambda message: _of_quaternion(message.transform.rotation),
    },
    "obstacles": {
        "visualization_msgs/MarkerArray": lambda message: _of_markers(message.markers),
        "visualization_msgs/Marker": lambda message: _of_markers([message]),
    },
}
"""Message types that can be read in each role, and how a message gives its columns: numbers, or where its
fields are columns over many messages (`cdr.columns`), arrays."""
