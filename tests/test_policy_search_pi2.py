from dataclasses import replace

import cma
import numpy as np
import pytest
from committed import committed
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import reach
from scipy.optimize import minimize_scalar

from structlearn.ground.errors import InputError
from structlearn.policy_search.pi2 import (
    PI2Parameters,
    SearchDistribution,
    cost_to_go,
    sample,
    time_weights,
    update,
)
from structlearn.policy_search.refinement import kernel_activation
from structlearn.primitives.vector import fit_vector

rngs = st.integers(0, 2**32 - 1).map(np.random.default_rng)
DEFAULT = committed(PI2Parameters, "refine.search")
TEXT = {"samples": 38, "averaging": "per_policy", "horizon": 1.0}
COLD = committed(PI2Parameters, "refine.search", temperature=1e-3, **TEXT)
TWO_SIDES = np.array([[1.0], [-1.0]])


def random_rollouts(rng, samples=12, steps=6, dimensions=3):
    distribution = SearchDistribution.around(rng.normal(size=dimensions), rng.uniform(0.5, 2.0, dimensions))
    policies = sample(distribution, samples, rng)
    return distribution, policies, rng.random((samples, steps))


def parameters_of(mode, **others):
    """The text's form, but for the covariance."""
    return committed(PI2Parameters, "refine.search", **TEXT, covariance={"mode": mode, **others})


def slow_update(mean, policies, costs, kl_bound, floor):
    """Algorithm IV.4 line by line, the temperature by minimising the dual, time step by time step."""
    steps = costs.shape[1]
    new_mean, new_covariance = 0.0, 0.0
    for t in range(steps):
        ahead = np.array([sum(row[j] for j in range(t, steps)) for row in costs])
        ahead = (ahead - ahead.min()) / (ahead.max() - ahead.min())

        def dual(temperature, ahead=ahead):
            return temperature * (kl_bound + np.log(np.mean(np.exp(-ahead / temperature))))

        temperature = minimize_scalar(dual, bounds=(floor, 5.0), method="bounded", options={"xatol": 1e-11}).x
        p = np.exp(-ahead / temperature) / np.sum(np.exp(-ahead / temperature))
        step_mean = sum(p_k * policy for p_k, policy in zip(p, policies, strict=True))
        weight = (steps - t) / sum(range(1, steps + 1))  # t from 0
        new_mean = new_mean + weight * step_mean
        for p_k, policy in zip(p, policies, strict=True):
            new_covariance = new_covariance + weight * p_k * np.outer(policy - mean, policy - mean)
    return new_mean, new_covariance


@given(rng=rngs)
def test_equals_the_algorithm_of_the_text(rng):
    """Whatever acts when."""
    distribution, policies, costs = random_rollouts(rng)
    parameters = parameters_of("full", eigenvalue_floor=1e-9)
    new = update(distribution, policies, costs, parameters, rng.random((6, 3))).distribution
    mean, covariance = slow_update(distribution.mean, policies, costs, 1.0, 1e-3)
    np.testing.assert_allclose(new.mean, mean, atol=1e-5)
    np.testing.assert_allclose(new.covariance, covariance, atol=1e-4)


def test_a_parameter_follows_the_samples_that_were_good_while_it_acts():
    """Two samples, each better at one of two steps: the first parameter acts at the first, and so on."""
    costs, apart = np.array([[0.0, 1.0], [1.0, 0.0]]), np.eye(2)
    parameters = COLD.model_copy(update={"averaging": "per_weight", "horizon": 0.5})
    policies = np.array([[1.0, 1.0], [-1.0, -1.0]])
    found = update(SearchDistribution.around(np.zeros(2), 1.0), policies, costs, parameters, apart)
    np.testing.assert_allclose(found.weights, [[1, 0], [0, 1]], atol=1e-9)
    np.testing.assert_allclose(found.distribution.mean, [1.0, -1.0])


@given(rng=rngs)
def test_parameters_that_act_alike_have_the_text_s_weights(rng):
    distribution, policies, costs = random_rollouts(rng)
    shared = DEFAULT.model_copy(update={"averaging": "per_policy"})
    per_weight = DEFAULT.model_copy(update={"averaging": "per_weight"})
    expected = update(distribution, policies, costs, shared).weights
    for activation in (None, np.full((6, 3), 0.7)):
        found = update(distribution, policies, costs, per_weight, activation).weights
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_a_cost_beyond_the_horizon_does_not_count():
    costs = np.array([[1.0, 2.0, 4.0, 8.0]])
    np.testing.assert_array_equal(cost_to_go(costs, 0.5), [[3, 6, 12, 8]])
    np.testing.assert_array_equal(cost_to_go(costs, 1e-3), costs)  # one step at least


def test_time_weights_by_hand():
    """Three steps, two samples, costs on one step only: weights 3, 2, 1 over 6."""
    np.testing.assert_allclose(time_weights(3), [3 / 6, 2 / 6, 1 / 6])
    np.testing.assert_allclose(time_weights(1), [1.0])
    costs = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 2.0]])
    np.testing.assert_array_equal(cost_to_go(costs), [[1, 1, 0], [2, 2, 2]])
    # the first sample is better at all steps; nearly all weight at temperature 1e-3
    distribution = SearchDistribution.around(np.zeros(1), 1.0)
    assert update(distribution, TWO_SIDES, costs, COLD).distribution.mean == pytest.approx(1.0)
    # better only where nothing has been paid yet (weights 3 + 2), worse at the end (weight 1)
    costs = np.array([[0.0, 0.0, 1.0], [0.0, 2.0, 0.0]])
    found = update(distribution, TWO_SIDES, costs, COLD)
    assert found.distribution.mean == pytest.approx(5 / 6 - 1 / 6)
    np.testing.assert_allclose(found.weights[:, 0], [5 / 6, 1 / 6])


def test_two_samples_at_a_fixed_temperature():
    distribution = SearchDistribution.around(np.array([10.0, 0.0]), 1.0)
    policies = np.array([[1.0, 2.0], [3.0, -2.0]])
    warm = committed(PI2Parameters, "refine.search", temperature=0.5)
    found = update(distribution, policies, np.array([[5.0], [7.0]]), warm)
    p = 1 / (1 + np.exp(-2.0))
    np.testing.assert_allclose(found.distribution.mean, [p + 3 * (1 - p), 2 * p - 2 * (1 - p)])
    np.testing.assert_allclose(found.temperatures, 0.5)
    np.testing.assert_allclose(found.effective_samples, 1 / (p**2 + (1 - p) ** 2))


@pytest.mark.parametrize("mode", ["per_weight", "rescaled", "full", "kept"])
@given(rng=rngs)
def test_the_order_of_the_rollouts_does_not_matter(mode, rng):
    distribution, policies, costs = random_rollouts(rng)
    order = rng.permutation(12)
    plain = update(distribution, policies, costs, parameters_of(mode))
    other = update(distribution, policies[order], costs[order], parameters_of(mode))
    np.testing.assert_allclose(other.distribution.mean, plain.distribution.mean, atol=1e-8)
    np.testing.assert_allclose(other.distribution.covariance, plain.distribution.covariance, atol=1e-8)
    np.testing.assert_allclose(other.weights, plain.weights[order], atol=1e-8)


@pytest.mark.parametrize("fault", [np.nan, np.inf, -np.inf])
@given(rng=rngs, step=st.integers(0, 5))
def test_a_rollout_without_a_finite_cost_is_as_if_it_had_not_been(fault, rng, step):
    distribution, policies, costs = random_rollouts(rng)
    costs[[2, 9], step] = fault
    found = update(distribution, policies, costs, DEFAULT)
    rest = np.delete(np.arange(12), [2, 9])
    expected = update(distribution, policies[rest], costs[rest], DEFAULT)
    np.testing.assert_array_equal(found.distribution.mean, expected.distribution.mean)
    np.testing.assert_array_equal(found.distribution.covariance, expected.distribution.covariance)
    np.testing.assert_array_equal(np.flatnonzero(found.failed), [2, 9])
    np.testing.assert_array_equal(found.weights[[2, 9]], 0.0)


@pytest.mark.filterwarnings("error")
def test_a_sum_beyond_the_largest_number_is_no_finite_cost():
    distribution, policies, costs = random_rollouts(np.random.default_rng(0))
    costs[3] = 1e308
    np.testing.assert_array_equal(np.flatnonzero(update(distribution, policies, costs, DEFAULT).failed), [3])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d, p, c: (d, p[1:], c), r"same K, not \(11, 3\) and \(12, 6\)"),
        (lambda d, p, c: (d, p, c[:, 0]), r"not \(12, 3\) and \(12,\)"),
        (lambda d, p, c: (d, p, c[:, :0]), r"not \(12, 3\) and \(12, 0\)"),
        (lambda d, p, c: (d, p[:, :2], c), "have 2 parameters, the distribution has 3"),
        (lambda d, p, c: (d, np.nan * p, c), "not finite"),
        (lambda d, p, c: (replace(d, covariance=np.eye(2)), p, c), r"not \(3,\) and \(2, 2\)"),
        (lambda d, p, c: (replace(d, covariance=-np.eye(3)), p, c), "not positive definite"),
        (lambda d, p, c: (d, p, c, np.ones((3, 6))), r"must be \(T, D\), here \(6, 3\), not \(3, 6\)"),
        *(
            (
                lambda d, p, c, left=left: (d, p, np.where(np.arange(12)[:, None] < left, c, np.nan)),
                f"^{left} of 12 rollouts have finite costs, an update needs 2$",
            )
            for left in (0, 1)
        ),
    ],
)
def test_arrays_that_do_not_fit_are_named(change, message):
    distribution, policies, costs, *activation = change(*random_rollouts(np.random.default_rng(0)))
    with pytest.raises(InputError, match=message):
        update(distribution, policies, costs, DEFAULT, *activation)


def test_samples_have_the_moments_of_the_distribution():
    distribution = SearchDistribution(np.array([1.0, -2.0]), np.array([[2.0, 0.6], [0.6, 0.5]]))
    policies = sample(distribution, 200_000, np.random.default_rng(0))
    np.testing.assert_allclose(policies.mean(axis=0), distribution.mean, atol=0.02)
    np.testing.assert_allclose(np.cov(policies.T), distribution.covariance, atol=0.02)


def test_fewer_samples_are_the_first_of_more():
    distribution, *_ = random_rollouts(np.random.default_rng(0), dimensions=25)
    more, fewer = (sample(distribution, count, np.random.default_rng(3)) for count in (38, 10))
    np.testing.assert_allclose(fewer, more[:10], rtol=1e-12)


def shifted_quadratic(dimensions, condition):
    """Rotated, minimum away from 0, curvatures from 1 to the condition number."""
    rng = np.random.default_rng(7)
    axes = np.linalg.qr(rng.normal(size=(dimensions, dimensions)))[0]
    optimum, curvatures = rng.normal(size=dimensions), np.geomspace(1.0, condition, dimensions)
    return lambda policies: np.sum(curvatures * ((policies - optimum) @ axes) ** 2, axis=1)


def search(function, start, std, updates, seed, parameters):
    """Cost of the mean after so many updates, with the costs of one time step."""
    distribution = SearchDistribution.around(start, std)
    for number in range(updates):
        policies = sample(distribution, parameters.samples, np.random.default_rng([seed, number]))
        distribution = update(distribution, policies, function(policies)[:, None], parameters).distribution
    return function(distribution.mean[None])[0]


def evolution_strategy(function, start, std, updates, seed, samples):
    """The same of CMA-ES."""
    strategy = cma.CMAEvolutionStrategy(start, std, {"popsize": samples, "seed": seed + 1, "verbose": -9})
    for _ in range(updates):
        policies = np.array(strategy.ask())
        strategy.tell(policies, function(policies))
    return function(strategy.mean[None])[0]


def medians(function, start, std, updates, parameters):
    """Median cost over seeds: ours, CMA-ES."""
    seeds, samples = range(5), parameters.samples
    ours = [search(function, start, std, updates, seed, parameters) for seed in seeds]
    peer = [evolution_strategy(function, start, std, updates, seed, samples) for seed in seeds]
    return np.median(ours), np.median(peer)


def test_a_full_covariance_learns_an_ill_conditioned_quadratic_as_fast_as_cma_es():
    """6 parameters; by the 40th update both are far below what a covariance of fixed shape reaches."""
    function = shifted_quadratic(6, 1000.0)
    ours, peer = medians(function, np.zeros(6), 1.0, 40, parameters_of("full"))
    of_fixed_shape = np.median(
        [search(function, np.zeros(6), 1.0, 40, seed, parameters_of("rescaled")) for seed in range(5)]
    )
    assert ours < 10.0 * peer
    assert ours < 1e-3 * of_fixed_shape


@pytest.fixture(scope="module")
def tracking():
    """A movement primitive that has to follow another path: early weights act on all later costs."""
    rng = np.random.default_rng(0)
    path, wanted = (reach(rng, [0.0], [0.3], dt=0.01, detour=detour) for detour in (0.0, 0.05))
    primitive = replace(fit_vector([path]), goal=wanted.position[-1])

    def costs(policies):
        weights = policies.reshape(len(policies), 25, 1)
        return abs(replace(primitive, weights=weights).unroll(0.01).position - wanted.position)[..., 0]

    return primitive.weights.ravel(), costs


def test_with_equal_rollouts_ours_follows_a_path_closer_than_the_text_s_form_and_cma_es(tracking):
    """152 rollouts each; what it is for: costs of every step, weights that act at different times."""
    ours = np.mean(learning_curves(*tracking, DEFAULT, updates=152 // DEFAULT.samples), axis=0)
    text = np.mean(learning_curves(*tracking, parameters_of("full"), updates=4), axis=0)
    start, costs = tracking
    peer = np.mean(
        [
            evolution_strategy(lambda one: costs(one).sum(axis=1), start, 1.0, 11, seed, 13)
            for seed in range(4)
        ]
    )
    assert ours[-1] < text[-1]
    assert ours[-1] < peer


def learning_curves(start, costs, parameters, updates):
    """Cost of the mean before and after every update, by search."""
    curves = []
    for seed in range(4):
        distribution = SearchDistribution.around(start, 1.0)
        curves.append([costs(distribution.mean[None]).sum()])
        for number in range(updates):
            policies = sample(distribution, parameters.samples, np.random.default_rng([seed, number]))
            found = costs(policies)
            activation = kernel_activation(found.shape[1], len(start))
            distribution = update(distribution, policies, found, parameters, activation).distribution
            curves[-1].append(costs(distribution.mean[None]).sum())
    return curves
