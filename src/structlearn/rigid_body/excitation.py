"""Whether a motion is rich enough to learn a robot's dynamics from it."""

import numpy as np

from structlearn.rigid_body.base_parameters import base_parameters
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import torque_regressor
from structlearn.rigid_body.tree import KinematicTree

MOST_SAMPLES = 3000
"""Of a motion whose regressor is looked at, evenly spread: more would change its third digit."""


def base_condition(tree: KinematicTree, motion: Motion) -> float:
    """Condition number of the regressor of the base parameters, stacked over a motion, in SI units.

    It bounds by how much errors of the torques grow on their way to the parameters; below 100 counts as well
    excited (Gautier and Khalil 1992). Columns are not scaled: a joint that hardly moves must show.

    Args:
        tree: n joints.
        motion: of these joints, in the tree's order.

    Returns:
        At least 1; infinite where a parameter has no effect on any torque, or there are fewer torques than
        parameters.
    """
    part = motion.part(np.unique(np.linspace(0, len(motion) - 1, MOST_SAMPLES).round().astype(int)))
    columns = base_parameters(tree).columns
    stacked = torque_regressor(tree, part.q, part.qd, part.qdd).reshape(part.q.size, -1)[:, columns]
    if len(stacked) < len(columns):
        return float("inf")
    values = np.linalg.svd(stacked, compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > 0.0 else float("inf")
