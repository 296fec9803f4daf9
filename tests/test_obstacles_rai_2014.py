import numpy as np
import pytest
from sklearn.linear_model import ARDRegression

from structlearn.avoidance import rai_2014
from structlearn.avoidance.features import features
from structlearn.core import artefacts
from structlearn.core.errors import InputError

GRID = len(rai_2014.BETA_PER_RAD) * len(rai_2014.DECAY_PER_M)


def seen(to, velocity):
    """Features of a tiny obstacle in direction `to`, seen from the origin at tau 1."""
    to = np.asarray(to, dtype=float)
    cloud = to + 1e-9 * np.eye(3)
    return features(np.zeros(3), np.asarray(velocity, dtype=float), 1.0, cloud, to)


def random_states(count, seed=0):
    rng = np.random.default_rng(seed)
    to = rng.normal(size=(count, 3))
    cloud = to[:, None] + 0.05 * rng.normal(size=(count, 6, 3))
    return features(np.zeros((count, 3)), rng.normal(size=(count, 3)), 1.0, cloud, to)


def test_effect_is_the_equation():
    found = rai_2014.steering_features(seen([1.0, 1.0, 0.0], [2.0, 0.0, 0.0]))
    angle, distance = np.pi / 4, np.sqrt(2.0)
    beta, decay = rai_2014.BETA_PER_RAD[1], rai_2014.DECAY_PER_M[3]
    place = len(rai_2014.DECAY_PER_M) + 3
    size = 2.0 * angle * np.exp(-beta * angle) * np.exp(-decay * distance)
    np.testing.assert_allclose(found[:, place], [0.0, -size, 0.0], atol=1e-12)  # away from y > 0
    np.testing.assert_allclose(found[:, GRID + place], [0.0, -size, 0.0], atol=1e-6)


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
def test_no_effect_at_rest_or_straight_ahead(velocity):
    found = rai_2014.steering_features(seen([1.0, 0.0, 0.0], velocity))
    np.testing.assert_allclose(found, 0.0, atol=1e-8)


def test_known_weights_are_found_and_others_pruned():
    states = random_states(600)
    weights = np.zeros((1, 3, 2 * GRID))
    weights[0, 1, 7], weights[0, 2, GRID + 11] = 40.0, -25.0
    truth = rai_2014.HumanInspiredModels(weights)
    target = truth(states, np.zeros(600), np.zeros(600))
    found = rai_2014.fit_human_inspired(states, target)
    again = random_states(100, seed=1)
    zero = np.zeros(100)
    np.testing.assert_allclose(found(again, zero, zero), truth(again, zero, zero), atol=0.05)
    assert found.weights[0, 0].tolist() == [0.0] * (2 * GRID)  # nothing along x: no weight along x
    assert np.count_nonzero(found.weights[0]) < 60


@pytest.mark.parametrize("count", [40, 500])
def test_the_regression_is_that_of_the_library(count):
    rng = np.random.default_rng(count)
    inputs = rng.normal(size=(count, 50)) @ rng.normal(size=(50, 50))  # correlated, as effects are
    target = inputs[:, :3].sum(axis=1) + rng.normal(size=count)
    expected = ARDRegression(max_iter=rai_2014.ITERATIONS, fit_intercept=False).fit(inputs, target)
    found = rai_2014.pruning_regression(inputs, target)
    np.testing.assert_allclose(found, expected.coef_, atol=1e-8 * np.abs(expected.coef_).max())
    assert (found == 0.0).any()


def test_model_of_each_sample():
    rng = np.random.default_rng(0)
    stack = rai_2014.HumanInspiredModels(rng.normal(size=(4, 3, 2 * GRID)))
    states, zero = random_states(4), np.zeros(4)
    found = stack(states, zero, zero)
    for index in range(4):
        alone = stack.take([index])(states, zero, zero)
        np.testing.assert_allclose(found[index], alone[index])
    with pytest.raises(ValueError, match="3 samples for 4 models"):
        stack(states[:3], zero[:3], zero[:3])


def test_files_hold_the_models(tmp_path):
    rng, path = np.random.default_rng(0), tmp_path / "models.safetensors"
    stacks = {
        name: rai_2014.HumanInspiredModels(rng.normal(size=(2, 3, 2 * GRID))) for name in ("cube", "all")
    }
    rai_2014.write_human_inspired(stacks, path)
    found = rai_2014.read_human_inspired(path)
    for name, stack in stacks.items():
        np.testing.assert_array_equal(found[name].weights, stack.weights)
    artefacts.write_tensors({"a": np.zeros(2)}, path, "{}")
    with pytest.raises(InputError, match="holds no human-inspired models"):
        rai_2014.read_human_inspired(path)
