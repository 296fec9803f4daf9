"""Both searches in a closed-form setting: they learn, keep to the budget, begin alike, repeat themselves."""

import math

import cma
import numpy as np
import pytest
from committed import committed
from made_up_environment import KERNELS, MadeUp

from dissertation.scraping.protocol.sample_efficiency import (
    CMA_ES,
    JUDGED,
    PI2,
    SEARCHED,
    ComparisonParameters,
    EvolutionStrategy,
    PathIntegralSearch,
    compare_searches,
)
from structlearn.core.errors import InputError
from structlearn.feedback.models.pmnn import open_loop
from structlearn.policy_search.pi2 import PI2Parameters, SearchDistribution, update
from structlearn.policy_search.refinement import Rollout, kernel_activation

START, EXPLORATION = np.zeros(KERNELS), 4.0
SEARCH = committed(PI2Parameters, "refine.search", samples=20)
POPULATION = 4 + math.floor(3 * math.log(KERNELS))  # of CMA-ES
PARAMETERS = ComparisonParameters(budget=120, seeds=2, evaluation_runs=3)


def compared(environment=None, **changes):
    parameters = PARAMETERS.model_copy(update=changes)
    return compare_searches(environment or MadeUp(), START, EXPLORATION, SEARCH, parameters)


@pytest.fixture(scope="module")
def environment():
    return MadeUp()


@pytest.fixture(scope="module")
def table(environment):
    return compared(environment)


def test_both_improve(table):
    for (method, seed), rows in table.groupby(["method", "seed"]):
        assert rows["cost_rad"].iloc[-1] < 0.5 * rows["cost_rad"].iloc[0], (method, seed)
        assert rows["best_rad"].iloc[-1] < 0.6 * rows["cost_rad"].iloc[0], (method, seed)
        assert rows["best_rad"].iloc[1:].is_monotonic_decreasing
        assert np.isnan(rows["best_rad"].iloc[0])


@pytest.mark.parametrize("budget", [39, 40, 54])
def test_the_budget_is_kept_to_and_only_whole_updates_are_made(budget):
    environment = MadeUp()
    table = compared(environment, budget=budget)
    used = table.groupby(["method", "seed"])["rollouts"].max()
    assert (used <= budget).all()
    assert (used[PI2] > budget - SEARCH.samples).all()
    assert (used[CMA_ES] > budget - POPULATION).all()
    assert sum(seed[1] == SEARCHED for _, seed in environment.calls) == used.sum()


@pytest.mark.parametrize(("budget", "method"), [(19, PI2), (POPULATION - 1, f"{PI2}|{CMA_ES}")])
def test_a_budget_that_allows_no_update_is_told(budget, method):
    with pytest.raises(InputError, match=rf"a budget of {budget} rollouts is not enough .* of ({method})"):
        compared(budget=budget)


def test_all_begin_with_the_same_policy_distribution_and_random_numbers(table, environment):
    start = table[table["update"] == 0]
    cost = environment.rollout(open_loop(START), (0, JUDGED, 0)).cost.sum()
    assert start["cost_rad"].tolist() == pytest.approx([cost] * 2 * PARAMETERS.seeds)
    for seed in range(PARAMETERS.seeds):
        white = np.random.default_rng(seed).standard_normal((SEARCH.samples, KERNELS))
        first = START + EXPLORATION * white
        around = SearchDistribution.around(START, EXPLORATION)
        integrals = PathIntegralSearch(around, SEARCH, np.random.default_rng(seed))
        evolution = EvolutionStrategy.around(START, EXPLORATION, np.random.default_rng(seed))
        np.testing.assert_allclose(integrals.propose(), first)
        # the package makes the standard deviations differ by 5e-5 to tell the axes apart
        np.testing.assert_allclose(evolution.propose(), first[:POPULATION], rtol=1e-4)
        asked = [network.phase_biases for network, key in environment.calls if key == (seed, SEARCHED, 0)]
        np.testing.assert_allclose(asked, [first[0]] * 2, rtol=1e-4)


def test_the_mean_policies_are_those_of_the_searches(environment, table):
    """The first update of PI2-CMA by hand: the cost of its mean is in the table."""
    search = PathIntegralSearch(
        SearchDistribution.around(START, EXPLORATION), SEARCH, np.random.default_rng(0)
    )
    own = search.propose()
    runs = MadeUp().rollouts([open_loop(policy) for policy in own], [(0,)] * len(own))
    costs = np.array([run.cost for run in runs])
    activation = kernel_activation(costs.shape[1], KERNELS)
    new = update(search.distribution, own, costs, SEARCH, activation)
    search.learn(own, runs)
    np.testing.assert_array_equal(search.mean, new.mean)
    np.testing.assert_array_equal(search.distribution.covariance, new.covariance)
    row = table.query("method == 'pi2' and seed == 0 and update == 1").iloc[0]
    cost = environment.rollout(open_loop(new.mean), (0, JUDGED, 0)).cost.sum()
    assert row["cost_rad"] == pytest.approx(cost)
    assert row["best_rad"] == pytest.approx(costs.sum(axis=1).min())


def quadratic(policies):
    return np.sum(np.arange(1.0, KERNELS + 1.0) * (policies - 3.0) ** 2, axis=1)


def rollout_of(cost):
    return Rollout(np.full(4, cost / 4), None, "" if np.isfinite(cost) else "diverged")


def test_cma_es_is_the_package_s_own_with_its_defaults(tmp_path, monkeypatch):
    """Its ordinary use, with its seed and its files, takes the same steps."""
    monkeypatch.chdir(tmp_path)
    state = np.random.get_state()  # noqa: NPY002
    theirs = cma.CMAEvolutionStrategy(START, EXPLORATION, {"seed": 5, "verbose": -9})
    reference = []
    for _ in range(15):
        policies = theirs.ask()
        theirs.tell(policies, quadratic(np.array(policies)))
        reference.append(np.array(theirs.mean))
    np.random.set_state(state)  # noqa: NPY002
    ours = EvolutionStrategy.around(START, EXPLORATION, np.random.RandomState(5))
    for mean in reference:
        policies = ours.propose()
        assert len(policies) == ours.count == POPULATION
        ours.learn(policies, [rollout_of(cost) for cost in quadratic(policies)])
        np.testing.assert_allclose(ours.mean, mean, rtol=1e-12)


def test_cma_es_takes_a_failed_rollout_for_the_worst():
    """As if it had cost very much; any other place in the order makes another step."""
    means = []
    for cost in (np.nan, 1e6, 0.0):
        search = EvolutionStrategy.around(START, EXPLORATION, np.random.default_rng(1))
        policies = search.propose()
        costs = quadratic(policies)
        costs[np.argmin(costs)] = cost
        search.learn(policies, [rollout_of(one) for one in costs])
        means.append(search.mean)
    np.testing.assert_array_equal(means[0], means[1])
    assert not np.array_equal(means[0], means[2])


def test_failed_rollouts_count_and_have_no_cost():
    failing = {(0, SEARCHED, 3), (0, SEARCHED, 11), (0, SEARCHED, 25)}
    table = compared(MadeUp(failing.__contains__))
    own = table[table["seed"] == 0].set_index(["method", "update"])["failed"]
    assert own[PI2].tolist() == [0, 2, 3, 3, 3, 3, 3]
    assert own[CMA_ES].tolist()[:5] == [0, 1, 2, 3, 3]
    assert (table.loc[table["seed"] == 1, "failed"] == 0).all()
    assert np.isfinite(table["cost_rad"]).all()
    assert np.isfinite(table.loc[table["update"] > 0, "best_rad"]).all()
    last = table.groupby(["method", "seed"])["cost_rad"].last()
    assert (last < 0.5 * table["cost_rad"].iloc[0]).all()


@pytest.mark.parametrize(("method", "count"), [(PI2, SEARCH.samples), (CMA_ES, POPULATION)])
def test_an_update_needs_two_rollouts(method, count):
    """The rollouts of the second update of one method fail, but for the first."""
    failing = {(1, SEARCHED, number) for number in range(count + 1, 2 * count)}
    message = rf"1 of {count} rollouts of {method}, seed 1, update 2 succeeded, 2 must; .* diverged"
    with pytest.raises(InputError, match=message):
        compared(MadeUp(failing.__contains__))


def test_it_leaves_no_trace(tmp_path, monkeypatch, capfd):
    """No output, no files, no options from a file that happens to lie there, no global random numbers."""
    monkeypatch.chdir(tmp_path)
    before = np.random.get_state(legacy=False)  # noqa: NPY002
    compared(seeds=1)
    np.testing.assert_equal(np.random.get_state(legacy=False), before)  # noqa: NPY002
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")
