"""LeRobotDatasets: what is written, what comes back, and what their own reader makes of it.

And public sets: names and layouts of all kinds, degrees, and descriptions that their frames contradict.
"""

import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet
import pytest
from committed import EXAMPLE_TASK, NO_TOPICS
from conftest import minimum_jerk
from lerobot_sets import FPS, POSE, copied, described, edited, lost, unlisted, write_set
from readers_sets import write_dataset

from dissertation.simulation.pick_and_place import TIP, URDF, takes, write_takes
from structlearn.core import quaternion
from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers import read_recordings, synchronise
from structlearn.readers.lerobot import read_movement
from structlearn.readers.source import JointPose
from structlearn.readers.urdf_file import urdf_path
from structlearn.segmentation.segments import cut
from structlearn.tasks.inspection.recordings_report import as_yaml, find_out, report_lines
from structlearn.tasks.movement.lerobot_export import write_lerobot


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder, task = tmp_path_factory.mktemp("bags"), EXAMPLE_TASK
    write_takes(takes(3, 3, 3), folder)
    found = [synchronise(one, 100.0) for one in read_recordings(folder, task.topics, task.stamps)]
    assert found[0].wrench[:, 2].min() == pytest.approx(-9.81 * 0.6, abs=0.8)  # the part's weight
    return found


@pytest.fixture(scope="module")
def written(runs, tmp_path_factory):
    target = tmp_path_factory.mktemp("lerobot") / "pick"
    segmentation = cut(runs, EXAMPLE_TASK.segment)
    assert write_lerobot(runs, segmentation, target, "pick up the part", 5.0, robot="panda") == 3
    return target, segmentation


def entry(pose, **topics):
    task = EXAMPLE_TASK
    none = {name: () if empty == [] else empty for name, empty in NO_TOPICS.items()}
    return task.model_copy(update={"topics": task.topics.model_copy(update=none | {"pose": pose} | topics)})


def test_poses_joints_and_wrenches_come_back(written, runs):
    target, segmentation = written
    signals = {"joint_states": ("observation.state",), "wrench": "observation.wrench"}
    episodes = read_movement(target, entry("observation.pose", **signals), {})
    assert [one.name for one in episodes] == ["episode 0", "episode 1", "episode 2"]
    for episode, run in zip(episodes, runs, strict=True):
        start = min(table.loc[run.name, "start_s"] for table in segmentation.results.values())
        pose, joints, wrench = episode.streams
        time = start + 1e-9 * pose.stamps
        for axis in range(3):
            expected = np.interp(time, run.time, run.position[:, axis])
            assert pose.values[:, axis] == pytest.approx(expected, abs=1e-6)
        turned = quaternion.interpolate(time, run.time, run.orientation)
        assert quaternion.angle_between(pose.values[:, 3:], turned).max() < 1e-6
        assert joints.joints == run.joint_names
        assert wrench.values.shape == (len(time), 6)


def test_a_pose_is_computed_from_the_joints_of_a_state(written):
    urdf = str(urdf_path(URDF))
    sources = "observation.pose", JointPose(urdf=urdf, tip=TIP, topic="observation.state")
    given, computed = (read_movement(written[0], entry(one), {})[0].streams[0].values for one in sources)
    assert np.abs(computed[:, :3] - given[:, :3]).max() < 3e-3  # the recorded pose has noise of its own


def test_subtasks_are_the_cuts_to_one_frame_and_actions_the_next_state(written, runs):
    target, segmentation = written
    frames = pyarrow.parquet.read_table(target / "data/chunk-000/file-000.parquet").to_pandas()
    names = pyarrow.parquet.read_table(target / "meta/subtasks.parquet").to_pandas().index
    assert list(names) == segmentation.primitives
    for number, run in enumerate(runs):
        its = frames[frames["episode_index"] == number]
        cuts = [table.loc[run.name] for table in segmentation.results.values()]
        assert its["subtask_index"].unique().tolist() == list(range(len(names)))
        first = its.groupby("subtask_index")["timestamp"].min().to_numpy()
        expected = np.array([cut["start_s"] for cut in cuts]) - cuts[0]["start_s"]
        assert np.abs(first - expected).max() <= 0.01 + 1e-6
        state, action = np.stack(its["observation.state"]), np.stack(its["action"])
        assert np.array_equal(action[:-1], state[1:])
        assert its["timestamp"].iloc[-1] <= max(cut["end_s"] for cut in cuts) - cuts[0]["start_s"] + 1e-6


def test_the_description_agrees_with_the_frames(written):
    info = json.loads((written[0] / "meta/info.json").read_text())
    frames = pyarrow.parquet.read_table(written[0] / "data/chunk-000/file-000.parquet")
    episodes = pyarrow.parquet.read_table(written[0] / "meta/episodes/chunk-000/file-000.parquet").to_pandas()
    assert set(info["features"]) == set(frames.column_names)
    assert info["total_frames"] == frames.num_rows == episodes["length"].sum()
    assert list(episodes["dataset_to_index"][:-1]) == list(episodes["dataset_from_index"][1:])
    for name, feature in info["features"].items():
        width = len(frames[name][0]) if feature["names"] else 1
        assert feature["shape"] == [width]
        mean = np.stack(frames[name].to_numpy()).reshape(len(frames), -1).astype(float).mean(axis=0)
        stats = json.loads((written[0] / "meta/stats.json").read_text())[name]
        assert stats["mean"] == pytest.approx(mean)
    assert episodes[["quality/smoothness", "quality/idle_share"]].notna().all(axis=None)


def test_their_reader_reads_it(written):
    """With lerobot installed beside this (it needs other versions than are pinned, so not by an extra)."""
    lerobot_dataset = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    dataset = lerobot_dataset.LeRobotDataset("lab/pick", root=written[0])
    assert (dataset.num_episodes, dataset.fps) == (3, 100)
    item = dataset[dataset.num_frames - 1]
    assert item["task"] == "pick up the part"
    assert item["subtask"] == list(written[1].primitives)[-1]
    assert tuple(item["observation.state"].shape) == tuple(dataset.features["action"]["shape"])


@pytest.mark.parametrize(
    ("missing", "changes", "message"),
    [
        ("meta/info.json", {}, "so this is no LeRobotDataset"),
        ("data/chunk-000/file-000.parquet", {}, "holds no file of frames"),
        (None, {"codebase_version": "v2.1"}, "is of version v2.1"),
        (None, {"features": {}}, "has no feature pose"),
    ],
)
def test_a_dataset_that_is_not_one_is_named(tmp_path, missing, changes, message):
    write_dataset(tmp_path, **changes)
    if missing:
        (tmp_path / missing).unlink()
    with pytest.raises((InputError, MissingInputError), match=message):
        read_movement(tmp_path, entry("pose"), {})


def test_demonstrations_with_other_signals_are_refused(runs, tmp_path):
    segmentation = cut(runs, EXAMPLE_TASK.segment)
    mixed = [runs[0], *(replace(run, wrench=None) for run in runs[1:])]
    with pytest.raises(InputError, match="differ in their signals"):
        write_lerobot(mixed, segmentation, tmp_path / "x", "pick", 5.0)
    assert not (tmp_path / "x").exists()


KUKA, KUKA_TIP = "kuka_iiwa/model.urdf", "lbr_iiwa_link_7"
JOINTS = [f"lbr_iiwa_joint_{number}" for number in range(1, 8)]


def moves(seed, count=60):
    """(T, 7) poses of a reach and a retreat with a turn."""
    time = np.arange(count) / FPS
    there, back = minimum_jerk((time - 0.3) / 0.6), minimum_jerk((time - 1.2) / 0.6)
    half, zero = 0.2 * back, np.zeros(count)
    start = np.random.default_rng(seed).normal(0.4, 0.01, 3)
    position = start + 0.2 * there[:, None] * [1, 0, 0.5] - 0.1 * back[:, None]
    return np.hstack([position, np.stack([np.cos(half), zero, zero, np.sin(half)], axis=1)])


def angles(seed):
    """(T, 8) rad of the KUKA's joints, and a gripper that is open by half."""
    reach = moves(seed)[:, :1]
    return np.hstack([reach * [1.0, 1.5, 0.5, -2.0, 0.4, 1.0, 0.3], np.full_like(reach, 50.0)])


@pytest.fixture
def pose_set(tmp_path):
    wrench = np.arange(6.0) + np.zeros((60, 1))
    episodes = [{"pose": moves(seed), "wrench": wrench} for seed in range(5)]
    return write_set(
        tmp_path / "set", episodes, {"pose": POSE, "wrench": ["tx", "ty", "tz", "fx", "fy", "fz"]}
    )


def poses(folder, pose="pose", left_out=None, **topics):
    """(T, 7) values of the pose of each episode."""
    recordings = read_movement(folder, entry(pose, **topics), {} if left_out is None else left_out)
    return [recording.streams[0].values for recording in recordings]


@pytest.mark.parametrize(
    ("names", "order", "topic"),
    [
        (POSE, range(7), "pose"),
        ({"motors": POSE}, range(7), "pose"),
        ([POSE], range(7), "pose"),
        ({"position": POSE[:3], "orientation": ["w", "x", "y", "z"]}, range(7), "pose"),
        ({name: place for place, name in enumerate(POSE)}, range(7), "pose"),
        (["x", "y", "z", "qx", "qy", "qz", "qw"], [0, 1, 2, 4, 5, 6, 3], "pose"),
        ([f"eef_{name}" for name in POSE], range(7), "pose"),
        (["quat.w", "quat.x", "quat.y", "quat.z", "pos.x", "pos.y", "pos.z"], [3, 4, 5, 6, 0, 1, 2], "pose"),
        ([*POSE, "gripper"], [*range(7), 0], "pose"),
        (["vel_x", "vel_y", "vel_z", *POSE], [0, 0, 0, *range(7)], "pose"),
        (None, range(7), "pose[0:7]"),
        (["ee_pos_quat"], range(7), "pose[0:7]"),
        (None, [0, 1, 2, 4, 5, 6, 3], "pose[0:3, 6, 3:6]"),
        ([f"left_{name}" for name in POSE] + [f"right_{name}" for name in POSE], [*range(7), *[0] * 7],
         f"pose[{', '.join(f'left_{name}' for name in POSE)}]"),
    ],
)  # fmt: skip
def test_columns_are_found_by_all_forms_of_names(tmp_path, names, order, topic):
    path = moves(0)
    write_set(tmp_path / "set", [{"pose": path[:, list(order)]}], {"pose": names})
    (read,) = poses(tmp_path / "set", topic)
    assert read == pytest.approx(path, abs=1e-6)


@pytest.mark.parametrize(
    ("names", "width", "topic", "message"),
    [
        (None, 7, "pose", r"7 columns without names: pose\[0:7\] if qw is the fourth"),
        (
            ["x", "y", "z", "roll", "pitch", "yaw"],
            6,
            "pose",
            r"roll, pitch, yaw.* pose\[x, y, z\] is the pos",
        ),
        (
            [*(f"l_{n}" for n in "xyz"), *(f"r_{n}" for n in "xyz")],
            6,
            "pose",
            r"several positions: pose\[l_x, l_",
        ),
        (["x", "y", "z"], 7, "pose", "names 3 columns of pose, but it has 7"),
        (POSE, 7, "pose[0:8]", "pose has 7 columns"),
        (POSE, 7, "pose[x, y, q]", "has no column q; it has x, y, z"),
        (POSE, 7, "pose[0, 1, 0:1]", "chosen twice"),
        (["a", "b", "c"], 3, "pose", "has the columns a, b, c, not x, y, z"),
    ],
)
def test_columns_that_are_no_pose_are_named(tmp_path, names, width, topic, message):
    write_set(tmp_path / "set", [{"pose": moves(0)[:, :width]}], {"pose": names})
    with pytest.raises(InputError, match=message):
        poses(tmp_path / "set", topic)


def test_a_wrench_is_read_in_the_order_of_its_names(pose_set):
    wrench = read_movement(pose_set, entry("pose", wrench="wrench"), {})[0].streams[1].values
    assert wrench[0].tolist() == [3, 4, 5, 0, 1, 2]
    with pytest.raises(InputError, match="pose has x, y, z, qw, qx, qy, qz, not fx"):
        read_movement(pose_set, entry("pose[x, y, z]", wrench="pose"), {})
    with pytest.raises(InputError, match="pose has x, y, z, qw, qx, qy, qz, which are no joints"):
        read_movement(pose_set, entry("pose[x, y, z]", joint_states=("pose",)), {})


def test_both_layouts_give_the_same_recordings(pose_set, tmp_path):
    episodes = [{"pose": moves(seed)} for seed in range(5)]
    older = write_set(tmp_path / "older", episodes, {"pose": POSE}, version="v2.1")
    for one, other in zip(poses(pose_set), poses(older), strict=True):
        assert np.array_equal(one, other)


FIRST, LAST, MORE = (f"data/chunk-000/file-00{number}.parquet" for number in (0, 2, 3))
LIST = "meta/episodes/chunk-000/file-000.parquet"


def late(rows):
    """Timestamps of which those from frame 30 on are 0.4 s late."""
    return rows["timestamp"].where(rows.index < 30, rows["timestamp"] + 0.4)


def narrow(rows):
    """Poses, of which frame 5 has two values only."""
    return [pose[:2] if row == 5 else pose for row, pose in enumerate(rows["pose"])]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([lost(LAST)], "with episode 4 in data/chunk-000/file-002.parquet: there is no such file"),
        ([unlisted, lost(FIRST)], "5 episodes of 300 frames, has 3 of 180: episodes 0 to 1 are missing"),
        ([edited(LAST, lambda rows: rows[:-9])], "episode 4: .*has 51 frames, but .* says 60"),
        ([unlisted, edited(LAST, lambda rows: rows[:-9])], "says 5 episodes of 300 frames, has 291"),
        ([edited(FIRST, lambda rows: rows.drop(range(20, 28)))], "episode 0: .*frame 19 is followed by 28"),
        ([edited(LAST, lambda rows: rows[9:])], "episode 4: .*begins with frame 9"),
        ([described(fps=20)], "timestamps are 0.03333 s apart, but fps is 20, which means 0.05 s"),
        (
            [edited(LAST, lambda rows: rows.assign(timestamp=late(rows)))],
            "frame 30 comes 0.4333 s after",
        ),
        ([described(total_episodes=50)], "lists episodes 0 to 4, but meta/info.json says 50 episodes"),
        ([described(total_frames=301)], "lists 300 frames, but meta/info.json says total_frames 301"),
        ([edited(LIST, lambda rows: rows.assign(dataset_to_index=7))], "but its frames go from 0 to 7"),
        ([edited(LIST, lambda rows: rows[:4])], "lists episodes 0 to 3, but meta/info.json says 5"),
        ([copied(FIRST, LAST)], "holds episodes 0 to 1, but the set has episode 4 there"),
        (
            [unlisted, copied(FIRST, MORE)],
            "episode 0: frame 0 is both in .*000.parquet and in .*003",
        ),
        ([unlisted, described(total_episodes=4)], "holds episode 4, but the set has 4 episodes"),
        ([edited(LAST, lambda rows: rows.assign(pose=narrow(rows)))], "frame 5: pose has 2 values, not 7"),
    ],
)
def test_what_a_set_says_of_itself_is_held_against_its_frames(pose_set, changes, message):
    for change in changes:
        change(pose_set)
    with pytest.raises(InputError, match=message):
        poses(pose_set)


def test_files_that_a_set_does_not_name_are_left_out(pose_set):
    expected, left_out = poses(pose_set), {}
    copied(FIRST, "data/chunk-000/file-000 (copy).parquet")(pose_set)
    copied(FIRST, MORE)(pose_set)  # as of an older set with more episodes
    assert np.array_equal(poses(pose_set, left_out=left_out), expected)
    assert [name.rpartition("/")[2] for name in left_out] == ["file-000 (copy).parquet", "file-003.parquet"]


def test_a_shape_that_names_and_columns_contradict_is_left_out_and_otherwise_refused(pose_set):
    features, left_out = json.loads((pose_set / "meta/info.json").read_text())["features"], {}
    described(features=features | {"pose": features["pose"] | {"shape": [8]}})(pose_set)
    assert poses(pose_set, left_out=left_out)[0].shape == (60, 7)
    assert "shape [8], but it has 7 columns" in next(iter(left_out.values()))
    described(features=features | {"pose": {"shape": [8], "names": None}})(pose_set)
    with pytest.raises(InputError, match=r"shape \[8\], but it has 7 columns"):
        poses(pose_set, "pose[0:7]")


def test_an_episode_that_fails_is_left_out_if_the_entry_says_so(pose_set):
    edited(FIRST, lambda rows: rows.drop(range(20, 28)))(pose_set)
    left_out, going_on = {}, entry("pose")
    segment = going_on.segment.model_copy(update={"skip_failures": True})
    read = read_movement(pose_set, going_on.model_copy(update={"segment": segment}), left_out)
    assert [one.name for one in read] == [f"episode {number}" for number in range(1, 5)]
    assert "frame 19 is followed by 28" in left_out["episode 0"]


@pytest.mark.parametrize("names", [[f"{name}.pos" for name in JOINTS] + ["gripper.pos"], None])
def test_degrees_are_asked_for_and_read(tmp_path, names):
    state = angles(0)
    degrees = np.hstack([np.degrees(state[:, :7]), state[:, 7:]])
    columns, topic = {"observation.state": names}, "observation.state"
    renamed = () if names else tuple((str(place), name) for place, name in enumerate(JOINTS))
    write_set(tmp_path / "rad", [{topic: state}], columns)
    write_set(tmp_path / "deg", [{topic: degrees}], columns)
    write_set(tmp_path / "counts", [{topic: 2048 + degrees}], columns)
    pose = JointPose(urdf=KUKA, tip=KUKA_TIP, topic=topic, joints=renamed)
    in_degrees = pose.model_copy(update={"units": "deg"})
    (expected,) = poses(tmp_path / "rad", pose)
    with pytest.raises(InputError, match=r"joint_4 goes to -.*, beyond its limit of -2.094 rad.*: degrees\?"):
        poses(tmp_path / "deg", pose)
    (read,) = read_movement(tmp_path / "deg", entry(in_degrees, joint_states=(topic,)), {})
    assert read.streams[0].values == pytest.approx(expected, abs=1e-5)
    assert read.streams[1].values == pytest.approx(state, abs=1e-5)  # the gripper is not in the chain
    with pytest.raises(InputError, match="rad, and not `units: deg`"):
        poses(tmp_path / "rad", in_degrees)
    with pytest.raises(InputError, match="in which units is it"):
        poses(tmp_path / "counts", pose)


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_inspection_proposes_an_entry_that_reads_the_set(tmp_path, version):
    names = [*(f"{name}.pos" for name in JOINTS), "gripper.pos"]
    states = [np.hstack([np.degrees(angles(seed)[:, :7]), np.full((60, 1), 50.0)]) for seed in range(3)]
    episodes = [{"action": state, "observation.state": state} for state in states]
    folder = write_set(tmp_path / "set", episodes, dict.fromkeys(episodes[0], names), version=version)
    report = find_out(str(folder), KUKA)
    proposed = report.proposal.entry
    assert proposed["reader"] == "lerobot"
    assert proposed["topics"]["joint_states"] == "observation.state"
    assert proposed["topics"]["pose"]["units"] == "deg"
    assert "degrees?" in "".join(as_yaml(report.proposal))
    read = read_movement(folder, entry(JointPose(**proposed["topics"]["pose"])), {})
    assert len(read) == len(report.seen.files) == 3
    assert sum("observation.images.top" in line for line in report_lines(report)) == 1


def test_inspection_finds_poses_among_columns(tmp_path):
    states = [{"state": np.hstack([moves(seed), np.ones((60, 1))])} for seed in range(3)]
    folder = write_set(tmp_path / "set", states, {"state": [*(f"eef_{name}" for name in POSE), "gripper"]})
    assert find_out(str(folder)).proposal.entry["topics"] == {"pose": "state"}
    names = ["x", "y", "z", "roll", "pitch", "yaw", "gripper", "other"]
    folder = write_set(tmp_path / "other", states, {"state": {"motors": names}})
    assert find_out(str(folder)).proposal.entry["topics"] == {"pose": "state[x, y, z]"}


def test_inspection_leaves_out_what_the_import_would_refuse(pose_set):
    edited(FIRST, lambda rows: rows.drop(range(20, 28)))(pose_set)
    report = find_out(str(pose_set))
    assert report.proposal.entry["segment"]["skip_failures"] is True
    assert "# left out: episode 0: " in "\n".join(as_yaml(report.proposal))
    lines = "\n".join(report_lines(report))
    assert "episode 0: left out: " in lines
    assert "frame 19 is followed by 28" in lines


def test_a_set_without_frames_is_refused_by_inspection(tmp_path):
    (tmp_path / "meta").mkdir()
    describing = {"codebase_version": "v3.0", "total_episodes": 1, "fps": 30, "features": {}}
    (tmp_path / "meta/info.json").write_text(json.dumps(describing))
    with pytest.raises(InputError, match="data: holds no file of frames"):
        find_out(str(tmp_path))
