"""Motion of an arm along sines in every joint: a model's torques and linear feedback (dissertation III.4.1).

    tau = f_ID(q_r, qd_r, qdd_r) + K (q_r - q) + D (qd_r - qd)

The better the model, the less the feedback has to do. Its gains are those of the robot, the same for all
models: if it went through the model, light wrist joints would have next to none, and friction held them. The
model is asked at the reference: viscous friction that was fitted to Coulomb friction gives more than a fast
joint takes, and at the measured velocity that drives a light wrist away within seconds.
"""

from dataclasses import dataclass
from typing import Protocol

import numba
import numpy as np
from pydantic import Field

from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters
from structlearn.rigid_body.compiled_dynamics import InverseDynamics, inverse_dynamics
from structlearn.rigid_body.tree import KinematicTree, LinkInertias
from structlearn.simulation.arm import Arm


class FeedbackParameters(Parameters):
    """Linear feedback of the joints.

    Attributes:
        stiffness_n_m_rad: of each joint; an arm with fewer joints takes the first ones. A light joint must
            not swing faster than control can follow: 2 N m/rad on 0.001 kg m^2 are 45 rad/s.
        damping_ratio: of each joint alone, with the URDF's inertia in the middle of its range.
    """

    stiffness_n_m_rad: tuple[float, ...]
    damping_ratio: float = Field(gt=0)


class SineParameters(Parameters):
    """The reference and how stiffly it is tracked.

    Attributes:
        duration_s: of the motion.
        rate_hz: of control and log.
        periods_s: of each joint's sine; an arm with fewer joints takes the first ones.
        amplitudes: share of each joint's half range, about the middle of its range.
        feedback: of the joints.
    """

    duration_s: float = Field(gt=0, le=3600)
    rate_hz: float = Field(ge=100, le=2000)
    periods_s: tuple[float, ...]
    amplitudes: tuple[float, ...]
    feedback: FeedbackParameters


@dataclass(frozen=True)
class Feedback:
    """Gains of a robot's joints.

    Attributes:
        stiffness: (n,) N m/rad.
        damping: (n,) N m s/rad.
    """

    stiffness: np.ndarray
    damping: np.ndarray


@dataclass(frozen=True)
class JointPath:
    """T samples of n joints at a uniform rate.

    Attributes:
        q: (T, n) rad.
        qd: (T, n) rad/s.
        qdd: (T, n) rad/s^2.
    """

    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray


@dataclass(frozen=True)
class Run:
    """What a controlled arm did; shorter than its reference where it was stopped.

    Attributes:
        q: (T, n) rad.
        qd: (T, n) rad/s.
        torques: (T, n) N m, of the drives during the step that follows.
        stopped: why it was stopped; None where it ran through.
    """

    q: np.ndarray
    qd: np.ndarray
    torques: np.ndarray
    stopped: str | None


class Policy(Protocol):
    """Torques (n,) in N m at tick k, position and velocity (n,)."""

    def __call__(self, k: int, q: np.ndarray, qd: np.ndarray) -> np.ndarray: ...  # noqa: D102


def joint_range(tree: KinematicTree) -> tuple[np.ndarray, np.ndarray]:
    """Middle and half of each joint's range (n,); a joint without ends turns half a circle either way."""
    lower = np.where(np.isfinite(tree.lower), tree.lower, -np.pi)
    upper = np.where(np.isfinite(tree.upper), tree.upper, np.pi)
    return 0.5 * (lower + upper), 0.5 * (upper - lower)


def joint_feedback(tree: KinematicTree, inertias: LinkInertias, parameters: FeedbackParameters) -> Feedback:
    """Gains of an arm.

    Args:
        tree: the arm.
        inertias: of its URDF.
        parameters: see there.

    Raises:
        InputError: there are fewer stiffnesses than joints.
    """
    stiffness = of_joints("stiffness_n_m_rad", parameters.stiffness_n_m_rad, tree)
    middle, zero = joint_range(tree)[0], np.zeros(len(stiffness))
    torques = inverse_dynamics(tree, inertias)
    weight = torques(middle, zero, zero)
    carried = np.array([(torques(middle, zero, unit) - weight) @ unit for unit in np.eye(len(zero))])
    return Feedback(stiffness, 2.0 * parameters.damping_ratio * np.sqrt(stiffness * carried))


def of_joints(key: str, values: tuple[float, ...], tree: KinematicTree) -> np.ndarray:
    """Values (n,) of an arm's joints from a parameter that has at least as many.

    Raises:
        InputError: it has fewer.
    """
    count = len(tree.names)
    if len(values) < count:
        raise InputError(f"{key}: has {len(values)} values, the arm has {count} joints")
    return np.array(values[:count])


def sine_path(tree: KinematicTree, parameters: SineParameters) -> JointPath:
    """Sines in all joints at once.

    Raises:
        InputError: there are fewer periods or amplitudes than joints, or a joint would be faster than it can.
    """
    middle, half = joint_range(tree)
    amplitude = of_joints("amplitudes", parameters.amplitudes, tree) * half
    frequency = 2.0 * np.pi / of_joints("periods_s", parameters.periods_s, tree)
    fast = amplitude * frequency > tree.velocity
    if fast.any():
        joint = int(np.argmax(fast))
        raise InputError(
            f"periods_s: the sine of joint '{tree.names[joint]}' reaches "
            f"{amplitude[joint] * frequency[joint]:.3g} rad/s, its limit is {tree.velocity[joint]:.3g}"
        )
    time = np.arange(round(parameters.duration_s * parameters.rate_hz)) / parameters.rate_hz
    phase = time[:, None] * frequency
    swing = amplitude * np.sin(phase)
    return JointPath(middle + swing, amplitude * frequency * np.cos(phase), -(frequency**2) * swing)


def sine_policy(torques: InverseDynamics, reference: JointPath, feedback: Feedback) -> Policy:
    """The law in the module's header."""

    def policy(k: int, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        wanted, rate = reference.q[k], reference.qd[k]
        model = torques(wanted, rate, reference.qdd[k])
        return _corrected(model, feedback.stiffness, feedback.damping, wanted, rate, q, qd)

    return policy


@numba.njit(cache=True)
def _corrected(
    torques: np.ndarray,
    stiffness: np.ndarray,
    damping: np.ndarray,
    q_ref: np.ndarray,
    qd_ref: np.ndarray,
    q: np.ndarray,
    qd: np.ndarray,
) -> np.ndarray:
    return torques + stiffness * (q_ref - q) + damping * (qd_ref - qd)


def run(
    arm: Arm, tree: KinematicTree, policy: Policy, ticks: int, torque_limit: np.ndarray, take_at: int = -1
) -> Run:
    """Let a policy move an arm from where it is, until it ends or must be stopped.

    A run is stopped as a robot's safety controller would: a joint is faster than `OVERSPEED` times its limit
    or beyond its range, or the policy's torques are no numbers.

    Args:
        arm: placed.
        tree: limits.
        policy: see there.
        ticks: number of control ticks.
        torque_limit: (n,) N m; torques beyond are cut off.
        take_at: tick at which the arm takes its payload; -1: never.
    """
    count, fastest = len(tree.names), OVERSPEED * tree.velocity
    q, qd, torques = np.empty((ticks, count)), np.empty((ticks, count)), np.empty((ticks, count))
    for k in range(ticks):
        if k == take_at:
            arm.take_payload()
        fault = _fault(arm.q, arm.qd, tree.lower, tree.upper, fastest)
        if fault == 0:
            command = _bounded(policy(k, arm.q, arm.qd), torque_limit)
            fault = 3 if np.isnan(command[0]) else 0
        if fault > 0:
            return Run(q[:k], qd[:k], torques[:k], _FAULTS[fault])
        q[k], qd[k] = arm.q, arm.qd
        arm.step(command)
        torques[k] = arm.torques
    return Run(q, qd, torques, None)


OVERSPEED = 1.5
"""Multiple of its speed limit at which a joint counts as run away; overshoot stays below."""

_FAULTS = ("", "speed limit", "joint limit", "not finite")


@numba.njit(cache=True)
def _fault(q: np.ndarray, qd: np.ndarray, lower: np.ndarray, upper: np.ndarray, fastest: np.ndarray) -> int:
    """Index of what is wrong with a state, as in `_FAULTS`; 0: nothing."""
    for i in range(len(q)):
        if not (np.isfinite(q[i]) and np.isfinite(qd[i])):
            return 3
        if abs(qd[i]) > fastest[i]:
            return 1
        if q[i] < lower[i] or q[i] > upper[i]:
            return 2
    return 0


@numba.njit(cache=True)
def _bounded(torques: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Torques within their limits; all NaN where one is no finite number."""
    out = np.empty(len(torques))
    for i in range(len(torques)):
        if not np.isfinite(torques[i]):
            out[:] = np.nan
            return out
        out[i] = min(max(torques[i], -limit[i]), limit[i])
    return out
