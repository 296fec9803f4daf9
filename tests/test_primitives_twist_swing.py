import numpy as np
import pytest
from primitives_movements import (
    for_rngs,
    random_orientations,
    random_twist_swing,
    random_vectors,
    wobbly_turn,
)

from structlearn.core import quaternion
from structlearn.primitives import twist_swing as chart
from structlearn.primitives.trajectory import differentiated_orientation

DT = 0.005
AXIS = np.array([0.2, -0.4, 1.0])


def random_axes(rng):
    return np.linalg.qr(rng.normal(size=(3, 3)))[0]


def random_coordinates(rng, *shape):
    """Any twist; swings up to 2.9 rad (at pi the axis is upside down and the chart singular)."""
    direction = rng.normal(size=(*shape, 2))
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    swing = rng.uniform(0, 2.9, size=(*shape, 1)) * direction
    return np.concatenate([rng.uniform(-15, 15, size=(*shape, 1)), swing], axis=-1)


def wrapped(angle):
    return np.arctan2(np.sin(angle), np.cos(angle))


@for_rngs
def test_the_chart_and_its_inverse_agree(rng):
    axes, coordinates = random_axes(rng), random_coordinates(rng, 40)
    found = chart.to_chart(chart.from_chart(coordinates, axes), axes)
    np.testing.assert_allclose(found[:, 1:], coordinates[:, 1:], atol=1e-10)
    np.testing.assert_allclose(wrapped(found[:, 0] - coordinates[:, 0]), 0.0, atol=1e-10)
    assert np.abs(found[:, 0]).max() <= np.pi

    q = random_orientations(rng, 40)
    assert quaternion.angle_between(chart.from_chart(chart.to_chart(q, axes), axes), q).max() < 1e-7
    np.testing.assert_allclose(
        chart.from_chart(chart.to_chart(-q, axes), axes), chart.from_chart(chart.to_chart(q, axes), axes)
    )


def test_a_pure_twist_and_a_pure_swing_stay_alone():
    axes = np.eye(3)[:, [2, 0, 1]]
    twist = quaternion.from_rotation_vector([0.0, 0.0, 3.0])
    np.testing.assert_allclose(chart.to_chart(twist, axes), [3.0, 0, 0], atol=1e-14)
    swing = quaternion.from_rotation_vector([0.5, -0.2, 0.0])
    np.testing.assert_allclose(chart.to_chart(swing, axes), [0, 0.5, -0.2], atol=1e-14)
    np.testing.assert_array_equal(chart.to_chart(quaternion.IDENTITY, axes), np.zeros(3))


@for_rngs
def test_angular_rates_and_chart_rates_are_inverse(rng):
    axes, coordinates = random_axes(rng), random_coordinates(rng, 40)
    rates, accelerations = rng.normal(size=(2, 40, 3)) * 3
    velocity, acceleration = chart.angular_rates(coordinates, rates, accelerations, axes)
    found = chart.chart_rates(coordinates, velocity, acceleration, axes)
    np.testing.assert_allclose(found[0], rates, atol=1e-9)
    np.testing.assert_allclose(found[1], accelerations, atol=1e-8)


@pytest.mark.parametrize("swing", [0.0, 1e-9, 0.05, 0.0999, 0.1001, 1.0, 2.8])
def test_angular_rates_are_the_derivatives_of_the_orientation(swing):
    rng = np.random.default_rng(1)
    axes, h = random_axes(rng), 1e-4
    direction = np.array([0.6, -0.8])
    coordinates = np.concatenate([[4.0], swing * direction])
    rates, accelerations = np.array([2.0, -1.0, 0.7]), np.array([-3.0, 2.0, 1.0])

    def orientation(t):
        return chart.from_chart(coordinates + rates * t + accelerations * t**2 / 2, axes)

    before, here, after = orientation(-h), orientation(0.0), orientation(h)
    velocity, acceleration = chart.angular_rates(coordinates, rates, accelerations, axes)
    np.testing.assert_allclose(quaternion.difference(after, before) / (2 * h), velocity, atol=1e-6)
    change = quaternion.difference(after, here) - quaternion.difference(here, before)
    np.testing.assert_allclose(change / h**2, acceleration, atol=1e-5)


@for_rngs
def test_the_dominant_axis_is_the_one_turned_about(rng):
    turn = rng.uniform(0.3, 14.0)
    demonstrated = [wobbly_turn(rng, turn, wobble=0.02, axis=AXIS) for _ in range(3)]
    axes = chart.dominant_axes(demonstrated)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert axes[:, 0] @ AXIS / np.linalg.norm(AXIS) > 0.9
    assert chart.largest_turn(demonstrated) == pytest.approx(turn, abs=0.1)


@pytest.mark.parametrize("turns", [0.3, -1.0, 1.7, -3.2])
@for_rngs
def test_several_recordings_with_sign_flips_are_one_primitive(turns, rng):
    seed, base, axis = rng.integers(2**32), random_orientations(rng), rng.normal(size=3)
    recorded = []
    for duration in (1.2, 1.5, 2.0):
        path = wobbly_turn(np.random.default_rng(seed), 2 * np.pi * turns, 0.2, duration, DT, base, axis)
        nudge = quaternion.from_rotation_vector(random_vectors(rng, 0.05))
        flips = rng.choice([-1.0, 1.0], size=(len(path.time), 1))
        recorded.append(quaternion.product(path.orientation, nudge) * flips)
    demonstrated = [differentiated_orientation(path, DT, cutoff_hz=40.0) for path in recorded]
    primitive = chart.fit_twist_swing(demonstrated)
    for demonstration in demonstrated:
        start, goal = demonstration.orientation[[0, -1]]
        path = primitive.unroll(DT, start, goal, demonstration.duration)
        error = np.degrees(quaternion.angle_between(path.orientation, demonstration.orientation))
        assert error.max() < 5.0
        assert error[-1] < 0.5
        turned = chart.largest_turn([path])
        demonstrated_turn = chart.largest_turn([demonstration])
        assert turned == pytest.approx(demonstrated_turn, abs=0.2)  # not a turn fewer or more


@for_rngs
def test_the_reported_rates_are_those_of_the_path(rng):
    path = random_twist_swing(rng).unroll(0.0005)
    found = quaternion.angular_velocity(path.orientation, 0.0005)
    scale = np.abs(path.angular_velocity).max()
    np.testing.assert_allclose(found[1:-1], path.angular_velocity[1:-1], atol=1e-3 * scale)
    change = np.gradient(path.angular_velocity, 0.0005, axis=0)[1:-1]
    scale = np.abs(path.angular_acceleration).max()
    np.testing.assert_allclose(change, path.angular_acceleration[1:-1], atol=1e-2 * scale)
