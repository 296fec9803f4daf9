"""The tool's edge on the tilting board, and how its force loads the robot's joints.

The board is a plane; the 11 mm edge is a row of points on a Winkler foundation: each pushes back in
proportion to how deep it is, with damping, and sticks to the board by a tangential spring until that pulls
with the Coulomb force, from which on it slides. (Friction as a function of speed alone either chatters at the
physics step, or lets a standing tool creep.)
A physics engine's own box contact was tried: it hits with 1-2 N and hides the roll torque in stiction. The
force enters as joint torques through the transposed Jacobian, which is what the force does and saves calls.
"""

import numba
import numpy as np

from structlearn.ground.compiled_vectors import cross
from structlearn.testbeds.scraping.world.layout import EDGE_WIDTH_M

EDGE_POINTS = 11

POINTS = ((np.arange(EDGE_POINTS) + 0.5) / EDGE_POINTS - 0.5) * EDGE_WIDTH_M
"""m along the edge, which lies along the grasp's x axis: the middle of equal pieces. With points at its ends
the roll torque of a tilted board would be a fifth too large."""


@numba.njit(cache=True)
def step_forces(
    q: np.ndarray,
    v: np.ndarray,
    rotation: np.ndarray,
    translation: np.ndarray,
    axis: np.ndarray,
    prismatic: np.ndarray,
    edge: float,
    point: np.ndarray,
    normal: np.ndarray,
    board: np.ndarray,
    dt: float,
    stuck: np.ndarray,
    tool_to_base: np.ndarray,
    edge_position: np.ndarray,
    wrench: np.ndarray,
    torques: np.ndarray,
) -> None:
    """Contact wrench on the tool at its edge, and the joint torques that it amounts to.

    Args:
        q: (J,) joint positions.
        v: (J,) joint velocities.
        rotation: (J, 3, 3) of the chain (`scraping_robot.Chain`), like the three that follow.
        translation: (J, 3) m.
        axis: (J, 3).
        prismatic: (J,).
        edge: m, distance of the edge from the last joint along its z axis.
        point: (3,) m, a point of the board.
        normal: (3,) its normal.
        board: stiffness of the whole edge in N/m, damping in s/m, friction coefficient, tangential stiffness
            of the whole edge in N/m and its damping in N s/m.
        dt: s since the last call.
        stuck: (EDGE_POINTS, 3) m, deflection of the tangential springs; carried on from call to call.
        tool_to_base: (3, 3) written: rotation of the tool.
        edge_position: (3,) written: middle of the edge.
        wrench: (6,) written: force of the board on the tool, and its torque about the middle of the edge.
        torques: (J,) written: joint torques of that wrench.
    """
    joints = len(q)
    frame, place = np.eye(3), np.zeros(3)
    axes, origins = np.empty((joints, 3)), np.empty((joints, 3))
    turned, turn = np.empty((3, 3)), np.empty((3, 3))
    for j in range(joints):
        for i in range(3):
            place[i] += _row(frame, i, translation[j])
        _multiply(frame, rotation[j], turned)
        for i in range(3):
            axes[j, i] = _row(turned, i, axis[j])
            origins[j, i] = place[i]
        if prismatic[j]:
            place += q[j] * axes[j]
            frame[:] = turned
        else:
            _turn(axis[j], q[j], turn)
            _multiply(turned, turn, frame)
    tool_to_base[:] = frame
    along_edge = frame[:, 0].copy()
    middle = place + edge * frame[:, 2]
    edge_position[:] = middle
    wrench[:] = 0.0
    torques[:] = 0.0
    reach = 0.5 * EDGE_WIDTH_M * abs(along_edge @ normal)
    if (middle - point) @ normal - reach > 0.0:
        stuck[:] = 0.0
        return  # in the air

    linear, angular = np.zeros(3), np.zeros(3)
    for j in range(joints):
        if prismatic[j]:
            linear += v[j] * axes[j]
        else:
            linear += v[j] * np.array(cross(axes[j], middle - origins[j]))
            angular += v[j] * axes[j]
    stiffness, sticking, sticking_damping = (
        board[0] / EDGE_POINTS,
        board[3] / EDGE_POINTS,
        board[4] / EDGE_POINTS,
    )
    for i in range(EDGE_POINTS):
        arm = POINTS[i] * along_edge
        depth = (point - middle - arm) @ normal
        if depth <= 0.0:
            stuck[i] = 0.0
            continue
        velocity = linear + np.array(cross(angular, arm))
        approach = velocity @ normal
        push = max(stiffness * depth * (1.0 - board[1] * approach), 0.0)
        slip = velocity - approach * normal
        deflection = stuck[i] + dt * slip
        deflection -= (deflection @ normal) * normal
        drag = sticking * deflection + sticking_damping * slip
        size, largest = np.sqrt(drag @ drag), board[2] * push
        if size > largest:  # it slides, and the spring keeps what it can hold
            drag *= largest / size
            deflection = drag / sticking
        stuck[i] = deflection
        force = push * normal - drag
        wrench[:3] += force
        wrench[3:] += np.array(cross(arm, force))
    for j in range(joints):
        if prismatic[j]:
            torques[j] = axes[j] @ wrench[:3]
        else:
            torques[j] = axes[j] @ (wrench[3:] + np.array(cross(middle - origins[j], wrench[:3])))


# Written out: for matrices this small a call of the linear algebra library costs more than the products.
@numba.njit(cache=True)
def _multiply(a: np.ndarray, b: np.ndarray, product: np.ndarray) -> None:
    """Product of two (3, 3) matrices, written to the third."""
    for i in range(3):
        for j in range(3):
            product[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@numba.njit(cache=True)
def _row(a: np.ndarray, i: int, vector: np.ndarray) -> float:
    """Row i of the product of a (3, 3) matrix and a (3,) vector."""
    return a[i, 0] * vector[0] + a[i, 1] * vector[1] + a[i, 2] * vector[2]


@numba.njit(cache=True)
def _turn(axis: np.ndarray, angle: float, turn: np.ndarray) -> None:
    """Write the rotation (3, 3) by an angle in rad about a unit axis (3,) (Rodrigues)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    rest = 1.0 - cosine
    for i in range(3):
        for j in range(3):
            turn[i, j] = axis[i] * axis[j] * rest
        turn[i, i] += cosine
    turn[0, 1] -= axis[2] * sine
    turn[0, 2] += axis[1] * sine
    turn[1, 0] += axis[2] * sine
    turn[1, 2] -= axis[0] * sine
    turn[2, 0] -= axis[1] * sine
    turn[2, 1] += axis[0] * sine
