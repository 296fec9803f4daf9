"""Bags of every format and compression, ours and those of other programs."""

import json
import struct
import sys
from operator import attrgetter

import lz4.frame
import numpy as np
import pytest
import zstandard
from committed import topic_map
from hypothesis import given
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Chunk, Footer
from mcap.writer import MCAP0_MAGIC, CompressionType, IndexType
from mcap.writer import Writer as PlainWriter
from mcap_ros2.decoder import DecoderFactory
from readers_bags import (
    foreign_bag,
    joint_messages,
    make_recording,
    pose_messages,
    pose_rows,
    write_bag,
    write_older,
)

from structlearn.core.errors import InputError
from structlearn.readers import (
    OWN_TOPICS,
    Recording,
    Stream,
    read_recording,
    read_recordings,
    write_recording,
)
from structlearn.readers.bag_recording import open_bag
from structlearn.readers.messages import MESSAGE_TYPES, definition
from structlearn.readers.raw_messages import LARGEST_CHUNK
from structlearn.readers.source import OptionalTopicMap
from structlearn.readers.source_files import as_recording_file, recording_files

STAMPS = [10**9 + row * 10**7 for row in range(4)]
POSES = pose_messages(STAMPS, pose_rows(4))
JOINTS = {"name": ["a"], "position": [1.0]}
JOINT_STATES = [(f"/{one}", "sensor_msgs/msg/JointState", JOINTS, s) for one in "ab" for s in STAMPS]
THERE = r"it has /tool \(geometry_msgs/msg/PoseStamped\)"
SEGMENTS = np.array([[0.0, 0.1], [0.1, 1 / 3]])
TOOL = topic_map(pose="/tool")


def test_the_same_recording_gives_the_same_bytes(tmp_path):
    write_recording(make_recording(segments=SEGMENTS), tmp_path / "demo.mcap")
    turned = {"seed": "0", "origin": "simulated"}  # another order of keys
    write_recording(make_recording(segments=SEGMENTS, provenance=turned), tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == (tmp_path / "demo.mcap").read_bytes()


AXES = {
    "pose": ("pose.position.x y z", "pose.orientation.w x y z"),
    "twist": ("twist.linear.x y z", "twist.angular.x y z"),
    "wrench": ("wrench.force.x y z", "wrench.torque.x y z"),
    "tool_to_board": ("quaternion.w x y z",),
}
SEQUENCES = {"joint_positions": "position", "joint_velocities": "velocity", "joint_torques": "effort"}


def numbers(kind, message):
    if kind not in AXES:
        return list(getattr(message, SEQUENCES.get(kind, "data")))
    found = []
    for path in AXES[kind]:
        path, _, axes = path.rpartition(".")
        found += attrgetter(*(f"{path}.{axis}" for axis in axes.split()))(message)
    return found


@given(seed=st.integers(0, 2**32 - 1), start=st.integers(0, 2 * 10**18))
def test_the_library_decodes_every_number_and_stamp_that_was_written(tmp_path_factory, seed, start):
    recording = make_recording(seed=seed, count=3, start=start, segments=SEGMENTS)
    path = tmp_path_factory.mktemp("any") / "any.mcap"
    write_recording(recording, path)
    back = read_recording(path)
    assert (back.name, back.provenance) == ("any", {"origin": "simulated", "seed": str(seed)})
    np.testing.assert_array_equal(back.true_segments, SEGMENTS)
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        rows = list(reader.iter_decoded_messages(log_time_order=False))
        (record,) = reader.iter_metadata()
    assert json.loads(record.metadata["provenance"])["origin"] == "simulated"
    assert {row.schema.name for row in rows} == set(MESSAGE_TYPES.values())
    times = [row.message.log_time for row in rows]
    assert times == sorted(times)
    joints = next(row for row in rows if row.channel.topic == "/joint_states/positions").decoded_message
    assert joints.name == [f"joint_{joint}" for joint in range(1, 8)]
    assert (joints.velocity, joints.effort) == ([], [])
    for stream, read in zip(recording.streams, back.streams, strict=True):
        assert (read.topic, read.kind) == (stream.topic, stream.kind)
        assert read.values.flags.c_contiguous  # sums over it do not depend on how it was read
        mine = [row for row in rows if row.channel.topic == stream.topic]
        assert [row.message.log_time for row in mine] == stream.stamps.tolist()
        assert [row.message.publish_time for row in mine] == stream.stamps.tolist()
        found = [numbers(stream.kind, row.decoded_message) for row in mine]
        np.testing.assert_array_equal(found, stream.values)
        np.testing.assert_array_equal(read.stamps, stream.stamps)
        np.testing.assert_array_equal(read.values, stream.values)
        if stream.kind != "tactile":
            headers = [row.decoded_message.header.stamp for row in mine]
            assert [one.sec * 10**9 + one.nanosec for one in headers] == stream.stamps.tolist()


@pytest.mark.parametrize(("compression", "pack"), [("zstd", zstandard.compress), ("lz4", lz4.frame.compress)])
@pytest.mark.parametrize("said", [100, LARGEST_CHUNK + 1])
def test_a_chunk_that_grows_beyond_what_it_says_is_refused(tmp_path, compression, pack, said):
    builder = RecordBuilder()
    Chunk(compression, pack(bytes(10**7)), 0, 0, 0, said).write(builder)
    Footer(0, 0, 0).write(builder)
    (tmp_path / "bomb.mcap").write_bytes(MCAP0_MAGIC + builder.end() + MCAP0_MAGIC)
    with pytest.raises(InputError, match=r"bomb\.mcap: damaged MCAP file: a chunk of \d+ bytes"):
        read_recording(tmp_path / "bomb.mcap")


@pytest.mark.parametrize(
    ("record", "complaint"),
    [
        (
            struct.pack("<BQ", Opcode.MESSAGE, 10**6) + bytes(30),
            "a record of 1000000 bytes does not fit",
        ),
        (struct.pack("<BQ", Opcode.MESSAGE, 8) + bytes(8), "a message has no channel and time"),
        (struct.pack("<BQHIQQ", Opcode.MESSAGE, 22, 9, 0, 1, 1), "KeyError: 9"),
        (bytes([Opcode.MESSAGE]), "(error: |a record of)"),
    ],
)
@pytest.mark.parametrize("chunked", [True, False])
def test_records_that_contradict_themselves_are_refused(tmp_path, record, complaint, chunked):
    builder = RecordBuilder()
    if chunked:
        Chunk("", record, 0, 0, 0, len(record)).write(builder)
    else:
        builder.write(record)
    Footer(0, 0, 0).write(builder)
    (tmp_path / "bag.mcap").write_bytes(MCAP0_MAGIC + builder.end() + MCAP0_MAGIC)
    with pytest.raises(InputError, match=rf"bag\.mcap: damaged MCAP file: .*{complaint}"):
        read_recording(tmp_path / "bag.mcap")


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda s: (s[1],), "demo: has no pose stream"),
        (lambda s: (s[0], s[0]), "demo: pose comes from several topics: /pose, /pose"),
        (lambda s: (Stream("/pose", "pose", s[0].stamps - 6 * 10**9, s[0].values),), "stamps before 0"),
        (lambda s: (s[0], *s[6:8] * 6), "demo: has more than 10 tactile streams"),
        (lambda s: (Stream("/pose", "pose", s[0].stamps[:0], s[0].values[:0]),), "two samples, has 0"),
    ],
)
def test_what_cannot_be_read_back_is_not_written(tmp_path, change, complaint):
    recording = make_recording()
    with pytest.raises(InputError, match=complaint):
        write_recording(Recording("demo", change(recording.streams)), tmp_path / "demo.mcap")


POSE = "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
POSE += f"{'=' * 80}\nMSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
POSE += f"{'=' * 80}\nMSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
ROW = [1, 2, 3, 0, 0, 0, 1]


OPTIONS = [
    {},
    {"use_chunking": False, "repeat_channels": False, "use_statistics": False},
    {"index_types": IndexType.NONE},
    {"repeat_channels": False},
    {"repeat_schemas": False},
    {"compression": CompressionType.LZ4, "chunk_size": 100},
    {"compression": CompressionType.NONE, "enable_crcs": False},
]


@pytest.mark.parametrize(("options", "order"), [*((one, "mixed") for one in OPTIONS), ({}, "<"), ({}, ">")])
def test_bags_of_other_makers_give_the_same_values(tmp_path, options, order):
    """Without index, chunks or a whole summary, compressed otherwise, big-endian, or of both byte orders."""
    little = b"\x00\x01\x00\x00" + np.array(ROW, dtype="<f8").tobytes()
    big = b"\x00\x00\x00\x00" + np.array(ROW, dtype=">f8").tobytes()
    rows = {"<": [little] * 4, ">": [big] * 4, "mixed": [little, big] * 2}[order]
    schema = ("geometry_msgs/msg/Pose", "ros2msg", POSE.encode())
    path = foreign_bag(tmp_path / "bag.mcap", schema, list(zip(STAMPS, rows, strict=True)), **options)
    (stream,) = read_recording(path, TOOL).streams
    np.testing.assert_array_equal(stream.stamps, STAMPS)
    np.testing.assert_array_equal(stream.values, [[1, 2, 3, 1, 0, 0, 0]] * 4)


def test_a_topic_of_two_publishers_comes_in_the_order_of_its_log_times(tmp_path):
    with open(tmp_path / "bag.mcap", "wb") as stream:
        writer = PlainWriter(stream)
        writer.start()
        for place in (1, 0):  # with a definition each
            schema = writer.register_schema("geometry_msgs/msg/Pose", "ros2msg", POSE.encode())
            channel = writer.register_channel("/tool", "cdr", schema)
            for stamp in STAMPS[place::2]:
                row = np.array([stamp, *ROW[1:]], dtype="<f8")
                writer.add_message(channel, stamp, b"\x00\x01\x00\x00" + row.tobytes(), stamp)
        writer.finish()
    optional = OptionalTopicMap(**topic_map(pose="/tool", wrench="/wrist").model_dump(), obstacles=None)
    (pose,) = read_recording(tmp_path / "bag.mcap", optional).streams  # of which some may be absent
    np.testing.assert_array_equal(pose.stamps, STAMPS)
    np.testing.assert_array_equal(pose.values[:, 0], STAMPS)


def bag(messages, empty=()):
    return lambda path: write_bag(path, messages, empty)


def foreign(definition, content, kind=("geometry_msgs/msg/Pose", "ros2msg", "cdr")):
    name, language, encoding = kind
    return lambda path: foreign_bag(path, (name, language, definition), [(1, content)], encoding)


def cdr(length):
    return b"\x00\x01\x00\x00" + bytes(length)


JSON, TWICE = ("Pose", "jsonschema", "json"), topic_map(pose="/tool", joint_states=("/a", "/b"))
EMPTY, WRENCHES = topic_map(pose="/tool", wrench="/empty"), [("/empty", "geometry_msgs/msg/WrenchStamped")]


@pytest.mark.parametrize(
    ("write", "topics", "complaint"),
    [
        (lambda path: None, TOOL, "cannot be read: No such file"),
        (lambda path: path.mkdir(), TOOL, "cannot be read: not a file"),
        *(
            (lambda path, content=content: path.write_bytes(content), TOOL, "not an MCAP file")
            for content in (b"", b"\x89MCAP", b"time,x\n0,1\n" * 100)
        ),
        (bag([]), OWN_TOPICS, "has no topic '/pose' for pose; it has no topics"),
        (bag(POSES), OWN_TOPICS, f"has no topic '/pose' for pose; {THERE}"),
        (bag(POSES, WRENCHES), EMPTY, "topic '/empty' has no messages"),
        (bag(POSES + JOINT_STATES), TWICE, "joint_positions come from several topics: /a, /b"),
        (
            foreign(b"{}", b"{}", JSON),
            TOOL,
            r"topic '/tool' has messages of type Pose \[json, jsonschema: not",
        ),
        (foreign(b"float64 x\n", cdr(8)), TOOL, "topic '/tool': a message lacks a field of its type"),
        *(
            (foreign(POSE.encode(), cdr(56)[:length]), TOOL, "topic '/tool': damaged message: error: unpack")
            for length in (4, 12, 59)
        ),
    ],
)
def test_a_file_that_cannot_be_read_is_named_with_its_fault(tmp_path, write, topics, complaint):
    write(tmp_path / "bag.mcap")
    with pytest.raises(InputError, match=rf"bag\.mcap: {complaint}"):
        read_recording(tmp_path / "bag.mcap", topics)


TIMES = [1_700_000_000 * 10**9 + 5_000_001 * row for row in range(12)]
HAND = pose_rows(12)
ANGLES = np.arange(24.0).reshape(12, 2)
TOPICS = topic_map(pose="/tool", joint_states="/joint_states")


@pytest.fixture
def plain(tmp_path):
    """The bag as MCAP: poses, and joint states."""
    path = tmp_path / "plain.mcap"
    write_bag(path, [*pose_messages(TIMES, HAND), *joint_messages(TIMES, ["a", "b"], ANGLES)])
    return path


def assert_same(recording):
    pose, joints = recording.streams
    for stream in (pose, joints):
        np.testing.assert_array_equal(stream.stamps, TIMES)
    np.testing.assert_array_equal(pose.values, HAND)
    np.testing.assert_array_equal(joints.values, ANGLES)
    assert joints.joints == ("a", "b")


def test_a_file_that_is_compressed_as_a_whole(plain, tmp_path):
    packed = zstandard.compress(plain.read_bytes())
    path = tmp_path / "take.mcap.zstd"
    path.write_bytes(packed)
    recording = read_recording(path, TOPICS)
    assert_same(recording)
    assert (recording.name, recording.provenance["source"]) == ("take", "take.mcap.zstd")
    assert [file.name for file in recording_files(tmp_path)] == ["plain", "take"]
    for content, complaint in (
        (packed[:-9], "(the zstd file is cut off|damaged)"),
        (b"no frame at all", "damaged zstd file"),
        (zstandard.compress(b"no MCAP"), "not an MCAP file"),
    ):
        path.write_bytes(content)
        with pytest.raises(InputError, match=rf"take\.mcap\.zstd: {complaint}"):
            read_recording(path, TOPICS)


@pytest.mark.parametrize("compression", CompressionType)
def test_messages_that_are_compressed_one_by_one(plain, tmp_path, compression):
    bag = open_bag(as_recording_file(plain), ["/tool"])
    raw = bag.messages["/tool"]
    packed = [zstandard.compress(message) for message in raw.data]

    kind = "geometry_msgs/msg/PoseStamped"
    schema = (kind, "ros2msg", definition(kind).encode())

    def read(data):
        messages = list(zip(TIMES, data, strict=True))
        path = foreign_bag(tmp_path / "take.mcap", schema, messages, compression=compression)
        return read_recording(path, topic_map(pose="/tool"))

    (pose,) = read(packed).streams
    np.testing.assert_array_equal(pose.values, HAND)
    packed[3] = packed[3][:-5]
    with pytest.raises(InputError, match=r"take\.mcap: damaged MCAP file: ZstdError"):
        read(packed)
    bomb = b"\x28\xb5\x2f\xfd\xe0" + (2**60).to_bytes(8, "little")
    with pytest.raises(InputError, match="it unpacks to more than"):
        read([bomb, *packed[1:]])


def test_files_are_taken_by_their_kind(plain, tmp_path):
    for name in ("take.db3", "old.bag", "extra.csv", ".hidden.mcap", "notes.md", "obstacles.csv"):
        (tmp_path / name).touch()
    found = {file.name: file.format for file in recording_files(tmp_path)}
    assert found == {"plain": "mcap", "take": "db3", "old": "bag"}  # a table beside bags is none of them
    for path in [*tmp_path.glob("*.db3"), *tmp_path.glob("*.bag"), plain]:
        path.unlink()
    assert [(file.name, file.format) for file in recording_files(tmp_path)] == [("extra", "table")]
    (tmp_path / "take").mkdir()
    for name in ("metadata.yaml", "take_0.db3", "take_0.mcap"):
        (tmp_path / "take" / name).touch()
    with pytest.raises(InputError, match="take: the bag has files of several kinds: db3, mcap"):
        recording_files(tmp_path)


@pytest.mark.parametrize("name", ["take.db3", "take.bag"])
def test_without_the_extra_it_is_said_how_to_get_it(tmp_path, monkeypatch, name):
    for module in ("rosbags", "rosbags.highlevel", "rosbags.rosbag1"):
        monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / name).touch()
    with pytest.raises(InputError, match=rf"{name}: .* `rosbags`, .*: `pip install 'structlearn"):
        read_recordings(tmp_path, TOPICS)


@pytest.mark.parametrize("mode", ["plain", "message", "file", "old"])
def test_a_bag_in_the_older_storage_of_ros_2(tmp_path, mode):
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, Writer

    writer = Writer(tmp_path / "take", version=9)
    if mode in ("message", "file"):
        writer.set_compression(CompressionMode[mode.upper()], CompressionFormat.ZSTD)
    write_older(writer, TIMES, HAND, ANGLES, ros1=False)
    (path,) = (tmp_path / "take").glob("take*.db3*")
    if mode == "old":  # before Iron there were no definitions in the file
        import apsw

        apsw.Connection(str(path)).execute("DELETE FROM message_definitions")
    (recording,) = read_recordings(tmp_path, TOPICS)
    assert_same(recording)
    assert recording.name == "take"
    assert_same(read_recording(path, TOPICS))  # without its folder
    assert set(open_bag(as_recording_file(path), []).topics) == {"/tool", "/joint_states", "/chatter"}


def test_a_bag_of_ros_1(tmp_path):
    from rosbags.rosbag1 import Writer

    write_older(Writer(tmp_path / "take.bag"), TIMES, HAND, ANGLES, ros1=True)
    (recording,) = read_recordings(tmp_path, TOPICS)
    assert_same(recording)
    assert recording.provenance == {"origin": "recorded", "source": "take.bag"}
    with pytest.raises(
        InputError, match=r"take\.bag: has no topic '/wrist' for wrench; it has /chatter \(std"
    ):
        read_recordings(tmp_path, topic_map(pose="/tool", wrench="/wrist"))
