"""Reaches of an arm's tool to random goals, with a learned model in the controller (III.4.1.1)."""

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from structlearn.ground import minimum_jerk
from structlearn.ground.params import Parameters
from structlearn.rigid_body.compiled_models import InverseDynamics
from structlearn.rigid_body.operational_space_velocity import (
    VelocityControl,
    VelocityControlParameters,
    tool_motion,
)
from structlearn.rigid_body.tree import KinematicTree
from structlearn.testbeds.dynamics.world.arm_motion import Feedback, joint_range
from structlearn.testbeds.dynamics.world.controlled_arm import Controller


class ReachingParameters(Parameters):
    """The reaching tasks."""

    goals: int = Field(ge=1)
    move_s: float = Field(gt=0)
    rest_s: float = Field(ge=0)
    half_box_m: tuple[float, float, float]
    posture: tuple[float, ...]
    tool_m: tuple[float, float, float]
    control: VelocityControlParameters


@dataclass(frozen=True)
class ToolPath:
    """T samples of a point at a uniform rate.

    Attributes:
        x: (T, 3) m, base frame.
        xd: (T, 3) m/s.
        xdd: (T, 3) m/s^2.
    """

    x: np.ndarray
    xd: np.ndarray
    xdd: np.ndarray


def first_posture(tree: KinematicTree, parameters: ReachingParameters) -> np.ndarray:
    """Joint positions (n,) in rad at which the reaches begin."""
    middle, half = joint_range(tree)
    shares = np.zeros(len(middle))
    given = parameters.posture[: len(middle)]
    shares[: len(given)] = given
    return middle + shares * half


def reaches(tree: KinematicTree, parameters: ReachingParameters, rate_hz: float, seed: int) -> ToolPath:
    """Reaches to random goals, one after the other; the same seed gives the same goals."""
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
        corners[:-1, None] + step * minimum_jerk.progress(s),
        step * minimum_jerk.rate(s) / parameters.move_s,
        step * bend / parameters.move_s**2,
    )
    return ToolPath(*(np.ascontiguousarray(part.reshape(-1, 3)) for part in parts))


def reaching_controller(
    tree: KinematicTree,
    model: InverseDynamics,
    reference: ToolPath,
    feedback: Feedback,
    parameters: ReachingParameters,
) -> Controller:
    """Velocity-based operational-space control along the reference with a model of the arm.

    Args:
        tree: the arm.
        model: of the arm.
        reference: of the tool.
        feedback: of the joints; only its damping is used.
        parameters: tool and gains.
    """
    gains = parameters.control
    tool = np.array(parameters.tool_m)
    control = VelocityControl(tool, first_posture(tree, parameters), gains.tool_1_s, gains.posture_1_s)
    path, soft = (reference.x, reference.xd, reference.xdd), np.zeros_like(feedback.stiffness)
    return Controller(model, *path, soft, feedback.damping, of_tool=True, tool=control)
