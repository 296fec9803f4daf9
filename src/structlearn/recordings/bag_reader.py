"""Raw messages of an MCAP file, ours or a robot's.

The library reads a file record by record and field by field, ten times as long as all that is done with the
numbers in its messages, and checks little of what a file says of itself. Here the file's records are found in
one short loop, heads of messages are read at once, and every checksum and count that is there must be right:
of chunks, data and summary, and how many messages a topic has. The library reads the other records.
"""

import json
import mmap
import os
import tempfile
import zlib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    Metadata,
    Schema,
    Statistics,
)
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import MCAP0_MAGIC
from numpy.lib.stride_tricks import sliding_window_view

from structlearn.ground.errors import InputError
from structlearn.recordings.bag_writer import MESSAGE_HEAD, METADATA, RECORD_PREFIX

LARGEST_CHUNK = 2**28
"""Bytes of a chunk when it is unpacked; writers begin a new one after a few million."""

COMPRESSED = ".zstd"
"""End of the name of a file that is compressed as a whole."""

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""How a zstd frame begins."""

Buffer = bytes | mmap.mmap
RecordType = TypeVar("RecordType", bound=McapRecord)


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
        path: the file, as `ros2 bag record -s mcap` or `write_bag` leaves it; one that is compressed as a
            whole has `COMPRESSED` at its end.
        topics: whose messages are wanted.

    Raises:
        InputError: the file is missing, not an MCAP file, cut off or damaged; the message names it.
    """
    try:
        with open(path, "rb") as raw, uncompressed(path, raw) as file:
            _check_complete(path, file)
            with damage_named(path), mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
                return _read(content, topics)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error


@contextmanager
def uncompressed(path: Path, file: BinaryIO) -> Iterator[BinaryIO]:
    """What is in a file, or where it is compressed as a whole a file without a name that has it."""
    if path.suffix != COMPRESSED:
        yield file
        return
    with tempfile.TemporaryFile() as plain:
        unpack_file(path, file, plain)
        yield plain


def unpack_file(path: Path, file: BinaryIO, plain: BinaryIO) -> None:
    """Unpack a file that is one zstd frame, as `ros2 bag` leaves it.

    Raises:
        InputError: the frame is damaged or cut off.
    """
    unpacker = zstandard.ZstdDecompressor().decompressobj()
    try:
        while not unpacker.eof and (block := file.read(2**20)):
            plain.write(unpacker.decompress(block))
    except zstandard.ZstdError as error:
        raise InputError(f"{path}: damaged zstd file: {error}") from error
    if not unpacker.eof:
        raise InputError(f"{path}: the zstd file is cut off at its end")
    plain.flush()
    plain.seek(0)


def unpacked_messages(where: str, messages: RawMessages) -> RawMessages:
    """Messages that were compressed one by one, as `ros2 bag record --compression-mode message` does it.

    Each is a zstd frame then. No message begins like such a frame: its first byte is 0.

    Raises:
        InputError: a frame is damaged, or grows beyond `LARGEST_CHUNK`.
    """
    if not any(message.startswith(ZSTD_MAGIC) for message in messages.data):
        return messages
    unpacker = zstandard.ZstdDecompressor()
    data = []
    for row, message in enumerate(messages.data):
        if message.startswith(ZSTD_MAGIC):
            try:
                if zstandard.frame_content_size(message) > LARGEST_CHUNK:
                    raise zstandard.ZstdError(f"it grows beyond {LARGEST_CHUNK} bytes")
                message = unpacker.decompress(message, max_output_size=LARGEST_CHUNK)
            except (zstandard.ZstdError, MemoryError) as error:
                raise InputError(f"{where}: row {row}: damaged compressed message: {error}") from error
        data.append(message)
    return replace(messages, data=data)


def joined(bags: Sequence[Bag]) -> Bag:
    """The parts of one bag that is split over several files; the origin is what the first says that does."""
    if len(bags) == 1:
        return bags[0]
    topics: dict[str, list[str]] = {}
    for bag in bags:
        for topic, types in bag.topics.items():
            its = topics.setdefault(topic, [])
            its += [name for name in types if name not in its]
    parts: dict[str, list[RawMessages]] = {}
    for bag in bags:
        for topic, messages in bag.messages.items():
            parts.setdefault(topic, []).append(messages)
    metadata = next((bag.metadata for bag in bags if bag.metadata is not None), None)
    return Bag(topics, metadata, {topic: _behind_each_other(its) for topic, its in parts.items()})


def _behind_each_other(parts: Sequence[RawMessages]) -> RawMessages:
    """Messages of one topic in several files, in the order of their log times; channels get new numbers."""
    schemas: dict[int, Schema] = {}
    channels: list[np.ndarray] = []
    places: list[bytes] = []
    for part in parts:
        numbers = {number: len(schemas) + place for place, number in enumerate(part.schemas)}
        schemas |= {numbers[number]: schema for number, schema in part.schemas.items()}
        channels.append(np.array([numbers[number] for number in part.channels.tolist()]))
        places += part.data
    log_times = np.concatenate([part.log_times for part in parts])
    order = np.argsort(log_times, kind="stable")
    data = [places[place] for place in order.tolist()]
    return RawMessages(schemas, np.concatenate(channels)[order], log_times[order], data)


def own_provenance(bag: Bag, path: Path) -> dict[str, str]:
    """What our own metadata say of the origin; a file without them was recorded.

    Raises:
        InputError: it is not a mapping of words to words.
    """
    if bag.metadata is None:
        return {"origin": "recorded", "source": path.name}
    with damage_named(path):
        provenance = json.loads(bag.metadata["provenance"])
        if not isinstance(provenance, dict) or not all(isinstance(word, str) for word in provenance.values()):
            raise _Damage("its provenance is not a mapping of words to words")
    return provenance


class _Damage(Exception):  # noqa: N818 - it is what is found
    """What a file says of itself is not so."""


@contextmanager
def damage_named(where: str | Path, what: str = "MCAP file") -> Iterator[None]:
    """Turn whatever is raised on damaged bytes into an InputError; only what reads them goes inside."""
    try:
        yield
    except _Damage as error:
        raise InputError(f"{where}: damaged {what}: {error}") from error
    except Exception as error:
        raise InputError(f"{where}: damaged {what}: {type(error).__name__}: {error}") from error


def _check_complete(path: Path, file: BinaryIO) -> None:
    """A complete MCAP file starts and ends with the magic bytes; a killed recorder leaves no end."""
    size = len(MCAP0_MAGIC)
    if file.read(size) != MCAP0_MAGIC:
        raise InputError(f"{path}: not an MCAP file")
    file.seek(max(size, os.fstat(file.fileno()).st_size - size))
    if file.read() != MCAP0_MAGIC:
        raise InputError(f"{path}: the MCAP file is cut off at its end; `mcap recover` saves what is there")
    file.seek(0)


def _read(content: mmap.mmap, topics: Collection[str]) -> Bag:
    records = list(_records(content, len(MCAP0_MAGIC), len(content) - len(MCAP0_MAGIC)))
    _check_sums(content, records)
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    pieces: dict[str, list[_Piece]] = {topic: [] for topic in topics}
    counted: Counter[int] = Counter()

    def take(buffer: Buffer, inside: Sequence[tuple[int, int, int]]) -> None:
        """What a chunk, or all that is outside of chunks, holds."""
        for opcode, start, end in inside:
            if opcode == Opcode.SCHEMA:
                schema = _parsed(Schema, buffer, start, end)
                schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                channel = _parsed(Channel, buffer, start, end)
                if channels.setdefault(channel.id, channel) != channel:
                    raise _Damage(f"channel {channel.id} is defined twice")
        places = np.array([(start, end) for opcode, start, end in inside if opcode == Opcode.MESSAGE])
        if len(places):
            for topic, piece in _pieces(buffer, places, channels, topics):
                pieces[topic].append(piece)
                counted.update(piece.channels.tolist())

    others = [record for record in records if record[0] != Opcode.CHUNK]
    indexes = [_parsed(ChunkIndex, content, *its) for opcode, *its in records if opcode == Opcode.CHUNK_INDEX]
    own = [_parsed(Metadata, content, *its) for opcode, *its in records if opcode == Opcode.METADATA]
    take(content, others)
    unwanted = _unwanted(content, records, indexes, channels, topics)
    for opcode, start, end in records:
        if opcode == Opcode.CHUNK and start - RECORD_PREFIX.size not in unwanted:
            chunk = _unpacked(_parsed(Chunk, content, start, end))
            take(chunk, list(_records(chunk, 0, len(chunk))))
    for opcode, start, end in records:
        if opcode == Opcode.STATISTICS:
            _check_counts(_parsed(Statistics, content, start, end), records, counted, channels, topics)
    ours = [dict(record.metadata) for record in own if record.name == METADATA]
    return Bag(
        topics=_present(channels, schemas),
        metadata=ours[0] if ours else None,
        messages={topic: _joined(found, channels, schemas) for topic, found in pieces.items() if found},
    )


def _records(buffer: Buffer, place: int, end: int) -> Iterator[tuple[int, int, int]]:
    """Opcode, begin and end of the content of each record between two places."""
    while place < end:
        opcode, length = RECORD_PREFIX.unpack_from(buffer, place)
        start = place + RECORD_PREFIX.size
        place = start + length
        yield opcode, start, place
    if place > end:
        raise _Damage("a record is longer than what holds it")


def _parsed(kind: type[RecordType], buffer: Buffer, start: int, end: int) -> RecordType:
    return kind.read(ReadDataStream(BytesIO(buffer[start:end])))  # type: ignore[attr-defined]  # each has it


def _check_sums(content: mmap.mmap, records: Sequence[tuple[int, int, int]]) -> None:
    """Checksums of data and summary, where there are any."""
    opcode, start, end = records[-1]
    if opcode != Opcode.FOOTER:
        raise _Damage("there is no footer")
    footer = _parsed(Footer, content, start, end)
    view = memoryview(content)
    try:
        if footer.summary_crc and footer.summary_crc != zlib.crc32(view[footer.summary_start : end - 4]):
            raise _Damage("the checksum of the summary is wrong")
        for opcode, start, end in records:
            if opcode == Opcode.DATA_END:
                crc = _parsed(DataEnd, content, start, end).data_section_crc
                if crc and crc != zlib.crc32(view[: start - RECORD_PREFIX.size]):
                    raise _Damage("the checksum of the data is wrong")
    finally:
        view.release()


def _unwanted(
    content: mmap.mmap,
    records: Sequence[tuple[int, int, int]],
    indexes: Sequence[ChunkIndex],
    channels: Mapping[int, Channel],
    topics: Collection[str],
) -> set[int]:
    """Where chunks begin that hold none of the topics; only a summary whose checksum is right is believed."""
    if not _parsed(Footer, content, *records[-1][1:]).summary_crc:
        return set()
    wanted = {number for number, channel in channels.items() if channel.topic in topics}
    return {
        index.chunk_start_offset
        for index in indexes
        if index.message_index_offsets
        and index.message_index_offsets.keys() <= channels.keys()
        and wanted.isdisjoint(index.message_index_offsets)
    }


def _unpacked(chunk: Chunk) -> bytes:
    """Content of a chunk; never more of it than `LARGEST_CHUNK`, whatever a compressed one grows to."""
    size = chunk.uncompressed_size
    if size > LARGEST_CHUNK:
        raise _Damage(f"a chunk of {size} bytes is larger than {LARGEST_CHUNK}, which this reader allows")
    if chunk.compression == "zstd":
        content = zstandard.ZstdDecompressor().stream_reader(chunk.data).read(size + 1)
    elif chunk.compression == "lz4":
        content = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    elif chunk.compression == "":
        content = chunk.data
    else:
        raise _Damage(f"chunks are compressed by '{chunk.compression}', not by zstd or lz4")
    if len(content) != size:
        raise _Damage(f"a chunk of {size} bytes does not unpack to as many")
    if chunk.uncompressed_crc and chunk.uncompressed_crc != zlib.crc32(content):
        raise _Damage("the checksum of a chunk is wrong")
    return content


@dataclass(frozen=True)
class _Piece:
    """Messages of one topic in one chunk, or outside of all: as `RawMessages`, in the order of the file."""

    channels: np.ndarray
    log_times: np.ndarray
    data: Sequence[bytes]


def _pieces(
    buffer: Buffer, places: np.ndarray, channels: Mapping[int, Channel], topics: Collection[str]
) -> Iterator[tuple[str, _Piece]]:
    """Messages of the topics, each piece with its topic; `places` (M, 2): begin and end of records."""
    starts, ends = places.T
    if (ends - starts < MESSAGE_HEAD.itemsize - RECORD_PREFIX.size).any():
        raise _Damage("a message is shorter than its head")
    windows = sliding_window_view(np.frombuffer(buffer, dtype=np.uint8), MESSAGE_HEAD.itemsize)
    heads = windows[starts - RECORD_PREFIX.size].view(MESSAGE_HEAD)[:, 0]
    unknown = set(heads["channel"].tolist()) - channels.keys()
    if unknown:
        raise _Damage(f"a message is of channel {min(unknown)}, which is not defined")
    for topic in topics:
        its = [number for number, channel in channels.items() if channel.topic == topic]
        mine = np.flatnonzero(np.isin(heads["channel"], its))
        if len(mine):
            begins = starts[mine] + MESSAGE_HEAD.itemsize - RECORD_PREFIX.size
            data = [
                buffer[begin:end] for begin, end in zip(begins.tolist(), ends[mine].tolist(), strict=True)
            ]
            yield topic, _Piece(heads["channel"][mine], heads["log_time"][mine], data)


def _check_counts(
    statistics: Statistics,
    records: Sequence[tuple[int, int, int]],
    counted: Mapping[int, int],
    channels: Mapping[int, Channel],
    topics: Collection[str],
) -> None:
    """Nothing is missing, and nothing is there twice."""
    chunks = sum(opcode == Opcode.CHUNK for opcode, _, _ in records)
    if statistics.chunk_count != chunks:
        raise _Damage(f"there are {chunks} chunks, not {statistics.chunk_count}")
    for number, channel in channels.items():
        found = counted.get(number, 0)
        said = statistics.channel_message_counts.get(number, found)
        if channel.topic in topics and found != said:
            raise _Damage(f"topic '{channel.topic}' has {found} messages, not {said}")


def _present(channels: Mapping[int, Channel], schemas: Mapping[int, Schema]) -> dict[str, list[str]]:
    """Topics of a file with the types of their messages."""
    present: dict[str, list[str]] = {}
    for channel in channels.values():
        schema = schemas.get(channel.schema_id)
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


def _joined(
    pieces: Sequence[_Piece], channels: Mapping[int, Channel], schemas: Mapping[int, Schema]
) -> RawMessages:
    """Pieces of one topic in the order of the file, put in the order of their log times."""
    numbers = np.concatenate([piece.channels for piece in pieces])
    log_times = np.concatenate([piece.log_times for piece in pieces])
    data = [message for piece in pieces for message in piece.data]
    if log_times.max() >= 2**63:
        raise _Damage("a log time is beyond 2^63 ns")
    if (log_times[1:] < log_times[:-1]).any():
        order = np.argsort(log_times, kind="stable")
        numbers, log_times = numbers[order], log_times[order]
        data = [data[place] for place in order.tolist()]
    its: dict[int, Any] = {  # None where the file has none: `_present` says so, and nobody reads these
        number: schemas.get(channels[number].schema_id) for number in np.unique(numbers).tolist()
    }
    return RawMessages(its, numbers, log_times.astype(np.int64), data)
