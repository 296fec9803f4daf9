"""Raw messages of an MCAP file, ours or a robot's, read and written by the package `mcap`.

Every checksum and count that a file has must be right: of chunks, data and summary, and how many messages a
channel has.
"""

import json
import tempfile
import zlib
from bz2 import BZ2Decompressor
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path
from typing import BinaryIO

import lz4.frame
import numpy as np
import zstandard
from mcap.records import Channel, Chunk, Footer, McapRecord, Message, Metadata, Schema, Statistics
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import MCAP0_MAGIC, Writer

from structlearn.core.errors import InputError
from structlearn.core.reading import PER_MESSAGE, Budget, require_file

METADATA = "structlearn"
"""Name of the metadata record of our own files."""

LARGEST_CHUNK = 2**28
"""Bytes of a chunk when it is unpacked; writers begin a new one after a few million."""

COMPRESSED = ".zstd"
"""End of the name of a file that is compressed as a whole."""

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""How a zstd frame begins; no message does, its first byte is 0."""


Row = tuple[int, Schema | None, bytes]
"""Log time in ns, definition and content of a message."""


@dataclass(frozen=True)
class RawMessages:
    """Messages of one topic, in the order of their log times."""

    schemas: Sequence[Schema | None]  # their definitions; None where the file has none
    kinds: np.ndarray  # (T,) which of the schemas each message has
    log_times: np.ndarray  # (T,) int64 ns
    data: Sequence[bytes]  # bytes of each message

    def rows(self) -> Iterator[Row]:
        """Messages one by one."""
        schemas = (self.schemas[kind] for kind in self.kinds.tolist())
        return zip(self.log_times.tolist(), schemas, self.data, strict=True)


def in_time_order(rows: Iterable[Row]) -> RawMessages:
    """Messages of one topic, those of equal times in the order in which they come."""
    log_times, schemas, data = zip(*sorted(rows, key=itemgetter(0)), strict=True)
    different = {id(one): one for one in schemas}
    places = {number: place for place, number in enumerate(different)}
    kinds = np.array([places[id(one)] for one in schemas])
    return RawMessages(list(different.values()), kinds, np.array(log_times, dtype=np.int64), data)


def of_one_type(message_type: str, definition: str, stamps: np.ndarray, content: np.ndarray) -> RawMessages:
    """Messages (T, L) uint8 of one type, with the text of its definition and (T,) increasing stamps in ns."""
    schema = Schema(id=0, name=message_type, encoding=SchemaEncoding.ROS2, data=definition.encode())
    return RawMessages([schema], np.zeros(len(stamps), dtype=int), stamps, [row.tobytes() for row in content])


@dataclass(frozen=True)
class Bag:
    """What a file has."""

    # every topic with the types of its messages; what is not a ROS 2 message says so in its type
    topics: Mapping[str, Sequence[str]]
    metadata: Mapping[str, str] | None  # our own metadata record; None where the file is not ours
    messages: Mapping[str, RawMessages]  # of each topic that was asked for, unless there are none

    def provenance(self, path: Path) -> dict[str, str]:
        """What our own metadata say of the origin; a file without them was recorded."""
        if self.metadata is None:
            return {"origin": "recorded", "source": path.name}
        with damage_named(path):
            found = json.loads(self.metadata["provenance"])
            if not isinstance(found, dict) or not all(isinstance(word, str) for word in found.values()):
                raise _Damage("its provenance is not a mapping of words to words")
        return found


def write_bag(
    path: str | Path, metadata: Mapping[str, str], messages: Iterable[tuple[str, RawMessages]]
) -> None:
    """Write messages of ROS 2 with their topics as an MCAP file; the same ones give the same bytes.

    Those of a topic have one type. They stand in the order of their log times, at equal times in the order of
    the topics. The file is written in place; its folder exists.
    """
    with open(path, "wb") as file:
        writer = Writer(file, enable_data_crcs=True)
        writer.start(profile=Profile.ROS2)
        writer.add_metadata(METADATA, dict(metadata))
        schemas: dict[str, int] = {}
        rows = []
        for topic, its in messages:
            (schema,) = filter(None, its.schemas)
            if schema.name not in schemas:
                schemas[schema.name] = writer.register_schema(schema.name, schema.encoding, schema.data)
            channel = writer.register_channel(topic, MessageEncoding.CDR, schemas[schema.name])
            rows += [(stamp, channel, data) for stamp, _, data in its.rows()]
        for stamp, channel, data in sorted(rows, key=itemgetter(0)):
            writer.add_message(channel, log_time=stamp, data=data, publish_time=stamp)
        writer.finish()


def read_bag(path: Path, topics: Collection[str]) -> Bag:
    """Read the messages of some topics of an MCAP file, as `ros2 bag record -s mcap` or `write_bag` left it.

    Raises InputError: the file is missing, not an MCAP file, cut off or damaged; the message names it.
    """
    try:
        require_file(path, whole=False)
        budget = Budget(path)
        with unpacked_file(path, budget) as plain, open(plain, "rb") as file:
            _check_complete(path, file)
            with damage_named(path):
                return _read(file, topics, budget)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error


@contextmanager
def unpacked_file(path: Path, budget: Budget) -> Iterator[Path]:
    """The file, or where it is one zstd frame, as `ros2 bag` leaves it, another one with its content.

    Raises InputError: the frame is damaged or cut off, grows beyond the budget, or the disk has no room for
    it.
    """
    if path.suffix != COMPRESSED:
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / path.stem
        unpacker = zstandard.ZstdDecompressor().decompressobj()
        with open(path, "rb") as file, open(plain, "wb") as unpacked:
            try:
                while not unpacker.eof and (block := file.read(2**12)):  # 100 MB of zeros are as long
                    content = unpacker.decompress(block)
                    budget.take(len(content))
                    unpacked.write(content)
            except (zstandard.ZstdError, MemoryError) as error:
                raise InputError(f"{path}: damaged zstd file: {error}") from error
        if not unpacker.eof:
            raise InputError(f"{path}: the zstd file is cut off at its end")
        yield plain


def joined(bags: Sequence[Bag]) -> Bag:
    """The parts of one bag that is split over several files; the origin is what the first says that does."""
    if len(bags) == 1:
        return bags[0]
    topics: dict[str, list[str]] = {}
    rows: dict[str, list[Row]] = {}
    for bag in bags:
        for topic, types in bag.topics.items():
            topics[topic] = list(dict.fromkeys([*topics.get(topic, ()), *types]))
        for topic, messages in bag.messages.items():
            rows.setdefault(topic, []).extend(messages.rows())
    metadata = next((bag.metadata for bag in bags if bag.metadata is not None), None)
    return Bag(topics, metadata, {topic: in_time_order(its) for topic, its in rows.items()})


class _Damage(Exception):  # noqa: N818 - it is what is found
    """What a file says of itself is not so."""


@contextmanager
def damage_named(where: str | Path, what: str = "MCAP file") -> Iterator[None]:
    """Turn whatever is raised on damaged bytes into an InputError; only what reads them goes inside."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        kind = "" if isinstance(error, _Damage) else f"{type(error).__name__}: "
        raise InputError(f"{where}: damaged {what}: {kind}{error}") from error


def _check_complete(path: Path, file: BinaryIO) -> None:
    """A complete MCAP file starts and ends with the magic bytes; a killed recorder leaves no end."""
    size = len(MCAP0_MAGIC)
    if file.read(size) != MCAP0_MAGIC:
        raise InputError(f"{path}: not an MCAP file")
    file.seek(max(size, file.seek(0, 2) - size))
    if file.read() != MCAP0_MAGIC:
        raise InputError(f"{path}: the MCAP file is cut off at its end; `mcap recover` saves what is there")
    file.seek(0)


def _read(file: BinaryIO, topics: Collection[str], budget: Budget) -> Bag:
    """Content of a file; topics may be defined, and again, anywhere in it."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    metadata: dict[str, Metadata] = {}
    messages: dict[str, list[tuple[int, int, bytes]]] = {topic: [] for topic in topics}
    counted: Counter[int] = Counter()
    statistics: Statistics | None = None
    chunks = 0
    for record in _records(file, budget):
        if isinstance(record, Message):
            budget.take(PER_MESSAGE)
            counted[record.channel_id] += 1
            topic = channels[record.channel_id].topic
            if topic in messages:
                content = unpacked_message(record.data, budget)
                messages[topic].append((record.log_time, record.channel_id, content))
        elif isinstance(record, Chunk):
            chunks += 1
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            if channels.setdefault(record.id, record) != record:
                raise _Damage(f"channel {record.id} is defined twice")
        elif isinstance(record, Metadata):
            metadata.setdefault(record.name, record)
        elif isinstance(record, Statistics):
            statistics = record
    if statistics and statistics.chunk_count != chunks:
        raise _Damage(f"there are {chunks} chunks, not {statistics.chunk_count}")
    for number, said in statistics.channel_message_counts.items() if statistics else ():
        if counted[number] != said:
            raise _Damage(f"channel {number} has {counted[number]} messages, not {said}")
    definitions = {number: schemas.get(channel.schema_id) for number, channel in channels.items()}
    found = {
        topic: in_time_order((log_time, definitions[number], data) for log_time, number, data in its)
        for topic, its in messages.items()
        if its
    }
    present: dict[str, dict[str, None]] = {}  # in their order
    for number, channel in channels.items():
        present.setdefault(channel.topic, {})[_type_name(channel, definitions[number])] = None
    types = {topic: list(its) for topic, its in present.items()}
    return Bag(types, metadata[METADATA].metadata if METADATA in metadata else None, found)


def _type_name(channel: Channel, schema: Schema | None) -> str:
    if channel.message_encoding == MessageEncoding.CDR and schema and schema.encoding == SchemaEncoding.ROS2:
        return schema.name
    encodings = f"{channel.message_encoding}, {schema.encoding if schema else 'no schema'}"
    name = schema.name if schema else "unknown"
    return f"{name} [{encodings}: not ROS 2 messages with ros2msg definitions]"


def _records(file: BinaryIO, budget: Budget) -> Iterator[McapRecord]:
    """All records; behind each chunk those that it holds."""
    footer = None
    for record in StreamReader(file, emit_chunks=True, validate_crcs=True).records:
        yield record
        if isinstance(record, Chunk):
            budget.take(record.uncompressed_size)
            yield from breakup_chunk(_unpacked(record), validate_crc=True)
        elif isinstance(record, Footer):
            footer = record
    assert footer is not None  # the reader goes on until there is one
    file.seek(footer.summary_start)
    checked = file.read()[: -len(MCAP0_MAGIC) - 4]  # but for its own field
    if footer.summary_crc and footer.summary_crc != zlib.crc32(checked):
        raise _Damage("the checksum of the summary is wrong")


def _unpacked(chunk: Chunk) -> Chunk:
    """A chunk without compression."""
    size = chunk.uncompressed_size
    content = unpacked_chunk(chunk.compression, chunk.data, size)
    if len(content) != size:
        raise _Damage(f"a chunk of {size} bytes does not unpack to as many")
    return replace(chunk, compression="", data=content)


def unpacked_chunk(compression: str, data: bytes, size: int = LARGEST_CHUNK) -> bytes:
    """Content of a chunk; where it is larger than `size`, a byte more than that."""
    if size > LARGEST_CHUNK:
        raise _Damage(f"a chunk of {size} bytes is larger than {LARGEST_CHUNK}, which this reader allows")
    if compression == "zstd":
        return zstandard.ZstdDecompressor().stream_reader(data).read(size + 1)
    if compression == "lz4":
        return lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
    if compression == "bz2":
        return BZ2Decompressor().decompress(data, max_length=size + 1)
    if compression in ("", "none"):
        return data
    raise _Damage(f"chunks are compressed by '{compression}', not by zstd or lz4")


def unpacked_message(data: bytes, budget: Budget) -> bytes:
    """A message, unpacked if `ros2 bag record --compression-mode message` compressed it."""
    if not data.startswith(ZSTD_MAGIC):
        return data
    size = zstandard.frame_content_size(data)
    budget.take(max(size, 0))
    content = zstandard.ZstdDecompressor().decompress(data, max_output_size=LARGEST_CHUNK)
    budget.take(len(content) if size < 0 else 0)
    return content
