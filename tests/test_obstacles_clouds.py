import numpy as np
import pytest

from structlearn.avoidance.shapes import cloud_batch, constant_velocity
from structlearn.ground.errors import InputError

CORNERS = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1.0, 1) for z in (-1.0, 1)])


def test_the_centre_is_the_mean_and_the_radius_the_mean_distance():
    batch = cloud_batch(np.stack([CORNERS, 0.1 * CORNERS + 2.0]))
    np.testing.assert_allclose(batch.centre, [[0, 0, 0], [2, 2, 2]], atol=1e-12)
    np.testing.assert_allclose(batch.radius, [np.sqrt(3), 0.1 * np.sqrt(3)])
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
    ("points", "options", "message"),
    [
        (np.zeros((2, 0, 3)), {}, "no points"),
        (CORNERS, {}, "scenarios, points, 3"),
        (np.where(CORNERS > 0, np.nan, CORNERS)[None], {}, "not finite"),
        (np.zeros((1, 4, 3)), {}, "no extent"),
        (CORNERS[None], {"radius": 0.0}, "no extent"),
        (CORNERS[None], {"centre": np.zeros(3)}, r"finite \(1, 3\)"),
        (CORNERS[None], {"centre": np.full((1, 3), np.nan)}, r"finite \(1, 3\)"),
    ],
)
def test_clouds_that_are_none_are_refused(points, options, message):
    with pytest.raises(InputError, match=message):
        cloud_batch(points, **options)


def test_a_motion_that_is_not_finite_is_refused():
    batch = cloud_batch(CORNERS[None], motion=lambda time: np.full(3, np.nan if time else 0.0))
    with pytest.raises(InputError, match="not finite"):
        batch.path(np.array([0.0, 1.0]))
