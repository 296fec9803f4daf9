"""Sets of recordings: folders, names, tables of runs, and shapes beside a movement."""

import dataclasses
import re
import weakref
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet
import pytest
from committed import topic_map
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from pydantic import ValidationError
from readers_bags import make_recording, pose_messages, pose_rows, ros_pose, write_bag

from structlearn.core.artefacts import write_arrow
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.readers import (
    read_demonstrations,
    read_recording,
    read_recordings,
    synchronise,
    write_recording,
    write_recordings,
)
from structlearn.readers.demonstration import (
    SIGNAL_UNITS,
    UNIT,
    Demonstration,
    NamedShape,
    read_about,
    read_runs,
    write_runs,
)
from structlearn.readers.source import SceneTopicMap, Setting, setting_label
from structlearn.tasks.movement.recordings import setting_folders
from structlearn.tasks.task_import import on_clock

STAMPS = [10**9 + row * 10**7 for row in range(5)]
TOOL = topic_map(pose="/tool")
LAB = SimpleNamespace(source="bags", skips_failures=False)


def bag(path, seed=0):
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bag(path, pose_messages(STAMPS, pose_rows(5, seed)))


def ros2_bag(folder, files=1):
    for part in range(files):
        bag(folder / f"{folder.name}_{part}.mcap")
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")


def test_numbers_as_names_are_padded_and_come_in_their_order(tmp_path):
    recordings = [make_recording(name, count=4) for name in ("2", "10", "1", "prim1")]
    write_recordings(recordings, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["01.mcap", "02.mcap", "10.mcap", "prim1.mcap"]
    assert [d.name for d in read_demonstrations(tmp_path)] == ["01", "02", "10", "prim1"]


def test_a_file_a_ros_2_bag_and_a_folder_of_them(tmp_path):
    for name in ("take_2", "take_10"):
        ros2_bag(tmp_path / name)
    bag(tmp_path / "reach.mcap")
    (demonstration,) = read_demonstrations(str(tmp_path / "reach.mcap"), TOOL, rate_hz=200)
    assert (demonstration.name, demonstration.dt) == ("reach", pytest.approx(0.005))
    (tmp_path / "reach.mcap").unlink()
    (demonstration,) = read_demonstrations(tmp_path / "take_2", TOOL)
    assert demonstration.name == "take_2_0"
    assert [d.name for d in read_demonstrations(tmp_path, TOOL)] == ["take_2_0", "take_10_0"]


def test_a_bag_in_several_files_is_one_demonstration(tmp_path):
    rows = pose_rows(6)
    stamps = [10**9 + row * 10**7 for row in range(6)]
    (tmp_path / "long").mkdir()
    for name, part in (("long_10", slice(4, 6)), ("long_2", slice(2, 4)), ("long_1", slice(2))):
        write_bag(tmp_path / "long" / f"{name}.mcap", pose_messages(stamps[part], rows[part]))
    listing = "rosbag2_bagfile_information:\n  relative_file_paths: [long/long_1.mcap, long_2.mcap"
    (tmp_path / "long" / "metadata.yaml").write_text(f"{listing}, long_10.mcap]\n")
    for source in (tmp_path / "long", tmp_path):
        (recording,) = read_recordings(source, TOOL)
        assert (recording.name, recording.provenance["source"]) == ("long", "long")
        np.testing.assert_array_equal(recording.streams[0].stamps, stamps)
        np.testing.assert_array_equal(recording.streams[0].values, rows)
    (tmp_path / "long" / "metadata.yaml").write_text(f"{listing}, long_3.mcap]\n")
    with pytest.raises(InputError, match=r"long: the bag's file long_3\.mcap, which metadata\.yaml names"):
        read_recordings(tmp_path, TOOL)


def test_missing_and_empty_sources(tmp_path):
    (tmp_path / "notes.txt").write_text("not a bag")
    for source, complaint in (
        ("nowhere", "nowhere: no such file"),
        ("", r"no bag \(\.mcap, .* and no table"),
    ):
        with pytest.raises(InputError, match=complaint):
            read_demonstrations(tmp_path / source)


@pytest.mark.parametrize(
    ("names", "complaint"),
    [
        (["a", "a"], "several recordings have the name a"),
        (["1", "01"], "several recordings have the name 01"),
        *(
            ([name], f"{re.escape(repr(name))} cannot be a name")
            for name in ("../a", "a/b", "", "$x^{$", "=1+1")
        ),
    ],
)
def test_names_must_be_file_names_of_their_own(tmp_path, names, complaint):
    with pytest.raises(InputError, match=complaint):
        write_recordings([make_recording(name, count=4) for name in names], tmp_path)


class Own(Parameters):
    settings: tuple[Setting, ...]


@pytest.mark.parametrize(
    ("written", "label"),
    [
        *((one, "5") for one in ("5", "5.0", 5, 5.0, "+5")),
        *((one, "-2.5") for one in (-2.5, "-2.50")),
        *((one, one) for one in ("tilt_left", "6.3", "nan")),
        ("-0", "0"),
    ],
)
def test_numbers_are_one_setting_however_they_are_written(written, label):
    assert setting_label(written) == label
    assert Own(settings=[written]).settings == (label,)


@pytest.mark.parametrize("wrong", [True, None, [5], "../5", "", "=5"])
def test_what_is_no_label_is_refused(wrong):
    with pytest.raises(ValidationError):
        Own(settings=[wrong])


def test_folders_of_settings_come_by_label_those_that_are_named_first(tmp_path):
    for name in ("10", "5.0", "tilt_left", ".git", "7.5"):
        (tmp_path / name).mkdir()
    found = setting_folders(tmp_path, ["tilt_left", "5"])
    assert list(found) == ["tilt_left", "5", "10", "7.5"]
    assert found["5"] == tmp_path / "5.0"
    with pytest.raises(InputError, match=r"recorded in the setting 6, up; there are 10, 5, 7\.5, tilt_left"):
        setting_folders(tmp_path, ["5", "6", "up"])
    with pytest.raises(InputError, match="nowhere: no such folder"):
        setting_folders(tmp_path / "nowhere", [])
    (tmp_path / "5").mkdir()
    with pytest.raises(InputError, match=r"5\.0: the setting 5 has another folder, 5, too"):
        setting_folders(tmp_path, ["5"])


def _runs() -> list[Demonstration]:
    rng = np.random.default_rng(3)
    shape = NamedShape("box", "cube", np.zeros(3), np.array([1.0, 0, 0, 0]), np.ones(3))
    full = Demonstration(
        name="2",
        time=np.arange(5) / 100,
        position=rng.normal(size=(5, 3)),
        orientation=np.tile([1.0, 0, 0, 0], (5, 1)),
        wrench=rng.normal(size=(5, 6)),
        tactile=np.round(rng.normal(size=(5, 12)) * 100),
        joint_positions=rng.normal(size=(5, 2)),
        joint_names=("a", "b"),
        true_segments=np.array([[0.0, 0.1], [0.1, 1 / 3]]),
        provenance={"origin": "simulated", "person": "1"},
        shapes=(shape,),
    )
    bare = Demonstration(name="10", time=np.arange(3) / 7, position=rng.normal(size=(3, 3)))
    return [full, bare]


def test_runs_come_back_bit_for_bit(tmp_path):
    write_runs([], tmp_path / "none.parquet")
    assert read_runs(tmp_path / "none.parquet") == []
    write_runs(_runs(), tmp_path / "runs.parquet")
    schema = pyarrow.parquet.read_schema(tmp_path / "runs.parquet")
    for column, unit in (("time", b"s"), ("position.x", b"m"), ("joint_positions.1", b"rad")):
        assert schema.field(column).metadata[UNIT] == unit
    for before, after in zip(_runs(), read_runs(tmp_path / "runs.parquet"), strict=True):
        for field in dataclasses.fields(before):
            its, their = getattr(before, field.name), getattr(after, field.name)
            if isinstance(its, np.ndarray):
                assert np.array_equal(its, their)
                assert their.dtype == its.dtype
                assert their.flags.c_contiguous
            else:
                assert str(its) == str(their)


def test_sets_larger_than_a_row_group_come_back_with_the_signals_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr("structlearn.readers.demonstration.GROUP_ROWS", 6)
    full, bare = _runs()
    runs = [bare, dataclasses.replace(bare, name="11"), full, dataclasses.replace(bare, name="12")]
    path = tmp_path / "runs.parquet"
    write_runs(iter(runs), path)
    assert pyarrow.parquet.ParquetFile(path).num_row_groups == 2  # the second one has more columns
    assert not list(tmp_path.glob(".publish*"))
    for before, after in zip(runs, read_runs(path), strict=True):
        for signal in ("time", *SIGNAL_UNITS):
            its, their = getattr(before, signal), getattr(after, signal)
            assert np.array_equal(its, their) if their is not None else its is None
    for before, after in zip(runs, read_runs(path, ["wrench"]), strict=True):
        assert np.array_equal(before.position, after.position)
        assert (after.wrench is None) == (before.wrench is None)
        assert after.orientation is after.tactile is None
        assert (after.joint_names, after.provenance) == (before.joint_names, before.provenance)
    assert list(read_about(path)) == [run.name for run in runs]
    write_runs(read_runs(path), tmp_path / "again.parquet")
    assert path.read_bytes() == (tmp_path / "again.parquet").read_bytes()


def test_an_import_has_one_recording_in_memory_and_leaves_nothing_behind(tmp_path, monkeypatch):
    monkeypatch.setattr("structlearn.readers.demonstration.GROUP_ROWS", 1)
    read = []

    def recordings():
        for number in range(4):
            assert all(stream() is None for stream in read), "an earlier recording is still in memory"
            recording = make_recording(str(number), count=30)
            read.extend(weakref.ref(stream) for stream in recording.streams)
            yield recording
            del recording
        raise InputError("the fifth cannot be read")

    with pytest.raises(InputError, match="the fifth cannot be read"):
        write_runs(on_clock(LAB, recordings(), None, {}), tmp_path / "runs.parquet")
    assert len(read) > 4
    assert not list(tmp_path.iterdir())


def test_another_table_and_changed_provenance_are_refused(tmp_path):
    path = tmp_path / "runs.parquet"
    write_arrow(pyarrow.table({"a": [1]}), path)
    with pytest.raises(InputError, match="holds no runs"):
        read_runs(path)
    write_runs(_runs(), path)
    table = pyarrow.parquet.read_table(path)
    metadata = {key: value.replace(b"simulated", b"recorded") for key, value in table.schema.metadata.items()}
    pyarrow.parquet.write_table(table.replace_schema_metadata(metadata), path, write_page_checksum=True)
    with pytest.raises(InputError, match="damaged"):
        read_runs(path)


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
