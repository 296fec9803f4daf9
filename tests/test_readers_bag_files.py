"""Bags of every format and compression, written by other programs, give what the same MCAP file gives."""

import sys

import numpy as np
import pytest
import zstandard
from committed import topic_map
from mcap.writer import CompressionType
from readers_bags import foreign_bag, joint_messages, pose_messages, pose_rows, write_bag, write_older

from structlearn.core.errors import InputError
from structlearn.readers import read_recording, read_recordings
from structlearn.readers.bag_recording import open_bag
from structlearn.readers.messages import definition
from structlearn.readers.source import as_recording_file, recording_files

STAMPS = [1_700_000_000 * 10**9 + 5_000_001 * row for row in range(12)]
POSES = pose_rows(12)
ANGLES = np.arange(24.0).reshape(12, 2)
TOPICS = topic_map(pose="/tool", joint_states="/joint_states")


@pytest.fixture
def plain(tmp_path):
    """The bag as MCAP: poses, and joint states."""
    path = tmp_path / "plain.mcap"
    write_bag(path, [*pose_messages(STAMPS, POSES), *joint_messages(STAMPS, ["a", "b"], ANGLES)])
    return path


def assert_same(recording):
    pose, joints = recording.streams
    for stream in (pose, joints):
        np.testing.assert_array_equal(stream.stamps, STAMPS)
    np.testing.assert_array_equal(pose.values, POSES)
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
        messages = list(zip(STAMPS, data, strict=True))
        path = foreign_bag(tmp_path / "take.mcap", schema, messages, compression=compression)
        return read_recording(path, topic_map(pose="/tool"))

    (pose,) = read(packed).streams
    np.testing.assert_array_equal(pose.values, POSES)
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
    with pytest.raises(InputError, match=rf"{name}: .* `rosbags`, .*: `make own` installs it, or `pip inst"):
        read_recordings(tmp_path, TOPICS)


@pytest.mark.parametrize("mode", ["plain", "message", "file", "old"])
def test_a_bag_in_the_older_storage_of_ros_2(tmp_path, mode):
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, Writer

    writer = Writer(tmp_path / "take", version=9)
    if mode in ("message", "file"):
        writer.set_compression(CompressionMode[mode.upper()], CompressionFormat.ZSTD)
    write_older(writer, STAMPS, POSES, ANGLES, ros1=False)
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

    write_older(Writer(tmp_path / "take.bag"), STAMPS, POSES, ANGLES, ros1=True)
    (recording,) = read_recordings(tmp_path, TOPICS)
    assert_same(recording)
    assert recording.provenance == {"origin": "recorded", "source": "take.bag"}
    with pytest.raises(
        InputError, match=r"take\.bag: has no topic '/wrist' for wrench; it has /chatter \(std"
    ):
        read_recordings(tmp_path, topic_map(pose="/tool", wrench="/wrist"))
