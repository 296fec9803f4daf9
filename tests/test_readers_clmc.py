"""The importer on tiny logs that are made up, and on the recorded data where they are at hand."""

import shutil

import numpy as np
import pytest
from readers_bags import recorded_data

from structlearn.core import quaternion
from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers import clmc, eflesh, panda, slide, synchronise, ur10e

ROWS = 6

INCOMPLETE = {("dataset2_part", "15"), ("dataset2_part", "21")}
"""Recorded reaches that begin or end in mid-air."""


@pytest.fixture
def folder(tmp_path):
    """A data set of the repository's layout whose values are their column numbers (times excepted)."""

    def write(path, columns, time=None, unit=None):
        table = np.tile(np.arange(columns, dtype=float), (ROWS, 1))
        if time is not None:
            table[:, 0] = time
        if unit is not None:
            table[:, unit : unit + 4] = [0.6, 0.0, 0.8, 0.0]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(" ".join(f"{value:.5g}" for value in row) for row in table) + "\n")

    for number in (1, 2, 10):
        write(tmp_path / f"cart_coord_dmp/dataset1/{number}.txt", 10, time=np.arange(ROWS) * 1e-3)
    write(tmp_path / "quat_dmp_unscrewing/01.txt", 93, time=np.arange(ROWS) / 300, unit=10)
    for primitive in ("prim1", "prim2", "prim3"):
        trial = tmp_path / "scraping/setting_2_trial_3" / primitive
        write(trial / "position", 9)
        write(trial / "orientation", 10, unit=0)
        write(trial / "sense_proprio", 7)
        write(trial / "sense_R_LF", 19)
        write(trial / "sense_R_RF", 19)
    return tmp_path


def row_of(recording, kind, finger=0):
    return [stream for stream in recording.streams if stream.kind == kind][finger].values[3].tolist()


def test_reaches_have_no_orientation(folder):
    recordings = clmc.read_reaches(folder)
    assert [recording.name for recording in recordings] == ["1", "2", "10"]
    assert row_of(recordings[0], "pose") == [1, 2, 3, 1, 0, 0, 0]
    assert row_of(recordings[0], "twist") == [4, 5, 6, 0, 0, 0]
    assert recordings[0].provenance["files"] == "cart_coord_dmp/dataset1/1.txt"
    assert recordings[0].provenance["licence"].startswith("MIT")
    assert synchronise(recordings[0]).orientation is None


def test_folders_may_be_as_they_were_published(folder):
    published = folder / "cart_coord_dmp/multi_traj_training/dataset2"
    shutil.copytree(folder / "cart_coord_dmp/dataset1", published)
    shutil.rmtree(folder / "cart_coord_dmp/dataset1")
    assert len(clmc.read_reaches(folder, "dataset2*")) == 3
    with pytest.raises(MissingInputError, match=r"dataset1: holds no reaches"):
        clmc.read_reaches(folder)
    (folder / "quat_dmp_unscrewing/prim02").mkdir()
    shutil.move(folder / "quat_dmp_unscrewing/01.txt", folder / "quat_dmp_unscrewing/prim02/04.txt")
    assert [one.name for one in clmc.read_unscrewing(folder)] == ["04"]


def test_unscrewing_columns_and_clock(folder):
    (recording,) = clmc.read_unscrewing(folder)
    assert recording.name == "01"
    assert row_of(recording, "pose") == [1, 2, 3, 0.6, 0, 0.8, 0]
    assert row_of(recording, "twist") == [4, 5, 6, 14, 15, 16]
    assert row_of(recording, "wrench") == [20, 21, 22, 23, 24, 25]
    assert row_of(recording, "tactile") == list(range(26, 45))
    assert recording.streams[0].stamps.tolist() == [0, 3333333, 6666667, 10000000, 13333333, 16666667]


def test_unscrewing_at_another_rate_is_refused(folder):
    path = folder / "quat_dmp_unscrewing/01.txt"
    lines = path.read_text().splitlines()
    lines[2] = "0.0072" + lines[2][lines[2].index(" ") :]
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"01\.txt: row 2 has time 0\.0072 s, 300 Hz means 0\.00666667 s"):
        clmc.read_unscrewing(folder)


def test_scraping_columns(folder):
    recordings = clmc.read_scraping_execution(folder)
    assert [recording.name for recording in recordings] == ["prim1", "prim2", "prim3"]
    recording = recordings[1]
    assert row_of(recording, "pose") == [0, 1, 2, 0.6, 0, 0.8, 0]
    assert row_of(recording, "twist") == [3, 4, 5, 4, 5, 6]
    assert row_of(recording, "joint_positions") == list(range(7))
    assert row_of(recording, "tactile", 1) == list(range(19))
    assert len(recording.provenance["sha256"].split()) == 5


def test_scraping_streams_of_different_length_are_refused(folder):
    path = folder / "scraping/setting_2_trial_3/prim2/sense_R_RF"
    path.write_text("\n".join(path.read_text().splitlines()[:-1]))
    with pytest.raises(InputError, match="prim2/sense_R_RF: has 5 rows, position has 6"):
        clmc.read_scraping_execution(folder)


@pytest.mark.parametrize(
    ("read", "complaint"),
    [
        (clmc.read_reaches, "dataset1: holds no reaches"),
        (lambda folder: clmc.read_reaches(folder, "dataset3"), "dataset3: holds no reaches"),
        (clmc.read_unscrewing, "quat_dmp_unscrewing: holds no logs"),
        (clmc.read_scraping_execution, "scraping: holds no execution"),
        (lambda folder: clmc.read_scraping_execution(folder, "other"), "scraping/other: holds no execution"),
        (lambda folder: eflesh.read_touch(folder, None, {}), "holds no run"),
        (panda.read_motion, "holds no motion"),
        (slide.read_slides, "holds no trials"),
        (ur10e.read_motion, "holds no logs"),
    ],
)
def test_a_public_set_that_is_not_there_is_missing(tmp_path, read, complaint):
    with pytest.raises(MissingInputError, match=complaint):
        read(tmp_path)


@pytest.mark.parametrize(("dataset", "count"), [("dataset1", 97), ("dataset2_part", 30)])
def test_recorded_reaches(dataset, count):
    recordings = clmc.read_reaches(recorded_data("clmc"), dataset)
    assert len(recordings) == count
    for recording in recordings:
        demonstration = synchronise(recording)
        assert demonstration.dt == pytest.approx(1e-3)
        assert 0.4 < demonstration.time[-1] < 1.04
        shift = demonstration.position[-1] - demonstration.position[0]
        whole = np.abs(shift - [-0.268, 0.389, 0.033]).max() < 0.05
        assert whole == ((dataset, recording.name) not in INCOMPLETE)
        integral = np.trapezoid(demonstration.velocity, dx=1e-3, axis=0)
        np.testing.assert_allclose(integral, shift, atol=0.01)  # the twist is the pose's


def test_recorded_unscrewing_turns_once():
    recordings = clmc.read_unscrewing(recorded_data("clmc"))
    assert [recording.name for recording in recordings] == ["01", "02", "03"]
    for recording in recordings:
        demonstration = synchronise(recording, rate_hz=300)
        assert len(demonstration.time) == len(recording.streams[0].stamps)
        assert demonstration.tactile.shape[1] == 19
        steps = quaternion.difference(demonstration.orientation[1:], demonstration.orientation[:-1])
        assert abs(np.rad2deg(steps[:, 2].sum())) == pytest.approx(360, abs=40)
        spin = demonstration.angular_velocity[:, 2].sum() / 300
        assert spin == pytest.approx(steps[:, 2].sum(), abs=0.1)


def test_recorded_scraping():
    demonstrations = [synchronise(one) for one in clmc.read_scraping_execution(recorded_data("clmc"))]
    assert [len(demonstration.time) for demonstration in demonstrations] == [777, 1122, 1087]
    assert {demonstration.tactile.shape[1] for demonstration in demonstrations} == {38}
