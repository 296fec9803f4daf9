from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from primitives_movements import few, quick, reach, rngs, wobbly_turn

from structlearn.core import quaternion
from structlearn.feedback.corrected_paths import coupling_response
from structlearn.feedback.coupling import orientation_target, position_target
from structlearn.primitives import transformation
from structlearn.primitives.orientation import fit_quaternion
from structlearn.primitives.vector import fit_vector

COARSE, FINE = 0.004, 0.001  # s


def vector_pair(rng, dt=0.002):
    """A nominal primitive, and a corrected demonstration of another duration."""
    nominal = fit_vector([reach(rng, np.zeros(3), [0.5, 0.2, -0.1], dt=0.005)])
    return nominal, reach(rng, [0.02, 0.0, -0.01], [0.5, 0.2, 0.0], duration=1.2, dt=dt, detour=0.2)


def orientation_pair(rng, dt=0.002):
    nominal = fit_quaternion([wobbly_turn(rng, 1.0)])
    return nominal, wobbly_turn(rng, 1.2, wobble=0.4, duration=1.2, dt=dt)


def unrolled(nominal, path, start, target, goal):
    """The nominal primitive from the initial state of a path, with its target as coupling."""
    velocity, acceleration = (rate[0] for rate in path.rates)
    coupling = lambda k, x, xd: target[k]  # noqa: E731
    return nominal.unroll(path.dt, start, goal, path.duration, velocity, acceleration, coupling)


def position_error(seed, dt, goal):
    """Largest distance from the demonstration."""
    nominal, path = vector_pair(np.random.default_rng(seed), dt)
    again = unrolled(nominal, path, path.position[0], position_target(path, nominal, goal), goal)
    return np.linalg.norm(again.position - path.position, axis=1).max()


def orientation_error(seed, dt, goal):
    nominal, path = orientation_pair(np.random.default_rng(seed), dt)
    again = unrolled(nominal, path, path.orientation[0], orientation_target(path, nominal, goal), goal)
    return quaternion.angle_between(again.orientation, path.orientation).max()


@pytest.mark.parametrize(
    ("error", "goal", "limit"),
    [
        (position_error, None, 0.01),  # m, of a reach of half a metre
        (position_error, np.array([0.4, 0.3, 0.1]), 0.01),
        (orientation_error, None, 0.03),  # rad
        (orientation_error, quaternion.from_rotation_vector(np.array([0.1, -0.2, 1.3])), 0.03),
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_a_primitive_with_its_target_as_coupling_is_the_demonstration(error, goal, limit, seed):
    """But for the hold of the coupling over a step, which shrinks with the step."""
    coarse, fine = error(seed, COARSE, goal), error(seed, FINE, goal)
    assert coarse < limit
    assert fine < 0.35 * coarse


@few
@given(rngs)
def test_what_needs_no_correction_has_no_target(rng):
    nominal, _ = vector_pair(rng)
    start, goal = rng.normal(size=(2, 3))
    path = nominal.unroll(0.004, start, goal, 1.0, *rng.normal(size=(2, 3)))
    terms = nominal.forcing(path.time, start, goal, path.duration)
    assert np.abs(position_target(path, nominal, goal)).max() < 1e-9 * np.abs(terms).max()
    nominal, _ = orientation_pair(rng)
    turn = quaternion.from_rotation_vector(0.1 * rng.normal(size=3))
    path = nominal.unroll(0.004, quaternion.product(turn, nominal.start), None, 1.2, *rng.normal(size=(2, 3)))
    terms = nominal.forcing(path.time, path.duration)
    assert np.abs(orientation_target(path, nominal)).max() < 1e-9 * np.abs(terms).max()


@few
@given(rngs)
def test_the_sign_of_a_quaternion_does_not_matter(rng):
    nominal, path = orientation_pair(rng)
    flipped = replace(path, orientation=-path.orientation)
    np.testing.assert_allclose(
        orientation_target(flipped, nominal, -nominal.goal), orientation_target(path, nominal), atol=1e-9
    )


@given(rngs)
@quick
def test_coupling_adds_its_response_to_any_nominal_movement(rng):
    dt, tau = rng.uniform(0.001, 0.05), rng.uniform(0.5, 8.0)
    state = {name: rng.normal(size=(3, 2)) for name in ("start", "goal", "velocity", "acceleration")}
    forcing, coupling = 50 * rng.normal(size=(2, 3, 60, 2))
    corrected, nominal = (
        transformation.unroll(
            forcing=forcing, dt=dt, tau=tau, coupling=lambda k, x, xd, c=c: c[:, k], **state
        ).position
        for c in (coupling, 0.0 * coupling)
    )
    expected = coupling_response(60, dt / tau) @ coupling
    np.testing.assert_allclose(corrected - nominal, expected, rtol=1e-9, atol=1e-9)
