"""Joint logs: motion with torques or motor currents on one clock, and the names of the joints.

A dynamics model is learned from joints alone, so a log needs no end-effector pose, unlike a `Recording`.
Stages exchange logs as tables; a robot's own log is a bag (`bag_recording.read_joint_log`).

Joint states of one topic are separated by the names of the joints (`joint_series`). On `/joint_states` a
robot, its gripper and its hand often publish side by side, each at its own rate, and a message may contain
only some of the joints. Joints that always occur together are one series with one clock. Joints that ever
occur together, directly or through others, belong to one publisher.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from structlearn.core.errors import InputError
from structlearn.readers.bag import RawMessages
from structlearn.readers.cdr import Decoded, decoded
from structlearn.readers.clock import at_row, in_order
from structlearn.readers.demonstration import (
    JOINT_KINDS,
    Kind,
    Series,
    Stream,
    columns_of,
    read_series,
    write_series,
)
from structlearn.readers.messages import FIELDS, fields_named, sample_stamps, sequence, table
from structlearn.readers.source import StampPolicy

UNITS = {
    "stamps": "ns",
    "positions": "rad",
    "velocities": "rad/s",
    "torques": "N m",
    "currents": "A",
    "desired_currents": "A",
    "target_torques": "N m",
    "accelerations": "rad/s^2",
    "inertial": "N m",
    "coriolis": "N m",
    "gravity": "N m",
}  # for revolute joints

MOST_JOINTS = 1000  # per topic or robot; humanoids with both hands have a hundred


@dataclass(frozen=True)
class MotionLog:
    """Motion of joints as recorded, at possibly irregular times."""

    name: str  # unique within its set
    joints: tuple[str, ...]  # (n,) names in the order of the columns
    stamps: np.ndarray  # (T,) int64 ns, increasing
    positions: np.ndarray  # (T, n) rad (m for prismatic joints)
    velocities: np.ndarray  # (T, n) rad/s
    # what is known of the origin; `origin` is `simulated` or `recorded`
    provenance: Mapping[str, str] = field(default_factory=dict, kw_only=True)

    def __post_init__(self) -> None:
        """Raise InputError, naming log and row: wrong shapes, stamps that do not increase, or NaN."""
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
    """A log with torques (T, n) in N m, positive if they accelerate the joint in its positive direction."""

    torques: np.ndarray


@dataclass(frozen=True)
class DriveLog(MotionLog):
    """A log of an arm without torque sensors; a drive's torque is a gain times its current."""

    currents: np.ndarray  # (T, n) A, measured
    desired_currents: np.ndarray  # (T, n) A, set by the controller
    target_torques: np.ndarray  # (T, n) N m, computed by the controller, not measured


@dataclass(frozen=True)
class PartedLog(JointLog):
    """A simulated log, with accelerations and the additive parts of the torques, (T, n) each."""

    accelerations: np.ndarray
    inertial: np.ndarray
    coriolis: np.ndarray  # including centrifugal torques
    gravity: np.ndarray


Log = TypeVar("Log", JointLog, DriveLog, PartedLog)


def signals_of(kind: type[MotionLog]) -> list[str]:
    """Names of the (T, n) signals of a kind of log."""
    return [one.name for one in fields(kind) if one.name in UNITS and one.name != "stamps"]


def write_log_table(logs: Sequence[MotionLog], target: str | Path) -> None:
    """Publish a set of logs as a Parquet table with the columns `stamps`, `positions.JOINT`, ..."""
    runs = []
    for log in logs:
        columns = {"stamps": log.stamps}
        for signal in signals_of(type(log)):
            columns |= columns_of(signal, getattr(log, signal), log.joints)
        about = {"joints": list(log.joints), "provenance": dict(log.provenance)}
        runs.append(Series(log.name, columns, about))
    write_series(runs, UNITS, target)


def read_log_table(
    path: str | Path,
    kind: type[Log] = JointLog,  # type: ignore[assignment]  # mypy binds no default to a type variable
) -> list[Log]:
    """Read a set of logs in the order of writing. Raises InputError: it is another kind."""
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


@dataclass(frozen=True)
class JointSeries:
    """Signals of joints that share a clock."""

    topic: str  # topic of publication
    names: tuple[str, ...]  # (J,) joint names; empty if messages have none
    publisher: int  # index within the topic
    stamps: np.ndarray  # (T,) int64 ns, increasing
    values: Mapping[Kind, np.ndarray]  # (T, J) per kind that is filled

    def streams(self) -> list[Stream]:
        """One stream per kind."""
        return [Stream(self.topic, kind, self.stamps, its, self.names) for kind, its in self.values.items()]

    def renamed(self, names: Mapping[str, str]) -> "JointSeries":
        """Series with other names for some joints, e.g. those of a URDF."""
        return replace(self, names=tuple(names.get(name, name) for name in self.names))

    def of_joints(self, names: Sequence[str]) -> "JointSeries | None":
        """Columns of some joints, in the given order; None if it has none of them."""
        mine = tuple(name for name in names if name in self.names)
        columns = [self.names.index(name) for name in mine]
        values = {kind: its.take(columns, axis=1) for kind, its in self.values.items()}
        return replace(self, names=mine, values=values) if mine else None


def joint_series(
    where: str, topic: str, messages: RawMessages, policy: StampPolicy
) -> tuple[list[JointSeries], str | None]:
    """Joint states of one topic, in order of first appearance, and how their stamps were corrected.

    A field that is all NaN counts as not filled, since drivers send NaN for signals they do not measure.
    Joints are in the order in which messages first name them.
    """
    groups = decoded(where, messages)
    tables: dict[Kind, tuple[np.ndarray, np.ndarray]] = {}
    with fields_named(where):
        stamps = sample_stamps(messages, groups, policy)
        orders = [tuple(group.message.name) for group in groups]
        joints = _joints(where, stamps, groups, orders)
        for kind in JOINT_KINDS:
            its = [sequence(getattr(group.message, FIELDS[kind])) for group in groups]
            filled = np.zeros(len(stamps), dtype=bool)
            for group, columns in zip(groups, its, strict=True):
                filled[group.rows] = len(columns) > 0
            tables[kind] = table(where, stamps, groups, its, orders, joints, kind), filled
    several = len(set(map(frozenset, orders))) > 1
    found, notes = [], []
    for publisher, names, rows in _clocks(groups, orders, joints):
        kept, note = in_order(
            f"{where}: joints {', '.join(names)}" if several else where, stamps[rows], policy
        )
        if note is not None:
            notes.append(f"{note} of {', '.join(names)}" if several else note)
        places = [joints.index(name) for name in names]
        values = {}
        for kind, (signal, filled) in tables.items():
            mine = signal[rows].take(places, axis=1) if names else signal
            if filled[rows].all() and not np.isnan(mine).all():
                values[kind] = mine if note is None else mine[kept]
        if values:
            found.append(JointSeries(topic, names, publisher, stamps[rows][kept], values))
    if not found:
        raise InputError(f"{where} has joint states without position, velocity and effort")
    return found, ", ".join(notes) or None


def chosen(
    where: str, series: Sequence[JointSeries], joints: Sequence[str] | None
) -> tuple[list[JointSeries], list[str]]:
    """Series of the requested joints, in that order, and the joints that are left out.

    Without a request, the joints are those of the publisher with the most (the first of several).
    """
    present = [name for one in series for name in one.names]
    if joints is None:
        sizes: dict[int, int] = {}
        for one in series:
            sizes[one.publisher] = sizes.get(one.publisher, 0) + len(one.names)
        largest = max(sizes, key=lambda publisher: sizes[publisher])
        kept = [one for one in series if one.publisher == largest]
    else:
        if missing := [name for name in joints if name not in present]:
            raise InputError(
                f"{where} has no joint {', '.join(missing)}; it has {', '.join(present) or 'none'}"
            )
        parts = (one.of_joints(joints) for one in series)
        kept = sorted((part for part in parts if part), key=lambda part: list(joints).index(part.names[0]))
    names = {name for one in kept for name in one.names}
    return kept, [name for name in present if name not in names]


def _joints(
    where: str, stamps: np.ndarray, groups: Sequence[Decoded], orders: Sequence[tuple[str, ...]]
) -> tuple[str, ...]:
    """All joints in order of first appearance; `orders`: joint names of each group of messages."""
    for group, names in zip(groups, orders, strict=True):
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(f"{where}: {at_row(int(group.rows[0]), stamps)} names joint '{twice}' twice")
    if any(orders) and () in orders:
        row = int(groups[orders.index(())].rows[0])
        raise InputError(f"{where}: {at_row(row, stamps)} names no joints, other messages do")
    joints = tuple(dict.fromkeys(name for names in orders for name in names))
    if len(joints) > MOST_JOINTS:
        raise InputError(f"{where} names {len(joints)} joints, more than {MOST_JOINTS}")
    return joints


def _clocks(
    groups: Sequence[Decoded], orders: Sequence[tuple[str, ...]], joints: Sequence[str]
) -> Iterator[tuple[int, tuple[str, ...], np.ndarray]]:
    """Joints that always occur together: publisher, names, and the messages (M,) that contain them."""
    rows: dict[frozenset[str], list[np.ndarray]] = {}
    for group, names in zip(groups, orders, strict=True):
        rows.setdefault(frozenset(names), []).append(group.rows)
    sets = list(rows)
    together: dict[tuple[int, ...], list[str]] = {}
    for name in joints:
        together.setdefault(tuple(n for n, its in enumerate(sets) if name in its), []).append(name)
    publishers = list(range(len(sets)))  # per set; sets with a common joint share one
    for has in together:
        one = {publishers[number] for number in has}
        publishers = [min(one) if publisher in one else publisher for publisher in publishers]
    for has, mine in together.items() or [((0,), [])]:
        found = [part for number in has for part in rows[sets[number]]]
        yield publishers[has[0]], tuple(mine), np.sort(np.concatenate(found))
