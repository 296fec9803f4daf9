"""Raw messages of an MCAP file, ours or a robot's.

The library reads a file record by record and field by field, ten times as long as all that is done with the
numbers in its messages. Here the messages of a chunk are walked in one loop; all other records are the
library's to read.
"""

import struct
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.reader import McapReader, make_reader
from mcap.records import Chunk, Schema
from mcap.stream_reader import get_chunk_data_stream
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import MCAP0_MAGIC

from structlearn.ground.errors import InputError
from structlearn.recordings.bag_writer import METADATA

_PREFIX = 9  # bytes of a record's opcode and length
_HEAD = 31  # bytes of a message's record before the message
_LENGTH = struct.Struct("<Q")
_LOGGED = struct.Struct("<QHIQ")  # length, channel, sequence, log time of a message's record

RawMessage = tuple[Schema, int, bytes]
"""Schema, log time in ns and bytes of a message."""


@dataclass(frozen=True)
class Bag:
    """What a file has.

    Attributes:
        topics: every topic with the types of its messages; what is not a ROS 2 message says so in its type.
        metadata: our own metadata record; None where the file is not ours.
        messages: of the topics asked for that the file has, in the order of their log times.
    """

    topics: Mapping[str, Sequence[str]]
    metadata: Mapping[str, str] | None
    messages: Mapping[str, Sequence[RawMessage]]


def read_bag(path: Path, topics: Collection[str]) -> Bag:
    """Read an MCAP file.

    Args:
        path: the file, as `ros2 bag record -s mcap` or `write_bag` leaves it.
        topics: whose messages are wanted.

    Raises:
        InputError: the file is missing, not an MCAP file, cut off or damaged; the message names it.
    """
    try:
        with open(path, "rb") as file:
            _check_complete(path, file)
            with damage_named(path):
                reader = make_reader(file, validate_crcs=True)
                present = _topics(reader)
                own = [record.metadata for record in reader.iter_metadata() if record.name == METADATA]
                messages: dict[str, list[RawMessage]] = {topic: [] for topic in topics if topic in present}
                for topic, message in _messages(file, reader, messages):
                    messages[topic].append(message)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    for found in messages.values():
        found.sort(key=lambda message: message[1])
    return Bag(present, own[0] if own else None, messages)


@contextmanager
def damage_named(where: str | Path) -> Iterator[None]:
    """Turn whatever is raised on damaged bytes into an InputError; only what reads them goes inside."""
    try:
        yield
    except Exception as error:
        raise InputError(f"{where}: damaged MCAP file: {type(error).__name__}: {error}") from error


def _check_complete(path: Path, file: BinaryIO) -> None:
    """A complete MCAP file starts and ends with the magic bytes; a killed recorder leaves no end."""
    size = len(MCAP0_MAGIC)
    if file.read(size) != MCAP0_MAGIC:
        raise InputError(f"{path}: not an MCAP file")
    file.seek(max(size, path.stat().st_size - size))
    if file.read() != MCAP0_MAGIC:
        raise InputError(f"{path}: the MCAP file is cut off at its end; `mcap recover` saves what is there")
    file.seek(0)


def _topics(reader: McapReader) -> dict[str, list[str]]:
    """Topics of a file with the types of their messages."""
    summary = reader.get_summary()
    if summary is not None and summary.channels:
        pairs = [(channel, summary.schemas.get(channel.schema_id)) for channel in summary.channels.values()]
    else:  # the index at the end of the file is optional
        pairs = [(channel, schema) for schema, channel, _ in reader.iter_messages(log_time_order=False)]
    present: dict[str, list[str]] = {}
    for channel, schema in pairs:
        name = schema.name if schema is not None else "unknown"
        if channel.message_encoding != MessageEncoding.CDR or (
            schema and schema.encoding != SchemaEncoding.ROS2
        ):
            encodings = f"{channel.message_encoding}, {schema.encoding if schema else 'no schema'}"
            name = f"{name} [{encodings}: not ROS 2 messages with ros2msg definitions]"
        types = present.setdefault(channel.topic, [])
        if name not in types:
            types.append(name)
    return present


def _messages(
    file: BinaryIO, reader: McapReader, topics: Collection[str]
) -> Iterator[tuple[str, RawMessage]]:
    """Messages of the topics, each with its topic, in the order of the file."""
    summary = reader.get_summary()
    if summary is None or not summary.chunk_indexes:
        for schema, channel, message in reader.iter_messages(topics, log_time_order=False):
            yield channel.topic, (schema, message.log_time, message.data)
        return
    channels = {
        number: (channel.topic, summary.schemas.get(channel.schema_id)) if channel.topic in topics else None
        for number, channel in summary.channels.items()
    }
    wanted = {number for number, channel in channels.items() if channel}
    for index in summary.chunk_indexes:
        if index.message_index_offsets and wanted.isdisjoint(index.message_index_offsets):
            continue
        file.seek(index.chunk_start_offset + _PREFIX)
        stream, size = get_chunk_data_stream(Chunk.read(ReadDataStream(file)), validate_crc=True)
        chunk, place = stream.read(size), 0
        while place < size:
            if chunk[place] == Opcode.MESSAGE:
                length, number, _, log_time = _LOGGED.unpack_from(chunk, place + 1)
                start, place = place + _HEAD, place + _PREFIX + length
                if channel := channels[number]:
                    topic, schema = channel
                    yield topic, (schema, log_time, chunk[start:place])
            else:
                place += _PREFIX + _LENGTH.unpack_from(chunk, place + 1)[0]
        if place > size:
            raise EndOfFile
