"""Inverse dynamics by the recursive Newton-Euler algorithm, batched and differentiable (chapter III.2).

Velocities and accelerations are propagated from the base to the tips, forces and moments back: the reference
for the regressor and the compiled recursion, of any inertias, with gradients.
"""

import numpy as np
import torch
from torch import Tensor

from structlearn.rigid_body.tree import KinematicTree, LinkInertias


def inverse_dynamics(
    tree: KinematicTree, inertias: LinkInertias[Tensor], q: Tensor, qd: Tensor, qdd: Tensor
) -> Tensor:
    """Joint torques tau = H(q) qdd + C(q, qd) qd + g(q) of a robot without friction (eq. III.1).

    States are (..., B, n) in rad, rad/s and rad/s^2 (m for sliding joints), torques (..., B, n) in N m or N.
    Leading axes of the inertias, mass (..., n), broadcast with those of the states. An inertia need not be
    symmetric: I w + w x I w uses the matrix as given.
    """
    placements = _placements(tree, q)
    axes = torch.as_tensor(tree.axis, dtype=q.dtype)
    # per link: angular velocity and acceleration, acceleration of its origin; frame
    motions: list[tuple[Tensor, Tensor, Tensor]] = []
    for joint, parent in enumerate(tree.parents):
        rotation, translation = placements[joint]
        if parent < 0:
            velocity = acceleration = q.new_zeros((*q.shape[:-1], 3))
            linear = velocity - torch.as_tensor(tree.gravity, dtype=q.dtype)  # gravity as base acceleration
        else:
            velocity, acceleration, linear = motions[parent]
        linear = linear + _cross(acceleration, translation) + _twice(velocity, translation)
        velocity, acceleration, linear = (
            _rotate(rotation.mT, vector) for vector in (velocity, acceleration, linear)
        )
        speed = qd[..., joint, None] * axes[joint]
        change = qdd[..., joint, None] * axes[joint]
        if tree.prismatic[joint]:
            linear = linear + change + 2.0 * _cross(velocity, speed)
        else:
            acceleration = acceleration + change + _cross(velocity, speed)
            velocity = velocity + speed
        motions.append((velocity, acceleration, linear))
    forces, moments = _wrenches(
        inertias, *(torch.stack(parts, dim=-2) for parts in zip(*motions, strict=True))
    )
    return _projected(tree, placements, axes, list(forces.unbind(-2)), list(moments.unbind(-2)))


def _placements(tree: KinematicTree, q: Tensor) -> list[tuple[Tensor, Tensor]]:
    """Rotation (..., 3, 3) and origin (..., 3) of each joint frame in its parent's frame."""
    placements = []
    for joint, axis in enumerate(tree.axis):
        rotation = torch.as_tensor(tree.rotation[joint], dtype=q.dtype)
        translation = torch.as_tensor(tree.translation[joint], dtype=q.dtype)
        position = q[..., joint, None]
        if tree.prismatic[joint]:
            along = torch.as_tensor(tree.rotation[joint] @ axis, dtype=q.dtype)
            placements.append((rotation, translation + position * along))
        else:
            skew = torch.as_tensor(np.cross(np.eye(3), axis), dtype=q.dtype)
            sine, cosine = position.sin()[..., None], position.cos()[..., None]
            turn = torch.eye(3, dtype=q.dtype) + sine * skew + (1.0 - cosine) * (skew @ skew)
            placements.append((rotation @ turn, translation))
    return placements


def _wrenches(
    inertias: LinkInertias[Tensor], velocity: Tensor, acceleration: Tensor, linear: Tensor
) -> tuple[Tensor, Tensor]:
    """Net forces and moments about the joint origins for the links' motion, (..., B, n, 3) each."""
    mass = inertias.mass[..., None, :, None]
    first_moment = inertias.first_moment[..., None, :, :]
    inertia = inertias.inertia[..., None, :, :, :]
    force = mass * linear + _cross(acceleration, first_moment) + _twice(velocity, first_moment)
    spin = _rotate(inertia, acceleration) + _cross(velocity, _rotate(inertia, velocity))
    return force, spin + _cross(first_moment / mass, force)


def _projected(
    tree: KinematicTree,
    placements: list[tuple[Tensor, Tensor]],
    axes: Tensor,
    forces: list[Tensor],
    moments: list[Tensor],
) -> Tensor:
    """Torques (..., B, n): each joint bears its link and all links beyond."""
    torques = [forces[0]] * len(axes)
    for joint in reversed(range(len(axes))):
        force, moment = forces[joint], moments[joint]
        torques[joint] = (force if tree.prismatic[joint] else moment) @ axes[joint]
        parent = tree.parents[joint]
        if parent >= 0:
            rotation, translation = placements[joint]
            force = _rotate(rotation, force)
            forces[parent] = forces[parent] + force
            moments[parent] = moments[parent] + _rotate(rotation, moment) + _cross(translation, force)
    return torch.stack(torques, dim=-1)


def _rotate(matrix: Tensor, vector: Tensor) -> Tensor:
    return (matrix @ vector[..., None])[..., 0]


def _cross(left: Tensor, right: Tensor) -> Tensor:
    return torch.linalg.cross(*torch.broadcast_tensors(left, right))


def _twice(velocity: Tensor, vector: Tensor) -> Tensor:
    """Centripetal part w x (w x r)."""
    return _cross(velocity, _cross(velocity, vector))
