"""Tables of those without ROS, of poses and of shapes, and text that others wrote."""

import hashlib

import numpy as np
import pandas as pd
import pytest
from committed import topic_map
from hypothesis import given
from hypothesis import strategies as st
from readers_bags import pose_messages, pose_rows, write_bag

from structlearn.core.errors import InputError
from structlearn.readers import read_demonstrations, read_recording, read_recordings
from structlearn.readers.foreign_tables import PublicSet, read_stamped_table, read_text_table, uniform_stamps
from structlearn.readers.user_tables import TABLE_TOPICS

TIMES = ["1700000000.000000001", "1700000000.01", "1700000000.02", "1700000000.03"]
POSES = pose_rows(4)
POSE = ["x", "y", "z", "qw", "qx", "qy", "qz"]
ALL = topic_map(**TABLE_TOPICS)
SHAPES = "name,form,x,y,z,qw,qx,qy,qz,sx,sy,sz\n"


def csv(path, columns, rows, times=TIMES):
    lines = [",".join(["time_s", *columns])]
    lines += [",".join([time, *map(repr, map(float, row))]) for time, row in zip(times, rows, strict=True)]
    path.write_text("\n".join(lines) + "\n")


def test_a_table_with_everything(tmp_path):
    wrench, angles = np.arange(24.0).reshape(4, 6), np.arange(8.0).reshape(4, 2)
    columns = [*POSE, "fx", "fy", "fz", "tx", "ty", "tz", "position.a", "effort.a", "effort.b", "position.b"]
    rows = np.hstack([POSES, wrench, angles[:, :1], -angles, angles[:, 1:]])
    csv(tmp_path / "take.csv", columns, rows)
    recording = read_recording(tmp_path / "take.csv", ALL)
    pose, positions, torques, force = recording.streams
    nanoseconds = [1_700_000_000 * 10**9 + late for late in (1, 10**7, 2 * 10**7, 3 * 10**7)]
    for stream in recording.streams:
        np.testing.assert_array_equal(stream.stamps, nanoseconds)
    np.testing.assert_array_equal(pose.values, POSES)
    np.testing.assert_array_equal(force.values, wrench)
    np.testing.assert_array_equal(positions.values, angles)
    np.testing.assert_array_equal(torques.values, -angles)
    assert recording.joint_names == ("a", "b")
    assert recording.provenance == {"origin": "recorded", "source": "take.csv"}


def test_a_table_without_quaternions_has_no_orientation(tmp_path):
    csv(tmp_path / "take.csv", ["z", "y", "x"], POSES[:, 2::-1])
    (demonstration,) = read_demonstrations(tmp_path, topic_map(pose="/pose"), rate_hz=100)
    assert demonstration.orientation is None
    assert demonstration.provenance["orientation"] == "not recorded"
    np.testing.assert_allclose(demonstration.position[0], POSES[0, :3], atol=1e-9)


def test_parquet_is_the_same_table(tmp_path):
    table = pd.DataFrame(POSES, columns=POSE)
    table.insert(0, "time_s", [0.5, 0.51, 0.52, 0.53])
    table.to_parquet(tmp_path / "take.parquet")
    (recording,) = read_recordings(tmp_path, topic_map(pose="/pose"))
    np.testing.assert_array_equal(recording.streams[0].stamps, [5 * 10**8 + row * 10**7 for row in range(4)])
    np.testing.assert_array_equal(recording.streams[0].values, POSES)
    table.loc[2, "y"] = np.nan
    table.to_parquet(tmp_path / "take.parquet")
    with pytest.raises(InputError, match=r"take\.parquet: row 2: y is nan"):
        read_recordings(tmp_path, topic_map(pose="/pose"))
    (tmp_path / "take.parquet").write_bytes(b"PAR1 no more")
    with pytest.raises(InputError, match=r"take\.parquet: not a Parquet file"):
        read_recordings(tmp_path, topic_map(pose="/pose"))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("t,x,y,z\n0,0,0,0\n", "the first column is 't', not time_s; behind it columns may be x, y"),
        ("time_s,x,y\n0,0,0\n", "has no column z"),
        ("time_s,x,y,z,qw\n0,0,0,0,1\n", "has no column qx, qy, qz; qw, qx, qy, qz come together"),
        ("time_s,x,y,z,gripper\n0,0,0,0,1\n", "column 'gripper' is not understood; columns may be x, y, z"),
        ("time_s,x,y,z,x\n0,0,0,0,1\n", "column 'x' stands 2 times"),
        ("time_s,x,y,z,effort.a,position.b\n0,0,0,0,1,1\n", "has position.b, but not position.a"),
        ("time_s,x,y,z\n0,0,0\n", "line 2 has 3 columns, expected 4"),
        ("time_s,x,y,z\nnoon,0,0,0\n", "line 2: not a time in s: 'noon'|not a number"),
        ("time_s,x,y,z\n-1,0,0,0\n", "row 0: time_s is -1, not between 0 and"),
        ("time_s,x,y,z\n", "has no rows"),
        ("", "the first column is ''"),
    ],
)
def test_a_table_that_is_not_one_is_told_of(tmp_path, text, complaint):
    (tmp_path / "take.csv").write_text(text)
    with pytest.raises(InputError, match=rf"take\.csv: .*{complaint}|take\.csv: {complaint}"):
        read_recording(tmp_path / "take.csv", topic_map(pose="/pose"))


def bag(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bag(path, pose_messages([1, 2, 3], pose_rows(3)))


def test_shapes_come_from_the_nearest_table(tmp_path):
    for name in ("one.mcap", "two.mcap", "three/three_0.mcap", "four/four_0.mcap"):
        bag(tmp_path / name)
        if "/" in name:
            (tmp_path / name).with_name("metadata.yaml").touch()
    (tmp_path / "obstacles.csv").write_text(
        SHAPES + "post,cylinder,0.1,0.2,0.3,1,0,0,0,0.1,0.1,0.5\nball,sphere,1,0,0,1,0,0,0,0.2,0.2,0.2\n"
    )
    (tmp_path / "two.obstacles.csv").write_text(SHAPES + "box,cube,0,0,0,0,0,0,1,1,2,3\n")
    (tmp_path / "four" / "obstacles.csv").write_text(SHAPES)
    found = {one.name: one.shapes for one in read_recordings(tmp_path, topic_map(pose="/tool"))}
    names = {name: [shape.name for shape in shapes] for name, shapes in found.items()}
    assert names == {"one": ["post", "ball"], "two": ["box"], "three_0": ["post", "ball"], "four_0": []}
    post, _ = found["one"]
    assert post.form == "cylinder"
    np.testing.assert_array_equal(post.position, [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(post.size, [0.1, 0.1, 0.5])
    np.testing.assert_array_equal(found["two"][0].orientation, [0, 0, 0, 1])


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("name,form\n", "has no column x, y, z"),
        (SHAPES + "a,cone,0,0,0,1,0,0,0,1,1,1\n", "line 2: form is 'cone', not one of cube, sphere, cyl"),
        (SHAPES + "a,cube,0,0,0,2,0,0,0,1,1,1\n", "line 2: quaternion has norm 2, not 1"),
        (SHAPES + "a,cube,0,0,0,1,0,0,0,1,1,0\n", "line 2: a shape needs a positive size"),
        (SHAPES + "a,cube,0,0,0,1,0,0,0,1,1,wide\n", "line 2: not a number: 'wide'"),
    ],
)
def test_a_table_of_shapes_that_is_none_is_told_of(tmp_path, text, complaint):
    bag(tmp_path / "one.mcap")
    (tmp_path / "obstacles.csv").write_text(text)
    with pytest.raises(InputError, match=rf"obstacles\.csv: {complaint}"):
        read_recordings(tmp_path, topic_map(pose="/tool"))


@pytest.fixture
def log(tmp_path):
    def write(text):
        path = tmp_path / "log.txt"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def test_white_space_blank_lines_a_header_commas_and_one_at_the_end_of_lines(log):
    table = read_text_table(log("1 2.5\t-3e2\n\n  4   5 6 \n\n"), 3)
    np.testing.assert_array_equal(table, [[1, 2.5, -300], [4, 5, 6]])
    table = read_text_table(log("time,a, b\r\n1,2,3,\r\n4,5,6\r\n"), 3, separator=",", header_lines=1)
    np.testing.assert_array_equal(table, [[1, 2, 3], [4, 5, 6]])


@given(stamp=st.integers(-(10**18), 4 * 10**18))
def test_any_printed_time_is_read_exactly(tmp_path_factory, stamp):
    path = tmp_path_factory.mktemp("time") / "log.txt"
    sign = "-" if stamp < 0 else ""
    path.write_text(f"{sign}{abs(stamp) // 10**9}.{abs(stamp) % 10**9:09d} 0\n")
    stamps, _ = read_stamped_table(path, 2)
    assert stamps.tolist() == [stamp]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("1 2\n3\n", "line 2 has 1 columns, expected 2"),
        ("1 2\n\n1 2 3\n", "line 3 has 3 columns, expected 2"),
        ("1 2\n3 four\n", "line 2: not a number: 'four'"),
        ("1 nan\n", "line 1: not a finite number: 'nan'"),
        ("1 2\n1 -inf\n", "line 2: not a finite number: '-inf'"),
        ("", "has no rows"),
        (b"\xff\xfe1 2\n", "not a text file"),
    ],
)
@pytest.mark.parametrize("read", [read_text_table, read_stamped_table])
def test_faults_are_named_with_file_and_line(log, read, text, complaint):
    with pytest.raises(InputError, match=rf"log\.txt: {complaint}"):
        read(log(text), 2)
    for time in ("noon", "1e30", "1e999999"):
        with pytest.raises(InputError, match=rf"log\.txt: line 1: .*time .*: '{time}'"):
            read_stamped_table(log(f"{time} 1\n"), 2)


def test_uniform_stamps_do_not_drift():
    stamps = uniform_stamps(30_001, 300.0)
    assert stamps[0] == 0
    assert stamps[-1] == 100 * 10**9
    assert set(np.diff(stamps).tolist()) == {3333333, 3333334}


def test_provenance_has_the_files_and_their_digests(tmp_path):
    (tmp_path / "set").mkdir()
    files = [tmp_path / "set" / "1.txt", tmp_path / "set" / "2.txt"]
    for file in files:
        file.write_text(file.name)
    provenance = PublicSet("https://example.org", "abc", "MIT").provenance(tmp_path, files)
    assert provenance["origin"] == "recorded"
    assert provenance["files"] == "set/1.txt set/2.txt"
    assert provenance["sha256"] == " ".join(hashlib.sha256(f.name.encode()).hexdigest() for f in files)
