"""Robots for tests of rigid-body dynamics, from public URDFs and one with everything odd, and motions."""

import re
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pinocchio
import pybullet_data

from dissertation.simulation.arm import Payload
from structlearn.rigid_body.friction import friction_columns
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.robot import Robot, configuration, read_urdf
from structlearn.rigid_body.tree import KinematicTree, LinkInertias

FINGERS = ("panda_finger_joint1", "panda_finger_joint2")

_INERTIAL = """<inertial><origin xyz="{x}" rpy="0.3 -0.2 0.5"/><mass value="{m}"/>
  <inertia ixx="{a}" ixy="0.001" ixz="-0.002" iyy="{b}" iyz="0.0015" izz="{c}"/></inertial>"""


def link(name: str, mass: float = 1.0, centre: str = "0.05 -0.02 0.1") -> str:
    values = {"a": 0.03 * mass, "b": 0.04 * mass, "c": 0.05 * mass}
    return f'<link name="{name}">' + _INERTIAL.format(x=centre, m=mass, **values) + "</link>"


def joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    axis: str = "0 0 1",
    origin: str = 'xyz="0.1 0.2 0.3" rpy="0.4 -0.7 1.1"',
    limit: str = '<limit lower="-1.5" upper="2" velocity="3" effort="50"/>',
) -> str:
    ends = f'<origin {origin}/><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{limit}</joint>'


ODD = "\n".join(
    [
        '<robot name="odd"><link name="base"/>',
        *(link(name, mass) for name, mass in zip("abcdef", (3.0, 2.0, 1.5, 1.0, 0.7, 0.4), strict=True)),
        link("weight", 0.5),
        '<link name="mark"/>',
        joint("slide", "prismatic", "base", "a", "0 1 0"),
        joint("skewed", "revolute", "a", "b", "1 2 -0.5"),
        joint("endless", "continuous", "b", "c", "0 0 -1", limit=""),
        joint("skewed_slide", "prismatic", "b", "d", "-1 0.3 2"),  # a branch
        joint("wrist", "revolute", "d", "e", "1 0 0"),
        joint("endless_skewed", "continuous", "e", "f", "1 1 1", limit='<limit velocity="2" effort="3"/>'),
        joint("bolt", "fixed", "f", "weight"),
        joint("point", "fixed", "weight", "mark"),
        "</robot>",
    ]
)
"""Prismatic, endless and skewed joints, a branch, a fixed link with mass and one without."""


@lru_cache
def robot(name: str) -> Robot:
    """One of iiwa, panda (fingers locked), panda_hand (fingers move, each by itself), xarm, odd."""
    public = Path(pybullet_data.getDataPath())
    if name in ("odd", "panda_hand"):
        follows = r'<mimic joint="[^"]*" */>'
        text = re.sub(follows, "", (public / "franka_panda/panda.urdf").read_text())
        with TemporaryDirectory() as folder:
            path = Path(folder) / f"{name}.urdf"
            path.write_text(ODD if name == "odd" else text)
            return read_urdf(path)
    return read_urdf(public / FILES[name], FINGERS if name == "panda" else ())


FILES = {"iiwa": "kuka_iiwa/model.urdf", "panda": "franka_panda/panda.urdf", "xarm": "xarm/xarm6_robot.urdf"}
ROBOTS = ("iiwa", "panda", "panda_hand", "xarm", "odd")


def states(robot: Robot, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Random positions, velocities and accelerations, (count, n) each."""
    generator, shape = np.random.default_rng(seed), (count, len(robot.tree.names))
    return generator.uniform(-2.0, 2.0, shape), *(generator.normal(0.0, std, shape) for std in (2.0, 5.0))


def pinocchio_torques(robot: Robot, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Torques (B, n) by Pinocchio's recursive Newton-Euler."""
    data = robot.model.createData()
    rows = zip((configuration(robot.model, row) for row in q), qd, qdd, strict=True)
    return np.array([pinocchio.rnea(robot.model, data, *row) for row in rows])


def carrying(robot: Robot, payload: Payload) -> LinkInertias:
    """Inertias of the links when the last one carries a payload, as Pinocchio adds bodies."""
    body = pinocchio.Inertia(payload.mass_kg, np.array(payload.point_m), payload.inertia * np.eye(3))
    loaded = list(robot.model.inertias)[-1] + body
    mass, moment, inertia = (
        values.copy() for values in (robot.inertias.mass, robot.inertias.first_moment, robot.inertias.inertia)
    )
    mass[-1], moment[-1], inertia[-1] = loaded.mass, loaded.mass * loaded.lever, loaded.inertia
    return LinkInertias(mass, moment, inertia)


def pendulum(mass: float, length: float, moment: float) -> tuple[KinematicTree, LinkInertias]:
    """A hinge about y: tau = (I + m l^2) qdd + m g l sin(q)."""
    one = np.ones(1)
    tree = KinematicTree(
        ("hinge",), np.array([-1]), np.eye(3)[None], np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]),
        np.array([False]), -3.0 * one, 3.0 * one, 9.0 * one, np.array([0.0, 0.0, -9.81]),
    )  # fmt: skip
    return tree, LinkInertias(mass * one, np.array([[0.0, 0.0, -mass * length]]), moment * np.eye(3)[None])


def robot_with(robot: Robot, inertias: LinkInertias) -> Robot:
    """A robot with other inertias, in Pinocchio's model too."""
    model = robot.model.copy()
    for place, (mass, moment, inertia) in enumerate(
        zip(inertias.mass, inertias.first_moment, inertias.inertia, strict=True), start=1
    ):
        model.inertias[place] = pinocchio.Inertia(mass, moment / mass, inertia)
    return Robot(robot.name, robot.tree, inertias, model)


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


def motion_with_friction(arm: Robot) -> Motion:
    """The same with viscous and Coulomb friction in every joint."""
    motion = sine_motion(arm)
    friction = friction_columns(motion.q, motion.qd, ("viscous", "coulomb")) @ [VISCOUS, COULOMB]
    return Motion(motion.q, motion.qd, motion.qdd, motion.torque + friction)


def arm() -> Robot:
    """The KUKA iiwa."""
    return robot("iiwa")
