"""Axes along and about which feedback corrects: those of the base frame.

A coupling term stands in the transformation system (eq. IV.1, IV.2) and has its unit: an acceleration times
tau^2, so m for positions and rad for orientations. Held for long it shifts by c / (ALPHA BETA).
"""

from typing import Literal, get_args

import numpy as np

Axis = Literal["x", "y", "z", "rx", "ry", "rz"]
"""Of the base frame: along it, or about it with an `r`."""

AXES: tuple[Axis, ...] = get_args(Axis)
"""In this order everywhere: three of the position, then three of the orientation."""


def turns(axis: Axis) -> bool:
    """Whether a correction turns about the axis; else it shifts along it."""
    return AXES.index(axis) >= 3


def direction(axis: Axis) -> np.ndarray:
    """Unit vector (3,) of an axis."""
    return np.eye(3)[AXES.index(axis) % 3]


def unit(axis: Axis) -> str:
    """Unit of the coupling term."""
    return "rad" if turns(axis) else "m"
