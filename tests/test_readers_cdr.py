"""Columns of messages against the library's decoder, which takes one message at a time."""

from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer

from structlearn.readers import cdr

NUMBERS = {
    "float64": st.floats(allow_nan=False),
    "float32": st.floats(width=32, allow_nan=False),
    "int8": st.integers(-(2**7), 2**7 - 1),
    "uint8": st.integers(0, 2**8 - 1),
    "int16": st.integers(-(2**15), 2**15 - 1),
    "uint16": st.integers(0, 2**16 - 1),
    "int32": st.integers(-(2**31), 2**31 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    "int64": st.integers(-(2**63), 2**63 - 1),
    "uint64": st.integers(0, 2**64 - 1),
    "bool": st.booleans(),
}


def encoded(text, messages):
    """Bytes of each message of pkg/msg/Own, and what the library decodes."""
    file = BytesIO()
    writer = Writer(file)
    schema = writer.register_msgdef("pkg/msg/Own", text)
    for message in messages:
        writer.write_message("/topic", schema, message, 0)
    writer.finish()
    file.seek(0)
    rows = list(make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    return [row.message.data for row in rows], [row.decoded_message for row in rows]


def columns(text, data):
    table = np.frombuffer(b"".join(data), dtype=np.uint8).reshape(len(data), -1)
    fields, alike = cdr.columns("pkg/msg/Own", text, table) or (None, np.zeros(1))
    return fields if alike.all() else None


def assert_same(column, values):
    """A field of the columns against that of every message."""
    if isinstance(column, np.ndarray):
        expected = [list(value) if isinstance(value, bytes) else value for value in values]
        np.testing.assert_array_equal(column, np.array(expected).reshape(column.shape))
    elif isinstance(column, SimpleNamespace):
        for name, inner in vars(column).items():
            assert_same(inner, [getattr(value, name) for value in values])
    elif isinstance(column, list) and column and isinstance(column[0], SimpleNamespace):
        for place, inner in enumerate(column):
            assert_same(inner, [value[place] for value in values])
    else:
        assert [column] * len(values) == values


@st.composite
def definitions(draw, depth=2):
    """Text of a definition as lines and nested types, and a strategy of its messages, all of one layout."""
    lines, nested, fields = [], {}, {}
    kinds = [*NUMBERS, "string", *(["nested"] if depth else [])]
    for number, kind in enumerate(draw(st.lists(st.sampled_from(kinds), min_size=1, max_size=5))):
        many = draw(st.sampled_from(["", "[]", "[3]", "[<=4]"]))
        length = {"": None, "[3]": 3}.get(many, draw(st.integers(0, 4)))
        if kind == "nested":
            inner_lines, inner_nested, one = draw(definitions(depth - 1))
            kind = f"Inner{depth}{number}x{len(inner_nested)}{draw(st.integers(0, 9**6))}"
            nested |= inner_nested | {f"pkg/{kind}": inner_lines}
        elif kind == "string":
            one = st.just(draw(st.text(max_size=5).filter(lambda text: "\0" not in text)))
        else:
            one = NUMBERS[kind]
        lines += [f"{kind}{many} f{number}  # what it is", "# = a comment", f"int32 LIMIT_{number} = 3"]
        fields[f"f{number}"] = one if length is None else st.lists(one, min_size=length, max_size=length)
    return lines, nested, st.fixed_dictionaries(fields)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_columns_are_what_the_library_decodes(data):
    lines, nested, messages = data.draw(definitions())
    text = "\n".join(lines)
    text += "".join(f"\n{'=' * 80}\nMSG: {name}\n" + "\n".join(inner) for name, inner in nested.items())
    raw, decoded = encoded(text, data.draw(st.lists(messages, min_size=1, max_size=3)))
    fields = columns(text, raw)
    assert fields is not None
    assert_same(fields, decoded)


@pytest.mark.parametrize(
    "text", ["", "wstring name\n", "Unknown x\n", "float64 x[3]\n", "float64 x\nfloat64 y\n", "int32[] a\n"]
)
def test_definitions_and_encodings_that_are_rare_or_do_not_fit_have_no_columns(text):
    assert columns(text, [b"\0\1\0\0" + b"\xff" * 8]) is None
    assert columns(text, [b"\0\1"]) is None
    for encapsulation in (b"\0\0\0\0", b"\0\3\0\0", b"\0\7\0\0"):
        assert columns("float64 x\n", [encapsulation + bytes(8)]) is None
