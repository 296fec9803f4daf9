"""Second-order canonical system: the clock that all primitives of a movement share (eq. IV.4, IV.5).

    tau du/dt = ALPHA_U (ALPHA_U / 4 (0 - p) - u)        p(0) = 1
    tau dp/dt = u                                        u(0) = 0

It is critically damped, so the solution is closed-form; nothing is integrated and no step size can matter.
"""

import numpy as np

ALPHA_U = 25.0

TAU_PER_DURATION = 2.0
"""tau = 2 x duration, so that the phase has decayed (p = 0.0140) when the movement ends. With tau = duration
it would decay in the first half, and most kernels would be bunched in the last samples."""


def time_constant(duration: float) -> float:
    """Time constant tau in s of a movement of the given duration in s.

    Raises ValueError: the duration is not positive.
    """
    if not duration > 0.0:
        raise ValueError(f"duration must be positive, is {duration}")
    return TAU_PER_DURATION * duration


def phase(times: np.ndarray, tau: float) -> tuple[np.ndarray, np.ndarray]:
    """Phase p (1 -> 0) and phase velocity u = tau dp/dt (<= 0, 0 at both ends), (...) each (eq. IV.4, IV.5).

    `times`: (...) s since the start of the movement. `tau`: time constant in s.
    """
    rate = 0.5 * ALPHA_U  # double pole of the critically damped system
    elapsed = rate * np.asarray(times, dtype=float) / tau
    decay = np.exp(-elapsed)
    return (1.0 + elapsed) * decay, -rate * elapsed * decay
