"""Obstacles as solids and clouds, and what models see of them."""

import numpy as np
import pytest
from hypothesis import given
from primitives_movements import quick, rngs
from scipy.spatial import cKDTree

from structlearn.avoidance import features as module
from structlearn.avoidance.features import NAMES, displaced, obstacle_features
from structlearn.avoidance.shapes import (
    HALF_SIZE_M,
    SHAPES,
    Obstacle,
    check_cloud,
    cloud_batch,
    constant_velocity,
    obstacle,
    ringed_sphere,
    virtual_radius,
)

CENTRE = np.array([0.3, -0.2, 0.1])


@pytest.fixture(params=SHAPES)
def solid(request):
    return obstacle(request.param, CENTRE, yaw=0.4)


def surface_area(solid):
    a, b, c = solid.half_size
    if solid.shape == "sphere":
        return 4 * np.pi * a**2
    return 8 * (a * b + b * c + c * a) if solid.shape == "cube" else 2 * np.pi * a * (a + 2 * c)


def test_distances_known_by_hand():
    ball = Obstacle("sphere", np.zeros(3), np.full(3, 0.5))
    np.testing.assert_allclose(ball.signed_distance([[0, 0, 2], [0, 0, 0], [0.3, 0, 0.4]]), [1.5, -0.5, 0])
    box = Obstacle("cube", np.zeros(3), np.array([1.0, 2.0, 3.0]))
    points = [[4, 6, 3], [0, 0, 0], [0, 1.9, 0], [2, 0, 0]]  # over an edge, centre, near a face, outside
    np.testing.assert_allclose(box.signed_distance(points), [5, -1, -0.1, 1])
    can = Obstacle("cylinder", np.zeros(3), np.array([1.0, 1.0, 2.0]))
    points = [[0, 4, 6], [0, 0, 0], [0, 0, 1.9], [3, 0, 1], [0, 0, 5]]
    np.testing.assert_allclose(can.signed_distance(points), [5, -1, -0.1, 2, 3])


def test_distance_agrees_with_a_dense_cloud(solid):
    rng = np.random.default_rng(0)
    points = CENTRE + rng.uniform(-0.3, 0.3, (200, 3))
    nearest = cKDTree(solid.cloud(100_000)).query(points)[0]
    np.testing.assert_allclose(np.abs(solid.signed_distance(points)), nearest, atol=2e-3)


def test_normal_is_the_gradient_of_the_distance(solid):
    rng = np.random.default_rng(1)
    points = CENTRE + rng.uniform(-0.2, 0.2, (500, 3))
    steps = 1e-6 * np.eye(3)
    differences = [
        solid.signed_distance(points + step) - solid.signed_distance(points - step) for step in steps
    ]
    distance, normal = solid.distance_and_normal(points)
    np.testing.assert_allclose(normal, np.stack(differences, axis=-1) / 2e-6, atol=1e-6)
    np.testing.assert_array_equal(distance, solid.signed_distance(points))


@pytest.mark.parametrize("count", [30, 100, 400])
def test_clouds_cover_the_surface_evenly(solid, count):
    cloud = solid.cloud(count)
    assert cloud.shape == (count, 3)
    np.testing.assert_allclose(solid.signed_distance(cloud), 0.0, atol=1e-12)
    share = np.sqrt(surface_area(solid) / count)  # side of a square with one point's share of the area
    assert cKDTree(cloud).query(solid.cloud(50_000))[0].max() < 1.5 * share
    np.testing.assert_allclose(cloud.mean(axis=0), CENTRE, atol=0.1 * share)
    np.testing.assert_array_equal(cloud, solid.cloud(count))


def test_sphere_of_rings_has_35_points_and_the_centre_last():
    centres = np.stack([CENTRE, np.zeros(3)])
    clouds = ringed_sphere(centres, 0.05)
    assert clouds.shape == (2, 35, 3)
    np.testing.assert_array_equal(clouds[:, -1], centres)
    np.testing.assert_allclose(np.linalg.norm(clouds[:, :-1] - centres[:, None], axis=-1), 0.05)
    np.testing.assert_allclose(clouds.mean(axis=1), centres, atol=1e-15)


CORNERS = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1.0, 1) for z in (-1.0, 1)])


def test_the_centre_is_the_mean_and_the_radius_the_mean_distance():
    batch = cloud_batch(np.stack([CORNERS, 0.1 * CORNERS + 2.0]))
    np.testing.assert_allclose(batch.centre, [[0, 0, 0], [2, 2, 2]], atol=1e-12)
    np.testing.assert_allclose(batch.radius, [np.sqrt(3), 0.1 * np.sqrt(3)])
    assert obstacle("sphere", CENTRE).radius == pytest.approx(HALF_SIZE_M["sphere"][0], rel=1e-3)
    np.testing.assert_array_equal(cloud_batch(CORNERS[None], radius=0.05).radius, [0.05])
    known = cloud_batch(CORNERS[None], centre=np.ones((1, 3)))
    np.testing.assert_array_equal(known.centre, [[1, 1, 1]])
    np.testing.assert_allclose(known.radius, [np.sqrt(3)])


def test_a_cloud_stays_or_moves_as_told():
    times = np.array([0.0, 0.5, 2.0])
    np.testing.assert_array_equal(cloud_batch(CORNERS[None]).path(times), np.zeros((1, 3, 3)))
    moving = cloud_batch(np.stack([CORNERS, CORNERS]), motion=constant_velocity([[1, 0, 0], [0, -2, 0]]))
    np.testing.assert_allclose(
        moving.path(times)[:, :, :2], [[[0, 0], [0.5, 0], [2, 0]], [[0, 0], [0, -1], [0, -4]]]
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Obstacle("cone", CENTRE, np.ones(3)), "unknown obstacle 'cone'; known are sphere, cube"),
        (lambda: Obstacle("cube", CENTRE, np.array([1, 0, 1])), "half_size must be three positive lengths"),
        (lambda: Obstacle("sphere", CENTRE, np.array([1, 1, 2])), "sphere: is not round"),
        (lambda: obstacle("cube", CENTRE).cloud(5), "at least 6 points, not 5"),
        (lambda: virtual_radius(np.empty((0, 3))), "has no points"),
        (lambda: check_cloud(np.zeros((4, 2))), r"must be \(\.\.\., points, 3\)"),
        (lambda: check_cloud(np.full((4, 3), np.nan)), "not finite"),
        (lambda: cloud_batch(CORNERS), "scenarios, points, 3"),
        (lambda: cloud_batch(CORNERS[None], radius=0.0), "no extent"),
        (lambda: cloud_batch(CORNERS[None], centre=np.full((1, 3), np.nan)), r"finite \(1, 3\)"),
    ],
)
def test_impossible_solids_and_clouds_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


RECORDED = "clmc/obs_avoid/pmnn_unroll_test_dataset/subsampled_test_unroll_prim_1_X_raw_obs_avoid.txt"


def random_states(rng, batch=5, points=12):
    position, velocity, centre = rng.normal(size=(3, batch, 3))
    return position, velocity, rng.normal(size=(batch, points, 3)), centre


def one_by_one(position, velocity, tau, cloud, centre):
    """The definition, point by point."""
    rows = []
    for x, v, points, c in zip(position, velocity, cloud, centre, strict=True):
        nearest = sorted(points - x, key=np.linalg.norm)[:3]
        stacked = [nearest[point][axis] for axis in range(3) for point in range(3)]
        cosine = v @ nearest[0] / (np.linalg.norm(v) * np.linalg.norm(nearest[0]))
        rows.append([*(c - x), *stacked, *(tau * v), np.linalg.norm(c - x), cosine])
    return np.array(rows)


@given(rngs)
@quick
def test_displaced_features_are_those_of_a_hand_that_is_there(rng):
    position, velocity, cloud, centre = random_states(rng, points=1)
    cloud = np.repeat(cloud, 3, axis=1)  # one point: it stays the closest
    off, faster, tau = *rng.normal(size=(2, *position.shape)), 1.7
    seen = displaced(obstacle_features(position, velocity, tau, cloud, centre), off, tau * faster)
    np.testing.assert_allclose(
        seen, obstacle_features(position + off, velocity + faster, tau, cloud, centre), atol=1e-9
    )


@given(rngs)
@quick
def test_features_are_their_definition(rng):
    position, velocity, cloud, centre = random_states(rng)
    values = obstacle_features(position, velocity, 3.2, cloud, centre)
    np.testing.assert_allclose(values, one_by_one(position, velocity, 3.2, cloud, centre), atol=1e-12)
    assert len(NAMES) == len(set(NAMES)) == values.shape[-1]


def test_the_cosine_is_minus_one_where_it_is_undefined_and_one_straight_ahead():
    cloud = np.array([[1.0, 0, 0], [2, 0, 0], [3, 0, 0]])
    ahead = np.array([1.0, 0, 0])
    for velocity, position, cosine in [(0 * ahead, 0 * ahead, -1), (ahead, ahead, -1), (ahead, 0 * ahead, 1)]:
        assert obstacle_features(position, velocity, 1.0, cloud, cloud.mean(axis=0))[16] == cosine


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_finite_is_refused_by_name(bad):
    for place, name in enumerate(("position", "velocity", "cloud", "centre")):
        inputs = [array.copy() for array in random_states(np.random.default_rng(2))]
        inputs[place][1, ..., -1] = bad
        position, velocity, cloud, centre = inputs
        with pytest.raises(ValueError, match=name):
            obstacle_features(position, velocity, 1.0, cloud, centre)


@pytest.mark.parametrize(
    ("shapes", "message"),
    [
        (((2, 3), (2, 3), (2, 2, 3), (2, 3)), "2 points"),
        (((2, 2), (2, 3), (2, 9, 3), (2, 3)), "position must be"),
        (((2, 3), (3,), (3,), (2, 3)), "cloud must be"),
        (((2, 3), (2, 3), (2, 9, 3), (4, 3)), "do not fit"),
    ],
)
def test_wrong_shapes_are_refused(shapes, message):
    position, velocity, cloud, centre = (np.zeros(shape) for shape in shapes)
    with pytest.raises(ValueError, match=message):
        obstacle_features(position, velocity, 1.0, cloud, centre)


def test_recorded_features_have_the_same_columns(recorded_data):
    path = recorded_data / RECORDED
    if not path.is_file():
        pytest.skip(f"no {path.name} among the recorded data")
    recorded = np.loadtxt(path)
    assert recorded.shape == (823, 17)
    # put the hand at the origin: the recorded vectors are then the obstacle itself, as far as they are known
    cloud = recorded[:, module.TO_POINTS].reshape(-1, 3, 3).swapaxes(1, 2)
    velocity, centre = recorded[:, module.SCALED_VELOCITY], recorded[:, module.TO_CENTRE]
    shuffled = cloud[:, [2, 0, 1]]
    ours = obstacle_features(np.zeros((823, 3)), velocity, 1.0, shuffled, centre)
    np.testing.assert_allclose(ours, recorded, atol=1e-9)
