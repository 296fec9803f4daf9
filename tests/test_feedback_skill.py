import json
from dataclasses import replace

import numpy as np
import pytest
from feedback_skills import random_network, random_skill
from hypothesis import given
from hypothesis.extra.numpy import arrays
from primitives_movements import quick, wobbly_turn

from structlearn import __version__
from structlearn.core.artefacts import read_description, read_tensors, write_tensors
from structlearn.core.errors import InputError
from structlearn.feedback.models.pmnn import open_loop
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import Limits, ReactiveSkill, Workspace, demonstrated_workspace, on_axis
from structlearn.feedback.skill_file import UNITS, read_provenance, read_skill, skill_provenance, write_skill
from structlearn.primitives.twist_swing import fit_twist_swing
from structlearn.verify import SKILL

RNG = np.random.default_rng(1)
IDLE = open_loop(np.ones(25))


def skill_with_feedback(seed=0):
    rng = np.random.default_rng(seed)
    return random_skill(rng, on_axis({"tilt": random_network(rng), "scrape": IDLE}, "rx"))


def twisted(skill):
    demonstration = wobbly_turn(np.random.default_rng(0), 9.0)
    first = replace(skill.primitives[0], orientation=fit_twist_swing([demonstration]))
    return replace(skill, primitives=[first, *skill.primitives[1:]])


def unturned(skill):
    return replace(skill, primitives=[*skill.primitives[:2], replace(skill.primitives[2], orientation=None)])


def five_channels(skill):
    fewer = random_skill(np.random.default_rng(1), channels=5)
    return replace(skill, expected=skill.expected | {"scrape": fewer.expected["tilt"]})


def with_network(skill, network, name="tilt", axis="rx"):
    return replace(skill, networks=skill.networks | {name: {axis: network}})


def broken(**arrays):
    return lambda skill: with_network(skill, replace(skill.networks["tilt"]["rx"], **arrays))


FAULTS = [
    (lambda skill: replace(skill, primitives=skill.primitives[:1] * 2), "two primitives are called 'down'"),
    (lambda skill: ReactiveSkill([]), "at least one primitive"),
    (twisted, "orientation of 'down' is a TwistSwingPrimitive"),
    (unturned, "'scrape' has no orientation"),
    (lambda skill: with_network(skill, IDLE, "up"), "a network for 'up'"),
    (lambda skill: with_network(skill, IDLE, axis="roll"), "no axis among x, y, z, rx"),
    (lambda skill: replace(skill, limits=Limits(largest_coupling={"ry": 3.0})), "no largest coupling .* rx"),
    (lambda skill: replace(skill, sensors=(("tactile", 5),)), "{'tactile': 5} do not make up 6 channels"),
    (five_channels, "'scrape' has expected traces of 5 channels, others 6"),
    (lambda skill: with_network(skill, random_network(RNG, 7)), "for rx takes 7 channels, but its .* have 6"),
    (lambda skill: replace(skill, expected={}), "for rx takes 6 channels, but there are no expected traces"),
    (broken(input_scale=np.ones(5)), "network of 'tilt' for rx has layers that do not fit"),
    (broken(input_scale=np.zeros(6)), "network of 'tilt' for rx has an input scale that is not positive"),
]


@pytest.mark.parametrize(("change", "message"), FAULTS)
def test_parts_that_do_not_fit_together_are_named(change, message):
    skill = skill_with_feedback()
    with pytest.raises(InputError, match=message):
        change(skill)


def test_a_position_can_be_corrected_without_orientations():
    skill = random_skill(np.random.default_rng(2), turned=False)
    replace(skill, networks={"down": {"z": IDLE}})
    with pytest.raises(InputError, match="'down' has no orientation"):
        replace(skill, networks={"tilt": {"rz": IDLE}})


@given(arrays(float, (7, 3), elements={"min_value": -2.0, "max_value": 2.0}))
@quick
def test_all_that_was_demonstrated_is_inside_and_no_more_than_the_margin_around_it(points):
    box = demonstrated_workspace([points[:3], points[3:]], 0.1)
    for point in (*points, box.low, box.high):  # the border is inside
        box.require(point, "a sample")
    np.testing.assert_allclose(box.high - box.low, np.ptp(points, axis=0) + 0.2)
    with pytest.raises(InputError, match="a point is outside the workspace of the skill: y = "):
        box.require(points.mean(axis=0) + 4.2 * np.eye(3)[1], "a point")


@pytest.mark.parametrize(
    ("low", "high"),
    [
        *((np.ones(3), np.zeros(3)), (np.zeros(3), [1.0, 1.0, np.inf]), (np.zeros(2), np.ones(2))),
        *((["0"] * 3, ["1"] * 3), (np.zeros(3), [1.0, [1.0], 1.0]), (0.0, 1.0), (None, None)),
        (np.zeros(3), np.ma.MaskedArray(np.ones(3), [0, 1, 0])),
    ],
)
def test_corners_that_make_no_box_are_an_error(low, high):
    with pytest.raises(InputError, match="a workspace needs a low and a high corner"):
        Workspace(low, high)


PROVENANCE = {"bags": {"one.mcap": "ab"}, "parameters": "cd", "version": "0"}
TURN = "primitives.down.orientation."
TURN = "primitives.down.orientation."
LIMITS = Limits(largest_coupling={"z": 3.0, "rx": 0.5, "ry": 20.0}, fade_s=0.2)


@pytest.fixture
def skill():
    """Three primitives; one is corrected on two axes, one on another without a sensor, one not at all."""
    rng = np.random.default_rng(0)
    networks = {
        "tilt": {"z": random_network(rng, size=10.0), "rx": random_network(rng, hidden=(8, 4), size=10.0)},
        "scrape": {"ry": open_loop(rng.normal(size=25))},
    }
    made = random_skill(rng, networks, limits=LIMITS)
    paths = [primitive.position.unroll(0.01).position for primitive in made.primitives]
    sensors = (("tactile", 4), ("wrench", 2))
    return replace(made, workspace=demonstrated_workspace(paths, 0.05), sensors=sensors)


@pytest.fixture
def file(skill, tmp_path):
    path = tmp_path / "skill.safetensors"
    write_skill(skill, path, PROVENANCE)
    return path


def path_of(skill):
    controller = Controller(skill, 300.0)
    first, samples = skill.primitives[0], np.random.default_rng(1).normal(0.0, 30.0, (1000, 6))
    controller.start(first.position.start, first.orientation.start)
    path = []
    while not controller.finished:
        controller.tick(samples[len(path)])
        path.append([*controller.position, *controller.orientation, *controller.coupling])
    return np.array(path)


def test_a_skill_that_is_read_runs_as_the_one_that_was_written(skill, file):
    found = read_skill(file)
    np.testing.assert_array_equal(path_of(found), path_of(skill))
    assert (np.ptp(path_of(found)[:, -3:], axis=0) > 0.1).all()
    assert found.axes == ("z", "rx", "ry")
    assert found.limits == LIMITS
    assert found.sensors == skill.sensors
    assert read_provenance(file) == PROVENANCE
    for corner in ("low", "high"):
        np.testing.assert_array_equal(getattr(found.workspace, corner), getattr(skill.workspace, corner))


def test_equal_skills_are_equal_files(skill, file, tmp_path):
    write_skill(read_skill(file), tmp_path / "again.safetensors", PROVENANCE)
    assert (tmp_path / "again.safetensors").read_bytes() == file.read_bytes()


def test_the_file_tells_a_reader_what_its_numbers_mean(file):
    assert read_description(file).startswith(SKILL)  # so that `structlearn.verify` reads it as one
    described = json.loads(read_description(file))["reactive_skill"]
    assert described["units"]["coupling"]["z"] == "m"
    assert described["units"]["coupling"]["ry"] == "rad"
    assert "first 5 good samples of a run, at rest and in the air, is its offset" in described["readings"]
    assert described["sensors"] == [["tactile", 4], ["wrench", 2]]


def test_a_skill_for_a_robot_says_where_it_may_be_used(skill, tmp_path):
    with pytest.raises(InputError, match=r"s\.safetensors: a skill without a workspace is not for a robot"):
        write_skill(replace(skill, workspace=None), tmp_path / "s.safetensors", PROVENANCE)
    assert not any(tmp_path.iterdir())


def changed(file, tensors=None, **description):
    """The file with other content and a right digest."""
    described = json.loads(read_description(file))["reactive_skill"] | description
    arrays = read_tensors(file) | (tensors or {})
    write_tensors(arrays, file, json.dumps({"reactive_skill": described}))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"networks": {"tilt": {"y": "pmnn"}}}, r"no skill of this version \(KeyError: 'input_mean'"),
        ({"networks": {"tilt": {"rx": "os"}}}, "there is no feedback network 'os'"),
        ({"limits": LIMITS.model_dump() | {"largest_coupling": {"z": 1e300}}}, "z: Input should be less"),
        ({"limits": {"largest_coupling": {"z": 1.0}}}, "limits lack fade_s, offset_within_s, stale_after_s"),
        ({"version": 99}, "a skill file of version 99; version 1 is read"),
        ({"units": UNITS | {"length": "mm"}}, "its units are not those of a skill"),
        ({"tensors": {TURN + "weights": np.full((25, 3), 1e308)}}, "holds 1e.308, more"),
        ({"tensors": {TURN + "duration": np.array(1e4)}}, "duration is 10000 s, not within"),
        ({"tensors": {TURN + "duration": np.array(1e-320)}}, "duration is 9.99989e-321 s, not within"),
        ({"tensors": {TURN + "goal": np.ones(4)}}, "is no unit quaternion"),
        *(
            ({"tensors": {TURN + "weights": np.ones(shape)}}, "weights have shape")
            for shape in ((25, 2), (1, 3), (1, 25, 3), (2, 25, 3))
        ),
        ({"sensors": None}, "no skill of this version"),
        ({"tensors": {"workspace": np.zeros(3)}}, "no skill of this version"),
    ],
)
def test_parts_that_are_none_are_named_with_the_file(file, change, message):
    changed(file, **change)
    with pytest.raises(InputError, match=r"skill\.safetensors: .*" + message):
        read_skill(file)


@pytest.mark.parametrize("read", [read_skill, read_provenance])
def test_other_files_are_told_apart(read, tmp_path):
    write_tensors({"a": np.zeros(1)}, tmp_path / "other.safetensors", "note")
    with pytest.raises(InputError, match=r"other\.safetensors: holds no skill"):
        read(tmp_path / "other.safetensors")


def test_provenance_knows_every_bag_and_every_parameter(tmp_path):
    (tmp_path / "bags/5").mkdir(parents=True)
    (tmp_path / "bags/one.mcap").write_bytes(b"1")
    (tmp_path / "bags/5/two.mcap").write_bytes(b"2")
    (tmp_path / "log.mcap").write_bytes(b"1")
    sources = [tmp_path / "bags", tmp_path / "log.mcap"]
    first = skill_provenance(sources, {"fit": {"kernels": 25, "hz": 5.0}, "axes": ["z"]})
    assert list(first["bags"]) == ["bags/5/two.mcap", "bags/one.mcap", "log.mcap"]
    assert first["bags"]["bags/one.mcap"] == first["bags"]["log.mcap"]
    assert first["version"] == __version__
    assert first == skill_provenance(sources, {"axes": ["z"], "fit": {"hz": 5.0, "kernels": 25}})
    other = skill_provenance(sources, {"fit": {"kernels": 25, "hz": 5.0}, "axes": ["y"]})
    assert other["parameters"] != first["parameters"]
    (tmp_path / "bags/5/two.mcap").write_bytes(b"3")
    assert skill_provenance(sources, {})["bags"] != first["bags"]
