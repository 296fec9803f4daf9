import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from primitives_movements import few, quick, rngs, wobbly_turn

from structlearn.feedback import differentiable_primitive
from structlearn.ground import quaternion
from structlearn.primitives import canonical, transformation
from structlearn.primitives.orientation import fit_quaternion

ROLL = np.array([1.0, 0.0, 0.0])


def random_batch(rng, batch=3, samples=40, axes=2):
    """A random situation with forcing and coupling that do not start at zero, as float64 tensors."""
    state = {name: rng.normal(size=(batch, axes)) for name in ("start", "goal", "velocity", "acceleration")}
    terms = {name: 50 * rng.normal(size=(batch, samples, axes)) for name in ("forcing", "coupling")}
    return {name: torch.tensor(values) for name, values in (state | terms).items()}


def reference(dt, tau, coupling, **situation):
    """The same movements by the sequential unroll."""
    situation = {name: values.numpy() for name, values in situation.items()}
    held = coupling.numpy()
    path = transformation.unroll(dt=dt, tau=tau, coupling=lambda k, x, xd: held[:, k], **situation)
    return path.position


@given(rngs)
@quick
def test_the_torch_primitive_is_the_sequential_unroll(rng):
    dt, tau = rng.uniform(0.001, 0.05), rng.uniform(0.5, 8.0)
    situation = random_batch(rng)
    path = differentiable_primitive.unroll(dt=dt, tau=tau, **situation)
    np.testing.assert_allclose(path.numpy(), reference(dt, tau, **situation), rtol=1e-9, atol=1e-9)


def test_at_rest_at_the_goal_it_stays_there():
    here, nothing = torch.full((2, 3), 0.7, dtype=torch.float64), torch.zeros(2, 50, 3, dtype=torch.float64)
    path = differentiable_primitive.unroll(here, here, nothing, nothing, dt=0.01, tau=1.0)
    torch.testing.assert_close(path, here[:, None].expand(2, 50, 3), rtol=0, atol=1e-12)


def test_gradients_agree_with_finite_differences():
    situation = random_batch(np.random.default_rng(0), batch=2, samples=6)
    tensors = [values.requires_grad_() for values in situation.values()]

    def path(*values):
        named = dict(zip(situation, values, strict=True))
        return differentiable_primitive.unroll(dt=0.05, tau=1.3, **named)

    assert torch.autograd.gradcheck(path, tensors)


@given(rngs)
@quick
def test_coupling_adds_its_response_to_any_nominal_movement(rng):
    dt, tau = rng.uniform(0.001, 0.05), rng.uniform(0.5, 8.0)
    situation = random_batch(rng, samples=60)
    with_coupling = reference(dt, tau, **situation)
    without = reference(dt, tau, **situation | {"coupling": torch.zeros_like(situation["coupling"])})
    response = differentiable_primitive.responses(60, dt / tau).coupling
    expected = response @ situation["coupling"].numpy()
    np.testing.assert_allclose(with_coupling - without, expected, rtol=1e-9, atol=1e-9)


@given(st.floats(1e-4, 0.1))
@few
def test_a_coupling_acts_later_only_and_alike_at_all_times(step):
    held = differentiable_primitive.responses(30, step).held
    assert not np.triu(held).any()
    np.testing.assert_array_equal(held[1:, 1:], held[:-1, :-1])
    # critically damped: the response to a constant coupling is closed-form
    elapsed = transformation.ALPHA / 2 * step * np.arange(30)
    steady = 1.0 / (transformation.ALPHA * transformation.BETA)
    expected = steady * (1 - (1 + elapsed) * np.exp(-elapsed))
    np.testing.assert_allclose(held.sum(axis=1), expected, atol=1e-12)


def test_the_response_depends_on_normalised_time_only():
    coupling = torch.tensor(np.random.default_rng(1).normal(size=(1, 40, 1)))
    nothing, zero = torch.zeros_like(coupling), torch.zeros(1, 1, dtype=torch.float64)
    slow, fast = (
        differentiable_primitive.unroll(zero, zero, nothing, coupling, dt, tau)
        for dt, tau in ((0.1, 8.0), (0.01, 0.8))
    )
    torch.testing.assert_close(slow, fast, rtol=0, atol=1e-12)


def roll_correction(nominal, amplitude, dt):
    """A fading roll coupling of the given largest angle in rad, and that angle over time (T,)."""
    tau = canonical.time_constant(nominal.duration)
    times = dt * np.arange(round(nominal.duration / dt) + 1)
    _, u = canonical.phase(times, tau)
    coupling = u * np.sin(4 * times / nominal.duration + 1)
    angle = differentiable_primitive.responses(len(times), dt / tau).coupling @ coupling
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
