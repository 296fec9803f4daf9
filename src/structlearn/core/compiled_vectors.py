"""Vectors in compiled loops, where a call of the linear algebra library costs more than the arithmetic."""

from functools import partial

import numpy as np

from structlearn.core.compilation import numba

compiled_inside = partial(
    numba.njit, cache=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True
)()
"""Decorator of what compiled functions alone call: code that takes apart what Python would pass, often a
hundred arrays, takes longer to compile than the function."""


@numba.njit(cache=True, inline="always")
def cross(a: np.ndarray | tuple, b: np.ndarray | tuple) -> tuple:
    """Vector product of two vectors of three numbers each."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
