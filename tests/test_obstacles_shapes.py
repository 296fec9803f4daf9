import numpy as np
import pytest
from scipy.spatial import cKDTree

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
from structlearn.core.errors import InputError

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
    with pytest.raises(InputError, match=message):
        make()
