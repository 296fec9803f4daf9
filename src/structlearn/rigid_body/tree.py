"""Kinematic tree and link inertias of a robot as plain arrays, which torch and numba code can use.

Joint i moves link i, and its frame is fixed to that link; `rotation` and `translation` are its pose in the
parent joint's frame at position zero. `robot.read_urdf` reads both from a file.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

import numpy as np

from structlearn.core.errors import InputError

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


@dataclass(frozen=True)
class LinkInertias(Generic[Array]):
    """Inertial parameters of n links in their joint frames; leading axes, if any, are models."""

    mass: Array  # (..., n) kg
    first_moment: Array  # (..., n, 3) kg m, mass times centre of mass
    inertia: Array  # (..., n, 3, 3) kg m^2, about the centre of mass, axes of the joint frame

    def of(self, model: int) -> "LinkInertias[np.ndarray]":
        """Inertias of one model."""
        return LinkInertias(
            *(np.asarray(part[model]) for part in (self.mass, self.first_moment, self.inertia))
        )

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


class RobotArrays(NamedTuple):
    """A robot for compiled functions; undocumented fields are those of `KinematicTree`.

    Newton-Euler needs inertias about the joint origins (`first_moment`, `origin_inertia`), the simulation
    those about the centres of mass.
    """

    parents: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray
    axis: np.ndarray
    prismatic: np.ndarray
    gravity: np.ndarray
    mass: np.ndarray  # (n,) kg
    first_moment: np.ndarray  # (n, 3) kg m, mass times centre of mass
    origin_inertia: np.ndarray  # (n, 3, 3) kg m^2, about the joint frame's origin; need not be symmetric
    centre: np.ndarray  # (n, 3) m, centre of mass in the joint frame
    inertia: np.ndarray  # (n, 3, 3) kg m^2, about the centre of mass, axes of the joint frame


def robot_arrays(tree: KinematicTree, inertias: LinkInertias) -> RobotArrays:
    """Contiguous arrays of a tree and its links (n,); the inertias need not be physical."""
    kinds = {"parents": np.int64, "prismatic": bool}
    fields = ("parents", "rotation", "translation", "axis", "prismatic", "gravity")
    kinematics = [np.ascontiguousarray(getattr(tree, name), dtype=kinds.get(name, float)) for name in fields]
    mass, first_moment, inertia = (
        np.array(values, dtype=float) for values in (inertias.mass, inertias.first_moment, inertias.inertia)
    )
    squares = np.einsum("ni,ni->n", first_moment, first_moment)[:, None, None] * np.eye(3)
    outer = first_moment[:, :, None] * first_moment[:, None, :]
    origin_inertia = inertia + (squares - outer) / mass[:, None, None]  # parallel axes
    inertial = (mass, first_moment, origin_inertia, first_moment / mass[:, None], inertia)
    return RobotArrays._make([*kinematics, *inertial])


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
