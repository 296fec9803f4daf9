"""Joint friction with free parameters: viscous, Coulomb and a constant offset.

    tau_f = d qd + c tanh(qd / 0.02) + o        d = s^2, c = s^2

Viscous damping is chapter III.4.2's; Coulomb friction is what the dissertation names as future work. The
terms are linear in d, c and o, so friction goes beside the regressor of the links.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor

FrictionTerm = Literal["viscous", "coulomb", "offset"]

COULOMB_WIDTH = 0.02
"""rad/s (m/s where a joint slides); below it the Coulomb term falls to zero, smoothly."""


def friction_columns(qd: np.ndarray, terms: Sequence[FrictionTerm]) -> np.ndarray:
    """What the coefficients of each joint are multiplied with: (..., n, k) of velocities (..., n)."""
    shapes = {
        "viscous": lambda: qd,
        "coulomb": lambda: np.tanh(qd / COULOMB_WIDTH),
        "offset": lambda: np.ones_like(qd),
    }
    columns = np.empty((*qd.shape, len(terms)))
    for place, term in enumerate(terms):
        columns[..., place] = shapes[term]()
    return columns


def friction_regressor(qd: np.ndarray, terms: Sequence[FrictionTerm]) -> np.ndarray:
    """`friction_columns` (B, n, n k) of (B, n) as columns of a regressor, beside those of the links.

    Column j k + t is term t of joint j and is zero for all other joints.
    """
    columns = friction_columns(qd, terms)
    batch, joints, count = columns.shape
    regressor = np.zeros((batch, joints, joints, count))
    each = np.arange(joints)
    regressor[:, each, each] = columns
    return regressor.reshape(batch, joints, joints * count)


def friction_coefficients(free: "Tensor", terms: Sequence[FrictionTerm]) -> "Tensor":
    """Coefficients (..., n, k) of free parameters (..., n, k): squares, but for the offset."""
    import torch  # two seconds, which only those who learn need

    parts = [
        column if term == "offset" else column.square()
        for term, column in zip(terms, free.unbind(-1), strict=True)
    ]
    return torch.stack(parts, dim=-1)
