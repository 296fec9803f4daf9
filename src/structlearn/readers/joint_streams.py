"""Joint states of a topic to streams, separated by the names of the joints.

On `/joint_states` a robot, its gripper and its hand often publish side by side, each at its own rate, and a
message may contain only some of the joints. Joints that always occur together are one series with one clock.
Joints that ever occur together, directly or through others, belong to one publisher.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from structlearn.core.errors import InputError
from structlearn.readers.clock import at_row, in_order
from structlearn.readers.decoded_messages import Decoded, decoded
from structlearn.readers.demonstration import JOINT_KINDS, Kind, Stream
from structlearn.readers.messages import FIELDS, fields_named, sample_stamps, sequence, table_of_numbers
from structlearn.readers.one_source import check_source
from structlearn.readers.raw_messages import RawMessages
from structlearn.readers.source import StampPolicy

MOST_JOINTS = 1000  # per topic or robot; humanoids with both hands have a hundred


@dataclass(frozen=True)
class JointSeries:
    """Signals of joints that share a clock."""

    topic: str  # topic of publication
    names: tuple[str, ...]  # (J,) joint names; empty if messages have none
    publisher: int  # index within the topic
    stamps: np.ndarray  # (T,) int64 ns, increasing
    values: Mapping[Kind, np.ndarray]  # (T, J) per kind that is filled

    def streams(self) -> list[Stream]:
        """One stream per kind, of the joints whose field is not NaN throughout."""
        streams = []
        for kind, values in self.values.items():
            names = self.names
            if names:
                measured = ~np.isnan(values).all(axis=0)
                names = tuple(name for name, is_measured in zip(names, measured, strict=True) if is_measured)
                values = values if measured.all() else values[:, measured]
            streams.append(Stream(self.topic, kind, self.stamps, values, names))
        return streams

    def renamed(self, names: Mapping[str, str]) -> "JointSeries":
        """Series with other names for some joints, e.g. those of a URDF."""
        return replace(self, names=tuple(names.get(name, name) for name in self.names))

    def of_joints(self, names: Sequence[str]) -> "JointSeries | None":
        """Columns of some joints, in the given order; None if it has none of them."""
        mine = tuple(name for name in names if name in self.names)
        columns = [self.names.index(name) for name in mine]
        values = {kind: signal.take(columns, axis=1) for kind, signal in self.values.items()}
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
            fields = [sequence(getattr(group.message, FIELDS[kind])) for group in groups]
            filled = np.zeros(len(stamps), dtype=bool)
            for group, columns in zip(groups, fields, strict=True):
                filled[group.rows] = len(columns) > 0
            tables[kind] = table_of_numbers(where, stamps, groups, fields, orders, joints, kind), filled
    several = len(set(map(frozenset, orders))) > 1
    series, notes = [], []
    for publisher, names, rows in _clocks(groups, orders, joints):
        channels = None if messages.channels is None else messages.channels[rows]
        places = [joints.index(name) for name in names]
        own = {
            kind: signal[rows].take(places, axis=1) if names else signal
            for kind, (signal, _) in tables.items()
        }
        for kind, mine in own.items():
            check_source(f"{where}: {FIELDS[kind]} of {', '.join(names)}", kind, stamps[rows], mine, channels)
        kept, note = in_order(
            f"{where}: joints {', '.join(names)}" if several else where, stamps[rows], policy
        )
        if note is not None:
            notes.append(f"{note} of {', '.join(names)}" if several else note)
        values = {
            kind: mine if note is None else mine[kept]
            for kind, mine in own.items()
            if tables[kind][1][rows].all() and not np.isnan(mine).all()
        }
        if values:
            series.append(JointSeries(topic, names, publisher, stamps[rows][kept], values))
    if not series:
        raise InputError(f"{where} has joint states without position, velocity and effort")
    return series, ", ".join(notes) or None


def chosen(
    where: str, series: Sequence[JointSeries], joints: Sequence[str] | None
) -> tuple[list[JointSeries], list[str]]:
    """Series of the requested joints, in that order, and the joints that are left out.

    Without a request, the joints are those of the publisher with the most (the first of several).
    """
    present = [name for part in series for name in part.names]
    if joints is None:
        sizes: dict[int, int] = {}
        for part in series:
            sizes[part.publisher] = sizes.get(part.publisher, 0) + len(part.names)
        largest = max(sizes, key=lambda publisher: sizes[publisher])
        kept = [part for part in series if part.publisher == largest]
    else:
        if missing := [name for name in joints if name not in present]:
            raise InputError(
                f"{where} has no joint {', '.join(missing)}; it has {', '.join(present) or 'none'}"
            )
        parts = (part.of_joints(joints) for part in series)
        kept = sorted((part for part in parts if part), key=lambda part: list(joints).index(part.names[0]))
    names = {name for part in kept for name in part.names}
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
        members = tuple(number for number, names in enumerate(sets) if name in names)
        together.setdefault(members, []).append(name)
    publishers = list(range(len(sets)))  # per set; sets with a common joint share one
    for has in together:
        shared = {publishers[number] for number in has}
        publishers = [min(shared) if publisher in shared else publisher for publisher in publishers]
    for has, mine in together.items() or [((0,), [])]:
        messages_of = [part for number in has for part in rows[sets[number]]]
        yield publishers[has[0]], tuple(mine), np.sort(np.concatenate(messages_of))
