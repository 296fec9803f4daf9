"""Inverse dynamics as a matrix product: tau = Y(q, qd, qdd) theta.

Torques are linear in mass, first moment and rotational inertia about the JOINT origin. With fixed kinematics,
Y of a data set is computed once, and training needs autograd only through the parameterisation
(`inertia_parameters`). A non-symmetric inertia (nostr) has nine columns, one per entry.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from structlearn.core.compilation import cross, numba
from structlearn.rigid_body.friction import FrictionTerm, friction_regressor
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.tree import KinematicTree, LinkInertias, RobotArrays, robot_arrays

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
    columns = SYMMETRIC_COLUMNS if symmetric else FULL_COLUMNS
    regressor = np.zeros((*q.shape, len(tree.names), columns))
    q, qd, qdd = (np.ascontiguousarray(values, dtype=np.float64) for values in (q, qd, qdd))
    links = len(tree.names)
    any_inertias = LinkInertias(np.ones(links), np.zeros((links, 3)), np.zeros((links, 3, 3)))
    _fill(robot_arrays(tree, any_inertias), q, qd, qdd, regressor)
    return regressor.reshape(*q.shape, len(tree.names) * columns)


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


class _Motion(NamedTuple):
    """Motion of all links in one sample, at their origins and in their axes."""

    velocity: np.ndarray  # (n, 3) angular
    acceleration: np.ndarray  # (n, 3) angular
    linear: np.ndarray  # (n, 3) acceleration of the origin minus gravity
    turning: np.ndarray  # (n, n, 3) [link, joint]: the link's angular velocity for unit speed of the joint
    sliding: np.ndarray  # (n, n, 3) [link, joint]: velocity of the link's origin then


@numba.njit(cache=True)
def _fill(robot: RobotArrays, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, regressor: np.ndarray) -> None:
    """Fill a regressor of zeros (B, n, n, columns).

    By virtual work, the torque of joint i is the wrench of every link beyond it times the twist (v, w) that
    unit speed of joint i gives that link, both at the link's origin, where the wrench is

        f = m a + dw x h + w x (w x h)        n = h x a + I dw + w x (I w)
    """
    batch, joints = q.shape
    square, cube = (joints, 3), (joints, joints, 3)
    motion = _Motion(np.empty(square), np.empty(square), np.empty(square), np.empty(cube), np.empty(cube))
    for sample in range(batch):
        for link in range(joints):
            _move(robot, motion, link, q[sample, link], qd[sample, link], qdd[sample, link])
            joint = link
            while joint >= 0:
                _fill_columns(motion, link, joint, regressor, sample)
                joint = robot.parents[joint]


@numba.njit(cache=True, inline="always")
def _move(
    robot: RobotArrays, motion: _Motion, link: int, position: float, speed: float, change: float
) -> None:
    """Motion of a link from the motion of its parent."""
    parent = robot.parents[link]
    axis, slides = _vector(robot.axis[link]), robot.prismatic[link]
    rotation, origin = _placement(robot, link, position)
    if parent < 0:
        velocity = acceleration = (0.0, 0.0, 0.0)
        linear = _rotated_back(rotation, _scaled(_vector(robot.gravity), -1.0))
    else:
        velocity, acceleration = _vector(motion.velocity[parent]), _vector(motion.acceleration[parent])
        linear = _sum(_vector(motion.linear[parent]), cross(acceleration, origin))
        linear = _rotated_back(rotation, _sum(linear, cross(velocity, cross(velocity, origin))))
        velocity, acceleration = _rotated_back(rotation, velocity), _rotated_back(rotation, acceleration)
        joint = parent
        while joint >= 0:
            turning = _vector(motion.turning[parent, joint])
            sliding = _sum(_vector(motion.sliding[parent, joint]), cross(turning, origin))
            _store(motion.turning[link, joint], _rotated_back(rotation, turning))
            _store(motion.sliding[link, joint], _rotated_back(rotation, sliding))
            joint = robot.parents[joint]
    own, turned = _scaled(axis, change), cross(velocity, _scaled(axis, speed))
    if slides:
        linear = _sum(linear, _sum(own, _scaled(turned, 2.0)))
    else:
        acceleration = _sum(acceleration, _sum(own, turned))
        velocity = _sum(velocity, _scaled(axis, speed))
    _store(motion.velocity[link], velocity)
    _store(motion.acceleration[link], acceleration)
    _store(motion.linear[link], linear)
    _store(motion.turning[link, link], _scaled(axis, 0.0 if slides else 1.0))
    _store(motion.sliding[link, link], _scaled(axis, 1.0 if slides else 0.0))


@numba.njit(cache=True, inline="always")
def _placement(robot: RobotArrays, joint: int, position: float) -> tuple[tuple, tuple]:
    """Rows of a joint frame's rotation in its parent's frame, and its origin there."""
    axis, origin = _vector(robot.axis[joint]), _vector(robot.translation[joint])
    rotation = robot.rotation[joint]
    x, y, z = _vector(rotation[0]), _vector(rotation[1]), _vector(rotation[2])
    if robot.prismatic[joint]:
        along = (_dot(x, axis), _dot(y, axis), _dot(z, axis))
        return (x, y, z), _sum(origin, _scaled(along, position))
    s, c = np.sin(position), np.cos(position)
    return (_turned(x, axis, s, c), _turned(y, axis, s, c), _turned(z, axis, s, c)), origin


@numba.njit(cache=True, inline="always")
def _turned(row: tuple, axis: tuple, sine: float, cosine: float) -> tuple:
    """Rodrigues' formula for one row of a rotation matrix, for a turn about the axis by minus the angle."""
    along = _scaled(axis, (1.0 - cosine) * _dot(row, axis))
    return _sum(_scaled(row, cosine), _sum(along, _scaled(cross(row, axis), sine)))


@numba.njit(cache=True, inline="always")
def _fill_columns(motion: _Motion, link: int, joint: int, regressor: np.ndarray, sample: int) -> None:
    """Torque of a joint per unit of each parameter of one link."""
    wx, wy, wz = w = _vector(motion.velocity[link])
    dx, dy, dz = _vector(motion.acceleration[link])
    ax, ay, az = _vector(motion.linear[link])
    tx, ty, tz = t = _vector(motion.turning[link, joint])
    sx, sy, sz = _vector(motion.sliding[link, joint])
    cx, cy, cz = cross(t, w)
    columns = regressor[sample, joint, link]
    columns[0] = sx * ax + sy * ay + sz * az
    # f and n are linear in h: s . (dw x h + w x (w x h)) + t . (h x a)
    columns[1] = -sx * (wy * wy + wz * wz) + sy * (wx * wy + dz) + sz * (wx * wz - dy) + ay * tz - az * ty
    columns[2] = sx * (wx * wy - dz) - sy * (wx * wx + wz * wz) + sz * (wy * wz + dx) + az * tx - ax * tz
    columns[3] = sx * (wx * wz + dy) + sy * (wy * wz - dx) - sz * (wx * wx + wy * wy) + ax * ty - ay * tx
    # t . (I dw + w x (I w)) = t^T I dw + (t x w)^T I w
    xx, xy, xz = tx * dx + cx * wx, tx * dy + cx * wy, tx * dz + cx * wz
    yx, yy, yz = ty * dx + cy * wx, ty * dy + cy * wy, ty * dz + cy * wz
    zx, zy, zz = tz * dx + cz * wx, tz * dy + cz * wy, tz * dz + cz * wz
    if columns.size == SYMMETRIC_COLUMNS:
        columns[4], columns[5], columns[6] = xx, xy + yx, xz + zx
        columns[7], columns[8], columns[9] = yy, yz + zy, zz
    else:
        columns[4], columns[5], columns[6] = xx, xy, xz
        columns[7], columns[8], columns[9] = yx, yy, yz
        columns[10], columns[11], columns[12] = zx, zy, zz


# Vectors are tuples below: numba keeps them in registers, whereas each array would cost an allocation.


@numba.njit(cache=True, inline="always")
def _vector(values: np.ndarray) -> tuple:
    return values[0], values[1], values[2]


@numba.njit(cache=True, inline="always")
def _store(target: np.ndarray, vector: tuple) -> None:
    target[0], target[1], target[2] = vector


@numba.njit(cache=True, inline="always")
def _sum(left: tuple, right: tuple) -> tuple:
    return left[0] + right[0], left[1] + right[1], left[2] + right[2]


@numba.njit(cache=True, inline="always")
def _scaled(vector: tuple, factor: float) -> tuple:
    return factor * vector[0], factor * vector[1], factor * vector[2]


@numba.njit(cache=True, inline="always")
def _dot(left: tuple, right: tuple) -> float:
    return left[0] * right[0] + left[1] * right[1] + left[2] * right[2]


@numba.njit(cache=True, inline="always")
def _rotated_back(rows: tuple, vector: tuple) -> tuple:
    """R^T v, from the three rows of a rotation R."""
    x, y = _scaled(rows[0], vector[0]), _scaled(rows[1], vector[1])
    return _sum(_sum(x, y), _scaled(rows[2], vector[2]))


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
