"""Kinematic tree and link inertias of a robot, read from its URDF.

Pinocchio reads the file and merges links at fixed joints; the results are plain arrays, so that torch and
numba code need no Pinocchio. Joint i moves link i, and its frame is fixed to that link; `rotation` and
`translation` are its pose in the parent joint's frame at position zero.
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
    """Kinematics of a robot with n joints, each listed after its parent."""

    names: tuple[str, ...]  # joint names
    parents: np.ndarray  # (n,) index of the parent joint, smaller than the joint's; -1 for the base
    rotation: np.ndarray  # (n, 3, 3) joint frame in the parent's at position zero
    translation: np.ndarray  # (n, 3) m, origin of the joint frame in the parent's
    axis: np.ndarray  # (n, 3) unit vector, in the joint frame
    prismatic: np.ndarray  # (n,) bool; False: revolute or continuous
    lower: np.ndarray  # (n,) rad or m; -inf for continuous joints
    upper: np.ndarray  # (n,) rad or m; inf for continuous joints
    velocity: np.ndarray  # (n,) limit in rad/s or m/s
    gravity: np.ndarray  # (3,) m/s^2, gravitational acceleration in the base frame

    @property
    def ranges(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper limits (n,); -pi and pi for joints without limits."""
        limits = ((self.lower, -np.pi), (self.upper, np.pi))
        lower, upper = (np.where(np.isfinite(limit), limit, other) for limit, other in limits)
        return lower, upper


class Chain(NamedTuple):
    """A kinematic tree for compiled functions; fields are those of `KinematicTree`."""

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
    """Inertial parameters of n links in their joint frames; leading axes, if any, are models."""

    mass: Array  # (..., n) kg
    first_moment: Array  # (..., n, 3) kg m, mass times centre of mass
    inertia: Array  # (..., n, 3, 3) kg m^2, about the centre of mass, axes of the joint frame

    def of(self, model: int) -> "LinkInertias[np.ndarray]":
        """Inertias of one model."""
        return LinkInertias(*(np.asarray(its[model]) for its in (self.mass, self.first_moment, self.inertia)))

    def tensors(self) -> "LinkInertias[Tensor]":
        """The same as float64 tensors."""
        import torch  # takes two seconds, and is only needed for learning

        fields = (self.mass, self.first_moment, self.inertia)
        return LinkInertias(*(torch.as_tensor(field, dtype=torch.float64) for field in fields))

    def arrays(self) -> "LinkInertias[np.ndarray]":
        """The same as float64 arrays, detached."""
        import torch

        fields = (torch.as_tensor(field) for field in (self.mass, self.first_moment, self.inertia))
        return LinkInertias(*(field.detach().double().numpy() for field in fields))


@dataclass(frozen=True)
class Robot:
    """A robot as described by its URDF."""

    name: str
    tree: KinematicTree
    inertias: LinkInertias[np.ndarray]  # of the moving links, including whatever is fixed to them
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

    Raises InputError as `read_urdf` does, except for masses and inertias.
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
    """Tree and inertias of a fixed-base robot, from Pinocchio's model."""
    return Robot(model.name, _tree(model), _inertias(model), model)


def configuration(model: pinocchio.Model, joints: np.ndarray) -> np.ndarray:
    """Pinocchio's configuration vector for joints (n,), in which continuous joints are cosine and sine."""
    return pinocchio.integrate(model, pinocchio.neutral(model), joints)


def joint_order(tree: KinematicTree, names: Sequence[str], source: str | Path) -> np.ndarray:
    """Indices that sort a log's columns into the robot's joint order, `log[:, order]`; others are dropped.

    Raises InputError naming `source`: a joint of the robot is missing from the log, or appears twice.
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
    bounded = np.array([model.joints[joint].nq == 1 for joint in joints])  # continuous: cosine and sine
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
    # Pinocchio returns a vector for a single joint
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
    """Check that every link, after merging at fixed joints, has mass and positive definite inertia.

    Inconsistent principal moments are so common in manufacturers' files that they only cause a warning.
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
