"""Shapes beside a movement: written as markers, read from ours and from a user's bag."""

from dataclasses import replace

import numpy as np
import pytest
from committed import topic_map
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from readers_bags import make_recording, pose_messages, pose_rows, ros_pose, write_bag

from structlearn.core.errors import InputError
from structlearn.readers import read_recording, synchronise, write_recording
from structlearn.readers.demonstration import NamedShape
from structlearn.readers.source import SceneTopicMap

TURNED, SIZES = np.array([0.6, 0.0, 0.0, 0.8]), np.array([0.2, 0.1, 0.3])
SHAPES = (
    NamedShape("box", "cube", np.array([0.1, 0.2, 0.3]), TURNED, SIZES),
    NamedShape("ball", "sphere", np.array([-0.1, 0.0, 1.0]), np.array([1.0, 0, 0, 0]), np.full(3, 0.05)),
)


def marker(space, number, kind, size=0.1):
    row = [0.5, 0.0, 0.1 * number, 2.0, 0.0, 0.0, 0.0]  # a quaternion that is not of unit length
    scale = dict.fromkeys("xyz", size)
    return {"ns": space, "id": number, "type": kind, "pose": ros_pose(row), "scale": scale}


def user_bag(path, messages):
    """Two poses and messages of markers, as another program writes them."""
    rows = pose_messages([10**9, 2 * 10**9], pose_rows(2))
    rows += [("/world", "visualization_msgs/msg/MarkerArray", {"markers": one}, 10**9) for one in messages]
    write_bag(path, rows)
    return read_recording(path, SceneTopicMap(**topic_map(pose="/tool").model_dump(), obstacles="/world"))


def test_shapes_survive_the_file_and_the_clock(tmp_path):
    recording = replace(make_recording(), shapes=SHAPES)
    write_recording(recording, tmp_path / "demo.mcap")
    read = read_recording(tmp_path / "demo.mcap")
    for found in (read, synchronise(read)):
        for one, shape in zip(found.shapes, SHAPES, strict=True):
            assert (one.name, one.form) == (shape.name, shape.form)
            for field in ("position", "orientation", "size"):
                assert np.array_equal(getattr(one, field), getattr(shape, field))


def test_other_programs_read_our_markers(tmp_path):
    write_recording(replace(make_recording(), shapes=SHAPES), tmp_path / "demo.mcap")
    with open(tmp_path / "demo.mcap", "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        ((schema, _, _, message),) = reader.iter_decoded_messages(topics=["/obstacles"])
    assert schema.name == "visualization_msgs/msg/MarkerArray"
    first, second = message.markers
    assert (first.ns, first.type, second.ns, second.type) == ("box", 1, "ball", 2)
    assert (first.pose.orientation.w, first.pose.orientation.z) == (0.6, 0.8)
    assert first.color.a == 1.0
    assert second.scale.x == 0.05


def test_a_users_markers_are_read(tmp_path):
    solids = [marker(*one) for one in (("wall", 1, 1), ("wall", 2, 1), ("can", 0, 3), ("label", 0, 9))]
    found = user_bag(tmp_path / "bag.mcap", [solids, []])  # the first message counts
    forms = {"wall 1": "cube", "wall 2": "cube", "can": "cylinder"}
    assert {shape.name: shape.form for shape in found.shapes} == forms
    assert found.shapes[1].position.tolist() == [0.5, 0.0, 0.2]
    assert found.shapes[0].orientation.tolist() == [1.0, 0.0, 0.0, 0.0]
    with pytest.raises(InputError, match=r"'/world': shape 'can' needs a finite pose and a positive size"):
        user_bag(tmp_path / "bag.mcap", [[marker("can", 0, 3, size=0.0)]])
    with pytest.raises(InputError, match="demo: several shapes have the name box"):
        write_recording(replace(make_recording(), shapes=SHAPES[:1] * 2), tmp_path / "demo.mcap")
