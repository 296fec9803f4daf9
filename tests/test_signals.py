import numpy as np
import pytest
from hypothesis import given
from primitives_movements import quick, rngs

from structlearn.core.signals import (
    derivative,
    low_pass,
    minimum_jerk,
    minimum_jerk_rate,
    standardise,
    time_normalised,
)

DT = 1 / 300
TIME = DT * np.arange(3000)  # 10 s


def sinusoid(frequency_hz, phase=0.0):
    return np.sin(2 * np.pi * frequency_hz * TIME + phase)


def inside(signal):
    """Without the first and last second, which the reflection at the ends disturbs."""
    return signal[300:-300]


@pytest.mark.parametrize("cutoff_hz", [1.0, 5.0, 20.0])
def test_the_cutoff_halves_the_amplitude_and_shifts_nothing(cutoff_hz):
    wave = sinusoid(cutoff_hz, phase=0.3)
    # -3 dB forwards and again backwards; no phase: the output is the input times a number
    np.testing.assert_allclose(inside(low_pass(wave, DT, cutoff_hz)), 0.5 * inside(wave), atol=2e-3)
    slow = sinusoid(0.2)
    np.testing.assert_allclose(inside(low_pass(slow, DT, 10.0)), inside(slow), atol=1e-6)


def test_a_line_passes_unchanged_even_at_its_ends():
    slope, cutoff_hz = -0.7, 5.0
    line = 3.0 + slope * TIME
    change_in_a_period = abs(slope) / cutoff_hz
    np.testing.assert_allclose(low_pass(line, DT, cutoff_hz), line, atol=1e-3 * change_in_a_period)


@pytest.mark.parametrize("cutoff_hz", [150.0, 1000.0])
def test_a_cutoff_beyond_half_the_sampling_rate_changes_nothing_and_copies(cutoff_hz):
    wave = sinusoid(70.0)
    same = low_pass(wave, DT, cutoff_hz)
    np.testing.assert_array_equal(same, wave)
    same[:] = 0.0
    assert wave.any()


@given(rngs)
@quick
def test_the_derivative_of_a_parabola_is_exact_up_to_its_ends(rng):
    a, b, c = rng.normal(size=(3, 2))
    time = 0.02 * np.arange(50)[:, None]
    np.testing.assert_allclose(derivative(a + b * time + c * time**2, 0.02), b + 2 * c * time, atol=1e-10)


def test_standardised_columns_have_no_mean_and_unit_variance():
    columns = np.stack([sinusoid(1.0), 5.0 + 100.0 * TIME, np.full(3000, 7.0)], axis=1)
    found = standardise(columns)
    np.testing.assert_allclose(found.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(found.std(axis=0), [1.0, 1.0, 0.0])
    assert not found[:, 2].any()  # a constant column is zero, not NaN


@given(rngs)
@quick
def test_time_normalisation_is_linear_interpolation(rng):
    signal = rng.normal(size=(31, 2, 2))
    found = time_normalised(signal, 83)
    expected = np.interp(np.linspace(0, 30, 83), np.arange(31), signal[:, 1, 0])
    np.testing.assert_allclose(found[:, 1, 0], expected, atol=1e-12)
    np.testing.assert_array_equal(found[[0, -1]], signal[[0, -1]])
    np.testing.assert_array_equal(time_normalised(signal, 31), signal)


def test_least_jerk_goes_from_rest_to_rest_at_the_derivative_of_its_path():
    ends = np.array([0.0, 1.0])
    np.testing.assert_allclose(minimum_jerk(ends), ends)
    np.testing.assert_allclose(minimum_jerk_rate(ends), 0.0)
    s = np.linspace(0, 1, 1001)
    rate = minimum_jerk_rate(s)
    np.testing.assert_allclose(rate, np.gradient(minimum_jerk(s), s, edge_order=2), atol=1e-4)
    assert rate[1] / s[1] == pytest.approx(0.0, abs=0.05)  # no acceleration at the ends
    assert rate.max() == 15 / 8
