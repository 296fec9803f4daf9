import numpy as np

from structlearn.core import minimum_jerk


def test_it_goes_from_rest_to_rest_without_acceleration_at_the_ends():
    ends = np.array([0.0, 1.0])
    np.testing.assert_allclose(minimum_jerk.progress(ends), ends)
    np.testing.assert_allclose(minimum_jerk.rate(ends), 0.0)
    near = np.array([1e-4, 1 - 1e-4])
    np.testing.assert_allclose(minimum_jerk.rate(near) / 1e-4, 0.0, atol=0.01)


def test_the_rate_is_the_derivative_and_peaks_at_fifteen_eighths():
    s = np.linspace(0, 1, 1001)
    slope = np.gradient(minimum_jerk.progress(s), s, edge_order=2)
    np.testing.assert_allclose(minimum_jerk.rate(s), slope, atol=1e-4)
    assert minimum_jerk.rate(s).max() == 15 / 8
