"""Refinement in a closed-form setting: it learns there, repeats itself, and survives failures."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from committed import committed
from feedback_skills import random_network
from made_up_environment import CHANNELS, KERNELS, LEARNED, NEW, PHASE, TICKS, MadeUp, dataset, felt, wanted

from structlearn.core.errors import InputError
from structlearn.feedback.coupling_dataset import COLUMNS, concatenated
from structlearn.feedback.models.pmnn import open_loop
from structlearn.feedback.trainers import TrainingParameters, train_final
from structlearn.policy_search import refinement
from structlearn.policy_search.pi2 import PI2Parameters, SearchDistribution, covariance_factor, sample
from structlearn.policy_search.refinement import (
    FEEDBACK,
    IMPROVED,
    SAMPLE,
    RefinementParameters,
    compress,
    executed,
    open_loop_weights,
    refine,
)

EXPLORATION = 4.0
KINDS = (FEEDBACK, SAMPLE, IMPROVED)
TRAINING = {"steps": 200, "batch_size": 32, "evaluate_every": 50, "dropout": 0.0, "learning_rate": 3e-3}
PARAMETERS = RefinementParameters(
    iterations=2,
    search=committed(PI2Parameters, "refine.search", samples=20),
    evaluation_runs=3,
    added_runs=2,
    training=committed(TrainingParameters, "compare_models", **TRAINING),
    retraining_dropout=0.0,
)
ONCE = PARAMETERS.model_copy(update={"iterations": 1})


@pytest.fixture(scope="module")
def demonstrations():
    rng = np.random.default_rng(0)
    return concatenated(
        [dataset(felt(setting, rng), wanted(setting), setting, n) for setting in LEARNED for n in range(2)]
    )


@pytest.fixture(scope="module")
def initial(demonstrations):
    untrained = random_network(np.random.default_rng(1), CHANNELS, hidden=(6,), kernels=KERNELS)
    return train_final("pmnn", demonstrations, PARAMETERS.training, initial=untrained)


@pytest.fixture(scope="module")
def refined(initial, demonstrations):
    """Refinement in an environment, by default with the parameters and the seed of the whole run."""

    def run(environment, parameters=PARAMETERS, seed=3, **others):
        return refine(environment, initial, demonstrations, parameters, EXPLORATION, seed, **others)

    return run


@pytest.fixture(scope="module")
def uninterrupted(refined):
    """A whole run: environment, states that were reported, result."""
    environment, states = MadeUp(), []
    return environment, states, refined(environment, report=states.append)


def arrays(network):
    return list(network.arrays().values())


def test_an_open_loop_policy_is_compressed_into_itself():
    """Also from samples that stop short of the end: data thinned to the sensor's rate may lack the last."""
    policy = np.random.default_rng(1).normal(0.0, 20.0, KERNELS)
    runs = MadeUp().rollouts([open_loop(policy)] * 2, [(0,), (1,)])
    short = replace(runs[0], samples=runs[0].samples.where(np.arange(TICKS - 1)))
    for done in (runs, [short, runs[1]]):
        np.testing.assert_allclose(compress(done, KERNELS), policy, rtol=1e-10)


def test_several_runs_are_compressed_into_their_mean_and_failed_ones_left_out():
    policies = np.random.default_rng(2).normal(0.0, 20.0, (3, KERNELS))
    runs = MadeUp(lambda seed: seed == (1,)).rollouts(
        [open_loop(policy) for policy in policies], [(0,), (1,), (2,)]
    )
    np.testing.assert_allclose(compress(runs, KERNELS), policies[[0, 2]].mean(axis=0), rtol=1e-10)


def test_the_cost_falls_and_what_was_learned_before_stays(uninterrupted, initial, demonstrations):
    _, states, result = uninterrupted
    with_network = result.history[result.history["kind"] == FEEDBACK]
    norms = with_network.groupby("iteration")["norm_rad"].mean().to_list()
    assert [state.iteration for state in states] == [0, 1, 2]
    assert norms[0] > norms[1] > norms[2]
    assert norms[2] < 0.6 * norms[0]
    known, target = (
        (demonstrations.deviation, demonstrations.phase, demonstrations.phase_velocity),
        demonstrations.target,
    )
    before, after = (np.abs(one.coupling(*known) - target).mean() for one in (initial, result.network))
    assert after < 2.0 * before + 0.05 * np.abs(target).max()


def test_the_history_has_a_row_per_rollout(uninterrupted):
    environment, _, result = uninterrupted
    counts = {FEEDBACK: 3, SAMPLE: 20, IMPROVED: 2}
    order = [(0, FEEDBACK), *((i, kind) for i in (1, 2) for kind in (SAMPLE, IMPROVED, FEEDBACK))]
    rows = [(iteration, kind, n) for iteration, kind in order for n in range(counts[kind])]
    assert list(result.history) == ["iteration", "kind", "number", "cost_rad", "norm_rad", "fault"]
    assert list(result.history[["iteration", "kind", "number"]].itertuples(index=False, name=None)) == rows
    assert (result.history["fault"] == "").all()
    for (network, seed), row in zip(environment.calls, result.history.itertuples(), strict=True):
        cost = environment.rollout(network, seed).cost
        assert row.cost_rad == np.sum(cost)
        assert row.norm_rad == np.linalg.norm(cost)
    kinds = zip(environment.calls, result.history["kind"], strict=True)
    open_loops = [network.phase_biases for (network, _), kind in kinds if kind != FEEDBACK]
    np.testing.assert_array_equal(result.policies, open_loops)


def test_every_iteration_draws_anew(uninterrupted):
    _, states, _ = uninterrupted
    drawn = []
    for before, after in pairwise(states):
        own = after.policies[len(before.policies) :][: PARAMETERS.search.samples]
        drawn.append(np.linalg.solve(covariance_factor(before.covariance), (own - before.compressed).T))
    assert np.abs(drawn[0] - drawn[1]).max() > 0.5
    np.testing.assert_allclose([np.std(one) for one in drawn], 1.0, rtol=0.15)


def test_the_search_starts_at_the_compressed_policy_with_the_given_standard_deviation(uninterrupted):
    """Also after the first iteration: what the network does now, not what the last policy did (line 4)."""
    _, states, _ = uninterrupted
    np.testing.assert_allclose(states[0].covariance, EXPLORATION**2 * np.eye(KERNELS))
    count = PARAMETERS.search.samples
    for before, after in pairwise(states):
        own = after.policies[len(before.policies) :][:count]
        start = SearchDistribution(before.compressed, before.covariance)
        expected = sample(start, count, np.random.default_rng([3, after.iteration]))
        np.testing.assert_allclose(own, expected, rtol=1e-10)
    assert np.abs(states[1].policies[-1] - states[1].compressed).max() > 0.1  # so the two can be told apart


def test_seeds_follow_from_iteration_kind_and_number(uninterrupted, refined):
    """Those of networks from kind and number alone: all iterations meet equal conditions."""
    environment, _, result = uninterrupted
    seeds = [seed for _, seed in environment.calls]
    rows = list(result.history[["iteration", "kind", "number"]].itertuples(index=False))
    assert seeds == [
        (0 if row.kind == FEEDBACK else row.iteration, KINDS.index(row.kind), row.number) for row in rows
    ]
    policies = [seed for seed, row in zip(seeds, rows, strict=True) if row.kind != FEEDBACK]
    assert len(set(policies)) == len(policies)
    other = MadeUp()
    refined(other, ONCE.model_copy(update={"evaluation_runs": 4}), seed=8)
    assert {seed for seed in seeds if seed[0] < 2} < {seed for _, seed in other.calls}


def test_the_cheapest_network_is_kept_and_gone_on_from(refined, monkeypatch):
    """The second training spoils the network: the first one's is returned, and the third begins from it."""
    states, calls = [], []

    def spoil_the_second(model, data, parameters, initial):
        network = train_final(model, data, parameters, initial=initial)
        calls.append(network)
        return replace(network, output_weights=-network.output_weights) if len(calls) == 2 else network

    monkeypatch.setattr(refinement, "train_final", spoil_the_second)
    refined(MadeUp(), PARAMETERS.model_copy(update={"iterations": 3}), report=states.append)
    assert [state.iteration for state in states] == [0, 1, 2, 3]
    assert [state.kept for state in states[:3]] == [0, 1, 1]
    first, second = states[1:3]
    assert second.network is first.network
    np.testing.assert_array_equal(second.compressed, first.compressed)
    np.testing.assert_array_equal(arrays(states[3].network)[0], arrays(calls[states[3].kept - 1])[0])


def test_a_network_that_fails_is_not_kept_however_cheap_the_rest(refined):
    """One of its executions fails."""
    environment = MadeUp()
    state = refined(environment, PARAMETERS.model_copy(update={"iterations": 1}))
    history = state.history
    own = (history["kind"] == FEEDBACK) & (history["iteration"] == 1)
    worse = history.assign(fault=history["fault"].mask(own & (history["number"] == 0), "diverged"))
    assert state.kept == 1
    assert replace(state, history=worse).kept == 0


def test_executions_in_a_known_setting_are_data_of_it():
    policy = np.random.default_rng(3).normal(0.0, 20.0, KERNELS)
    environment = MadeUp()
    found = executed(environment, policy, 2)
    assert sorted(np.unique(found.demonstration)) == [-2, -1]
    np.testing.assert_allclose(open_loop_weights(found, KERNELS), policy, rtol=1e-10)
    seeds = [seed for _, seed in environment.calls]
    assert len(set(seeds)) == 2
    assert {seed[1] for seed in seeds} == {refinement.KNOWN}


def test_failed_rollouts_are_left_out_and_recorded(refined):
    failing = {(0, 0, 1), (1, 1, 0), (1, 1, 5), (1, 2, 1)}
    result = refined(MadeUp(failing.__contains__), ONCE)
    failed = result.history[result.history["fault"] != ""]
    found = zip(failed["iteration"], map(KINDS.index, failed["kind"]), failed["number"], strict=True)
    assert set(found) == failing | {(1, 0, 1)}  # the network of iteration 1 meets what fails
    assert failed[["cost_rad", "norm_rad"]].isna().all(axis=None)
    assert failed["fault"].str.endswith("diverged").all()
    assert len(result.policies) == (result.history["kind"] != FEEDBACK).sum()
    for array in (result.covariance, result.policies, result.compressed, *arrays(result.network)):
        assert np.isfinite(array).all()


@pytest.mark.parametrize(
    ("failing", "named"),
    [
        (lambda seed: seed[:2] == (0, 0), (0, 0, 0)),
        (lambda seed: seed[:2] == (1, 1), (1, 1, 0)),
        (lambda seed: seed[1] == 1 and seed[2] != 7, (1, 1, 0)),  # one sample is not enough for an update
        (lambda seed: seed[:2] == (1, 2), (1, 2, 0)),
    ],
)
def test_where_too_few_succeed_the_fault_is_named(failing, named, refined):
    with pytest.raises(InputError, match=rf"ValueError: \({', '.join(map(str, named))}\) diverged"):
        refined(MadeUp(failing))


def test_the_network_is_trained_anew_on_demonstrations_and_improved_runs(
    initial, demonstrations, refined, monkeypatch
):
    trained = []

    def remember(model, data, parameters, initial):
        trained.append((data, initial))
        return train_final(model, data, parameters, initial=initial)

    monkeypatch.setattr(refinement, "train_final", remember)
    environment = MadeUp(lambda seed: seed == (1, 2, 1))
    result = refined(environment, PARAMETERS.model_copy(update={"added_runs": 3}))
    kept = len(demonstrations.target)
    for (data, start), added in zip(trained, (2, 3), strict=True):
        assert start is initial
        for name in COLUMNS:
            np.testing.assert_array_equal(getattr(data, name)[:kept], getattr(demonstrations, name))
        new = data.where(np.arange(kept, len(data.target)))
        numbers, counts = np.unique(new.demonstration, return_counts=True)
        assert counts.tolist() == [TICKS] * added
        assert not set(numbers) & set(demonstrations.demonstration)
        assert (new.setting == NEW).all()
    improved = result.policies[PARAMETERS.search.samples]  # the first row after the samples
    first = trained[0][0].where(np.arange(kept, kept + TICKS))
    np.testing.assert_array_equal(first.target, open_loop(improved).coupling(np.empty((TICKS, 0)), *PHASE))
