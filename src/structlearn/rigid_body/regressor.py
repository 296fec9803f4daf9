"""Inverse dynamics as a matrix product: tau = Y(q, qd, qdd) theta, with Y by Pinocchio.

Torques are linear in mass, first moment and rotational inertia about the JOINT origin. With fixed kinematics,
Y of a data set is computed once, and training needs autograd only through the parameterisation
(`inertia_parameters`). A non-symmetric inertia (nostr) has nine columns, one per entry.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor

from structlearn.rigid_body.friction import FrictionTerm, friction_regressor
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

SYMMETRIC_COLUMNS, FULL_COLUMNS = 10, 13  # per link


def torque_regressor(
    tree: KinematicTree, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, symmetric: bool = True
) -> np.ndarray:
    """Regressor Y at joint positions, velocities and accelerations, (B, n) each.

    With `symmetric`, ten columns per link: m, h (3), then xx, xy, xz, yy, yz, zz of the inertia about the
    joint origin; otherwise thirteen, with the nine entries row by row.

    Returns:
        (B, n, 10 n) or (B, n, 13 n), link after link.
    """
    model = _pinocchio_model(tree)
    data = model.createData()
    batch, joints = q.shape
    regressor = np.empty((batch, joints, joints * SYMMETRIC_COLUMNS))
    for sample, state in enumerate(zip(q, qd, qdd, strict=True)):
        regressor[sample] = pinocchio.computeJointTorqueRegressor(model, data, *state)
    regressor = regressor.reshape(batch, joints, joints, SYMMETRIC_COLUMNS)
    if symmetric:
        regressor[..., [6, 7]] = regressor[..., [7, 6]]  # Pinocchio's order is xx, xy, yy, xz, yz, zz
    else:
        regressor = np.concatenate([regressor[..., :4], _inertia_columns(tree, q, qd, qdd)], axis=-1)
    return regressor.reshape(batch, joints, -1)


def link_parameters(inertias: LinkInertias[Tensor], symmetric: bool = True) -> Tensor:
    """Theta for the columns of `torque_regressor`, from inertias with mass (..., n); differentiable.

    (..., 10 n), where only the symmetric part counts, or (..., 13 n).
    """
    mass, first_moment = inertias.mass[..., None], inertias.first_moment
    squared = first_moment.square().sum(-1)[..., None, None] * torch.eye(3, dtype=mass.dtype)
    outer = first_moment[..., :, None] * first_moment[..., None, :]
    about_origin = (inertias.inertia + (squared - outer) / mass[..., None]).flatten(-2)
    if symmetric:
        about_origin = about_origin[..., [0, 1, 2, 4, 5, 8]]
    return torch.cat([mass, first_moment, about_origin], dim=-1).flatten(-2)


@dataclass(frozen=True)
class TorqueFactors:
    """Squared torque errors on a data set as a function of theta, independent of the number of samples.

    With tau = Y theta, the squared error of joint j is |Y_j theta - tau_j|^2 = |R_j (theta, -1)|^2, where R_j
    is the triangular factor of (Y_j, tau_j), of the size of theta. Unlike the normal equations, the factor
    loses no digits.
    """

    factors: np.ndarray  # (n, P + 1, P + 1) per joint, of the regressor's columns and then the torque
    samples: int  # N
    variance: np.ndarray  # (n,) (N m)^2 of each joint's torque

    def nmse(self, parameters: np.ndarray) -> np.ndarray:
        """Mean squared error (..., n) of theta (..., P) over the torque's variance."""
        extended = np.concatenate([parameters, -np.ones_like(parameters[..., :1])], axis=-1)
        residual = np.einsum("jrp,...p->...jr", self.factors, extended, optimize=True)
        return (residual**2).sum(axis=-1) / (self.samples * self.variance)


def triangular_factor(rows: np.ndarray) -> np.ndarray:
    """R (min(N, P), P) of a QR decomposition of rows (N, P), which preserves sums of squares."""
    return np.linalg.qr(rows, mode="r")  # type: ignore[return-value]  # numpy's stub lacks this mode


def torque_factors(regressor: np.ndarray, torque: np.ndarray) -> TorqueFactors:
    """Triangular factors of a data set, regressor (N, n, P) and torques (N, n) in N m."""
    samples, joints, width = regressor.shape
    factors = np.zeros((joints, width + 1, width + 1))
    for joint in range(joints):
        columns = regressor[:, joint]
        used = np.append(np.flatnonzero(columns.any(axis=0)), width)  # skip links before the joint
        stacked = np.column_stack([columns[:, used[:-1]], torque[:, joint]])
        factor = triangular_factor(stacked)
        factors[joint, : len(factor), used] = factor.T
    return TorqueFactors(factors, samples, torque.var(axis=0))


class MotionRegressor:
    """Regressor of a motion, shared by all models that learn from it.

    Inertias are symmetric or (nostr) full; columns of friction follow those of the links.
    """

    def __init__(
        self, tree: KinematicTree, motion: Motion, symmetric: bool, friction: Sequence[FrictionTerm]
    ):
        columns = torque_regressor(tree, motion.q, motion.qd, motion.qdd, symmetric)
        if friction:
            columns = np.concatenate([columns, friction_regressor(motion.q, motion.qd, friction)], axis=-1)
        self.factors: TorqueFactors = torque_factors(columns, motion.torque)
        self.columns, self.torque = columns, motion.torque  # (N, n, P), (N, n)
        self.friction = tuple(friction)


def _pinocchio_model(tree: KinematicTree) -> pinocchio.Model:
    """Joints and gravity of a tree; continuous joints have a single coordinate."""
    model = pinocchio.Model()
    model.gravity.linear = tree.gravity
    for joint, name in enumerate(tree.names):
        kind = (
            pinocchio.JointModelPrismaticUnaligned
            if tree.prismatic[joint]
            else pinocchio.JointModelRevoluteUnaligned
        )
        placement = pinocchio.SE3(tree.rotation[joint], tree.translation[joint])
        model.addJoint(int(tree.parents[joint]) + 1, kind(tree.axis[joint]), placement, name)
    return model


def _inertia_columns(tree: KinematicTree, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Columns (B, n, n, 9) [joint, link] of the nine entries of an inertia that need not be symmetric.

    By virtual work, the torque of a joint is t . (I dw + w x I w) = t^T I dw + (t x w)^T I w, where t is the
    link's angular velocity for unit speed of the joint; w and dw are the link's, all in its axes.
    """
    batch, joints = q.shape
    columns = np.zeros((batch, joints, joints, 9))
    turns = np.zeros((joints, batch, joints, 3))  # t by link and joint
    velocity, acceleration = np.zeros((2, joints, batch, 3))
    for link, (parent, axis) in enumerate(zip(tree.parents, tree.axis, strict=True)):
        turned = np.zeros_like(q[:, link, None]) if tree.prismatic[link] else q[:, link, None]
        rotation = tree.rotation[link] @ Rotation.from_rotvec(turned * axis).as_matrix()  # (B, 3, 3)
        if parent >= 0:
            turns[link] = turns[parent] @ rotation  # R^T t
            velocity[link] = np.einsum("bi,bij->bj", velocity[parent], rotation)
            acceleration[link] = np.einsum("bi,bij->bj", acceleration[parent], rotation)
        if not tree.prismatic[link]:
            turns[link, :, link] = axis
            acceleration[link] += axis * qdd[:, link, None] + np.cross(
                velocity[link], axis * qd[:, link, None]
            )
            velocity[link] += axis * qd[:, link, None]
        w, dw = velocity[link, :, None], acceleration[link, :, None]  # (B, 1, 3)
        outer = turns[link, ..., None] * dw[..., None, :]
        outer += np.cross(turns[link], w)[..., None] * w[..., None, :]
        columns[:, :, link] = outer.reshape(batch, joints, 9)
    return columns
