import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize_scalar

from structlearn.policy_search.temperature import bounded_temperatures, normalised, probabilities

FLOOR = 1e-3
rngs = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def divergence(weights):
    """KL divergence of (K, T) weights from the uniform ones."""
    logarithms = np.log(np.where(weights > 0, weights * len(weights), 1.0))
    return np.sum(weights * logarithms, axis=0)


def random_costs(rng, samples, steps):
    """Normalised costs of many kinds: even, with outliers, with ties and near ties."""
    costs = np.exp(rng.uniform(0.0, 4.0, steps) * rng.normal(size=(samples, steps)))
    tied = rng.random(steps) < 0.3
    costs[:, tied] = np.round(costs[:, tied]) * (1.0 + rng.choice([0.0, 1e-6]) * rng.random(samples)[:, None])
    return normalised(costs)


@given(rng=rngs, samples=st.integers(2, 40), scale=st.floats(1e-6, 1e6), shift=st.floats(-1e3, 1e3))
def test_normalised_costs_span_0_to_1_and_do_not_depend_on_shift_and_scale(rng, samples, scale, shift):
    costs = rng.normal(size=(samples, 7))
    relative = normalised(costs)
    assert np.all(relative.min(axis=0) == 0)
    assert np.all(relative.max(axis=0) == 1)
    np.testing.assert_allclose(normalised(scale * (costs + shift)), relative, atol=1e-9)


def test_equal_costs_are_0_also_when_only_rounding_tells_them_apart():
    costs = np.array([[0.0, 0.3, 1.0], [0.0, 0.1 + 0.2, 2.0]])
    np.testing.assert_array_equal(normalised(costs), [[0, 0, 0], [0, 0, 1]])


def test_costs_near_the_largest_number_do_not_overflow():
    np.testing.assert_allclose(normalised(np.array([[-1.7e308], [0.0], [1.7e308]])), [[0], [0.5], [1]])


def test_probabilities_of_two_samples_are_the_logistic_function():
    weights = probabilities(np.array([[0.0, 0.0], [1.0, 1.0]]), np.array([0.5, 2.0]))
    np.testing.assert_allclose(weights[0], 1 / (1 + np.exp([-2.0, -0.5])))
    np.testing.assert_allclose(weights.sum(axis=0), 1.0)


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


@given(rng=rngs)
def test_temperatures_minimise_the_dual_of_relative_entropy_policy_search(rng):
    costs = random_costs(rng, 38, 3)
    for column, found in zip(costs.T, bounded_temperatures(costs, 1.0, FLOOR), strict=True):

        def dual(temperature, column=column):
            return temperature + temperature * np.log(np.mean(np.exp(-column / temperature)))

        best = minimize_scalar(dual, bounds=(FLOOR, 10.0), method="bounded", options={"xatol": 1e-10}).x
        assert dual(found) <= dual(best) + 1e-12
        assert found == pytest.approx(best, abs=1e-5)


@pytest.mark.parametrize("kl_bound", [1e-6, 0.01, 0.3, 0.69])
def test_temperature_of_two_samples(kl_bound):
    """KL = log 2 - entropy(p) = bound, solved for p; then p = 1 / (1 + exp(-1 / lambda))."""
    p = brentq(
        lambda p: np.log(2) + p * np.log(p) + (1 - p) * np.log(1 - p) - kl_bound, 0.5, 1 - 1e-12, xtol=1e-15
    )
    (found,) = bounded_temperatures(np.array([[0.0], [1.0]]), kl_bound, FLOOR)
    assert found == pytest.approx(1 / np.log(p / (1 - p)), rel=1e-5)


def test_the_floor_stands_where_the_bound_is_out_of_reach():
    """Two samples reach log 2, 38 with 14 equally good ones log(38 / 14), equal costs 0: all below 1."""
    ties = np.concatenate([np.zeros(14), np.linspace(0.5, 1.0, 24)])[:, None]
    for costs in (np.array([[0.0], [1.0]]), ties, np.zeros((38, 1))):
        np.testing.assert_array_equal(bounded_temperatures(costs, 1.0, FLOOR), FLOOR)
    weights = probabilities(ties, np.array([FLOOR]))[:, 0]
    np.testing.assert_allclose(weights[:14], 1 / 14)


@pytest.mark.parametrize("gap", [1e-2, 3e-3, 2e-3])
def test_a_plateau_between_two_scales_of_cost_is_crossed(gap):
    """The divergence rests at log(38 / 2) until the two best are told apart near the floor."""
    costs = np.concatenate([[0.0, gap], np.linspace(0.5, 1.0, 36)])[:, None]
    temperatures = bounded_temperatures(costs, 3.0, FLOOR)
    assert FLOOR < temperatures[0] < 2 * gap
    assert divergence(probabilities(costs, temperatures)) == pytest.approx(3.0, abs=1e-6)
