"""The scraping testbed as a physical world: torques in, motion and contact out (PyBullet, compiled contact).

PyBullet integrates arm, grasp and tool; the springs of the grasp and the contact of edge and board are
computed here and enter as joint torques. Everything is deterministic: the same torques give the same bits.
"""

from typing import Self

import numba
import numpy as np
import pybullet
from pydantic import Field

from structlearn.ground.params import Parameters
from structlearn.testbeds.scraping.world import contact, scraping_robot
from structlearn.testbeds.scraping.world.layout import EDGE_M
from structlearn.testbeds.scraping.world.scraping_robot import (
    ARM_JOINTS,
    GRASP_JOINTS,
    TOOL_CENTRE_M,
    TOOL_KG,
)

GRAVITY = 9.81  # m/s^2
# Masses and inertias that each spring of the grasp carries, for its damping: the tool's.
_CARRIED = np.array([TOOL_KG, TOOL_KG, TOOL_KG, 1e-5, 7.4e-5, 7.4e-5])


class WorldParameters(Parameters):
    """Physical constants of the simulated set-up.

    Attributes:
        control_rate_hz: of the robot's controller.
        substeps: physics steps per control tick.
        grasp_n_m: stiffness of the finger tips against displacements of the tool.
        grasp_n_m_rad: against turns about the pinch axis, the fingers, and the scraping direction (roll); the
            skin gives most about roll.
        grasp_damping: damping ratio of the grasp.
        board_n_m: stiffness of the board under the whole edge.
        board_damping_s_m: factor of the contact force on the approach velocity.
        friction: Coulomb coefficient between tool and board.
        sticking_n_m: stiffness with which the whole edge sticks to the board before it slides, of the order
            of the normal one (Mindlin 1949: somewhat less).
        sticking_damping: damping ratio of that spring with the tool.
    """

    control_rate_hz: float = Field(ge=100, le=2000)
    substeps: int = Field(ge=1, le=20)
    grasp_n_m: float = Field(gt=0)
    grasp_n_m_rad: tuple[float, float, float]
    grasp_damping: float = Field(ge=0)
    board_n_m: float = Field(gt=0)
    board_damping_s_m: float = Field(ge=0)
    friction: float = Field(ge=0)
    sticking_n_m: float = Field(gt=0)
    sticking_damping: float = Field(ge=0)


class ScrapingWorld:
    """Robot, tool and board. Use as a context manager: PyBullet's server is closed at the end.

    Attributes:
        q: (13,) positions of arm and grasp joints, rad and m.
        v: (13,) their velocities.
        tool_rotation: (3, 3) of the tool, base frame, at the last physics step.
        edge: (3,) m, middle of the tool's edge.
        board_wrench: (6,) force of the board on the tool in N, and its torque about the edge in N m.
        grasp_load: (6,) force and torque of the tool on the hand at the grasp, hand frame.
    """

    def __init__(self, parameters: WorldParameters) -> None:
        self.parameters = parameters
        self.dt = 1.0 / parameters.control_rate_hz
        self._client = pybullet.connect(pybullet.DIRECT)
        pybullet.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=self._client)
        pybullet.setTimeStep(self.dt / parameters.substeps, physicsClientId=self._client)
        self._body, self._joints = scraping_robot.load(self._client)
        chain = scraping_robot.chain()
        self._chain = (chain.rotation, chain.translation, chain.axis, chain.prismatic, EDGE_M)
        about_x, about_z, about_y = parameters.grasp_n_m_rad
        stiffness = np.array([parameters.grasp_n_m] * 3 + [about_z, about_x, about_y])
        damping = 2.0 * parameters.grasp_damping * np.sqrt(stiffness * _CARRIED)
        self._grasp = np.stack([stiffness, damping])
        count = len(self._joints)
        self.q, self.v = np.zeros(count), np.zeros(count)
        self.tool_rotation, self.edge = np.eye(3), np.zeros(3)
        self.board_wrench, self.grasp_load = np.zeros(6), np.zeros(6)
        self._torques = np.zeros(count)
        self._stuck = np.zeros((contact.EDGE_POINTS, 3))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(self._client)

    def place(
        self,
        angles: np.ndarray,
        board_roll: float,
        board_point: np.ndarray,
        friction_factor: float = 1.0,
        stiffness_factor: float = 1.0,
    ) -> None:
        """Put the robot at rest, with the tool hanging in the grasp, and the board in its place.

        Args:
            angles: (7,) rad, of the arm.
            board_roll: rad, about the base y axis.
            board_point: (3,) m, a point of the board on its axis of tilt.
            friction_factor: of this run, on the friction coefficient.
            stiffness_factor: of this run, on the board's stiffness.
        """
        own = self.parameters
        sag = np.zeros(len(GRASP_JOINTS))
        sag[2] = TOOL_KG * GRAVITY / own.grasp_n_m  # fingers point down: the weight pulls along them
        for joint, angle in zip(self._joints, [*angles, *sag], strict=True):
            pybullet.resetJointState(self._body, joint, angle, 0.0, physicsClientId=self._client)
        self._point = np.array(board_point, dtype=float)
        self._normal = np.array([np.sin(board_roll), 0.0, np.cos(board_roll)])
        self._board = np.array(
            [
                own.board_n_m * stiffness_factor,
                own.board_damping_s_m,
                own.friction * friction_factor,
                own.sticking_n_m,
                2.0 * own.sticking_damping * np.sqrt(own.sticking_n_m * TOOL_KG),
            ]
        )
        self._stuck[:] = 0.0
        self._read()
        self._apply(np.zeros(ARM_JOINTS))

    def step(self, torques: np.ndarray) -> None:
        """Advance by one control tick with constant arm torques (7,) in N m."""
        for _ in range(self.parameters.substeps):
            self._apply(torques)
            pybullet.setJointMotorControlArray(
                self._body,
                self._joints,
                pybullet.TORQUE_CONTROL,
                forces=self._torques.tolist(),
                physicsClientId=self._client,
            )
            pybullet.stepSimulation(physicsClientId=self._client)
            self._read()

    def _read(self) -> None:
        states = pybullet.getJointStates(self._body, self._joints, physicsClientId=self._client)
        self.q[:] = [state[0] for state in states]
        self.v[:] = [state[1] for state in states]

    def _apply(self, torques: np.ndarray) -> None:
        """Fill the joint torques of the next physics step: arm, grasp and contact."""
        contact.step_forces(
            self.q,
            self.v,
            *self._chain,
            self._point,
            self._normal,
            self._board,
            self.dt / self.parameters.substeps,
            self._stuck,
            self.tool_rotation,
            self.edge,
            self.board_wrench,
            self._torques,
        )
        _add_grasp_and_arm(self.q, self.v, self._grasp, torques, self._torques, self.grasp_load)


def tool_wrench(grasp_load: np.ndarray, hand_rotation: np.ndarray, tool_rotation: np.ndarray) -> np.ndarray:
    """What the tool exerts on the board, from what the wrist sensor feels at the grasp.

    The tool's weight is taken off with its *current* orientation: with that of the hand, a tool that gives
    way would seem to be loaded, and roll control would settle at twice the tilt.

    Args:
        grasp_load: (6,) of `ScrapingWorld`.
        hand_rotation: (3, 3) of the hand, base frame.
        tool_rotation: (3, 3) of the tool, base frame.

    Returns:
        (6,) force in N and torque about the tool's edge in N m, base frame.
    """
    return _tool_wrench(grasp_load, np.ascontiguousarray(hand_rotation), np.ascontiguousarray(tool_rotation))


@numba.njit(cache=True)
def _tool_wrench(load: np.ndarray, hand: np.ndarray, tool: np.ndarray) -> np.ndarray:
    down = tool[:, 2].copy()
    weight = np.array((0.0, 0.0, -GRAVITY * TOOL_KG))
    force = hand @ load[:3] - weight
    torque = hand @ load[3:] - TOOL_CENTRE_M * np.cross(down, weight) - EDGE_M * np.cross(down, force)
    return -np.concatenate((force, torque))  # on the board, not by it


@numba.njit(cache=True)
def _add_grasp_and_arm(
    q: np.ndarray, v: np.ndarray, grasp: np.ndarray, arm: np.ndarray, torques: np.ndarray, load: np.ndarray
) -> None:
    """Add the arm's torques (7,) and the grasp's springs to the contact's; write the load on the hand."""
    torques[:ARM_JOINTS] += arm
    for i in range(6):
        spring = grasp[0, i] * q[ARM_JOINTS + i] + grasp[1, i] * v[ARM_JOINTS + i]
        torques[ARM_JOINTS + i] -= spring
        # joints: displacements x, y, z, then turns about z, x, y
        load[i if i < 3 else 3 + (i - 1) % 3] = spring
