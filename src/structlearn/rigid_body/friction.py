"""Joint friction as torques linear in viscous, Coulomb, offset and stiffness coefficients.

    tau_f = d qd + c tanh(qd / 0.02) + o + k q        d = s^2, c = s^2

Viscous damping is that of chapter III.4.2; Coulomb friction is what the dissertation names as future work;
stiffness is that of cables along the joint, or of a torque sensor that is sensitive to the pose. Since the
torques are linear in d, c, o and k, friction adds columns to the regressor of the links.
"""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor

FrictionTerm = Literal["viscous", "coulomb", "offset", "stiffness"]

SIGNED: tuple[FrictionTerm, ...] = ("offset", "stiffness")  # terms whose coefficients may be negative

INITIAL_FRICTION = 0.01  # N m s/rad or N m; not 0, where a square has no gradient
COULOMB_WIDTH = 0.02  # rad/s (m/s for sliding joints); below it the Coulomb term falls smoothly to zero


FRICTIONS: Mapping[str, tuple[FrictionTerm, ...]] = {
    "none": (),
    "viscous": ("viscous",),
    "coulomb": ("viscous", "coulomb"),
    "offset": ("viscous", "coulomb", "offset"),
    "stiffness": ("viscous", "coulomb", "offset", "stiffness"),
}
"""Friction that models learn: none in simulation, viscous on the robot (III.4.2); Coulomb friction, which the
dissertation names as future work; and a constant torque, for sensors that are not zeroed."""


def friction_columns(q: np.ndarray, qd: np.ndarray, terms: Sequence[FrictionTerm]) -> np.ndarray:
    """Torques (..., n, k) per unit of each friction coefficient, at q and qd (..., n)."""
    shapes = {
        "viscous": lambda: qd,
        "coulomb": lambda: np.tanh(qd / COULOMB_WIDTH),
        "offset": lambda: np.ones_like(qd),
        "stiffness": lambda: q,
    }
    columns = np.empty((*qd.shape, len(terms)))
    for place, term in enumerate(terms):
        columns[..., place] = shapes[term]()
    return columns


def friction_regressor(q: np.ndarray, qd: np.ndarray, terms: Sequence[FrictionTerm]) -> np.ndarray:
    """Regressor columns (B, n, n k) of friction, at q and qd (B, n).

    Column j k + t is term t of joint j and is zero for all other joints.
    """
    columns = friction_columns(q, qd, terms)
    batch, joints, count = columns.shape
    regressor = np.zeros((batch, joints, joints, count))
    each = np.arange(joints)
    regressor[:, each, each] = columns
    return regressor.reshape(batch, joints, joints * count)


def friction_coefficients(free: "Tensor", terms: Sequence[FrictionTerm]) -> "Tensor":
    """Coefficients (..., n, k) of free parameters (..., n, k): their squares, except for `SIGNED` terms."""
    import torch  # takes two seconds, and is only needed for learning

    parts = [
        column if term in SIGNED else column.square()
        for term, column in zip(terms, free.unbind(-1), strict=True)
    ]
    return torch.stack(parts, dim=-1)


def initial_friction(models: int, joints: int, terms: Sequence[FrictionTerm]) -> np.ndarray:
    """Initial free parameters (M, n, t) of friction; 0 for `SIGNED` terms."""
    return np.tile(np.where(squared(terms), math.sqrt(INITIAL_FRICTION), 0.0), (models, joints, 1))


def squared(terms: Sequence[FrictionTerm]) -> np.ndarray:
    """(t,) mask: the coefficient of the term is the square of its free parameter."""
    return np.array([term not in SIGNED for term in terms], dtype=bool)
