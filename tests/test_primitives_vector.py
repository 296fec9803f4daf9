from dataclasses import replace

import numpy as np
import pytest
from primitives_movements import fading_coupling, for_rngs, normalised_error, random_orientations, reach

from structlearn.core import quaternion
from structlearn.core.frames import local_frame
from structlearn.core.signals import minimum_jerk
from structlearn.primitives.position import fit_position, fit_position_subsets
from structlearn.primitives.trajectory import differentiated
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


@pytest.mark.parametrize("coupled", [False, True])
@for_rngs
def test_the_goal_is_reached_whatever_the_weights(coupled, rng):
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


@for_rngs
def test_another_duration_gives_the_same_shape(rng):
    primitive, factor = random_primitive(rng, bound=100.0), rng.uniform(0.2, 5.0)
    dt = primitive.duration / 150
    path = primitive.unroll(dt)
    scaled = primitive.unroll(factor * dt, duration=factor * primitive.duration)
    np.testing.assert_allclose(scaled.time, factor * path.time)
    np.testing.assert_allclose(scaled.position, path.position, atol=1e-9)
    np.testing.assert_allclose(factor * scaled.velocity, path.velocity, atol=1e-8)
    np.testing.assert_allclose(factor**2 * scaled.acceleration, path.acceleration, atol=1e-6)


@pytest.mark.parametrize("method", ["joint", "local"])
@for_rngs
def test_a_smooth_demonstration_is_reproduced(method, rng):
    demonstration = reach(rng, rng.normal(size=3), rng.normal(size=3), duration=rng.uniform(0.5, 3.0), dt=DT)
    path = fit_vector([demonstration], method=method).unroll(DT)
    limit = 1e-6 if method == "joint" else 1e-3
    assert normalised_error(path.position, demonstration.position) < limit
    assert normalised_error(path.velocity, demonstration.velocity) < 10 * limit
    np.testing.assert_allclose(path.position[0], demonstration.position[0], atol=1e-12)
    np.testing.assert_allclose(path.velocity[0], demonstration.velocity[0], atol=1e-12)
    np.testing.assert_allclose(path.acceleration[0], demonstration.acceleration[0], atol=1e-9)


@for_rngs
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


@for_rngs
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


@for_rngs
def test_reaches_of_different_distances_are_one_primitive_of_the_mean_distance(rng):
    shape = reach(rng, np.zeros(2), np.array([1.0, 0.5]), detour=0.05)
    distances = np.array([0.4, 1.0, 2.2])
    demonstrations = [
        replace(shape, **{name: d * getattr(shape, name) for name in SIGNALS}) for d in distances
    ]
    primitive = fit_vector(demonstrations, scaled=[True, True])
    for distance in (*distances, distances.mean()):
        state = {name: distance * getattr(shape, name)[0] for name in SIGNALS[1:]}
        start, goal = distance * shape.position[[0, -1]]
        path = primitive.unroll(DT, start, goal, **state)
        assert normalised_error(path.position, distance * shape.position) < 1e-6


def test_an_axis_that_hardly_moves_is_never_scaled():
    found = relative_scale(np.full(3, 3.0), np.array([1e-4, 2.0, 2.0]), np.array([True, True, False]))
    np.testing.assert_array_equal(found, [1.0, 1.5, 1.0])


def test_samples_run_up_to_the_one_nearest_to_the_duration():
    assert [sample_count(duration, 1 / 300) for duration in (1.0, 0.9999, 1.0018)] == [301, 301, 302]


SIGNALS = ("position", "velocity", "acceleration")
START, LEVEL, STEEP = np.array([0.1, 0.2, 0.3]), np.array([0.5, 0.4, 0.35]), np.array([0.12, 0.2, 0.8])
REACHES = pytest.mark.parametrize(("goal", "kind"), [(LEVEL, "up"), (STEEP, "side"), (START, "world")])


def demonstration(rng, goal, **options):
    detour = 0.0 if goal is START else 0.03
    path = reach(rng, START, goal, **options, detour=detour)
    if goal is START:  # a small loop that ends where it began
        loop = reach(rng, START, START, **options, detour=0.03)
        back = (loop.position[-1] - loop.position[0]) * (loop.time / loop.duration)[:, None]
        rate = (loop.position[-1] - loop.position[0]) / loop.duration
        return type(path)(loop.time, loop.position - back, loop.velocity - rate, loop.acceleration)
    return path


@REACHES
@for_rngs
def test_a_reach_is_reproduced_in_its_frame(goal, kind, rng):
    demonstrated = demonstration(rng, goal)
    primitive = fit_position([demonstrated])
    assert primitive.frame == kind
    assert primitive.duration == pytest.approx(demonstrated.duration)
    path = primitive.unroll(DT)
    assert np.linalg.norm(path.position - demonstrated.position, axis=1).max() < 1e-3
    assert normalised_error(path.position, demonstrated.position) < 1e-5
    assert normalised_error(path.velocity, demonstrated.velocity) < 1e-4
    np.testing.assert_allclose(path.acceleration[0], demonstrated.acceleration[0], atol=1e-9)


def random_reach(rng, goal=LEVEL):
    fitted = fit_position([demonstration(rng, goal)])
    return replace(fitted, local=replace(fitted.local, weights=rng.uniform(-300, 300, size=(25, 3))))


@REACHES
@for_rngs
def test_turning_start_goal_and_frame_together_turns_the_path(goal, kind, rng):
    primitive = random_reach(rng, goal)
    turn, shift = random_orientations(rng), rng.normal(size=3)
    state = {name: rng.normal(size=3) for name in ("velocity", "acceleration")}
    turned = {name: quaternion.rotate(turn, value) for name, value in state.items()}
    frame = local_frame(primitive.start, primitive.goal, primitive.frame)
    start, goal = (quaternion.rotate(turn, end) + shift for end in (primitive.start, primitive.goal))
    path = primitive.unroll(DT, **state)
    moved = primitive.unroll(DT, start, goal, frame=quaternion.rotate(turn, frame.T).T, **turned)
    np.testing.assert_allclose(moved.position, quaternion.rotate(turn, path.position) + shift, atol=1e-9)


@for_rngs
def test_demonstrations_in_other_directions_are_one_primitive(rng):
    demonstrated = demonstration(rng, LEVEL)
    turned = []
    for angle in (0.0, 0.5, -0.4):
        turn = quaternion.from_rotation_vector([0.0, 0.0, angle])
        signals = {name: quaternion.rotate(turn, vars(demonstrated)[name]) for name in SIGNALS}
        turned.append(replace(demonstrated, **signals))
    primitive, alone = fit_position(turned), fit_position([demonstrated])
    np.testing.assert_allclose(primitive.local.weights[1:], alone.local.weights[1:], atol=1e-3)
    path = primitive.unroll(DT, demonstrated.position[0], demonstrated.position[-1])
    assert np.linalg.norm(path.position - demonstrated.position, axis=1).max() < 1e-3  # IV.6.1


def loops(mean_m, spread_m, count=8):
    """Loops of 10 cm that end `mean_m` +- `spread_m` from their start, level."""
    rng = np.random.default_rng(1)
    time = np.linspace(0.0, 1.0, 600)
    s = minimum_jerk(time)
    loop = 0.1 * np.stack([np.sin(2 * np.pi * s), 1.0 - np.cos(2 * np.pi * s), 0.0 * s], axis=1)
    ends = [mean_m, 0.0, 0.0] + spread_m * rng.standard_normal((count, 3)) * [1.0, 1.0, 0.0]
    return [differentiated(loop + end * s[:, None], 0.005, 5.0) for end in ends]


@pytest.mark.parametrize(
    ("mean_m", "spread_m", "frame"),
    [
        (0.0, 0.005, "world"),
        (0.012, 0.0, "up"),
        (0.012, 0.005, "world"),
        (0.03, 0.02, "world"),
        (0.05, 0.02, "world"),
    ],
)
def test_a_loop_is_learned_in_the_frame_in_which_demonstrations_agree(mean_m, spread_m, frame):
    demonstrated = loops(mean_m, spread_m)
    scaled, every = (True, False, False), np.ones(len(demonstrated), dtype=bool)
    primitive = fit_position(demonstrated, scaled)
    assert primitive.frame == fit_position_subsets(demonstrated, scaled)(every, "joint").frame == frame
    assert fit_position(demonstrated, scaled, frame="base").frame == "world"
    for path in demonstrated:
        own = primitive.unroll(path.dt, path.position[0], path.position[-1], path.duration)
        assert np.linalg.norm(own.position - path.position, axis=1).max() < 0.006  # m
