from dataclasses import replace

import numpy as np
import pytest
from feedback_skills import NAMES, random_network, random_skill
from hypothesis import given
from hypothesis.extra.numpy import arrays
from primitives_movements import quick, wobbly_turn

from structlearn.core.errors import InputError
from structlearn.feedback.models.pmnn import open_loop
from structlearn.feedback.skill import Limits, ReactiveSkill, Workspace, demonstrated_workspace, on_axis
from structlearn.primitives.twist_swing import fit_twist_swing

RNG = np.random.default_rng(1)


def skill_with_feedback(seed=0):
    rng = np.random.default_rng(seed)
    return random_skill(rng, on_axis({"tilt": random_network(rng), "scrape": open_loop(np.ones(25))}, "rx"))


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
    (lambda skill: with_network(skill, open_loop(np.ones(25)), "up"), "a network for 'up'"),
    (
        lambda skill: with_network(skill, open_loop(np.ones(25)), axis="roll"),
        "no axis among x, y, z, rx",
    ),
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


def test_the_axes_of_a_skill_are_those_of_its_networks():
    skill = skill_with_feedback()
    assert skill.axes == ("rx",)
    several = with_network(with_network(skill, open_loop(np.ones(25)), "down", "z"), open_loop(np.ones(25)))
    assert several.axes == ("z", "rx")
    assert ReactiveSkill(skill.primitives).axes == ()


def test_a_position_can_be_corrected_without_orientations():
    skill = random_skill(np.random.default_rng(2), turned=False)
    replace(skill, networks={"down": {"z": open_loop(np.ones(25))}})
    with pytest.raises(InputError, match="'down' has no orientation"):
        replace(skill, networks={"tilt": {"rz": open_loop(np.ones(25))}})


def test_names_and_places_lead_to_a_primitive():
    skill = skill_with_feedback()
    assert [skill.index(name) for name in NAMES] == [skill.index(place) for place in range(3)] == [0, 1, 2]
    for unknown in ("up", 3, -1):
        with pytest.raises(InputError, match="there is no primitive"):
            skill.index(unknown)


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
    ("low", "high"), [(np.ones(3), np.zeros(3)), (np.zeros(3), [1.0, 1.0, np.inf]), (np.zeros(2), np.ones(2))]
)
def test_corners_that_make_no_box_are_an_error(low, high):
    with pytest.raises(InputError, match="a workspace needs a low and a high corner"):
        Workspace(np.array(low), np.array(high))
