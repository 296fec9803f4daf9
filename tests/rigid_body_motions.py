"""Motions with known inertias and friction, for the tests of learning."""

import numpy as np
from rigid_body_robots import pinocchio_torques, robot

from structlearn.rigid_body.friction import friction_columns
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.tree import Robot

VISCOUS, COULOMB = 0.3, 0.8


def sine_motion(arm: Robot, samples: int = 1200, dt: float = 0.02) -> Motion:
    """Every joint on a sine of its own period; torques by Pinocchio."""
    joints = len(arm.tree.names)
    frequency = 2.0 * np.pi / np.linspace(9.0, 2.0, joints)
    angle = dt * np.arange(samples)[:, None] * frequency + np.arange(joints)
    amplitude = 0.9
    states = (
        amplitude * np.sin(angle),
        amplitude * frequency * np.cos(angle),
        -amplitude * frequency**2 * np.sin(angle),
    )
    return Motion(*states, pinocchio_torques(arm, *states))


def rubbing_motion(arm: Robot) -> Motion:
    """The same with viscous and Coulomb friction in every joint."""
    motion = sine_motion(arm)
    friction = friction_columns(motion.q, motion.qd, ("viscous", "coulomb")) @ [VISCOUS, COULOMB]
    return Motion(motion.q, motion.qd, motion.qdd, motion.torque + friction)


def arm() -> Robot:
    """The KUKA iiwa."""
    return robot("iiwa")
