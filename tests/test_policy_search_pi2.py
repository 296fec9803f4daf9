from dataclasses import replace

import cma
import numpy as np
import pytest
from committed import committed
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import rngs
from scipy.optimize import minimize_scalar

from structlearn.policy_search.pi2 import (
    CovarianceParameters,
    PI2Parameters,
    SearchDistribution,
    adapted_covariance,
    bounded_temperatures,
    cost_to_go,
    covariance_factor,
    normalised_costs,
    probabilities,
    sample,
    sample_weights,
    update,
)

DEFAULT = committed(PI2Parameters, "refine.search")
PUBLISHED = {"samples": 38, "averaging": "per_policy", "horizon": 1.0}
COLD = committed(PI2Parameters, "refine.search", temperature=1e-3, **PUBLISHED)


def random_rollouts(rng, samples=12, steps=6, dimensions=3):
    distribution = SearchDistribution.around(rng.normal(size=dimensions), rng.uniform(0.5, 2.0, dimensions))
    policies = sample(distribution, samples, rng)
    return distribution, policies, rng.random((samples, steps))


def parameters_of(mode, **others):
    """As published, but for the covariance."""
    return committed(PI2Parameters, "refine.search", **PUBLISHED, covariance={"mode": mode, **others})


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
    new = update(distribution, policies, costs, parameters, rng.random((6, 3)))
    mean, covariance = slow_update(distribution.mean, policies, costs, 1.0, 1e-3)
    np.testing.assert_allclose(new.mean, mean, atol=1e-5)
    np.testing.assert_allclose(new.covariance, covariance, atol=1e-4)


def test_a_parameter_follows_the_samples_that_were_good_while_it_acts():
    """Two samples, each better at one of two steps: the first parameter acts at the first, and so on."""
    costs, apart = np.array([[0.0, 1.0], [1.0, 0.0]]), np.eye(2)
    parameters = COLD.model_copy(update={"averaging": "per_weight", "horizon": 0.5})
    np.testing.assert_allclose(sample_weights(costs, 2, parameters, apart), [[1, 0], [0, 1]], atol=1e-9)
    policies = np.array([[1.0, 1.0], [-1.0, -1.0]])
    found = update(SearchDistribution.around(np.zeros(2), 1.0), policies, costs, parameters, apart)
    np.testing.assert_allclose(found.mean, [1.0, -1.0])


@given(rng=rngs)
def test_parameters_that_act_alike_have_the_text_s_weights(rng):
    ahead = cost_to_go(random_rollouts(rng)[2])
    shared, per_weight = (
        DEFAULT.model_copy(update={"averaging": form}) for form in ("per_policy", "per_weight")
    )
    expected = sample_weights(ahead, 3, shared)
    for activation in (None, np.full((6, 3), 0.7)):
        np.testing.assert_allclose(sample_weights(ahead, 3, per_weight, activation), expected, rtol=1e-12)


def test_a_cost_beyond_the_horizon_does_not_count():
    costs = np.array([[1.0, 2.0, 4.0, 8.0]])
    np.testing.assert_array_equal(cost_to_go(costs, 0.5), [[3, 6, 12, 8]])
    np.testing.assert_array_equal(cost_to_go(costs, 1e-3), costs)  # one step at least


def test_two_samples_at_a_fixed_temperature():
    distribution = SearchDistribution.around(np.array([10.0, 0.0]), 1.0)
    policies = np.array([[1.0, 2.0], [3.0, -2.0]])
    warm = committed(PI2Parameters, "refine.search", temperature=0.5)
    found = update(distribution, policies, np.array([[5.0], [7.0]]), warm)
    p = 1 / (1 + np.exp(-2.0))
    np.testing.assert_allclose(found.mean, [p + 3 * (1 - p), 2 * p - 2 * (1 - p)])


@pytest.mark.parametrize("mode", ["per_weight", "rescaled", "full", "kept"])
@given(rng=rngs)
def test_the_order_of_the_rollouts_does_not_matter(mode, rng):
    distribution, policies, costs = random_rollouts(rng)
    order = rng.permutation(12)
    plain = update(distribution, policies, costs, parameters_of(mode))
    other = update(distribution, policies[order], costs[order], parameters_of(mode))
    np.testing.assert_allclose(other.mean, plain.mean, atol=1e-8)
    np.testing.assert_allclose(other.covariance, plain.covariance, atol=1e-8)


@pytest.mark.parametrize("fault", [np.nan, np.inf, -np.inf])
@given(rng=rngs, step=st.integers(0, 5))
def test_a_rollout_without_a_finite_cost_is_as_if_it_had_not_been(fault, rng, step):
    distribution, policies, costs = random_rollouts(rng)
    costs[[2, 9], step] = fault
    found = update(distribution, policies, costs, DEFAULT)
    rest = np.delete(np.arange(12), [2, 9])
    expected = update(distribution, policies[rest], costs[rest], DEFAULT)
    np.testing.assert_array_equal(found.mean, expected.mean)
    np.testing.assert_array_equal(found.covariance, expected.covariance)


@pytest.mark.filterwarnings("error")
def test_a_sum_beyond_the_largest_number_is_no_finite_cost():
    distribution, policies, costs = random_rollouts(np.random.default_rng(0))
    costs[3] = 1e308
    rest = np.delete(np.arange(12), 3)
    found = update(distribution, policies, costs, DEFAULT)
    expected = update(distribution, policies[rest], costs[rest], DEFAULT)
    np.testing.assert_array_equal(found.mean, expected.mean)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d, p, c: (d, p[1:], c), r"same K, not \(11, 3\) and \(12, 6\)"),
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
    def updated():
        distribution, policies, costs, *activation = change(*random_rollouts(np.random.default_rng(0)))
        update(distribution, policies, costs, DEFAULT, *activation)

    with pytest.raises(ValueError, match=message):
        updated()


def test_samples_have_the_moments_of_the_distribution():
    distribution = SearchDistribution(np.array([1.0, -2.0]), np.array([[2.0, 0.6], [0.6, 0.5]]))
    policies = sample(distribution, 200_000, np.random.default_rng(0))
    np.testing.assert_allclose(policies.mean(axis=0), distribution.mean, atol=0.02)
    np.testing.assert_allclose(np.cov(policies.T), distribution.covariance, atol=0.02)


def test_fewer_samples_are_the_first_of_more():
    distribution, *_ = random_rollouts(np.random.default_rng(0), dimensions=25)
    more, fewer = (sample(distribution, count, np.random.default_rng(3)) for count in (38, 10))
    np.testing.assert_allclose(fewer, more[:10], rtol=1e-12)


def searches(seed, updates=40):
    """Cost after so many updates of ours with a full and a rescaled covariance, between them CMA-ES.

    Of a rotated quadratic with curvatures from 1 to 1000 and its minimum away from 0.
    """
    rng = np.random.default_rng(7)
    axes, optimum = np.linalg.qr(rng.normal(size=(6, 6)))[0], rng.normal(size=6)

    def cost(policies):
        return np.sum(np.geomspace(1.0, 1000.0, 6) * ((policies - optimum) @ axes) ** 2, axis=1)

    means = []
    for mode in ("full", "rescaled"):
        own, distribution = parameters_of(mode), SearchDistribution.around(np.zeros(6), 1.0)
        for number in range(updates):
            policies = sample(distribution, own.samples, np.random.default_rng([seed, number]))
            distribution = update(distribution, policies, cost(policies)[:, None], own)
        means.append(distribution.mean)
    strategy = cma.CMAEvolutionStrategy(
        np.zeros(6), 1.0, {"popsize": own.samples, "seed": seed + 1, "verbose": -9}
    )
    for _ in range(updates):
        policies = np.array(strategy.ask())
        strategy.tell(policies, cost(policies))
    return cost(np.array([means[0], strategy.mean, means[1]]))


def test_a_full_covariance_learns_an_ill_conditioned_quadratic_as_fast_as_cma_es():
    """6 parameters; by the 40th update both are far below what a covariance of fixed shape reaches."""
    found = np.median([searches(seed) for seed in range(5)], axis=0)
    assert found[0] < 10.0 * found[1]
    assert found[0] < 1e-3 * found[2]


FLOOR = 1e-3


def divergence(weights):
    """KL divergence of (K, T) weights from the uniform ones."""
    logarithms = np.log(np.where(weights > 0, weights * len(weights), 1.0))
    return np.sum(weights * logarithms, axis=0)


def random_costs(rng, samples, steps):
    """Normalised costs of many kinds: even, with outliers, with ties and near ties."""
    costs = np.exp(rng.uniform(0.0, 4.0, steps) * rng.normal(size=(samples, steps)))
    tied = rng.random(steps) < 0.3
    costs[:, tied] = np.round(costs[:, tied]) * (1.0 + rng.choice([0.0, 1e-6]) * rng.random(samples)[:, None])
    return normalised_costs(costs)


@given(rng=rngs, samples=st.integers(2, 40), scale=st.floats(1e-6, 1e6), shift=st.floats(-1e3, 1e3))
def test_normalised_costs_span_0_to_1_and_do_not_depend_on_shift_and_scale(rng, samples, scale, shift):
    costs = rng.normal(size=(samples, 7))
    relative = normalised_costs(costs)
    assert np.all(relative.min(axis=0) == 0)
    assert np.all(relative.max(axis=0) == 1)
    np.testing.assert_allclose(normalised_costs(scale * (costs + shift)), relative, atol=1e-9)


@pytest.mark.parametrize(
    ("costs", "expected"),
    [
        ([[0.3], [0.1 + 0.2]], [[0], [0]]),  # only rounding tells them apart
        ([[-1.7e308], [0.0], [1.7e308]], [[0], [0.5], [1]]),  # their difference overflows
    ],
)
def test_equal_and_huge_costs_are_normalised(costs, expected):
    np.testing.assert_allclose(normalised_costs(np.array(costs)), expected)


@given(rng=rngs, samples=st.integers(2, 60), kl_bound=st.floats(1e-3, 3.0))
def test_the_bound_is_met_wherever_it_can_be(rng, samples, kl_bound):
    costs = random_costs(rng, samples, 20)
    temperatures = bounded_temperatures(costs, kl_bound, FLOOR)
    reached = divergence(probabilities(costs, temperatures))
    possible = divergence(probabilities(costs, np.full(20, FLOOR)))
    attainable = possible > kl_bound
    np.testing.assert_allclose(reached[attainable], kl_bound, atol=1e-6, rtol=0)
    np.testing.assert_array_equal(temperatures[~attainable], FLOOR)
    assert np.all(temperatures >= FLOOR)


@pytest.mark.parametrize("gap", [1e-2, 3e-3, 2e-3])
def test_a_plateau_between_two_scales_of_cost_is_crossed(gap):
    """The divergence rests at log(38 / 2) until the two best are told apart near the floor."""
    costs = np.concatenate([[0.0, gap], np.linspace(0.5, 1.0, 36)])[:, None]
    temperatures = bounded_temperatures(costs, 3.0, FLOOR)
    assert FLOOR < temperatures[0] < 2 * gap
    assert divergence(probabilities(costs, temperatures)) == pytest.approx(3.0, abs=1e-6)


MODES = ("per_weight", "rescaled", "full", "kept")
NO_FLOOR = 1e-9


def random_covariance(rng, dimensions):
    root = rng.normal(size=(dimensions, dimensions))
    return root @ root.T + 0.1 * np.eye(dimensions)


def adaptation(mode, **changes):
    return committed(CovarianceParameters, "refine.search.covariance", mode=mode, **changes)


def random_weights(rng, samples, dimensions):
    """Weights of the samples, the same for all parameters."""
    return np.tile(rng.dirichlet(np.full(samples, 0.3))[:, None], dimensions)


@given(rng=rngs, damping=st.floats(1.0, 4.0))
def test_rescaled_is_the_old_one_by_a_damped_mean_ratio(rng, damping):
    old, deviations, weights = random_covariance(rng, 5), rng.normal(size=(6, 5)), random_weights(rng, 6, 5)
    parameters = adaptation("rescaled", damping=damping, eigenvalue_floor=NO_FLOOR)
    estimate = deviations.T @ (weights[:, :1] * deviations)
    ratio = np.trace(np.linalg.inv(old) @ estimate) / 5
    new = adapted_covariance(old, deviations, weights, parameters)
    np.testing.assert_allclose(new, ratio ** (1 / damping) * old, rtol=1e-8)


@given(rng=rngs, damping=st.floats(1.0, 4.0))
def test_each_variance_follows_the_samples_that_were_good_in_its_parameter(rng, damping):
    """Correlations stay; undamped, the variances are those of the weighted samples."""
    old, deviations = random_covariance(rng, 4), rng.normal(size=(7, 4))
    weights = rng.dirichlet(np.ones(7), 4).T
    parameters = adaptation("per_weight", damping=damping, eigenvalue_floor=NO_FLOOR)
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
    new = adapted_covariance(old, np.concatenate([arms, -arms]), np.full((8, 4), 1 / 8), adaptation(mode))
    np.testing.assert_allclose(new, old, rtol=1e-9)


@pytest.mark.parametrize("mode", ["per_weight", "rescaled", "full"])
def test_no_variance_shrinks_below_the_floor(mode):
    """All weight on the old mean: nothing is left of the estimate."""
    old = random_covariance(np.random.default_rng(1), 4)
    new = adapted_covariance(
        old, np.zeros((5, 4)), np.full((5, 4), 0.2), adaptation(mode, eigenvalue_floor=0.2)
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
    parameters = adaptation(mode, eigenvalue_floor=0.3)
    expected = change @ adapted_covariance(old, deviations, weights, parameters) @ change.T
    found = adapted_covariance(change @ old @ change.T, deviations @ change.T, weights, parameters)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("mode", MODES)
@given(rng=rngs, samples=st.integers(2, 40), dimensions=st.integers(1, 30), spread=st.floats(1e-6, 1e6))
def test_covariances_stay_symmetric_and_positive_definite(mode, rng, samples, dimensions, spread):
    """Over many updates, also with fewer samples than dimensions and weights on single samples."""
    covariance = spread * random_covariance(rng, dimensions)
    for _ in range(15):
        deviations = rng.normal(size=(samples, dimensions)) @ covariance_factor(covariance).T
        weights = random_weights(rng, samples, dimensions)
        covariance = adapted_covariance(covariance, deviations, weights, adaptation(mode))
        np.testing.assert_allclose(covariance, covariance.T, rtol=1e-12)
        assert np.all(np.linalg.eigvalsh(covariance / np.trace(covariance)) > 0)


def test_a_direction_may_become_very_narrow():
    """The first axis is never hit, the others keep their width: 1e-60 beside 1 must still be factored."""
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    covariance = np.eye(3)
    arms = np.sqrt(2.0) * np.concatenate([np.eye(3)[1:], -np.eye(3)[1:]]) @ turn
    for _ in range(200):
        covariance = adapted_covariance(covariance, arms, np.full((4, 3), 1 / 4), adaptation("full"))
    widths = np.linalg.eigvalsh(covariance)
    assert 0 < widths[0] < 1e-10
    np.testing.assert_allclose(widths[1:], 1.0, rtol=1e-6)
