"""Logs of a robot's joints: motion and torques, or motor currents, on one clock, with the joints' names.

A dynamics model is learned from joints alone, so a log needs no end-effector pose, unlike a `Recording`.
Stages hand logs on as tables. A robot's own is a bag with one topic of ROS 2 `sensor_msgs/JointState`.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TypeVar

import numpy as np

from structlearn.core.errors import InputError
from structlearn.readers.bag import write_bag
from structlearn.readers.bag_files import RecordingFile, as_recording_file, open_bag, recording_files
from structlearn.readers.checks import at_row
from structlearn.readers.clock import AS_WRITTEN, MAX_GAP_S, StampPolicy, on_one_clock
from structlearn.readers.joint_series import chosen, joint_series
from structlearn.readers.messages import check_readable, joint_messages
from structlearn.readers.recording import JOINT_KINDS, Stream
from structlearn.readers.runs import Series, read_series, write_series

JOINT_STATES = "/joint_states"
"""Where drivers publish joint states unless told otherwise."""

UNITS = {
    "stamps": "ns",
    "positions": "rad",
    "velocities": "rad/s",
    "torques": "N m",
    "currents": "A",
    "desired_currents": "A",
    "target_torques": "N m",
}
"""Of the signals, where joints turn."""


@dataclass(frozen=True)
class MotionLog:
    """Motion of joints as it came, at possibly irregular times."""

    name: str  # unique within its set
    joints: tuple[str, ...]  # (n,) names in the order of the columns
    stamps: np.ndarray  # (T,) int64 ns, increasing
    positions: np.ndarray  # (T, n) rad (m where prismatic)
    velocities: np.ndarray  # (T, n) rad/s
    # what is known of the origin; `origin` is `simulated` or `recorded`
    provenance: Mapping[str, str] = field(default_factory=dict, kw_only=True)

    def __post_init__(self) -> None:
        """Raise an InputError naming log and row if shapes differ, stamps do not increase or NaNs occur."""
        count, width = len(self.stamps), len(self.joints)
        if count < 2:
            raise InputError(f"{self.name}: needs at least two samples, has {count}")
        if (late := np.diff(self.stamps) <= 0).any():
            row = at_row(int(np.argmax(late)) + 1, self.stamps)
            raise InputError(f"{self.name}: {row} does not come after the one before it")
        for signal in signals_of(type(self)):
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


@dataclass(frozen=True)
class JointLog(MotionLog):
    """A log with torques (T, n) in N m, positive when they accelerate the joint forwards."""

    torques: np.ndarray


@dataclass(frozen=True)
class DriveLog(MotionLog):
    """A log of an arm without torque sensors; a drive gives a gain times its current."""

    currents: np.ndarray  # (T, n) A, measured
    desired_currents: np.ndarray  # (T, n) A, what the controller asks the drives for
    target_torques: np.ndarray  # (T, n) N m, what the controller thinks the joints need; no measurement


Log = TypeVar("Log", JointLog, DriveLog)


def signals_of(kind: type[MotionLog]) -> list[str]:
    """Names of the (T, n) signals of a kind of log."""
    return [one.name for one in fields(kind) if one.name in UNITS and one.name != "stamps"]


def write_log_table(logs: Sequence[JointLog] | Sequence[DriveLog], target: str | Path) -> None:
    """Publish a set of logs as a Parquet table with the columns `stamps`, `positions.JOINT`, ..."""
    runs = []
    for log in logs:
        columns = {"stamps": log.stamps}
        for signal in signals_of(type(log)):
            names = (f"{signal}.{joint}" for joint in log.joints)
            columns |= dict(zip(names, getattr(log, signal).T, strict=True))
        about = {"joints": list(log.joints), "provenance": dict(log.provenance)}
        runs.append(Series(log.name, columns, about))
    write_series(runs, UNITS, target)


def read_log_table(
    path: str | Path,
    kind: type[Log] = JointLog,  # type: ignore[assignment]  # mypy binds no default to a type variable
) -> list[Log]:
    """Read a set of logs in the order in which they were written.

    Raises InputError: the table is missing, damaged or not of this kind of logs.
    """
    logs = []
    for run in read_series(path):
        try:
            joints = tuple(run.about["joints"])
            signals = [run.stacked([f"{signal}.{joint}" for joint in joints]) for signal in signals_of(kind)]
            provenance = run.about["provenance"]
            logs.append(kind(run.name, joints, run.columns["stamps"], *signals, provenance=provenance))
        except KeyError as missing:
            raise InputError(f"{path}: no {kind.__name__}: {run.name} has no {missing}") from missing
    return logs


def on_clock(
    log: DriveLog, rate_hz: float, delays_s: np.ndarray, max_gap_s: float = MAX_GAP_S
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A log on one uniform clock (`clock.on_one_clock`), each joint's current put back to when it acted.

    `delays_s`: (..., n) by how much each measured current is later than the motion that it belongs to;
    several assumptions about it share the clock. Returns times (N,) s, positions and velocities (N, n),
    currents (..., N, n).
    """
    late = np.round(np.asarray(delays_s) * 1e9).astype(np.int64)
    streams = [
        Stream("positions", "joint_positions", log.stamps, log.positions),
        Stream("velocities", "joint_velocities", log.stamps, log.velocities),
    ]
    streams += [
        Stream("currents", "joint_torques", log.stamps - late[place], log.currents[:, [place[-1]]])
        for place in np.ndindex(late.shape)
    ]
    time, (positions, velocities, *currents) = on_one_clock(log.name, streams, rate_hz, max_gap_s)
    stacked = np.stack([its[:, 0] for its in currents]).reshape(*late.shape, -1)
    return time, positions, velocities, np.ascontiguousarray(np.swapaxes(stacked, -1, -2))


def write_joint_log(log: JointLog, path: str | Path) -> None:
    """Write a log as an MCAP file, which gives the log its name; the caller publishes it.

    Raises InputError: a stamp is negative or after 2^31 s.
    """
    values = dict(zip(JOINT_KINDS, (log.positions, log.velocities, log.torques), strict=True))
    messages = joint_messages(f"{log.name}: {JOINT_STATES}", log.joints, log.stamps, values)
    provenance = json.dumps(dict(log.provenance), sort_keys=True)
    write_bag(path, {"provenance": provenance}, [(JOINT_STATES, messages)])


def read_joint_logs(
    source: str | Path,
    topic: str = JOINT_STATES,
    joints: Sequence[str] | None = None,
    stamps: StampPolicy = AS_WRITTEN,
) -> list[JointLog]:
    """Read the logs of a source as of `bag_files.recording_files`, in natural order of their names."""
    return [read_joint_log(file, topic, joints, stamps) for file in recording_files(source)]


def read_joint_log(
    path: str | Path | RecordingFile,
    topic: str = JOINT_STATES,
    joints: Sequence[str] | None = None,
    stamps: StampPolicy = AS_WRITTEN,
) -> JointLog:
    """Read a log, named after its file, from one of any format (`bag_files`), ours or a robot's.

    Columns are those of the joints that are named, or of all joints of the publisher that has the most, in
    the order of its first message. Raises InputError: the file is missing, cut off or of another kind; it
    lacks the topic, or the topic is of another type; joints have no names, one is missing, or they come at
    different times; positions, velocities or efforts are not filled, or not finite.
    """
    file = path if isinstance(path, RecordingFile) else as_recording_file(Path(path))
    where = f"{file.path}: topic '{topic}'"
    bag = open_bag(file, [topic])
    if topic not in bag.messages:
        raise InputError(
            f"{file.path}: has no joint states on '{topic}'; its topics are {sorted(bag.topics)}"
        )
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
    provenance = bag.provenance(file.path)
    if note is not None:
        provenance["stamps"] = f"{topic}: {note}"
    if others:
        provenance["joints"] = f"{topic}: without {', '.join(others)}"
    positions, velocities, torques = (one.values[kind] for kind in JOINT_KINDS)
    return JointLog(file.name, one.names, one.stamps, positions, velocities, torques, provenance=provenance)
