"""Model of the scraping robot: a KUKA iiwa, a hand, a compliant grasp and a scraping tool.

The dissertation's robot (Barrett arm and hand) has no public model; an iiwa does. The hand holds the tool
between two soft finger tips, modelled as six passive joints with springs and dampers. Frames are those of
`layout`.
"""

import re
from functools import lru_cache
from pathlib import Path

import numpy as np
import pinocchio
import pybullet_data

from dissertation.scraping.world.layout import EDGE_M, GRASP_M
from structlearn.rigid_body.robot import Robot, robot_of

GRAVITY = 9.81  # m/s^2
ARM_JOINTS = 7
TOOL_KG = 0.06
TOOL_CENTRE_M = 0.02  # centre of mass, from the grasp
HAND_KG = 0.9
HAND_TO_FLANGE_M = 0.105

HOME = np.array([0.0, 0.75, 0.0, -1.35, 0.0, 1.04, 0.0])
"""Posture in rad away from limits and singularities, with the hand above the board and fingers down."""

_GRASP_AXES = {
    "grasp_x": ("prismatic", "1 0 0"),
    "grasp_y": ("prismatic", "0 1 0"),
    "grasp_z": ("prismatic", "0 0 1"),
    "grasp_yaw": ("revolute", "0 0 1"),
    "grasp_pitch": ("revolute", "1 0 0"),
    "grasp_roll": ("revolute", "0 1 0"),
}
GRASP_JOINTS = tuple(_GRASP_AXES)
"""Displacements of the tool between the finger tips along x, y, z, then rotations about z, x, y."""

# Bodies between two grasp joints are skin, with negligible mass
_SKIN_KG, _SKIN_INERTIA = 1e-4, (1e-8, 1e-8, 1e-8)


@lru_cache
def urdf() -> str:
    """URDF of the whole robot, without meshes, since `scraping_world` computes the only contact."""
    arm = (Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf").read_text()
    arm = re.sub(r"<(visual|collision)>.*?</\1>", "", arm, flags=re.DOTALL)
    parts = [
        _link("hand", HAND_KG, (2e-3, 2e-3, 1e-3)),
        _joint("wrist", "fixed", "lbr_iiwa_link_7", "hand", HAND_TO_FLANGE_M),
    ]
    parent = "hand"
    for name, (kind, axis) in _GRASP_AXES.items():
        last = name == GRASP_JOINTS[-1]
        child = "tool" if last else f"skin_{name}"
        mass = (TOOL_KG, (5e-5, 5e-5, 1e-5), TOOL_CENTRE_M) if last else (_SKIN_KG, _SKIN_INERTIA)
        parts += [
            _link(child, *mass),
            _joint(name, kind, parent, child, GRASP_M if parent == "hand" else 0.0, axis),
        ]
        parent = child
    parts += [
        _link("edge", 0.0, (0.0, 0.0, 0.0)),
        _joint("edge_joint", "fixed", "hand", "edge", GRASP_M + EDGE_M),
    ]
    return arm.replace("</robot>", "\n".join(parts) + "\n</robot>")


@lru_cache
def whole() -> Robot:
    """Robot with arm, grasp and tool, a chain of thirteen joints."""
    return robot_of(pinocchio.buildModelFromXML(urdf()))


@lru_cache
def arm() -> Robot:
    """The controller's robot: arm with hand and unloaded tool in a rigid grasp; with a frame `edge`."""
    model = whole().model
    grasp = [model.getJointId(name) for name in GRASP_JOINTS]
    return robot_of(pinocchio.buildReducedModel(model, grasp, pinocchio.neutral(model)))


def joint_angles(position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Arm posture (7,) in rad near `HOME` that puts the edge frame at a pose, by damped Gauss-Newton steps.

    `position`: (3,) m, base frame. `rotation`: (3, 3) edge to base. Raises ValueError: it is out of reach.
    """
    model = arm().model
    data, edge = model.createData(), model.getFrameId("edge")
    goal = pinocchio.SE3(rotation, position)
    angles = HOME.copy()
    for _ in range(100):
        pinocchio.framesForwardKinematics(model, data, angles)
        error = pinocchio.log6(data.oMf[edge].actInv(goal)).vector
        if np.linalg.norm(error) < 1e-12:
            return angles
        jacobian = pinocchio.computeFrameJacobian(model, data, angles, edge)
        angles = angles + jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-9 * np.eye(6), error)
    raise ValueError(f"the arm does not reach {position}")


def _link(name: str, mass: float, inertia: tuple[float, float, float], centre: float = 0.0) -> str:
    ixx, iyy, izz = inertia
    return (
        f'<link name="{name}"><inertial><origin xyz="0 0 {centre}"/><mass value="{mass}"/>'
        f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial></link>'
    )


def _joint(name: str, kind: str, parent: str, child: str, along_z: float, axis: str = "0 0 1") -> str:
    limit = "" if kind == "fixed" else '<limit lower="-1" upper="1" effort="1000" velocity="100"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 {along_z}"/><axis xyz="{axis}"/>{limit}</joint>'
    )
