"""Definitions of message types: those that we ship, and those of a bag, completed by ours."""

import re
from functools import cache
from pathlib import Path

from mcap.records import Schema
from mcap.well_known import SchemaEncoding

from structlearn.core.params import read_values

# Definition languages of schemas that ROS 2 writes; an early recorder wrote none
LANGUAGES = (SchemaEncoding.ROS2, "ros2idl", "")

_LINE, _HEAD = f"{'=' * 80}\n", re.compile(r"^=+\s*\nMSG:\s*(\S+)\s*$", re.MULTILINE)
_FIELD = re.compile(r"^\s*([A-Za-z]\w*(?:/\w+)*)(?:<=\d+)?(?:\[[^\]]*\])?\s+[a-z]\w*", re.MULTILINE)
_BUILT_IN = re.compile(r"u?int(8|16|32|64)|float(32|64)|bool|byte|char|w?string")


def short_name(message_type: str) -> str:
    """`package/Type`, from `package/msg/Type` or itself."""
    return message_type.replace("/msg/", "/")


def shipped() -> dict[str, str]:
    """Text of each type that we ship, by its short name, without those of nested types."""
    return read_values(Path(__file__).with_suffix(".yaml"))


@cache
def definition(message_type: str) -> str:
    """Message definition with those of all nested types, as in MCAP's encoding `ros2msg`."""
    return completed(message_type, "")


def definition_of(schema: Schema) -> str:
    """Definition of a bag's type; what it lacks (converters forget nested types) is ours.

    Raises LookupError: it lacks a type that we do not ship.
    """
    return completed(schema.name, schema.data.decode() if schema.encoding == SchemaEncoding.ROS2 else "")


def completed(message_type: str, text: str) -> str:
    """A definition, maybe empty, with those of all nested types. Raises LookupError: one is unknown."""
    first, *others = _HEAD.split(text)
    own, lacking = short_name(message_type), []
    texts = {short_name(name): nested for name, nested in zip(others[::2], others[1::2], strict=True)}
    texts = {own: first} | texts
    if not _FIELD.search(first):
        text, texts, lacking = "", {own: _ours(own, own)}, [own]
    names = list(texts)
    for name in names:  # grows while nested types are found
        for kind in dict.fromkeys(_FIELD.findall(texts[name])):
            nested = short_name(kind if "/" in kind else f"{name.partition('/')[0]}/{kind}")
            if kind == "Header" and nested not in texts:
                nested = "std_msgs/Header"
            if not _BUILT_IN.fullmatch(kind) and nested not in texts:
                texts[nested] = _ours(own, nested)
                names.append(nested)
                lacking.append(nested)
    if not lacking:
        return text
    parts = [] if not text else [text if text.endswith("\n") else f"{text}\n"]
    for name in lacking:
        parts.append(texts[name] if not parts else f"MSG: {name}\n{texts[name]}")
    return _LINE.join(parts)


def _ours(own: str, name: str) -> str:
    try:
        return shipped()[name]
    except KeyError:
        raise LookupError(f"the file's definition of {own} lacks {name}") from None
