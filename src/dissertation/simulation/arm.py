"""Simulated arms: kinematics from a URDF; inertias, friction and payloads that may differ from it.

A compiled loop moves them (`compiled_arm`); PyBullet (`bullet_arm`) is the reference in tests and in the
stage `engines`.
"""

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from structlearn.core.params import Parameters
from structlearn.readers.urdf_file import urdf_path
from structlearn.rigid_body.robot import Robot, read_urdf
from structlearn.rigid_body.tree import LinkInertias


@dataclass(frozen=True)
class Mechanics:
    """Inertias and drives of an arm with n joints."""

    inertias: LinkInertias  # of the links, physically consistent
    viscous: np.ndarray  # (n,) N m s/rad
    coulomb: np.ndarray  # (n,) N m
    ripple: np.ndarray  # (n,) N m, amplitude of the drives' torque ripple
    ripple_waves: float = 0.0  # ripple periods per rad of the joint
    latency_steps: int = 0  # steps between command and torque


def ideal(inertias: LinkInertias) -> Mechanics:
    """Mechanics without friction, ripple and latency."""
    zero = np.zeros(len(inertias.mass))
    return Mechanics(inertias, viscous=zero, coulomb=zero, ripple=zero)


@dataclass(frozen=True)
class Payload:
    """A body carried by the last link."""

    mass_kg: float
    point_m: tuple[float, float, float]  # centre of mass in the last joint's frame
    radius_m: float  # radius of gyration, equal about all axes

    @property
    def inertia(self) -> float:
        """Moment of inertia about any axis through the centre of mass, kg m^2."""
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
        """Read the arm. Raises InputError: there is no such file, or see `read_urdf`."""
        return read_urdf(urdf_path(self.urdf), self.locked_joints)
