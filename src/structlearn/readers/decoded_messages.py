"""Decoding of a topic's messages from CDR, the encoding of ROS 2.

Most messages of a topic have one layout: a field has the same offset in each of them, so that numpy reads or
writes it in all of them at once, a hundred times faster than message by message. The layout is derived from
the first message by the topic's own definition, and others must agree with it in every byte that determines
it. Publishers that share a topic, and messages with growing sequences, have their own layouts. Definitions
with rare constructs, and topics with too many layouts, are decoded message by message.
"""

import re
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from mcap.records import Schema
from mcap.well_known import MessageEncoding, SchemaEncoding

from structlearn.core.errors import InputError
from structlearn.readers.definitions import definition_of, short_name
from structlearn.readers.raw_messages import RawMessages, damage_named

MOST_LAYOUTS = 50  # per message length: a robot's frames need several, varying texts any number
LITTLE_ENDIAN = 1  # second byte of a message in plain little-endian CDR, sent by x86 and ARM robots

SCALARS = {
    name: np.dtype(name).newbyteorder("<")
    for name in (
        *(f"{sign}int{8 * size}" for sign in ("", "u") for size in (1, 2, 4, 8)),
        "float32",
        "float64",
    )
}
SCALARS |= {"bool": np.dtype(bool), "byte": SCALARS["uint8"], "char": SCALARS["int8"]}

_FIELD = re.compile(
    r"(?P<type>[\w/]+)(<=\d+)?(?P<many>\[(<=)?(?P<size>(?!0)\d*)\])?\s+(?P<name>[a-z]\w*)(\s.*)?"
)
_CONSTANT = re.compile(r"\S+\s+[A-Z]\w*\s*=")


class Decoded(NamedTuple):
    """Messages of one layout: their rows among the topic's, and all of them as one message.

    Its numbers are columns (M,) or (M, n); for a single message they may be scalars and lists.
    """

    rows: np.ndarray
    message: Any


def decoded(where: str, messages: RawMessages) -> list[Decoded]:
    """All messages of a topic in groups, ordered by their first row.

    Raises InputError: a message is damaged, or its definition lacks a type.
    """
    schemas = {id(schema): schema for schema in messages.schemas}
    try:
        whole = {key: _completed(schema) for key, schema in schemas.items() if schema}
    except LookupError as error:
        raise InputError(f"{where}: {error.args[0]}") from error
    keys = [np.fromiter(map(id, messages.schemas), np.int64), np.fromiter(map(len, messages.data), np.int64)]
    layouts, owners = np.unique(np.stack(keys), axis=1, return_inverse=True)
    groups: list[Decoded] = []
    with damage_named(where, "message"):
        for number, (kind, length) in enumerate(layouts.T.tolist()):
            rows = np.flatnonzero(owners.ravel() == number)
            raw = np.frombuffer(b"".join(messages.data[row] for row in rows.tolist()), dtype=np.uint8)
            groups += _of_one_length(whole[kind], rows, raw.reshape(len(rows), length))
    return sorted(groups, key=lambda group: int(group.rows[0]))


def _completed(schema: Schema) -> Schema:
    text = definition_of(schema).encode()
    return Schema(id=schema.id, name=schema.name, encoding=SchemaEncoding.ROS2, data=text)


def _of_one_length(schema: Schema, rows: np.ndarray, raw: np.ndarray) -> Iterator[Decoded]:
    """Decode messages (M, L) of one type: grouped by layout while there are few."""
    text = schema.data.decode()
    for _ in range(MOST_LAYOUTS):
        layout = columns(schema.name, text, raw)
        if layout is None:
            break
        fields, alike = layout
        if alike.all():
            yield Decoded(rows, fields)
            return
        yield from _of_one_length(schema, rows[alike], raw[alike])
        rows, raw = rows[~alike], raw[~alike]
    from mcap_ros2.decoder import DecoderFactory  # rarely needed

    decode = DecoderFactory().decoder_for(MessageEncoding.CDR, schema)
    assert decode is not None  # a ROS 2 schema, see `bag_recording.readable`
    for row, message in zip(rows, raw, strict=True):
        yield Decoded(np.array([row]), decode(message.tobytes()))


def columns(
    message_type: str, definition: str, messages: np.ndarray
) -> tuple[SimpleNamespace, np.ndarray] | None:
    """Views of all fields of messages (T, L) uint8, C-contiguous, by the layout of the first one.

    The definition is the text of the type with those of all nested types, as in the encoding `ros2msg`.
    Fields are nested as in the definition: numbers as (T,), sequences of numbers as (T, n) views of the
    bytes, so that writing to them changes the messages; strings and lists of strings are those of the first
    message. Also returns a mask (T,) of the messages with that layout; others differ in a length or a string,
    and their fields are meaningless. None if the first message is big-endian, or its definition has anything
    but numbers, strings, sequences and nested types.
    """
    if messages.shape[1] < 4 or messages[0, 1] != LITTLE_ENDIAN:
        return None
    layout = _Layout(messages)
    try:
        fields = layout.message(_definitions(message_type, definition), short_name(message_type))
    except (LookupError, ValueError):  # undefined type; unexpected line, text or end of message
        return None
    return fields, (messages[:, layout.shaping] == messages[0, layout.shaping]).all(axis=1)


class _Layout:
    """Parses the first message field by field; `shaping` marks the bytes that determine the layout."""

    def __init__(self, messages: np.ndarray):
        self._messages = messages
        self._at = 4  # after the encapsulation header, where alignment starts
        self.shaping = np.zeros(messages.shape[1], dtype=bool)
        self.shaping[1] = True

    def message(self, definitions: dict[str, list[re.Match]], message_type: str) -> SimpleNamespace:
        """Fields of a message that starts here."""
        package = message_type.partition("/")[0]
        fields = definitions[message_type]
        values = {field["name"]: self._field(definitions, package, field) for field in fields}
        return SimpleNamespace(**values)

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
        return text[:-1].decode()  # null-terminated

    def _bytes(self, count: int) -> np.ndarray:
        self._at += count
        if self._at > self._messages.shape[1]:
            raise ValueError("the message ends before its last field")
        return self._messages[:, self._at - count : self._at]


def _definitions(message_type: str, definition: str) -> dict[str, list[re.Match]]:
    """Fields of each type by its name. Raises ValueError: a line is not a field."""
    definitions: dict[str, list[re.Match]] = {short_name(message_type): []}
    for line in (line.partition("#")[0].strip() for line in definition.splitlines()):
        if line.startswith("MSG:"):
            definitions[line.removeprefix("MSG:").strip()] = []
        elif line and line.strip("=") and not _CONSTANT.match(line):
            field = _FIELD.fullmatch(line)
            if field is None:
                raise ValueError(f"not a field: {line}")
            definitions[next(reversed(definitions))].append(field)
    if not all(definitions.values()):
        raise ValueError("a message without fields has a byte that is not in its definition")
    return definitions
