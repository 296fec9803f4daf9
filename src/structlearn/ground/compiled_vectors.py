"""Vectors in compiled loops, where a call of the linear algebra library costs more than the arithmetic."""

import numba
import numpy as np


@numba.njit(cache=True, inline="always")
def cross(a: np.ndarray | tuple, b: np.ndarray | tuple) -> tuple:
    """Vector product of two vectors of three numbers each."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
