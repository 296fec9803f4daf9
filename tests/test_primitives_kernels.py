import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import for_rngs, quick
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from structlearn.primitives.canonical import ALPHA_U, phase, time_constant
from structlearn.primitives.kernels import (
    KERNEL_COUNT,
    OVERLAP,
    centres_and_widths,
    features,
    forcing_weights,
    unit_features,
)


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


@pytest.mark.parametrize("count", [2, 25, 300])
@for_rngs
def test_features_share_out_the_phase_velocity(count, rng):
    tau = time_constant(1.0)
    p, u = phase(rng.uniform(0.0, 20.0, size=(7, 11)), tau)  # also long after the end
    shares = features(p, u, count)
    late, rate = phase(np.array([1.0, 1.5, 3.0, 9.0]), tau)
    assert (features(late, rate, count).argmin(axis=-1) == count - 1).all()  # the last one leads ever after
    assert shares.shape == (7, 11, count)
    assert (shares <= 0).all()
    np.testing.assert_allclose(shares.sum(axis=-1), u, rtol=1e-12, atol=1e-300)  # eq. IV.6
    weights = rng.uniform(-1, 1, size=count)
    assert (np.abs(shares @ weights) <= np.abs(u) + 1e-300).all()  # so bounded weights fade with u


def test_shared_arrays_cannot_be_changed():
    for shared in (*centres_and_widths(25), unit_features(50)):
        with pytest.raises(ValueError, match="read-only"):
            shared[:] = 0.0


@given(st.floats(0.05, 50.0))
@quick
def test_the_closed_form_solves_the_text_equations(duration):
    tau = time_constant(duration)

    def rates(_, state):
        p, u = state
        return [u / tau, ALPHA_U * (ALPHA_U / 4 * (0 - p) - u) / tau]  # eq. IV.4, IV.5

    times = np.linspace(0.0, 2 * duration, 40)
    solution = solve_ivp(rates, (0, times[-1]), [1.0, 0.0], "DOP853", times, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(np.stack(phase(times, tau)), solution.y, atol=1e-9)


@pytest.mark.parametrize("duration", [0.0, -1.0, float("nan")])
def test_a_movement_needs_a_positive_duration(duration):
    with pytest.raises(ValueError, match=f"^duration must be positive, is {duration}$"):
        time_constant(duration)


def feature_matrix(samples, count):
    return features(*phase(np.linspace(0.0, 1.0, samples), time_constant(1.0)), count)


@pytest.mark.parametrize("scaled", [False, True])
@for_rngs
def test_joint_weights_are_the_least_squares_of_the_stacked_and_scaled_demonstrations(scaled, rng):
    lengths, count = (150, 150, 220), 12
    scales = rng.uniform(-2.0, 2.0, size=(3, 2)) if scaled else np.ones((3, 2))
    targets = [rng.normal(size=(samples, 2)).cumsum(axis=0) for samples in lengths]
    found = forcing_weights(targets, scales if scaled else None, count=count)  # IV.5.4
    for axis in range(2):
        matrix = np.concatenate(
            [scales[i, axis] * feature_matrix(samples, count) for i, samples in enumerate(lengths)]
        )
        expected = np.linalg.lstsq(matrix, np.concatenate(targets)[:, axis], rcond=None)[0]
        np.testing.assert_allclose(found[:, axis], expected, rtol=1e-4, atol=1e-3)


@for_rngs
def test_local_weights_fit_each_kernel_alone(rng):
    lengths, count = (90, 140), 10
    targets = [rng.normal(size=(samples, 2)).cumsum(axis=0) for samples in lengths]
    found = forcing_weights(targets, None, "local", count)
    p = np.concatenate([phase(np.linspace(0, 1, n), time_constant(1.0))[0] for n in lengths])
    u = np.concatenate([phase(np.linspace(0, 1, n), time_constant(1.0))[1] for n in lengths])
    kernels = np.exp(-0.5 * centres_and_widths(count)[1] * (p[:, None] - centres_and_widths(count)[0]) ** 2)
    kernels /= kernels.sum(axis=1, keepdims=True)
    for i in range(count):  # weighted regression of f on u with weights psi_i
        root = np.sqrt(kernels[:, i])[:, None]
        expected = np.linalg.lstsq(root * u[:, None], root * np.concatenate(targets), rcond=None)[0][0]
        np.testing.assert_allclose(found[i], expected, rtol=1e-9)
