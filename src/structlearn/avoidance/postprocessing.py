"""Postprocessing of a network's coupling term (IV.8.2, eq. IV.26, IV.33 and IV.34).

    x component      0: along the reach an avoiding movement is the baseline
    past obstacle    c exp(-k (x - x_last)^2)    where x > x_last
    beyond goal      0                           where x_goal < x_first

x_first and x_last are the smallest and largest x of the obstacle's points. The text prints the obstacle's x
for both, and no k; here, as in the author's code, they are those of the points, and k = 10 1/m^2.

These rules alone do not bring the movement to its goal. A coupling term of 1 shifts it by 6.4 mm, 1 / (alpha
beta), networks output tens, and past an obstacle close to the goal, or level with it, the term hardly fades.
So the deviation is limited too (`GoalReach`). The transformation system is linear, so a coupled movement is
the baseline plus a deviation y = (dx, tau dv) driven by the coupling term alone. The term is held over a
step, so the step is exact (`primitives.transformation`):

    y_{k+1} = A y_k + b c_k          D_k = first row of A^(n - k) y_k          D_{k+1} = D_k + g_k c_k

D_k is the deviation that will remain at sample n, the deadline, if no coupling acts from now on. A coupling
term of length r pointing straight back reduces it by r (g_k + ... + g_{n-1}), hence a movement can still be
brought back within the limit as long as

    |D_k| <= limit + r (g_k + ... + g_{n-1})

The model's coupling term is applied unless it would violate this; then the nearest term that does not is. So
the limit holds at the deadline for any model and any motion of the goal, on which the deviation does not
depend. And a movement may deviate as far as a modest coupling term can undo, not only as far as the
primitive's own attraction can, which detours around an obstacle close to the goal need.

After the first deadline the movement is over, and only corrections that a later limit needs are applied.
Otherwise a model that still sees its obstacle would drive the hand off its goal again.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from pydantic import Field

from structlearn.core.params import Parameters
from structlearn.primitives.transformation import step_matrix


class PostprocessingParameters(Parameters):
    """Limits on a model's coupling term. Fields: `params.yaml`, `obstacle_evaluation.postprocessing`."""

    passed_decay_per_m2: float = Field(ge=0)
    end_limit_m: float | None = Field(gt=0)
    late_limit_m: float | None = Field(gt=0)
    late_factor: float = Field(gt=1)
    return_coupling: float = Field(ge=0)


PUBLISHED_ONLY = PostprocessingParameters(
    passed_decay_per_m2=10.0, end_limit_m=None, late_limit_m=None, late_factor=1.5, return_coupling=20.0
)
"""The dissertation's rules only."""


def post_processed(
    coupling: np.ndarray,
    x: np.ndarray,
    first_x: np.ndarray,
    last_x: np.ndarray,
    goal_x: np.ndarray,
    passed_decay_per_m2: float,
) -> np.ndarray:
    """A model's coupling term (..., 3) after the rules above, in the local frame; never longer than before.

    All in m: `x` (...) of the hand, smallest and largest x (...) of the obstacle's points, `goal_x` (...).
    """
    passed = np.maximum(np.subtract(x, last_x), 0.0)
    factor = np.where(np.less(goal_x, first_x), 0.0, np.exp(-passed_decay_per_m2 * passed**2))
    return coupling * factor[..., None] * (0.0, 1.0, 1.0)


@dataclass(frozen=True)
class Deadline:
    """Largest distance from the baseline that may remain at a sample."""

    sample: int  # index n of the sample
    limit: float  # m


class GoalReach:
    """Deviation of a batch of coupled movements from their baselines, and bounds on further coupling.

    Among several deadlines, the next one counts. `batch` (B, D); `step`: dt / tau, dimensionless;
    `return_coupling`: length r of the coupling term that is assumed to bring a movement back.
    """

    def __init__(
        self, batch: tuple[int, int], step: float, deadlines: Sequence[Deadline], return_coupling: float
    ) -> None:
        self.deviation = np.zeros((2, *batch))  # (2, B, D) of the position and of tau v, both in m
        self._matrix, self._step, self._return = step_matrix(step), step, return_coupling
        self._deadlines = sorted(deadlines, key=lambda deadline: deadline.sample)

    def admissible(self, k: int, coupling: np.ndarray) -> np.ndarray:
        """Coupling term (B, D) to apply over step k: the nearest allowed one; after the end, nearest to 0."""
        following = [deadline for deadline in self._deadlines if deadline.sample > k]
        if len(following) < len(self._deadlines):
            coupling = np.zeros_like(coupling)
        if not following:
            return coupling
        rows, gains, rests = _projections(self._step, following[0].sample)
        left = np.tensordot(rows[k], self.deviation, 1) + gains[k] * coupling
        length = np.linalg.norm(left, axis=-1, keepdims=True)
        bound = following[0].limit + self._return * rests[k + 1]
        excess = np.maximum(1.0 - bound / np.maximum(length, bound), 0.0)
        return coupling - excess / gains[k] * left

    def advance(self, coupling: np.ndarray) -> None:
        """Advance by one step with the applied coupling term (B, D)."""
        self.deviation = np.tensordot(self._matrix[:2, :2], self.deviation, 1)
        self.deviation += self._matrix[:2, 3, None, None] * coupling


@lru_cache
def _projections(step: float, last: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Effect at sample n of the state and of the coupling terms at the samples before it.

    Returns `rows` (n, 2) such that D_k = rows[k] y_k; `gains` (n,) g_k; `rests` (n + 1,) g_k + ... + g_{n-1}.
    """
    matrix = step_matrix(step)
    rows, gains = np.empty((last, 2)), np.empty(last)
    row = np.array([1.0, 0.0])
    for k in reversed(range(last)):
        gains[k] = row @ matrix[:2, 3]
        row = row @ matrix[:2, :2]
        rows[k] = row
    rests = np.append(np.cumsum(gains[::-1])[::-1], 0.0)
    for values in (rows, gains, rests):
        values.flags.writeable = False
    return rows, gains, rests
