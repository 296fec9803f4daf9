import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from structlearn.ground.signals import standardise
from structlearn.segmentation.dtw import correspondences, warping


def slow_correspondences(reference: np.ndarray, guess: np.ndarray) -> list[tuple[int, int]]:
    """Algorithm IV.2, line by line, on whole tables."""
    a, b = (standardise(signal.reshape(len(signal), -1)) for signal in (reference, guess))
    memo = np.full((len(a) + 1, len(b) + 1), np.inf)
    memo[0, 0] = 0.0
    ancestry = np.zeros_like(memo, dtype=int)
    for i in range(1, len(a) + 1):
        for j in range(1, len(b) + 1):
            ancestors = [memo[i - 1, j], memo[i - 1, j - 1], memo[i, j - 1]]
            ancestry[i, j] = int(np.argmin(ancestors))
            memo[i, j] = np.linalg.norm(a[i - 1] - b[j - 1]) + min(ancestors)
    i, j, pairs = len(a), len(b), []
    while i > 1 and j > 1:
        if ancestry[i, j] == 0:
            i -= 1
        elif ancestry[i, j] == 1:
            pairs.append((i - 1, j - 1))
            i, j = i - 1, j - 1
        else:
            j -= 1
    return pairs[::-1]


@given(st.integers(2, 30), st.integers(2, 30), st.integers(1, 3), st.integers(0, 2**32 - 1), st.booleans())
def test_equals_the_algorithm_of_the_text(n, m, axes, seed, ties):
    rng = np.random.default_rng(seed)
    reference, guess = rng.normal(size=(n, axes)).cumsum(0), rng.normal(size=(m, axes)).cumsum(0)
    if ties:
        reference, guess = np.round(reference), np.round(guess)
    expected = slow_correspondences(reference, guess)
    if ties and axes > 1:  # sums in another order break ties of vectors differently
        assert len(correspondences(reference, guess)) <= min(n, m)
    else:
        assert correspondences(reference, guess).tolist() == [list(pair) for pair in expected]


@given(st.integers(2, 30), st.integers(2, 30), st.integers(1, 3))
def test_every_cell_is_computed_once(n, m, axes):
    rng = np.random.default_rng(0)
    pairs, cells = warping(rng.normal(size=(n, axes)), rng.normal(size=(m, axes)))
    assert cells == n * m
    assert len(pairs) <= min(n, m)


def test_scale_and_offset_do_not_matter():
    rng = np.random.default_rng(0)
    reference, guess = rng.normal(size=200).cumsum(), rng.normal(size=150).cumsum()
    np.testing.assert_array_equal(
        correspondences(reference, guess), correspondences(3 * reference + 7, 0.1 * guess - 2)
    )
