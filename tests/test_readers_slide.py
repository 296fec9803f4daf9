"""The importer on tiny tables that are made up, and on the recorded data where they are at hand."""

import numpy as np
import pytest
from readers_bags import recorded_data

from structlearn.core.errors import InputError
from structlearn.readers import slide, synchronise

START = 1581238055_716234152
WIDTHS = {"cp": 7, "cw": 6, "jp": 7, "jt": 7, "jv": 7, "bio": 44}


@pytest.fixture
def folder(tmp_path):
    """Two trials whose values are their column numbers from 1, times 10 ms apart and shifted per stream."""
    for name in ("mat9_10", "mat9_2"):
        for shift, (stream, width) in enumerate(WIDTHS.items()):
            values = list(range(1, width + 1))
            if stream == "cp":
                values[3:] = [0.0, 0.6, 0.0, 0.8]  # x y z w
            stamps = [START + shift * 10**6 + row * 10**7 for row in range(5)]
            end = "," if stream == "bio" else ""
            rows = [",".join([f"{s // 10**9}.{s % 10**9:09d}", *map(str, values)]) + end for s in stamps]
            header = ",".join(["timestamp", *(f"c{column}" for column in range(width))])
            (tmp_path / f"{name}_{stream}.csv").write_text("\n".join([header, *rows]) + "\n")
    return tmp_path


def test_columns_and_clocks(folder):
    recordings = slide.read_slides(folder)
    assert [recording.name for recording in recordings] == ["mat9_2", "mat9_10"]
    rows = {
        stream.kind: (stream.stamps[0] - START, stream.values[2].tolist()) for stream in recordings[0].streams
    }
    assert rows == {
        "pose": (0, [1, 2, 3, 0.8, 0, 0.6, 0]),
        "wrench": (1_000_000, [1, 2, 3, 4, 5, 6]),
        "joint_positions": (2_000_000, [1, 2, 3, 4, 5, 6, 7]),
        "joint_torques": (3_000_000, [1, 2, 3, 4, 5, 6, 7]),
        "joint_velocities": (4_000_000, [1, 2, 3, 4, 5, 6, 7]),
        "tactile": (5_000_000, list(range(26, 45))),
    }
    assert recordings[0].provenance["files"].split()[0] == "mat9_2_cp.csv"
    assert "not for redistribution" in recordings[0].provenance["licence"]


def test_a_missing_stream(folder):
    (folder / "mat9_10_cw.csv").unlink()
    with pytest.raises(InputError, match=r"mat9_10_cw\.csv: cannot be read: No such file"):
        slide.read_slides(folder)


def test_trials_may_lie_in_folders_of_their_material_and_be_limited(folder):
    flat = [recording.name for recording in slide.read_slides(folder)]
    inner = folder / "material"
    inner.mkdir()
    for path in folder.glob("*.csv"):
        path.rename(inner / path.name)
    assert [recording.name for recording in slide.read_slides(folder)] == flat
    assert [recording.name for recording in slide.read_slides(folder, trials=1)] == ["mat9_2"]


def test_all_recorded_slides_come_onto_one_clock():
    recordings = slide.read_slides(recorded_data("slide"))
    assert len(recordings) == 24
    for recording in recordings:
        demonstration = synchronise(recording, rate_hz=100)
        assert 4.0 < demonstration.time[-1] < 8.2
        assert 0.15 < np.ptp(demonstration.position[:, 0]) < 0.25  # a slide of 20 cm along x
        assert demonstration.tactile.shape[1] == 19
        speed = np.gradient(demonstration.joint_positions, 0.01, axis=0)
        assert np.median(np.abs(speed - demonstration.joint_velocities)) < 0.02
