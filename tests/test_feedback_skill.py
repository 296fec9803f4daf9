from dataclasses import replace

import numpy as np
import pytest
from feedback_skills import NAMES, random_network, random_skill
from primitives_movements import wobbly_turn

from structlearn.feedback.pmnn import write_networks
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import ReactiveSkill, open_loop, read_skill
from structlearn.ground.errors import InputError
from structlearn.primitives import canonical, kernels
from structlearn.primitives.primitive_files import write_primitives, write_vector_primitive
from structlearn.primitives.twist_swing import fit_twist_swing


def skill_with_feedback(seed=0, **networks):
    rng = np.random.default_rng(seed)
    return random_skill(rng, {"tilt": random_network(rng), "scrape": open_loop(np.ones(25))} | networks)


@pytest.fixture
def files(tmp_path):
    skill = skill_with_feedback()
    write_primitives(skill.primitives, tmp_path / "primitives.safetensors")
    for name, traces in skill.expected.items():
        write_vector_primitive(traces, tmp_path / "expected" / f"{name}.safetensors", "expected traces")
    write_networks(list(skill.networks.items()), tmp_path / "networks.safetensors")
    return skill, tmp_path


FILES = {"primitives": "primitives.safetensors", "expected": "expected", "networks": "networks.safetensors"}


def read(folder, axis, **other):
    return read_skill(*(folder / name for name in (FILES | other).values()), axis)


def test_a_skill_that_is_read_runs_as_the_one_that_was_written(files):
    skill, folder = files
    runs = []
    for one in (skill, read(folder, skill.axis)):
        controller = Controller(one, 300.0)
        first, samples = one.primitives[0], np.random.default_rng(1).normal(0.0, 30.0, (1000, 6))
        controller.start(first.position.start, first.orientation.start)
        path = []
        while not controller.finished:
            controller.tick(samples[len(path)])
            path.append([*controller.position, *controller.orientation, controller.coupling])
        runs.append(path)
    np.testing.assert_array_equal(*runs)
    assert np.ptp(runs[0], axis=0)[-1] > 0.1


def test_primitives_without_a_file_have_no_expected_traces(files):
    skill, folder = files
    (folder / "expected" / "down.safetensors").unlink()
    assert set(read(folder, skill.axis).expected) == {"tilt", "scrape"}


@pytest.mark.parametrize("missing", ["primitives", "expected", "networks"])
def test_a_missing_file_is_named(files, missing):
    skill, folder = files
    with pytest.raises(InputError, match="nowhere: no such f"):
        read(folder, skill.axis, **{missing: "nowhere"})


def test_expected_traces_of_an_unknown_primitive_are_an_error(files):
    skill, folder = files
    (folder / "expected" / "down.safetensors").rename(folder / "expected" / "up.safetensors")
    with pytest.raises(InputError, match="expected traces for 'up', but no such primitive"):
        read(folder, skill.axis)


def test_an_open_loop_policy_is_linear_in_the_phase_features():
    weights = np.random.default_rng(0).normal(size=25)
    features = kernels.features(*canonical.phase(np.linspace(0.0, 1.0, 9), 2.0))
    found = open_loop(weights).coupling(np.empty((9, 0)), features)
    np.testing.assert_allclose(found, features @ weights, atol=1e-14)


@pytest.mark.parametrize("axis", [[1.0, 0.0], [1.0, 1.0, 0.0], [np.nan, 0.0, 0.0], [0.0, 0.0, 0.0]])
def test_the_axis_is_a_unit_vector(axis):
    with pytest.raises(InputError, match="the axis of the feedback must"):
        replace(skill_with_feedback(), axis=np.array(axis))


def twisted(skill):
    demonstration = wobbly_turn(np.random.default_rng(0), 9.0)
    first = replace(skill.primitives[0], orientation=fit_twist_swing([demonstration]))
    return replace(skill, primitives=[first, *skill.primitives[1:]])


def unturned(skill):
    return replace(skill, primitives=[*skill.primitives[:2], replace(skill.primitives[2], orientation=None)])


def five_channels(skill):
    fewer = random_skill(np.random.default_rng(1), channels=5)
    return replace(skill, expected=skill.expected | {"scrape": fewer.expected["tilt"]})


def with_network(skill, network, name="tilt"):
    return replace(skill, networks=skill.networks | {name: network})


def broken(**arrays):
    return lambda skill: with_network(skill, replace(skill.networks["tilt"], **arrays))


FAULTS = {
    "two of a name": (
        lambda skill: replace(skill, primitives=[skill.primitives[0], *skill.primitives[:2]]),
        "two primitives are called 'down'",
    ),
    "none": (lambda skill: ReactiveSkill([]), "at least one primitive"),
    "twist-swing": (twisted, "orientation of 'down' is a TwistSwingPrimitive"),
    "no orientation": (unturned, "'scrape' has no orientation"),
    "unknown network": (
        lambda skill: with_network(skill, open_loop(np.ones(25)), "up"),
        "a network for 'up'",
    ),
    "channels": (five_channels, "'scrape' has expected traces of 5 channels, others 6"),
    "inputs": (
        lambda skill: with_network(skill, random_network(np.random.default_rng(1), 7)),
        "network of 'tilt' takes 7 channels, but its expected traces have 6",
    ),
    "no expected": (
        lambda skill: replace(skill, expected={"down": skill.expected["down"]}),
        "network of 'tilt' takes 6 channels, but there are no expected traces",
    ),
    "layers": (broken(phase_weights=np.ones((25, 9))), "layers of the network of 'tilt' do not fit"),
    "phase biases": (broken(phase_biases=np.ones(24)), "layers of the network of 'tilt' do not fit"),
    "input scale": (broken(input_scale=np.ones(5)), "layers of the network of 'tilt' do not fit"),
    "zero scale": (
        broken(input_scale=np.zeros(6)),
        "network of 'tilt' holds a value that is not finite or a",
    ),
    "NaN": (broken(output_weights=np.full(25, np.nan)), "network of 'tilt' holds a value that is not finite"),
}


@pytest.mark.parametrize(("change", "message"), FAULTS.values(), ids=FAULTS)
def test_parts_that_do_not_fit_together_are_named(change, message):
    skill = skill_with_feedback()
    with pytest.raises(InputError, match=message):
        change(skill)


def test_names_and_places_lead_to_a_primitive():
    skill = skill_with_feedback()
    assert [skill.index(name) for name in NAMES] == [skill.index(place) for place in range(3)] == [0, 1, 2]
    for unknown in ("up", 3, -1):
        with pytest.raises(InputError, match="there is no primitive"):
            skill.index(unknown)
