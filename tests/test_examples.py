"""The examples run, each as its first lines say, on less data or for a shorter time."""

import importlib.util
import runpy
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from own_skills import pick_skill, slower

from dissertation.simulation.pick_and_place import takes, write_takes
from structlearn.core.artefacts import write_table
from structlearn.feedback.skill_file import read_skill, write_skill
from structlearn.primitives.sequence import default_start, sequence_table, unroll

ROOT = Path(__file__).parents[1]


def example(name):
    """An example as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def short_skill(tmp_path_factory):
    """The file of a skill of half a second."""
    path = tmp_path_factory.mktemp("skill") / "skill.safetensors"
    skill = pick_skill()
    write_skill(slower(replace(skill, primitives=skill.primitives[:1]), 0.4), path, {})
    return str(path)


def test_learning_from_bags(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "examples/pick.yaml", "structlearn.yaml")
    (tmp_path / "data/example/pick").mkdir(parents=True)
    write_takes(takes(seed=1, moves=3, count=3), tmp_path / "data/example/pick")
    learn = example("learn_from_bags")
    path = learn.main("pick")
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines[:3]] == ["reach", "carry", "retreat"]
    assert np.isfinite(path.position.position).all()
    assert len(path.switches) == 4


def test_pybullet_and_a_loop_follow(short_skill):
    found = example("pybullet_1khz").main(short_skill)
    assert found["ticks"] == pytest.approx(1e3 * read_skill(short_skill).primitives[0].duration, abs=2)
    assert found["tip off (mm)"] < 20.0
    assert found["largest lag (ms)"] >= found["lag at the end (ms)"] >= 0.0
    ticks = found["ticks"]
    found = example("follower_loop").main(short_skill)  # it counts its deadlines
    assert found["ticks"] == pytest.approx(ticks, abs=2)
    assert 0.0 < found["median (ms)"] <= found["99 % (ms)"]
    assert 0 <= found["missed"] <= found["ticks"]


@pytest.mark.parametrize(
    ("name", "words", "code", "said"),
    [
        ("pybullet_1khz", [], 2, "pybullet_1khz.py: error: the following arguments are required: file"),
        ("pybullet_1khz", ["none"], 1, "error: none: no such file; run the stage that writes it"),
        ("follower_loop", [], 2, "follower_loop.py: error: the following arguments are required: file"),
        ("follower_loop", ["none", "--gui"], 2, "follower_loop.py: error: unrecognized arguments: --gui"),
        ("learn_from_bags", [], 2, "learn_from_bags.py: error: the following arguments are required: name"),
        ("learn_from_bags", ["pick"], 1, "error: structlearn.yaml: no such file here"),
        ("read_results", [], 1, "error: reports: no such folder; go to the project's root first"),
    ],
)
def test_wrong_words_are_one_line(tmp_path, monkeypatch, capsys, name, words, code, said):
    monkeypatch.chdir(tmp_path)
    script = str(ROOT / "examples" / f"{name}.py")
    monkeypatch.setattr(sys, "argv", [script, *words])
    with pytest.raises(SystemExit) as exit_:
        runpy.run_path(script, run_name="__main__")
    assert exit_.value.code == code
    assert capsys.readouterr().err.splitlines()[-1].startswith(said)


class FakeNode:
    """What the example uses of `rclpy.node.Node`; its clock is `time_s`, and `published` what it sent."""

    def __init__(self, name):
        self.time_s, self.published, self.callbacks = 100.0, [], {}

    def create_subscription(self, kind, topic, callback, depth):
        self.callbacks[topic] = callback

    def create_publisher(self, kind, topic, depth):
        assert topic == "target_pose"
        return SimpleNamespace(publish=self.published.append)

    def create_timer(self, period_s, callback):
        self.period_s = period_s

    def get_clock(self):
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=1e9 * self.time_s))


class FakePose:
    """A `PoseStamped`."""

    def __init__(self, position=(0.0, 0.0, 0.0), orientation=(1.0, 0.0, 0.0, 0.0)):
        point = SimpleNamespace(**dict(zip("xyz", position, strict=True)))
        turn = SimpleNamespace(**dict(zip("wxyz", orientation, strict=True)))
        self.header, self.pose = "base", SimpleNamespace(position=point, orientation=turn)


@pytest.fixture
def ros(monkeypatch):
    monkeypatch.setitem(sys.modules, "rclpy", SimpleNamespace(node=None))
    monkeypatch.setitem(sys.modules, "rclpy.node", SimpleNamespace(Node=FakeNode))
    messages = SimpleNamespace(PoseStamped=FakePose, WrenchStamped=object)
    monkeypatch.setitem(sys.modules, "geometry_msgs", SimpleNamespace(msg=messages))
    monkeypatch.setitem(sys.modules, "geometry_msgs.msg", messages)


@pytest.mark.parametrize("silent_from", [None, 30])
def test_a_ros_node_publishes_targets_until_the_end_or_until_poses_are_stale(ros, short_skill, silent_from):
    node = example("ros2_node").SkillNode(short_skill)
    start = default_start(read_skill(short_skill).primitives)
    for tick in range(2000):
        if silent_from is None or tick < silent_from:
            node.callbacks["current_pose"](FakePose(start.position, start.orientation))
        node.tick()
        node.time_s += node.period_s
        if node.done:
            break
    first, last = node.published[0].pose, node.published[-1].pose
    assert [first.position.x, first.position.y, first.position.z] == pytest.approx(list(start.position))
    assert first.orientation.w == pytest.approx(start.orientation[0])
    if silent_from is None:
        assert node.done == "finished"
        goal = read_skill(short_skill).primitives[-1].position.goal
        assert [last.position.x, last.position.y, last.position.z] == pytest.approx(list(goal), abs=2e-3)
    else:
        assert node.done == "stopped, stale: pose"
        assert len(node.published) == pytest.approx(silent_from + 0.1 / node.period_s, abs=2)


def test_reading_results(tmp_path, monkeypatch, capsys):
    read = example("read_results")
    monkeypatch.chdir(ROOT)
    assert {"scraping", "dynamics"} <= set(read.key_figures()["report"])
    assert read.verdicts().loc["scraping", "yes"] > 0
    monkeypatch.chdir(tmp_path)
    skill = pick_skill()
    path = unroll(skill.primitives, 0.01)
    names = [primitive.name for primitive in skill.primitives]
    write_table(sequence_table(path, names), Path("data/tasks/pick/primitives/nominal.parquet"))
    speeds = read.peak_speeds(Path("data/tasks/pick"))
    assert list(speeds.index) == names
    assert speeds.max() == pytest.approx(np.linalg.norm(path.position.velocity, axis=1).max())
