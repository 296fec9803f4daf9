import dataclasses
from functools import partial

import numpy as np
import pytest
from primitives_movements import (
    fading_coupling,
    for_few_rngs,
    for_rngs,
    random_orientations,
    random_quaternion_primitive,
    random_twist_swing,
    random_vectors,
    wobbly_turn,
)
from scipy.integrate import solve_ivp

from structlearn.core import quaternion
from structlearn.primitives import orientation, transformation
from structlearn.primitives.canonical import phase, time_constant
from structlearn.primitives.kernels import features
from structlearn.primitives.orientation import QuaternionPrimitive, fit_quaternion, initial_goal
from structlearn.primitives.transformation import ALPHA, ALPHA_G, BETA
from structlearn.primitives.twist_swing import fit_twist_swing

DT = 0.005


FORMS = {"quaternion": random_quaternion_primitive} | {
    f"{turns:g} turns": partial(random_twist_swing, turns=turns) for turns in (0.3, -1.0, 1.7, -3.2)
}
BOTH = pytest.mark.parametrize("random_primitive", [random_quaternion_primitive, random_twist_swing])


@pytest.mark.parametrize("random_primitive", FORMS.values(), ids=FORMS)
@pytest.mark.parametrize("coupled", [False, True])
@for_rngs
def test_the_goal_is_reached_whatever_the_weights(random_primitive, coupled, rng):
    primitive = random_primitive(rng, bound=500.0)
    start, goal, duration = random_orientations(rng), random_orientations(rng), rng.uniform(0.3, 4.0)
    dt = duration / 100
    state = {"velocity": rng.normal(size=3), "acceleration": 5 * rng.normal(size=3)}
    coupling = fading_coupling(rng, duration, dt, bound=100.0) if coupled else None
    path = primitive.unroll(dt, start, goal, duration, coupling=coupling, until=5 * duration, **state)
    assert quaternion.angle_between(path.orientation[-1], goal) < 1e-6
    assert np.abs(path.angular_velocity[-1]).max() < 1e-5
    np.testing.assert_allclose(np.linalg.norm(path.orientation, axis=1), 1.0, atol=1e-9)


@BOTH
@for_rngs
def test_the_path_starts_in_the_state_asked_for(random_primitive, rng):
    primitive = random_primitive(rng)
    turn = quaternion.from_rotation_vector(random_vectors(rng, 0.5))
    start = quaternion.product(turn, primitive.start) * rng.choice([-1.0, 1.0])
    velocity, acceleration, c = rng.normal(size=(3, 3))
    for coupling in (None, lambda *_: c):
        path = primitive.unroll(0.005, start, None, 1.0, velocity, 5 * acceleration, coupling)
        np.testing.assert_allclose(path.orientation[0], start, atol=1e-12)  # with its sign
        np.testing.assert_allclose(path.angular_velocity[0], velocity, atol=1e-9)
        np.testing.assert_allclose(path.angular_acceleration[0], 5 * acceleration, atol=1e-8)  # eq. IV.13
        assert (np.sum(path.orientation[1:] * path.orientation[:-1], axis=1) > 0).all()


@BOTH
@for_rngs
def test_turning_the_base_frame_with_the_primitive_turns_the_path(random_primitive, rng):
    primitive, turn = random_primitive(rng), random_orientations(rng)
    changes = {name: quaternion.product(turn, getattr(primitive, name)) for name in ("start", "goal")}
    if isinstance(primitive, QuaternionPrimitive):
        vectors = ("weights", "velocity", "acceleration")
        changes |= {name: quaternion.rotate(turn, getattr(primitive, name)) for name in vectors}
    else:
        changes["axes"] = quaternion.rotate(turn, primitive.axes.T).T
    path, moved = primitive.unroll(0.01), dataclasses.replace(primitive, **changes).unroll(0.01)
    expected = quaternion.product(turn, path.orientation)
    assert quaternion.angle_between(moved.orientation, expected).max() < 1e-6
    turned = quaternion.rotate(turn, path.angular_velocity)
    np.testing.assert_allclose(moved.angular_velocity, turned, atol=1e-6)


@for_few_rngs
def test_the_path_solves_the_text_equations(rng):
    duration, dt = rng.uniform(1.0, 3.0), 1 / 300
    tau = time_constant(duration)
    times = dt * np.arange(round(duration / dt) + 1)
    weights = rng.uniform(-20, 20, size=(25, 3))
    start = random_orientations(rng)
    goal = quaternion.product(
        quaternion.from_rotation_vector(random_vectors(rng, rng.uniform(0.2, 1.5))), start
    )
    velocity, acceleration = 0.3 * rng.normal(size=(2, 3))

    def forcing(t):
        return features(*phase(np.asarray(t), tau)) @ weights

    first = initial_goal(start, velocity, acceleration, tau, forcing(0.0))

    def rates(t, state):
        q, w, g = state[:4], state[4:7], state[7:]
        q, g = q / np.linalg.norm(q), g / np.linalg.norm(g)
        wd = (ALPHA * (BETA * quaternion.difference(g, q) - tau * w) + forcing(t)) / tau**2  # eq. IV.2
        w_g = ALPHA_G * quaternion.difference(goal, g) / tau  # eq. IV.11
        qd, gd = (quaternion.product(np.append(0, one), of) / 2 for one, of in ((w, q), (w_g, g)))
        return np.concatenate([qd, wd, gd])

    state, span = np.concatenate([start, velocity, first]), (0, times[-1])
    solution = solve_ivp(rates, span, state, "DOP853", times, rtol=1e-6, atol=1e-7)
    path = orientation.unroll(start, goal, forcing(times), dt, tau, velocity, acceleration)
    error = quaternion.angle_between(path.orientation, quaternion.normalised(solution.y[:4].T))
    assert error.max() < 1e-3
    np.testing.assert_allclose(path.angular_velocity, solution.y[4:7].T, atol=3e-3)


@pytest.mark.parametrize("dt", [1 / 300, 0.02, 0.1])
@for_few_rngs
def test_a_turn_about_a_fixed_axis_is_exactly_the_vector_system(dt, rng):
    axis, base, tau = random_vectors(rng, 1.0), random_orientations(rng), 4.0
    turn, velocity, acceleration = rng.uniform(-1, 1, size=3) * [1.5, 0.5, 0.5]
    times = dt * np.arange(round(2.0 / dt) + 1)
    forcing = features(*phase(times, tau)) @ rng.uniform(-20, 20, size=(25, 1))
    line = transformation.unroll(np.zeros(1), np.array([turn]), forcing, dt, tau, velocity, acceleration)
    assert np.ptp(line.position) < np.pi  # the logarithm stays below half a turn
    goal = quaternion.product(quaternion.from_rotation_vector(turn * axis), base)
    path = orientation.unroll(base, goal, forcing * axis, dt, tau, velocity * axis, acceleration * axis)
    expected = quaternion.product(quaternion.from_rotation_vector(line.position * axis), base)
    assert quaternion.angle_between(path.orientation, expected).max() < 1e-7
    np.testing.assert_allclose(path.angular_velocity, line.velocity * axis, atol=1e-11)
    np.testing.assert_allclose(path.angular_acceleration, line.acceleration * axis, atol=1e-10)


@pytest.mark.parametrize(
    ("fit", "turns", "limit_deg"),
    [(fit_quaternion, 0.3, 0.2), *((fit_twist_swing, turns, 0.5) for turns in (0.3, -1.0, 1.7, -3.2))],
)
@for_rngs
def test_a_smooth_demonstration_is_reproduced(fit, turns, limit_deg, rng):
    demonstrated = wobbly_turn(rng, 2 * np.pi * turns, base=random_orientations(rng), axis=rng.normal(size=3))
    path = fit([demonstrated]).unroll(DT)
    error = np.degrees(quaternion.angle_between(path.orientation, demonstrated.orientation))
    assert error.max() < limit_deg
    assert error[-1] < 0.1
    scale = np.abs(demonstrated.angular_velocity).max()
    np.testing.assert_allclose(path.angular_velocity, demonstrated.angular_velocity, atol=0.05 * scale)
    np.testing.assert_allclose(path.angular_velocity[0], demonstrated.angular_velocity[0], atol=1e-9)


@for_rngs
def test_demonstrations_of_different_durations_and_signs_are_one_primitive(rng):
    seed, base, axis = rng.integers(2**32), random_orientations(rng), rng.normal(size=3)
    demonstrated = [
        wobbly_turn(np.random.default_rng(seed), 1.5, 0.1, duration, duration / 250, base, axis)
        for duration in (1.0, 1.5, 2.5)
    ]
    flipped = [
        *demonstrated[:2],
        dataclasses.replace(demonstrated[2], orientation=-demonstrated[2].orientation),
    ]
    primitive = fit_quaternion(flipped)
    for demonstration in demonstrated:
        path = primitive.unroll(demonstration.dt, duration=demonstration.duration)
        error = quaternion.angle_between(path.orientation, demonstration.orientation)
        assert error.max() < np.radians(0.2)


@for_rngs
def test_a_batch_is_its_movements_one_by_one(rng):
    primitive = random_quaternion_primitive(rng, 3)
    gain = rng.normal(size=3)
    for coupling in (None, lambda k, q, w: gain * q[..., 1:] - w):
        batch = primitive.unroll(0.05, coupling=coupling)
        for i in range(3):
            member = dataclasses.replace(primitive, weights=primitive.weights[i])
            alone = member.unroll(0.05, coupling=coupling)
            np.testing.assert_allclose(batch.orientation[i], alone.orientation, atol=1e-9)
            np.testing.assert_allclose(batch.angular_velocity[i], alone.angular_velocity, atol=1e-8)
