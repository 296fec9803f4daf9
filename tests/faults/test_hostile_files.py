"""Hostile and oversized files: each is refused in one line, within bounds on memory and time."""

import json
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet
import pytest
import zstandard
from committed import topic_map
from faults import forged_skills
from faults.trial import NAMED, outcome
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, Footer
from mcap.writer import MCAP0_MAGIC, Writer
from readers_bags import foreign_bag, joint_messages, pose_messages, pose_rows, write_bag
from readers_sets import write_dataset, write_kuka
from rosbags import rosbag1
from rosbags.typesys import Stores, get_typestore

from dissertation.recorded.readers import kuka_lwr4
from dissertation.recorded.readers.ur10e import read_motion
from structlearn.core import used_files
from structlearn.core.artefacts import read_metrics, read_tensors, write_tensors
from structlearn.core.params import read_values
from structlearn.feedback.skill_file import KIND, read_skill
from structlearn.readers import read_demonstrations, read_recording
from structlearn.readers.foreign_tables import read_stamped_table
from structlearn.readers.lerobot import read_movement
from structlearn.rigid_body.robot import read_urdf

STAMPS = (10**9 + 10_000_000 * np.arange(4)).tolist()


def _columns(path: Path) -> None:
    names = ["time_s", "x", "y", "z", *(f"position.j{number}" for number in range(100_000))]
    path.write_text("\n".join([",".join(names), *(",".join([f"0.0{row}", *"0" * 100_003]) for row in "12")]))


def _joints(path: Path) -> None:
    names = [f"j{number}" for number in range(100_000)]
    write_bag(
        path, pose_messages(STAMPS, pose_rows(4)) + joint_messages(STAMPS[:1], names, [[0.0] * 100_000])
    )


def _chunks(path: Path) -> None:
    """3 chunks of 200 MB, each as large as it says, of a record that nobody knows."""
    builder, size = RecordBuilder(), 2 * 10**8
    packed = zstandard.compress(b"\x80" + size.to_bytes(8, "little") + bytes(size))
    for _ in range(3):
        Chunk("zstd", packed, 0, 0, 0, size + 9).write(builder)
    Footer(0, 0, 0).write(builder)
    path.write_bytes(MCAP0_MAGIC + builder.end() + MCAP0_MAGIC)


def _packed(path: Path) -> None:
    path.write_bytes(zstandard.compress(bytes(6 * 10**8)))


def _sparse(path: Path) -> None:
    path.touch()
    os.truncate(path, 200 * 10**9)


def _rows(path: Path) -> None:
    """A small file with 200 million values."""
    columns = dict.fromkeys(["time_s", "x", "y", "z"], pyarrow.nulls(5 * 10**7))
    pyarrow.parquet.write_table(pyarrow.table(columns), path)


def _noted(path: Path) -> None:
    """A table whose notes for pandas name a type of numbers that numpy lacks."""
    table = pyarrow.Table.from_pandas(pd.DataFrame(np.zeros((3, 4)), columns=["time_s", "x", "y", "z"]))
    notes = {key: its.replace(b"float64", b"F8_E4M3") for key, its in table.schema.metadata.items()}
    pyarrow.parquet.write_table(table.replace_schema_metadata(notes), path)


def _long(path: Path) -> None:
    """A skill with an absurd duration."""
    forged_skills.write(path)
    tensors = read_tensors(path)
    tensors["primitives.tilt.position.local.duration"] = np.array(1e300)
    forged_skills.sign(path, tensors)


def _deep(path: Path) -> None:
    write_tensors({"a": np.zeros(1)}, path, f'{{"{KIND}": ' + "[" * 100_000)


def _strange(path: Path) -> None:
    """A number type that numpy lacks."""
    header = json.dumps({"a": {"dtype": "F8_E4M3", "shape": [1], "data_offsets": [0, 1]}}).encode()
    signed = json.dumps({"__metadata__": {"description": "x\nsha256 0"}, **json.loads(header)}).encode()
    path.write_bytes(len(signed).to_bytes(8, "little") + signed + b"\0")


def _robot(encoding: str = "utf-8", inside: str = "") -> str:
    space = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
    return (
        f'<?xml version="1.0" encoding="{encoding}"?><robot name="r" {space}><link name="a"/>{inside}</robot>'
    )


def _bombed(path: Path) -> None:
    """A bag of ROS 1 with a chunk of 140 MB in half a megabyte."""
    store = get_typestore(Stores.ROS1_NOETIC)
    kind = "std_msgs/msg/String"
    writer = rosbag1.Writer(path)
    writer.set_compression(rosbag1.Writer.CompressionFormat.LZ4)
    with writer:
        topic = writer.add_connection("/tool", kind, typestore=store)
        writer.write(topic, 1, store.serialize_ros1(store.types[kind]("x" * 14 * 10**7), kind))


def _endless(path: Path) -> None:
    """Four thousand million elements that take no bytes."""
    definition = "Nothing[4000000000] many\nMSG: geometry_msgs/Nothing\nuint8[0] none"
    schema = ("geometry_msgs/msg/PoseStamped", "ros2msg", definition.encode())
    foreign_bag(path, schema, [(5, b"\0\1\0\0" + bytes(100))])


def _types(path: Path) -> None:
    """A topic with ten thousand types of messages."""
    writer = Writer(path.open("wb"))
    writer.start(profile="ros2")
    for number in range(10_000):
        writer.register_channel("/tool", "cdr", writer.register_schema(f"a/T{number}", "ros2msg", b"uint8 x"))
    writer.finish()


def _links(path: Path) -> None:
    joint = (
        '<joint name="j{0}" type="fixed"><parent link="l{0}"/><child link="l{1}"/></joint><link name="l{1}"/>'
    )
    inside = "".join(joint.format(number, number + 1) for number in range(30_000))
    path.write_text(_robot(inside=f'<link name="l0"/>{inside}'))


def _archive(path: Path, place: int, value: bytes) -> None:
    """Arrays in a zip file, of which something in the list of its entries is changed."""
    write_kuka(path.parent, path.stem)
    content = bytearray(path.read_bytes())
    begin = content.index(b"PK\x01\x02") + place
    content[begin : begin + len(value)] = value
    path.write_bytes(content)


def _read_dataset(path: Path) -> list:
    return read_movement(path, SimpleNamespace(topics=topic_map(pose="pose")), {})


def _read_arrays(path: Path) -> list:
    return kuka_lwr4.read_motion(path.parent)


def _read_tool(path: Path) -> Any:
    return read_recording(path, TOOL)


def _read_table(path: Path) -> Any:
    return read_recording(path, TABLE)


TABLE = topic_map(pose="/pose", joint_states="/joint_states")
TOOL = topic_map(pose="/tool", joint_states="/joint_states")
FILES = {
    "columns.csv": (_columns, _read_table, "has 100003 columns, more than"),
    "joints.mcap": (_joints, _read_tool, "names 100000 joints, more than"),
    "chunks.mcap": (_chunks, _read_tool, "it unpacks to more than"),
    "packed.mcap.zstd": (_packed, _read_tool, "it unpacks to more than"),
    "bombed.bag": (_bombed, _read_tool, "a chunk of more than"),
    "endless.mcap": (_endless, _read_tool, "lacks geometry_msgs/Nothing"),
    "types.mcap": (_types, _read_tool, "messages of several types"),
    "links.urdf": (_links, read_urdf, "has 30000 joints, more than"),
    "rows.parquet": (_rows, _read_table, "has 50000000 rows of 4 columns"),
    "noted.parquet": (_noted, _read_table, "data type 'F8_E4M3' not understood"),
    "sparse.csv": (_sparse, _read_table, "has 200000000000 bytes, more than"),
    "sparse.txt": (_sparse, lambda path: read_stamped_table(path, 4), "has 200000000000 bytes, more than"),
    "sparse.json": (_sparse, read_metrics, "has 200000000000 bytes, more than"),
    **{
        f"pipe.{suffix}": (os.mkfifo, lambda path: read_demonstrations(path.parent, TABLE), "not a file")
        for suffix in ("csv", "mcap", "bag")
    },
    "ur-pipe.csv": (os.mkfifo, lambda path: read_motion(path.parent), "not a file"),
    "measurements_3.npz": (os.mkfifo, _read_arrays, "not a file"),
    "pipe.safetensors": (os.mkfifo, read_tensors, "not a file"),
    "pipe.urdf": (os.mkfifo, read_urdf, "not a file"),
    "pipe.yaml": (os.mkfifo, read_values, "not a file"),
    "metrics.json": (os.mkfifo, read_metrics, "not a file"),
    "measurements_1.npz": (
        lambda path: _archive(path, 24, b"\0\0\0\x7f"), _read_arrays, "it unpacks to more than"
    ),
    "measurements_2.npz": (lambda path: _archive(path, 8, b"\1"), _read_arrays, "is encrypted"),
    "names": (lambda path: write_dataset(path, features={"pose": {"names": 3}}), _read_dataset, "TypeError"),
    "nested": (
        lambda path: (write_dataset(path), (path / "meta/info.json").write_text("[" * 100_000)),
        _read_dataset, "not the description of a LeRobotDataset",
    ),
    "rate": (lambda path: write_dataset(path, fps=1e-300), _read_dataset, "must be positive"),
    "words": (lambda path: write_dataset(path, {"pose": ["a", "b", "c"]}), _read_dataset, "ValueError"),
    "ragged": (
        lambda path: write_dataset(path, {"pose": [np.zeros(3), np.zeros(2), None]}),
        _read_dataset, "ValueError",
    ),
    "frames": (
        lambda path: write_dataset(path, {"frame_index": [0.0, np.nan, 1.0]}),
        _read_dataset, "no whole number",
    ),
    "metadata.yaml": (
        lambda path: path.write_text("a: " + "[" * 100_000 + "]" * 100_000),
        lambda path: read_demonstrations(path.parent), "nested too deeply",
    ),
    "home": (lambda path: None, lambda path: read_demonstrations("~nobody-home/x"), "no such home folder"),
    "long.safetensors": (_long, read_skill, "duration holds 1e+300"),
    "deep.safetensors": (_deep, read_skill, "holds no skill"),
    "strange.safetensors": (_strange, read_skill, "not a readable safetensors file"),
    "encoding.urdf": (lambda path: path.write_text(_robot("utf-7")), read_urdf, "not an XML file"),
    "no-encoding.urdf": (lambda path: path.write_text(_robot("none")), read_urdf, "not an XML file"),
    "xacro.urdf": (
        lambda path: path.write_text(_robot(inside='<xacro:include filename="arm.urdf"/>')),
        read_urdf, "expand it first",
    ),
}  # fmt: skip
"""By the file's name: how it is written and read, and the message."""


@pytest.mark.parametrize("name", FILES)
def test_each_is_refused_in_one_line(tmp_path, monkeypatch, name):
    monkeypatch.setattr(used_files, "LARGEST", 2**29)  # at least the memory of a trial
    write, read, words = FILES[name]
    write(tmp_path / name)
    came, said = outcome(read, tmp_path / name, "")
    assert came == NAMED, said
    assert words in said
