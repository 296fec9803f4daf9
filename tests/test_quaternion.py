import numpy as np
import pytest
from hypothesis import given
from primitives_movements import quick, random_orientations, random_vectors, rngs
from scipy.spatial.transform import Rotation, Slerp

from structlearn.core import quaternion


def scipy_rotation(q):
    return Rotation.from_quat(quaternion.to_xyzw(q))


def same_rotation(a, b, tolerance=1e-12):
    assert np.abs(np.abs(np.sum(a * b, axis=-1)) - 1.0).max() < tolerance


@given(rngs)
@quick
def test_product_is_the_composition_of_rotations(rng):
    a, b = random_orientations(rng, 2, 20)
    expected = (scipy_rotation(a) * scipy_rotation(b)).as_matrix()
    found = scipy_rotation(quaternion.product(a, b)).as_matrix()  # eq. B.1
    np.testing.assert_allclose(found, expected, atol=1e-13)


@given(rngs)
@quick
def test_rotation_vectors_agree_with_scipy_both_ways(rng):
    q, vector = random_orientations(rng, 50), random_vectors(rng, rng.uniform(0, np.pi, size=(50, 1)), 50)
    np.testing.assert_allclose(quaternion.rotation_vector(q), scipy_rotation(q).as_rotvec(), atol=1e-12)
    same_rotation(
        quaternion.from_rotation_vector(vector), quaternion.from_xyzw(Rotation.from_rotvec(vector).as_quat())
    )


@pytest.mark.parametrize("angle", [1e-3, 1e-6, 1e-9, 1e-11, 1e-15, 1e-30])
def test_the_logarithm_is_exact_near_the_identity(angle):
    vector = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    found = quaternion.rotation_vector(quaternion.from_rotation_vector(vector))
    np.testing.assert_allclose(found, vector, rtol=1e-12)  # arccos(r) would lose half the digits


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9, 1e-12])
def test_the_logarithm_is_exact_near_half_a_turn(gap):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    below, above = quaternion.from_rotation_vector(np.array([[np.pi - gap], [np.pi + gap]]) * axis)
    np.testing.assert_allclose(quaternion.rotation_vector(below), (np.pi - gap) * axis, atol=1e-14)
    np.testing.assert_allclose(quaternion.rotation_vector(above), -(np.pi - gap) * axis, atol=1e-14)


@given(rngs)
@quick
def test_rotate_agrees_with_scipy(rng):
    q, vectors = random_orientations(rng, 20), rng.normal(size=(20, 3))
    for some, its in ((q, vectors), (q[0], vectors), (q, vectors[0])):
        np.testing.assert_allclose(quaternion.rotate(some, its), scipy_rotation(some).apply(its), atol=1e-13)


@given(rngs)
@quick
def test_difference_turns_one_orientation_into_the_other(rng):
    target, q = random_orientations(rng, 2, 20)
    vector = quaternion.difference(target, q)
    same_rotation(quaternion.product(quaternion.from_rotation_vector(vector), q), target)
    expected = scipy_rotation(target) * scipy_rotation(q).inv()
    np.testing.assert_allclose(vector, expected.as_rotvec(), atol=1e-12)
    np.testing.assert_allclose(quaternion.angle_between(target, q), expected.magnitude(), atol=1e-12)


@given(rngs)
@quick
def test_sign_continuous_undoes_every_flip(rng):
    angles = np.cumsum(rng.uniform(-0.3, 0.3, size=(3, 60, 3)), axis=1)
    path = quaternion.product(random_orientations(rng, 3, 1), quaternion.from_rotation_vector(angles))
    smooth = quaternion.sign_continuous(path)
    flips = rng.choice([-1.0, 1.0], size=(3, 60, 1))
    flips[:, 0] = 1.0  # the first one is kept
    np.testing.assert_array_equal(quaternion.sign_continuous(smooth * flips), smooth)
    assert (np.sum(smooth[:, 1:] * smooth[:, :-1], axis=-1) > 0).all()
    same_rotation(smooth, path)


@given(rngs)
@quick
def test_mean_does_not_depend_on_signs(rng):
    vectors = random_vectors(rng, rng.uniform(0, 0.8, size=(9, 1)), 9)
    q = quaternion.product(quaternion.from_rotation_vector(vectors), random_orientations(rng))
    mean = quaternion.mean(q * rng.choice([-1.0, 1.0], size=(9, 1)))
    np.testing.assert_allclose(mean, quaternion.mean(q), atol=1e-12)
    assert mean[0] >= 0
    assert np.linalg.norm(mean) == pytest.approx(1.0)
    same_rotation(mean, quaternion.from_xyzw(scipy_rotation(q).mean().as_quat()))


@given(rngs)
@quick
def test_interpolation_is_slerp_even_across_sign_flips(rng):
    stamps = np.cumsum(rng.uniform(0.1, 1.0, size=8))
    path = random_orientations(rng, 8)
    times = np.append(rng.uniform(stamps[0], stamps[-1], size=30), stamps)
    found = quaternion.interpolate(times, stamps, path * rng.choice([-1.0, 1.0], size=(8, 1)))
    expected = Slerp(stamps, scipy_rotation(path))(times)
    assert (scipy_rotation(found) * expected.inv()).magnitude().max() < 1e-7
    same_rotation(found[-8:], path)


def test_angular_velocity_of_a_steady_turn_is_exact():
    rate = np.array([1.0, -2.0, 0.5])
    time = 0.01 * np.arange(400)  # more than one full turn
    path = quaternion.product(
        quaternion.from_rotation_vector(time[:, None] * rate), quaternion.exp(np.ones(3))
    )
    np.testing.assert_allclose(quaternion.angular_velocity(path, 0.01), np.tile(rate, (400, 1)), atol=1e-10)


@quick
@given(rngs)
def test_the_rotation_matrix_turns_as_the_quaternion_does(rng):
    q, vector = random_orientations(rng, 1)[0], rng.normal(size=3)
    np.testing.assert_allclose(quaternion.matrix(q) @ vector, quaternion.rotate(q, vector), atol=1e-12)
