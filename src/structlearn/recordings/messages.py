"""From decoded ROS 2 messages to streams: what each message type means.

Stamps. A topic whose messages have a header is stamped by the header: when the sample was taken. Where no
header stamp of the topic is set (all are zero), and for types without a header, MCAP's log time stands in:
when the recorder got it. The choice is made per topic, so that a simulator's clock may start at zero.

Frames. Poses, twists and wrenches are taken as published; that their frame is the robot's base is up to the
user. No transforms are looked up.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from structlearn.ground import quaternion
from structlearn.ground.errors import InputError
from structlearn.recordings.checks import at_row
from structlearn.recordings.recording import Kind, Stream
from structlearn.recordings.topics import Role


class TopicCollector:
    """Collects the messages of one topic and makes streams of them.

    Rows are kept in lists and become arrays once, at the end: the loop touches every message of a bag.
    """

    def __init__(self, where: str, topic: str, role: Role, message_type: str) -> None:
        """Choose how messages are read.

        Args:
            where: the file, for error messages.
            topic: the topic's name.
            role: what the user says the topic is.
            message_type: `package/msg/Type` or `package/Type`.

        Raises:
            InputError: messages of the type cannot be read in that role.
        """
        readers = READERS[role]
        short = message_type.replace("/msg/", "/")
        if short not in readers:
            raise InputError(
                f"{where}: topic '{topic}' has messages of type {message_type}; "
                f"{role} can be read from {', '.join(readers)}"
            )
        self._where = f"{where}: topic '{topic}'"
        self._topic = topic
        self._role: Role = role
        self._row = readers[short]
        self._has_header = short not in WITHOUT_HEADER
        self._header_stamps: list[int] = []
        self._log_times: list[int] = []
        self._rows: list[Any] = []

    def add(self, message: Any, log_time: int) -> None:
        """Take one decoded message, logged at `log_time` ns."""
        self._rows.append(self._row(message))
        self._log_times.append(log_time)
        if self._has_header:
            stamp = message.header.stamp
            self._header_stamps.append(stamp.sec * 10**9 + stamp.nanosec)

    def streams(self) -> list[Stream]:
        """Streams of the topic, in the order in which the messages were logged.

        A pose, twist, wrench or tactile topic gives one stream. Joint states give one for each of position,
        velocity and effort that the messages fill; a field that is NaN throughout counts as not filled, since
        drivers put NaN for what they do not measure.

        Raises:
            InputError: there is no message, a message has another length than the first one, or joint states
                change their set of joints; the message names the row.
        """
        if not self._rows:
            raise InputError(f"{self._where} has no messages")
        logged = np.argsort(np.array(self._log_times, dtype=np.int64), kind="stable")
        header = np.array(self._header_stamps, dtype=np.int64)
        stamps = (header if header.any() else np.array(self._log_times, dtype=np.int64))[logged]
        rows = [self._rows[index] for index in logged.tolist()]
        if self._role == "joint_states":
            return self._joint_streams(stamps, rows)
        values = _table(self._where, stamps, rows)
        if self._role == "pose":
            values = np.hstack([values[:, :3], quaternion.from_xyzw(values[:, 3:])])
        elif self._role == "tool_to_board":
            values = quaternion.from_xyzw(values)
        return [Stream(self._topic, self._role, stamps, values)]

    def _joint_streams(self, stamps: np.ndarray, rows: list[Any]) -> list[Stream]:
        names = rows[0][0]
        order = _joint_order(self._where, stamps, names, [row[0] for row in rows])
        streams = []
        for column, kind in enumerate(JOINT_KINDS, start=1):
            fields = [row[column] for row in rows]
            if not any(fields):
                continue
            values = _table(self._where, stamps, fields)
            if names and values.shape[1] != len(names):
                raise InputError(
                    f"{self._where} names {len(names)} joints and has {values.shape[1]} {kind} per message"
                )
            if np.isnan(values).all():
                continue
            if order is not None:
                values = np.take_along_axis(values, order, axis=1)
            streams.append(Stream(self._topic, kind, stamps, values))
        if not streams:
            raise InputError(f"{self._where} has joint states without position, velocity and effort")
        return streams


def _table(where: str, stamps: np.ndarray, rows: list[Any]) -> np.ndarray:
    """(T, D) float64 from rows that must be of one length."""
    width = len(rows[0])
    if any(len(row) != width for row in rows):
        row = next(index for index, values in enumerate(rows) if len(values) != width)
        raise InputError(f"{where}: {at_row(row, stamps)} has {len(rows[row])} values, the first has {width}")
    if width == 0:
        raise InputError(f"{where}: messages have no values")
    return np.array(rows, dtype=float)


def _joint_order(
    where: str, stamps: np.ndarray, names: list[str], rows: list[list[str]]
) -> np.ndarray | None:
    """(T, J) columns that bring each message into the first one's order; None where nothing is to do."""
    if all(row == names for row in rows):
        return None
    for index, row in enumerate(rows):
        if sorted(row) != sorted(names):
            raise InputError(
                f"{where}: {at_row(index, stamps)} has the joints {', '.join(row) or '(none)'}, "
                f"the first has {', '.join(names) or '(none)'}"
            )
    return np.array([[row.index(name) for name in names] for row in rows])


def _of_pose(pose: Any) -> tuple[float, ...]:
    """x, y, z, then the quaternion in ROS's order x, y, z, w."""
    p, q = pose.position, pose.orientation
    return (p.x, p.y, p.z, q.x, q.y, q.z, q.w)


def _of_transform(message: Any) -> tuple[float, ...]:
    p, q = message.transform.translation, message.transform.rotation
    return (p.x, p.y, p.z, q.x, q.y, q.z, q.w)


def _of_quaternion(q: Any) -> tuple[float, ...]:
    return (q.x, q.y, q.z, q.w)


def _of_twist(message: Any) -> tuple[float, ...]:
    v, w = message.twist.linear, message.twist.angular
    return (v.x, v.y, v.z, w.x, w.y, w.z)


def _of_wrench(message: Any) -> tuple[float, ...]:
    f, m = message.wrench.force, message.wrench.torque
    return (f.x, f.y, f.z, m.x, m.y, m.z)


def _of_joint_state(message: Any) -> tuple[list, ...]:
    return (message.name, message.position, message.velocity, message.effort)


def _of_array(message: Any) -> list[float]:
    return message.data


JOINT_KINDS: tuple[Kind, ...] = ("joint_positions", "joint_velocities", "joint_torques")
"""Kinds of stream that the fields position, velocity and effort of a joint state give."""

WITHOUT_HEADER = frozenset(
    {"geometry_msgs/Pose"}
    | {f"std_msgs/{number}MultiArray" for number in ("Float32", "Float64", "Int16", "Int32", "UInt16")}
)
"""Understood types that have no header."""

READERS: Mapping[Role, Mapping[str, Callable[[Any], Any]]] = {
    "pose": {
        "geometry_msgs/PoseStamped": lambda message: _of_pose(message.pose),
        "geometry_msgs/PoseWithCovarianceStamped": lambda message: _of_pose(message.pose.pose),
        "geometry_msgs/TransformStamped": _of_transform,
        # An odometry's twist is given in the child frame, ours in the base frame: only the pose is taken.
        "nav_msgs/Odometry": lambda message: _of_pose(message.pose.pose),
        "geometry_msgs/Pose": _of_pose,
    },
    "twist": {"geometry_msgs/TwistStamped": _of_twist},
    "joint_states": {"sensor_msgs/JointState": _of_joint_state},
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
}
"""Message types that can be read in each role, and how a message gives a row of numbers."""
