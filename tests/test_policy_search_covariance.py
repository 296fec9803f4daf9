import numpy as np
import pytest
from committed import committed
from hypothesis import given
from hypothesis import strategies as st

from structlearn.ground.errors import InputError
from structlearn.policy_search.covariance import CovarianceParameters, adapted, factor, moments

rngs = st.integers(0, 2**32 - 1).map(np.random.default_rng)
CENTRES, MODES = ("old_mean", "new_mean"), ("rescaled", "full", "kept")
NO_FLOOR = 1e-9


def random_covariance(rng, dimensions):
    root = rng.normal(size=(dimensions, dimensions))
    return root @ root.T + 0.1 * np.eye(dimensions)


def parameters_of(mode, centre="old_mean", **changes):
    return committed(CovarianceParameters, "refine.search.covariance", mode=mode, centre=centre, **changes)


def random_weights(rng, samples, steps):
    weights = rng.dirichlet(np.full(samples, 0.3), steps).T
    over_time = rng.random(steps)
    return weights, over_time / over_time.sum()


def estimate(deviations, weights, over_time, centre):
    """Sigma_ml of the module's first equation, sum by sum."""
    total = 0.0
    for weight, row in zip(over_time, weights.T, strict=True):
        mean = np.zeros(deviations.shape[1]) if centre == "old_mean" else row @ deviations
        for p, deviation in zip(row, deviations, strict=True):
            total = total + weight * p * np.outer(deviation - mean, deviation - mean)
    return total


@pytest.mark.parametrize("centre", CENTRES)
@given(rng=rngs)
def test_full_is_the_weighted_covariance_of_the_text(centre, rng):
    old, deviations = random_covariance(rng, 3), rng.normal(size=(20, 3))
    weights, over_time = random_weights(rng, 20, 6)
    parameters = parameters_of("full", centre, eigenvalue_floor=NO_FLOOR)
    new = adapted(old, deviations, moments(weights, over_time, centre), parameters)
    np.testing.assert_allclose(new, estimate(deviations, weights, over_time, centre), rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("centre", CENTRES)
@given(rng=rngs, damping=st.floats(1.0, 4.0))
def test_rescaled_is_the_old_one_by_a_damped_mean_ratio(centre, rng, damping):
    old, deviations = random_covariance(rng, 5), rng.normal(size=(6, 5))
    weights, over_time = random_weights(rng, 6, 4)
    parameters = parameters_of("rescaled", centre, damping=damping, eigenvalue_floor=NO_FLOOR)
    new = adapted(old, deviations, moments(weights, over_time, centre), parameters)
    ratio = np.trace(np.linalg.inv(old) @ estimate(deviations, weights, over_time, centre)) / 5
    np.testing.assert_allclose(new, ratio ** (1 / damping) * old, rtol=1e-8)


@pytest.mark.parametrize("mode", MODES)
def test_samples_that_are_as_wide_as_the_old_covariance_keep_it(mode):
    old = random_covariance(np.random.default_rng(3), 4)
    arms = 2.0 * factor(old).T  # rows: sqrt(D) times the factor's columns
    weights = moments(np.full((8, 1), 1 / 8), np.ones(1), "old_mean")
    new = adapted(old, np.concatenate([arms, -arms]), weights, parameters_of(mode))
    np.testing.assert_allclose(new, old, rtol=1e-9)


def test_kept_is_the_old_one():
    old = random_covariance(np.random.default_rng(0), 2)
    weights = moments(np.array([[1.0], [0.0]]), np.ones(1), "old_mean")
    new = adapted(old, np.array([[9.0, 9.0], [0.0, 0.0]]), weights, parameters_of("kept"))
    np.testing.assert_array_equal(new, old)


@pytest.mark.parametrize("mode", ["rescaled", "full"])
def test_no_variance_shrinks_below_the_floor(mode):
    """All weight on one sample: around the new mean nothing is left of the estimate."""
    old = random_covariance(np.random.default_rng(1), 4)
    deviations = np.random.default_rng(2).normal(size=(5, 4))
    weights = moments(np.eye(5)[:, :1], np.ones(1), "new_mean")
    parameters = parameters_of(mode, "new_mean", eigenvalue_floor=0.2)
    np.testing.assert_allclose(adapted(old, deviations, weights, parameters), 0.2 * old, rtol=1e-9)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("centre", CENTRES)
@given(rng=rngs)
def test_a_linear_change_of_the_parameters_changes_nothing(mode, centre, rng):
    old, deviations = random_covariance(rng, 4), rng.normal(size=(6, 4))
    change = rng.normal(size=(4, 4)) + 3.0 * np.eye(4)
    weights = moments(*random_weights(rng, 6, 3), centre)
    parameters = parameters_of(mode, centre, eigenvalue_floor=0.3)
    expected = change @ adapted(old, deviations, weights, parameters) @ change.T
    found = adapted(change @ old @ change.T, deviations @ change.T, weights, parameters)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("centre", CENTRES)
@given(rng=rngs, samples=st.integers(2, 40), dimensions=st.integers(1, 30), spread=st.floats(1e-6, 1e6))
def test_covariances_stay_symmetric_and_positive_definite(mode, centre, rng, samples, dimensions, spread):
    """Over many updates, also with fewer samples than dimensions and weights on single samples."""
    covariance = spread * random_covariance(rng, dimensions)
    parameters = parameters_of(mode, centre)
    for _ in range(40):
        deviations = rng.normal(size=(samples, dimensions)) @ factor(covariance).T
        weights = moments(*random_weights(rng, samples, 3), centre)
        covariance = adapted(covariance, deviations, weights, parameters)
        np.testing.assert_allclose(covariance, covariance.T, rtol=1e-12)
        assert np.all(np.linalg.eigvalsh(covariance / np.trace(covariance)) > 0)


def test_a_direction_may_become_very_narrow():
    """The first axis is never hit, the others keep their width: 1e-60 beside 1 must still be factored."""
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    covariance = np.eye(3)
    arms = np.sqrt(2.0) * np.concatenate([np.eye(3)[1:], -np.eye(3)[1:]]) @ turn
    weights = moments(np.full((4, 1), 1 / 4), np.ones(1), "old_mean")
    for _ in range(200):
        covariance = adapted(covariance, arms, weights, parameters_of("full"))
    widths = np.linalg.eigvalsh(covariance)
    assert 0 < widths[0] < 1e-10
    np.testing.assert_allclose(widths[1:], 1.0, rtol=1e-6)


def test_a_covariance_that_is_none_is_named():
    with pytest.raises(InputError, match="not positive definite"):
        factor(np.array([[1.0, 2.0], [2.0, 1.0]]))
