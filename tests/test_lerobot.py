"""LeRobotDatasets: what is written, what comes back, and what their own reader makes of it."""

import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet
import pytest
from committed import EXAMPLE_TASK, NO_TOPICS
from readers_sets import write_dataset

from dissertation.simulation.pick_and_place import TIP, URDF, takes, write_takes
from structlearn.core import quaternion
from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers import read_recordings, synchronise
from structlearn.readers.lerobot import read_movement
from structlearn.readers.source import JointPose
from structlearn.rigid_body.urdf import urdf_path
from structlearn.segmentation.segments import cut
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
