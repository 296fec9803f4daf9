"""Conversion between raw ROS 2 messages and streams: the meaning of each message type.

Stamps. Messages with a header are stamped by the header: the time of the sample. If no header stamp of a
topic is set (all are zero), for types without a header, and on request, the log time is used: the time of
reception by the recorder. The choice is made per topic, so that a simulator's clock may start at zero. Joint
states are separated by joint, see `joint_streams`.

Shapes. A topic of markers gives named shapes: cubes, spheres and cylinders at rest. Only its first message is
used.

Frames. Poses, twists and wrenches are taken as published; it is up to the user that their frame is the
robot's base, unless the pose is given by frame names (see `computed_pose`).
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from io import BytesIO
from operator import attrgetter
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
from mcap.reader import make_reader
from mcap.records import Schema
from mcap.well_known import SchemaEncoding

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers.clock import at_row, in_order
from structlearn.readers.decoded_messages import Decoded, columns, decoded
from structlearn.readers.definitions import definition, short_name
from structlearn.readers.demonstration import FIELDS, JOINT_KINDS, Form, Kind, NamedShape, Stream
from structlearn.readers.one_source import check_frames, check_source
from structlearn.readers.raw_messages import RawMessages
from structlearn.readers.source import Role, StampPolicy

FRAME = "base"  # frame_id that we write: the robot's base
LAST_STAMP = 2**31 * 10**9 - 1  # ns: seconds of a header are int32

MESSAGE_TYPES: Mapping[Kind, str] = {  # type that each kind of stream is written as
    **dict.fromkeys(JOINT_KINDS, "sensor_msgs/msg/JointState"),
    "pose": "geometry_msgs/msg/PoseStamped",
    "twist": "geometry_msgs/msg/TwistStamped",
    "wrench": "geometry_msgs/msg/WrenchStamped",
    "tactile": "std_msgs/msg/Float32MultiArray",
    "tool_to_board": "geometry_msgs/msg/QuaternionStamped",
}
OUTPUT_TYPES: Mapping[Kind, str] = {"outputs": "std_msgs/msg/Float64", "digital": "std_msgs/msg/Bool"}
SHAPES_TYPE = "visualization_msgs/msg/MarkerArray"  # one message for all; drawn by rviz, Foxglove and rerun
SOLIDS: Mapping[int, Form] = {1: "cube", 2: "sphere", 3: "cylinder"}  # by marker type

_ARRAYS = [f"std_msgs/{number}MultiArray" for number in ("Float32", "Float64", "Int16", "Int32", "UInt16")]
_NUMBERS = [f"std_msgs/{number}" for number in ("Float32", "Float64", "Int16", "Int32", "UInt8")]
WITHOUT_HEADER = {"geometry_msgs/Pose", "std_msgs/Bool", *_ARRAYS, *_NUMBERS}

READERS: Mapping[Role | Kind | Literal["transforms"], Mapping[str, Sequence[str]]] = {
    "pose": {
        "geometry_msgs/PoseStamped": ("pose.position", "pose.orientation"),
        "geometry_msgs/PoseWithCovarianceStamped": ("pose.pose.position", "pose.pose.orientation"),
        "geometry_msgs/TransformStamped": ("transform.translation", "transform.rotation"),
        # only the pose: an odometry's twist is in the child frame, ours in the base frame
        "nav_msgs/Odometry": ("pose.pose.position", "pose.pose.orientation"),
        "geometry_msgs/Pose": ("position", "orientation"),
    },
    "twist": {"geometry_msgs/TwistStamped": ("twist.linear", "twist.angular")},
    "joint_states": {"sensor_msgs/JointState": ()},
    "transforms": {"tf2_msgs/TFMessage": (), "tf/tfMessage": ()},
    "wrench": {"geometry_msgs/WrenchStamped": ("wrench.force", "wrench.torque")},
    "tactile": dict.fromkeys(_ARRAYS, ("data",)),
    "tool_to_board": {
        "geometry_msgs/QuaternionStamped": ("quaternion",),
        "geometry_msgs/PoseStamped": ("pose.orientation",),
        "geometry_msgs/TransformStamped": ("transform.rotation",),
    },
    "obstacles": {"visualization_msgs/MarkerArray": (), "visualization_msgs/Marker": ()},
    "outputs": dict.fromkeys(_NUMBERS, ("data",)),
    "digital": dict.fromkeys(["std_msgs/Bool", *_NUMBERS], ("data",)),
}
"""Message types supported in each role, with the fields of the columns; quaternions are in ROS's order
x, y, z, w. Joint states, transforms and markers have their own functions."""


def to_stream(
    where: str, topic: str, role: Kind, messages: RawMessages, policy: StampPolicy
) -> tuple[Stream, str | None]:
    """Stream of one topic (not joint states or shapes), and how its stamps were corrected."""
    groups = decoded(where, messages)
    schema = messages.schemas[0]
    assert schema is not None  # `bag_recording.readable` lets none pass
    short = short_name(schema.name)
    with fields_named(where):
        stamps = sample_stamps(messages, () if short in WITHOUT_HEADER else groups, policy)
        fields = [numbers(group.message, *READERS[role][short]) for group in groups]
        frame = check_frames(where, stamps, groups)
    values = table_of_numbers(where, stamps, groups, fields)
    if values.shape[1] == 0:
        raise InputError(f"{where}: messages have no values")
    if role == "pose":
        values = np.hstack([values[:, :3], quaternion.from_xyzw(values[:, 3:])])
    elif role == "tool_to_board":
        values = quaternion.from_xyzw(values)
    check_source(where, role, stamps, values, messages.channels)
    rows, note = in_order(where, stamps, policy)
    if note is not None:
        stamps, values = stamps[rows], values[rows]
    return Stream(topic, role, stamps, values, frame=frame), note


@contextmanager
def fields_named(where: str) -> Iterator[None]:
    """Turn errors about fields of a message, missing or contradictory, into an InputError."""
    try:
        yield
    except InputError:
        raise
    except OverflowError as error:
        raise InputError(f"{where}: {error}") from error
    except (AttributeError, TypeError, ValueError) as error:
        raise InputError(f"{where}: a message lacks a field of its type: {error}") from error


def nanoseconds(clock: Any) -> np.ndarray:
    """int64 ns of a ROS time or of a column of them. Raises OverflowError: its ns are more than a second."""
    seconds, rest = np.array(clock.sec, dtype=np.int64), np.array(clock.nanosec, dtype=np.int64)
    if (wrong := rest >= 10**9).any():
        place = np.argmax(wrong)
        stamp = f"{np.ravel(seconds)[place]} s and {np.ravel(rest)[place]} ns"
        raise OverflowError(f"a stamp is {stamp}: nanosec must be below 10^9")
    return seconds * 10**9 + rest


def sample_stamps(messages: RawMessages, groups: Sequence[Decoded], policy: StampPolicy) -> np.ndarray:
    """(T,) int64 ns: header stamps of all groups, if any is set and they are requested, else log times."""
    stamps = np.zeros(len(messages.log_times), dtype=np.int64)
    for group in groups:
        stamps[group.rows] = nanoseconds(group.message.header.stamp)
    return stamps if stamps.any() and policy.clock == "header" else messages.log_times


def numbers(message: Any, *paths: str) -> list:
    """Numbers of some fields of a message, vectors, `data` or its number; of many messages, columns (M,)."""
    columns_read: list = []
    for path in paths:
        part = attrgetter(path)(message)
        if path == "data" and (np.isscalar(part) or (isinstance(part, np.ndarray) and part.ndim == 1)):
            columns_read.append(part)
        elif path == "data":
            columns_read += sequence(part)
        else:
            columns_read += [part.x, part.y, part.z, *([part.w] if hasattr(part, "w") else [])]
    return columns_read


def sequence(field: Any) -> list:
    """Numbers of a sequence; for many messages (M, n) its n columns."""
    return list(np.moveaxis(field, 1, 0) if isinstance(field, np.ndarray) else field)


def table_of_numbers(
    where: str,
    stamps: np.ndarray,
    groups: Sequence[Decoded],
    fields: Sequence[list],
    orders: Sequence[tuple[str, ...]] = (),
    joints: Sequence[str] = (),
    kind: str = "",
) -> np.ndarray:
    """(T, D) float64 of the `numbers` of all groups; NaN where a message lacks a joint.

    `orders`: joints that each group names, if any; `joints`: those of the columns; `kind`: of signal.
    """
    values = np.full((len(stamps), len(joints) or len(fields[0])), np.nan)
    place_of = {name: place for place, name in enumerate(joints)}
    widths: dict[frozenset[str], int] = {}
    for group, group_columns, names in zip(groups, fields, orders or [()] * len(groups), strict=True):
        width = widths.setdefault(frozenset(names), len(group_columns))
        if len(group_columns) != width:
            row = at_row(int(group.rows[0]), stamps)
            raise InputError(f"{where}: {row} has {len(group_columns)} values, the first has {width}")
        if names and width not in (0, len(names)):
            raise InputError(f"{where} names {len(names)} joints and has {width} {kind} per message")
        if width:
            places = np.array([place_of[name] for name in names] or range(width))
            values[group.rows[:, None], places] = (
                np.array(group_columns, dtype=float).reshape(width, len(group.rows)).T
            )
    return values


def to_messages(where: str, stream: Stream) -> RawMessages:
    """Messages of a stream, one per row, with its stamps in the headers if the type has one.

    Tactile counts are float32: integers up to 2^24 are exact. All other values keep 64 bits.
    """
    values = stream.values
    if stream.kind in JOINT_KINDS:
        names = stream.joints or [f"joint_{joint + 1}" for joint in range(values.shape[1])]
        return joint_messages(where, names, stream.stamps, {stream.kind: values})
    if stream.kind == "pose":
        values = np.hstack([values[:, :3], quaternion.to_xyzw(values[:, 3:])])
    elif stream.kind == "tool_to_board":
        values = quaternion.to_xyzw(values)
    lengths = {"data": values.shape[1]} if stream.kind == "tactile" else {}
    message_type = {**MESSAGE_TYPES, **OUTPUT_TYPES}[stream.kind]
    content, fields = _blank(where, message_type, stream.stamps, (), lengths)
    places = numbers(fields, *READERS[stream.kind][short_name(message_type)])
    with np.errstate(over="ignore"):
        for place, column in zip(places, values.T, strict=True):
            place[:] = column
    if np.isinf(places).any():
        raise InputError(f"{where}: a count is too large for float32")
    return _of_one_type(message_type, stream.stamps, content)


def joint_messages(
    where: str, names: Sequence[str], stamps: np.ndarray, values: Mapping[Kind, np.ndarray]
) -> RawMessages:
    """Joint states, one per row: (T,) int64 ns, and (T, J) per kind that is filled."""
    message_type = MESSAGE_TYPES["joint_positions"]
    lengths = {FIELDS[kind]: signal.shape[1] for kind, signal in values.items()}
    content, fields = _blank(where, message_type, stamps, names, lengths)
    for kind, signal in values.items():
        getattr(fields, FIELDS[kind])[:] = signal
    return _of_one_type(message_type, stamps, content)


def to_shapes(where: str, messages: RawMessages) -> tuple[NamedShape, ...]:
    """Shapes of the first message of a topic of markers, in order.

    A marker is named by its namespace, followed by its number if several share it. Markers of other types
    (arrows, text, meshes) are ignored.
    """
    first = RawMessages(messages.log_times[:1], messages.schemas[:1], messages.data[:1])
    ((_, message),) = decoded(where, first)
    with fields_named(where):
        solids, frames = [], set()
        for marker in getattr(message, "markers", [message]):
            fields = (marker.id, marker.type, *numbers(marker, "pose.position", "pose.orientation", "scale"))
            number, kind, *values = (
                float(np.ravel(value)[0]) for value in fields
            )  # may be columns with a single row
            if kind in SOLIDS:
                frames.add(marker.header.frame_id.lstrip("/"))
                solids.append((marker.ns, int(number), SOLIDS[int(kind)], np.array(values)))
    if len(frames) > 1:
        raise InputError(f"{where}: shapes are in several frames: {', '.join(sorted(frames))}")
    spaces = [space for space, *_ in solids]
    shapes = []
    for space, number, form, row in solids:
        name = space if spaces.count(space) == 1 else f"{space} {number}"
        position, orientation, size = np.split(row, (3, 7))
        if not (np.isfinite(row).all() and (size > 0).all()):
            raise InputError(f"{where}: shape '{name}' needs a finite pose and a positive size")
        length = np.linalg.norm(orientation)
        if not length > 0:
            raise InputError(f"{where}: shape '{name}' has the orientation 0, 0, 0, 0")
        shapes.append(NamedShape(name, form, position, quaternion.from_xyzw(orientation / length), size))
    return tuple(shapes)


def shapes_message(stamp: int, shapes: Sequence[NamedShape]) -> RawMessages:
    """One message of markers with all shapes; their unique names become the namespaces."""
    seconds, rest = divmod(int(stamp), 10**9)
    header = {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": FRAME}
    types = {form: number for number, form in SOLIDS.items()}
    markers = [
        {
            "header": header,
            "ns": shape.name,
            "type": types[shape.form],
            "pose": {
                "position": dict(zip("xyz", map(float, shape.position), strict=True)),
                "orientation": dict(zip("wxyz", map(float, shape.orientation), strict=True)),
            },
            "scale": dict(zip("xyz", map(float, shape.size), strict=True)),
            "color": dict.fromkeys("rgb", 0.5) | {"a": 1.0},  # alpha 0 would be invisible
        }
        for shape in shapes
    ]
    data = np.frombuffer(_encoded(SHAPES_TYPE, {"markers": markers}), dtype=np.uint8)
    return _of_one_type(SHAPES_TYPE, np.array([stamp]), data[None])


def _of_one_type(message_type: str, stamps: np.ndarray, content: np.ndarray) -> RawMessages:
    """Messages (T, L) uint8 of one type at (T,) increasing stamps in ns."""
    text = definition(message_type).encode()
    schema = Schema(id=0, name=message_type, encoding=SchemaEncoding.ROS2, data=text)
    return RawMessages(stamps, [schema] * len(stamps), [row.tobytes() for row in content])


def _blank(
    where: str, message_type: str, stamps: np.ndarray, names: Sequence[str], lengths: Mapping[str, int]
) -> tuple[np.ndarray, SimpleNamespace]:
    """Messages with stamps, joint names and sequences of zeros, and their columns for writing."""
    if stamps.min() < 0 or stamps.max() > LAST_STAMP:
        fault = "before 0" if stamps.min() < 0 else "beyond 2^31 s"
        raise InputError(f"{where}: stamps {fault} cannot be written")
    template = _template(message_type, tuple(names), tuple(lengths.items()))
    messages = np.tile(np.frombuffer(template, dtype=np.uint8), (len(stamps), 1))
    layout = columns(message_type, definition(message_type), messages)
    assert layout is not None  # our definitions are simple
    fields, _ = layout
    if hasattr(fields, "header"):
        stamp = fields.header.stamp
        stamp.sec[:], stamp.nanosec[:] = np.divmod(stamps, 10**9)
    return messages, fields


@cache
def _template(message_type: str, names: Sequence[str], lengths: Sequence[tuple[str, int]]) -> bytes:
    """A message with these names, and sequences of zeros."""
    message = {"header": {"frame_id": FRAME}, "name": names}  # fields that a type lacks are ignored
    return _encoded(message_type, message | {field: [0.0] * length for field, length in lengths})


def _encoded(message_type: str, message: Mapping[str, Any]) -> bytes:
    """A message as encoded by the library; missing fields are zero or empty."""
    from mcap_ros2.writer import Writer  # needed only for writing

    file = BytesIO()
    writer = Writer(file)
    writer.write_message("/", writer.register_msgdef(message_type, definition(message_type)), message, 0)
    writer.finish()
    file.seek(0)
    ((_, _, record),) = make_reader(file).iter_messages()
    return record.data
