import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import quick, rngs
from scipy.stats import sem, t

from structlearn.core.metrics import (
    BETTER,
    UNDECIDED,
    WORSE,
    block_count,
    block_sums,
    blocks,
    drawn_counts,
    mean_interval,
    median_interval,
    nmse,
    pairwise_spread,
    percentiles,
    verdict,
)


@given(rngs)
@quick
def test_nmse_is_one_for_the_mean_zero_for_the_target_and_free_of_units(rng):
    target, prediction = rng.normal(size=(2, 60, 3))
    np.testing.assert_allclose(nmse(np.broadcast_to(target.mean(axis=0), target.shape), target), 1.0)
    np.testing.assert_array_equal(nmse(target, target), np.zeros(3))
    scaled = nmse(5.0 * prediction - 2.0, 5.0 * target - 2.0)
    np.testing.assert_allclose(scaled, nmse(prediction, target))


def test_nmse_of_an_offset_is_its_square_over_the_variance():
    target = np.stack([[0.0, 1.0, 2.0, 3.0], [0.0, 10.0, 20.0, 30.0]], axis=1)  # ddof 0: 1.25, 125
    np.testing.assert_allclose(nmse(target + 0.5, target), [0.25 / 1.25, 0.25 / 125.0])


def test_nmse_of_a_constant_target_is_zero_or_infinite_without_a_warning(recwarn):
    target = np.ones((10, 2))
    found = nmse(target + np.array([0.0, 0.1]), target)
    np.testing.assert_array_equal(found, [0.0, np.inf])
    assert not recwarn.list


def test_spread_of_parallel_curves_is_their_mean_distance():
    curve = np.stack([np.linspace(0, 1, 20), np.zeros(20)], axis=1)
    curves = curve + np.array([[[0.0, 0.0]], [[0.0, 3.0]], [[0.0, 4.0]]])
    assert pairwise_spread(curves) == pytest.approx((3 + 4 + 1) / 3)
    assert pairwise_spread(np.stack([curve, curve])) == 0.0


def test_a_verdict_needs_an_interval_on_one_side_of_zero():
    low, high = np.array([0.1, -0.2, -0.1, 0.0, np.nan]), np.array([0.2, -0.1, 0.1, 0.1, np.nan])
    assert verdict(low, high).tolist() == [BETTER, WORSE, UNDECIDED, UNDECIDED, UNDECIDED]


@given(st.integers(2, 40), st.sampled_from([0.5, 0.9, 0.95]), rngs)
@quick
def test_the_interval_of_a_mean_is_scipys(count, confidence, rng):
    samples = rng.normal(3.0, 2.0, count)
    middle, half = mean_interval(samples, confidence)
    expected = t.interval(confidence, count - 1, loc=samples.mean(), scale=sem(samples))
    np.testing.assert_allclose([middle - half, middle + half], expected, rtol=1e-9)


def test_a_single_sample_has_no_interval():
    middle, half = mean_interval(np.array([3.0]))
    assert middle == 3.0
    assert np.isnan(half)


@pytest.mark.parametrize("count", [5, 6, 9, 30, 101])
def test_an_interval_of_the_median_covers_whatever_the_distribution(count):
    draws = np.exp(2.0 * np.random.default_rng(0).standard_normal((2000, count)))
    low, high = np.transpose([median_interval(draw) for draw in draws])
    if count < 6:
        assert np.isnan([low, high]).all()
    else:
        assert 0.945 <= np.mean((low <= 1.0) & (high >= 1.0)) <= 0.985  # order statistics are discrete


def test_blocks_are_long_enough_and_leave_nothing_out():
    values = np.arange(20.0).reshape(10, 2)
    assert [len(block) for block in blocks(values, 3)] == [3, 3, 4]
    np.testing.assert_array_equal(block_sums(values, 3).sum(axis=0), values.sum(axis=0))
    assert block_count(2, 3) == 1
    np.testing.assert_array_equal(block_sums(values[:2], 3), values[:2].sum(axis=0, keepdims=True))


def test_as_many_blocks_are_drawn_as_there_are_and_the_seed_decides_which():
    counts = drawn_counts(7, 50, seed=3)
    assert (counts.sum(axis=1) == 7).all()
    np.testing.assert_array_equal(counts, drawn_counts(7, 50, seed=3))
    assert (counts != drawn_counts(7, 50, seed=4)).any()


@pytest.mark.parametrize(("length", "least", "most"), [(4, 0.0, 0.8), (60, 0.85, 1.0)])
def test_blocks_longer_than_the_memory_cover_the_mean(length, least, most):
    """Of noise that remembers 10 samples; blocks of four would be far too sure."""
    generator = np.random.default_rng(0)
    covered = []
    for seed in range(150):
        noise = np.convolve(generator.normal(size=1300), np.ones(10) / 10, mode="valid")
        sums = block_sums(np.stack([noise, np.ones_like(noise)], axis=1), length)
        drawn = drawn_counts(len(sums), 200, seed) @ sums
        low, high = percentiles(drawn[:, 0] / drawn[:, 1])
        covered.append(low <= 0.0 <= high)
    assert least <= np.mean(covered) <= most
