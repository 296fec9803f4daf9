"""Joint states of one topic, told apart by the names of the joints.

On `/joint_states` a robot, its gripper and its hand often publish side by side, each at its own pace, and a
message may have some of the joints only. Joints that always come together are one series with one clock.
Joints that ever come together, directly or through others, belong to one publisher.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from structlearn.core.errors import InputError
from structlearn.readers.bag import RawMessages
from structlearn.readers.cdr import (
    Decoded,
    decoded,
    fields_named,
    header_stamps,
    sample_stamps,
    sequence,
)
from structlearn.readers.checks import at_row
from structlearn.readers.clock import StampPolicy, in_order
from structlearn.readers.messages import FIELDS
from structlearn.readers.recording import JOINT_KINDS, Kind, Stream

MOST_JOINTS = 1000
"""Of a topic; humanoids with both hands have a hundred."""


@dataclass(frozen=True)
class JointSeries:
    """Signals of joints that share a clock."""

    topic: str  # where they were published
    names: tuple[str, ...]  # (J,) of the joints; or none, where messages name none
    publisher: int  # its number within the topic
    stamps: np.ndarray  # (T,) int64 ns, increasing
    values: Mapping[Kind, np.ndarray]  # (T, J) of each kind that is filled

    def streams(self) -> list[Stream]:
        """One for each kind."""
        return [Stream(self.topic, kind, self.stamps, its, self.names) for kind, its in self.values.items()]

    def of_joints(self, names: Sequence[str]) -> "JointSeries | None":
        """Columns of those of some joints that it has, in their order; None where it has none."""
        mine = [name for name in names if name in self.names]
        if not mine:
            return None
        columns = [self.names.index(name) for name in mine]
        values = {kind: its.take(columns, axis=1) for kind, its in self.values.items()}
        return replace(self, names=tuple(mine), values=values)


def joint_series(
    where: str, topic: str, messages: RawMessages, policy: StampPolicy
) -> tuple[list[JointSeries], str | None]:
    """Joint states of one topic, and what was done about their stamps, if anything.

    A field that is NaN throughout counts as not filled, since drivers put NaN for what they do not measure.

    Returns:
        The series, those that came first first, joints in the order in which a message first had them.

    Raises:
        InputError: a message cannot be decoded or lacks a field; messages of the same joints differ in their
            number of values, or have another number than of names; a joint is named twice in a message, or
            some messages name joints and some do not; nothing is filled; stamps of a series do not increase.
    """
    groups = decoded(where, messages)
    with fields_named(where):
        stamps = sample_stamps(messages.log_times, header_stamps(groups), policy)
        orders = [tuple(group.message.name) for group in groups]
        _check_names(where, stamps, groups, orders)
        joints = tuple(dict.fromkeys(name for names in orders for name in names))
        if len(joints) > MOST_JOINTS:
            raise InputError(f"{where} names {len(joints)} joints, more than {MOST_JOINTS}")
        tables = {kind: _table(where, stamps, groups, orders, joints, kind) for kind in JOINT_KINDS}
    several = len(set(map(frozenset, orders))) > 1
    found, notes = [], []
    for publisher, names, rows in _clocks(groups, orders, joints):
        whom = f"{where}: joints {', '.join(names)}" if several else where
        kept, note = in_order(whom, stamps[rows], policy)
        if note is not None:
            notes.append(f"{note} of {', '.join(names)}" if several else note)
        columns = [joints.index(name) for name in names]
        values = {}
        for kind, (table, filled) in tables.items():
            its = table[rows].take(columns, axis=1) if names else table
            if filled[rows].all() and not np.isnan(its).all():
                values[kind] = its if note is None else its[kept]
        if values:
            found.append(JointSeries(topic, names, publisher, stamps[rows][kept], values))
    if not found:
        raise InputError(f"{where} has joint states without position, velocity and effort")
    return found, ", ".join(notes) or None


def chosen(
    where: str, series: Sequence[JointSeries], joints: Sequence[str] | None
) -> tuple[list[JointSeries], list[str]]:
    """The series of the joints that are wanted, in their order, and the joints that are left out.

    Without names these are the joints of the publisher that has the most, of several the first. Raises
    InputError: a joint that is wanted is in none of them.
    """
    present = [name for one in series for name in one.names]
    if joints is None:
        sizes: dict[int, int] = {}
        for one in series:
            sizes[one.publisher] = sizes.get(one.publisher, 0) + len(one.names)
        largest = max(sizes, key=lambda publisher: sizes[publisher])
        kept = [one for one in series if one.publisher == largest]
    else:
        missing = [name for name in joints if name not in present]
        if missing:
            raise InputError(
                f"{where} has no joint {', '.join(missing)}; it has {', '.join(present) or 'none'}"
            )
        parts = (one.of_joints(joints) for one in series)
        kept = sorted((part for part in parts if part), key=lambda part: list(joints).index(part.names[0]))
    names = {name for one in kept for name in one.names}
    return kept, [name for name in present if name not in names]


def _check_names(
    where: str, stamps: np.ndarray, groups: Sequence[Decoded], orders: Sequence[tuple[str, ...]]
) -> None:
    for group, names in zip(groups, orders, strict=True):
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(f"{where}: {at_row(int(group.rows[0]), stamps)} names joint '{twice}' twice")
    if any(orders) and () in orders:
        row = int(groups[orders.index(())].rows[0])
        raise InputError(f"{where}: {at_row(row, stamps)} names no joints, other messages do")


def _table(
    where: str,
    stamps: np.ndarray,
    groups: Sequence[Decoded],
    orders: Sequence[tuple[str, ...]],
    joints: Sequence[str],
    kind: Kind,
) -> tuple[np.ndarray, np.ndarray]:
    """(T, J) of one field of all joints, NaN where a message lacks it, and (T,) whether it is filled."""
    fields = [sequence(getattr(group.message, FIELDS[kind])) for group in groups]
    table = np.full((len(stamps), len(joints) or len(fields[0])), np.nan)
    filled = np.zeros(len(stamps), dtype=bool)
    widths: dict[frozenset[str], int] = {}
    for group, names, columns in zip(groups, orders, fields, strict=True):
        width = widths.setdefault(frozenset(names), len(columns))
        if len(columns) != width:
            row = at_row(int(group.rows[0]), stamps)
            raise InputError(f"{where}: {row} has {len(columns)} values, the first has {width}")
        if names and width not in (0, len(names)):
            raise InputError(f"{where} names {len(names)} joints and has {width} {kind} per message")
        if width:
            places = np.array([joints.index(name) for name in names] or range(width))
            its = np.array(columns, dtype=float).reshape(width, len(group.rows)).T
            table[group.rows[:, None], places] = its
            filled[group.rows] = True
    return table, filled


def _clocks(
    groups: Sequence[Decoded], orders: Sequence[tuple[str, ...]], joints: Sequence[str]
) -> Iterator[tuple[int, tuple[str, ...], np.ndarray]]:
    """Joints that always come together: their publisher, their names, the messages (M,) that have them."""
    rows: dict[frozenset[str], list[np.ndarray]] = {}
    for group, names in zip(groups, orders, strict=True):
        rows.setdefault(frozenset(names), []).append(group.rows)
    sets = list(rows)
    together: dict[tuple[int, ...], list[str]] = {}
    for name in joints:
        together.setdefault(tuple(n for n, its in enumerate(sets) if name in its), []).append(name)
    publishers = list(range(len(sets)))  # of each set; sets with a joint in common have one
    for has in together:
        one = {publishers[number] for number in has}
        publishers = [min(one) if publisher in one else publisher for publisher in publishers]
    for has, mine in together.items() or [((0,), [])]:
        found = [part for number in has for part in rows[sets[number]]]
        yield publishers[has[0]], tuple(mine), np.sort(np.concatenate(found))
