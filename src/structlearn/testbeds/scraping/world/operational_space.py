"""Operational-space control of the arm (Khatib 1987): a pose reference becomes joint torques.

    tau = J^T Lambda (K e + D (v_d - v) + a_d) + N^T M (K_0 (q_0 - q) - D_0 qd) + nle        D = 2 sqrt(K)

Lambda = (J M^-1 J^T)^-1 makes the hand a unit mass in all directions, so one critically damped stiffness fits
position and orientation; the null space keeps the elbow where it was; nle are gravity, Coriolis and
centrifugal forces of the arm with its hand and tool.
"""

import numba
import numpy as np
import pinocchio

from structlearn.testbeds.scraping.world.scraping_robot import HOME, ArmModel

ELBOW_STIFFNESS, ELBOW_DAMPING = 40.0, 12.0  # 1/s^2 and 1/s; the elbow is in no hurry


class OperationalSpace:
    """The control law with its workspace; one per arm, since Pinocchio's data are overwritten.

    Attributes:
        position: (3,) m, the edge frame's position at the last call, base frame.
        rotation: (3, 3) its orientation.
        twist: (6,) its velocity in m/s and rad/s, base frame.
    """

    def __init__(self, arm: ArmModel) -> None:
        self._model, self._frame = arm.model, arm.edge_frame
        self._data = arm.model.createData()
        self._posture = HOME.copy()
        self.position = np.zeros(3)
        self.rotation = np.eye(3)
        self.twist = np.zeros(6)

    def hold_posture(self, angles: np.ndarray) -> None:
        """Set the posture (7,) in rad to which the null space pulls."""
        self._posture = angles.copy()

    def observe(self, q: np.ndarray, v: np.ndarray) -> None:
        """Compute kinematics and dynamics at joint positions and velocities (7,) each."""
        model, data = self._model, self._data
        pinocchio.computeAllTerms(model, data, q, v)
        pinocchio.updateFramePlacement(model, data, self._frame)
        self._jacobian = pinocchio.getFrameJacobian(
            model, data, self._frame, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        self._q, self._v = q, v
        placement = data.oMf[self._frame]
        self.position, self.rotation = placement.translation, placement.rotation
        self.twist = self._jacobian @ v

    def torques(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        twist: np.ndarray,
        acceleration: np.ndarray,
        stiffness: float,
        force: np.ndarray,
    ) -> np.ndarray:
        """Joint torques towards a reference, at the last observed state.

        Args:
            position: (3,) m, of the edge frame.
            rotation: (3, 3) of the edge frame.
            twist: (6,) reference velocity, m/s and rad/s in the base frame.
            acceleration: (6,) reference acceleration.
            stiffness: K in 1/s^2, the squared natural frequency.
            force: (6,) additional wrench on the hand at the edge frame, N and N m, base frame.

        Returns:
            (7,) N m.
        """
        data = self._data
        return _control_law(
            data.M,
            self._jacobian,
            data.nle,
            self._q,
            self._v,
            self._posture,
            position - self.position,
            rotation @ self.rotation.T,
            twist - self.twist,
            acceleration,
            stiffness,
            force,
        )


@numba.njit(cache=True)
def _control_law(
    mass: np.ndarray,
    jacobian: np.ndarray,
    bias: np.ndarray,
    q: np.ndarray,
    v: np.ndarray,
    posture: np.ndarray,
    distance: np.ndarray,
    turn: np.ndarray,
    twist_error: np.ndarray,
    acceleration: np.ndarray,
    stiffness: float,
    force: np.ndarray,
) -> np.ndarray:
    """The law in the module's header; `turn` (3, 3) rotates the hand to its reference."""
    jacobian = np.ascontiguousarray(jacobian)
    error = np.empty(6)
    error[:3] = distance
    sine = 0.5 * np.array((turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]))
    norm = np.sqrt(sine @ sine)
    angle = np.arctan2(norm, 0.5 * (turn[0, 0] + turn[1, 1] + turn[2, 2] - 1.0))
    error[3:] = sine if norm < 1e-9 else sine * (angle / norm)
    wanted = stiffness * error + 2.0 * np.sqrt(stiffness) * twist_error + acceleration
    inverse_times_jacobian = np.linalg.solve(np.ascontiguousarray(mass), np.ascontiguousarray(jacobian.T))
    inertia = np.linalg.inv(jacobian @ inverse_times_jacobian)  # Lambda
    elbow = mass @ (ELBOW_STIFFNESS * (posture - q) - ELBOW_DAMPING * v)
    # N^T = 1 - J^T Lambda J M^-1 leaves of the posture torque only what does not move the hand
    null = elbow - jacobian.T @ (inertia @ (inverse_times_jacobian.T @ elbow))
    return jacobian.T @ (inertia @ wanted + force) + null + bias
