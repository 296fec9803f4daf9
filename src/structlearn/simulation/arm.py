"""Simulated arms: kinematics of any URDF, with inertias, friction and payloads that may differ from it.

The motion is simulated in a compiled loop (`compiled_arm`); PyBullet (`bullet_arm`) is the oracle in tests
and in the stage `engines`.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pybullet_data
from pydantic import Field

from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.rigid_body.tree import LinkInertias, Robot, read_urdf


@dataclass(frozen=True)
class Mechanics:
    """Inertias and drives of an arm with n joints."""

    inertias: LinkInertias  # true inertias of the links
    viscous: np.ndarray  # (n,) N m s/rad
    coulomb: np.ndarray  # (n,) N m
    ripple: np.ndarray  # (n,) N m, amplitude of the drives' torque ripple
    ripple_waves: float = 0.0  # periods of the ripple per rad of the joint
    latency_steps: int = 0  # steps between a torque command and its effect


def ideal(inertias: LinkInertias) -> Mechanics:
    """Mechanics without friction, ripple and latency."""
    zero = np.zeros(len(inertias.mass))
    return Mechanics(inertias, viscous=zero, coulomb=zero, ripple=zero)


@dataclass(frozen=True)
class Payload:
    """A body carried by the last link."""

    mass_kg: float
    point_m: tuple[float, float, float]  # centre of mass in the last joint's frame
    radius_m: float  # of gyration, equal about all axes

    @property
    def inertia(self) -> float:
        """Moment of inertia about its centre of mass, equal for all axes, kg m^2."""
        return self.mass_kg * self.radius_m**2


def carrying(inertias: LinkInertias, payload: Payload) -> LinkInertias:
    """Inertias of links with a payload on the last one (parallel axis theorem)."""
    mass, moment, inertia = inertias.mass.copy(), inertias.first_moment.copy(), inertias.inertia.copy()
    point = np.array(payload.point_m)
    apart = point - moment[-1] / mass[-1]
    reduced = payload.mass_kg * mass[-1] / (payload.mass_kg + mass[-1])
    inertia[-1] += (payload.inertia + reduced * apart @ apart) * np.eye(3) - reduced * np.outer(apart, apart)
    mass[-1] += payload.mass_kg
    moment[-1] += payload.mass_kg * point
    return LinkInertias(mass, moment, inertia)


class ArmParameters(Parameters):
    """URDF of an arm."""

    urdf: str = Field(min_length=1)
    locked_joints: tuple[str, ...]

    def read(self) -> Robot:
        """The arm. Raises InputError: there is no such file, or it is no URDF of an arm (`read_urdf`)."""
        return read_urdf(urdf_path(self.urdf), self.locked_joints)


def urdf_path(name: str) -> Path:
    """A path, or a file of `pybullet_data` such as `kuka_iiwa/model.urdf`. Raises InputError: missing."""
    for path in (Path(name), Path(pybullet_data.getDataPath()) / name):
        if path.is_file():
            return path
    raise InputError(f"urdf: there is no file '{name}', and none of that name in pybullet_data")
