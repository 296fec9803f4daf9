import numpy as np
import torch

from structlearn.rigid_body.friction import (
    COULOMB_WIDTH,
    friction_coefficients,
    friction_columns,
    friction_regressor,
)

TERMS = ("viscous", "coulomb", "offset")


def test_torque_in_closed_form():
    qd = np.array([[0.5, -2.0], [0.0, COULOMB_WIDTH]])
    coefficients = np.array([[0.3, 1.0, 0.1], [0.2, 2.0, -0.4]])
    torque = (friction_columns(qd, TERMS) * coefficients).sum(axis=-1)
    expected = [
        [0.3 * 0.5 + 1.0 + 0.1, -0.2 * 2.0 - 2.0 - 0.4],
        [0.1, 0.2 * COULOMB_WIDTH + 2.0 * np.tanh(1.0) - 0.4],
    ]
    np.testing.assert_allclose(torque, expected, rtol=1e-12)


def test_regressor_is_the_same_torque():
    generator = np.random.default_rng(0)
    qd, coefficients = generator.normal(size=(20, 4)), generator.normal(size=(4, 2))
    terms = ("coulomb", "viscous")  # any order
    torque = (friction_columns(qd, terms) * coefficients).sum(axis=-1)
    regressor = friction_regressor(qd, terms)
    assert regressor.shape == (20, 4, 8)
    np.testing.assert_allclose(regressor @ coefficients.ravel(), torque, rtol=1e-12)


def test_friction_never_drives():
    """Viscous and Coulomb friction take power from the joint for any free parameters."""
    generator = np.random.default_rng(1)
    free = torch.from_numpy(generator.normal(0.0, 5.0, (3, 7, 2)))
    coefficients = friction_coefficients(free, TERMS[:2]).numpy()
    qd = generator.normal(size=(50, 7))
    torque = np.einsum("bnk,mnk->mbn", friction_columns(qd, TERMS[:2]), coefficients)
    assert (torque * qd >= 0.0).all()
