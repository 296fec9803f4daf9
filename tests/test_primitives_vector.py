import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import fading_coupling, normalised_error, quick, reach, rngs

from structlearn.primitives.vector import VectorPrimitive, fit_vector, relative_scale, sample_count

DT = 0.005


def random_primitive(rng, *batch, axes=3, bound=1000.0):
    start, goal, velocity, acceleration = rng.normal(size=(4, axes))
    return VectorPrimitive(
        weights=rng.uniform(-bound, bound, size=(*batch, 25, axes)),
        start=start,
        goal=goal,
        velocity=velocity,
        acceleration=10 * acceleration,
        duration=float(rng.uniform(0.3, 4.0)),
        scaled=np.zeros(axes, dtype=bool),
    )


@given(rngs, st.booleans())
@quick
def test_the_goal_is_reached_whatever_the_weights(rng, coupled):
    primitive = random_primitive(rng)
    duration = rng.uniform(0.3, 4.0)
    start, goal = 2 * rng.normal(size=(2, 3))
    dt = duration / 100
    state = {"velocity": rng.normal(size=3), "acceleration": 10 * rng.normal(size=3)}
    coupling = fading_coupling(rng, duration, dt, bound=500.0) if coupled else None
    path = primitive.unroll(dt, start, goal, duration, coupling=coupling, until=5 * duration, **state)
    np.testing.assert_allclose(path.position[-1], goal, atol=1e-6)
    np.testing.assert_allclose(path.velocity[-1], 0.0, atol=1e-5)
    np.testing.assert_allclose(path.position[0], start, atol=1e-12)


@given(rngs, st.floats(0.2, 5.0))
@quick
def test_another_duration_gives_the_same_shape(rng, factor):
    primitive = random_primitive(rng, bound=100.0)
    dt = primitive.duration / 150
    path = primitive.unroll(dt)
    scaled = primitive.unroll(factor * dt, duration=factor * primitive.duration)
    np.testing.assert_allclose(scaled.time, factor * path.time)
    np.testing.assert_allclose(scaled.position, path.position, atol=1e-9)
    np.testing.assert_allclose(factor * scaled.velocity, path.velocity, atol=1e-8)
    np.testing.assert_allclose(factor**2 * scaled.acceleration, path.acceleration, atol=1e-6)


@pytest.mark.parametrize("method", ["joint", "local"])
@given(rng=rngs)
@quick
def test_a_smooth_demonstration_is_reproduced(method, rng):
    demonstration = reach(rng, rng.normal(size=3), rng.normal(size=3), duration=rng.uniform(0.5, 3.0), dt=DT)
    path = fit_vector([demonstration], method=method).unroll(DT)
    limit = 1e-6 if method == "joint" else 1e-3
    assert normalised_error(path.position, demonstration.position) < limit
    assert normalised_error(path.velocity, demonstration.velocity) < 10 * limit
    np.testing.assert_allclose(path.position[0], demonstration.position[0], atol=1e-12)
    np.testing.assert_allclose(path.velocity[0], demonstration.velocity[0], atol=1e-12)
    np.testing.assert_allclose(path.acceleration[0], demonstration.acceleration[0], atol=1e-9)


@given(rngs)
@quick
def test_the_same_movement_at_different_speeds_is_one_primitive(rng):
    seed, start, goal = rng.integers(2**32), rng.normal(size=2), rng.normal(size=2)
    demonstrations = [
        reach(np.random.default_rng(seed), start, goal, duration, duration / 300)
        for duration in (1.0, 1.5, 2.5)
    ]
    primitive = fit_vector(demonstrations)
    assert primitive.duration == pytest.approx(5 / 3)
    for demonstration in demonstrations:
        path = primitive.unroll(demonstration.dt, duration=demonstration.duration)
        assert normalised_error(path.position, demonstration.position) < 1e-6


def test_the_mean_of_the_demonstrations_is_what_is_not_given():
    rng = np.random.default_rng(0)
    demonstrations = [reach(rng, rng.normal(size=2), rng.normal(size=2), 1.0, 0.01) for _ in range(4)]
    primitive = fit_vector(demonstrations)
    path = primitive.unroll(0.01)
    for name in ("position", "velocity", "acceleration"):
        mean = np.mean([getattr(one, name)[0] for one in demonstrations], axis=0)
        np.testing.assert_allclose(getattr(path, name)[0], mean)
    np.testing.assert_allclose(primitive.goal, np.mean([d.position[-1] for d in demonstrations], axis=0))


@given(rngs)
@quick
def test_scaled_axes_keep_their_shape_for_any_distance(rng):
    start, goal = np.zeros(2), np.array([1.0, 0.5])
    demonstration = reach(rng, start, goal, detour=0.05)
    primitive = fit_vector([demonstration], scaled=[True, False])
    start, goal = primitive.start, primitive.goal
    factor = rng.uniform(-3.0, 3.0)
    state = {"velocity": np.zeros(2), "acceleration": np.zeros(2)}
    path = primitive.unroll(DT, start, goal, **state)
    farther = primitive.unroll(DT, start, start + factor * (goal - start), **state)
    found, expected = farther.position - start, path.position - start
    np.testing.assert_allclose(found[:, 0], factor * expected[:, 0], atol=1e-9)
    duration = primitive.duration
    np.testing.assert_array_equal(
        primitive.forcing(path.time, start, goal, duration)[:, 1],
        primitive.forcing(path.time, start, 5 * goal, duration)[:, 1],
    )


def test_an_axis_that_hardly_moves_is_never_scaled():
    found = relative_scale(np.full(3, 3.0), np.array([1e-4, 2.0, 2.0]), np.array([True, True, False]))
    np.testing.assert_array_equal(found, [1.0, 1.5, 1.0])


def test_samples_run_up_to_the_one_nearest_to_the_duration():
    assert [sample_count(duration, 1 / 300) for duration in (1.0, 0.9999, 1.0018)] == [301, 301, 302]
