"""Logs of an arm without torque sensors: joint states beside the currents of its motors.

What a drive gives is a gain times its current, so a log becomes one of torques (`JointLog`) when the gains
are known. Its file is an MCAP whose topics are all ROS 2 `sensor_msgs/JointState`; the effort of the topics
of currents is in A, as drivers without torque sensors publish it.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from structlearn.ground.errors import InputError
from structlearn.recordings.bag_reader import own_provenance, read_bag
from structlearn.recordings.bag_writer import write_bag
from structlearn.recordings.joint_log import JOINT_STATES, DriveLog, on_clock
from structlearn.recordings.joint_series import joint_series
from structlearn.recordings.messages import check_readable, joint_topic
from structlearn.recordings.recording import Kind
from structlearn.recordings.stamps import AS_WRITTEN

STATES: dict[Kind, str] = {"joint_positions": "positions", "joint_velocities": "velocities"}
"""Fields of a log that stand in the joint states, by kind of stream."""

DRIVES = {
    "currents": "/drives/currents",
    "desired_currents": "/drives/desired_currents",
    "target_torques": "/drives/target_torques",
}
"""Fields of a log that have a topic of their own."""

EFFORT: Kind = "joint_torques"

__all__ = ["DriveLog", "on_clock", "read_drive_log", "write_drive_log"]


def write_drive_log(log: DriveLog, path: str | Path) -> None:
    """Write a log as an MCAP file; the same log gives the same bytes. The caller publishes the file.

    Args:
        log: its name is not written, the file's stem is the name.
        path: the file; its folder exists.

    Raises:
        InputError: a stamp is negative or after 2^31 s.
    """
    states = {kind: getattr(log, name) for kind, name in STATES.items()}
    tables = {JOINT_STATES: states} | {topic: {EFFORT: getattr(log, name)} for name, topic in DRIVES.items()}
    topics = [
        joint_topic(f"{log.name}: {topic}", topic, log.joints, log.stamps, values)
        for topic, values in tables.items()
    ]
    write_bag(path, {"provenance": json.dumps(dict(log.provenance), sort_keys=True)}, topics)


def read_drive_log(path: str | Path) -> DriveLog:
    """Read a log that `write_drive_log` left.

    Raises:
        InputError: the file is missing, cut off or no MCAP; it lacks a topic, or one of its signals; the
            topics differ in their joints or stamps.
    """
    path = Path(path)
    bag = read_bag(path, [JOINT_STATES, *DRIVES.values()])
    found: dict[str, Any] = {}
    clocks: list[tuple[tuple[str, ...], np.ndarray]] = []
    wanted = {JOINT_STATES: STATES} | {topic: {EFFORT: name} for name, topic in DRIVES.items()}
    for topic, fields in wanted.items():
        where = f"{path}: topic '{topic}'"
        if topic not in bag.messages:
            raise InputError(f"{path}: has no joint states on '{topic}'; its topics are {sorted(bag.topics)}")
        check_readable(where, "joint_states", bag.topics[topic])
        series, _ = joint_series(where, topic, bag.messages[topic], AS_WRITTEN)
        if len(series) > 1:
            raise InputError(f"{where} has joints that come at different times")
        (one,) = series
        for kind, name in fields.items():
            if kind not in one.values:
                raise InputError(f"{where} has no {name.replace('_', ' ')}")
            found[name] = one.values[kind]
        clocks.append((one.names, one.stamps))
        if one.names != clocks[0][0] or not np.array_equal(one.stamps, clocks[0][1]):
            raise InputError(f"{where} has other joints or stamps than '{JOINT_STATES}'")
    return DriveLog(path.stem, *clocks[0], **found, provenance=own_provenance(bag, path))
