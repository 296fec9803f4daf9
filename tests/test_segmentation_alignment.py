from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reporting_scraping import PARAMETERS

from structlearn.core.signals import standardise
from structlearn.segmentation.alignment import (
    Alignment,
    Movement,
    least_squares,
    refine_cuts,
    velocity_weights,
    with_crossings,
)
from structlearn.segmentation.crossings import Crossing
from structlearn.segmentation.dtw import correspondences
from structlearn.segmentation.motion_runs import moving_interval


def test_equals_the_weighted_normal_equations():
    """Equation IV.18, by a general solver."""
    rng = np.random.default_rng(0)
    pairs = np.column_stack([np.arange(50.0), 1.3 * np.arange(50) + 4 + rng.normal(size=50)])
    weights = rng.uniform(size=50)
    root = np.sqrt(weights)[:, None]
    columns = np.column_stack([pairs[:, 0], np.ones(50)])
    expected = np.linalg.lstsq(root * columns, root[:, 0] * pairs[:, 1], rcond=None)[0]
    found = least_squares(pairs, weights)
    np.testing.assert_allclose([found.time_scale, found.delay], expected)


def test_weights_fall_with_the_velocity_difference_and_vanish_near_zero():
    """Of either of the two; the guess is twice as fast, which scaling removes."""
    reference = np.array([[1.0], [0.5], [0.5], [0.05], [0.01], [0.5]])
    guess = np.array([[2.0], [1.0], [0.2], [0.1], [1.0], [0.02]])
    weights = velocity_weights(reference, guess, near_zero=0.08, decay=3.0)
    np.testing.assert_allclose(weights, [1.0, 1.0, np.exp(-3.0 * 0.4), 0.0, 0.0, 0.0])


def test_too_few_pairs_and_backward_time_are_told():
    with pytest.raises(ValueError, match="only 1 correspondence pairs"):
        least_squares(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([1.0, 0.0]))
    with pytest.raises(ValueError, match="backwards"):
        least_squares(np.array([[0.0, 10.0], [10.0, 0.0]]))


@pytest.mark.parametrize(("distance", "share"), [(0.0, 1.0), (10.0, 0.5), (30.0, 0.1)])
def test_both_crossings_together_weigh_what_is_said_of_all_other_pairs(distance, share):
    """Pairs without delay and crossings with one of 4 samples: the fit's is their weighted mean."""
    middle = np.arange(40.0, 61.0)
    pairs, weights = np.column_stack([middle, middle]), np.linspace(-1, 1, 21) ** 2
    crossings = np.array([[0.0, 4.0], [100.0, 104.0]])
    found = with_crossings(Alignment(1.0, 4.0 - distance), pairs, weights, crossings, 3.0, 10.0)
    assert found == Alignment(pytest.approx(1.0), pytest.approx(4.0 * 3.0 * share / (1.0 + 3.0 * share)))


@pytest.mark.parametrize(("bound", "outside"), [("earliest", slice(0, 100)), ("latest", slice(401, 500))])
def test_motion_outside_of_what_surrounds_a_primitive_does_not_count(bound, outside):
    """The extension of the segments would reach into it."""
    parameters = PARAMETERS.model_copy(update={"extension_s": 1.0})
    time = np.arange(500.0)
    path = np.tanh((time[:, None] - [230.0, 260.0]) / 40.0)  # (T, 2)
    reference = Movement(0.01, path, np.gradient(path, axis=0), Crossing(150, 350, 0, 499))

    def found(path, **bounds):
        crossing = replace(Crossing(150, 350, 0, 499), **bounds)
        return refine_cuts(reference, Movement(0.01, path, np.gradient(path, axis=0), crossing), parameters)

    other = path.copy()
    other[outside] += 0.4 - 0.4 * np.cos(np.linspace(0.0, 2.0 * np.pi, len(other[outside])))[:, None]
    here = {"earliest": 102, "latest": 398}[bound]  # a gradient reaches one sample further
    bounded = [found(its, **{bound: here}) for its in (path, other)]
    assert bounded[0].alignments == bounded[1].alignments
    np.testing.assert_array_equal(bounded[0].pairs, bounded[1].pairs)
    assert found(path).alignments != found(other).alignments


@pytest.mark.parametrize("downsampling", [1, 2, 5])
def test_delay_and_pairs_count_in_samples_of_the_recording(downsampling):
    """Whatever the down-sampling, and though both crossings are at the same samples."""
    parameters = PARAMETERS.model_copy(update={"extension_s": 1.0, "downsampling": downsampling})
    time, crossing = np.arange(500.0), Crossing(150, 350, 0, 499)
    paths = [np.tanh((time[:, None] - delay - [230.0, 260.0]) / 10.0) for delay in (0.0, 25.0)]
    found = refine_cuts(
        *(Movement(0.01, path, np.gradient(path, axis=0), crossing) for path in paths), parameters
    )
    alignment = found.alignments["wls_published"]
    assert alignment.time_scale * 245.0 + alignment.delay == pytest.approx(270.0, abs=4.0)
    assert ((found.pairs - 50) % downsampling == 0).all()
    np.testing.assert_allclose(found.pairs[[0, -1]], [[50, 50], [450, 450]], atol=downsampling)


def bell(samples: int = 400, centre: float = 200, width: float = 40) -> np.ndarray:
    return np.exp(-0.5 * ((np.arange(samples) - centre) / width) ** 2)


def test_cut_lies_at_rest_below_the_threshold():
    speed = bell()
    s, e = moving_interval(speed, speed, threshold=0.2, bridge=0)
    assert s < 200 < e
    assert max(speed[s], speed[e]) <= 0.2 * 0.2 < speed[s + 1]  # no further than needed


def test_descent_stops_at_a_local_minimum():
    speed = bell(centre=200) + 0.8 * bell(centre=320, width=20)
    valley = 200 + int(np.argmin(speed[200:320]))
    assert moving_interval(speed, speed, threshold=speed[valley] + 0.05, bridge=0)[1] == valley


TWO = bell(centre=120, width=20) + bell(centre=240, width=20) * 1.1


@pytest.mark.parametrize(
    ("speed", "threshold", "bridge", "first", "inside", "outside"),
    [
        (TWO, 0.3, 100, 0, (120, 240), ()),  # a hesitation is bridged
        (TWO, 0.3, 10, 0, (240,), (120,)),  # and a pause is not: the larger movement alone
        (2 * bell(centre=80, width=15) + bell(centre=300, width=15), 0.2, 0, 150, (300,), (80, 150)),
    ],
)
def test_the_largest_movement_from_the_first_sample_on(speed, threshold, bridge, first, inside, outside):
    s, e = moving_interval(speed, speed, threshold, bridge, first)
    assert all(s < sample < e for sample in inside)
    assert not any(s <= sample <= e for sample in outside)


def test_smoothing_does_not_widen_the_cut():
    sharp = ((np.arange(400) > 150) & (np.arange(400) < 250)).astype(float)
    smooth = np.convolve(sharp, np.ones(61) / 61, mode="same")
    assert moving_interval(smooth, sharp, threshold=0.1, bridge=0) == (150, 250)


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
