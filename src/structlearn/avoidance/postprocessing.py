"""What is done to a network's coupling term before it acts (IV.8.2, eq. IV.33 ff.).

    x component      0: along the reach an avoiding movement is the baseline
    past obstacle    c exp(-k (x - x_last)^2)    where x > x_last
    beyond goal      0                           where x_goal < x_first

x_first and x_last are the smallest and largest x of the obstacle's points. The text prints the obstacle's x
for both, and no k; the author's code has the points and k = 10 1/m^2, and so it is here.

These rules alone do not bring the movement to its goal. A coupling term of 1 holds it 6.4 mm off, 1 / (alpha
beta), networks ask for tens, and past an obstacle close to the goal, or level with it, hardly anything fades.
So the deviation is limited too (`goal_reach`).
"""

import numpy as np
from pydantic import Field

from structlearn.ground.params import Parameters


class PostprocessingParameters(Parameters):
    """What acts of a model's coupling term. Fields: `params.yaml`, `obstacle_evaluation.postprocessing`."""

    passed_decay_per_m2: float = Field(ge=0)
    end_limit_m: float | None = Field(gt=0)
    late_limit_m: float | None = Field(gt=0)
    late_factor: float = Field(gt=1)
    return_coupling: float = Field(ge=0)


PUBLISHED_DECAY_PER_M2 = 10.0
"""k of the dissertation in 1/m^2."""

TEXT_ONLY = PostprocessingParameters(
    passed_decay_per_m2=PUBLISHED_DECAY_PER_M2,
    end_limit_m=None,
    late_limit_m=None,
    late_factor=1.5,
    return_coupling=20.0,
)
"""The dissertation's rules and nothing else."""


def post_processed(
    coupling: np.ndarray,
    x: np.ndarray,
    first_x: np.ndarray,
    last_x: np.ndarray,
    goal_x: np.ndarray,
    passed_decay_per_m2: float,
) -> np.ndarray:
    """Coupling term after the rules above, in the local frame.

    Args:
        coupling: (..., 3) output of the model.
        x: (...) of the end-effector in m.
        first_x: (...) smallest x of the obstacle's points in m.
        last_x: (...) largest x of the obstacle's points in m.
        goal_x: (...) m.
        passed_decay_per_m2: k in 1/m^2.

    Returns:
        (..., 3) coupling term, never longer than what came in.
    """
    passed = np.maximum(np.subtract(x, last_x), 0.0)
    factor = np.where(np.less(goal_x, first_x), 0.0, np.exp(-passed_decay_per_m2 * passed**2))
    return coupling * factor[..., None] * (0.0, 1.0, 1.0)
