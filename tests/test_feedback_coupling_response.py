import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import few, quick, rngs, wobbly_turn

from structlearn.feedback.corrected_paths import coupling_response
from structlearn.ground import quaternion
from structlearn.primitives import canonical, transformation
from structlearn.primitives.orientation import fit_quaternion

ROLL = np.array([1.0, 0.0, 0.0])


@given(rngs)
@quick
def test_coupling_adds_its_response_to_any_nominal_movement(rng):
    dt, tau = rng.uniform(0.001, 0.05), rng.uniform(0.5, 8.0)
    state = {name: rng.normal(size=(3, 2)) for name in ("start", "goal", "velocity", "acceleration")}
    forcing, coupling = 50 * rng.normal(size=(2, 3, 60, 2))
    corrected, nominal = (
        transformation.unroll(
            forcing=forcing, dt=dt, tau=tau, coupling=lambda k, x, xd, c=c: c[:, k], **state
        ).position
        for c in (coupling, 0.0 * coupling)
    )
    expected = coupling_response(60, dt / tau) @ coupling
    np.testing.assert_allclose(corrected - nominal, expected, rtol=1e-9, atol=1e-9)


@given(st.floats(1e-4, 0.1))
@few
def test_a_coupling_acts_later_only_and_alike_at_all_times(step):
    response = coupling_response(30, step)[:, 1:]  # the first value moves the initial goal too
    assert not np.triu(response).any()
    np.testing.assert_array_equal(response[1:, 1:], response[:-1, :-1])
    # critically damped: the response to a constant coupling is closed-form
    elapsed = transformation.ALPHA / 2 * step * np.arange(29)
    steady = 1.0 / (transformation.ALPHA * transformation.BETA)
    expected = steady * (1 - (1 + elapsed) * np.exp(-elapsed))
    np.testing.assert_allclose(response[1:].sum(axis=1), expected, atol=1e-12)


def roll_correction(nominal, amplitude, dt, swings=4.0):
    """A fading coupling of the given largest angle in rad about an axis, and that angle over time (T,)."""
    tau = canonical.time_constant(nominal.duration)
    times = dt * np.arange(round(nominal.duration / dt) + 1)
    _, u = canonical.phase(times, tau)
    coupling = u * np.sin(swings * times / nominal.duration + 1)
    angle = coupling_response(len(times), dt / tau) @ coupling
    scale = amplitude / np.abs(angle).max()
    return scale * coupling, scale * angle


def turned(nominal, coupling, dt):
    """Rotation vectors (T, 3) from the nominal to the corrected unroll of a quaternion primitive."""
    corrected = nominal.unroll(dt, coupling=lambda k, q, w: coupling[k] * ROLL)
    return quaternion.difference(corrected.orientation, nominal.unroll(dt).orientation)


@given(rngs)
@few
def test_about_one_axis_the_orientation_primitive_has_the_same_response(rng):
    dt = 0.02
    base = quaternion.from_rotation_vector(rng.uniform(-3, 3) * ROLL)
    roll = wobbly_turn(rng, rng.uniform(-1, 1), wobble=0.0, dt=dt, base=base, axis=ROLL)
    coupling, angle = roll_correction(fit_quaternion([roll]), np.radians(20), dt)
    difference = turned(fit_quaternion([roll]), coupling, dt)
    np.testing.assert_allclose(difference[:, 0], angle, rtol=0, atol=1e-9)
    np.testing.assert_allclose(difference[:, 1:], 0.0, atol=1e-9)


@pytest.mark.parametrize(("other_deg", "error_deg"), [(1, 0.001), (4, 0.02), (10, 0.1)])
def test_with_other_rotations_the_roll_is_still_linear_to_a_fraction_of_a_degree(other_deg, error_deg):
    dt = 0.01
    for seed in range(5):
        rng = np.random.default_rng(seed)
        base = quaternion.from_rotation_vector(rng.normal(size=3))
        wobble = np.radians(other_deg / 3)
        path = wobbly_turn(rng, np.radians(other_deg), wobble, 2.6, dt, base, axis=(0, 0.6, 0.8))
        nominal = fit_quaternion([path])
        coupling, angle = roll_correction(nominal, np.radians(10), dt)
        error = turned(nominal, coupling, dt)[:, 0] - angle
        assert np.degrees(np.abs(error).max()) < error_deg


@pytest.mark.parametrize(("amplitude_deg", "error_deg"), [(2, 0.15), (5, 0.35), (10, 0.7)])
def test_corrections_about_two_axes_at_once_nearly_add_up(amplitude_deg, error_deg):
    dt = 0.01
    for seed in range(3):
        rng = np.random.default_rng(seed)
        base = quaternion.from_rotation_vector(rng.normal(size=3))
        path = wobbly_turn(rng, np.radians(10), np.radians(3), 2.6, dt, base, axis=(0, 0.6, 0.8))
        nominal, largest = fit_quaternion([path]), np.radians(amplitude_deg)
        pairs = [roll_correction(nominal, largest, dt, swings) for swings in (4.0, 2.0)]
        coupling, angles = (np.column_stack([*part, 0.0 * part[0]]) for part in zip(*pairs, strict=True))
        corrected = nominal.unroll(dt, coupling=lambda k, q, w, c=coupling: c[k])
        found = quaternion.difference(corrected.orientation, nominal.unroll(dt).orientation)
        assert np.degrees(np.abs(found - angles).max()) < error_deg
