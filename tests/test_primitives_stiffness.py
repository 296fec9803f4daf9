from dataclasses import replace

import numpy as np
import pytest
from feedback_skills import random_skill
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import quick, reach

from structlearn.core import signals
from structlearn.core.errors import InputError
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import Workspace
from structlearn.feedback.skill_file import read_skill, write_skill
from structlearn.primitives import sequence
from structlearn.primitives.position import fit_position
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.stiffness import KNOTS, StiffnessParameters, spread, suggested
from structlearn.primitives.trajectory import differentiated

BOUNDS = StiffnessParameters(
    force_n=5.0,
    softest_n_m=100.0,
    stiffest_n_m=2000.0,
    torque_nm=1.0,
    softest_nm_rad=5.0,
    stiffest_nm_rad=60.0,
)
DT = 0.01


def test_the_spread_is_that_of_the_demonstrations_on_each_axis_of_the_base():
    rng = np.random.default_rng(3)
    middle = reach(rng, np.zeros(3), np.array([0.3, 0.2, 0.0]), 2.0, DT, 0.0)
    bump = np.sin(np.pi * signals.minimum_jerk(np.linspace(0.0, 1.0, len(middle.time)))) ** 2
    sizes = np.array([-0.03, -0.01, 0.01, 0.03])
    paths = [
        differentiated(middle.position + size * np.outer(bump, [0.0, 1.0, 0.5]), DT, 20.0) for size in sizes
    ]
    primitive = PosePrimitive("reach", fit_position([middle]))
    found = spread(primitive, [(path, None) for path in paths])
    expected = np.sqrt(np.mean(sizes**2)) * np.outer(signals.time_normalised(bump, KNOTS), [0.0, 1.0, 0.5])
    np.testing.assert_allclose(found, expected, atol=4e-4)
    stiffness = suggested(found, BOUNDS)
    assert (stiffness[[0, -1]] == BOUNDS.stiffest_n_m).all()  # all demonstrations meet their ends
    assert stiffness[KNOTS // 2, 1] == pytest.approx(BOUNDS.force_n / expected[KNOTS // 2, 1], rel=0.02)
    with pytest.raises(InputError, match=r"'reach' was learned from 2 demonstrations: .* needs 3"):
        spread(primitive, [(path, None) for path in paths[:2]])


@given(st.lists(st.floats(0.0, 1e3), min_size=6, max_size=6), st.floats(1.0, 100.0))
@quick
def test_less_spread_is_never_softer_and_the_bounds_hold(spreads, factor):
    wide = suggested(factor * np.array([spreads]), BOUNDS)
    narrow = suggested(np.array([spreads]), BOUNDS)
    assert (wide <= narrow).all()
    softest, stiffest = np.repeat([[100.0, 5.0], [2000.0, 60.0]], 3, axis=1)
    assert ((softest <= wide) & (narrow <= stiffest)).all()


def test_the_softest_is_not_stiffer_than_the_stiffest():
    with pytest.raises(ValueError, match="the softest is stiffer"):
        StiffnessParameters(**BOUNDS.model_dump() | {"softest_n_m": 3000.0})


def test_a_skill_carries_its_stiffness_to_the_controller(tmp_path):
    rng = np.random.default_rng(5)
    skill = random_skill(rng)
    profiles = {part.name: rng.uniform(100.0, 2000.0, (KNOTS, 6)) for part in skill.primitives}
    box = Workspace(np.full(3, -1.0), np.full(3, 1.0))
    write_skill(replace(skill, stiffness=profiles, workspace=box), tmp_path / "skill.safetensors", {})
    skill = read_skill(tmp_path / "skill.safetensors")
    controller = Controller(skill, 100.0, durations=[1.0, 2.0, 1.0])
    start = sequence.default_start(skill.primitives)
    controller.start(start.position, start.orientation)
    np.testing.assert_array_equal(controller.stiffness, profiles["down"][0])
    for _ in range(201):
        controller.tick(None)
    assert controller.primitive == 1
    middle = profiles["tilt"][KNOTS // 2 - 1 : KNOTS // 2 + 1].mean(axis=0)  # an even number of knots
    np.testing.assert_allclose(controller.stiffness, middle)
    while not controller.finished:
        controller.tick(None)
    np.testing.assert_allclose(controller.stiffness, profiles["scrape"][-1])


def test_a_skill_without_stiffness_suggests_none():
    assert Controller(random_skill(np.random.default_rng(5)), 100.0).stiffness is None


@pytest.mark.parametrize(
    "change",
    [
        lambda profiles: {"down": profiles["down"]},
        lambda profiles: profiles | {"tilt": profiles["tilt"][:, :4]},
        lambda profiles: profiles | {"tilt": profiles["tilt"][:, :3]},
        lambda profiles: profiles | {"tilt": profiles["tilt"][:1]},
        lambda profiles: profiles | {"tilt": 0.0 * profiles["tilt"]},
        lambda profiles: profiles | {"tilt": np.nan * profiles["tilt"]},
        lambda profiles: profiles | {"up": profiles["tilt"]},
    ],
)
def test_a_stiffness_that_does_not_fit_is_an_error(change):
    skill = random_skill(np.random.default_rng(5))
    profiles = {part.name: np.full((KNOTS, 6), 100.0) for part in skill.primitives}
    with pytest.raises(InputError, match="a stiffness is positive, on 3 or on 6 axes"):
        replace(skill, stiffness=change(profiles))
