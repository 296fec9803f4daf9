import numpy as np
import pytest
from committed import committed
from hypothesis import given
from hypothesis import strategies as st

from structlearn.ground.errors import InputError
from structlearn.policy_search.pi2 import CovarianceParameters, adapted_covariance, covariance_factor

rngs = st.integers(0, 2**32 - 1).map(np.random.default_rng)
MODES = ("per_weight", "rescaled", "full", "kept")
NO_FLOOR = 1e-9


def random_covariance(rng, dimensions):
    root = rng.normal(size=(dimensions, dimensions))
    return root @ root.T + 0.1 * np.eye(dimensions)


def parameters_of(mode, **changes):
    return committed(CovarianceParameters, "refine.search.covariance", mode=mode, **changes)


def random_weights(rng, samples, dimensions):
    """Weights of the samples, the same for all parameters."""
    return np.tile(rng.dirichlet(np.full(samples, 0.3))[:, None], dimensions)


def estimate(deviations, weights):
    """Sigma_ml of the module's first equation, sum by sum."""
    pairs = zip(weights[:, 0], deviations, strict=True)
    return sum(weight * np.outer(deviation, deviation) for weight, deviation in pairs)


@given(rng=rngs)
def test_full_is_the_weighted_covariance_of_the_text(rng):
    old, deviations, weights = random_covariance(rng, 3), rng.normal(size=(20, 3)), random_weights(rng, 20, 3)
    new = adapted_covariance(old, deviations, weights, parameters_of("full", eigenvalue_floor=NO_FLOOR))
    np.testing.assert_allclose(new, estimate(deviations, weights), rtol=1e-7, atol=1e-7)


@given(rng=rngs, damping=st.floats(1.0, 4.0))
def test_rescaled_is_the_old_one_by_a_damped_mean_ratio(rng, damping):
    old, deviations, weights = random_covariance(rng, 5), rng.normal(size=(6, 5)), random_weights(rng, 6, 5)
    parameters = parameters_of("rescaled", damping=damping, eigenvalue_floor=NO_FLOOR)
    ratio = np.trace(np.linalg.inv(old) @ estimate(deviations, weights)) / 5
    new = adapted_covariance(old, deviations, weights, parameters)
    np.testing.assert_allclose(new, ratio ** (1 / damping) * old, rtol=1e-8)


@given(rng=rngs, damping=st.floats(1.0, 4.0))
def test_each_variance_follows_the_samples_that_were_good_in_its_parameter(rng, damping):
    """Correlations stay; undamped, the variances are those of the weighted samples."""
    old, deviations = random_covariance(rng, 4), rng.normal(size=(7, 4))
    weights = rng.dirichlet(np.ones(7), 4).T
    parameters = parameters_of("per_weight", damping=damping, eigenvalue_floor=NO_FLOOR)
    new = adapted_covariance(old, deviations, weights, parameters)
    for d in range(4):
        variance = sum(w * x**2 for w, x in zip(weights[:, d], deviations[:, d], strict=True))
        assert new[d, d] / old[d, d] == pytest.approx((variance / old[d, d]) ** (1 / damping))
    scales = [np.sqrt(np.diag(one)) for one in (old, new)]
    correlations = [one / np.outer(own, own) for one, own in zip((old, new), scales, strict=True)]
    np.testing.assert_allclose(*correlations, rtol=1e-9)


@pytest.mark.parametrize("mode", MODES)
def test_samples_that_are_as_wide_as_the_old_covariance_keep_it(mode):
    old = random_covariance(np.random.default_rng(3), 4)
    arms = 2.0 * covariance_factor(old).T  # rows: sqrt(D) times the factor's columns
    new = adapted_covariance(old, np.concatenate([arms, -arms]), np.full((8, 4), 1 / 8), parameters_of(mode))
    np.testing.assert_allclose(new, old, rtol=1e-9)


@pytest.mark.parametrize("mode", ["per_weight", "rescaled", "full"])
def test_no_variance_shrinks_below_the_floor(mode):
    """All weight on the old mean: nothing is left of the estimate."""
    old = random_covariance(np.random.default_rng(1), 4)
    new = adapted_covariance(
        old, np.zeros((5, 4)), np.full((5, 4), 0.2), parameters_of(mode, eigenvalue_floor=0.2)
    )
    np.testing.assert_allclose(new, 0.2 * old, rtol=1e-9)


@pytest.mark.parametrize("mode", MODES)
@given(rng=rngs)
def test_a_linear_change_of_the_parameters_changes_nothing(mode, rng):
    """Of their units alone, where each parameter has a variance of its own."""
    old, deviations, weights = random_covariance(rng, 4), rng.normal(size=(6, 4)), random_weights(rng, 6, 4)
    change = rng.normal(size=(4, 4)) + 3.0 * np.eye(4)
    if mode == "per_weight":
        change = np.diag(rng.uniform(0.1, 10.0, 4))
    parameters = parameters_of(mode, eigenvalue_floor=0.3)
    expected = change @ adapted_covariance(old, deviations, weights, parameters) @ change.T
    found = adapted_covariance(change @ old @ change.T, deviations @ change.T, weights, parameters)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("mode", MODES)
@given(rng=rngs, samples=st.integers(2, 40), dimensions=st.integers(1, 30), spread=st.floats(1e-6, 1e6))
def test_covariances_stay_symmetric_and_positive_definite(mode, rng, samples, dimensions, spread):
    """Over many updates, also with fewer samples than dimensions and weights on single samples."""
    covariance = spread * random_covariance(rng, dimensions)
    for _ in range(40):
        deviations = rng.normal(size=(samples, dimensions)) @ covariance_factor(covariance).T
        weights = random_weights(rng, samples, dimensions)
        covariance = adapted_covariance(covariance, deviations, weights, parameters_of(mode))
        np.testing.assert_allclose(covariance, covariance.T, rtol=1e-12)
        assert np.all(np.linalg.eigvalsh(covariance / np.trace(covariance)) > 0)


def test_a_direction_may_become_very_narrow():
    """The first axis is never hit, the others keep their width: 1e-60 beside 1 must still be factored."""
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    covariance = np.eye(3)
    arms = np.sqrt(2.0) * np.concatenate([np.eye(3)[1:], -np.eye(3)[1:]]) @ turn
    for _ in range(200):
        covariance = adapted_covariance(covariance, arms, np.full((4, 3), 1 / 4), parameters_of("full"))
    widths = np.linalg.eigvalsh(covariance)
    assert 0 < widths[0] < 1e-10
    np.testing.assert_allclose(widths[1:], 1.0, rtol=1e-6)


def test_a_covariance_that_is_none_is_named():
    with pytest.raises(InputError, match="not positive definite"):
        covariance_factor(np.array([[1.0, 2.0], [2.0, 1.0]]))
