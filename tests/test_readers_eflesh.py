"""The importer of the magnetic skin on made-up files, and on the recorded runs where they are at hand."""

import numpy as np
import pytest
from readers_bags import recorded_data

from structlearn.core.errors import InputError
from structlearn.readers import eflesh
from structlearn.readers.touch_log import read_touch_logs, read_touch_table, write_touch_logs

START = 1_700_000_000.0


def write_run(folder, kind, name, states, sensed):
    """A run with given states (rows of numbers after the time) and times of readings, counts 1, 2, ..."""
    path = folder / eflesh.FOLDERS[kind] / name
    path.mkdir(parents=True)
    lines = [",".join(f"{value:.6f}" for value in (START + time, *rest)) for time, *rest in states]
    (path / "states.csv").write_text("\n".join(lines) + "\n")
    channels = 30 if kind == eflesh.SHEAR else 15
    counts = ",".join(str(float(channel)) for channel in range(1, channels + 1))
    (path / "sensor_post_baselines.csv").write_text(
        "".join(f"{START + time:.6f},{counts}\n" for time in sensed)
    )
    return path


@pytest.fixture
def folder(tmp_path):
    write_run(tmp_path, eflesh.PRESSES, "a", [(0, 1, 2, 3), (4, 5, 6, 7)], [0.1, 3.9])
    write_run(
        tmp_path, eflesh.STROKES, "b", [(0, 1, 2, 3, 100), (1, 1, 2, 2, -1), (2, 1, 2, 1, 200)], [0, 1, 2]
    )
    write_run(tmp_path, eflesh.SHEAR, "c", [(0, 1, 2, 3, 50), (1, 1, 2, 4, -1)], [0, 1])
    return tmp_path


def test_readings_take_the_state_of_the_nearest_time(folder):
    (run,) = eflesh.read_runs(folder, eflesh.PRESSES)
    assert run.name == "a"
    np.testing.assert_allclose(run.place, [[1e-3, 2e-3, 3e-3], [5e-3, 6e-3, 7e-3]])
    np.testing.assert_allclose(run.time, [0.0, 3.8])
    np.testing.assert_array_equal(run.counts[0], np.arange(1, 16))
    assert run.force is None
    assert run.provenance["commit"] == eflesh.SOURCE.commit


def test_the_scale_reads_newtons_and_misses_some(folder):
    (run,) = eflesh.read_runs(folder, eflesh.STROKES)
    np.testing.assert_allclose(run.force, [0.980665, np.nan, 1.96133])


def test_nearest_rows_are_those_of_a_search_over_all():
    rng = np.random.default_rng(0)
    stamps, asked = np.cumsum(rng.integers(1, 9, 50)), rng.integers(-5, 260, 200)
    np.testing.assert_array_equal(
        eflesh.nearest_rows(stamps, asked), np.abs(stamps - asked[:, None]).argmin(axis=1)
    )
    np.testing.assert_array_equal(eflesh.nearest_rows(stamps[:1], asked), 0)


def test_a_table_holds_what_was_read(folder, tmp_path):
    read = eflesh.read_touch(folder, None, {})
    write_touch_logs(read, tmp_path / "touches.parquet")
    for log, back in zip(read, read_touch_logs(tmp_path / "touches.parquet"), strict=True):
        for name in ("time", "place", "counts", "force"):
            np.testing.assert_array_equal(getattr(log, name), getattr(back, name))
        assert (log.name, log.channels, log.provenance) == (back.name, back.channels, back.provenance)
    assert [log.channels for log in read] == [eflesh.CHANNELS] * 2 + [eflesh.TWO_SKINS]
    with pytest.raises(InputError, match=r"touches\.parquet: has no column 9q"):
        read_touch_table(tmp_path / "touches.parquet", ["1x", "9q"])


@pytest.mark.parametrize(
    ("states", "sensed", "message"),
    [
        ([(0, 1, 2, 3), (0, 1, 2, 3)], [0], r"states\.csv: line 2 does not come after"),
        ([(0, 1, 2, 3), (1, 1, 2, 3)], [0, 0], r"baselines\.csv: line 2 does not come after"),
        ([(0, 1, 2, 3), (1, 1, 2, 3)], [0, 3], r"baselines\.csv: line 2 is 2\.000 s from any state"),
        ([(0, 1, 2)], [0], r"states\.csv: line 1 has 3 columns, expected 4"),
        ([(0, 1, 2, float("nan"))], [0], r"states\.csv: line 1: not a finite number"),
    ],
)
def test_faults_name_file_and_line(tmp_path, states, sensed, message):
    write_run(tmp_path, eflesh.PRESSES, "a", states, sensed)
    with pytest.raises(InputError, match=message):
        eflesh.read_runs(tmp_path, eflesh.PRESSES)


def test_a_negative_weight_is_named(tmp_path):
    write_run(tmp_path, eflesh.STROKES, "b", [(0, 1, 2, 3, 1), (1, 1, 2, 3, -7)], [0, 1])
    with pytest.raises(InputError, match=r"states\.csv: line 2: the scale reads -7 g"):
        eflesh.read_runs(tmp_path, eflesh.STROKES)


def test_the_recorded_runs_are_read_in_full():
    folder = recorded_data("eflesh")
    for run in eflesh.read_runs(folder, eflesh.PRESSES):
        assert len(np.unique(run.place[:, :2].round(4), axis=0)) == 961
        assert np.linalg.norm(run.counts, axis=1).min() > 100
    for run in eflesh.read_runs(folder, eflesh.STROKES):
        assert 30 < np.nanmax(run.force) < 40
        assert 0.4 < np.isnan(run.force).mean() < 0.55
