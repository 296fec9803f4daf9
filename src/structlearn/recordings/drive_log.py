"""Logs of an arm without torque sensors: joint states beside the currents of its motors.

What a drive gives is a gain times its current, so a log becomes one of torques (`JointLog`) when the gains
are known. Its file is an MCAP whose topics are all ROS 2 `sensor_msgs/JointState`; the effort of the topics
of currents is in A, as drivers without torque sensors publish it.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from structlearn.ground.errors import InputError
from structlearn.recordings.bag_reader import own_provenance, read_bag
from structlearn.recordings.bag_writer import write_bag
from structlearn.recordings.clock import MAX_GAP_S, on_one_clock
from structlearn.recordings.joint_log import JOINT_STATES, check_signals
from structlearn.recordings.joint_series import joint_series
from structlearn.recordings.messages import check_readable, joint_topic
from structlearn.recordings.recording import Kind, Stream
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


@dataclass(frozen=True)
class DriveLog:
    """Joint and motor signals of one motion as they came, at possibly irregular times.

    Attributes:
        name: unique within its set; error messages and tables use it.
        joints: (n,) names in the order of the columns.
        stamps: (T,) int64 ns, increasing.
        positions: (T, n) rad.
        velocities: (T, n) rad/s.
        currents: (T, n) A, measured.
        desired_currents: (T, n) A, what the controller asks the drives for.
        target_torques: (T, n) N m, what the controller thinks the joints need; no measurement.
        provenance: what is known of the origin; `origin` is `simulated` or `recorded`.
    """

    name: str
    joints: tuple[str, ...]
    stamps: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    currents: np.ndarray
    desired_currents: np.ndarray
    target_torques: np.ndarray
    provenance: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        signals = {name: getattr(self, name) for name in (*STATES.values(), *DRIVES)}
        check_signals(self.name, self.joints, self.stamps, signals)

    @property
    def time(self) -> np.ndarray:
        """(T,) s since the first sample."""
        return (self.stamps - self.stamps[0]) * 1e-9


def on_clock(
    log: DriveLog, rate_hz: float, delays_s: np.ndarray, max_gap_s: float = MAX_GAP_S
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A log on one uniform clock, where each joint's current is put back to when it acted.

    Args:
        log: n joints.
        rate_hz: ticks per second.
        delays_s: (..., n) by how much each measured current is later than the motion that it belongs to;
            several assumptions about it share the clock.
        max_gap_s: see `clock.synchronise`.

    Returns:
        Times (N,) s, positions and velocities (N, n), currents (..., N, n).

    Raises:
        InputError: see `clock.on_one_clock`.
    """
    late = np.round(np.asarray(delays_s) * 1e9).astype(np.int64)
    streams = [Stream(JOINT_STATES, kind, log.stamps, getattr(log, name)) for kind, name in STATES.items()]
    streams += [
        Stream(DRIVES["currents"], EFFORT, log.stamps - late[place], log.currents[:, [place[-1]]])
        for place in np.ndindex(late.shape)
    ]
    time, (positions, velocities, *currents) = on_one_clock(log.name, streams, rate_hz, max_gap_s)
    stacked = np.stack([its[:, 0] for its in currents]).reshape(*late.shape, -1)
    return time, positions, velocities, np.ascontiguousarray(np.swapaxes(stacked, -1, -2))


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
