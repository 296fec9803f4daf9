"""Movements of joints without a pose: from recordings to a skill that commands joints."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from committed import EXAMPLE_TASK, run_stages, topic_map
from lerobot_sets import write_set
from own_skills import FIT, PANDA, quick_check

from structlearn.command import main
from structlearn.core.artefacts import read_description, read_metrics
from structlearn.core.errors import InputError
from structlearn.core.signals import minimum_jerk
from structlearn.feedback.cpp_export import header
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import ReactiveSkill, demonstrated_workspace
from structlearn.feedback.skill_file import read_skill, write_skill
from structlearn.primitives.fitting import cross_validation, learn_sequence, without_frame
from structlearn.primitives.sequence import PoseGoal, default_goals, unroll
from structlearn.readers import read_demonstrations
from structlearn.readers.demonstration import Demonstration, read_runs, write_runs
from structlearn.segmentation.segments import cut
from structlearn.tasks.inspection.recordings_report import find_out
from structlearn.tasks.movement.lerobot_export import write_lerobot
from structlearn.tasks.task_entry import as_task
from structlearn.tasks.task_files import TaskFiles

RATE_HZ, NAMES = 100.0, ("reach", "place", "back")
JOINTS = tuple(f"panda_joint{place}" for place in range(1, 8))
REST = np.array([0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.8])
STOPS = REST + np.array(
    [[0, 0, 0, 0, 0, 0, 0], [0.5, 0.3, 0, 0.4, 0, -0.2, 0.3], [-0.4, 0.2, 0.1, 0.3, 0.2, 0, 0], [0] * 7]
)  # rad, of the arm that `own_skills` checks
FREE = topic_map(pose=None, joint_states=("/joint_states",))
JOINT_FIT = without_frame(FIT)


def demonstrated(count: int = 6) -> list[Demonstration]:
    """Three moves of all joints from stop to stop, with rests between; stops, durations and rests vary."""
    runs = []
    for number in range(count):
        rng = np.random.default_rng(number)
        stops = STOPS + 0.02 * rng.standard_normal(STOPS.shape)
        starts = np.cumsum(rng.uniform([0.5, 2.0, 2.0], [0.9, 2.6, 2.6]))
        lasts = rng.uniform(1.2, 1.5, 3)
        time = np.arange(0.0, starts[-1] + lasts[-1] + 0.8, 1.0 / RATE_HZ)
        done = [minimum_jerk(np.clip((time - a) / d, 0.0, 1.0)) for a, d in zip(starts, lasts, strict=True)]
        angles = stops[0] + np.stack(done, axis=1) @ np.diff(stops, axis=0)
        angles += 2e-4 * rng.standard_normal(angles.shape)
        true = np.stack([starts, starts + lasts], axis=1)
        beside = {"joint_positions": angles, "joint_names": JOINTS, "of_joints": True, "true_segments": true}
        runs.append(Demonstration(f"{number:02d}", time, angles, **beside))
    return runs


@pytest.fixture(scope="module")
def runs():
    return demonstrated()


@pytest.fixture(scope="module")
def cuts(runs):
    own = EXAMPLE_TASK.segment.model_dump() | {"primitives": NAMES}
    return cut(runs, EXAMPLE_TASK.segment.model_validate(own))


@pytest.fixture(scope="module")
def skill(runs, cuts) -> ReactiveSkill:
    workspace = demonstrated_workspace([run.position for run in runs], 0.05, JOINTS)
    return ReactiveSkill(learn_sequence(runs, cuts.results, JOINT_FIT), workspace=workspace, joints=JOINTS)


def ticked(skill: ReactiveSkill, goals=None) -> np.ndarray:
    controller = Controller(skill, RATE_HZ, goals=goals)
    controller.start(skill.primitives[0].position.start)
    rows = []
    while not controller.finished:
        controller.tick(None)
        rows.append(controller.position.copy())
    return np.array(rows)


def test_joints_are_cut_and_learned_without_a_pose(runs, cuts):
    assert len(cuts.left_out) == len(cuts.warnings) == 0
    for place, table in enumerate(cuts.results.values()):
        true = np.array([run.true_segments[place] for run in runs])
        assert np.abs(table[["start_s", "end_s"]].to_numpy() - true).max() < 0.040
    errors = cross_validation(runs, cuts.results, JOINT_FIT).query("left_out and regression == 'joint'")
    assert errors["mean_joint"].mean() < 0.02  # rad over seven joints, which move by 0.7
    assert "mean_mm" not in errors


def test_the_controller_commands_joints(skill):
    path = unroll(skill.primitives, 1.0 / RATE_HZ).position.position
    np.testing.assert_allclose(ticked(skill), path, atol=1e-9)
    goals = default_goals(skill.primitives)
    moved = [*goals[:-1], PoseGoal(goals[-1].position + 0.03)]
    np.testing.assert_allclose(ticked(skill, moved)[-1], moved[-1].position, atol=2e-3)
    controller = Controller(skill, RATE_HZ)
    controller.start(skill.primitives[0].position.start)
    controller.move_goal("place", STOPS[2] + 0.02)
    assert controller.position.shape == (7,)
    with pytest.raises(InputError, match=r"outside the workspace .*panda_joint2 = 9 is 8\.\d+ above"):
        controller.move_goal("back", np.where(np.arange(7) == 1, 9.0, REST))
    with pytest.raises(InputError, match="the position at the start must be 7 finite numbers"):
        controller.start(np.zeros(3))


def test_the_file_keeps_joints(skill, tmp_path):
    path = tmp_path / "skill.safetensors"
    write_skill(skill, path, {})
    again = read_skill(path)
    assert again.joints == again.workspace.joints == JOINTS
    np.testing.assert_array_equal(ticked(again), ticked(skill))
    assert json.loads(read_description(path))["reactive_skill"]["version"] == 3
    with pytest.raises(InputError, match=r"the skill has joints, which the C\+\+ header does not know"):
        header(skill, "skill_joints", "of a test")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"joints": JOINTS[:6]}, "the workspace is of"),
        ({"joints": JOINTS[:6], "workspace": None}, "'reach' has 7 coordinates, the skill 6: panda_joint1"),
        ({"joints": (), "workspace": None}, "'reach' has 7 coordinates, the skill 3: x, y, z"),
        ({"outputs": ("opening",)}, "'reach' has 0 outputs, the skill 1: opening"),
    ],
)
def test_parts_that_do_not_fit_are_named(skill, changes, message):
    with pytest.raises(InputError, match=message):
        replace(skill, **changes)


def test_the_check_holds_joints_against_the_urdf(skill):
    check = quick_check(skill, PANDA)
    assert check.verdict != "no"
    assert check.margins["run"].nunique() == 1 + 2 * 7 * (1 + 3)
    assert {"joint range", "velocity", "self-collision"} <= set(check.margins["quantity"])
    assert not {"position", "orientation", "singularity"} & set(check.margins["quantity"])
    true = np.abs(unroll(skill.primitives, 1 / 50.0).position.velocity).max(axis=0)
    nominal = check.margins.query("kind == 'nominal' and quantity == 'velocity'").iloc[0]
    assert nominal["value"] == pytest.approx(true[JOINTS.index(nominal["where"])], rel=0.02)
    local = [replace(one.position.local, duration=0.45) for one in skill.primitives]
    hasty = [
        replace(one, position=replace(one.position, local=own))
        for one, own in zip(skill.primitives, local, strict=True)
    ]
    failed = quick_check(replace(skill, primitives=hasty), PANDA)
    assert failed.verdict == "no"
    assert failed.advice.startswith("durations x")
    with pytest.raises(InputError, match="panda_joint7, not panda_finger_joint1: name what does not"):
        quick_check(skill, PANDA.model_copy(update={"locked_joints": ("panda_finger_joint2",)}))


def test_runs_of_joints_come_back_from_their_file(runs, tmp_path):
    write_runs(runs[:2], tmp_path / "runs.parquet")
    for again in (
        read_runs(tmp_path / "runs.parquet"),
        read_runs(tmp_path / "runs.parquet", ("orientation",)),
    ):
        assert again[0].of_joints
        np.testing.assert_array_equal(again[0].position, runs[0].position)


def write_table(path: Path, run: Demonstration) -> None:
    columns = {"time_s": run.time + 1.0}
    columns |= {f"position.{joint}": values for joint, values in zip(JOINTS, run.position.T, strict=True)}
    pd.DataFrame(columns).to_csv(path, index=False)


def test_tables_of_joints_are_read_and_an_entry_is_proposed(runs, tmp_path):
    for run in runs:
        write_table(tmp_path / f"{run.name}.csv", run)
    read = read_demonstrations(tmp_path, FREE, RATE_HZ)
    np.testing.assert_allclose(read[0].position, runs[0].position, atol=1e-6)
    report = find_out(str(tmp_path))
    assert report.proposal.entry["topics"] == {"joint_states": "/joint_states"}
    assert report.proposal.entry["segment"] == {"primitives": 3}


def test_an_angle_that_wraps_around_is_named(runs, tmp_path):
    wound = runs[0].position.copy()
    wound[:, 3] = (4.0 * wound[:, 3] + 14.5) % (2.0 * np.pi)
    write_table(tmp_path / "a.csv", replace(runs[0], position=wound, joint_positions=wound))
    with pytest.raises(InputError, match=r"row \d+ .*the position of panda_joint4 jumps by 6.*whole range"):
        read_demonstrations(tmp_path, FREE, RATE_HZ)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"topics": {}}, "needs a `pose`, or else `joint_states`"),
        ({"segment": {"primitives": [{"name": "a", "axis": "z"}]}}, "all joints together show a primitive"),
        ({"fit": {"frame": "reach"}}, "joints have no frame but `none`"),
        ({"turns": True, "presegmented": "a"}, "turns: needs a pose, but topics name none"),
        ({"topics": {"pose": "/p", "outputs": {"a": "/a"}, "digital": {"a": "/b"}}}, "more than once: a"),
        ({"topics": {"pose": "/p"}, "fit": {"frame": "none"}}, "a pose has a frame, not `none`"),
    ],
)
def test_an_entry_that_joints_cannot_have_is_refused(entry, message):
    whole = {"source": "x", "topics": {"joint_states": "/j"}, "segment": {"primitives": 2}} | entry
    with pytest.raises(InputError, match=message):
        as_task("movement", whole, Path("structlearn.yaml"), "movement.a")


def test_the_exported_set_has_joints_alone(runs, cuts, tmp_path):
    write_lerobot(runs, cuts, tmp_path / "set", "reach", 5.0)
    features = json.loads((tmp_path / "set/meta/info.json").read_text())["features"]
    assert features["observation.state"]["names"] == features["action"]["names"] == list(JOINTS)
    assert "observation.pose" not in features


@pytest.fixture(scope="module")
def project(runs, tmp_path_factory):
    """From a LeRobotDataset of uncalibrated joints to a page, by `new` and the stages that `run` runs."""
    folder = tmp_path_factory.mktemp("joints")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        thinned = [{"observation.state": 50.0 * run.position[::4]} for run in runs]  # shares of a range
        columns = [f"{joint}.pos" for joint in JOINTS]
        write_set(Path("so101"), thinned, {"observation.state": columns}, fps=25)
        main(["new", "reach", "--from", "so101"])
        patch.chdir("reach")
        run_stages("reach", "import_task", "segment", "primitives", "feedback", "skill", "check")
        run_stages("reach", "report", "view")
        yield TaskFiles("reach")


def test_a_lerobot_set_without_urdf_becomes_a_skill(project):
    metrics = read_metrics(project.folder / "primitives/metrics.json")
    assert max(metrics[f"primitives_move_{place}_left_out_joint"] for place in (1, 2, 3)) < 50.0 * 0.04
    skill = read_skill(project.skill)
    assert skill.joints == JOINTS
    np.testing.assert_allclose(ticked(skill)[-1], 50.0 * STOPS[-1], atol=1.5)


def test_its_page_says_what_was_not_checked(project):
    words = re.sub(r"<[^>]*>", "", (project.report / "index.html").read_text())
    assert "the joints themselves, in the unit in which they were recorded" in words
    assert "Not checked, since the entry names no URDF" in words
    assert "velocities, accelerations, jerk and self-collisions" in words
    assert " mm" not in words.replace("mm/s", "")
    assert (project.report / "rerun/primitives.rrd").stat().st_size > 10_000
