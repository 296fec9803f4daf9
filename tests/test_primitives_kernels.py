import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import quick, rngs
from scipy.optimize import brentq

from structlearn.primitives.canonical import phase, time_constant
from structlearn.primitives.kernels import KERNEL_COUNT, OVERLAP, centres_and_widths, features, unit_features


@pytest.mark.parametrize("count", [2, 10, 25, 60])
def test_centres_are_equally_spaced_in_time_from_start_to_end(count):
    centres, _ = centres_and_widths(count)
    tau = time_constant(1.0)
    times = [brentq(lambda t, c=c: float(phase(t, tau)[0]) - c, -1e-3, 2.0) for c in centres[1:]]
    assert centres[0] == 1.0
    np.testing.assert_allclose(times, np.arange(1, count) / (count - 1), atol=1e-9)  # IV.6


def test_the_text_has_25_kernels_whose_widths_follow_from_their_neighbours():
    centres, widths = centres_and_widths(KERNEL_COUNT)
    assert KERNEL_COUNT == 25
    half_width = 1 / np.sqrt(widths)  # where the kernel has fallen to exp(-1/2)
    np.testing.assert_allclose(half_width[:-1], OVERLAP * (centres[:-1] - centres[1:]))
    assert half_width[-1] == half_width[-2]


@given(st.floats(0.0, 1.0), st.integers(2, 60))
@quick
def test_features_are_the_normalised_kernels_of_the_text(time, count):
    p, u = phase(np.array(time), time_constant(1.0))
    centres, widths = centres_and_widths(count)
    kernels = np.array([np.exp(-h * (p - c) ** 2 / 2) for c, h in zip(centres, widths, strict=True)])
    np.testing.assert_allclose(features(p, u, count), u * kernels / kernels.sum(), rtol=1e-9, atol=1e-40)


@given(rngs, st.sampled_from([2, 25, 300]))
@quick
def test_features_share_out_the_phase_velocity(rng, count):
    tau = time_constant(1.0)
    p, u = phase(rng.uniform(0.0, 20.0, size=(7, 11)), tau)  # also long after the end
    shares = features(p, u, count)
    assert shares.shape == (7, 11, count)
    assert (shares <= 0).all()
    np.testing.assert_allclose(shares.sum(axis=-1), u, rtol=1e-12, atol=1e-300)  # eq. IV.6
    weights = rng.uniform(-1, 1, size=count)
    assert (np.abs(shares @ weights) <= np.abs(u) + 1e-300).all()  # so bounded weights fade with u


@pytest.mark.parametrize("count", [2, 25, 300])
def test_the_last_kernel_leads_ever_after(count):
    p, u = phase(np.array([1.0, 1.5, 3.0, 9.0]), time_constant(1.0))
    assert (features(p, u, count).argmin(axis=-1) == count - 1).all()


def test_shared_arrays_cannot_be_changed():
    for shared in (*centres_and_widths(25), unit_features(50)):
        with pytest.raises(ValueError, match="read-only"):
            shared[:] = 0.0
