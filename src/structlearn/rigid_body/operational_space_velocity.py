"""Velocity-based operational-space control of an arm's tool point (dissertation III.4.1.1, ref. 60).

Nakanishi et al. (2008), the variant without integration of joint velocities: a reference velocity of the tool
becomes one of the joints, its derivative an acceleration, and inverse dynamics a torque.

    xd_r = xd_d + K_x (x_d - x)                qd_r = J+ xd_r + (1 - J+ J) K_n (q_0 - q)
    qdd_r = J+ (xdd_d + K_x (xd_d - xd) - Jd qd) - (1 - J+ J) K_n qd
    tau = f_ID(q, qd, qdd_r) + D (qd_r - qd)

D is the robot's joint damping, the same for all models. The scraping robot's controller, which works on
forces, is `simulation.operational_space`.
"""

import numba
import numpy as np
from pydantic import Field

from structlearn.ground.compiled_vectors import cross
from structlearn.ground.params import Parameters
from structlearn.rigid_body.compiled_dynamics import chain_arrays, joint_placement
from structlearn.rigid_body.tree import KinematicTree

DAMPING = 1e-6
"""m^2; keeps the pseudo-inverse of the Jacobian finite where the arm is stretched out."""


class VelocityControlParameters(Parameters):
    """Gains of the controller.

    Attributes:
        tool_1_s: K_x, of the tool's position.
        posture_1_s: K_n, towards the posture in the null space.
    """

    tool_1_s: float = Field(gt=0)
    posture_1_s: float = Field(ge=0)


class VelocityControl:
    """The law for one arm; holds the arm's arrays.

    Attributes:
        position: (3,) m of the tool at the last call, base frame.
        velocity: (3,) m/s.
    """

    def __init__(
        self,
        tree: KinematicTree,
        tool_m: np.ndarray,
        posture: np.ndarray,
        parameters: VelocityControlParameters,
    ) -> None:
        """Choose what is controlled.

        Args:
            tree: the arm; the tool is on its last link.
            tool_m: (3,) the tool point in the last joint's frame.
            posture: (n,) rad, to which the null space pulls.
            parameters: gains.
        """
        self._arm = (*chain_arrays(tree), np.array(tool_m, dtype=float))
        self._posture = np.array(posture, dtype=float)
        self._gains = np.array([parameters.tool_1_s, parameters.posture_1_s])
        self.position, self.velocity = np.zeros(3), np.zeros(3)

    def reference(
        self, q: np.ndarray, qd: np.ndarray, wanted: tuple[np.ndarray, np.ndarray, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Joint velocity qd_r (n,) in rad/s and acceleration qdd_r (n,) in rad/s^2.

        Args:
            q: (n,) rad.
            qd: (n,) rad/s.
            wanted: the tool's position, velocity and acceleration, (3,) each, base frame.
        """
        return _law(*self._arm, self._posture, self._gains, q, qd, *wanted, self.position, self.velocity)


def tool_motion(
    tree: KinematicTree, tool_m: np.ndarray, q: np.ndarray, qd: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity (T, 3) of a point of the last link along a motion.

    Args:
        tree: the arm.
        tool_m: (3,) in the last joint's frame.
        q: (T, n) rad.
        qd: (T, n) rad/s.
    """
    position, velocity = np.empty((len(q), 3)), np.empty((len(q), 3))
    arm = (*chain_arrays(tree), np.array(tool_m, dtype=float))
    _tool_motion(*arm, np.ascontiguousarray(q), np.ascontiguousarray(qd), position, velocity)
    return position, velocity


@numba.njit(cache=True)
def _kinematics(
    parents: np.ndarray,
    rotation: np.ndarray,
    translation: np.ndarray,
    axis: np.ndarray,
    prismatic: np.ndarray,
    tool: np.ndarray,
    q: np.ndarray,
    qd: np.ndarray,
    position: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Write the tool's position; return its Jacobian (3, n) and Jd qd (3,), its acceleration at qdd = 0."""
    count = len(q)
    orientation, origin = np.empty((count, 3, 3)), np.empty((count, 3))
    axes = np.empty((count, 3))
    spin, spin_rate, lift = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3))
    turn, offset, reach = np.empty((3, 3)), np.empty(3), np.empty(3)
    for i in range(count):
        joint_placement(rotation[i], translation[i], axis[i], prismatic[i], q[i], turn, offset)
        parent = parents[i]
        if parent < 0:
            orientation[i] = turn
            origin[i] = offset
        else:
            over = orientation[parent]
            for row in range(3):
                reach[row] = over[row, 0] * offset[0] + over[row, 1] * offset[1] + over[row, 2] * offset[2]
                for k in range(3):
                    orientation[i, row, k] = (
                        over[row, 0] * turn[0, k] + over[row, 1] * turn[1, k] + over[row, 2] * turn[2, k]
                    )
            origin[i] = origin[parent] + reach
            spin[i], spin_rate[i] = spin[parent], spin_rate[parent]
            lift[i] = lift[parent] + _carried(spin[parent], spin_rate[parent], reach)
        for row in range(3):
            axes[i, row] = (
                orientation[i, row, 0] * axis[i, 0]
                + orientation[i, row, 1] * axis[i, 1]
                + orientation[i, row, 2] * axis[i, 2]
            )
        coriolis = cross(spin[i], axes[i])
        for k in range(3):
            if prismatic[i]:
                lift[i, k] += 2.0 * coriolis[k] * qd[i]
            else:
                spin_rate[i, k] += coriolis[k] * qd[i]
        if not prismatic[i]:
            spin[i] += axes[i] * qd[i]
    last = count - 1
    for row in range(3):
        reach[row] = 0.0
        for k in range(3):
            reach[row] += orientation[last, row, k] * tool[k]
    position[:] = origin[last] + reach
    bias = lift[last] + _carried(spin[last], spin_rate[last], reach)
    jacobian = np.zeros((3, count))
    joint = last
    while joint >= 0:
        if prismatic[joint]:
            jacobian[:, joint] = axes[joint]
        else:
            lever = cross(axes[joint], position - origin[joint])
            for row in range(3):
                jacobian[row, joint] = lever[row]
        joint = parents[joint]
    return jacobian, bias


@numba.njit(cache=True)
def _tool_motion(
    parents: np.ndarray,
    rotation: np.ndarray,
    translation: np.ndarray,
    axis: np.ndarray,
    prismatic: np.ndarray,
    tool: np.ndarray,
    q: np.ndarray,
    qd: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
) -> None:
    for row in range(len(q)):
        jacobian, _ = _kinematics(
            parents, rotation, translation, axis, prismatic, tool, q[row], qd[row], position[row]
        )
        velocity[row] = jacobian @ qd[row]


@numba.njit(cache=True)
def _carried(spin: np.ndarray, spin_rate: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Acceleration (3,) of a point of a turning body against the body's origin."""
    sweep, pull = np.array(cross(spin, reach)), cross(spin_rate, reach)
    inward = cross(spin, sweep)
    return np.array((pull[0] + inward[0], pull[1] + inward[1], pull[2] + inward[2]))


@numba.njit(cache=True)
def _law(
    parents: np.ndarray,
    rotation: np.ndarray,
    translation: np.ndarray,
    axis: np.ndarray,
    prismatic: np.ndarray,
    tool: np.ndarray,
    posture: np.ndarray,
    gains: np.ndarray,
    q: np.ndarray,
    qd: np.ndarray,
    x_wanted: np.ndarray,
    xd_wanted: np.ndarray,
    xdd_wanted: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """The law in the module's header; writes the tool's position and velocity."""
    jacobian, bias = _kinematics(parents, rotation, translation, axis, prismatic, tool, q, qd, position)
    velocity[:] = jacobian @ qd
    inverse = jacobian.T @ np.linalg.inv(jacobian @ jacobian.T + DAMPING * np.eye(3))  # J+
    pull = gains[1] * (posture - q)
    reference = inverse @ (xd_wanted + gains[0] * (x_wanted - position) - jacobian @ pull) + pull
    change = inverse @ (xdd_wanted + gains[0] * (xd_wanted - velocity) - bias + gains[1] * (jacobian @ qd))
    return reference, change - gains[1] * qd
