"""Physical simulation of the scraping testbed: torques in, motion and contact out.

Forces of the grasp's springs and of the contact between edge and board are computed here and enter as joint
torques. The robot's motion is integrated by `simulation.compiled_chain`, or by PyBullet
(`stages/engines.py`), which takes ten times as long and agrees. Everything is deterministic: the same torques
give the same bits.

The board is a plane; the 11 mm edge is a row of points on a Winkler foundation: each pushes back in
proportion to its depth, with damping, and sticks to the board by a tangential spring until that reaches the
Coulomb force; then it slides. (Friction as a function of speed alone either chatters at the physics step, or
lets a tool at rest creep. A physics engine's own box contact hit with 1-2 N and hid the roll torque in
stiction.) The contact force enters through the transposed Jacobian, which is exact and saves calls.
"""

from typing import NamedTuple

import numpy as np
from pydantic import Field

from dissertation.scraping.world import scraping_robot
from dissertation.scraping.world.layout import CONTACT_M, EDGE_M, EDGE_WIDTH_M
from dissertation.scraping.world.scraping_robot import (
    ARM_JOINTS,
    GRASP_JOINTS,
    GRAVITY,
    TOOL_CENTRE_M,
    TOOL_KG,
)
from dissertation.simulation.compiled_chain import ChainState, dynamics, step, workspace
from structlearn.core.compilation import compiled_inside, cross, numba
from structlearn.core.params import Parameters
from structlearn.rigid_body.tree import RobotArrays, robot_arrays

EDGE_POINTS = 11

POINTS = ((np.arange(EDGE_POINTS) + 0.5) / EDGE_POINTS - 0.5) * EDGE_WIDTH_M
"""Positions in m along the edge, which lies along the grasp's x axis: midpoints of equal pieces. With points
at its ends, the roll torque of a tilted board would be a fifth too large."""

# Masses and inertias of the tool on each spring of the grasp, for its damping
_CARRIED = np.array([TOOL_KG, TOOL_KG, TOOL_KG, 1e-5, 7.4e-5, 7.4e-5])


class WorldParameters(Parameters):
    """Physical constants of the simulated set-up."""

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
        """Control tick in s."""
        return 1.0 / self.control_rate_hz


class Board(NamedTuple):
    """The board of one run."""

    point: np.ndarray  # (3,) m, on the surface
    normal: np.ndarray  # (3,) unit vector
    stiffness: float  # N/m under the whole edge
    damping: float  # s/m, factor of the force on the approach velocity
    friction: float  # coefficient
    sticking: float  # N/m, tangential stiffness of the whole edge
    sticking_damping: float  # N s/m, tangential


class World(NamedTuple):
    """State and model of robot, tool and board; the arrays are updated in place."""

    arrays: RobotArrays  # arm, grasp and tool, thirteen joints
    work: ChainState  # kinematics and dynamics at q and v
    q: np.ndarray  # (13,) positions of arm and grasp joints, rad and m
    v: np.ndarray  # (13,) their velocities
    grasp: np.ndarray  # (2, 6) stiffness and damping of the grasp's joints
    board: Board
    dt: float  # s per physics step
    substeps: int  # physics steps per control tick
    stuck: np.ndarray  # (EDGE_POINTS, 3) m, tangential springs of the contact
    tool_rotation: np.ndarray  # (3, 3) of the tool, base frame, at the last physics step
    edge: np.ndarray  # (3,) m, middle of the tool's edge at that step
    board_wrench: np.ndarray  # (6,) force of the board on the tool in N, and its torque about the edge in N m
    grasp_load: np.ndarray  # (6,) force and torque of the tool on the hand at the grasp, hand frame
    torques: np.ndarray  # (13,) N m and N on the joints, of arm, grasp and contact


def placed(
    parameters: WorldParameters,
    angles: np.ndarray,
    board_roll: float,
    friction_factor: float = 1.0,
    stiffness_factor: float = 1.0,
) -> World:
    """World with the robot at rest, the tool hanging in the grasp, and the board in place.

    `angles`: (7,) rad, of the arm. `board_roll`: rad, about the base y axis. The factors scale the board's
    friction and stiffness in this run.
    """
    own, robot = parameters, scraping_robot.whole()
    about_x, about_z, about_y = own.grasp_n_m_rad
    stiffness = np.array([own.grasp_n_m] * 3 + [about_z, about_x, about_y])
    count = ARM_JOINTS + len(GRASP_JOINTS)
    q = np.concatenate([angles, np.zeros(len(GRASP_JOINTS))])
    q[ARM_JOINTS + 2] = TOOL_KG * GRAVITY / own.grasp_n_m  # the tool's weight pulls along the fingers
    world = World(
        arrays=robot_arrays(robot.tree, robot.inertias),
        work=workspace(count),
        q=q,
        v=np.zeros(count),
        grasp=np.stack([stiffness, 2.0 * own.grasp_damping * np.sqrt(stiffness * _CARRIED)]),
        board=Board(
            point=CONTACT_M.copy(),
            normal=np.array([np.sin(board_roll), 0.0, np.cos(board_roll)]),
            stiffness=float(own.board_n_m * stiffness_factor),
            damping=own.board_damping_s_m,
            friction=float(own.friction * friction_factor),
            sticking=own.sticking_n_m,
            sticking_damping=float(2.0 * own.sticking_damping * np.sqrt(own.sticking_n_m * TOOL_KG)),
        ),
        dt=own.dt / own.substeps,
        substeps=own.substeps,
        stuck=np.zeros((EDGE_POINTS, 3)),
        tool_rotation=np.eye(3),
        edge=np.zeros(3),
        board_wrench=np.zeros(6),
        grasp_load=np.zeros(6),
        torques=np.zeros(count),
    )
    dynamics(world.arrays, world.q, world.v, world.work)
    load(world, np.zeros(ARM_JOINTS))
    return world


@numba.njit(cache=True, error_model="numpy")
def advance(world: World, torques: np.ndarray) -> None:
    """Advance by one control tick with constant arm torques (7,) in N m."""
    for _ in range(world.substeps):
        load(world, torques)
        step(world.arrays, world.q, world.v, world.torques, world.dt, world.work)


@numba.njit(cache=True, error_model="numpy")
def load(world: World, arm: np.ndarray) -> None:
    """Write the joint torques of the next physics step: arm torques (7,) in N m, grasp and contact."""
    torques = world.torques
    world.tool_rotation[:] = world.work.frame[-1]
    press(world.work, world.v, world.board, world.dt, world.stuck, world.edge, world.board_wrench, torques)
    torques[:ARM_JOINTS] += arm
    for i in range(6):
        j = ARM_JOINTS + i
        spring = world.grasp[0, i] * world.q[j] + world.grasp[1, i] * world.v[j]
        torques[j] -= spring
        # joints: displacements along x, y, z, then rotations about z, x, y
        world.grasp_load[i if i < 3 else 3 + (i - 1) % 3] = spring


@numba.njit(cache=True, error_model="numpy")
def tool_wrench(load: np.ndarray, hand: np.ndarray, tool: np.ndarray, wrench: np.ndarray) -> None:
    """Write the wrench of the tool on the board, from the load that the wrist sensor measures at the grasp.

    The tool's weight is subtracted with the tool's *current* orientation: with the hand's, a tool that yields
    would seem loaded, and roll control would settle at twice the tilt.

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


@numba.njit(cache=True, error_model="numpy")
def press(
    work: ChainState,
    v: np.ndarray,
    board: Board,
    dt: float,
    stuck: np.ndarray,
    middle: np.ndarray,
    wrench: np.ndarray,
    torques: np.ndarray,
) -> None:
    """Write the contact wrench on the tool at its edge, and the resulting joint torques.

    `work`: kinematics of a robot whose last link is the tool; `v`: (J,) joint velocities. `dt`: s since the
    last call. `stuck`: (EDGE_POINTS, 3) m, deflection of the tangential springs, kept between calls. Written:
    `middle` of the edge (3,) m; `wrench` (6,), force of the board on the tool in N and its torque about the
    middle in N m; joint `torques` (J,).
    """
    frame, place, normal = work.frame[-1], work.place[-1], board.normal
    for i in range(3):
        middle[i] = place[i] + EDGE_M * frame[i, 2]
    wrench[:] = 0.0
    torques[:] = 0.0
    along = (frame[0, 0], frame[1, 0], frame[2, 0])
    height = _dot(
        (middle[0] - board.point[0], middle[1] - board.point[1], middle[2] - board.point[2]), normal
    )
    slope = _dot(along, normal)
    if height - 0.5 * EDGE_WIDTH_M * abs(slope) > 0.0:
        stuck[:] = 0.0
        return  # in the air

    angular, linear = _velocity_at(work.screw, v, middle)
    for i in range(EDGE_POINTS):
        depth = -height - POINTS[i] * slope
        if depth <= 0.0:
            stuck[i] = 0.0
            continue
        arm = (POINTS[i] * along[0], POINTS[i] * along[1], POINTS[i] * along[2])
        sweep = cross(angular, arm)
        velocity = (linear[0] + sweep[0], linear[1] + sweep[1], linear[2] + sweep[2])
        force = _push_back(velocity, depth, board, dt, stuck[i])
        torque = cross(arm, force)
        for d in range(3):
            wrench[d] += force[d]
            wrench[3 + d] += torque[d]
    turning = cross(middle, wrench)  # torque of the force about the base's origin, as for screws
    for j in range(len(torques)):
        screw = work.screw[j]
        for d in range(3):
            torques[j] += screw[d] * (wrench[3 + d] + turning[d]) + screw[3 + d] * wrench[d]


@numba.njit(cache=True, error_model="numpy", inline="always")
def _dot(a: np.ndarray | tuple, b: np.ndarray | tuple) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled_inside
def _velocity_at(screws: np.ndarray, v: np.ndarray, point: np.ndarray) -> tuple[tuple, tuple]:
    """Angular velocity of the last link, and linear velocity of one of its points."""
    w0 = w1 = w2 = v0 = v1 = v2 = 0.0
    for j in range(len(v)):
        w0 += v[j] * screws[j, 0]
        w1 += v[j] * screws[j, 1]
        w2 += v[j] * screws[j, 2]
        v0 += v[j] * screws[j, 3]
        v1 += v[j] * screws[j, 4]
        v2 += v[j] * screws[j, 5]
    sweep = cross((w0, w1, w2), point)
    return (w0, w1, w2), (v0 + sweep[0], v1 + sweep[1], v2 + sweep[2])


@compiled_inside
def _push_back(velocity: tuple, depth: float, board: Board, dt: float, stuck: np.ndarray) -> tuple:
    """Force (3,) in N on one point of the edge; updates its tangential spring `stuck` (3,)."""
    normal = board.normal
    approach = _dot(velocity, normal)
    push = max(board.stiffness / EDGE_POINTS * depth * (1.0 - board.damping * approach), 0.0)
    stiffness, damping = board.sticking / EDGE_POINTS, board.sticking_damping / EDGE_POINTS
    for d in range(3):
        stuck[d] += dt * (velocity[d] - approach * normal[d])
    off = _dot(stuck, normal)
    for d in range(3):
        stuck[d] -= off * normal[d]
    drag = (
        stiffness * stuck[0] + damping * (velocity[0] - approach * normal[0]),
        stiffness * stuck[1] + damping * (velocity[1] - approach * normal[1]),
        stiffness * stuck[2] + damping * (velocity[2] - approach * normal[2]),
    )
    size, largest = np.sqrt(_dot(drag, drag)), board.friction * push
    if size > largest:  # sliding: the spring keeps the deflection that friction can hold
        kept = largest / size
        drag = (kept * drag[0], kept * drag[1], kept * drag[2])
        for d in range(3):
            stuck[d] = drag[d] / stiffness
    return push * normal[0] - drag[0], push * normal[1] - drag[1], push * normal[2] - drag[2]
