"""Coupling targets of corrected demonstrations (eq. IV.23, IV.24), and the axes of feedback.

    c_target = tau_cd^2 xdd_cd - ALPHA (BETA (g - x_cd) - tau_cd xd_cd) - f(p, u)

The goal g evolves from the demonstration's own initial state to the steady goal of the *nominal* primitive,
as it does when the primitive is unrolled with feedback. So the primitive, unrolled from the demonstration's
start with c_target as its coupling term, reproduces the demonstration.

Feedback corrects along and about the axes of the base frame. A coupling term is added to the transformation
system (eq. IV.1, IV.2) and has its unit, acceleration times tau^2: m for positions and rad for orientations.
A constant coupling term shifts by c / (ALPHA BETA).
"""

from typing import Literal, get_args

import numpy as np

from structlearn.core.errors import InputError
from structlearn.core.frames import local_frame
from structlearn.primitives import orientation, transformation
from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.primitives.position import PositionPrimitive, from_start
from structlearn.primitives.trajectory import OrientationTrajectory, Trajectory
from structlearn.primitives.vector import VectorPrimitive

Axis = Literal["x", "y", "z", "rx", "ry", "rz"]  # along or, with `r`, about an axis of the base frame

AXES: tuple[Axis, ...] = get_args(Axis)
"""Order of axes everywhere: three of the position, then three of the orientation."""


def turns(axis: Axis) -> bool:
    """Whether a correction rotates about the axis, instead of shifting along it."""
    return AXES.index(axis) >= 3


def direction(axis: Axis) -> np.ndarray:
    """Unit vector (3,) of an axis."""
    return np.eye(3)[AXES.index(axis) % 3]


def unit(axis: Axis) -> str:
    """Unit of the coupling term."""
    return "rad" if turns(axis) else "m"


def position_target(
    path: Trajectory, primitive: VectorPrimitive, goal: np.ndarray | None = None
) -> np.ndarray:
    """Coupling target (T, D) of a corrected vector movement (eq. IV.23); 0 at the first sample.

    `path`: (T, D) in the primitive's coordinates. `goal`: (D,) steady goal; default: the primitive's.
    """
    goal = primitive.goal if goal is None else goal
    tau = primitive.time_constant(path.duration)
    x, xd, xdd = path.position, path.velocity, path.acceleration
    forcing = primitive.forcing(path.time, x[0], goal, path.duration)
    first = transformation.initial_goal(x[0], xd[0], xdd[0], tau, forcing[0])
    g = transformation.goal_path(goal, first, path.time, tau)
    attraction = transformation.ALPHA * (transformation.BETA * (g - x) - tau * xd)
    return tau**2 * xdd - attraction - forcing


def reach_target(path: Trajectory, primitive: PositionPrimitive) -> np.ndarray:
    """Coupling target of a corrected reach in the base frame (eq. IV.23), where sensors and axes are fixed.

    The transformation system is the same along all axes, so a coupling term rotates with the local frame,
    which is that from the reach's own start to the goal of the nominal primitive.

    `path`: (T, 3) m in the base frame. Returns (T, 3) c_target in m; 0 at the first sample. Raises
    InputError: the path starts at the goal, so that the local frame is undefined.
    """
    start = path.position[0]
    try:
        axes = local_frame(start, primitive.goal, primitive.frame)
    except ValueError as error:
        raise InputError(f"a corrected reach from {start} to {primitive.goal}: {error}") from error
    goal = (primitive.goal - start) @ axes
    return position_target(from_start(path, axes), primitive.local, goal) @ axes.T


def orientation_target(
    path: OrientationTrajectory, primitive: QuaternionPrimitive, goal: np.ndarray | None = None
) -> np.ndarray:
    """Coupling target (T, 3) of a corrected orientation movement in the base frame (eq. IV.24).

    It is 0 at the first sample. `path`: (T, 4) orientations. `goal`: (4,) steady goal; default: the
    primitive's.
    """
    goal, tau = primitive.goal if goal is None else goal, primitive.time_constant(path.duration)
    weights = primitive.weights_towards(path.orientation[0], goal)
    forcing = primitive.features_at(path.time, path.duration) @ weights
    return orientation.forcing_target(path, tau, goal, forcing[0]) - forcing
