"""The tool's edge on the tilting board, and how its force loads the robot's joints.

The board is a plane; the 11 mm edge is a row of points on a Winkler foundation: each pushes back in
proportion to how deep it is, with damping, and sticks to the board by a tangential spring until that pulls
with the Coulomb force, from which on it slides. (Friction as a function of speed alone either chatters at the
physics step, or lets a standing tool creep.)
A physics engine's own box contact was tried: it hits with 1-2 N and hides the roll torque in stiction. The
force enters as joint torques through the transposed Jacobian, which is what the force does and saves calls.
"""

from typing import NamedTuple

import numba
import numpy as np

from structlearn.core.compiled_vectors import compiled_inside, cross
from structlearn.rigid_body.compiled_chain import Workspace
from structlearn.testbeds.scraping.world.layout import EDGE_M, EDGE_WIDTH_M

EDGE_POINTS = 11

POINTS = ((np.arange(EDGE_POINTS) + 0.5) / EDGE_POINTS - 0.5) * EDGE_WIDTH_M
"""m along the edge, which lies along the grasp's x axis: the middle of equal pieces. With points at its ends
the roll torque of a tilted board would be a fifth too large."""


class Board(NamedTuple):
    """The board of one run."""

    point: np.ndarray  # (3,) m, a point of it
    normal: np.ndarray  # (3,) unit vector
    stiffness: float  # N/m under the whole edge
    damping: float  # s/m, factor of the force on the approach velocity
    friction: float  # coefficient
    sticking: float  # N/m, tangential stiffness of the whole edge
    sticking_damping: float  # N s/m of that


@numba.njit(cache=True, error_model="numpy")
def press(
    work: Workspace,
    v: np.ndarray,
    board: Board,
    dt: float,
    stuck: np.ndarray,
    middle: np.ndarray,
    wrench: np.ndarray,
    torques: np.ndarray,
) -> None:
    """Contact wrench on the tool at its edge, and the joint torques that it amounts to.

    Args:
        work: kinematics of the robot whose last link is the tool.
        v: (J,) joint velocities.
        board: see there.
        dt: s since the last call.
        stuck: (EDGE_POINTS, 3) m, deflection of the tangential springs; carried on from call to call.
        middle: (3,) m, written: middle of the edge.
        wrench: (6,) written: force of the board on the tool in N, and its torque about the middle in N m.
        torques: (J,) written: joint torques of that wrench.
    """
    frame, place, normal = work.frame[-1], work.place[-1], board.normal
    for i in range(3):
        middle[i] = place[i] + EDGE_M * frame[i, 2]
    for k in range(6):
        wrench[k] = 0.0
    for j in range(len(torques)):
        torques[j] = 0.0
    along = (frame[0, 0], frame[1, 0], frame[2, 0])
    height = _dot(
        (middle[0] - board.point[0], middle[1] - board.point[1], middle[2] - board.point[2]), normal
    )
    slope = _dot(along, normal)
    if height - 0.5 * EDGE_WIDTH_M * abs(slope) > 0.0:
        for i in range(EDGE_POINTS):
            for d in range(3):
                stuck[i, d] = 0.0
        return  # in the air

    angular, linear = _velocity_at(work.screw, v, middle)
    for i in range(EDGE_POINTS):
        depth = -height - POINTS[i] * slope
        if depth <= 0.0:
            for d in range(3):
                stuck[i, d] = 0.0
            continue
        arm = (POINTS[i] * along[0], POINTS[i] * along[1], POINTS[i] * along[2])
        sweep = cross(angular, arm)
        velocity = (linear[0] + sweep[0], linear[1] + sweep[1], linear[2] + sweep[2])
        force = _push_back(velocity, depth, board, dt, stuck[i])
        torque = cross(arm, force)
        for d in range(3):
            wrench[d] += force[d]
            wrench[3 + d] += torque[d]
    turning = cross(middle, wrench)  # of the force about the base's origin, as screws have it
    for j in range(len(torques)):
        screw = work.screw[j]
        for d in range(3):
            torques[j] += screw[d] * (wrench[3 + d] + turning[d]) + screw[3 + d] * wrench[d]


@numba.njit(cache=True, error_model="numpy", inline="always")
def _dot(a: np.ndarray | tuple, b: np.ndarray | tuple) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled_inside
def _velocity_at(screws: np.ndarray, v: np.ndarray, point: np.ndarray) -> tuple[tuple, tuple]:
    """Angular velocity of the last link, and linear velocity of a point of it."""
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
    """Force (3,) in N on one point of the edge; its tangential spring `stuck` (3,) moves on."""
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
    if size > largest:  # it slides, and the spring keeps what it can hold
        kept = largest / size
        drag = (kept * drag[0], kept * drag[1], kept * drag[2])
        for d in range(3):
            stuck[d] = drag[d] / stiffness
    return push * normal[0] - drag[0], push * normal[1] - drag[1], push * normal[2] - drag[2]
