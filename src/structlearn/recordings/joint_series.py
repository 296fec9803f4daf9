"""Joint states of one topic, told apart by the names of the joints.

On `/joint_states` a robot, its gripper and its hand often publish side by side, each at its own pace, and a
message may have some of the joints only. Joints that always come together are one series with one clock.
Joints that ever come together, directly or through others, belong to one publisher.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from structlearn.ground.errors import InputError
from structlearn.recordings.bag_reader import RawMessages, damage_named
from structlearn.recordings.checks import at_row
from structlearn.recordings.decoding import (
    decoded,
    fields_named,
    header_stamps,
    sample_stamps,
    sequence,
    table,
)
from structlearn.recordings.recording import JOINT_KINDS, Kind, Stream
from structlearn.recordings.stamps import StampPolicy, in_order

FIELDS: Mapping[Kind, str] = dict(zip(JOINT_KINDS, ("position", "velocity", "effort"), strict=True))
"""Field of a joint state that each kind of stream comes from."""


@dataclass(frozen=True)
class JointSeries:
    """Signals of joints that share a clock.

    Attributes:
        topic: where they were published.
        names: (J,) of the joints; or none, where messages name none.
        publisher: number of the publisher within the topic.
        stamps: (T,) int64 ns, increasing.
        values: (T, J) of each kind that is filled.
    """

    topic: str
    names: tuple[str, ...]
    publisher: int
    stamps: np.ndarray
    values: Mapping[Kind, np.ndarray]

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
    """Joint states of one topic.

    A field that is NaN throughout counts as not filled, since drivers put NaN for what they do not measure.

    Args:
        where: file and topic, for error messages.
        topic: its name.
        messages: its messages.
        policy: how stamps are taken.

    Returns:
        The series, those that came first first, joints in the order in which a message first had them; and
        what was done about their stamps, if anything.

    Raises:
        InputError: a message cannot be decoded or lacks a field; messages of the same joints differ in their
            number of values, or have another number than of names; a joint is named twice in a message, or
            some messages name joints and some do not; nothing is filled; stamps of a series do not increase.
    """
    with damage_named(where, "message"):
        groups = decoded(messages)
    with fields_named(where):
        stamps = sample_stamps(messages.log_times, header_stamps(groups), policy)
        sets = _by_names(where, stamps, groups)
    found, notes = [], []
    for publisher, names, members in _clocks(sets):
        rows = np.sort(np.concatenate([member.rows for member in members]))
        place = np.empty(len(stamps), dtype=int)
        place[rows] = np.arange(len(rows))
        values = {}
        for kind in JOINT_KINDS:
            if all(kind in member.values for member in members):
                whole = np.empty((len(rows), len(names) or members[0].values[kind].shape[1]))
                for member in members:
                    columns = [member.names.index(name) for name in names]
                    its = member.values[kind]
                    whole[place[member.rows]] = its.take(columns, axis=1) if names else its
                if not np.isnan(whole).all():
                    values[kind] = whole
        whom = f"{where}: joints {', '.join(names)}" if len(sets) > 1 else where
        kept, note = in_order(whom, stamps[rows], policy)
        if note is not None:
            notes.append(f"{note} of {', '.join(names)}" if len(sets) > 1 else note)
            values = {kind: whole[kept] for kind, whole in values.items()}
        if values:
            found.append(JointSeries(topic, names, publisher, stamps[rows][kept], values))
    if not found:
        raise InputError(f"{where} has joint states without position, velocity and effort")
    return found, ", ".join(notes) or None


def chosen(
    where: str, series: Sequence[JointSeries], joints: Sequence[str] | None
) -> tuple[list[JointSeries], list[str]]:
    """The series of the joints that are wanted.

    Args:
        where: of the series, for the message.
        series: with names.
        joints: names of those that are wanted; None: those of the publisher that has the most, of several the
            first.

    Returns:
        The series, in the order of the names; and the names of the joints that are left out.

    Raises:
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


@dataclass(frozen=True)
class _Members:
    """Messages of one set of joints: their rows, and (M, J) of each field that is not empty."""

    names: tuple[str, ...]
    rows: np.ndarray
    values: Mapping[Kind, np.ndarray]


def _by_names(where: str, stamps: np.ndarray, groups: Sequence) -> list[_Members]:
    """Messages put together by the set of their joints, whatever order they name them in."""
    orders: dict[frozenset[str], dict[tuple[str, ...], list]] = {}
    for group in groups:
        names = tuple(group.message.name)
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(f"{where}: {at_row(int(group.rows[0]), stamps)} names joint '{twice}' twice")
        orders.setdefault(frozenset(names), {}).setdefault(names, []).append(group)
    nameless = orders.get(frozenset())
    if nameless and len(orders) > 1:
        row = min(int(group.rows[0]) for group in nameless[()])
        raise InputError(f"{where}: {at_row(row, stamps)} names no joints, other messages do")
    return [_member(where, stamps, by_order) for by_order in orders.values()]


def _member(where: str, stamps: np.ndarray, by_order: Mapping[tuple[str, ...], list]) -> _Members:
    """Messages of one set of joints in the order of names of the first."""
    names = next(iter(by_order))
    ordered = [(order, group) for order, groups in by_order.items() for group in groups]
    ordered.sort(key=lambda pair: int(pair[1].rows[0]))
    rows = np.concatenate([group.rows for _, group in ordered])
    inverse = np.empty(len(stamps), dtype=int)
    inverse[np.sort(rows)] = np.arange(len(rows))
    values = {}
    for kind, field in FIELDS.items():
        parts = []
        for order, group in ordered:
            columns: Sequence | np.ndarray = sequence(getattr(group.message, field))
            if len(columns) == len(order) and order != names:
                columns = [columns[order.index(name)] for name in names]
            parts.append((inverse[group.rows], columns))
        whole = table(where, stamps[np.sort(rows)], parts)
        if names and whole.shape[1] not in (0, len(names)):
            raise InputError(f"{where} names {len(names)} joints and has {whole.shape[1]} {kind} per message")
        if whole.shape[1]:
            values[kind] = whole
    return _Members(names, np.sort(rows), values)


def _clocks(sets: Sequence[_Members]) -> list[tuple[int, tuple[str, ...], list[_Members]]]:
    """Joints that always come together: their publisher, their names, the messages that have them."""
    if not sets[0].names:
        return [(0, (), list(sets))]
    together: dict[tuple[int, ...], list[str]] = {}
    names = list(dict.fromkeys(name for members in sets for name in members.names))
    for name in names:
        has = tuple(number for number, members in enumerate(sets) if name in members.names)
        together.setdefault(has, []).append(name)
    publishers = list(range(len(sets)))  # of each set; sets with a joint in common have one
    for has in together:
        joined = {publishers[number] for number in has}
        publishers = [min(joined) if one in joined else one for one in publishers]
    return [
        (publishers[has[0]], tuple(names), [sets[number] for number in has])
        for has, names in together.items()
    ]
