"""Via points: a change of the forcing term with which a movement passes given points at given times.

The change of the path is a chain of minimum-jerk movements (Flash & Hogan 1985), from 0 now, through what is
missing at each via point, and back to 0 at the end. What forcing term causes it follows from the
transformation system (eq. IV.1), with no change of the goal:

    df = tau^2 xdd + ALPHA tau xd + ALPHA BETA x

Position, velocity and acceleration stay continuous, and beyond the end nothing has changed.
"""

from collections.abc import Sequence

import numpy as np

from structlearn.core import signals
from structlearn.primitives import transformation
from structlearn.primitives.transformation import ALPHA, BETA

PEAK_SPEED = 1.875
"""Peak speed of a minimum-jerk movement over its mean speed."""


def forcing_change(rows: Sequence[int], missing: np.ndarray, samples: int, step: float) -> np.ndarray:
    """Change (T, D) of a forcing term that shifts the path by `missing` (K, D) at K rows, and back.

    `rows`: increasing, the first above 0; the last one more than K, where the shift has ended. `samples`: T.
    `step`: sampling interval / tau, dimensionless. Forcing is linear between samples, unlike that of the
    closed form, so the amplitudes are such that the shifts are exact.
    """
    ends = np.array([0, *rows])
    shapes = np.stack([_bump(ends[k : k + 3], samples, step) for k in range(len(missing))], axis=1)  # (T, K)
    still = np.zeros(shapes.shape[1])
    caused = transformation.unroll(still, still, shapes, step, 1.0, acceleration=shapes[0]).position
    return shapes @ np.linalg.solve(caused[ends[1:-1]], missing)


def _bump(ends: np.ndarray, samples: int, step: float) -> np.ndarray:
    """Forcing term (T,) of a shift from 0 at the first of three rows to 1 at the second, and back."""
    forcing = np.zeros(samples)
    for first, last in ((ends[0], ends[1]), (ends[2], ends[1])):
        duration = step * (last - first)  # over tau; negative on the way back, which is run backwards
        within = np.arange(min(first, last), max(first, last) + 1)
        s = (within - first) / (last - first)
        rate, bend = signals.minimum_jerk_rate(s) / duration, 60.0 * s * (1 - s) * (1 - 2 * s) / duration**2
        forcing[within] = bend + ALPHA * rate + ALPHA * BETA * signals.minimum_jerk(s)
    return forcing
