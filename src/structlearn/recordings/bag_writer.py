"""Messages of a demonstration written as an MCAP file, all at once.

The library's writer takes one message at a time, five times as long as everything that is done with the
numbers in it. Here the records of a file are laid out by numpy; the bytes are those of the library's writer.
"""

import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import BinaryIO

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import LIBRARY_IDENTIFIER, MCAP0_MAGIC
from numpy.lib.stride_tricks import sliding_window_view

METADATA = "structlearn"
"""Name of the metadata record of our own files."""

CHUNK_BYTES = 2**20
"""A chunk ends with the record that makes it longer than this, as the library's do."""

RECORD_PREFIX = struct.Struct("<BQ")
"""Opcode of a record, and length of what follows."""

MESSAGE_HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
"""A message's record up to the message itself."""


@dataclass(frozen=True)
class RawTopic:
    """Messages of one length.

    Attributes:
        name: the topic.
        message_type: `package/msg/Type`.
        definition: text of the type with those of all nested types.
        stamps: (T,) int64 ns, not negative, increasing: log and publish time; at least one.
        messages: (T, L) uint8, one message per row.
    """

    name: str
    message_type: str
    definition: str
    stamps: np.ndarray
    messages: np.ndarray


def write_bag(path: str | Path, metadata: Mapping[str, str], topics: Sequence[RawTopic]) -> None:
    """Write an MCAP file of ROS 2 messages: compressed chunks, indexes, checksums, statistics.

    Messages stand in the order of their stamps, at equal stamps in the order of the topics.

    Args:
        path: the file, written in place; its folder exists.
        metadata: our metadata record.
        topics: at least one.
    """
    owners = np.repeat(np.arange(len(topics)), [len(topic.stamps) for topic in topics])
    stamps = np.concatenate([topic.stamps for topic in topics])
    order = np.argsort(stamps, kind="stable")
    owners, stamps = owners[order], stamps[order]
    definitions = {topic.message_type: topic.definition for topic in topics}
    schemas = [
        Schema(id=number, name=name, encoding=SchemaEncoding.ROS2, data=text.encode())
        for number, (name, text) in enumerate(definitions.items(), start=1)
    ]
    schema_ids = {schema.name: schema.id for schema in schemas}
    first = np.unique(owners, return_index=True)[1]  # (topics,) place of each one's first message
    channels = [
        Channel(number, topics[owner].name, MessageEncoding.CDR, {}, schema_ids[topics[owner].message_type])
        for number, owner in enumerate(np.argsort(first).tolist(), start=1)  # in the order in which they come
    ]
    ids = np.argsort(np.argsort(first)) + 1  # (topics,) channel of each
    before = [0] * len(schemas) + np.sort(first).tolist()
    content, ends, ids, stamps = _records(topics, owners, stamps, ids, [*schemas, *channels], before)
    with open(path, "w+b") as file:
        file.write(MCAP0_MAGIC)
        file.write(_bytes(Header(Profile.ROS2, _library())))
        place = file.tell()
        length = file.write(_bytes(Metadata(METADATA, dict(metadata))))
        chunks = list(_write_chunks(file, content, ends, ids, stamps))
        file.seek(0)
        file.write(_bytes(DataEnd(zlib.crc32(file.read()))))
        counts = np.bincount(ids)[1:].tolist()
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(channels),
            channel_message_counts=dict(enumerate(counts, start=1)),
            chunk_count=len(chunks),
            message_count=sum(counts),
            message_end_time=int(stamps.max()),
            message_start_time=int(stamps[ids > 0].min()),
            metadata_count=1,
            schema_count=len(schemas),
        )
        groups: dict[Opcode, Sequence[McapRecord]] = {
            Opcode.SCHEMA: schemas,
            Opcode.CHANNEL: channels,
            Opcode.STATISTICS: [statistics],
            Opcode.CHUNK_INDEX: chunks,
            Opcode.ATTACHMENT_INDEX: [],
            Opcode.METADATA_INDEX: [MetadataIndex(place, length, METADATA)],
        }
        file.write(_summary(file.tell(), groups))
        file.write(MCAP0_MAGIC)


def _records(
    topics: Sequence[RawTopic],
    owners: np.ndarray,
    stamps: np.ndarray,
    ids: np.ndarray,
    others: Sequence[McapRecord],
    before: Sequence[int],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """All records of all chunks behind each other.

    Args:
        topics: what is written.
        owners: (T,) topic of each message.
        stamps: (T,) ns of each message.
        ids: (topics,) channel of each topic.
        others: schemas, and each channel.
        before: which message each of the others comes before.

    Returns:
        content: the bytes, uint8.   ends: (R,) where each record ends in them.
        ids: (R,) channel of each message, 0 for the others.   stamps: (R,) ns, 0 for the others.
    """
    heads = [np.frombuffer(_bytes(record), dtype=np.uint8) for record in others]
    sizes = np.array([MESSAGE_HEAD.itemsize + topic.messages.shape[1] for topic in topics])[owners]
    ends = np.cumsum(np.insert(sizes, before, [len(head) for head in heads]))
    channel = np.insert(ids[owners], before, 0)
    content = np.empty(ends[-1], dtype=np.uint8)
    for head, end in zip(heads, ends[channel == 0].tolist(), strict=True):
        content[end - len(head) : end] = head
    for number, topic in zip(ids.tolist(), topics, strict=True):
        message = np.zeros((len(topic.stamps), 1), dtype=MESSAGE_HEAD)
        size = MESSAGE_HEAD.itemsize + topic.messages.shape[1]
        message["opcode"], message["channel"] = Opcode.MESSAGE, number
        message["length"] = size - RECORD_PREFIX.size
        message["log_time"][:, 0] = message["publish_time"][:, 0] = topic.stamps
        places = sliding_window_view(content, size, writeable=True)
        places[ends[channel == number] - size] = np.hstack([message.view(np.uint8), topic.messages])
    return content, ends, channel, np.insert(stamps, before, 0)


def _write_chunks(
    file: BinaryIO, content: np.ndarray, ends: np.ndarray, ids: np.ndarray, stamps: np.ndarray
) -> Iterator[ChunkIndex]:
    """Write the chunks, each with the indexes of its channels; the arguments are what `_records` gives."""
    starts = np.append(0, ends[:-1])
    begin = 0
    while begin < len(ends):
        end = min(int(np.searchsorted(ends, starts[begin] + CHUNK_BYTES, side="right")) + 1, len(ends))
        chunk = content[starts[begin] : ends[end - 1]].tobytes()
        channel, places, times = ids[begin:end], starts[begin:end] - starts[begin], stamps[begin:end]
        record = Chunk(
            compression="zstd",
            data=zstandard.compress(chunk),
            message_end_time=int(times.max()),
            message_start_time=int(times[channel > 0].min()),
            uncompressed_crc=zlib.crc32(chunk),
            uncompressed_size=len(chunk),
        )
        place = file.tell()
        length = file.write(_bytes(record))
        offsets, index_start = {}, file.tell()
        for number in dict.fromkeys(channel[channel > 0].tolist()):
            entries = np.stack([times[channel == number], places[channel == number]], axis=1).astype("<u8")
            offsets[number] = file.tell()
            file.write(RECORD_PREFIX.pack(Opcode.MESSAGE_INDEX, 6 + entries.nbytes))
            file.write(struct.pack("<HI", number, entries.nbytes) + entries.tobytes())
        yield ChunkIndex(
            chunk_length=length,
            chunk_start_offset=place,
            compression=record.compression,
            compressed_size=len(record.data),
            message_end_time=record.message_end_time,
            message_index_length=file.tell() - index_start,
            message_index_offsets=offsets,
            message_start_time=record.message_start_time,
            uncompressed_size=record.uncompressed_size,
        )
        begin = end


def _summary(place: int, groups: Mapping[Opcode, Sequence[McapRecord]]) -> bytes:
    """The file's summary, which begins at `place`: groups of records, where each group is, footer."""
    summary, offsets = b"", b""
    for opcode, records in groups.items():
        group = b"".join(map(_bytes, records))
        offsets += _bytes(SummaryOffset(opcode, place + len(summary), len(group)))
        summary += group
    footer = _bytes(Footer(place, place + len(summary), 0))[:-4]  # its last field is the checksum of it all
    content = summary + offsets + footer
    return content + struct.pack("<I", zlib.crc32(content))


@cache
def _library() -> str:
    """Who wrote the file: the libraries whose records and messages it has."""
    return f"{LIBRARY_IDENTIFIER} mcap-ros2-support/{version('mcap-ros2-support')}"


def _bytes(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()
