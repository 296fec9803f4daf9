"""Intervals of rates: closed forms, symmetry, monotonicity, and coverage of correlated trials."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import betabinom, binomtest

from structlearn.core import rates
from structlearn.core.rates import estimate, intraclass_correlation, logit_grid, rate_interval

COUNTS = st.lists(st.tuples(st.integers(1, 60), st.integers(0, 60)), min_size=1, max_size=9).map(
    lambda pairs: (np.array([min(hits, m) for m, hits in pairs]), np.array([m for m, _ in pairs]))
)


@pytest.fixture
def independent(monkeypatch):
    monkeypatch.setattr(rates, "_CORRELATIONS", np.full(16, 1e-7))


@pytest.mark.usefixtures("independent")
@pytest.mark.parametrize("confidence", [0.95, 0.99])
@pytest.mark.parametrize("hits", [0, 1, 7, 250, 1259, 2519, 2520])
def test_without_correlation_it_is_clopper_and_pearsons(hits, confidence):
    by_person = np.full(40, hits // 40) + (np.arange(40) < hits % 40)
    expected = binomtest(hits, 2520).proportion_ci(confidence)
    assert rate_interval(by_person, np.full(40, 63), confidence) == pytest.approx(expected, abs=2e-4)


def test_with_one_trial_each_nothing_can_correlate():
    expected = binomtest(30, 40).proportion_ci(0.95)
    assert rate_interval(np.arange(40) < 30, np.ones(40)) == pytest.approx(expected, abs=2e-4)


def test_likelihoods_are_beta_binomial():
    grid = np.array([-2.0, 0.5])
    found = rates.person_likelihoods(np.array([3, 0]), np.array([20, 7]), grid)
    strength = 1.0 / rates._CORRELATIONS[5] - 1.0
    rate = 1.0 / (1.0 + np.exp(-grid))
    expected = betabinom.logpmf([[3], [0]], [[20], [7]], strength * rate, strength * (1.0 - rate))
    coefficient = betabinom.logpmf([3, 0], [20, 7], 1, 1) * 0 + np.log([1140, 1])  # 20 over 3, 7 over 0
    np.testing.assert_allclose(found[:, 5] + coefficient[:, np.newaxis], expected, rtol=1e-9)


@given(COUNTS)
def test_hits_and_misses_are_alike(counts):
    hits, trials = counts
    low, high = rate_interval(hits, trials)
    assert rate_interval(trials - hits, trials) == pytest.approx((1.0 - high, 1.0 - low), abs=1e-6)
    assert rate_interval(hits[::-1], trials[::-1]) == pytest.approx((low, high))


@given(COUNTS)
@settings(max_examples=50)
def test_no_hits_have_the_lowest_upper_end_of_all_counts(counts):
    hits, trials = counts
    assert rate_interval(np.zeros_like(hits), trials)[1] <= rate_interval(hits, trials)[1] + 1e-9


def test_more_hits_by_one_person_more_people_and_more_confidence():
    def of_one(hits, people=40, confidence=0.95):
        return rate_interval(np.append(hits, np.zeros(people - 1)), np.full(people, 40), confidence)

    for ends in np.transpose([of_one(hits) for hits in range(6)]):
        assert (np.diff(ends) >= 0.0).all()
    assert (np.diff([of_one(0, people)[1] for people in (2, 5, 12, 40)]) < 0.0).all()
    assert of_one(2, confidence=0.99)[1] > of_one(2)[1]
    assert [100 * of_one(hits)[1] for hits in range(3)] == pytest.approx([1.40, 1.99, 2.12], abs=0.01)


def test_a_grid_resolves_few_and_many_trials():
    for hits, trials in ((0, 2), (1, 200), (0, 10**6), (500_000, 10**6)):
        grid = logit_grid(hits, trials)
        assert (np.diff(grid) > 0.0).all()
        assert grid[0] < -20.0
        assert grid[-1] > 20.0
    low, high = rate_interval(np.full(1000, 500), np.full(1000, 1000))
    assert low == pytest.approx(1.0 - high, abs=1e-9)
    assert high - low == pytest.approx(2 * 1.96 * 0.5 / 1000.0, rel=0.05)


def test_the_intraclass_correlation_of_a_population_is_estimated():
    rng = np.random.default_rng(0)
    own = rng.beta(0.2 * 4, 0.8 * 4, 4000)  # 1 / (1 + 4)
    trials = rng.integers(5, 40, 4000)
    assert intraclass_correlation(rng.binomial(trials, own), trials) == pytest.approx(0.2, abs=0.02)
    for hits, trials in (([0, 0], [9, 9]), ([3], [9]), ([1, 0], [1, 1])):
        assert np.isnan(intraclass_correlation(hits, trials))


def test_the_rate_of_unequal_trials_lies_nearer_peoples_rates_if_people_differ():
    trials = np.array([1000, 10, 10, 10])
    assert estimate(np.array([500, 4, 6, 5]), trials) == pytest.approx(515 / 1030)
    assert 0.25 < estimate(np.array([1000, 0, 0, 0]), trials) < 0.3  # of all trials: 0.97
    assert estimate(np.array([3, 9]), np.array([10, 10])) == pytest.approx(0.6)


@pytest.mark.parametrize("population", [(0.01, 0.3, 8, 40), (0.1, 0.1, 12, 40), (0.5, 0.03, 20, 120)])
def test_correlated_trials_are_covered(population):
    path = Path(__file__).parents[1] / "benchmarks/share_coverage.py"
    benchmark = SimpleNamespace(**runpy.run_path(str(path)))
    assert benchmark.rate_coverage(benchmark.Population(*population), draws=600, seed=0).coverage >= 0.93
