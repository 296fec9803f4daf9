"""Logs of a robot's joints: positions, velocities and torques on one clock, with the joints' names.

A dynamics model is learned from joints alone, so a log needs no end-effector pose, unlike a `Recording`. Its
file is an MCAP with one topic of ROS 2 `sensor_msgs/JointState`, as a robot's driver publishes it.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer

from structlearn.ground.errors import InputError
from structlearn.recordings.checks import at_row
from structlearn.recordings.messages import JOINT_KINDS, TopicCollector
from structlearn.recordings.schemas import FRAME, definition

JOINT_STATES = "/joint_states"
"""Where drivers publish joint states unless told otherwise."""

MESSAGE_TYPE = "sensor_msgs/msg/JointState"
METADATA = "structlearn"


@dataclass(frozen=True)
class JointLog:
    """Joint signals of one motion as they came, at possibly irregular times.

    Attributes:
        name: unique within its set; error messages and tables use it.
        joints: (n,) names in the order of the columns.
        stamps: (T,) int64 ns, increasing.
        positions: (T, n) rad (m where prismatic).
        velocities: (T, n) rad/s.
        torques: (T, n) N m, positive when they accelerate the joint forwards.
        provenance: what is known of the origin; `origin` is `simulated` or `recorded`.
    """

    name: str
    joints: tuple[str, ...]
    stamps: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    torques: np.ndarray
    provenance: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        count, width = len(self.stamps), len(self.joints)
        if count < 2:
            raise InputError(f"{self.name}: needs at least two samples, has {count}")
        steps = np.diff(self.stamps)
        if (steps <= 0).any():
            row = int(np.argmax(steps <= 0)) + 1
            raise InputError(f"{self.name}: {at_row(row, self.stamps)} does not come after the one before it")
        for signal in ("positions", "velocities", "torques"):
            values = getattr(self, signal)
            if values.shape != (count, width):
                raise InputError(
                    f"{self.name}: {signal} have shape {values.shape}, not {count} samples of {width} joints"
                )
            if not np.isfinite(values).all():
                row, column = np.argwhere(~np.isfinite(values))[0]
                raise InputError(
                    f"{self.name}: {at_row(int(row), self.stamps)}: {signal} of joint "
                    f"'{self.joints[column]}' are {values[row, column]}"
                )

    @property
    def time(self) -> np.ndarray:
        """(T,) s since the first sample."""
        return (self.stamps - self.stamps[0]) * 1e-9


def write_joint_log(log: JointLog, path: str | Path) -> None:
    """Write a log as an MCAP file; the same log gives the same bytes. The caller publishes the file.

    Args:
        log: its name is not written, the file's stem is the name.
        path: the file; its folder exists.
    """
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.add_metadata(METADATA, {"provenance": json.dumps(dict(log.provenance), sort_keys=True)})
        schema = writer.register_msgdef(MESSAGE_TYPE, definition(MESSAGE_TYPE))
        rows = zip(
            log.stamps.tolist(),
            log.positions.tolist(),
            log.velocities.tolist(),
            log.torques.tolist(),
            strict=True,
        )
        names = list(log.joints)
        for stamp, position, velocity, torque in rows:
            seconds, nanoseconds = divmod(stamp, 10**9)
            header = {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": FRAME}
            message = {"header": header, "name": names, "position": position}
            message |= {"velocity": velocity, "effort": torque}
            writer.write_message(JOINT_STATES, schema, message, stamp, stamp)
        writer.finish()


def read_joint_log(path: str | Path, topic: str = JOINT_STATES) -> JointLog:
    """Read a log from an MCAP file of ROS 2 messages, ours or a robot's.

    Args:
        path: the file, as `ros2 bag record -s mcap` or `write_joint_log` leaves it.
        topic: has joint states with names, positions, velocities and efforts.

    Returns:
        The log, named after the file's stem, columns in the order of the first message's names.

    Raises:
        InputError: the file is missing, cut off or no MCAP; it lacks the topic, or the topic is of another
            type; joints have no names; positions, velocities or efforts are not filled, or not finite.
    """
    path = Path(path)
    collector, names, found, provenance = None, [], set(), {"origin": "recorded", "source": path.name}
    try:
        with open(path, "rb") as file:
            reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
            for record in reader.iter_metadata():
                if record.name == METADATA:
                    provenance = json.loads(record.metadata["provenance"])
            found = {channel.topic for channel in _channels(reader)}
            for schema, _, record, message in reader.iter_decoded_messages([topic]):
                if collector is None:
                    collector = TopicCollector(str(path), topic, "joint_states", schema.name)
                    names = list(message.name)
                collector.add(message, record.log_time)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except McapError as error:
        raise InputError(f"{path}: not a complete MCAP file: {error}") from error
    if collector is None:
        raise InputError(f"{path}: has no joint states on '{topic}'; its topics are {sorted(found)}")
    if not names:
        raise InputError(f"{path}: topic '{topic}' does not name the joints")
    streams = {stream.kind: stream for stream in collector.streams()}
    for kind in JOINT_KINDS:
        if kind not in streams:
            raise InputError(
                f"{path}: topic '{topic}' has no {kind.replace('_', ' ')}; a dynamics model is learned from "
                "position, velocity and effort"
            )
    return JointLog(
        path.stem,
        tuple(names),
        streams["joint_positions"].stamps,
        *(streams[kind].values for kind in JOINT_KINDS),
        provenance=provenance,
    )


def _channels(reader) -> list:
    summary = reader.get_summary()
    return list(summary.channels.values()) if summary is not None else []
