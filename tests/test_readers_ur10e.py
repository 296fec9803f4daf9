"""Logs of drives: the importer on made-up files and on the recorded arm, the file, and the one clock."""

import numpy as np
import pytest
from readers_bags import recorded_data

from structlearn.core.errors import InputError
from structlearn.readers import ur10e
from structlearn.readers.joint_log import DriveLog
from structlearn.tasks.motion.drives_and_load import on_clock


@pytest.fixture
def folder(tmp_path):
    """Two logs of three rows, at uneven times: 0, 1, ... 29, then by 100 more per row."""
    for name in ("ur-b", "ur-a"):
        rows = [[time, *(100 * row + np.arange(30))] for row, time in enumerate((200.743, 200.755, 200.765))]
        (tmp_path / f"{name}.csv").write_text("".join(",".join(map(str, row)) + "\n" for row in rows))
    return tmp_path


def test_columns_go_to_signals_and_joints(folder):
    first, second = ur10e.read_motion(folder)
    assert (first.name, second.name, first.joints) == ("a", "b", ur10e.JOINTS)
    np.testing.assert_array_equal(first.stamps, [200_743_000_000, 200_755_000_000, 200_765_000_000])
    for place, name in enumerate(ur10e.SIGNALS):
        np.testing.assert_array_equal(getattr(first, name)[1], 100 + 6 * place + np.arange(6))
    assert first.provenance["commit"] == ur10e.SOURCE.commit
    assert first.provenance["files"] == "ur-a.csv"


def test_faults_are_named_with_file_and_row(folder):
    path = folder / "ur-b.csv"
    rows = path.read_text().splitlines()
    path.write_text("\n".join([rows[0], rows[1] + ",7"]))
    with pytest.raises(InputError, match=r"ur-b\.csv: line 2 has 32 columns, expected 31"):
        ur10e.read_motion(folder)
    path.write_text("\n".join([rows[1], rows[0]]))
    with pytest.raises(InputError, match=r"ur-b\.csv: line 2 does not come after the one before it"):
        ur10e.read_motion(folder)


def test_logs_may_lie_in_folders_and_older_ones_are_left_aside(folder, capsys):
    (folder / "logs").mkdir()
    (folder / "ur-b.csv").rename(folder / "logs" / "ur-b.csv")
    (folder / "logs" / "ur-19_09_27.csv").write_text(",".join("0" * ur10e.OLDER_COLUMNS) + "\n")
    assert [log.name for log in ur10e.read_motion(folder)] == ["a", "b"]
    assert "ur-19_09_27.csv" in capsys.readouterr().out
    (folder / "logs" / "ur-a.csv").write_text((folder / "ur-a.csv").read_text())
    with pytest.raises(InputError, match=r"several recordings have the name ur-a\.csv"):
        ur10e.read_motion(folder)


def test_each_current_is_put_back_to_when_it_acted():
    stamps = np.cumsum(np.random.default_rng(0).integers(9_000_000, 13_000_000, 400))
    joints, late = ("one", "two"), np.array([0.0125, -0.004])
    time = (stamps * 1e-9)[:, None]
    states = {"positions": np.sin(3.0 * time + [0, 1]), "velocities": 3.0 * np.cos(3.0 * time + [0, 1])}
    currents = np.sin(3.0 * (time - late) + [0, 1])
    zero = np.zeros((400, 2))
    log = DriveLog(
        "run", joints, stamps, **states, currents=currents, desired_currents=zero, target_torques=zero
    )
    times, positions, _, found = on_clock(log, 100.0, late)
    np.testing.assert_allclose(np.diff(times), 0.01, atol=1e-12)
    np.testing.assert_allclose(found, positions, atol=5e-4)  # of linear interpolation


def test_the_recorded_logs_are_read_in_full():
    logs = {log.name: log for log in ur10e.read_motion(recorded_data("ur10e"))}
    assert {name: len(log.stamps) for name, log in logs.items()} == {
        "20_01_17-p1": 918,
        "20_01_31-load": 2881,
        "20_01_31-unload": 2623,
        "20_02_12-50sec_12harm": 5457,
        "20_02_19_14harm50sec": 5375,
        "20_02_19_14harm50secLoad": 5307,
    }
    assert np.abs(logs["20_02_19_14harm50sec"].velocities).max() < 2.0
