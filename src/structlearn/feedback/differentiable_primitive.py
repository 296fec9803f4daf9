"""The primitive as a differentiable function in torch: how its path follows from forcing and coupling terms.

    tau^2 xdd = ALPHA (BETA (g - x) - tau xd) + f + c        tau gd = ALPHA_G (G - g)

Given f and c the transformation system is linear, so its whole path is a sum of responses: to the state at
the start, to the forcing term (linear between samples) and to the coupling term (held over each step). They
are derived from the same exact step as `primitives.transformation.unroll`, depend on dt / tau alone, and
replace T steps in sequence by a matrix product, which is also how gradients flow back through the movement.
On a grid of T samples in normalised time all movements share them, whatever their durations.

Orientations: as long as everything turns about one fixed axis, the angle about it obeys this system
exactly. A correction about a fixed axis of the base frame, on top of a nominal movement with other
rotations, is not quite linear, since rotations do not commute. With 10 degrees of roll, its angle differs
from that of `primitives.orientation.unroll` by less than 0.001, 0.02 and 0.1 degrees on nominal movements
through 1, 4 and 10 degrees about other axes (the tests hold it). That is far below what feedback models
leave over, so there is no second, sequential unroll on SO(3) here: training uses the response,
`orientation.unroll` is the reference.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import torch
from scipy.linalg import toeplitz

from structlearn.primitives.transformation import ALPHA, BETA, initial_goal, step_matrix


@dataclass(frozen=True)
class Responses:
    """How the path of a transformation system depends on what drives it; all arrays are read-only.

    Attributes:
        state: (T, 3) to the initial state (x - G, tau xd, g - G).
        forcing: (T, T) to a forcing term that is linear between samples.
        held: (T, T) to a coupling term held over each step, the initial state being given.
    """

    state: np.ndarray
    forcing: np.ndarray
    held: np.ndarray

    @property
    def coupling(self) -> np.ndarray:
        """(T, T) all that the coupling term does; the initial goal makes up for its first value (eq. IV.12).

        A path with coupling is the path without, from the same initial position, velocity and acceleration,
        plus `coupling @ c`.
        """
        total = self.held.copy()
        total[:, 0] -= self.state[:, 2] / (ALPHA * BETA)
        return total


@lru_cache(maxsize=16)
def responses(samples: int, step: float) -> Responses:
    """Responses of the transformation system, from the powers of its exact step.

    Held terms act through c_k -> x_t = (A^(t-k-1) b)_x, a lower-triangular Toeplitz matrix.

    Args:
        samples: number of samples T from the start.
        step: sampling interval / tau, dimensionless; 1 / (2 (T - 1)) for a whole movement.

    Returns:
        Responses of T samples.
    """
    matrix = step_matrix(step)
    state = np.empty((samples, 3))
    row = np.array([1.0, 0.0, 0.0])
    for k in range(samples):  # row k of A^t that yields x
        state[k] = row
        row = row @ matrix[:, :3]
    impulses = np.zeros((samples, 2))  # one step later: of a held value, of a change over the step
    impulses[1:] = state[:-1] @ matrix[:, 3:]
    held, change = (toeplitz(impulse, np.zeros(samples)) for impulse in impulses.T)
    forcing = held - change  # change of step k: f_(k+1) - f_k
    forcing[:, 1:] += change[:, :-1]
    for values in (state, forcing, held):
        values.flags.writeable = False
    return Responses(state, forcing, held)


def unroll(
    start: torch.Tensor,
    goal: torch.Tensor,
    forcing: torch.Tensor,
    coupling: torch.Tensor,
    dt: float,
    tau: float,
    velocity: torch.Tensor | float = 0.0,
    acceleration: torch.Tensor | float = 0.0,
) -> torch.Tensor:
    """Path of a batch of transformation systems, differentiable in all tensors (eq. IV.1, IV.10, IV.12).

    The same path as `primitives.transformation.unroll`; the coupling term is given beforehand.

    Args:
        start: (B, D) initial position.
        goal: (B, D) steady goal G.
        forcing: (B, T, D) forcing term at the samples.
        coupling: (B, T, D) coupling term, held over each step.
        dt: sampling interval in s.
        tau: time constant in s, common to the batch.
        velocity: (B, D) initial velocity.
        acceleration: (B, D) initial acceleration; it sets the initial goal.

    Returns:
        (B, T, D) position.
    """
    system = responses(forcing.shape[-2], dt / tau)
    first = initial_goal(start, velocity, acceleration, tau, forcing[..., 0, :] + coupling[..., 0, :])
    rate = tau * velocity + torch.zeros_like(start)
    state = torch.stack([start - goal, rate, first - goal], dim=-2)  # (B, 3, D)
    driven = _like(system.forcing, forcing) @ forcing + _like(system.held, coupling) @ coupling
    return goal[..., None, :] + _like(system.state, state) @ state + driven


def _like(values: np.ndarray, tensor: torch.Tensor) -> torch.Tensor:
    """A constant array as a tensor of another one's type."""
    return torch.tensor(values, dtype=tensor.dtype)
