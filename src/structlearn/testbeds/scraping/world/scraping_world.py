"""The scraping testbed as a physical world: torques in, motion and contact out.

The springs of the grasp and the contact of edge and board are computed here and enter as joint torques; the
robot's own motion is integrated by `rigid_body.compiled_chain`, or by PyBullet (`bullet`), which takes ten
times as long and agrees with it. Everything is deterministic: the same torques give the same bits.
"""

from typing import NamedTuple

import numba
import numpy as np
from pydantic import Field

from structlearn.core.compiled_vectors import cross
from structlearn.core.params import Parameters
from structlearn.rigid_body.compiled_chain import Body, Workspace, body, dynamics, step, workspace
from structlearn.testbeds.scraping.world import contact, scraping_robot
from structlearn.testbeds.scraping.world.contact import Board
from structlearn.testbeds.scraping.world.layout import EDGE_M
from structlearn.testbeds.scraping.world.scraping_robot import (
    ARM_JOINTS,
    GRASP_JOINTS,
    GRAVITY,
    TOOL_CENTRE_M,
    TOOL_KG,
)

# Masses and inertias that each spring of the grasp carries, for its damping: the tool's.
_CARRIED = np.array([TOOL_KG, TOOL_KG, TOOL_KG, 1e-5, 7.4e-5, 7.4e-5])


class WorldParameters(Parameters):
    """Physical constants of the simulated set-up. Fields: `params.yaml`, `testbed.world`."""

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

    @property
    def dt(self) -> float:
        """Of a control tick, s."""
        return 1.0 / self.control_rate_hz


class World(NamedTuple):
    """Robot, tool and board in one moment; the arrays change in place."""

    body: Body  # arm, grasp and tool, thirteen joints
    work: Workspace  # kinematics and dynamics at q and v
    q: np.ndarray  # (13,) positions of arm and grasp joints, rad and m
    v: np.ndarray  # (13,) their velocities
    grasp: np.ndarray  # (2, 6) stiffness and damping of the grasp's joints
    board: Board
    dt: float  # s per physics step
    substeps: int  # of these per control tick
    stuck: np.ndarray  # (EDGE_POINTS, 3) m, tangential springs of the contact
    tool_rotation: np.ndarray  # (3, 3) of the tool, base frame, at the last physics step
    edge: np.ndarray  # (3,) m, middle of the tool's edge then
    board_wrench: np.ndarray  # (6,) force of the board on the tool in N, and its torque about the edge in N m
    grasp_load: np.ndarray  # (6,) force and torque of the tool on the hand at the grasp, hand frame
    torques: np.ndarray  # (13,) N m and N of arm, grasp and contact on the joints


def placed(
    parameters: WorldParameters,
    angles: np.ndarray,
    board_roll: float,
    board_point: np.ndarray,
    friction_factor: float = 1.0,
    stiffness_factor: float = 1.0,
) -> World:
    """The robot at rest, with the tool hanging in the grasp, and the board in its place.

    `angles`: (7,) rad, of the arm. `board_roll`: rad, about the base y axis. `board_point`: (3,) m, a point
    of the board on its axis of tilt. `stiffness_factor`: of this run, on the board's stiffness.
    """
    own, robot = parameters, scraping_robot.whole()
    about_x, about_z, about_y = own.grasp_n_m_rad
    stiffness = np.array([own.grasp_n_m] * 3 + [about_z, about_x, about_y])
    count = ARM_JOINTS + len(GRASP_JOINTS)
    q = np.concatenate([angles, np.zeros(len(GRASP_JOINTS))])
    q[ARM_JOINTS + 2] = TOOL_KG * GRAVITY / own.grasp_n_m  # fingers point down: the weight pulls along them
    world = World(
        body=body(robot.tree, robot.inertias),
        work=workspace(count),
        q=q,
        v=np.zeros(count),
        grasp=np.stack([stiffness, 2.0 * own.grasp_damping * np.sqrt(stiffness * _CARRIED)]),
        board=Board(
            point=np.array(board_point, dtype=float),
            normal=np.array([np.sin(board_roll), 0.0, np.cos(board_roll)]),
            stiffness=float(own.board_n_m * stiffness_factor),
            damping=own.board_damping_s_m,
            friction=float(own.friction * friction_factor),
            sticking=own.sticking_n_m,
            sticking_damping=float(2.0 * own.sticking_damping * np.sqrt(own.sticking_n_m * TOOL_KG)),
        ),
        dt=own.dt / own.substeps,
        substeps=own.substeps,
        stuck=np.zeros((contact.EDGE_POINTS, 3)),
        tool_rotation=np.eye(3),
        edge=np.zeros(3),
        board_wrench=np.zeros(6),
        grasp_load=np.zeros(6),
        torques=np.zeros(count),
    )
    dynamics(world.body, world.q, world.v, world.work)
    load(world, np.zeros(ARM_JOINTS))
    return world


@numba.njit(cache=True, error_model="numpy")
def advance(world: World, torques: np.ndarray) -> None:
    """Advance by one control tick with constant arm torques (7,) in N m."""
    for _ in range(world.substeps):
        load(world, torques)
        step(world.body, world.q, world.v, world.torques, world.dt, world.work)


@numba.njit(cache=True, error_model="numpy")
def load(world: World, arm: np.ndarray) -> None:
    """Write the joint torques of the next physics step: of the arm (7,) in N m, grasp and contact."""
    torques = world.torques
    for i in range(3):
        for k in range(3):
            world.tool_rotation[i, k] = world.work.frame[-1, i, k]
    contact.press(
        world.work, world.v, world.board, world.dt, world.stuck, world.edge, world.board_wrench, torques
    )
    for j in range(ARM_JOINTS):
        torques[j] += arm[j]
    for i in range(6):
        j = ARM_JOINTS + i
        spring = world.grasp[0, i] * world.q[j] + world.grasp[1, i] * world.v[j]
        torques[j] -= spring
        # joints: displacements x, y, z, then turns about z, x, y
        world.grasp_load[i if i < 3 else 3 + (i - 1) % 3] = spring


@numba.njit(cache=True, error_model="numpy")
def tool_wrench(load: np.ndarray, hand: np.ndarray, tool: np.ndarray, wrench: np.ndarray) -> None:
    """Write what the tool exerts on the board, from what the wrist sensor feels at the grasp.

    The tool's weight is taken off with its *current* orientation: with that of the hand, a tool that gives
    way would seem to be loaded, and roll control would settle at twice the tilt.

    `load`: (6,) `World.grasp_load`. `hand`: (3, 3) of the hand, base frame. `tool`: (3, 3) of the tool, base
    frame. `wrench`: (6,) written: force in N and torque about the tool's edge in N m, base frame.
    """
    for i in range(3):
        wrench[i] = -(hand[i, 0] * load[0] + hand[i, 1] * load[1] + hand[i, 2] * load[2])
        wrench[3 + i] = -(hand[i, 0] * load[3] + hand[i, 1] * load[4] + hand[i, 2] * load[5])
    weight = (0.0, 0.0, -GRAVITY * TOOL_KG)
    wrench[2] += weight[2]
    down = (tool[0, 2], tool[1, 2], tool[2, 2])
    hanging, pushing = cross(down, weight), cross(down, wrench)
    for i in range(3):
        wrench[3 + i] += TOOL_CENTRE_M * hanging[i] - EDGE_M * pushing[i]
