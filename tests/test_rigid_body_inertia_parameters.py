import numpy as np
import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rigid_body_robots import robot

from structlearn.rigid_body.friction import friction_coefficients, squared
from structlearn.rigid_body.inertia_parameters import (
    STRUCTURES,
    free_parameters,
    link_inertias,
    parameter_count,
    sample_parameters,
    structure_gradient,
    structure_theta,
)
from structlearn.rigid_body.regressor import link_parameters

EXTREME = st.sampled_from([0.0, 1e-200, -1e-12, 1e-6, 1.0, -1.0, 37.0, 1e3, -1e8, 1e16, -1e30, 1e60])
FREE = arrays(np.float64, (2, 10), elements=st.one_of(st.floats(-10.0, 10.0), EXTREME))


def principal_moments(inertias):
    matrix = inertias.inertia.detach().numpy()
    np.testing.assert_array_equal(matrix, np.swapaxes(matrix, -1, -2))
    return np.linalg.eigvalsh(matrix)


@pytest.mark.parametrize("structure", ["spd", "tri", "cov"])
@settings(max_examples=100)
@given(free=FREE)
@example(free=np.zeros((2, 10)))
@example(free=np.full((2, 10), 1e60))
@example(free=np.full((2, 10), -1e60))
@example(free=np.tile([0.0] * 6 + [1.0, 1e8, 1e8, -800.0], (2, 1)))  # a flat triangle: third side zero
@example(free=np.tile([0.0] * 6 + [1.0, 1e8, 1e8, 800.0], (2, 1)))  # a flat triangle: third side the sum
@example(free=np.tile([0.0] * 4 + [1e8, 0.0, 0.0, 1e8, 1e8, 0.0], (2, 1)))  # all mass on one line
def test_every_value_is_a_body_that_can_exist(structure, free):
    """But for the triangle inequality, which spd may break."""
    inertias = link_inertias(structure, torch.tensor(free))
    assert (inertias.mass > 0.0).all()
    moments = principal_moments(inertias)
    assert np.isfinite(moments).all()
    assert (moments > 0.0).all()  # positive definite
    triangle = moments[:, 0] + moments[:, 1] >= moments[:, 2]  # eq. III.8, with all permutations
    assert triangle.all() or structure == "spd"


@pytest.mark.parametrize("structure", STRUCTURES)
@settings(max_examples=30)
@given(seed=st.integers(0, 1000), size=st.floats(0.0, 30.0))
@example(seed=0, size=0.0)
def test_gradients_in_closed_form_are_those_of_autograd(structure, seed, size):
    generator = torch.Generator().manual_seed(seed)
    free = (size * sample_parameters(structure, 3, [generator, generator])).requires_grad_()
    friction = torch.randn(2, 3, 2, generator=generator, dtype=torch.float64).requires_grad_()
    terms = ("coulomb", "offset")
    if structure == "nostr":
        free.data[..., 0] += 1.0  # theta is divided by its mass
    links = link_parameters(link_inertias(structure, free), structure != "nostr")
    theta = torch.cat([links, friction_coefficients(friction, terms).flatten(1)], dim=1)
    slope = torch.randn(theta.shape, generator=generator, dtype=torch.float64)
    expected = torch.autograd.grad(theta, [free, friction], slope)
    arguments = STRUCTURES.index(structure), free.detach().numpy(), friction.detach().numpy(), squared(terms)
    np.testing.assert_allclose(structure_theta(*arguments), theta.detach(), rtol=1e-9, atol=1e-13)
    for found, gradient in zip(structure_gradient(*arguments, slope.numpy()), expected, strict=True):
        np.testing.assert_allclose(found, gradient, rtol=1e-8, atol=1e-11)


def test_weaker_structures_are_not_consistent():
    """What sets tri and cov apart: drawn at random, the others break the laws now and then."""
    generators = [torch.Generator().manual_seed(seed) for seed in range(20)]
    broken = {}
    for structure in STRUCTURES:
        inertias = link_inertias(structure, sample_parameters(structure, 7, generators)).arrays()
        symmetric = 0.5 * (inertias.inertia + np.swapaxes(inertias.inertia, -1, -2))
        moments = np.linalg.eigvalsh(symmetric)
        triangle = moments[..., 0] + moments[..., 1] >= moments[..., 2]
        broken[structure] = ((inertias.mass > 0.0) & (moments[..., 0] > 0.0) & triangle).mean() < 1.0
    assert broken == {"nostr": True, "symm": True, "spd": True, "tri": False, "cov": False}


@pytest.mark.parametrize("structure", STRUCTURES)
def test_known_inertias_come_back(structure):
    known = robot("iiwa").inertias
    back = link_inertias(structure, free_parameters(structure, known)).arrays()
    np.testing.assert_allclose(back.mass, known.mass, rtol=1e-12)
    np.testing.assert_allclose(back.first_moment, known.first_moment, rtol=1e-12)
    np.testing.assert_allclose(back.inertia, known.inertia, rtol=0, atol=1e-10)


@pytest.mark.parametrize("structure", ["tri", "cov"])
@given(free=arrays(np.float64, (3, 10), elements=st.floats(-3.0, 3.0)))
def test_free_parameters_invert_what_the_structure_says(structure, free):
    inertias = link_inertias(structure, torch.tensor(free))
    back = link_inertias(structure, free_parameters(structure, inertias))
    torch.testing.assert_close(back.inertia, inertias.inertia, rtol=1e-5, atol=3e-5)


@pytest.mark.parametrize("structure", ["tri", "cov"])
def test_a_urdf_that_breaks_the_triangle_becomes_its_neighbour(structure):
    known = robot("xarm").inertias
    moments = np.linalg.eigvalsh(known.inertia)
    assert (moments[:, 0] + moments[:, 1] < moments[:, 2]).sum() == 2  # links 2 and 3, as published
    near = link_inertias(structure, free_parameters(structure, known)).arrays()
    assert np.abs(near.inertia - known.inertia).max() < 4e-4
    moments = np.linalg.eigvalsh(near.inertia)
    assert (moments[:, 0] + moments[:, 1] >= moments[:, 2]).all()


@pytest.mark.parametrize("structure", STRUCTURES)
def test_a_start_at_known_inertias_can_learn(structure):
    """Also where the URDF lies on or beyond a bound: every tensor of some size can still change."""
    known = robot("xarm").inertias
    free = free_parameters(structure, known).requires_grad_()

    def entries(values):
        return link_inertias(structure, values).inertia

    slope = torch.autograd.functional.jacobian(lambda values: entries(values).sum(dim=0), free)
    assert torch.isfinite(slope).all()
    for link, size in enumerate(np.linalg.norm(known.inertia, axis=(1, 2))):
        reachable = torch.linalg.svdvals(slope[:, :, link, 4:].flatten(0, 1))[:6]
        assert reachable[-1] > 1e-7 * size, "an entry of the inertia is stuck"


@pytest.mark.parametrize("structure", STRUCTURES)
def test_draws_are_one_generator_per_model(structure):
    def drawn(*seeds):
        return sample_parameters(structure, 7, [torch.Generator().manual_seed(seed) for seed in seeds])

    assert drawn(1, 2, 3).shape == (3, 7, parameter_count(structure))
    torch.testing.assert_close(drawn(1, 2, 3)[1], drawn(2)[0], rtol=0, atol=0)


def test_tri_and_cov_of_a_brick_by_hand():
    """Eq. III.10 with a right angle; eq. III.15 with a diagonal L."""
    free = torch.zeros(1, 10, dtype=torch.float64)
    free[0, 7:9] = torch.tensor([3.0, 4.0]).sqrt()
    moments = principal_moments(link_inertias("tri", free))[0]
    np.testing.assert_allclose(moments, [3.0, 4.0, 5.0], rtol=1e-5)
    free = torch.zeros(1, 10, dtype=torch.float64)
    free[0, 4:7] = torch.tensor([1.0, 2.0, 3.0])
    moments = principal_moments(link_inertias("cov", free))[0]
    np.testing.assert_allclose(moments, [5.0, 10.0, 13.0], rtol=1e-5)
