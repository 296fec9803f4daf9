"""The importer on made-up files, and on the recorded motion where it is at hand."""

import numpy as np
import pytest
from readers_bags import recorded_data

from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers import panda


@pytest.fixture
def folder(tmp_path):
    """Two samples: 1 .. 14, 101 .. 114, 201 .. 214."""
    for start, word in enumerate(("positions", "velocity", "torques")):
        numbers = range(100 * start + 1, 100 * start + 15)
        (tmp_path / f"exciting_traj_{word}.txt").write_text("".join(f"{number}\n" for number in numbers))
    (tmp_path / "exciting_traj_time.txt").write_text("0\n0.00174391\n")
    return tmp_path


def test_numbers_go_to_joints_and_samples(folder):
    (log,) = panda.read_motion(folder)
    assert log.name == "exciting_traj"
    assert log.joints == tuple(f"panda_joint{number}" for number in range(1, 8))
    np.testing.assert_array_equal(log.stamps, [0, 1_743_910])
    np.testing.assert_array_equal(log.positions, np.arange(1, 15).reshape(2, 7))
    np.testing.assert_array_equal(log.velocities[1], np.arange(108, 115))
    np.testing.assert_array_equal(log.torques[0], np.arange(201, 208))
    assert log.provenance["commit"] == panda.SOURCE.commit
    assert log.provenance["files"].startswith("exciting_traj_time.txt ")


def test_a_file_of_another_length_is_named(folder):
    path = folder / "exciting_traj_torques.txt"
    path.write_text(path.read_text() + "7\n")
    with pytest.raises(InputError, match=r"torques\.txt: has 15 numbers, expected 7 for each of the 2 times"):
        panda.read_motion(folder)


def test_several_motions_are_told_apart_by_their_folders(folder):
    for trial in ("Trajectory_10", "Trajectory_2"):
        (folder / trial).mkdir()
        for path in folder.glob("*.txt"):
            (folder / trial / path.name).write_text(path.read_text())
    names = [log.name for log in panda.read_motion(folder)]
    assert names == ["Trajectory_2_exciting_traj", "Trajectory_10_exciting_traj", "exciting_traj"]


def test_a_missing_file_is_no_missing_motion(folder):
    (folder / "exciting_traj_torques.txt").unlink()
    with pytest.raises(InputError, match=r"torques\.txt: cannot be read") as error:
        panda.read_motion(folder)
    assert not isinstance(error.value, MissingInputError)


def test_the_recorded_motion_is_read_in_full():
    (log,) = panda.read_motion(recorded_data("panda"))
    assert log.positions.shape == (20544, 7)
    assert log.time[-1] == pytest.approx(21.0, abs=0.01)
    np.testing.assert_allclose(log.torques.var(axis=0), [5.7, 321, 95, 35, 0.96, 1.11, 0.076], rtol=0.02)
