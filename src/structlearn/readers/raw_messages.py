"""Raw messages of bags: MCAP files, ours or a robot's, by `mcap`; older bags, read by `rosbags`.

Every checksum and count in an MCAP file is verified: of chunks, data, summary, and messages per channel.
`rosbags` is an extra of this package. Messages of ROS 1 are converted to ROS 2: the same numbers in CDR,
headers without their counter. Individually compressed messages are unpacked.
"""

import json
import struct
import tempfile
import zlib
from bz2 import BZ2Decompressor
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from io import BytesIO
from operator import itemgetter
from pathlib import Path
from typing import Any, BinaryIO

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Footer, McapRecord, Metadata, Schema, Statistics
from mcap.stream_reader import CRCValidationError
from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import MCAP0_MAGIC, Writer

from structlearn.core.errors import InputError
from structlearn.core.used_files import PER_MESSAGE, Budget, require_file
from structlearn.readers.clock import clock_reset
from structlearn.readers.definitions import LANGUAGES, shipped, short_name
from structlearn.readers.source_files import COMPRESSED, RecordingFile

METADATA_RECORD = "structlearn"  # name of the metadata record of our own files

# Largest unpacked chunk in bytes; writers start a new one after a few million, those of ROS 1 after one
# million.
LARGEST_CHUNK, LARGEST_OF_ROS1 = 2**28, 2**27

CHANNELS = 2**16  # channels that a file may have

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"  # start of a zstd frame; the first byte of a message is 0

# Head of a record of MCAP: opcode, then the number of bytes that follow. Those of a message start with its
# channel, a sequence number, log and publish time in ns
RECORD_HEAD = struct.Struct("<BQ")
MESSAGE = int(Opcode.MESSAGE)
MESSAGE_HEAD = np.dtype([("channel", "<u2"), ("number", "<u4"), ("log_time", "<i8"), ("published", "<i8")])

# Messages outside chunks are collected in chunks of this many bytes
CHUNK = 2**20

# Parsers of the records that are needed besides messages
IN_CHUNKS: Mapping[int, Any] = {Opcode.SCHEMA: Schema.read, Opcode.CHANNEL: Channel.read}
OUTSIDE: Mapping[int, Any] = {
    **IN_CHUNKS,
    Opcode.CHUNK: Chunk.read,
    Opcode.DATA_END: DataEnd.read,
    Opcode.FOOTER: Footer.read,
    Opcode.METADATA: Metadata.read,
    Opcode.STATISTICS: Statistics.read,
}


@dataclass(frozen=True)
class RawMessages:
    """T messages of one topic, ordered by log time; as written, if the clock of the recorder was set back."""

    log_times: np.ndarray  # (T,) int64 ns
    schemas: Sequence[Schema | None]  # definition of each message; None if the file has none
    data: Sequence[bytes]  # content of each message
    channels: np.ndarray | None = None  # (T,) number of each message's channel; None: there is one


Parts = Sequence[RawMessages]  # messages of one topic in several parts


@dataclass(frozen=True)
class Bag:
    """Content of a bag."""

    # every topic with the types of its messages; the type says so if it is not a ROS 2 message
    topics: Mapping[str, Sequence[str]]
    messages: Mapping[str, RawMessages]  # per requested topic that has messages
    metadata: Mapping[str, str] | None = None  # our metadata record; None for other files

    def provenance(self, path: Path) -> dict[str, str]:
        """Provenance from our metadata; a file without them counts as recorded."""
        if self.metadata is None:
            return {"origin": "recorded", "source": path.name}
        with damage_named(path):
            provenance = json.loads(self.metadata["provenance"])
            words = provenance.values() if isinstance(provenance, dict) else [None]
            if not all(isinstance(word, str) for word in words):
                raise _Damage("its provenance is not a mapping of words to words")
        return provenance


def _bag(types: Iterable[tuple[str, str]], parts: Mapping[str, Parts], metadata: Any = None) -> Bag:
    """Bag from pairs of topic and type, which may repeat, and the messages per topic, sorted here."""
    topics: dict[str, dict[str, None]] = {}
    for topic, message_type in types:
        topics.setdefault(topic, {})[message_type] = None
    messages = {topic: _ordered(its) for topic, its in parts.items() if its}
    return Bag({topic: list(types_of_topic) for topic, types_of_topic in topics.items()}, messages, metadata)


def _ordered(parts: Parts) -> RawMessages:
    """Messages of all parts, sorted by log time; those of equal times stay in order.

    Where a channel's log times go back for good, sorting would mix two passes of its clock.
    """
    log_times = np.concatenate([part.log_times for part in parts])
    if (log_times < 0).any():
        raise _Damage("a log time is not between 0 and 2^63 ns")
    schemas = [schema for part in parts for schema in part.schemas]
    data = [content for part in parts for content in part.data]
    numbers = [np.zeros(len(part.data), int) if part.channels is None else part.channels for part in parts]
    channels = np.concatenate(numbers)
    every = np.unique(channels)
    passes = (log_times[channels == channel] for channel in every)
    if (log_times[1:] < log_times[:-1]).any() and not any(map(clock_reset, passes)):
        order = np.argsort(log_times, kind="stable")
        log_times, channels = log_times[order], channels[order]
        schemas, data = ([values[at] for at in order.tolist()] for values in (schemas, data))
    return RawMessages(log_times, schemas, data, channels if len(every) > 1 else None)


def read_bags(file: RecordingFile, topics: Collection[str]) -> Bag:
    """Read some topics of a bag; metadata of a split bag are those of the first file with any."""
    read = {"mcap": read_bag, "db3": read_db3, "bag": read_ros1_bag}[file.format]
    bags = [read(path, topics) for path in file.paths]
    if len(bags) == 1:
        return bags[0]
    types = ((topic, name) for bag in bags for topic, names in bag.topics.items() for name in names)
    parts: dict[str, list[RawMessages]] = defaultdict(list)
    for number, bag in enumerate(bags):
        for topic, part in bag.messages.items():
            channels = np.zeros(len(part.data), int) if part.channels is None else part.channels
            parts[topic].append(replace(part, channels=channels + CHANNELS * number))
    for its in parts.values():
        its.sort(key=lambda part: int(part.log_times[0]))
    return _bag(types, parts, next((bag.metadata for bag in bags if bag.metadata is not None), None))


def write_bag(
    path: str | Path, metadata: Mapping[str, str], messages: Iterable[tuple[str, RawMessages]]
) -> None:
    """Write ROS 2 messages as an MCAP file in place; equal messages give equal bytes.

    A topic has messages of one type. Messages are ordered by log time, then by topic.
    """
    with open(path, "wb") as file:
        writer = Writer(file, enable_data_crcs=True)
        writer.start(profile=Profile.ROS2)
        writer.add_metadata(METADATA_RECORD, dict(metadata))
        schemas: dict[str, int] = {}
        rows: list[tuple[int, int, bytes]] = []
        for topic, raw in messages:
            schema = raw.schemas[0]
            assert schema is not None  # we wrote it
            if schema.name not in schemas:
                schemas[schema.name] = writer.register_schema(schema.name, schema.encoding, schema.data)
            channel = writer.register_channel(topic, MessageEncoding.CDR, schemas[schema.name])
            rows += [
                (stamp, channel, data) for stamp, data in zip(raw.log_times.tolist(), raw.data, strict=True)
            ]
        for stamp, channel, data in sorted(rows, key=itemgetter(0)):
            writer.add_message(channel, log_time=stamp, data=data, publish_time=stamp)
        writer.finish()


class _Damage(Exception):  # noqa: N818 - it is what is found
    """A file contradicts itself."""


@contextmanager
def damage_named(where: str | Path, what: str = "MCAP file") -> Iterator[None]:
    """Turn any error while a file is read into an InputError; only reading calls belong in the body."""
    try:
        yield
    except InputError:
        raise
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "rosbags":
            raise
        raise InputError(
            f"{where}: bags of this kind are read by `rosbags`, which is not installed: `pip install "
            "'structlearn[bags]'`; or `ros2 bag convert` turns the bag into MCAP"
        ) from error
    except Exception as error:
        if isinstance(error, OSError) and error.strerror:  # errors of decompressors have none
            raise InputError(f"{where}: cannot be read: {error.strerror}") from error
        kind = "" if isinstance(error, _Damage) else f"{type(error).__name__}: "
        raise InputError(f"{where}: damaged {what}: {kind}{error}") from error


def read_bag(path: Path, topics: Collection[str]) -> Bag:
    """Read some topics of an MCAP file, from `ros2 bag record -s mcap` or `write_bag`. Raises InputError."""
    with damage_named(path):
        require_file(path, whole=False)
        budget, size = Budget(path), len(MCAP0_MAGIC)
        with unpacked_file(path, budget) as plain, open(plain, "rb") as file:
            if file.read(size) != MCAP0_MAGIC:
                raise InputError(f"{path}: not an MCAP file")
            file.seek(max(size, file.seek(0, 2) - size))
            if file.read() != MCAP0_MAGIC:  # a killed recorder writes no end
                raise InputError(
                    f"{path}: the MCAP file is cut off at its end; `mcap recover` saves what is there"
                )
            file.seek(0)
            return _read_mcap(file, topics, budget)


@contextmanager
def unpacked_file(path: Path, budget: Budget) -> Iterator[Path]:
    """Yield the file or, if it is a single zstd frame (`ros2 bag`), a temporary file with its content."""
    if path.suffix != COMPRESSED:
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / path.stem
        unpacker = zstandard.ZstdDecompressor().decompressobj()
        with open(path, "rb") as file, open(plain, "wb") as unpacked:
            try:
                while not unpacker.eof and (block := file.read(2**12)):  # 4 kB may unpack to 100 MB of zeros
                    content = unpacker.decompress(block)
                    budget.take(len(content))
                    unpacked.write(content)
            except (zstandard.ZstdError, MemoryError) as error:
                raise InputError(f"{path}: damaged zstd file: {error}") from error
        if not unpacker.eof:
            raise InputError(f"{path}: the zstd file is cut off at its end")
        yield plain


def _read_mcap(file: BinaryIO, topics: Collection[str], budget: Budget) -> Bag:
    """Content of an MCAP file; topics may be defined, even repeatedly, anywhere in it."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    metadata: dict[str, Mapping[str, str]] = {}
    found: dict[str, list[tuple[int, np.ndarray, list[bytes]]]] = {topic: [] for topic in topics}
    counted: Counter[int] = Counter()
    statistics: Statistics | None = None
    chunks = 0
    for record in _records(file, budget):
        if isinstance(record, _Messages):
            for number in np.unique(record.channels).tolist():
                rows = record.channels == number
                counted[number] += int(rows.sum())
                if (topic := channels[number].topic) in found:
                    found[topic].append((number, record.log_times[rows], record.data(rows, budget)))
        elif isinstance(record, Chunk):
            chunks += 1
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            if channels.setdefault(record.id, record) != record:
                raise _Damage(f"channel {record.id} is defined twice")
        elif isinstance(record, Metadata):
            metadata.setdefault(record.name, record.metadata)
        elif isinstance(record, Statistics):
            statistics = record
    if statistics and statistics.chunk_count != chunks:
        raise _Damage(f"there are {chunks} chunks, not {statistics.chunk_count}")
    for number, said in statistics.channel_message_counts.items() if statistics else ():
        if counted[number] != said:
            raise _Damage(f"channel {number} has {counted[number]} messages, not {said}")
    of = {number: schemas.get(channel.schema_id) for number, channel in channels.items()}
    types = ((channel.topic, _type_name(channel, of[number])) for number, channel in channels.items())
    parts = {
        topic: [
            RawMessages(times, [of[number]] * len(times), data, np.full(len(times), number))
            for number, times, data in its
        ]
        for topic, its in found.items()
    }
    return _bag(types, parts, metadata.get(METADATA_RECORD))


def _type_name(channel: Channel, schema: Schema | None) -> str:
    if channel.message_encoding == MessageEncoding.CDR and schema:
        known = schema.encoding in LANGUAGES and short_name(schema.name) in shipped()
        if known or schema.encoding == SchemaEncoding.ROS2:
            return schema.name
    encodings = f"{channel.message_encoding}, {schema.encoding if schema else 'no schema'}"
    name = schema.name if schema else "unknown"
    return f"{name} [{encodings}: not ROS 2 messages with ros2msg definitions]"


class _Messages:
    """Messages of a chunk: `channels` (M,) and `log_times` (M,) int64 ns."""

    def __init__(self, content: bytes, starts: Sequence[int], ends: Sequence[int]) -> None:
        """`starts`, `ends`: (M,) of each message in the content, after the head of its record."""
        self._content, self._starts, self._ends = content, np.array(starts), np.array(ends)
        if (self._ends - self._starts < MESSAGE_HEAD.itemsize).any():
            raise _Damage("a message has no channel and time")
        heads = self._starts[:, None] + np.arange(MESSAGE_HEAD.itemsize)
        head = np.frombuffer(content, dtype=np.uint8)[heads].view(MESSAGE_HEAD)[:, 0]
        self.channels, self.log_times = head["channel"], head["log_time"].astype(np.int64)

    def data(self, rows: np.ndarray, budget: Budget) -> list[bytes]:
        """Contents of some messages, `rows`: (M,) bool."""
        starts = (self._starts[rows] + MESSAGE_HEAD.itemsize).tolist()
        spans = zip(starts, self._ends[rows].tolist(), strict=True)
        data = [self._content[start:end] for start, end in spans]
        if ZSTD_MAGIC in self._content:
            data = [unpacked_message(message, budget) for message in data]
        return data


def _records(file: BinaryIO, budget: Budget) -> Iterator[McapRecord | _Messages]:
    """All records that are needed, verified; the contents of a chunk follow the chunk.

    The reader of `mcap` takes four times as long: it reads messages, and their index, field by field.
    """
    end = file.seek(0, 2)
    file.seek(0)
    checksum, record, loose = zlib.crc32(file.read(len(MCAP0_MAGIC))), None, bytearray()
    while not isinstance(record, Footer):
        head = file.read(RECORD_HEAD.size)
        opcode, length = RECORD_HEAD.unpack(head)
        if length > end - file.tell():
            raise _Damage(f"a record of {length} bytes does not fit into the file")
        body = file.read(length)
        if opcode == MESSAGE:
            loose += head + body
        if loose and (opcode != MESSAGE or len(loose) > CHUNK):
            yield from _within(bytes(loose), budget)
            loose.clear()
        if opcode in OUTSIDE:
            record = _parsed(OUTSIDE[opcode], body)
            yield record
            if isinstance(record, Chunk):
                yield from _within(_unpacked(record, budget), budget)
            elif isinstance(record, DataEnd) and record.data_section_crc not in (0, checksum):
                raise CRCValidationError(record.data_section_crc, checksum, record)
        checksum = zlib.crc32(body, zlib.crc32(head, checksum))
    if file.read() != MCAP0_MAGIC:
        raise _Damage("it goes on after its footer")
    file.seek(record.summary_start)
    checked = file.read()[: -len(MCAP0_MAGIC) - 4]  # without the checksum itself
    if record.summary_crc and record.summary_crc != zlib.crc32(checked):
        raise _Damage("the checksum of the summary is wrong")


def _unpacked(chunk: Chunk, budget: Budget) -> bytes:
    """Verified content of a chunk."""
    size = chunk.uncompressed_size
    budget.take(size)
    content = unpacked_chunk(chunk.compression, chunk.data, size)
    if len(content) != size:
        raise _Damage(f"a chunk of {size} bytes does not unpack to as many")
    if chunk.uncompressed_crc and chunk.uncompressed_crc != (checksum := zlib.crc32(content)):
        raise CRCValidationError(chunk.uncompressed_crc, checksum, chunk)
    return content


def _within(content: bytes, budget: Budget) -> Iterator[McapRecord | _Messages]:
    """Definitions in a chunk, then its messages."""
    starts, ends, at, size = [], [], 0, len(content)
    while at < size:
        opcode, length = RECORD_HEAD.unpack_from(content, at)
        start = at + RECORD_HEAD.size
        at = start + length
        if at > size:
            raise _Damage(f"a record of {length} bytes does not fit into its chunk")
        if opcode == MESSAGE:
            starts.append(start)
            ends.append(at)
        elif opcode in IN_CHUNKS:
            yield _parsed(IN_CHUNKS[opcode], content[start:at])
    if starts:
        budget.take(PER_MESSAGE * len(starts))
        yield _Messages(content, starts, ends)


def _parsed(parse: Callable[[ReadDataStream], McapRecord], body: bytes) -> McapRecord:
    return parse(ReadDataStream(BytesIO(body)))


def unpacked_chunk(compression: str, data: bytes, size: int = LARGEST_CHUNK) -> bytes:
    """Content of a chunk, at most one byte more than `size`."""
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
    """Content of a message, unpacked if it was compressed by `ros2 bag record --compression-mode message`."""
    if not data.startswith(ZSTD_MAGIC):
        return data
    size = zstandard.frame_content_size(data)
    budget.take(max(size, 0))
    content = zstandard.ZstdDecompressor().decompress(data, max_output_size=LARGEST_CHUNK)
    budget.take(len(content) if size < 0 else 0)
    return content


def read_db3(path: Path, topics: Collection[str]) -> Bag:
    """Read some topics of a .db3 file; before ROS 2 Iron, the library supplies the types."""
    with damage_named(path, "bag"), unpacked_file(path, budget := Budget(path)) as plain:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        latest = get_typestore(Stores.LATEST)
        with AnyReader([plain], default_typestore=latest) as reader:
            stores = (reader.typestore, latest)
            return _read_older(reader, topics, stores, lambda raw, _: unpacked_message(raw, budget), budget)


def read_ros1_bag(path: Path, topics: Collection[str]) -> Bag:
    """Read some topics of a ROS 1 .bag file."""
    with damage_named(path, "bag"):
        from rosbags.rosbag1 import Reader
        from rosbags.rosbag1.reader import decompressors
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        with Reader(path) as reader:
            types: dict[str, Any] = {}
            for connection in reader.connections:
                types |= get_types_from_msg(connection.msgdef.data, connection.msgtype)
            header = "std_msgs/msg/Header"
            if header in types:  # ROS 2 headers have no counter
                types[header] = get_typestore(Stores.LATEST).fielddefs[header]
            store = get_typestore(Stores.EMPTY)
            store.register(types)
            budget, names = Budget(path), {unpack: name for name, unpack in decompressors.items()}

            def unpacked(compression: str, data: bytes) -> bytes:  # called again if chunks overlap in time
                content = unpacked_chunk(compression, data, LARGEST_OF_ROS1)
                if len(content) > LARGEST_OF_ROS1:
                    raise InputError(f"{path}: a chunk of more than {LARGEST_OF_ROS1} bytes")
                budget.take(len(content))
                return content

            for place, chunk in reader.chunks.items():
                within = partial(unpacked, names[chunk.decompressor])
                reader.chunks[place] = chunk._replace(decompressor=within)
            return _read_older(reader, topics, (store,), store.ros1_to_cdr, budget)


def _read_older(
    reader: Any,
    topics: Collection[str],
    stores: Collection[Any],
    to_cdr: Callable[[bytes, str], Any],
    budget: Budget,
) -> Bag:
    """Content of an open reader; `stores` know the types, `to_cdr` converts (content, type) to CDR."""
    wanted = [connection for connection in reader.connections if connection.topic in topics]
    schemas = {}
    for name in dict.fromkeys(connection.msgtype for connection in wanted):
        store = next((store for store in stores if name in store.fielddefs), None)
        if store is None:
            raise LookupError(f"the type {name} is not defined")
        text, _ = store.generate_msgdef(name, ros_version=2)
        schemas[name] = Schema(id=0, name=name, encoding=SchemaEncoding.ROS2, data=text.encode())
    parts: dict[str, list[RawMessages]] = defaultdict(list)
    for connection, log_time, raw in reader.messages(connections=wanted) if wanted else ():
        budget.take(PER_MESSAGE)
        content = bytes(to_cdr(raw, connection.msgtype))
        log_times = np.array([log_time], dtype=np.int64)
        channel = np.array([connection.id])
        parts[connection.topic].append(
            RawMessages(log_times, [schemas[connection.msgtype]], [content], channel)
        )
    return _bag(((connection.topic, connection.msgtype) for connection in reader.connections), parts)
