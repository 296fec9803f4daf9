"""Raw messages of an MCAP file, ours or a robot's.

The library reads a file record by record and field by field, ten times as long as all that is done with the
numbers in its messages. Here a chunk's messages are found in one short loop and their heads are read at once;
all other records are the library's to read.
"""

import struct
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.reader import McapReader, NonSeekingReader, make_reader
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import get_chunk_data_stream
from mcap.summary import Summary
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import MCAP0_MAGIC
from numpy.lib.stride_tricks import sliding_window_view

from structlearn.ground.errors import InputError
from structlearn.recordings.bag_writer import MESSAGE_HEAD, METADATA, RECORD_PREFIX

_LENGTH = struct.Struct("<Q")


@dataclass(frozen=True)
class RawMessages:
    """Messages of one topic, in the order of their log times.

    Attributes:
        schemas: of each channel of the topic.
        channels: (T,) of each message.
        log_times: (T,) int64 ns.
        data: bytes of each message.
    """

    schemas: Mapping[int, Schema]
    channels: np.ndarray
    log_times: np.ndarray
    data: Sequence[bytes]


@dataclass(frozen=True)
class Bag:
    """What a file has.

    Attributes:
        topics: every topic with the types of its messages; what is not a ROS 2 message says so in its type.
        metadata: our own metadata record; None where the file is not ours.
        messages: of each topic that was asked for, unless there are none.
    """

    topics: Mapping[str, Sequence[str]]
    metadata: Mapping[str, str] | None
    messages: Mapping[str, RawMessages]


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
                present = _topics(file, reader)
                own = [record.metadata for record in reader.iter_metadata() if record.name == METADATA]
                pieces: dict[str, list[RawMessages]] = {topic: [] for topic in topics if topic in present}
                for topic, piece in _pieces(file, reader, topics):
                    pieces[topic].append(piece)
                messages = {topic: _joined(found) for topic, found in pieces.items() if found}
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
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


def _topics(file: BinaryIO, reader: McapReader) -> dict[str, list[str]]:
    """Topics of a file with the types of their messages."""
    summary = _index(reader)
    if summary is not None:
        pairs = [(channel, summary.schemas.get(channel.schema_id)) for channel in summary.channels.values()]
    else:
        pairs = [(channel, schema) for schema, channel, _ in _one_by_one(file)]
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


def _index(reader: McapReader) -> Summary | None:
    """The summary at the end of the file; None unless it has chunks, channels and schemas, each optional."""
    summary = reader.get_summary()
    if summary is None or not (summary.chunk_indexes and summary.channels):
        return None
    needed = {channel.schema_id for channel in summary.channels.values()} - {0}  # 0: without a schema
    return summary if needed <= summary.schemas.keys() else None


def _one_by_one(file: BinaryIO) -> Iterator[tuple[Schema | None, Channel, Message]]:
    """All messages in the order of the file, by the library."""
    file.seek(0)
    return NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False)


def _pieces(file: BinaryIO, reader: McapReader, topics: Collection[str]) -> Iterator[tuple[str, RawMessages]]:
    """Messages of the topics as the file has them, chunk by chunk, each piece with its topic."""
    summary = _index(reader)
    if summary is None:
        for schema, channel, message in _one_by_one(file):
            if channel.topic not in topics:
                continue
            number, time = np.array([channel.id]), np.array([message.log_time], dtype=np.uint64)
            yield channel.topic, RawMessages({channel.id: schema}, number, time, [message.data])
        return
    channels = {number: channel for number, channel in summary.channels.items() if channel.topic in topics}
    for index in summary.chunk_indexes:
        if index.message_index_offsets and channels.keys().isdisjoint(index.message_index_offsets):
            continue
        file.seek(index.chunk_start_offset + RECORD_PREFIX.size)
        stream, size = get_chunk_data_stream(Chunk.read(ReadDataStream(file)), validate_crc=True)
        chunk = stream.read(size)
        starts = _message_places(chunk)
        if not len(starts):
            continue
        windows = sliding_window_view(np.frombuffer(chunk, dtype=np.uint8), MESSAGE_HEAD.itemsize)
        heads = windows[starts].view(MESSAGE_HEAD)[:, 0]
        ends = starts + RECORD_PREFIX.size + heads["length"].astype(int)
        for topic in dict.fromkeys(channel.topic for channel in channels.values()):
            schemas = {
                number: summary.schemas.get(channel.schema_id)
                for number, channel in channels.items()
                if channel.topic == topic
            }
            mine = np.flatnonzero(np.isin(heads["channel"], list(schemas)))
            if len(mine):
                begins = starts[mine] + MESSAGE_HEAD.itemsize
                places = zip(begins.tolist(), ends[mine].tolist(), strict=True)
                data = [chunk[begin:end] for begin, end in places]
                yield topic, RawMessages(schemas, heads["channel"][mine], heads["log_time"][mine], data)


def _message_places(chunk: bytes) -> np.ndarray:
    """Where the records of messages begin in a chunk."""
    places, place, message = [], 0, int(Opcode.MESSAGE)  # an enumeration's own comparison is slow
    while place < len(chunk):
        if chunk[place] == message:
            places.append(place)
        place += RECORD_PREFIX.size + _LENGTH.unpack_from(chunk, place + 1)[0]
    if place > len(chunk):
        raise EndOfFile
    return np.array(places, dtype=int)


def _joined(pieces: Sequence[RawMessages]) -> RawMessages:
    """Pieces of one topic in the order of the file, put in the order of their log times."""
    schemas = {number: schema for piece in pieces for number, schema in piece.schemas.items()}
    channels = np.concatenate([piece.channels for piece in pieces])
    log_times = np.concatenate([piece.log_times for piece in pieces])
    data = [message for piece in pieces for message in piece.data]
    if log_times.max() >= 2**63:
        raise OverflowError("a log time is beyond 2^63 ns")
    if (log_times[1:] < log_times[:-1]).any():
        order = np.argsort(log_times, kind="stable")
        channels, log_times = channels[order], log_times[order]
        data = [data[place] for place in order.tolist()]
    return RawMessages(schemas, channels, log_times.astype(np.int64), data)
