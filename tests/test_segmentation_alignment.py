from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from reporting_scraping import PARAMETERS

from structlearn.ground.errors import InputError
from structlearn.segmentation.alignment import (
    Alignment,
    Movement,
    least_squares,
    refine,
    velocity_weights,
    with_crossings,
)
from structlearn.segmentation.crossings import Crossing


@given(st.floats(0.3, 3.0), st.floats(-500, 500), st.integers(0, 1000))
def test_recovers_scale_and_delay_from_exact_pairs(time_scale, delay, seed):
    rng = np.random.default_rng(seed)
    reference = rng.choice(1000, size=20, replace=False)
    pairs = np.column_stack([reference, time_scale * reference + delay])
    found = least_squares(pairs, rng.uniform(0.1, 1.0, 20))
    np.testing.assert_allclose([found.time_scale, found.delay], [time_scale, delay], rtol=1e-8, atol=1e-6)


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
    reference = np.array([[1.0], [0.5], [0.5], [0.05]])
    guess = np.array([[2.0], [1.0], [0.2], [0.1]])  # twice as fast: comparable after scaling
    weights = velocity_weights(reference, guess, near_zero=0.08, decay=3.0)
    np.testing.assert_allclose(weights, [1.0, 1.0, np.exp(-3.0 * 0.4), 0.0])


def test_too_few_pairs_are_told():
    with pytest.raises(InputError, match="only 1 correspondence pairs"):
        least_squares(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([1.0, 0.0]))


def test_backward_time_is_told():
    with pytest.raises(InputError, match="backwards"):
        least_squares(np.array([[0.0, 10.0], [10.0, 0.0]]))


def test_crossings_correct_the_ends_and_false_ones_hardly_count():
    reference = np.arange(40.0, 60.0)
    pairs = np.column_stack([reference, reference])  # mid-movement only
    text = least_squares(pairs)
    near = with_crossings(text, pairs, np.ones(20), np.array([[0.0, 4.0], [100.0, 96.0]]), 3.0, 10.0)
    assert abs(near.guess_time(0.0) - 4.0) < 0.5
    false = with_crossings(text, pairs, np.ones(20), np.array([[0.0, 0.0], [100.0, 400.0]]), 3.0, 10.0)
    assert abs(false.guess_time(100.0) - 100.0) < 30.0
    assert with_crossings(text, pairs, np.ones(20), pairs[:2], 0.0, 10.0) == Alignment(
        pytest.approx(1.0), pytest.approx(0.0, abs=1e-9)
    )


def test_a_pair_is_dropped_where_either_of_the_two_is_near_rest():
    reference = np.array([[1.0], [0.01], [0.5], [0.5]])
    guess = np.array([[1.0], [0.5], [0.01], [0.5]])
    weights = velocity_weights(reference, guess, near_zero=0.08, decay=3.0)
    np.testing.assert_array_equal(weights > 0.0, [True, False, False, True])


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
        return refine(reference, Movement(0.01, path, np.gradient(path, axis=0), crossing), parameters)

    other = path.copy()
    other[outside] += 0.4 - 0.4 * np.cos(np.linspace(0.0, 2.0 * np.pi, len(other[outside])))[:, None]
    here = {"earliest": 102, "latest": 398}[bound]  # a gradient reaches one sample further
    bounded = [found(its, **{bound: here}) for its in (path, other)]
    assert bounded[0].alignments == bounded[1].alignments
    np.testing.assert_array_equal(bounded[0].pairs, bounded[1].pairs)
    assert found(path).alignments != found(other).alignments
