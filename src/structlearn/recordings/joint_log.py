"""Logs of a robot's joints: positions, velocities and torques on one clock, with the joints' names.

A dynamics model is learned from joints alone, so a log needs no end-effector pose, unlike a `Recording`. Its
file is an MCAP with one topic of ROS 2 `sensor_msgs/JointState`, as a robot's driver publishes it.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from structlearn.ground.errors import InputError
from structlearn.recordings.bag_files import RecordingFile, as_recording_file, open_bag, recording_files
from structlearn.recordings.bag_reader import own_provenance
from structlearn.recordings.bag_writer import write_bag
from structlearn.recordings.checks import at_row
from structlearn.recordings.joint_series import chosen, joint_series
from structlearn.recordings.messages import check_readable, joint_topic
from structlearn.recordings.recording import JOINT_KINDS
from structlearn.recordings.stamps import AS_WRITTEN, StampPolicy

JOINT_STATES = "/joint_states"
"""Where drivers publish joint states unless told otherwise."""


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
        signals = {name: getattr(self, name) for name in ("positions", "velocities", "torques")}
        check_signals(self.name, self.joints, self.stamps, signals)

    @property
    def time(self) -> np.ndarray:
        """(T,) s since the first sample."""
        return (self.stamps - self.stamps[0]) * 1e-9


def check_signals(
    name: str, joints: Sequence[str], stamps: np.ndarray, signals: Mapping[str, np.ndarray]
) -> None:
    """Check what a log of joints holds.

    Args:
        name: of the log, for messages.
        joints: (n,) names.
        stamps: (T,) ns.
        signals: (T, n) each.

    Raises:
        InputError: there are fewer than two samples, stamps do not increase, a signal has another shape or a
            value that is not finite; the message names log and row.
    """
    count, width = len(stamps), len(joints)
    if count < 2:
        raise InputError(f"{name}: needs at least two samples, has {count}")
    steps = np.diff(stamps)
    if (steps <= 0).any():
        row = int(np.argmax(steps <= 0)) + 1
        raise InputError(f"{name}: {at_row(row, stamps)} does not come after the one before it")
    for signal, values in signals.items():
        if values.shape != (count, width):
            raise InputError(
                f"{name}: {signal} have shape {values.shape}, not {count} samples of {width} joints"
            )
        if not np.isfinite(values).all():
            row, column = np.argwhere(~np.isfinite(values))[0]
            raise InputError(
                f"{name}: {at_row(int(row), stamps)}: {signal} of joint '{joints[column]}' are "
                f"{values[row, column]}"
            )


def write_joint_log(log: JointLog, path: str | Path) -> None:
    """Write a log as an MCAP file; the same log gives the same bytes. The caller publishes the file.

    Args:
        log: its name is not written, the file's stem is the name.
        path: the file; its folder exists.

    Raises:
        InputError: a stamp is negative or after 2^31 s.
    """
    values = dict(zip(JOINT_KINDS, (log.positions, log.velocities, log.torques), strict=True))
    topic = joint_topic(f"{log.name}: {JOINT_STATES}", JOINT_STATES, log.joints, log.stamps, values)
    write_bag(path, {"provenance": json.dumps(dict(log.provenance), sort_keys=True)}, [topic])


def read_joint_logs(
    source: str | Path,
    topic: str = JOINT_STATES,
    joints: Sequence[str] | None = None,
    stamps: StampPolicy = AS_WRITTEN,
) -> list[JointLog]:
    """Read the logs of a source of any format (`bag_files`), in natural order of their names.

    Raises:
        InputError: the source fails `bag_files.recording_files`, or a log `read_joint_log`.
    """
    return [read_joint_log(file, topic, joints, stamps) for file in recording_files(source)]


def read_joint_log(
    path: str | Path | RecordingFile,
    topic: str = JOINT_STATES,
    joints: Sequence[str] | None = None,
    stamps: StampPolicy = AS_WRITTEN,
) -> JointLog:
    """Read a log from a file of any format (`bag_files`), ours or a robot's.

    Args:
        path: the file, e.g. as `ros2 bag record -s mcap` or `write_joint_log` leaves it, or one of
            `bag_files.recording_files`.
        topic: has joint states with names, positions, velocities and efforts.
        joints: names of those that are taken; None: those of the publisher that has the most.
        stamps: how stamps are taken.

    Returns:
        The log, named after the file's stem, columns in the order of the first message's names.

    Raises:
        InputError: the file is missing, cut off or of another kind; it lacks the topic, or the topic is of
            another type; joints have no names, one is missing, or they come at different times; positions,
            velocities or efforts are not filled, or not finite.
    """
    file = path if isinstance(path, RecordingFile) else as_recording_file(Path(path))
    where = f"{file.path}: topic '{topic}'"
    bag = open_bag(file, [topic])
    if topic not in bag.messages:
        present = sorted(bag.topics)
        raise InputError(f"{file.path}: has no joint states on '{topic}'; its topics are {present}")
    check_readable(where, "joint_states", bag.topics[topic])
    series, note = joint_series(where, topic, bag.messages[topic], stamps)
    if not series[0].names:
        raise InputError(f"{where} does not name the joints")
    series, others = chosen(where, series, joints)
    if len(series) > 1:
        parts = " and ".join(", ".join(one.names) for one in series)
        raise InputError(f"{where} has joints that come at different times: {parts}")
    (one,) = series
    for kind in JOINT_KINDS:
        if kind not in one.values:
            raise InputError(
                f"{where} has no {kind.replace('_', ' ')}; a dynamics model is learned from "
                "position, velocity and effort"
            )
    provenance = own_provenance(bag, file.path)
    if note is not None:
        provenance["stamps"] = f"{topic}: {note}"
    if others:
        provenance["joints"] = f"{topic}: without {', '.join(others)}"
    positions, velocities, torques = (one.values[kind] for kind in JOINT_KINDS)
    return JointLog(file.name, one.names, one.stamps, positions, velocities, torques, provenance)
