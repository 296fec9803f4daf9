"""The importer of reaches past boxes on a tiny made-up set, and on the public one where it is at hand."""

import numpy as np
import pytest
from readers_bags import recorded_data

from structlearn.core import quaternion
from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers import read_demonstrations, write_recordings
from structlearn.readers.reaches_past_boxes import read_obstacles, unity_rotation, unity_to_base

TRIALS = "participant,trial,type,start_moved_time,target_reached_time\n"
HAND = "time,pos_x,pos_y,pos_z,rot_x,rot_y,rot_z\n"
SHAPE = "object,x,y,z,width,height,depth\n"
BOXES = "Target,0,0.8,0.2,0.05,0.09,0.06\nFailOnTouchObstacleLong-1,0.1,0.79,-0.1,0.15,0.12,0.05\n"
SCENE = "TableTop,0,0.7,0,1,0.1,1\nLeftBoundary,-0.36,0.8,0,0.02,0.13,0.6\n"


def trial(folder, name, hand="0.1,0.2,-0.3,0,90,0", boxes=BOXES, scene=SCENE):
    folder.mkdir(parents=True, exist_ok=True)
    rows = "".join(f"{100 + 0.01 * row:.4f},{hand}\n" for row in range(5))
    (folder / f"HandTracker_movement_{name}.csv").write_text(HAND + rows)
    (folder / f"grid_objects_layout_{name}.csv").write_text(SHAPE + boxes)
    (folder / f"scene_layout_{name}.csv").write_text(SHAPE + scene)


@pytest.fixture
def folder(tmp_path):
    rows = "sub_01,7,main,100.01,100.03\nsub_02,11,main,100.01,100.03\n"
    (tmp_path / "trials.csv").write_text(TRIALS + rows)
    trial(tmp_path / "sub_01" / "T007", "T007")
    return tmp_path


def test_a_trial_has_hand_boxes_walls_and_target(folder):
    (found,) = read_obstacles(folder, None)  # the other trial is not there
    assert found.name == "sub_01_T007"
    assert found.streams[0].values[0, :3].tolist() == [0.1, -0.3, 0.2]  # right, forward, up
    assert [(shape.name, shape.form) for shape in found.shapes] == [
        ("target", "cylinder"),
        ("box Long-1", "cube"),
        ("boundary left", "cube"),
    ]
    assert found.shapes[1].position.tolist() == [0.1, -0.1, 0.79]
    assert found.shapes[1].size.tolist() == [0.15, 0.05, 0.12]  # width, depth, height
    known = found.provenance
    assert (known["person"], known["trial"], known["moved_s"], known["reached_s"]) == (
        "sub_01",
        "7",
        "0.0100",
        "0.0300",
    )
    assert len(known["sha256"].split()) == 3


def test_a_trial_may_lie_in_folders_as_it_was_published(folder):
    (whole,) = read_obstacles(folder, None)
    files = folder / "sub_01" / "T007"
    for name, kind in (("HandTracker_movement", "movement"), ("grid_objects_layout", "scene")):
        (files / kind).mkdir()
        (files / f"{name}_T007.csv").rename(files / kind / f"{name}_T007.csv")
    (found,) = read_obstacles(folder, None)
    assert found.provenance["sha256"] == whole.provenance["sha256"]


def test_rotations_are_those_of_reflected_matrices():
    """Unity turns about z, x, y; in the base frame that matrix stands between two exchanges of axes."""
    rng = np.random.default_rng(0)
    exchange = np.eye(3)[[0, 2, 1]]
    for degrees in rng.uniform(-180.0, 180.0, (20, 3)):
        a, b, c = np.radians(degrees)
        x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
        y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
        z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
        turned = quaternion.matrix(unity_rotation(degrees))
        assert np.allclose(turned, exchange @ (y @ x @ z) @ exchange)
        assert np.allclose(
            turned @ unity_to_base([1.0, 2.0, 3.0]), unity_to_base(y @ x @ z @ [1.0, 2.0, 3.0])
        )


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"hand": "0.1,0.2,x,0,90,0"}, r"HandTracker_movement_T007\.csv: line 2: not a number: 'x'"),
        ({"boxes": "Target,0,0.8,0.2,0.05,0.09\n"}, r"grid_.*\.csv: line 2 has 6 columns, expected 7"),
        ({"boxes": BOXES.replace("0.79", "high")}, r"grid_.*\.csv: line 3: not a number: 'high'"),
        ({"boxes": BOXES.replace("0.15", "0")}, r"grid_.*\.csv: line 3: a size must be positive"),
        ({"boxes": BOXES.replace("Target", "Lamp")}, r"grid_.*\.csv: line 2: unknown object 'Lamp'"),
        ({"boxes": BOXES.partition("\n")[2]}, r"grid_.*\.csv: needs one object 'Target'"),
    ],
)
def test_faults_are_told_with_file_and_line(folder, changes, complaint):
    trial(folder / "sub_01" / "T007", "T007", **changes)
    with pytest.raises(InputError, match=complaint):
        read_obstacles(folder, None)


def test_faults_of_the_table_of_trials(folder):
    (folder / "trials.csv").write_text(TRIALS + "sub_01,7,main,soon,100.03\n")
    with pytest.raises(InputError, match=r"trials\.csv: line 2: not a number: 'soon'"):
        read_obstacles(folder, None)
    (folder / "trials.csv").write_text(TRIALS + "sub_09,7,main,1,2\n")
    with pytest.raises(MissingInputError, match=r"holds none of the trials of trials\.csv"):
        read_obstacles(folder, None)
    (folder / "trials.csv").write_text("participant,trial\nsub_01,7\n")
    with pytest.raises(InputError, match=r"trials\.csv: has no column type, start_moved_time"):
        read_obstacles(folder, None)


def test_the_public_set(tmp_path):
    recordings = read_obstacles(recorded_data("reaches_past_boxes"), None)
    assert len(recordings) == 286
    assert len({one.provenance["person"] for one in recordings}) == 16
    write_recordings(recordings[:3], tmp_path)
    for one in read_demonstrations(tmp_path):
        names = [shape.name for shape in one.shapes]
        assert names.count("target") == 1
        assert sum(name.startswith("boundary") for name in names) == 3
        target = one.shapes[names.index("target")].position
        at = int(float(one.provenance["reached_s"]) / one.dt)
        assert np.linalg.norm(one.position[at] - target) < 0.06  # it is picked up within 0.0375 m
