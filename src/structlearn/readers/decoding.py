"""Raw messages of one topic, decoded: columns over as many messages as have one layout, the others singly.

Publishers that share a topic, and messages whose sequences grow, have layouts of their own: messages are put
together by definition, length and layout before their columns are looked for (`cdr.columns`).
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from mcap.records import Schema
from mcap.well_known import MessageEncoding

from structlearn.core.errors import InputError
from structlearn.readers import cdr
from structlearn.readers.bag import RawMessages, damage_named
from structlearn.readers.checks import at_row
from structlearn.readers.stamps import StampPolicy

MOST_LAYOUTS = 50
"""Layouts of one length that are looked for: frames of a robot have some, texts that change have no end."""


@dataclass(frozen=True)
class Decoded:
    """Messages of one layout.

    Attributes:
        rows: (M,) which of the topic's messages they are.
        message: with columns (M,) or (M, n) as its numbers; of a single one they may be numbers and lists.
    """

    rows: np.ndarray
    message: Any


def decoded(where: str, messages: RawMessages) -> list[Decoded]:
    """All messages of a topic, those with the first row first; an InputError where one is damaged."""
    lengths = np.fromiter(map(len, messages.data), dtype=np.int64, count=len(messages.data))
    layouts, owners = np.unique(np.stack([messages.kinds, lengths]), axis=1, return_inverse=True)
    groups: list[Decoded] = []
    with damage_named(where, "message"):
        for number, (kind, length) in enumerate(layouts.T.tolist()):
            rows = np.flatnonzero(owners.ravel() == number)
            raw = np.frombuffer(b"".join(messages.data[row] for row in rows.tolist()), dtype=np.uint8)
            schema = messages.schemas[kind]
            assert schema is not None  # `messages.check_readable` lets none pass
            groups += _of_one_length(schema, rows, raw.reshape(len(rows), length))
    return sorted(groups, key=lambda group: int(group.rows[0]))


def _of_one_length(schema: Schema, rows: np.ndarray, raw: np.ndarray) -> Iterator[Decoded]:
    """Messages of one type, (M, L) bytes: those of a layout together while there are few layouts."""
    text = schema.data.decode()
    for _ in range(MOST_LAYOUTS):
        found = cdr.columns(schema.name, text, raw)
        if found is None:
            break
        fields, alike = found
        if alike.all():
            yield Decoded(rows, fields)
            return
        yield from _of_one_length(schema, rows[alike], raw[alike])
        rows, raw = rows[~alike], raw[~alike]
    from mcap_ros2.decoder import DecoderFactory  # seldom needed

    decode = DecoderFactory().decoder_for(MessageEncoding.CDR, schema)
    assert decode is not None  # it is one of ROS 2, or there were no definition for `cdr`
    for row, message in zip(rows, raw, strict=True):
        yield Decoded(np.array([row]), decode(message.tobytes()))


@contextmanager
def fields_named(where: str) -> Iterator[None]:
    """Turn what is raised where a field is looked for in a message without it into an InputError."""
    try:
        yield
    except AttributeError as error:
        raise InputError(f"{where}: a message lacks a field of its type: {error}") from error


def header_stamps(groups: Sequence[Decoded]) -> np.ndarray:
    """(T,) ns of the headers of all messages of a topic, in their order."""
    stamps = np.empty(sum(len(group.rows) for group in groups), dtype=np.int64)
    for group in groups:
        stamps[group.rows] = nanoseconds(group.message.header.stamp)
    return stamps


def nanoseconds(clock: Any) -> np.ndarray:
    """int64 ns of a ROS time, which may be a column of them."""
    seconds, rest = np.array(clock.sec, dtype=np.int64), np.array(clock.nanosec, dtype=np.int64)
    return seconds * 10**9 + rest


def sample_stamps(log_times: np.ndarray, header: np.ndarray | None, policy: StampPolicy) -> np.ndarray:
    """(T,) int64 ns: header stamps where somebody set any and they are wanted, else log times."""
    if policy.clock == "log" or header is None or not header.any():
        return log_times
    return header


def table(
    where: str, stamps: np.ndarray, parts: Sequence[tuple[np.ndarray, Sequence | np.ndarray]]
) -> np.ndarray:
    """(T, D) float64 of what was read from groups of messages: their rows, and D columns or numbers.

    Raises:
        InputError: a message has another number of values than the first; its row is named.
    """
    width = len(parts[0][1])
    odd = [(int(rows[0]), len(values)) for rows, values in parts if len(values) != width]
    if odd:
        row, length = min(odd)
        raise InputError(f"{where}: {at_row(row, stamps)} has {length} values, the first has {width}")
    values = np.empty((sum(len(rows) for rows, _ in parts), width))
    for rows, columns in parts:
        values[rows] = np.array(columns, dtype=float).reshape(width, len(rows)).T
    return values


def sequence(field: Any) -> Sequence | np.ndarray:
    """A message's sequence of numbers, with columns (M, n) turned to n columns."""
    return field.T if isinstance(field, np.ndarray) else field
