"""Sine motion of all joints with inverse-dynamics feedforward and linear feedback (dissertation III.4.1).

    tau = f_ID(q_r, qd_r, qdd_r) + K (q_r - q) + D (qd_r - qd)

The better the model, the smaller the feedback. The gains belong to the robot and are the same for all models:
scaled by a model's inertia, light wrist joints would have almost none and stick by friction. The model is
evaluated at the reference: viscous friction fitted to Coulomb friction is too large for fast joints, and at
the measured velocity it destabilises a light wrist within seconds.
"""

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from dissertation.dynamics.world.controlled_arm import ControlArguments, FeedbackGains, ReferencePath
from dissertation.dynamics.world.operational_space import (
    VelocityControl,
    VelocityControlParameters,
    tool_motion,
)
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.core.signals import minimum_jerk, minimum_jerk_rate
from structlearn.rigid_body.compiled_dynamics import InverseDynamics, inverse_dynamics
from structlearn.rigid_body.tree import KinematicTree, LinkInertias


class FeedbackParameters(Parameters):
    """Linear joint feedback."""

    stiffness_n_m_rad: tuple[float, ...]
    damping_ratio: float = Field(gt=0)


class SineMotion(Parameters):
    """Sines in all joints at once."""

    duration_s: float = Field(gt=0, le=3600)
    periods_s: tuple[float, ...]
    amplitudes: tuple[float, ...]


class SineParameters(SineMotion):
    """A sine motion, its sampling rate and feedback."""

    rate_hz: float = Field(ge=100, le=2000)
    feedback: FeedbackParameters

    def cut(self, duration_s: float) -> "SineParameters":
        """The motion, no longer than `duration_s`."""
        return self.model_copy(update={"duration_s": min(self.duration_s, duration_s)})


class ArmMotionParameters(Parameters):
    """The motion for choosing optimisers, and the motion that is scored."""

    use: Literal["tuning", "test"]
    tuning: SineMotion
    test: SineMotion
    rate_hz: float
    feedback: FeedbackParameters

    @model_validator(mode="after")
    def _are_apart(self) -> "ArmMotionParameters":
        for name in ("periods_s", "amplitudes"):
            pairs = zip(getattr(self.tuning, name), getattr(self.test, name), strict=False)
            alike = [joint for joint, (one, other) in enumerate(pairs, start=1) if one == other]
            if alike:
                raise ValueError(f"{name}: joints {alike} swing alike in `tuning` and in `test`")
        return self

    @property
    def used(self) -> SineParameters:
        """The motion that `use` selects."""
        motion = getattr(self, self.use)
        return SineParameters(**motion.model_dump(), rate_hz=self.rate_hz, feedback=self.feedback)


def joint_range(tree: KinematicTree) -> tuple[np.ndarray, np.ndarray]:
    """Middle and half-width of each joint's range, (n,) each, rad or m."""
    lower, upper = tree.ranges
    return 0.5 * (lower + upper), 0.5 * (upper - lower)


def joint_feedback(
    tree: KinematicTree, inertias: LinkInertias, parameters: FeedbackParameters
) -> FeedbackGains:
    """Feedback gains for the inertias of an arm's URDF. Raises InputError for too few stiffnesses."""
    stiffness = of_joints("stiffness_n_m_rad", parameters.stiffness_n_m_rad, tree)
    middle, zero = joint_range(tree)[0], np.zeros(len(stiffness))
    torques = inverse_dynamics(tree, inertias)
    weight = torques(middle, zero, zero)
    carried = np.array([(torques(middle, zero, unit) - weight) @ unit for unit in np.eye(len(zero))])
    return FeedbackGains(stiffness, 2.0 * parameters.damping_ratio * np.sqrt(stiffness * carried))


def of_joints(key: str, values: tuple[float, ...], tree: KinematicTree) -> np.ndarray:
    """Parameter values (n,) for an arm's joints. Raises InputError if there are too few."""
    count = len(tree.names)
    if len(values) < count:
        raise InputError(f"{key}: has {len(values)} values, the arm has {count} joints")
    return np.array(values[:count])


def sine_path(tree: KinematicTree, parameters: SineParameters) -> ReferencePath:
    """Sines in all joints at once.

    Raises InputError: too few periods or amplitudes, or a sine exceeds its joint's velocity limit.
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
    return ReferencePath(middle + swing, amplitude * frequency * np.cos(phase), -(frequency**2) * swing)


def sine_controller(
    model: InverseDynamics, reference: ReferencePath, feedback: FeedbackGains
) -> ControlArguments:
    """Controller of the law in the module's docstring."""
    nothing = VelocityControl(np.zeros(3), np.zeros(len(feedback.damping)), 0.0, 0.0)
    return ControlArguments(model, reference, feedback, of_tool=False, tool=nothing)


class ReachingParameters(Parameters):
    """Reaching tasks."""

    goals: int = Field(ge=1)
    move_s: float = Field(gt=0)
    rest_s: float = Field(ge=0)
    half_box_m: tuple[float, float, float]
    posture: tuple[float, ...]
    tool_m: tuple[float, float, float]
    control: VelocityControlParameters


def first_posture(tree: KinematicTree, parameters: ReachingParameters) -> np.ndarray:
    """Joint positions (n,) in rad from which the reaches start."""
    middle, half = joint_range(tree)
    shares = np.zeros(len(middle))
    given = parameters.posture[: len(middle)]
    shares[: len(given)] = given
    return middle + shares * half


def random_reaches(
    tree: KinematicTree, parameters: ReachingParameters, rate_hz: float, seed: int
) -> ReferencePath:
    """Minimum-jerk reaches of the tool to random goals in sequence; the seed determines the goals."""
    rng = np.random.default_rng(seed)
    posture = first_posture(tree, parameters)[None]
    start = tool_motion(tree, parameters.tool_m, posture, np.zeros_like(posture))[0][0]
    box = np.array(parameters.half_box_m)
    corners = np.vstack([start, start + box * rng.uniform(-1.0, 1.0, (parameters.goals, 3))])
    ticks = round((parameters.move_s + parameters.rest_s) * rate_hz)
    s = np.clip(np.arange(ticks) / (rate_hz * parameters.move_s), 0.0, 1.0)[:, None]
    bend = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)  # second derivative of the minimum-jerk progress
    step = np.diff(corners, axis=0)[:, None]  # (goals, 1, 3)
    parts = (
        corners[:-1, None] + step * minimum_jerk(s),
        step * minimum_jerk_rate(s) / parameters.move_s,
        step * bend / parameters.move_s**2,
    )
    return ReferencePath(*(np.ascontiguousarray(part.reshape(-1, 3)) for part in parts))


def reaching_controller(
    tree: KinematicTree,
    model: InverseDynamics,
    reference: ReferencePath,
    feedback: FeedbackGains,
    parameters: ReachingParameters,
) -> ControlArguments:
    """Velocity-based operational-space controller along a tool reference, with a model of the arm.

    Of the joint feedback only the damping is used.
    """
    gains, tool = parameters.control, np.array(parameters.tool_m)
    control = VelocityControl(tool, first_posture(tree, parameters), gains.tool_1_s, gains.posture_1_s)
    return ControlArguments(model, reference, feedback, of_tool=True, tool=control)
