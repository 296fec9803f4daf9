"""The C++ header of a skill does what the controller in Python does."""

import copy
import shutil
import struct
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from feedback_skills import random_network, random_skill

from structlearn import command
from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.feedback.cpp_export import header, namespace_of, write_header
from structlearn.feedback.models.ffnn import FeedForwardNetwork
from structlearn.feedback.models.pmnn import open_loop
from structlearn.feedback.runtime import Controller, Status
from structlearn.feedback.skill import Limits, ReactiveSkill, Workspace
from structlearn.feedback.skill_file import write_skill
from structlearn.primitives.sequence import default_goals, default_start
from structlearn.tasks.task_files import TaskFiles

HERE = Path(__file__).parent
TICKS = 100_000
FAR = 1e9  # no scale for differences
SAME = 1e-12  # relative to the largest value of each output in all runs
SENSOR = np.array([300.0, 310.0, 290.0, 305.0, 280.0, 320.0])
ANYWHERE = Workspace(np.full(3, -2.0), np.full(3, 2.0))
PLAN, START, TICK, TICK_WITH_SAMPLE, MOVE_GOAL, COPY = range(6)
ARRAYS = (
    *("position", "velocity", "acceleration", "orientation", "angular_velocity", "angular_acceleration"),
    *("deviation", "coupling"),
)
CHECKED = ("-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Wsign-conversion")
CHECKED += ("-Werror", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-D_GLIBCXX_ASSERTIONS")

pytestmark = pytest.mark.skipif(shutil.which("g++") is None, reason="there is no g++")


def felt_skill():
    """Networks of several sizes on four axes, one without sensors, and sensors of all primitives."""
    rng = np.random.default_rng(1)
    networks = {
        "down": {"z": open_loop(rng.normal(0.0, 2.0, 11)), "ry": random_network(rng, size=20.0)},
        "tilt": {"ry": random_network(rng, size=60.0), "x": random_network(rng, kernels=9, hidden=(7, 5))},
        "scrape": {"rz": random_network(rng, hidden=(), size=5.0)},
    }
    limits = Limits(largest_coupling={"x": 1.0, "z": 2.0, "ry": 15.0, "rz": 10.0}, fade_s=0.02)
    skill = random_skill(rng, networks, limits=limits)
    return replace(skill, workspace=ANYWHERE, sensors=(("finger 1", 4), ("finger 2", 2)))


def plain_skill():
    """Points only: no orientation, no sensor, no feedback; one primitive in the frame of the base."""
    down, tilt, scrape = random_skill(np.random.default_rng(2), turned=False).primitives
    primitives = (down, replace(tilt, position=replace(tilt.position, frame="world")), scrape)
    return ReactiveSkill(primitives, workspace=ANYWHERE)


def strange_skill():
    """Traces and a network of one primitive only, whose inputs may overflow; a name for no compiler."""
    rng = np.random.default_rng(3)
    network = replace(random_network(rng, size=20.0), input_scale=np.full(6, 1e-3))
    skill = random_skill(rng, {"tilt": {"rx": network}})
    down, tilt, scrape = skill.primitives
    name = 'dé "??/\\\n  8'
    expected = {"tilt": skill.expected["tilt"]}
    limits = Limits(largest_coupling={"rx": 4.0}, offset_within_s=0.045)
    return replace(
        skill,
        primitives=(replace(down, name=name), tilt, scrape),
        expected=expected,
        limits=limits,
        workspace=ANYWHERE,
    )


SKILLS = {"felt": felt_skill, "plain": plain_skill, "strange": strange_skill}


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """`controller_runs.cpp` with the headers of all skills, with sanitizers."""
    folder = tmp_path_factory.mktemp("cpp")
    for name, skill in SKILLS.items():
        write_skill(skill(), folder / "skill.safetensors", {})
        write_header(folder / "skill.safetensors", name, folder)
    source = HERE / "controller_runs.cpp"
    subprocess.run(["g++", *CHECKED, "-Og", "-I", folder, source, "-o", folder / "runs"], check=True)
    return folder / "runs"


class Runs:
    """Runs of the controller in Python, with the commands that repeat them in C++."""

    def __init__(self, skill):
        self.skill, self.controller = skill, None
        self.commands, self.outputs, self.results = [], [], []  # bytes of doubles; a result per command
        self.width = 23 + skill.channels + len(skill.axes)

    def do(self, command, call, *numbers):
        """Run a command; `numbers`: what C++ is told."""
        self.commands.append(np.hstack([command, *numbers]).astype(float).tobytes())
        try:
            result = call()
        except InputError:
            result = -1
        self.record(0 if result is None else result)

    def record(self, result):
        self.results.append(result)
        if (now := self.controller) is None or not now._started:  # then C++ has NaN
            self.outputs.append(np.full(self.width, np.nan).tobytes())
        else:
            self.outputs += [getattr(now, name).tobytes() for name in ARRAYS]
            self.outputs.append(struct.pack("4d", now.primitive, now.time, now.phase, now.finished))

    def plan(self, rate, durations=None, goals=None, feedback=True):
        """Let there be another controller."""
        goals = default_goals(self.skill.primitives) if goals is None else goals
        if durations is None:
            durations = [primitive.duration for primitive in self.skill.primitives]

        def plan():
            self.controller = None
            self.controller = Controller(self.skill, rate, durations, goals, feedback)

        numbers = [number for goal in goals for number in (goal.position, unit(goal.orientation))]
        self.do(PLAN, plan, rate, feedback, durations, *numbers)

    def start(self, position, orientation):
        self.do(START, lambda: self.controller.start(position, orientation), position, unit(orientation))

    def tick(self, sample=None):
        felt = sample is not None and self.skill.channels > 0
        self.commands.append(bytes_of(TICK_WITH_SAMPLE) + sample.tobytes() if felt else bytes_of(TICK))
        self.record(self.controller.tick(sample))

    def move_goal(self, primitive, position, orientation=None):
        def move():
            self.controller.move_goal(primitive, position, orientation)

        self.do(MOVE_GOAL, move, primitive, orientation is not None, position, unit(orientation))

    def copy(self):
        self.controller = copy.deepcopy(self.controller)
        self.do(COPY, lambda: 0)

    def repeated(self, program, name):
        """Results (K,) and outputs (K, W) in Python and in C++, and the messages there."""
        done = subprocess.run(
            [program, name], input=b"".join(self.commands), capture_output=True, check=False
        )
        assert done.returncode == 0, done.stderr.decode()
        theirs = np.frombuffer(done.stdout).reshape(-1, 1 + self.width)
        mine = np.column_stack([self.results, np.frombuffer(b"".join(self.outputs)).reshape(-1, self.width)])
        return mine, theirs, done.stderr.decode().splitlines()


def bytes_of(number):
    """A double."""
    return struct.pack("d", number)


def unit(orientation):
    """An orientation, or the identity without one."""
    return quaternion.IDENTITY if orientation is None else orientation


def sensor(rng, channels):
    """A sensor that reads nothing, noise, NaN, infinity or far too much, for a while each."""
    kinds = {"good": 0.5, "slow": 0.2, "missing": 0.1, "nan": 0.08, "infinite": 0.04, "huge": 0.08}
    kind = "good"
    while True:
        samples = np.resize(SENSOR, channels) + rng.normal(0.0, 30.0, (40, channels))
        if kind in ("nan", "infinite"):
            samples[:, channels // 2 :] = np.nan if kind == "nan" else -np.inf
        if kind == "huge":
            samples[:] = np.resize([1e307, -1e307], channels)  # sums of larger ones depend on their order
        for k, sample in enumerate(samples):
            yield None if kind == "missing" or (kind == "slow" and k % 10) else sample
        kind = rng.choice(list(kinds), p=list(kinds.values()))


def random_runs(name, ticks):
    """Runs with every kind of sample, other starts, goals, durations and rates, and goals that move."""
    rng = np.random.default_rng(list(SKILLS).index(name))
    skill = SKILLS[name]()
    runs, start = Runs(skill), default_start(skill.primitives)
    turned = start.orientation is not None

    def near(pose):
        turn = quaternion.from_rotation_vector(rng.uniform(-0.2, 0.2, 3))
        orientation = quaternion.product(turn, pose.orientation) if turned else None
        return replace(pose, position=pose.position + rng.uniform(-0.05, 0.05, 3), orientation=orientation)

    while len(runs.results) < ticks:
        goals = [near(goal) for goal in default_goals(skill.primitives)]
        durations = [rng.uniform(0.7, 1.3) * primitive.duration for primitive in skill.primitives]
        runs.plan(rng.choice([100.0, 333.3, 1000.0]), durations, goals, feedback=rng.uniform() < 0.9)
        for late_s in 0.06 * rng.integers(3, size=3):  # before the first sample
            pose = near(start)
            runs.start(pose.position, pose.orientation)
            samples = sensor(rng, skill.channels)
            end = sum(durations) + rng.uniform(0.2, 2.5) * durations[-1]
            while (time := runs.controller.time) < end:
                for _ in range(100):
                    runs.tick(next(samples) if time >= late_s else None)
                index = int(rng.integers(len(goals)))
                if index >= runs.controller.primitive:
                    goal = near(goals[index])
                    runs.move_goal(index, goal.position, goal.orientation if rng.uniform() < 0.5 else None)
                if rng.uniform() < 0.1:
                    runs.copy()
    return runs


@pytest.mark.parametrize(("name", "share"), [("felt", 0.7), ("plain", 0.1), ("strange", 0.2)])
def test_ticks_are_those_of_the_controller_in_python(program, name, share):
    mine, theirs, _ = random_runs(name, share * TICKS).repeated(program, name)
    assert len(mine) == len(theirs)
    np.testing.assert_array_equal(theirs[:, 0], mine[:, 0])  # flags, and what was refused
    assert np.bitwise_or.reduce(mine[:, 0].astype(int)) == (sum(Status) if name != "plain" else 0)
    largest = np.nanmax(np.where(np.abs(mine) < FAR, np.abs(mine), 0.0), axis=0)
    bound = SAME * np.maximum(largest, np.abs(mine))
    assert np.array_equal(np.isnan(theirs), np.isnan(mine))
    assert (np.isnan(mine) | (np.abs(theirs - mine) <= bound)).all()


def test_bad_input_is_refused_in_words_and_changes_nothing(program):
    skill = felt_skill()
    runs, goals, start = Runs(skill), default_goals(skill.primitives), default_start(skill.primitives)
    far, turned = start.position + 9.0, quaternion.product([0.0, 1.0, 0.0, 0.0], start.orientation)
    for rate in (0.0, np.nan, -1.0, 20e3):
        runs.plan(rate)
    for durations in ([0.5, np.nan, 0.5], [0.5, 0.5, 1e-4], [1e4, 1.0, 1.0], [np.inf, 1.0, 1.0]):
        runs.plan(1000.0, durations)
    runs.plan(1000.0, goals=[*goals[:2], replace(goals[2], position=far)])
    runs.plan(1000.0, goals=[replace(goals[0], orientation=turned), *goals[1:]])
    assert runs.results == [-1] * 10
    runs.plan(100.0)
    runs.start(start.position, start.orientation)
    for k in range(80):
        runs.tick(SENSOR + k)
    for position, orientation in (
        (far, start.orientation),
        (np.array([0.0, np.nan, 0.0]), start.orientation),
        (start.position, turned),
        (start.position, 1.1 * start.orientation),
        (start.position, np.full(4, np.nan)),
        (goals[0].position, start.orientation),  # no reach, so no frame
    ):
        runs.start(position, orientation)
    assert runs.controller.primitive == 1
    runs.move_goal(0, goals[0].position)  # it has ended
    runs.move_goal(1, far)
    runs.move_goal(2, goals[2].position, turned)
    runs.move_goal(2, goals[1].position - 0.3, 2.0 * goals[2].orientation)
    assert runs.results[-10:] == [-1] * 10
    runs.tick(SENSOR)
    mine, theirs, messages = runs.repeated(program, "felt")
    assert len(messages) == 20
    np.testing.assert_allclose(theirs, mine, rtol=1e-9, atol=1e-9)
    for words in (
        "the rate of the controller must be positive",
        "the duration of 'tilt' must be a tick",
        "the run would have more than 10000000 ticks",
        "the goal of 'scrape' is outside the work",
        "the orientation at the start is more than 60 degrees",
        "the goal of 'down' cannot be moved",
    ):
        assert any(message.startswith(words) for message in messages), words


def test_before_the_start_there_are_no_outputs(program):
    runs = Runs(plain_skill())
    runs.plan(100.0)
    runs.commands.append(bytes_of(TICK))
    runs.record(64)
    mine, theirs, _ = runs.repeated(program, "plain")
    np.testing.assert_array_equal(theirs[:, :20], mine[:, :20])


@pytest.mark.parametrize(
    ("name", "namespace"),
    [
        ("pour", "skill_pour"),
        ("skill", "skill"),
        ("2-up_", "skill_2_up"),
        ("switch", "skill_switch"),
        ("a skill", "skill_a"),
        ("Gießen", "skill_Gie_en"),
    ],
)
def test_every_name_is_one_of_cpp(name, namespace):
    assert namespace_of(name) == namespace


@dataclass(frozen=True)
class RhythmicPosition:
    """A position primitive of another kind."""

    position: object

    def __getattr__(self, name):
        return getattr(self.position, name)


@dataclass(frozen=True)
class GrippingSkill(ReactiveSkill):
    """A skill with one more field."""

    gripper: tuple = ()


def test_what_the_header_does_not_know_is_refused(tmp_path):
    skill = felt_skill()
    down, *others = skill.primitives
    layer = (np.ones((1, 6)), np.zeros(1))
    network = FeedForwardNetwork(np.zeros(6), np.ones(6), (layer,))
    fields = {field: getattr(skill, field) for field in ReactiveSkill.__dataclass_fields__}
    rhythmic = replace(down, position=RhythmicPosition(down.position))
    for unknown, message in (
        (replace(skill, workspace=None), "a skill without a workspace is not for a robot"),
        (replace(skill, networks={"tilt": {"ry": network}}), "the network of 'tilt' for ry is a 'ffnn', wh"),
        (replace(skill, primitives=(rhythmic, *others)), "'down' has a RhythmicPosition, which the C"),
        (GrippingSkill(**fields, gripper=(1.0,)), "the skill has gripper, which the C"),
    ):
        with pytest.raises(InputError, match=f"^{message}"):
            header(unknown, "skill", "")
    assert header(GrippingSkill(**fields), "skill", "") == header(skill, "skill", "")
    write_skill(replace(skill, networks={"tilt": {"ry": network}}), tmp_path / "skill.safetensors", {})
    with pytest.raises(InputError, match=r"skill.safetensors: the network of 'tilt'"):
        write_header(tmp_path / "skill.safetensors", "skill", tmp_path / "out")
    with pytest.raises(InputError, match=r"skill.safetensors: is not a folder"):
        write_header(tmp_path / "skill.safetensors", "skill", tmp_path / "skill.safetensors")
    assert [path.name for path in tmp_path.iterdir()] == ["skill.safetensors"]


def test_numbers_are_exact():
    skill = felt_skill()
    text = header(skill, "skill", "")
    for one in skill.primitives:
        assert all(repr(value) in text for value in one.position.local.weights.ravel().tolist())


ENTRY = "movement: {pour: {source: bags, topics: {pose: /pose}, segment: {primitives: [pour]}}}"
STUBBED = (
    "controller_interface/controller_interface.hpp",
    "pluginlib/class_list_macros.hpp",
    "rclcpp/rclcpp.hpp",
)


def test_the_example_of_ros2_control_compiles_against_stubs(tmp_path):
    for name in STUBBED:
        (tmp_path / name).parent.mkdir()
        shutil.copy(HERE / "ros2_control_stubs.hpp", tmp_path / name)
    (tmp_path / "skill_pour.hpp").write_text(header(felt_skill(), "skill_pour", ""))
    source = HERE.parent / "examples/ros2_control_skill.cpp"
    subprocess.run(["g++", *CHECKED, "-fsyntax-only", "-I", tmp_path, source], check=True)


def test_arithmetic_without_nan_is_not_compiled(program):
    words = ["g++", "-std=c++17", "-ffast-math", "-fsyntax-only", program.parent / "skill_plain.hpp"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "takes away the check of sensor samples" in done.stderr


def test_the_command_exports_the_skill_of_a_task_or_of_a_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("structlearn.yaml").write_text(ENTRY)
    files = TaskFiles("pour")

    def refused(*words):
        with pytest.raises(SystemExit) as ended:
            command.main(["export", *words])
        assert ended.value.code == 1
        return capsys.readouterr().err

    missing = "does not exist; make it first: structlearn run pour"
    assert refused("pour", "--cpp", "include") == f"error: {files.skill}: {missing}\n"
    files.skill.parent.mkdir(parents=True)
    files.skill.with_name("absent.txt").write_text("'pour' turns by more than half a circle\n")
    said = "error: pour has no skill: 'pour' turns by more than half a circle\n"
    assert refused("pour", "--cpp", "include") == said
    assert refused("other", "--cpp", "include").endswith("there is no such task among pour\n")
    assert refused("other.safetensors", "--cpp", "include").startswith("error: other.safetensors: ")
    assert not Path("include").exists()
    write_skill(plain_skill(), files.skill, {})
    for given, name in (("pour", "skill_pour"), (str(files.skill), "skill")):
        command.main(["export", given, "--cpp", "include"])
        said = f"include/{name}.hpp: controller in C++17 of {files.skill}\n"
        assert capsys.readouterr().out == said
        assert f"namespace {name} {{" in Path("include", f"{name}.hpp").read_text(encoding="ascii")
    for option, value in (("fps", "30"), ("words", "pour"), ("robot", "panda")):
        unused = f"error: --{option} is of a LeRobotDataset, not of a C++ header (--cpp)\n"
        assert refused("pour", "--cpp", "include", f"--{option}", value) == unused
    assert refused("pour", "--cpp", str(files.skill)) == f"error: {files.skill}: is not a folder\n"
