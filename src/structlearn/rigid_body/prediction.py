"""Torques that models predict for a motion."""

import numpy as np
import torch

from structlearn.rigid_body.friction import friction_columns
from structlearn.rigid_body.model_files import DynamicsModels
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import link_parameters, torque_regressor
from structlearn.rigid_body.tree import KinematicTree, LinkInertias


def rigid_body_torques(tree: KinematicTree, inertias: LinkInertias, motion: Motion) -> np.ndarray:
    """Torques (M, N, n) of inertias with mass (M, n), or (N, n) of mass (n,), without friction."""
    columns = torque_regressor(tree, motion.q, motion.qd, motion.qdd, symmetric=False)
    theta = link_parameters(inertias.tensors(), symmetric=False).numpy()
    return np.moveaxis(columns @ theta.T, -1, 0) if theta.ndim == 2 else columns @ theta


def predicted_torques(models: DynamicsModels, tree: KinematicTree, motion: Motion) -> np.ndarray:
    """Torques (M, N, n) in N m of M learned models on a motion, friction included.

    Args:
        models: of the robot.
        tree: the robot.
        motion: whose torques are not looked at.
    """
    if models.structured:
        torques = rigid_body_torques(tree, models.inertias(), motion)
    else:
        states = (
            torch.tensor(np.ascontiguousarray(values.T), dtype=torch.float32)
            for values in (motion.q, motion.qd, motion.qdd)
        )
        with torch.no_grad():
            torques = np.swapaxes(models.networks().torques(*states).double().numpy(), 1, 2)
    if models.friction:
        columns = friction_columns(motion.qd, models.friction)
        torques = torques + np.einsum("njt,mjt->mnj", columns, models.friction_coefficients())
    return torques
