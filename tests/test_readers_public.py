"""Importers of the public sets on tiny made-up files, and on what was recorded where it is at hand."""

import shutil

import numpy as np
import pytest
from readers_bags import recorded_data
from readers_sets import BOXES, SHAPE, write_boxes, write_kuka, write_skin, write_ur10e

from dissertation.recorded.readers import clmc, eflesh, kuka_lwr4, panda, slide, ur10e
from dissertation.recorded.readers.reaches_past_boxes import read_obstacles, unity_rotation, unity_to_base
from structlearn.core import quaternion
from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers import read_demonstrations, synchronise, write_recordings
from structlearn.readers.joint_log import DriveLog
from structlearn.readers.touch_log import read_touch_logs, read_touch_table, write_touch_logs
from structlearn.tasks.motion.drives_and_load import log_on_clock

ROWS = 6


def clmc_table(path, columns, time=None, unit=None):
    """Values are their column numbers, times and a quaternion excepted."""
    table = np.tile(np.arange(columns, dtype=float), (ROWS, 1))
    if time is not None:
        table[:, 0] = time
    if unit is not None:
        table[:, unit : unit + 4] = [0.6, 0.0, 0.8, 0.0]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(" ".join(f"{value:.5g}" for value in row) for row in table) + "\n")


def write_clmc(folder):
    for number in (1, 2, 10):
        clmc_table(folder / f"cart_coord_dmp/dataset1/{number}.txt", 10, time=np.arange(ROWS) * 1e-3)
    clmc_table(folder / "quat_dmp_unscrewing/01.txt", 93, time=np.arange(ROWS) / 300, unit=10)
    for primitive in ("prim1", "prim2", "prim3"):
        trial = folder / "scraping/setting_2_trial_3" / primitive
        for name, columns in (("position", 9), ("sense_proprio", 7), ("sense_R_LF", 19), ("sense_R_RF", 19)):
            clmc_table(trial / name, columns)
        clmc_table(trial / "orientation", 10, unit=0)


def write_panda(folder):
    """Two samples: 1 .. 14, 101 .. 114, 201 .. 214."""
    for start, word in enumerate(("positions", "velocity", "torques")):
        numbers = range(100 * start + 1, 100 * start + 15)
        (folder / f"exciting_traj_{word}.txt").write_text("".join(f"{number}\n" for number in numbers))
    (folder / "exciting_traj_time.txt").write_text("0\n0.00174391\n")


SLIDE_START = 1581238055_716234152
SLIDE_WIDTHS = {"cp": 7, "cw": 6, "jp": 7, "jt": 7, "jv": 7, "bio": 44}


def write_slides(folder):
    """Two trials whose values are their column numbers from 1, times 10 ms apart and shifted per stream."""
    for name in ("mat9_10", "mat9_2"):
        for shift, (stream, width) in enumerate(SLIDE_WIDTHS.items()):
            values = list(range(1, width + 1))
            if stream == "cp":
                values[3:] = [0.0, 0.6, 0.0, 0.8]  # x y z w
            stamps = [SLIDE_START + shift * 10**6 + row * 10**7 for row in range(5)]
            end = "," if stream == "bio" else ""
            rows = [",".join([f"{s // 10**9}.{s % 10**9:09d}", *map(str, values)]) + end for s in stamps]
            header = ",".join(["timestamp", *(f"c{column}" for column in range(width))])
            (folder / f"{name}_{stream}.csv").write_text("\n".join([header, *rows]) + "\n")


def rows_of(recording):
    """The fourth row of each kind of stream; of two fingers the second's."""
    return {stream.kind: stream.values[3].tolist() for stream in recording.streams}


def reaches_of_boxes(folder):
    return read_obstacles(folder, None)


def presses(folder):
    return eflesh.read_runs(folder, eflesh.PRESSES)


def replaced(name, old, new):
    """Damage to a text file: some of its text is another."""
    return lambda folder: (folder / name).write_text((folder / name).read_text().replace(old, new))


def written(name, text):
    return lambda folder: (folder / name).write_text(text)


def states(rows, sensed=(0,), kind=eflesh.PRESSES):
    return lambda folder: write_skin(folder, kind, "a", rows, sensed)


def arrays(**changes):
    return lambda folder: write_kuka(folder, **changes)


FINGER, GRID = "scraping/setting_2_trial_3/prim2/sense_R_RF", "sub_01/T007/grid_objects_layout_T007.csv"
HAND, STILL = "sub_01/T007/HandTracker_movement_T007.csv", [(0, 1, 2, 3), (1, 1, 2, 3)]
DAMAGES = [
    (write_clmc, replaced("quat_dmp_unscrewing/01.txt", "0.0066667 ", "0.0072 "), clmc.read_unscrewing,
     r"01\.txt: row 2 has time 0\.0072 s, 300 Hz means 0\.00666667 s"),
    (write_clmc, written(FINGER, " ".join("1" * 19)), clmc.read_scraping_execution,
     "prim2/sense_R_RF: has 1 rows, position has 6"),
    (None, states([STILL[0]] * 2), presses, r"states\.csv: line 2 does not come after"),
    (None, states(STILL, [0, 0]), presses, r"baselines\.csv: line 2 does not come after"),
    (None, states(STILL, [0, 3]), presses, r"baselines\.csv: line 2 is 2\.000 s from any state"),
    (None, states([(0, 1, 2, 3, 1), (1, 1, 2, 3, -7)], [0, 1], eflesh.STROKES),
     lambda folder: eflesh.read_runs(folder, eflesh.STROKES), r"states\.csv: line 2: the scale reads -7 g"),
    (write_panda, replaced("exciting_traj_torques.txt", "214\n", "214\n7\n"), panda.read_motion,
     r"torques\.txt: has 15 numbers, expected 7 for each of the 2 times"),
    (write_panda, lambda folder: (folder / "exciting_traj_torques.txt").unlink(), panda.read_motion,
     r"torques\.txt: cannot be read"),
    (None, arrays(torques=np.zeros((3, 6))), kuka_lwr4.read_motion,
     r"measurements_1.*: torques have shape \(3, 6\), not 3 samples of 7 joints"),
    *((None, arrays(times=np.array([0.0, bad, 1.0])), kuka_lwr4.read_motion,
       r"measurements_1\.npz: .*times are no times in s") for bad in (np.nan, 1e30)),
    (None, arrays(positions=np.array([None] * 3, dtype=object)), kuka_lwr4.read_motion,
     r"measurements_1\.npz: cannot be read as arrays"),
    (write_slides, lambda folder: (folder / "mat9_10_cw.csv").unlink(), slide.read_slides,
     r"mat9_10_cw\.csv: cannot be read: No such file"),
    (write_ur10e, replaced("ur-b.csv", "200.755", "200.7"), ur10e.read_motion,
     r"ur-b\.csv: line 2 does not come after the one before it"),
    (write_boxes, replaced(HAND, "-0.3", "x"), reaches_of_boxes, r"Hand.*\.csv: line 2: not a number: 'x'"),
    (write_boxes, replaced(GRID, ",0.06", ""), reaches_of_boxes, "grid_.*: line 2 has 6 columns, expected 7"),
    (write_boxes, replaced(GRID, "0.15", "0"), reaches_of_boxes, "grid_.*: line 3: a size must be positive"),
    (write_boxes, replaced(GRID, "Target", "Lamp"), reaches_of_boxes, "grid_.*: line 2: .*'Lamp'"),
    (write_boxes, written(GRID, SHAPE + BOXES.partition("\n")[2]), reaches_of_boxes,
     r"grid_.*\.csv: needs one object 'Target'"),
    (write_boxes, written("trials.csv", "participant,trial\nsub_01,7\n"), reaches_of_boxes,
     r"trials\.csv: has no column type, start_moved_time"),
]  # fmt: skip
"""Of each reader: a sound set or none, its damage, and the message."""


@pytest.mark.parametrize(("sound", "damage", "read", "message"), DAMAGES)
def test_damage_is_named_with_file_and_line_and_is_no_missing_set(tmp_path, sound, damage, read, message):
    if sound:
        sound(tmp_path)
    damage(tmp_path)
    with pytest.raises(InputError, match=message) as error:
        read(tmp_path)
    assert not isinstance(error.value, MissingInputError)


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
        (kuka_lwr4.read_motion, "holds no logs"),
        (slide.read_slides, "holds no trials"),
        (ur10e.read_motion, "holds no logs"),
        (lambda folder: write_boxes(folder) or shutil.rmtree(folder / "sub_01") or reaches_of_boxes(folder),
         r"holds none of the trials of trials\.csv"),
    ],
)  # fmt: skip
def test_a_public_set_that_is_not_there_is_missing(tmp_path, read, complaint):
    with pytest.raises(MissingInputError, match=complaint):
        read(tmp_path)


def test_each_reading_of_the_skin_has_the_state_nearest_to_it(tmp_path):
    """Readings and states differ in number: some states have no reading, one has two."""
    states = [(time, 10 * time, 1, -time, 100 * time) for time in range(6)]
    write_skin(tmp_path, eflesh.STROKES, "a", states, (0.8, 1.3, 3.9, 4.6))
    (log,) = eflesh.read_runs(tmp_path, eflesh.STROKES)
    rows = np.array([1, 1, 4, 5])
    np.testing.assert_allclose(log.place, 1e-3 * np.column_stack([10 * rows, np.ones(4), -rows]))
    np.testing.assert_allclose(log.force, 0.1 * eflesh.STANDARD_GRAVITY * rows)


def test_columns_of_clmc(tmp_path):
    write_clmc(tmp_path)
    recordings = clmc.read_reaches(tmp_path)
    assert [recording.name for recording in recordings] == ["1", "2", "10"]
    assert rows_of(recordings[0]) == {"pose": [1, 2, 3, 1, 0, 0, 0], "twist": [4, 5, 6, 0, 0, 0]}
    assert recordings[0].provenance["files"] == "cart_coord_dmp/dataset1/1.txt"
    assert recordings[0].provenance["licence"].startswith("MIT")
    assert synchronise(recordings[0]).orientation is None
    (unscrewing,) = clmc.read_unscrewing(tmp_path)
    assert unscrewing.name == "01"
    assert rows_of(unscrewing) == {
        "pose": [1, 2, 3, 0.6, 0, 0.8, 0],
        "twist": [4, 5, 6, 14, 15, 16],
        "wrench": [20, 21, 22, 23, 24, 25],
        "tactile": list(range(26, 45)),
    }
    assert unscrewing.streams[0].stamps.tolist() == [0, 3333333, 6666667, 10000000, 13333333, 16666667]
    scraping = clmc.read_scraping_execution(tmp_path)
    assert [recording.name for recording in scraping] == ["prim1", "prim2", "prim3"]
    assert rows_of(scraping[1]) == {
        "pose": [0, 1, 2, 0.6, 0, 0.8, 0],
        "twist": [3, 4, 5, 4, 5, 6],
        "joint_positions": list(range(7)),
        "tactile": list(range(19)),
    }
    assert len(scraping[1].provenance["sha256"].split()) == 5


def test_columns_of_slides(tmp_path):
    write_slides(tmp_path)
    first, second = slide.read_slides(tmp_path)
    assert (first.name, second.name) == ("mat9_2", "mat9_10")
    joints = {f"joint_{name}": list(range(1, 8)) for name in ("positions", "torques", "velocities")}
    wrench, tactile = list(range(1, 7)), list(range(26, 45))
    expected = {"pose": [1, 2, 3, 0.8, 0, 0.6, 0], "wrench": wrench, **joints, "tactile": tactile}
    assert rows_of(first) == expected
    starts = {one.kind: one.stamps[0] - SLIDE_START for one in first.streams}
    assert starts == {kind: place * 10**6 for place, kind in enumerate(expected)}
    assert first.provenance["files"].split()[0] == "mat9_2_cp.csv"
    assert "not for redistribution" in first.provenance["licence"]
    assert [one.name for one in slide.read_slides(tmp_path, trials=1)] == ["mat9_2"]


def test_columns_of_logs_of_arms(tmp_path):
    for name, write in (("panda", write_panda), ("ur10e", write_ur10e), ("kuka", write_kuka)):
        (tmp_path / name).mkdir()
        write(tmp_path / name)
    (log,) = panda.read_motion(tmp_path / "panda")
    assert (log.name, log.joints) == ("exciting_traj", tuple(f"panda_joint{one}" for one in range(1, 8)))
    np.testing.assert_array_equal(log.stamps, [0, 1_743_910])
    np.testing.assert_array_equal(log.positions, np.arange(1, 15).reshape(2, 7))
    np.testing.assert_array_equal(log.velocities[1], np.arange(108, 115))
    np.testing.assert_array_equal(log.torques[0], np.arange(201, 208))
    assert log.provenance["commit"] == panda.SOURCE.commit
    assert log.provenance["files"].startswith("exciting_traj_time.txt ")
    first, second = ur10e.read_motion(tmp_path / "ur10e")
    assert (first.name, second.name, first.joints) == ("a", "b", ur10e.JOINTS)
    np.testing.assert_array_equal(first.stamps, [200_743_000_000, 200_755_000_000, 200_765_000_000])
    for place, name in enumerate(ur10e.SIGNALS):
        np.testing.assert_array_equal(getattr(first, name)[1], 100 + 6 * place + np.arange(6))
    assert (first.provenance["commit"], first.provenance["files"]) == (ur10e.SOURCE.commit, "ur-a.csv")
    write_kuka(tmp_path / "kuka", "measurements_10")
    first, second = kuka_lwr4.read_motion(tmp_path / "kuka")
    assert (second.name, first.joints) == ("measurements_10", kuka_lwr4.JOINTS)
    np.testing.assert_allclose(first.time, [0.0, 0.005, 0.01], atol=1e-6)
    np.testing.assert_array_equal(first.torques[1], np.arange(7.0, 14.0))
    assert first.provenance["commit"] == kuka_lwr4.SOURCE.commit
    np.savez(tmp_path / "kuka/measurements_1.npz", times=np.arange(3.0))
    left_out: dict[str, str] = {}
    assert [one.name for one in kuka_lwr4.read_motion(tmp_path / "kuka", None, left_out)] == [
        "measurements_10"
    ]
    assert "has no array positions" in left_out.popitem()[1]


def test_readings_of_a_skin_take_the_state_of_the_nearest_time(tmp_path):
    write_skin(tmp_path)
    write_skin(
        tmp_path, eflesh.STROKES, "b", [(0, 1, 2, 3, 100), (1, 1, 2, 2, -1), (2, 1, 2, 1, 200)], (0, 1, 2)
    )
    write_skin(tmp_path, eflesh.SHEAR, "c", [(0, 1, 2, 3, 50), (1, 1, 2, 4, -1)], (0, 1))
    pressed, stroked, _ = read = eflesh.read_touch(tmp_path, None, {})
    assert (pressed.name, pressed.force) == ("a", None)
    np.testing.assert_allclose(pressed.place, [[1e-3, 2e-3, 3e-3], [5e-3, 6e-3, 7e-3]])
    np.testing.assert_allclose(pressed.time, [0.0, 3.8])
    np.testing.assert_array_equal(pressed.counts[0], np.arange(1, 16))
    assert pressed.provenance["commit"] == eflesh.SOURCE.commit
    np.testing.assert_allclose(stroked.force, [0.980665, np.nan, 1.96133])
    assert [log.channels for log in read] == [eflesh.CHANNELS] * 2 + [eflesh.TWO_SKINS]
    write_touch_logs(read, tmp_path / "touches.parquet")
    for log, back in zip(read, read_touch_logs(tmp_path / "touches.parquet"), strict=True):
        for name in ("time", "place", "counts", "force"):
            np.testing.assert_array_equal(getattr(log, name), getattr(back, name))
        assert (log.name, log.channels, log.provenance) == (back.name, back.channels, back.provenance)
    with pytest.raises(InputError, match=r"touches\.parquet: has no column 9q"):
        read_touch_table(tmp_path / "touches.parquet", ["1x", "9q"])
    rng = np.random.default_rng(0)
    stamps, asked = np.cumsum(rng.integers(1, 9, 50)), rng.integers(-5, 260, 200)
    nearest = np.abs(stamps - asked[:, None]).argmin(axis=1)
    np.testing.assert_array_equal(eflesh.nearest_rows(stamps, asked), nearest)
    np.testing.assert_array_equal(eflesh.nearest_rows(stamps[:1], asked), 0)


def test_a_trial_has_hand_boxes_walls_and_target(tmp_path):
    write_boxes(tmp_path)
    (found,) = reaches_of_boxes(tmp_path)  # the other trial is not there
    assert found.name == "sub_01_T007"
    assert found.streams[0].values[0, :3].tolist() == [0.1, -0.3, 0.2]  # right, forward, up
    forms = {"target": "cylinder", "box Long-1": "cube", "boundary left": "cube"}
    assert {shape.name: shape.form for shape in found.shapes} == forms
    assert found.shapes[1].position.tolist() == [0.1, -0.1, 0.79]
    assert found.shapes[1].size.tolist() == [0.15, 0.05, 0.12]  # width, depth, height
    known = {"person": "sub_01", "trial": "7", "moved_s": "0.0100", "reached_s": "0.0300"}
    assert found.provenance | known == found.provenance
    assert len(found.provenance["sha256"].split()) == 3


def test_rotations_are_those_of_reflected_matrices():
    """Unity turns about z, x, y; in the base frame that matrix stands between two exchanges of axes."""
    exchange = np.eye(3)[[0, 2, 1]]
    for degrees in np.random.default_rng(0).uniform(-180.0, 180.0, (20, 3)):
        a, b, c = np.radians(degrees)
        x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
        z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
        turned, point = quaternion.matrix(unity_rotation(degrees)), [1.0, 2.0, 3.0]
        assert np.allclose(turned, exchange @ (y @ x @ z) @ exchange)
        assert np.allclose(turned @ unity_to_base(point), unity_to_base(y @ x @ z @ point))


def moved_into(folder, inner, pattern):
    """Files of a set in a folder of their own, as they were published."""
    (folder / inner).mkdir(parents=True)
    for path in folder.glob(pattern):
        path.rename(folder / inner / path.name)
        if not any(path.parent.iterdir()):
            path.parent.rmdir()


@pytest.mark.parametrize(
    ("write", "inner", "pattern", "read"),
    [
        (write_clmc, "cart_coord_dmp/multi_traj_training/dataset2", "cart_coord_dmp/dataset1/*.txt",
         lambda folder: clmc.read_reaches(folder, "dataset[12]*")),
        (write_clmc, "quat_dmp_unscrewing/prim02", "quat_dmp_unscrewing/*.txt", clmc.read_unscrewing),
        (write_slides, "material", "*.csv", slide.read_slides),
        (write_ur10e, "logs", "ur-b.csv", ur10e.read_motion),
        (write_boxes, "sub_01/T007/movement", "sub_01/T007/Hand*.csv", reaches_of_boxes),
    ],
)  # fmt: skip
def test_a_set_may_lie_in_folders_as_it_was_published(tmp_path, write, inner, pattern, read):
    write(tmp_path)
    flat = [one.name for one in read(tmp_path)]
    moved_into(tmp_path, inner, pattern)
    assert [one.name for one in read(tmp_path)] == flat


def test_motions_of_one_name_are_told_apart_by_their_folders_or_refused(tmp_path, capsys):
    write_panda(tmp_path)
    for trial in ("Trajectory_10", "Trajectory_2"):
        (tmp_path / trial).mkdir()
        write_panda(tmp_path / trial)
    names = [log.name for log in panda.read_motion(tmp_path)]
    assert names == ["Trajectory_2_exciting_traj", "Trajectory_10_exciting_traj", "exciting_traj"]
    write_ur10e(tmp_path)
    (tmp_path / "ur-19_09_27.csv").write_text(",".join("0" * ur10e.OLDER_COLUMNS) + "\n")
    assert [log.name for log in ur10e.read_motion(tmp_path)] == ["a", "b"]  # an older log is left aside
    assert "ur-19_09_27.csv" in capsys.readouterr().out
    write_ur10e(tmp_path / "Trajectory_2")
    with pytest.raises(InputError, match=r"several recordings have the name ur-a\.csv"):
        ur10e.read_motion(tmp_path)


def test_each_current_is_put_back_to_when_it_acted():
    stamps = np.cumsum(np.random.default_rng(0).integers(9_000_000, 13_000_000, 400))
    late, time, zero = np.array([0.0125, -0.004]), (stamps * 1e-9)[:, None], np.zeros((400, 2))
    states = {"positions": np.sin(3.0 * time + [0, 1]), "velocities": 3.0 * np.cos(3.0 * time + [0, 1])}
    states |= {"currents": np.sin(3.0 * (time - late) + [0, 1])}
    log = DriveLog("run", ("one", "two"), stamps, **states, desired_currents=zero, target_torques=zero)
    times, positions, _, found = log_on_clock(log, 100.0, late)
    np.testing.assert_allclose(np.diff(times), 0.01, atol=1e-12)
    np.testing.assert_allclose(found, positions, atol=5e-4)  # of linear interpolation


@pytest.mark.parametrize(
    ("dataset", "count", "in_mid_air"), [("dataset1", 97, ()), ("dataset2_part", 30, ("15", "21"))]
)
def test_recorded_reaches(dataset, count, in_mid_air):
    recordings = clmc.read_reaches(recorded_data("clmc"), dataset)
    assert len(recordings) == count
    for recording in recordings:
        demonstration = synchronise(recording)
        assert demonstration.dt == pytest.approx(1e-3)
        assert 0.4 < demonstration.time[-1] < 1.04
        shift = demonstration.position[-1] - demonstration.position[0]
        whole = np.abs(shift - [-0.268, 0.389, 0.033]).max() < 0.05
        assert whole == (recording.name not in in_mid_air)  # where they begin or end
        integral = np.trapezoid(demonstration.velocity, dx=1e-3, axis=0)
        np.testing.assert_allclose(integral, shift, atol=0.01)  # the twist is the pose's


def test_recorded_unscrewing_turns_once_and_slides_are_of_20_cm():
    recordings = clmc.read_unscrewing(recorded_data("clmc"))
    assert [recording.name for recording in recordings] == ["01", "02", "03"]
    for recording in recordings:
        one = synchronise(recording, rate_hz=300)
        assert one.tactile.shape == (len(recording.streams[0].stamps), 19)
        steps = quaternion.difference(one.orientation[1:], one.orientation[:-1])[:, 2].sum()
        assert abs(np.rad2deg(steps)) == pytest.approx(360, abs=40)
        assert one.angular_velocity[:, 2].sum() / 300 == pytest.approx(steps, abs=0.1)
    scraping = [synchronise(one) for one in clmc.read_scraping_execution(recorded_data("clmc"))]
    assert [one.tactile.shape for one in scraping] == [(777, 38), (1122, 38), (1087, 38)]
    recordings = slide.read_slides(recorded_data("slide"))
    assert len(recordings) == 24
    for recording in recordings[::4]:
        one = synchronise(recording, rate_hz=100)
        assert 4.0 < one.time[-1] < 8.2
        assert 0.15 < np.ptp(one.position[:, 0]) < 0.25  # along x
        assert one.tactile.shape[1] == 19
        speed = np.gradient(one.joint_positions, 0.01, axis=0)
        assert np.median(np.abs(speed - one.joint_velocities)) < 0.02


def test_recorded_logs_of_arms_and_runs_of_a_skin_are_read_in_full():
    (log,) = panda.read_motion(recorded_data("panda"))
    assert (log.positions.shape, log.time[-1]) == ((20544, 7), pytest.approx(21.0, abs=0.01))
    np.testing.assert_allclose(log.torques.var(axis=0), [5.7, 321, 95, 35, 0.96, 1.11, 0.076], rtol=0.02)
    logs = {log.name: log for log in ur10e.read_motion(recorded_data("ur10e"))}
    lengths = {"20_01_17-p1": 918, "20_01_31-load": 2881, "20_01_31-unload": 2623}
    lengths |= {"20_02_12-50sec_12harm": 5457, "20_02_19_14harm50sec": 5375, "20_02_19_14harm50secLoad": 5307}
    assert {name: len(log.stamps) for name, log in logs.items()} == lengths
    assert np.abs(logs["20_02_19_14harm50sec"].velocities).max() < 2.0
    logs = kuka_lwr4.read_motion(recorded_data("kuka_lwr4"))
    assert [log.name for log in logs] == ["measurements_1", "measurements_2"]
    assert {log.positions.shape for log in logs} == {(5027, 7)}
    for run in presses(recorded_data("eflesh")):
        assert len(np.unique(run.place[:, :2].round(4), axis=0)) == 961
        assert np.linalg.norm(run.counts, axis=1).min() > 100
    for run in eflesh.read_runs(recorded_data("eflesh"), eflesh.STROKES):
        assert 30 < np.nanmax(run.force) < 40
        assert 0.4 < np.isnan(run.force).mean() < 0.55


def test_recorded_reaches_past_boxes(tmp_path):
    recordings = reaches_of_boxes(recorded_data("reaches_past_boxes"))
    assert len(recordings) == 286
    assert len({one.provenance["person"] for one in recordings}) == 16
    write_recordings(recordings[:3], tmp_path)
    for one in read_demonstrations(tmp_path):
        names = [shape.name for shape in one.shapes]
        assert names.count("target") == 1
        assert sum(name.startswith("boundary") for name in names) == 3
        at = int(float(one.provenance["reached_s"]) / one.dt)
        target = one.shapes[names.index("target")].position
        assert np.linalg.norm(one.position[at] - target) < 0.06  # it is picked up within 0.0375 m
