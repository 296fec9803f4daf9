"""Operational-space control of the arm (Khatib 1987): joint torques from a pose reference.

    tau = J^T Lambda (K e + D (v_d - v) + a_d) + N^T M (K_0 (q_0 - q) - D_0 qd) + nle        D = 2 sqrt(K)

Lambda = (J M^-1 J^T)^-1 gives the hand unit mass in all directions, so one critically damped stiffness fits
position and orientation; the null-space term holds the elbow; nle are gravity, Coriolis and centrifugal
forces of the arm with its hand and tool.
"""

from typing import NamedTuple

import numpy as np

from dissertation.simulation.compiled_chain import ChainState, dynamics, factorise, solve, workspace
from structlearn.core.compilation import cross, numba
from structlearn.rigid_body.robot import Robot
from structlearn.rigid_body.tree import RobotArrays, robot_arrays

ELBOW_STIFFNESS, ELBOW_DAMPING = 40.0, 12.0  # 1/s^2 and 1/s; slow, since the elbow need not hurry


class ArmModel(NamedTuple):
    """The controller's model of the arm, and its observations in the base frame."""

    arrays: RobotArrays  # arm with hand and unloaded tool
    work: ChainState
    edge_rotation: np.ndarray  # (3, 3) edge frame in the last link's frame
    edge_place: np.ndarray  # (3,) m, its origin there
    posture: np.ndarray  # (7,) rad, target of the null space
    q: np.ndarray  # (7,) rad, last observed
    v: np.ndarray  # (7,) rad/s, last observed
    position: np.ndarray  # (3,) m of the edge frame at q
    rotation: np.ndarray  # (3, 3) of the edge frame
    twist: np.ndarray  # (6,) m/s and rad/s of the edge frame
    jacobian: np.ndarray  # (6, 7) of the edge frame's twist
    torques: np.ndarray  # (7,) N m, last commanded
    mobility: np.ndarray  # (6, 7) M^-1 J^T, transposed
    inverse_inertia: np.ndarray  # (6, 6) inverse of Lambda


class Target(NamedTuple):
    """Desired motion of the edge frame."""

    position: np.ndarray  # (3,) m
    rotation: np.ndarray  # (3, 3)
    twist: np.ndarray  # (6,) m/s and rad/s
    acceleration: np.ndarray  # (6,) m/s^2 and rad/s^2


def controlled(robot: Robot, posture: np.ndarray) -> ArmModel:
    """Controller state for the arm of `scraping_robot.arm`, with null-space posture (7,) in rad."""
    count, model = len(posture), robot.model
    edge = model.frames[model.getFrameId("edge")].placement
    return ArmModel(
        arrays=robot_arrays(robot.tree, robot.inertias),
        work=workspace(count),
        edge_rotation=np.ascontiguousarray(edge.rotation),
        edge_place=edge.translation.copy(),
        posture=posture.copy(),
        q=np.zeros(count),
        v=np.zeros(count),
        position=np.zeros(3),
        rotation=np.eye(3),
        twist=np.zeros(6),
        jacobian=np.zeros((6, count)),
        torques=np.zeros(count),
        mobility=np.zeros((6, count)),
        inverse_inertia=np.zeros((6, 6)),
    )


@numba.njit(cache=True, error_model="numpy")
def observe(arm: ArmModel, q: np.ndarray, v: np.ndarray) -> None:
    """Compute the arm's kinematics and dynamics at q and v, of which the first entries are the arm's."""
    count = len(arm.q)
    arm.q[:], arm.v[:] = q[:count], v[:count]
    work, jacobian = arm.work, arm.jacobian
    dynamics(arm.arrays, arm.q, arm.v, work)
    frame, place, x = work.frame[-1], work.place[-1], arm.position
    for i in range(3):
        x[i] = place[i]
        for k in range(3):
            x[i] += frame[i, k] * arm.edge_place[k]
            arm.rotation[i, k] = (
                frame[i, 0] * arm.edge_rotation[0, k]
                + frame[i, 1] * arm.edge_rotation[1, k]
                + frame[i, 2] * arm.edge_rotation[2, k]
            )
    arm.twist[:] = 0.0
    for j in range(count):
        screw = work.screw[j]
        sweep = cross(screw, x)
        for k in range(3):
            jacobian[k, j] = screw[3 + k] + sweep[k]
            jacobian[3 + k, j] = screw[k]
        for k in range(6):
            arm.twist[k] += jacobian[k, j] * v[j]


@numba.njit(cache=True, error_model="numpy")
def control(arm: ArmModel, target: Target, stiffness: float, force: np.ndarray) -> None:
    """Write the joint torques towards a target, for the last observed state; call once per observation.

    `stiffness`: K in 1/s^2, the squared natural frequency. `force`: (6,) additional wrench on the hand at the
    edge frame, N and N m, base frame.
    """
    count, mass, jacobian, torques = len(arm.q), arm.work.mass_matrix, arm.jacobian, arm.torques
    wanted = np.empty(6)
    for k in range(3):
        wanted[k] = target.position[k] - arm.position[k]
    write_rotation_error(target.rotation, arm.rotation, wanted[3:])
    damping = 2.0 * np.sqrt(stiffness)
    for k in range(6):
        wanted[k] = (
            stiffness * wanted[k] + damping * (target.twist[k] - arm.twist[k]) + target.acceleration[k]
        )
    for i in range(count):
        torques[i] = 0.0
        for j in range(count):
            pull = ELBOW_STIFFNESS * (arm.posture[j] - arm.q[j]) - ELBOW_DAMPING * arm.v[j]
            torques[i] += mass[i, j] * pull
    factorise(mass)
    for k in range(6):
        for j in range(count):
            arm.mobility[k, j] = jacobian[k, j]
        solve(mass, arm.mobility[k])
        for m in range(k + 1):
            arm.inverse_inertia[m, k] = 0.0
            for j in range(count):
                arm.inverse_inertia[m, k] += jacobian[m, j] * arm.mobility[k, j]
        # N^T = 1 - J^T Lambda J M^-1 removes the part of the posture torque that would move the hand
        for j in range(count):
            wanted[k] -= arm.mobility[k, j] * torques[j]
    factorise(arm.inverse_inertia)
    solve(arm.inverse_inertia, wanted)
    for j in range(count):
        torques[j] += arm.work.bias[j]
        for k in range(6):
            torques[j] += jacobian[k, j] * (wanted[k] + force[k])


@numba.njit(cache=True, error_model="numpy")
def write_rotation_error(goal: np.ndarray, now: np.ndarray, error: np.ndarray) -> None:
    """Write the rotation vector (3,) in rad, base frame, from orientation `now` (3, 3) to `goal` (3, 3)."""
    turn = np.empty((3, 3))
    for i in range(3):
        for k in range(3):
            turn[i, k] = goal[i, 0] * now[k, 0] + goal[i, 1] * now[k, 1] + goal[i, 2] * now[k, 2]
    error[0] = 0.5 * (turn[2, 1] - turn[1, 2])
    error[1] = 0.5 * (turn[0, 2] - turn[2, 0])
    error[2] = 0.5 * (turn[1, 0] - turn[0, 1])
    sine = np.sqrt(error[0] * error[0] + error[1] * error[1] + error[2] * error[2])
    if sine >= 1e-9:
        angle = np.arctan2(sine, 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0))
        for k in range(3):
            error[k] *= angle / sine
