"""The ROS 2 messages that this package writes: their definitions, and streams turned into messages.

Definitions are those of ROS 2's `geometry_msgs`, `sensor_msgs` and `std_msgs` without comments, so that bags
open in any ROS 2 tool without our package.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from structlearn.ground import quaternion
from structlearn.recordings.recording import Kind, Stream

FRAME = "base"
"""Frame of poses, twists and wrenches: the robot's base."""

MESSAGE_TYPES: Mapping[Kind, str] = {
    "pose": "geometry_msgs/msg/PoseStamped",
    "twist": "geometry_msgs/msg/TwistStamped",
    "joint_positions": "sensor_msgs/msg/JointState",
    "joint_velocities": "sensor_msgs/msg/JointState",
    "joint_torques": "sensor_msgs/msg/JointState",
    "wrench": "geometry_msgs/msg/WrenchStamped",
    "tactile": "std_msgs/msg/Float32MultiArray",
    "tool_to_board": "geometry_msgs/msg/QuaternionStamped",
}
"""Type in which each kind of stream is written."""


def definition(message_type: str) -> str:
    """Text of a message definition with those of all nested types, as MCAP's `ros2msg` encoding has it."""
    own, *nested = _DEFINITIONS[message_type]
    separator = "=" * 80 + "\n"
    return own + "".join(f"{separator}MSG: {name}\n{_NESTED[name]}" for name in nested)


def to_messages(stream: Stream) -> Iterator[dict[str, Any]]:
    """Messages of a stream, one per row, in the form that `mcap_ros2.writer.Writer` takes.

    Counts of tactile sensors are float32 in their message: whole numbers up to 2^24 are exact. All other
    values keep their 64 bits.

    Args:
        stream: stamps in ns, not negative; the stamp goes into the header where the type has one.

    Yields:
        The next row's message.
    """
    values = np.asarray(stream.values, dtype=float)
    if stream.kind == "pose":
        values = np.hstack([values[:, :3], quaternion.to_xyzw(values[:, 3:])])
    elif stream.kind == "tool_to_board":
        values = quaternion.to_xyzw(values)
    build = _BUILDERS[stream.kind]
    names = [f"joint_{joint + 1}" for joint in range(values.shape[1])]
    for stamp, row in zip(stream.stamps.tolist(), values.tolist(), strict=True):
        seconds, nanoseconds = divmod(stamp, 10**9)
        header = {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": FRAME}
        yield build(header, names, row)


def _pose(header: dict, _: list[str], row: list[float]) -> dict[str, Any]:
    x, y, z, qx, qy, qz, qw = row
    pose = {"position": {"x": x, "y": y, "z": z}, "orientation": {"x": qx, "y": qy, "z": qz, "w": qw}}
    return {"header": header, "pose": pose}


def _twist(header: dict, _: list[str], row: list[float]) -> dict[str, Any]:
    return {"header": header, "twist": {"linear": _vector(row[:3]), "angular": _vector(row[3:])}}


def _quaternion(header: dict, _: list[str], row: list[float]) -> dict[str, Any]:
    x, y, z, w = row
    return {"header": header, "quaternion": {"x": x, "y": y, "z": z, "w": w}}


def _wrench(header: dict, _: list[str], row: list[float]) -> dict[str, Any]:
    return {"header": header, "wrench": {"force": _vector(row[:3]), "torque": _vector(row[3:])}}


def _vector(row: list[float]) -> dict[str, float]:
    return {"x": row[0], "y": row[1], "z": row[2]}


def _joints(field: str) -> Callable[[dict, list[str], list[float]], dict[str, Any]]:
    return lambda header, names, row: {"header": header, "name": names, field: row}


_BUILDERS: Mapping[Kind, Callable[[dict, list[str], list[float]], dict[str, Any]]] = {
    "pose": _pose,
    "twist": _twist,
    "joint_positions": _joints("position"),
    "joint_velocities": _joints("velocity"),
    "joint_torques": _joints("effort"),
    "wrench": _wrench,
    "tactile": lambda _header, _names, row: {"data": row},
    "tool_to_board": _quaternion,
}

_NESTED = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride\n",
}

_HEADER = ("std_msgs/Header", "builtin_interfaces/Time")

_DEFINITIONS: Mapping[str, tuple[str, ...]] = {  # own text, then the names of all nested types
    "geometry_msgs/msg/PoseStamped": (
        "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
        *_HEADER,
        "geometry_msgs/Pose",
        "geometry_msgs/Point",
        "geometry_msgs/Quaternion",
    ),
    "geometry_msgs/msg/TwistStamped": (
        "std_msgs/Header header\ngeometry_msgs/Twist twist\n",
        *_HEADER,
        "geometry_msgs/Twist",
        "geometry_msgs/Vector3",
    ),
    "geometry_msgs/msg/WrenchStamped": (
        "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n",
        *_HEADER,
        "geometry_msgs/Wrench",
        "geometry_msgs/Vector3",
    ),
    "geometry_msgs/msg/QuaternionStamped": (
        "std_msgs/Header header\ngeometry_msgs/Quaternion quaternion\n",
        *_HEADER,
        "geometry_msgs/Quaternion",
    ),
    "sensor_msgs/msg/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
        *_HEADER,
    ),
    "std_msgs/msg/Float32MultiArray": (
        "std_msgs/MultiArrayLayout layout\nfloat32[] data\n",
        "std_msgs/MultiArrayLayout",
        "std_msgs/MultiArrayDimension",
    ),
}
