"""Kinematic tree and link inertias of a robot, read from its URDF.

Pinocchio reads the file and merges links at fixed joints; what comes out are plain arrays, so that torch and
numba need no Pinocchio. Joint i moves link i; the joint frame is fixed to the link; `rotation` and
`translation` are its pose in the frame of the parent joint at zero position.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

import numpy as np
import pinocchio

from structlearn.core.errors import InputError
from structlearn.rigid_body.urdf import check_urdf

if TYPE_CHECKING:
    from torch import Tensor

Array = TypeVar("Array", np.ndarray, "Tensor")


@dataclass(frozen=True)
class KinematicTree:
    """Kinematics of a robot: n joints, each after its parent."""

    names: tuple[str, ...]  # of the joints
    parents: np.ndarray  # (n,) index of the parent joint, smaller than the joint's; -1 for the base
    rotation: np.ndarray  # (n, 3, 3) joint frame in the parent's at position zero
    translation: np.ndarray  # (n, 3) m, its origin in the parent's frame
    axis: np.ndarray  # (n, 3) unit vector, in the joint frame
    prismatic: np.ndarray  # (n,) bool; the others turn
    lower: np.ndarray  # (n,) rad or m; -inf for continuous joints
    upper: np.ndarray  # (n,) rad or m; inf for continuous joints
    velocity: np.ndarray  # (n,) limit in rad/s or m/s
    gravity: np.ndarray  # (3,) m/s^2, acceleration of free fall in the base frame

    @property
    def ranges(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper limits (n,); a joint without limits turns half a circle either way."""
        limits = ((self.lower, -np.pi), (self.upper, np.pi))
        lower, upper = (np.where(np.isfinite(limit), limit, other) for limit, other in limits)
        return lower, upper


class Chain(NamedTuple):
    """A kinematic tree for compiled functions; fields are `KinematicTree`'s."""

    parents: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray
    axis: np.ndarray
    prismatic: np.ndarray
    gravity: np.ndarray

    @classmethod
    def of(cls, tree: KinematicTree) -> "Chain":
        """Contiguous arrays of a tree."""
        kinds = (np.int64, float, float, float, bool, float)
        pairs = zip(cls._fields, kinds, strict=True)
        return cls(*(np.ascontiguousarray(getattr(tree, name), dtype=kind) for name, kind in pairs))


@dataclass(frozen=True)
class LinkInertias(Generic[Array]):
    """Inertial parameters of n links in their joint frames; arrays or tensors, leading axes are models."""

    mass: Array  # (..., n) kg
    first_moment: Array  # (..., n, 3) kg m, mass times centre of mass
    inertia: Array  # (..., n, 3, 3) kg m^2, about the centre of mass, axes of the joint frame

    def of(self, model: int) -> "LinkInertias[np.ndarray]":
        """Those of one model."""
        return LinkInertias(*(np.asarray(its[model]) for its in (self.mass, self.first_moment, self.inertia)))

    def tensors(self) -> "LinkInertias[Tensor]":
        """The same as float64 tensors."""
        import torch  # two seconds, which only those who learn need

        fields = (self.mass, self.first_moment, self.inertia)
        return LinkInertias(*(torch.as_tensor(field, dtype=torch.float64) for field in fields))

    def arrays(self) -> "LinkInertias[np.ndarray]":
        """The same as float64 arrays, cut off from any gradient."""
        import torch

        fields = (torch.as_tensor(field) for field in (self.mass, self.first_moment, self.inertia))
        return LinkInertias(*(field.detach().double().numpy() for field in fields))


@dataclass(frozen=True)
class Robot:
    """A robot as its URDF describes it."""

    name: str
    tree: KinematicTree
    inertias: LinkInertias[np.ndarray]  # of the moving links, with everything that is fixed to them
    model: pinocchio.Model  # with the same joints in the same order


def read_urdf(path: str | Path, locked: Sequence[str] = ()) -> Robot:
    """Read a robot with a fixed base from its URDF.

    Args:
        path: the URDF file; meshes are not read.
        locked: names of joints held at zero position, e.g. a gripper's fingers; they leave the tree and their
            links become part of the links that carry them.

    Raises:
        InputError: the file is missing or unreadable, a locked joint is unknown, a joint is of a kind other
            than revolute, continuous or prismatic, limits are absent or crossed, or a moving link has no
            positive mass or no positive definite inertia; the message names file and joint.
    """
    model = read_model(path, locked)
    robot = robot_of(model)
    _check_inertias(robot, path)
    return robot


def read_model(path: str | Path, locked: Sequence[str] = ()) -> pinocchio.Model:
    """Pinocchio's model of a robot with a fixed base; its links need neither mass nor inertia.

    Raises InputError as `read_urdf` does, but for masses and inertias.
    """
    check_urdf(path, locked)
    try:
        model = pinocchio.buildModelFromUrdf(str(path))
    except ValueError as error:
        raise InputError(f"{path}: not a valid URDF model; its parser has printed why") from error
    if locked:
        joints = [model.getJointId(name) for name in locked]
        model = pinocchio.buildReducedModel(model, joints, pinocchio.neutral(model))
    if model.nv == 0:
        raise InputError(f"{path}: the robot has no joint that moves")
    return model


def robot_of(model: pinocchio.Model) -> Robot:
    """A robot with a fixed base from Pinocchio's model of it."""
    return Robot(model.name, _tree(model), _inertias(model), model)


def configuration(model: pinocchio.Model, joints: np.ndarray) -> np.ndarray:
    """Pinocchio's configuration of joints (n,): continuous ones are a cosine and a sine there."""
    return pinocchio.integrate(model, pinocchio.neutral(model), joints)


def joint_order(tree: KinematicTree, names: Sequence[str], source: str | Path) -> np.ndarray:
    """Columns of a log in the order of the robot's joints: `log[:, order]`; other joints are left out.

    Raises InputError, which names `source`: a joint of the robot is missing from the log, or is there twice.
    """
    names = list(names)
    if missing := [name for name in tree.names if name not in names]:
        raise InputError(
            f"{source}: the log lacks the robot's joints {', '.join(missing)}; it has {', '.join(names)}"
        )
    for name in tree.names:
        if (count := names.count(name)) > 1:
            raise InputError(f"{source}: joint '{name}' stands {count} times in the log")
    return np.array([names.index(name) for name in tree.names])


def _tree(model: pinocchio.Model) -> KinematicTree:
    joints = range(1, model.njoints)
    placements = [model.jointPlacements[joint] for joint in joints]
    screws = _screws(model)
    bounded = np.array([model.joints[joint].nq == 1 for joint in joints])  # continuous ones have cos and sin
    positions = [model.joints[joint].idx_q for joint in joints]
    prismatic = np.any(screws[:, :3] != 0.0, axis=1)
    return KinematicTree(
        names=tuple(model.names)[1:],
        parents=np.array([model.parents[joint] - 1 for joint in joints]),
        rotation=np.array([placement.rotation for placement in placements]),
        translation=np.array([placement.translation for placement in placements]),
        axis=np.where(prismatic[:, None], screws[:, :3], screws[:, 3:]),
        prismatic=prismatic,
        lower=np.where(bounded, model.lowerPositionLimit[positions], -np.inf),
        upper=np.where(bounded, model.upperPositionLimit[positions], np.inf),
        velocity=model.velocityLimit.copy(),
        gravity=model.gravity.linear.copy(),
    )


def _screws(model: pinocchio.Model) -> np.ndarray:
    """Twist (n, 6) of each link in its own frame for unit speed of its joint: linear, angular."""
    data = model.createData()
    pinocchio.computeJointJacobians(model, data, pinocchio.neutral(model))
    local, joints = pinocchio.ReferenceFrame.LOCAL, range(1, model.njoints)
    jacobians = [pinocchio.getJointJacobian(model, data, joint, local) for joint in joints]
    # Pinocchio gives a vector where there is one joint only
    return np.array([jacobian.reshape(6, -1)[:, joint] for joint, jacobian in enumerate(jacobians)])


def _inertias(model: pinocchio.Model) -> LinkInertias[np.ndarray]:
    links = list(model.inertias)[1:]
    mass = np.array([link.mass for link in links])
    return LinkInertias(
        mass=mass,
        first_moment=mass[:, None] * np.array([link.lever for link in links]),
        inertia=np.array([link.inertia for link in links]),
    )


def _check_inertias(robot: Robot, path: str | Path) -> None:
    """Links as Pinocchio merged them at fixed joints must have mass and inertia.

    Moments that no body has are so common in makers' files that they only cause a warning.
    """
    moments = np.linalg.eigvalsh(robot.inertias.inertia)
    for name, mass, moment in zip(robot.tree.names, robot.inertias.mass, moments[:, 0], strict=True):
        if mass <= 0.0:
            raise InputError(
                f"{path}: the link that joint '{name}' moves has no mass: <inertial> is absent or zero"
            )
        if moment <= 0.0:
            raise InputError(
                f"{path}: the link that joint '{name}' moves has no positive definite inertia "
                f"(least principal moment {moment:g} kg m^2)"
            )
    excess = moments[:, 2] / (moments[:, 0] + moments[:, 1]) - 1.0
    if (excess > 1e-6).any():
        links = ", ".join(f"'{robot.tree.names[place]}'" for place in np.flatnonzero(excess > 1e-6))
        warnings.warn(
            f"{path}: no body has the inertia of what moves with {links}: the largest principal moment "
            f"exceeds the sum of both others, by up to {100 * excess.max():.2g} %",
            stacklevel=3,
        )
