"""Forward dynamics: accelerations that joint torques cause.

    qdd = H(q)^-1 (tau - C(q, qd) qd - g(q))

H comes column by column from the inverse dynamics of unit accelerations, all columns as one batch; so it
holds for whatever the inverse dynamics holds for, and it is differentiable.
"""

from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from structlearn.rigid_body.newton_euler import inverse_dynamics
from structlearn.rigid_body.tree import KinematicTree, LinkInertias


def mass_matrix(tree: KinematicTree, inertias: LinkInertias[Tensor], q: Tensor) -> Tensor:
    """Joint-space inertia H(q).

    Args:
        tree: n joints.
        inertias: mass (..., n).
        q: (..., B, n) rad or m.

    Returns:
        (..., B, n, n) kg m^2 where both joints turn; symmetric if the inertias are.
    """
    joints = len(tree.names)
    weightless = replace(tree, gravity=np.zeros(3))
    states = q.repeat_interleave(joints, dim=-2)  # (..., B n, n): each state with every unit acceleration
    accelerations = torch.eye(joints, dtype=q.dtype).repeat(q.shape[-2], 1).expand_as(states)
    columns = inverse_dynamics(weightless, inertias, states, torch.zeros_like(states), accelerations)
    return columns.unflatten(-2, (q.shape[-2], joints)).mT


def forward_dynamics(
    tree: KinematicTree, inertias: LinkInertias[Tensor], q: Tensor, qd: Tensor, torques: Tensor
) -> Tensor:
    """Joint accelerations under given torques (without friction).

    Args:
        tree: n joints.
        inertias: mass (..., n).
        q: (..., B, n) rad or m.
        qd: (..., B, n) rad/s or m/s.
        torques: (..., B, n) N m or N.

    Returns:
        (..., B, n) rad/s^2 or m/s^2.
    """
    bias = inverse_dynamics(tree, inertias, q, qd, torch.zeros_like(q))
    return torch.linalg.solve(mass_matrix(tree, inertias, q), torques - bias)
