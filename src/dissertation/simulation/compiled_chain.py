"""Forward dynamics of a kinematic tree, compiled for the steps of a simulation.

    M(q) qdd + b(q, qd) = tau        b: gravity, Coriolis and centrifugal forces

Everything is expressed in the base frame about its origin, where inertias and forces of a subtree simply add
up: the mass matrix (composite rigid bodies) and the bias (Newton-Euler) come out of one pass to the tip and
one back. Screws, twists and wrenches are angular part first: (w, v) and (torque, force).

    robot, work = robot_arrays(tree, inertias), workspace(count)
    dynamics(robot, q, v, work)               # frames, screws, M and b at this state
    step(robot, q, v, torques, dt, work)      # semi-implicit Euler; the workspace is then at the new state
"""

from typing import NamedTuple

import numpy as np

from structlearn.core.compilation import compiled_inside, cross, numba
from structlearn.rigid_body.compiled_dynamics import joint_placement
from structlearn.rigid_body.tree import RobotArrays


class ChainState(NamedTuple):
    """Quantities at one state, expressed in the base frame about its origin."""

    frame: np.ndarray  # (n, 3, 3) rotation of each link's joint frame
    place: np.ndarray  # (n, 3) m, its origin
    screw: np.ndarray  # (n, 6) twist of each link for unit speed of its joint
    mass_matrix: np.ndarray  # (n, n) M; overwritten with its factor by `accelerations`
    bias: np.ndarray  # (n,) b in N m or N
    twist: np.ndarray  # (n, 6) of each link
    bias_acceleration: (
        np.ndarray
    )  # (n, 6) acceleration of each link at qdd = 0; gravity counts as upward acceleration
    # (n, 10) inertia of each link and its subtree: mass, first moment, xx, xy, xz, yy, yz, zz
    composite: np.ndarray
    wrench: np.ndarray  # (n, 6) wrench that gives the subtree these accelerations
    turn: np.ndarray  # (3, 3) scratch
    offset: np.ndarray  # (3,) scratch


def workspace(count: int) -> ChainState:
    """Preallocated workspace for a robot with `count` joints."""
    shapes = [(count, 3, 3), (count, 3), (count, 6), (count, count), (count,)]
    shapes += [(count, 6), (count, 6), (count, 10), (count, 6), (3, 3), (3,)]
    return ChainState(*(np.zeros(shape) for shape in shapes))


@numba.njit(cache=True, error_model="numpy")
def step(
    robot: RobotArrays, q: np.ndarray, v: np.ndarray, torques: np.ndarray, dt: float, work: ChainState
) -> None:
    """Advance q and v (n,) by a semi-implicit Euler step of dt s, as PyBullet does.

    Torques (n,) are overwritten with the accelerations. The workspace must hold `dynamics` at q and v, and
    afterwards holds it at the new state.
    """
    accelerations(work, torques)
    for j in range(len(q)):
        v[j] += dt * torques[j]
        q[j] += dt * v[j]
    dynamics(robot, q, v, work)


@numba.njit(cache=True, error_model="numpy")
def accelerations(work: ChainState, torques: np.ndarray) -> None:
    """Overwrite joint torques (n,) with accelerations, at the state of the last `dynamics`."""
    for j in range(len(torques)):
        torques[j] -= work.bias[j]
    factorise(work.mass_matrix)
    solve(work.mass_matrix, torques)


@numba.njit(cache=True, error_model="numpy")
def dynamics(robot: RobotArrays, q: np.ndarray, v: np.ndarray, work: ChainState) -> None:
    """Fill the workspace at positions and velocities (n,) of the joints."""
    count = len(q)
    kinematics(robot, q, work)
    for j in range(count):
        _move(robot.parents[j], robot.gravity, v[j], j, work)
        _carry(robot.mass[j], robot.centre[j], robot.inertia[j], j, work)
        for i in range(count):
            work.mass_matrix[j, i] = 0.0
    for j in range(count - 1, -1, -1):
        parent, screw, wrench = robot.parents[j], work.screw[j], work.wrench[j]
        work.bias[j] = _power(screw, wrench)
        momentum = _momentum(work.composite[j], screw)
        i = j
        while i >= 0:
            entry = _power(work.screw[i], momentum)
            work.mass_matrix[i, j] = entry
            work.mass_matrix[j, i] = entry
            i = robot.parents[i]
        if parent >= 0:
            for k in range(6):
                work.wrench[parent, k] += wrench[k]
            for k in range(10):
                work.composite[parent, k] += work.composite[j, k]


@numba.njit(cache=True, error_model="numpy")
def kinematics(robot: RobotArrays, q: np.ndarray, work: ChainState) -> None:
    """Fill frames, origins and screws at positions (n,) of the joints."""
    for j in range(len(q)):
        parent, frame, place = robot.parents[j], work.frame[j], work.place[j]
        turn, offset = work.turn, work.offset
        joint_placement(robot, j, q[j], turn, offset)
        for row in range(3):
            if parent < 0:
                place[row] = offset[row]
            else:
                place[row] = work.place[parent, row] + _row(work.frame[parent], row, offset)
            for k in range(3):
                frame[row, k] = turn[row, k]
                if parent >= 0:
                    above = work.frame[parent, row]
                    frame[row, k] = above[0] * turn[0, k] + above[1] * turn[1, k] + above[2] * turn[2, k]
        own = robot.axis[j]
        axis = (_row(frame, 0, own), _row(frame, 1, own), _row(frame, 2, own))
        linear = axis if robot.prismatic[j] else cross(place, axis)
        for k in range(3):
            work.screw[j, k] = 0.0 if robot.prismatic[j] else axis[k]
            work.screw[j, 3 + k] = linear[k]


@numba.njit(cache=True, error_model="numpy")
def factorise(matrix: np.ndarray) -> None:
    """Overwrite the upper triangle of a positive definite matrix (n, n) by U, matrix = U^T U (Cholesky)."""
    count = len(matrix)
    for j in range(count):  # row by row: inner loops then run along memory
        pivot = 1.0 / np.sqrt(matrix[j, j])
        for k in range(j, count):
            matrix[j, k] *= pivot
        for i in range(j + 1, count):
            share = matrix[j, i]
            for k in range(i, count):
                matrix[i, k] -= share * matrix[j, k]


@numba.njit(cache=True, error_model="numpy")
def solve(factor: np.ndarray, right: np.ndarray) -> None:
    """Overwrite the right-hand side (n,) with the solution; `factor` (n, n) comes from `factorise`."""
    count = len(right)
    for i in range(count):
        right[i] /= factor[i, i]
        for k in range(i + 1, count):
            right[k] -= factor[i, k] * right[i]
    for i in range(count - 1, -1, -1):
        rest = right[i]
        for k in range(i + 1, count):
            rest -= factor[i, k] * right[k]
        right[i] = rest / factor[i, i]


@numba.njit(cache=True, error_model="numpy", inline="always")
def _row(matrix: np.ndarray, row: int, vector: np.ndarray) -> float:
    """One row of a (3, 3) matrix times a (3,) vector."""
    return matrix[row, 0] * vector[0] + matrix[row, 1] * vector[1] + matrix[row, 2] * vector[2]


@numba.njit(cache=True, error_model="numpy", inline="always")
def _power(screw: np.ndarray, wrench: np.ndarray | tuple) -> float:
    """Power of a wrench (6,) on a screw (6,)."""
    return (
        (screw[0] * wrench[0] + screw[1] * wrench[1] + screw[2] * wrench[2])
        + (screw[3] * wrench[3] + screw[4] * wrench[4])
        + screw[5] * wrench[5]
    )


@compiled_inside
def _move(parent: int, gravity: np.ndarray, speed: float, j: int, work: ChainState) -> None:
    """Write a link's twist and its acceleration at qdd = 0, from those of its parent."""
    twist, bias_acceleration, screw = work.twist[j], work.bias_acceleration[j], work.screw[j]
    for k in range(3):
        bias_acceleration[k] = 0.0
        bias_acceleration[3 + k] = -gravity[k]
    for k in range(6):
        twist[k] = speed * screw[k]
        if parent >= 0:
            twist[k] += work.twist[parent, k]
            bias_acceleration[k] = work.bias_acceleration[parent, k]
    w, v = (twist[0], twist[1], twist[2]), (twist[3], twist[4], twist[5])
    own_w, own_v = (screw[0], screw[1], screw[2]), (screw[3], screw[4], screw[5])
    angular, linear, centripetal = cross(w, own_w), cross(w, own_v), cross(v, own_w)
    for k in range(3):
        bias_acceleration[k] += speed * angular[k]
        bias_acceleration[3 + k] += speed * (linear[k] + centripetal[k])


@compiled_inside
def _carry(mass: float, centre: np.ndarray, inertia: np.ndarray, j: int, work: ChainState) -> None:
    """Write a link's own inertia, and the wrench for the acceleration that `_move` wrote."""
    frame, place, turn, own = work.frame[j], work.place[j], work.turn, work.composite[j]
    c = (
        place[0] + _row(frame, 0, centre),
        place[1] + _row(frame, 1, centre),
        place[2] + _row(frame, 2, centre),
    )
    for row in range(3):
        for k in range(3):
            turn[row, k] = (
                frame[row, 0] * inertia[0, k] + frame[row, 1] * inertia[1, k] + frame[row, 2] * inertia[2, k]
            )
    own[0] = mass
    for k in range(3):
        own[1 + k] = mass * c[k]
    own[4] = _row(frame, 0, turn[0]) + mass * (c[1] * c[1] + c[2] * c[2])  # parallel axes
    own[5] = _row(frame, 1, turn[0]) - mass * c[0] * c[1]
    own[6] = _row(frame, 2, turn[0]) - mass * c[0] * c[2]
    own[7] = _row(frame, 1, turn[1]) + mass * (c[0] * c[0] + c[2] * c[2])
    own[8] = _row(frame, 2, turn[1]) - mass * c[1] * c[2]
    own[9] = _row(frame, 2, turn[2]) + mass * (c[0] * c[0] + c[1] * c[1])
    twist = work.twist[j]
    momentum, force = _momentum(own, twist), _momentum(own, work.bias_acceleration[j])
    w, v = (twist[0], twist[1], twist[2]), (twist[3], twist[4], twist[5])
    angular, linear = (momentum[0], momentum[1], momentum[2]), (momentum[3], momentum[4], momentum[5])
    turning, pulling, moving = cross(w, angular), cross(v, linear), cross(w, linear)
    for k in range(3):
        work.wrench[j, k] = force[k] + turning[k] + pulling[k]
        work.wrench[j, 3 + k] = force[3 + k] + moving[k]


@numba.njit(cache=True, error_model="numpy", inline="always")
def _momentum(own: np.ndarray, twist: np.ndarray) -> tuple:
    """Angular, then linear momentum: an inertia (10,) as in `Workspace.composite` times a twist (6,)."""
    w, v, h = (twist[0], twist[1], twist[2]), (twist[3], twist[4], twist[5]), (own[1], own[2], own[3])
    angular, linear = cross(h, v), cross(h, w)
    return (
        own[4] * w[0] + own[5] * w[1] + own[6] * w[2] + angular[0],
        own[5] * w[0] + own[7] * w[1] + own[8] * w[2] + angular[1],
        own[6] * w[0] + own[8] * w[1] + own[9] * w[2] + angular[2],
        own[0] * v[0] - linear[0],
        own[0] * v[1] - linear[1],
        own[0] * v[2] - linear[2],
    )
