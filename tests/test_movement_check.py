"""A skill held against a robot: what is tried, margins in closed form, and what is told of it."""

import re
import shutil
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from committed import own_tasks
from own_skills import PANDA, pick_skill, quick_check
from rigid_body_arms import planar_arm

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.feedback.skill import ReactiveSkill, Workspace
from structlearn.primitives.transformation import ALPHA, BETA
from structlearn.readers.urdf_file import urdf_path
from structlearn.reporting.document import Document, Panel, Source, render
from structlearn.rigid_body.arm_kinematics import JointPath, read_arm, read_collision_shapes
from structlearn.rigid_body.urdf import named_files
from structlearn.tasks.movement import check_results, check_section, skill_check
from structlearn.tasks.movement.parameters import Placement
from structlearn.tasks.movement.skill_check import Unroll, unrolls
from structlearn.tasks.task_entry import file_digests, read_task
from structlearn.tasks.task_files import TaskFiles

RATE_HZ = skill_check.RATE_HZ
ENTRY = {"source": "bags", "topics": {"pose": "/pose"}, "segment": {"primitives": 1}}


@pytest.fixture(scope="module")
def check():
    return quick_check(pick_skill(("x", "rz")), PANDA)


@pytest.fixture(scope="module")
def nominal_alone():
    """Without corners and corrections."""
    return ReactiveSkill(pick_skill().primitives)


def test_everything_that_may_vary_is_tried():
    runs = list(unrolls(pick_skill(("x", "rz")), 100.0))
    assert [run.kind for run in runs] == (
        ["nominal"] + 8 * ["starts"] + 2 * 8 * ["goals"] + 2 * 2 * ["corrections"]
    )
    assert len({run.name for run in runs}) == len(runs)
    box = pick_skill().workspace
    ends = {"-": box.low, "+": box.high}
    for run in (run for run in runs if run.kind in ("starts", "goals")):
        signs = [part[-1] for part in run.name.split()[-3:]]
        corner = [ends[sign][axis] for axis, sign in enumerate(signs)]
        if run.kind == "starts":
            np.testing.assert_allclose(run.position[0], corner, atol=1e-12)
        elif "retreat" in run.name:
            np.testing.assert_allclose(run.position[-1], corner, atol=2e-3)


def test_corrections_are_held_at_their_bound_in_both_directions():
    skill = pick_skill(("x", "rz"))
    nominal, *others = unrolls(skill, 100.0)
    runs = {run.name: run for run in others if run.kind == "corrections"}
    for sign, name in ((1, "x +"), (-1, "x -")):
        shift = (runs[name].position - nominal.position)[:, 0]
        bound = skill.limits.largest_coupling["x"] / (ALPHA * BETA)
        assert sign * shift[-1] == pytest.approx(bound, rel=0.05)
        assert np.abs(runs[name].position - nominal.position)[:, 1:].max() < 1e-9
    for sign, name in ((1, "rz +"), (-1, "rz -")):
        turn = quaternion.difference(runs[name].orientation, nominal.orientation)[:, 2]
        bound = skill.limits.largest_coupling["rz"] / (ALPHA * BETA)
        assert sign * turn[-1] == pytest.approx(bound, rel=0.1)


def test_margins_of_a_swinging_joint_are_those_of_a_sine(tmp_path):
    (tmp_path / "arm.urdf").write_text(planar_arm(0.5, reach=2.0, velocity=4.0))
    arm = read_arm(tmp_path / "arm.urdf", "tip")
    time, size, pace = np.arange(0, 1, 1 / RATE_HZ), 1.2, 3.0
    joints = size * np.sin(pace * time)[:, None]
    jacobian = np.zeros((len(time), 3, 1))
    jacobian[:, 1, 0] = 0.5
    path = JointPath(joints, np.full(len(time), 4e-4), np.zeros(len(time)), jacobian)
    bounds = {"max_acceleration": 10.0, "max_jerk": 40.0, "least_singular_value": 0.25}
    rows = skill_check.margins(arm, path, PANDA.model_copy(update=bounds), None)
    rows = {row["quantity"]: row for row in rows}
    expected = {
        "position": 1 - 0.4,
        "joint range": 1 - size / 2.0,
        "velocity": 1 - size * pace / 4.0,
        "acceleration": 1 - size * pace**2 / 10.0,
        "jerk": 1 - size * pace**3 / 40.0,
        "joint jump": 1 - size * pace / RATE_HZ / skill_check.JUMP,
        "singularity": 1.0,  # twice what is asked for
    }
    for quantity, margin in expected.items():
        assert rows[quantity]["margin"] == pytest.approx(margin, abs=4e-3), quantity
    assert rows["acceleration"]["verdict"] == "no"
    assert rows["velocity"]["verdict"] == "doubtful"
    assert rows["joint range"]["verdict"] == "yes"
    assert rows["acceleration"]["time_s"] == pytest.approx(np.pi / 2 / pace, abs=2 / RATE_HZ)
    assert (rows["joint range"]["bound"], rows["velocity"]["unit"]) == (2.0, "rad/s")
    assert rows["self-collision"]["verdict"] == "not tested"


def test_base_and_tool_stand_where_they_are_said_to():
    rng = np.random.default_rng(3)
    position, turns = rng.normal(size=(5, 3)), quaternion.normalised(rng.normal(size=(5, 4)))
    base = Placement(position_m=(0.3, -0.2, 0.1), orientation=(np.cos(0.4), 0.0, 0.0, np.sin(0.4)))
    tool = Placement(position_m=(0.0, 0.05, 0.12), orientation=(np.cos(0.2), np.sin(0.2), 0.0, 0.0))
    placed = PANDA.model_copy(update={"base": base, "tool": tool})
    tip = skill_check.in_arm_frames(Unroll("nominal", "", position, turns), placed)
    back = quaternion.product(base.turn, quaternion.product(tip.orientation, tool.turn))
    np.testing.assert_allclose(quaternion.angle_between(back, turns), 0.0, atol=1e-7)
    point = tip.position + quaternion.rotate(tip.orientation, np.array(tool.position_m))
    np.testing.assert_allclose(
        quaternion.rotate(base.turn, point) + np.array(base.position_m), position, atol=1e-12
    )
    with pytest.raises(InputError, match=r"robot\.tool: a skill without orientations"):
        skill_check.in_arm_frames(Unroll("nominal", "", position, None), placed)


def test_the_arm_can_do_what_was_led_with_it(check):
    nominal = check.margins[check.margins["kind"] == "nominal"]
    assert set(nominal["verdict"]) == {"yes"}
    assert (nominal.loc[nominal["quantity"] == "position", "value"] < 1e-8).all()
    assert check.notes == ()


def test_advice_was_tried(nominal_alone):
    found = skill_check.check_skill(nominal_alone, PANDA.model_copy(update={"max_acceleration": 3.0}))
    assert (found.verdict, set(found.failing["quantity"])) == ("no", {"acceleration"})
    assert found.notes == ("the skill has no workspace, so starts and goals elsewhere were not tried",)
    (tried,) = found.tried.itertuples()
    assert (tried.failing_runs, tried.still_failing) == (1, 0)
    assert 0.0 <= tried.least_margin_share < 0.05  # no slower than it has to be
    assert found.advice == tried.change == f"durations x {1.01 * found.stretch:.2f}"
    (fault,) = found.faults
    assert re.match(
        r"acceleration of panda_joint\d is [\d.]+ rad/s² at [\d.]+ s \(as demonstrated\), its bound 3$", fault
    )
    assert f"advice: {found.advice}" in check_results.check_lines(found)


BOTH = "workspace_margin_m smaller by {} m and corrections of at most {}% of their bounds"
SLOWER = "durations x 2.02"


@pytest.mark.parametrize(
    ("failing", "expected"),
    [
        ([], []),
        ([("nominal", "position")], []),
        ([("nominal", "velocity"), ("goals", "velocity")], [SLOWER]),
        ([("starts", "joint range")], [f"workspace_margin_m smaller by {inset} m" for inset in (0.02, 0.05)]),
        (
            [("corrections", "jerk"), ("goals", "velocity")],
            [SLOWER]
            + [
                BOTH.format(*change) + slower
                for change in ((0.02, 67), (0.05, 33))
                for slower in ("", f" and {SLOWER}")
            ],
        ),
    ],
)
def test_what_is_tried_follows_from_what_fails(failing, expected):
    rows = [(kind, quantity, -1.0, "no", "1") for kind, quantity in failing]
    rows += [("nominal", quantity, 0.5, "yes", "0") for quantity in ("velocity", "acceleration", "jerk")]
    margins = pd.DataFrame(rows, columns=["kind", "quantity", "margin", "verdict", "run"])
    check = check_results.SkillCheck(margins, {}, (), check_results.NOTHING_TRIED)
    skill = replace(pick_skill(("x",)), workspace=Workspace(np.zeros(3), np.full(3, 0.2)))
    found = list(skill_check.remedies(skill, check))
    assert [change for change, *_ in found] == expected
    for change, changed, slower in found:
        assert (slower > 1.0) == ("durations" in change)
        side = changed.workspace.high - changed.workspace.low
        assert side.max() == pytest.approx(0.16 if "0.02" in change else 0.1 if "0.05" in change else 0.2)
        share = changed.limits.largest_coupling["x"] / skill.limits.largest_coupling["x"]
        assert share == pytest.approx(2 / 3 if "67" in change else 1 / 3 if "33" in change else 1.0)


def test_what_does_not_fit_the_arm_is_told_by_key(nominal_alone):
    for key, values, counts in (
        ("max_jerk", (1.0, 2.0), "has 2 values for 7 joints: panda_joint1"),
        ("rest_configuration", (0.0,), "has 1 values for 7 joints"),
    ):
        with pytest.raises(InputError, match=rf"robot\.{key}: {counts}"):
            quick_check(nominal_alone, PANDA.model_copy(update={key: values}))
    with pytest.raises(InputError, match="there is no link 'hand'; there are panda_link0, "):
        quick_check(nominal_alone, PANDA.model_copy(update={"tip": "hand"}))
    with pytest.raises(ValueError, match="has norm 1"):
        Placement(position_m=(0.0, 0.0, 0.0), orientation=(1.0, 0.5, 0.0, 0.0))
    base = Placement(position_m=(3.0, 0.0, 0.0), orientation=(1.0, 0.0, 0.0, 0.0))
    away = PANDA.model_copy(update={"base": base, "rest_configuration": None})
    with pytest.raises(InputError, match="is the base where the demonstrations have their origin"):
        quick_check(nominal_alone, away)


def test_an_arm_whose_shapes_are_lost_is_checked_but_for_collisions(nominal_alone, tmp_path):
    """With a rest configuration that is looked for, and shapes in a folder that is not there."""
    text = Path(urdf_path(PANDA.urdf)).read_text()
    (tmp_path / "panda.urdf").write_text(text.replace("package://meshes", "package://lost"))
    lost = PANDA.model_copy(update={"urdf": str(tmp_path / "panda.urdf"), "rest_configuration": None})
    found = quick_check(nominal_alone, lost)
    assert found.notes[0].startswith("self-collision was not tested: ")
    assert "lost" in found.notes[0]
    assert found.verdict == "doubtful"
    doubtful = set(found.margins.loc[found.margins["verdict"] != "yes", "quantity"])
    assert doubtful <= {"self-collision", *check_results.SLOWED, "joint range"}


def test_what_was_found_is_read_as_it_was_written(check, tmp_path):
    noted = replace(check, notes=("nobody looked", "nor did we"))
    check_results.write_check(noted, tmp_path / "check")
    read = check_results.read_check(tmp_path / "check")
    assert (read.metrics(), read.rest, read.notes) == (noted.metrics(), noted.rest, noted.notes)


def with_verdicts(check, verdict):
    """The same, with one verdict for everything."""
    return replace(check, margins=check.margins.assign(verdict=verdict))


def files_of(check, folder, monkeypatch, robot):
    """A task whose check was written below a folder."""
    monkeypatch.chdir(folder)
    files = TaskFiles("pick")
    check_results.write_check(check, files.folder / "check")
    files.skill.parent.mkdir(exist_ok=True)
    files.skill.touch()
    own_tasks(folder, pick=ENTRY | ({"robot": robot} if robot else {}))
    content = {"kind": "movement", "entry": read_task("pick").model_dump(mode="json")}
    files.parameters.write_text(yaml.safe_dump(content))
    return files


def test_the_command_says_whether_something_fails(check, tmp_path, monkeypatch, capsys):
    entry = PANDA.model_dump(mode="json")
    for verdict, told in (("yes", "yes"), ("not tested", "doubtful"), ("doubtful", "doubtful"), ("no", "no")):
        assert with_verdicts(check, verdict).verdict == told  # the worst of all
    assert check_results.main(files_of(with_verdicts(check, "doubtful"), tmp_path, monkeypatch, entry))
    assert not check_results.main(files_of(with_verdicts(check, "no"), tmp_path, monkeypatch, entry))
    told = capsys.readouterr().out
    assert f"no: {check.metrics()['check_runs']} of" in told
    assert "self-collision" in told
    with pytest.raises(InputError, match=r"movement\.pick has no robot"):
        check_results.main(files_of(check, tmp_path, monkeypatch, None))


def test_the_section_says_what_was_found(check, tmp_path, monkeypatch):
    files = files_of(check, tmp_path, monkeypatch, PANDA.model_dump(mode="json"))
    section = check_section.check_section(files)
    assert all(name.startswith("check_") for name in section.find)
    assert len(section.tables["check"].frame) == 9  # quantities
    assert len(section.tables["check_runs"].frame) == check.metrics()["check_runs"]
    sources = {"check": Source("data/tasks/pick/check", "check@pick")}
    its = {"facts": {"check": section.facts}, "tables": section.tables, "sources": sources}
    page = Document("check.html.jinja", "structlearn.tasks.movement", **its)
    panel = [Panel("figures/check_margins.svg", 700, 300)]
    text = render(page, dict.fromkeys(section.pictures, panel))
    assert "panda_grasptarget" in text
    assert "panda_joint7 0.80" in text


MESHES = {
    "package://robot/meshes/a.obj": "robot/meshes/a.obj",
    "model://meshes/b.obj": "robot/meshes/b.obj",
    "meshes/c.obj": "robot/meshes/c.obj",
    "../beside.obj": "beside.obj",
    "file://{}/absolute.obj": "absolute.obj",
    "package://driver/d.obj": "ros/driver/d.obj",
}
LINK = """<link name="{0}"><collision><geometry><mesh filename="{1}"/></geometry></collision></link>"""
JOINT = """<joint name="to_{1}" type="revolute"><parent link="{0}"/><child link="{1}"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""


def test_a_robot_is_known_with_every_mesh_that_its_check_reads(tmp_path, monkeypatch):
    """A check of another mesh is another check; meshes are found where Pinocchio finds them."""
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    names = {name.format(tmp_path): tmp_path / place for name, place in MESHES.items()}
    for path in names.values():
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(urdf_path("franka_panda/meshes/collision/link5.obj"), path)
    links = [f"link_{number}" for number in range(len(names))]
    parts = [LINK.format(*one) for one in zip(links, names, strict=True)]
    parts += [JOINT.format(*pair) for pair in pairwise(links)]
    urdf = tmp_path / "robot/arm.urdf"
    urdf.write_text(f"<robot name='arm'>{''.join(parts)}<plugin filename='absent.so'/></robot>")
    arm = read_arm(urdf, links[-1])
    shapes = read_collision_shapes(arm, (), np.zeros(len(links) - 1)).meshes.geometryObjects
    read = {shape.name.removesuffix("_0"): Path(shape.meshPath) for shape in shapes}
    assert {name: read[link] for name, link in zip(names, links, strict=True)} == named_files(urdf)
    before = file_digests(str(urdf), meshes=True)
    assert set(before) == {str(urdf), *(f"{urdf}: {name}" for name in names)}
    for name, path in names.items():
        path.write_text(path.read_text().replace("v ", "v 1", 1))
        now = file_digests(str(urdf), meshes=True)
        assert {key for key in now if now[key] != before[key]} == {f"{urdf}: {name}"}
        before = now
