"""pydmps at the rows of `primitives`: one movement of a second, its only duration.

It fits each kernel's weight alone (locally weighted regression), one demonstration at a time, and takes Euler
steps in Python; there is nothing to batch. Every public function builds a contender and raises ImportError
when the library is absent.
"""

import numpy as np
from primitive_inputs import AXES, DT, path_error
from timing import Contender

KERNELS = 100
"""Four times ours: with 25 its path is off by a twelfth of its size, with these by a seventieth."""


def fit(path: np.ndarray) -> Contender:
    """Weights of one primitive from the positions (T, D) of one demonstration."""
    dmp = _primitive()
    return Contender(lambda: dmp.imitate_path(path.T), lambda _: path_error(dmp.rollout()[0], path))


def unroll(path: np.ndarray) -> Contender:
    """Positions, velocities and accelerations of a movement (T, D)."""
    dmp = _primitive()
    dmp.imitate_path(path.T)
    return Contender(dmp.rollout, lambda unrolled: path_error(unrolled[0], path))


def _primitive():
    from pydmps import DMPs_discrete

    return DMPs_discrete(n_dmps=AXES, n_bfs=KERNELS, dt=DT)
