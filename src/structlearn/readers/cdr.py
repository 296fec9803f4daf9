"""Columns of a topic's messages, seen in their raw bytes (CDR, the encoding of ROS 2).

Messages of one topic mostly have one layout: a field stands at the same place in each of them, and numpy
reads or writes it in all of them at once, a hundred times faster than message by message. The layout is
followed along the first message with the topic's own definition, and the others must agree with it in every
byte that shapes it. Where they do not, or where the definition has something rare, there are no columns, and
the messages have to be decoded one by one.
"""

import re
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np

LITTLE_ENDIAN = 1
"""Second byte of a message in plain little-endian CDR, which x86 and ARM robots send."""

SCALARS = {
    f"{sign}int{bits}": np.dtype(f"{sign}int{bits}").newbyteorder("<")
    for sign in ("", "u")
    for bits in (8, 16, 32, 64)
}
SCALARS |= {name: np.dtype(name).newbyteorder("<") for name in ("bool", "float32", "float64")}
SCALARS |= {"byte": SCALARS["uint8"], "char": SCALARS["int8"]}

_FIELD = re.compile(r"(?P<type>[\w/]+)(<=\d+)?(?P<many>\[(<=)?(?P<size>\d*)\])?\s+(?P<name>[a-z]\w*)(\s.*)?")
_CONSTANT = re.compile(r"\S+\s+[A-Z]\w*\s*=")


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
