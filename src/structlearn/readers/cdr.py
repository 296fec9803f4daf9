"""Messages of one topic, decoded from CDR, the encoding of ROS 2.

Messages of one topic mostly have one layout: a field stands at the same place in each of them, and numpy
reads or writes it in all of them at once, a hundred times faster than message by message. The layout is
followed along the first message with the topic's own definition, and the others must agree with it in every
byte that shapes it. Publishers that share a topic, and messages whose sequences grow, have layouts of their
own. Where a definition has something rare, or layouts have no end, messages are decoded one by one.
"""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from mcap.records import Schema
from mcap.well_known import MessageEncoding

from structlearn.core.errors import InputError
from structlearn.readers.bag import RawMessages, damage_named
from structlearn.readers.clock import StampPolicy
from structlearn.readers.recording import at_row

MOST_LAYOUTS = 50
"""Layouts of one length that are looked for: frames of a robot have some, texts that change have no end."""


LITTLE_ENDIAN = 1
"""Second byte of a message in plain little-endian CDR, which x86 and ARM robots send."""

SCALARS = {
    f"{sign}int{bits}": np.dtype(f"{sign}int{bits}").newbyteorder("<")
    for sign in ("", "u")
    for bits in (8, 16, 32, 64)
}
SCALARS |= {name: np.dtype(name).newbyteorder("<") for name in ("bool", "float32", "float64")}
SCALARS |= {"byte": SCALARS["uint8"], "char": SCALARS["int8"]}

_FIELD = re.compile(
    r"(?P<type>[\w/]+)(<=\d+)?(?P<many>\[(<=)?(?P<size>(?!0)\d*)\])?\s+(?P<name>[a-z]\w*)(\s.*)?"
)
_CONSTANT = re.compile(r"\S+\s+[A-Z]\w*\s*=")


@dataclass(frozen=True)
class Decoded:
    """Messages of one layout."""

    rows: np.ndarray  # (M,) which of the topic's messages they are
    message: Any  # with columns (M,) or (M, n) as its numbers; of a single one they may be numbers and lists


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
        found = columns(schema.name, text, raw)
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

    Raises InputError: a message has another number of values than the first; its row is named.
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


def short_name(message_type: str) -> str:
    """`package/Type` of `package/msg/Type` or of itself."""
    return message_type.replace("/msg/", "/")


def columns(
    message_type: str, definition: str, messages: np.ndarray
) -> tuple[SimpleNamespace, np.ndarray] | None:
    """Views of all fields of messages (T, L) uint8, in C order, by the layout of the first one.

    The definition is the text of the type with those of all nested types, as in the encoding `ros2msg`.

    Returns:
        Fields under their names, nested as in the definition: numbers as (T,), sequences of numbers as (T, n)
        views of the bytes, so that to write them is to write the messages; a string, or list of strings, is
        that of the first message. And which messages (T,) have that layout: the others differ in a length or
        a string, and their fields mean nothing. None where the first message is big-endian, or its definition
        has something else than numbers, strings, sequences and nested types.
    """
    if messages.shape[1] < 4 or messages[0, 1] != LITTLE_ENDIAN:
        return None
    layout = _Layout(messages)
    try:
        fields = layout.message(dict(_definitions(message_type, definition)), short_name(message_type))
    except (LookupError, ValueError):  # a type that is not defined; a line, text or end that is not expected
        return None
    return fields, (messages[:, layout.shaping] == messages[0, layout.shaping]).all(axis=1)


class _Layout:
    """Follows the first message field by field; `shaping` marks the bytes that the layout depends on."""

    def __init__(self, messages: np.ndarray):
        self._messages = messages
        self._at = 4  # behind the encapsulation header, from where places are aligned
        self.shaping = np.zeros(messages.shape[1], dtype=bool)
        self.shaping[1] = True

    def message(self, definitions: dict[str, list[re.Match]], message_type: str) -> SimpleNamespace:
        """The fields of a message that begins here."""
        fields = definitions[message_type]
        package = message_type.partition("/")[0]
        return SimpleNamespace(
            **{field["name"]: self._field(definitions, package, field) for field in fields}
        )

    def _field(self, definitions: dict[str, list[re.Match]], package: str, field: re.Match) -> Any:
        kind, count = field["type"], 1
        if field["many"]:
            count = int(field["size"]) if field["size"] and "<" not in field["many"] else self._length()
        if kind in SCALARS:
            numbers = self._numbers(SCALARS[kind], count)
            return numbers if field["many"] else numbers[:, 0]
        if kind == "string":
            values: list[Any] = [self._string() for _ in range(count)]
        else:
            name = kind if "/" in kind else f"{package}/{kind}"
            values = [self.message(definitions, name) for _ in range(count)]
        return values if field["many"] else values[0]

    def _numbers(self, dtype: np.dtype, count: int) -> np.ndarray:
        if count:  # an empty sequence is not aligned
            self._at += -(self._at - 4) % dtype.itemsize
        return self._bytes(count * dtype.itemsize).view(dtype)

    def _length(self) -> int:
        length = self._numbers(SCALARS["uint32"], 1)
        self.shaping[self._at - 4 : self._at] = True
        return int(length[0, 0])

    def _string(self) -> str:
        length = self._length()
        text = self._bytes(length)[0].tobytes()
        self.shaping[self._at - length : self._at] = True
        return text[:-1].decode()  # behind a null

    def _bytes(self, count: int) -> np.ndarray:
        self._at += count
        if self._at > self._messages.shape[1]:
            raise ValueError("the message ends before its last field")
        return self._messages[:, self._at - count : self._at]


def _definitions(message_type: str, definition: str) -> Iterator[tuple[str, list[re.Match]]]:
    """Fields of each type."""
    fields: list[re.Match] = []
    for line in [*(line.partition("#")[0].strip() for line in definition.splitlines()), "MSG:"]:
        if line.startswith("MSG:"):
            if not fields:
                raise ValueError("a message without fields has a byte that no line tells of")
            yield short_name(message_type), fields
            message_type, fields = line.removeprefix("MSG:").strip(), []
        elif line and line.strip("=") and not _CONSTANT.match(line):
            field = _FIELD.fullmatch(line)
            if field is None:
                raise ValueError(f"not a field: {line}")
            fields.append(field)
