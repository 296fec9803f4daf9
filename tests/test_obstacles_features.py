import numpy as np
import pytest
from hypothesis import given
from primitives_movements import quick, rngs

from structlearn.avoidance import features as module
from structlearn.avoidance.features import NAMES, displaced, features
from structlearn.core.errors import InputError

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
    seen = displaced(features(position, velocity, tau, cloud, centre), off, tau * faster)
    np.testing.assert_allclose(
        seen, features(position + off, velocity + faster, tau, cloud, centre), atol=1e-9
    )


@given(rngs)
@quick
def test_features_are_their_definition(rng):
    position, velocity, cloud, centre = random_states(rng)
    values = features(position, velocity, 3.2, cloud, centre)
    np.testing.assert_allclose(values, one_by_one(position, velocity, 3.2, cloud, centre), atol=1e-12)
    assert len(NAMES) == len(set(NAMES)) == values.shape[-1]


def test_the_cosine_is_minus_one_where_it_is_undefined_and_one_straight_ahead():
    cloud = np.array([[1.0, 0, 0], [2, 0, 0], [3, 0, 0]])
    ahead = np.array([1.0, 0, 0])
    for velocity, position, cosine in [(0 * ahead, 0 * ahead, -1), (ahead, ahead, -1), (ahead, 0 * ahead, 1)]:
        assert features(position, velocity, 1.0, cloud, cloud.mean(axis=0))[16] == cosine


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_finite_is_refused_by_name(bad):
    for place, name in enumerate(("position", "velocity", "cloud", "centre")):
        inputs = [array.copy() for array in random_states(np.random.default_rng(2))]
        inputs[place][1, ..., -1] = bad
        position, velocity, cloud, centre = inputs
        with pytest.raises(InputError, match=name):
            features(position, velocity, 1.0, cloud, centre)


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
    with pytest.raises(InputError, match=message):
        features(position, velocity, 1.0, cloud, centre)


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
    ours = features(np.zeros((823, 3)), velocity, 1.0, shuffled, centre)
    np.testing.assert_allclose(ours, recorded, atol=1e-9)
