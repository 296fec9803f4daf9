"""Velocity-based operational-space control of an arm's tool point (dissertation III.4.1.1, ref. 60).

The variant of Nakanishi et al. (2008) without integration of joint velocities: a reference velocity of the
tool gives a joint velocity and, differentiated, a joint acceleration, and inverse dynamics the torques.

    xd_r = xd_d + K_x (x_d - x)                qd_r = J+ xd_r + (1 - J+ J) K_n (q_0 - q)
    qdd_r = J+ (xdd_d + K_x (xd_d - xd) - Jd qd) - (1 - J+ J) K_n qd
    tau = f_ID(q, qd, qdd_r) + D (qd_r - qd)

D is the robot's joint damping, the same for all models. The scraping robot has a force-based controller,
`dissertation.scraping.world.operational_space`.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pydantic import Field

from dissertation.simulation.compiled_chain import ChainState, factorise, kinematics, solve, workspace
from structlearn.core.compilation import compiled_inside, cross, numba
from structlearn.core.params import Parameters
from structlearn.rigid_body.tree import KinematicTree, LinkInertias, RobotArrays, robot_arrays

DAMPING = 1e-6  # m^2; keeps the Jacobian's pseudo-inverse finite when the arm is stretched out


class VelocityControlParameters(Parameters):
    """Gains of the velocity-based controller."""

    tool_1_s: float = Field(gt=0)
    posture_1_s: float = Field(ge=0)


class VelocityControl(NamedTuple):
    """Constants of the control law."""

    tool_m: np.ndarray  # (3,) the tool point in the last joint's frame
    posture: np.ndarray  # (n,) rad, target of the null space
    tool_1_s: float  # K_x
    posture_1_s: float  # K_n


@numba.njit(cache=True)
def joint_reference(
    control: VelocityControl,
    robot: RobotArrays,
    work: ChainState,
    q: np.ndarray,
    qd: np.ndarray,
    x_wanted: np.ndarray,
    xd_wanted: np.ndarray,
    xdd_wanted: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Joint velocity qd_r (n,) in rad/s and acceleration qdd_r (n,) in rad/s^2 of the module's control law.

    Only the kinematics of `robot` are used; `work` holds the results of `compiled_chain.dynamics` at q and
    qd (n,). The tool references are (3,) in m, m/s and m/s^2 in the base frame.
    """
    count, position = len(q), _point(work, control.tool_m)
    jacobian = _jacobian(robot, work, position)
    velocity, gram = np.zeros(3), np.zeros((3, 3))  # J qd;  J J^T + damping
    # right-hand sides minus the null-space part; then multiplied by (J J^T)^-1
    speed, acceleration = np.empty(3), np.empty(3)
    for row in range(3):
        gram[row, row] = DAMPING
        for j in range(count):
            velocity[row] += jacobian[row, j] * qd[j]
            for k in range(3):
                gram[row, k] += jacobian[row, j] * jacobian[k, j]
    bias, tool_gain, gain = _bias(robot, work, position, velocity), control.tool_1_s, control.posture_1_s
    for row in range(3):
        speed[row] = xd_wanted[row] + tool_gain * (x_wanted[row] - position[row])
        acceleration[row] = xdd_wanted[row] + tool_gain * (xd_wanted[row] - velocity[row]) - bias[row]
        for j in range(count):
            speed[row] -= jacobian[row, j] * gain * (control.posture[j] - q[j])
            acceleration[row] += jacobian[row, j] * gain * qd[j]
    factorise(gram)
    solve(gram, speed)  # J+ = J^T (J J^T + damping)^-1
    solve(gram, acceleration)
    reference, change = np.empty(count), np.empty(count)
    for j in range(count):
        reference[j] = gain * (control.posture[j] - q[j])
        change[j] = -gain * qd[j]
        for row in range(3):
            reference[j] += jacobian[row, j] * speed[row]
            change[j] += jacobian[row, j] * acceleration[row]
    return reference, change


def tool_motion(
    tree: KinematicTree, tool_m: np.ndarray | Sequence[float], q: np.ndarray, qd: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity (T, 3) of a point (3,) of the last link along a motion q, qd (T, n)."""
    position, velocity = np.empty((len(q), 3)), np.empty((len(q), 3))
    count = len(tree.names)
    any_masses = LinkInertias(np.ones(count), np.zeros((count, 3)), np.zeros((count, 3, 3)))
    motion = (np.ascontiguousarray(q), np.ascontiguousarray(qd), position, velocity)
    _tool_motion(robot_arrays(tree, any_masses), workspace(count), np.array(tool_m, dtype=float), *motion)
    return position, velocity


@numba.njit(cache=True)
def _tool_motion(
    robot: RobotArrays,
    work: ChainState,
    tool_m: np.ndarray,
    q: np.ndarray,
    qd: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
) -> None:
    for row in range(len(q)):
        kinematics(robot, q[row], work)
        point = _point(work, tool_m)
        jacobian = _jacobian(robot, work, point)
        for k in range(3):
            position[row, k] = point[k]
            velocity[row, k] = 0.0
            for j in range(len(qd[row])):
                velocity[row, k] += jacobian[k, j] * qd[row, j]


@compiled_inside
def _point(work: ChainState, tool_m: np.ndarray) -> np.ndarray:
    """Position (3,) of a point of the last link in the base frame."""
    point = work.place[-1].copy()
    for row in range(3):
        for k in range(3):
            point[row] += work.frame[-1, row, k] * tool_m[k]
    return point


@compiled_inside
def _jacobian(robot: RobotArrays, work: ChainState, point: np.ndarray) -> np.ndarray:
    """Jacobian (3, n) of the velocity of a point of the last link."""
    jacobian = np.zeros((3, len(work.screw)))
    joint = len(work.screw) - 1
    while joint >= 0:
        screw = work.screw[joint]
        sweep = cross(screw, point)
        for row in range(3):
            jacobian[row, joint] = screw[3 + row] + sweep[row]
        joint = robot.parents[joint]
    return jacobian


@compiled_inside
def _bias(robot: RobotArrays, work: ChainState, point: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Bias Jd qd (3,): acceleration of a point of the last link at qdd = 0."""
    acceleration = work.bias_acceleration[-1]  # spatial acceleration, with gravity as an upward acceleration
    pull, inward = cross(acceleration, point), cross(work.twist[-1], velocity)
    bias = np.empty(3)
    for k in range(3):
        bias[k] = acceleration[3 + k] + robot.gravity[k] + pull[k] + inward[k]
    return bias
