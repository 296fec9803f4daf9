"""How the path of a primitive follows from its coupling terms: a matrix, through which gradients flow back.

    tau^2 xdd = ALPHA (BETA (g - x) - tau xd) + f + c        tau gd = ALPHA_G (G - g)

The transformation system is linear in c, so what a coupling term (held over each step) adds to a movement is
a sum of responses. They are derived from the same exact step as `primitives.transformation.unroll`, depend on
dt / tau alone, and replace T steps in sequence by a matrix product. On a grid of T samples in normalised time
all movements share them, whatever their durations.

Orientations: as long as everything turns about one fixed axis, the angle about it obeys this system
exactly. A correction about a fixed axis of the base frame, on top of a nominal movement with other
rotations, is not quite linear, since rotations do not commute. With 10 degrees of roll, its angle differs
from that of `primitives.orientation.unroll` by less than 0.001, 0.02 and 0.1 degrees on nominal movements
through 1, 4 and 10 degrees about other axes; with corrections of 2, 5 and 10 degrees about two axes at once
by less than 0.15, 0.35 and 0.7 degrees (the tests hold it). That is below what feedback models leave over, so
there is no second, sequential unroll on SO(3) here: training uses the response, `orientation.unroll` is the
reference. Positions are linear: along any axes the response is exact.
"""

from functools import lru_cache

import numpy as np
from scipy.linalg import toeplitz

from structlearn.primitives.transformation import ALPHA, BETA, step_matrix


@lru_cache(maxsize=16)
def coupling_response(samples: int, step: float) -> np.ndarray:
    """Response of the transformation system to a coupling term, from the powers of its exact step.

    A path with coupling is the path without, from the same initial position, velocity and acceleration, plus
    `coupling_response @ c`. Held terms act through c_k -> x_t = (A^(t-k-1) b)_x, a lower-triangular Toeplitz
    matrix; the initial goal makes up for the first value (eq. IV.12).

    Args:
        samples: number of samples T from the start.
        step: sampling interval / tau, dimensionless; 1 / (2 (T - 1)) for a whole movement.

    Returns:
        (T, T), read-only.
    """
    matrix = step_matrix(step)
    state = np.empty((samples, 3))  # response to the initial state (x - G, tau xd, g - G)
    row = np.array([1.0, 0.0, 0.0])
    for k in range(samples):  # row k of A^t that yields x
        state[k] = row
        row = row @ matrix[:, :3]
    impulse = np.zeros(samples)  # response to a held value one step later
    impulse[1:] = (state[:-1] @ matrix[:, 3:])[:, 0]
    response = toeplitz(impulse, np.zeros(samples))
    response[:, 0] -= state[:, 2] / (ALPHA * BETA)
    response.flags.writeable = False
    return response
