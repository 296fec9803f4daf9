"""Intervals from blocks of a time series."""

import numpy as np
import pytest

from structlearn.core.metrics import block_count, block_sums, blocks, drawn_counts, percentiles


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
