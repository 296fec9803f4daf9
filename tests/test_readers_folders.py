"""Sets of recordings: files, folders, names, and folders that are called like their setting."""

import re

import numpy as np
import pytest
from committed import topic_map
from pydantic import ValidationError
from readers_bags import make_recording, pose_messages, pose_rows, write_bag

from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.readers import read_demonstrations, read_recordings, write_recordings
from structlearn.readers.source import Setting, setting_label
from structlearn.tasks.task_import import setting_folders

STAMPS = [10**9 + row * 10**7 for row in range(5)]
TOOL = topic_map(pose="/tool")


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
