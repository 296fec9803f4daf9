"""Identification from a log: least squares, and the best model among those that can exist.

Torques are linear in theta, so the unconstrained optimum is one least-squares problem. A physically
consistent structure (tri, cov) is fitted to the same data and loss by L-BFGS on its free parameters; the loss
is a quadratic form of theta (`regressor.torque_factors`), so that an iteration does not touch the data.
"""

from collections.abc import Sequence

import numpy as np

from structlearn.rigid_body.compiled_structures import structure_gradient, structure_theta
from structlearn.rigid_body.friction import FrictionTerm
from structlearn.rigid_body.inertia_learner import initial_friction, squared
from structlearn.rigid_body.inertia_parameters import STRUCTURES, Structure, free_parameters
from structlearn.rigid_body.regressor import TorqueFactors, triangular_factor
from structlearn.rigid_body.tree import LinkInertias

SINGULAR = 1e-8
"""Directions of theta that the data excite by less than this share of the strongest are left at zero."""

ANCHOR = 1e-6
"""Weight of the squared change of theta, relative to all of it, against the sum of the joints' NMSEs."""


def normalised_triangle(factors: TorqueFactors) -> np.ndarray:
    """One triangular factor (P + 1, P + 1) of all joints: |triangle (theta, -1)|^2 is their NMSEs' sum."""
    scaled = factors.factors / np.sqrt(factors.samples * factors.variance)[:, None, None]
    return triangular_factor(scaled.reshape(-1, scaled.shape[-1]))


def least_squares(triangle: np.ndarray) -> np.ndarray:
    """Unconstrained optimum (P,) of the sum of the joints' NMSEs.

    Of the many optima (not every parameter shows in the torques) it is the smallest.
    """
    theta, *_ = np.linalg.lstsq(triangle[:, :-1], triangle[:, -1], rcond=SINGULAR)
    return theta


def fit_structure(
    structure: Structure,
    triangle: np.ndarray,
    friction: Sequence[FrictionTerm],
    start: LinkInertias,
    iterations: int,
    known: LinkInertias | None = None,
    rubbing: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The structure's best parameters for the same loss as `least_squares`, by L-BFGS.

    A weak pull towards known inertias decides what the data leave open.

    Args:
        structure: of the inertias.
        triangle: of the data; the columns are those of the links (full ones for nostr), then of friction.
        friction: its terms.
        start: inertias (n,) to start from.
        iterations: at most so many.
        known: where the pull goes; None: to the start, e.g. the URDF's values.
        rubbing: (1, n, t) free parameters of friction to start from; None: small ones.

    Returns:
        Free parameters of the inertias (1, n, k) and of friction (1, n, t).
    """
    from scipy.optimize import minimize

    place, squares = STRUCTURES.index(structure), squared(friction)
    free = free_parameters(structure, start)[None].numpy()
    rubbing = initial_friction(1, len(start.mass), friction) if rubbing is None else rubbing
    pulled = free if known is None else free_parameters(structure, known)[None].numpy()
    reference = structure_theta(place, pulled, rubbing[..., :0], squares[:0])[0]
    weight = ANCHOR / (reference @ reference)
    factor, measured = triangle[:, :-1], triangle[:, -1]

    def parts(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        inertial, rubbed = np.split(values, [free.size])
        return inertial.reshape(free.shape), rubbed.reshape(rubbing.shape)

    def loss(values: np.ndarray) -> tuple[float, np.ndarray]:
        theta = structure_theta(place, *parts(values), squares)
        error, pull = factor @ theta[0] - measured, theta[0, : len(reference)] - reference
        slope = 2.0 * (error @ factor)
        slope[: len(reference)] += 2.0 * weight * pull
        gradients = structure_gradient(place, *parts(values), squares, slope[None])
        return error @ error + weight * (pull @ pull), np.concatenate([its.ravel() for its in gradients])

    found = minimize(
        loss,
        np.concatenate([free.ravel(), rubbing.ravel()]),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": iterations, "maxfun": 2 * iterations, "maxcor": 50, "ftol": 1e-14, "gtol": 1e-10},
    )
    return parts(found.x)
