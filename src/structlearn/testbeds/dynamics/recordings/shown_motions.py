"""Which motions of an arm the recordings show, from what the dynamics stages wrote."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.ground.params import Parameters
from structlearn.recordings.joint_log import JointLog
from structlearn.rigid_body.dynamics_models import DynamicsModels, predicted_torques, rigid_body_torques
from structlearn.rigid_body.model_names import DEFAULT
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.operational_space_velocity import tool_motion
from structlearn.rigid_body.tree import KinematicTree, Robot
from structlearn.testbeds.dynamics.world.joint_logs import PayloadParameters
from structlearn.viewer.rrd import thinning


class DynamicsViewParameters(Parameters):
    """What the recordings show."""

    models: tuple[str, ...] = Field(min_length=1)
    robot_models: tuple[str, ...] = Field(min_length=1)
    torque_models: tuple[str, ...] = Field(min_length=1)
    torques_s: float = Field(gt=0)
    rate_hz: float = Field(gt=0)
    payload_s: float = Field(gt=0)


@dataclass(frozen=True)
class ShownTorques:
    """A robot's motion with its torques, measured and by models.

    Attributes:
        joints: (n,) names.
        time: (T,) s.
        q: (T, n) rad.
        tool: (T, 3) m, base frame.
        measured: (T, n) N m.
        predicted: by model, (T, n) N m.
    """

    joints: tuple[str, ...]
    time: np.ndarray
    q: np.ndarray
    tool: np.ndarray
    measured: np.ndarray
    predicted: Mapping[str, np.ndarray]


@dataclass(frozen=True)
class ShownPayload:
    """An arm that picks up a payload, and what is learned of it.

    Attributes:
        joints: (n,) names.
        time: (T,) s.
        q: (T, n) rad.
        body: (T, 3) m, the payload's centre of mass once it is carried, base frame.
        pick_up_s: when that is.
        mass_kg: of the payload.
        learned: see `rigid_body.online_learning.follow_payload`.
    """

    joints: tuple[str, ...]
    time: np.ndarray
    q: np.ndarray
    body: np.ndarray
    pick_up_s: float
    mass_kg: float
    learned: pd.DataFrame


def shown_torques(
    robot: Robot,
    motion: Motion,
    dt: float,
    models: Mapping[str, DynamicsModels],
    tool_m: tuple[float, float, float],
    chosen: DynamicsViewParameters,
) -> ShownTorques:
    """Torques of the URDF and of the first seed of learned models beside the measured ones.

    Args:
        robot: by its URDF.
        motion: of the robot.
        dt: s between its samples.
        models: by name.
        tool_m: tool point in the last joint's frame.
        chosen: how much of the motion.
    """
    every = thinning(dt, chosen.rate_hz)
    motion = motion.part(slice(0, round(chosen.torques_s / dt), every))
    predicted = {DEFAULT: rigid_body_torques(robot.tree, robot.inertias, motion)}
    predicted |= {name: predicted_torques(its, robot.tree, motion)[0] for name, its in models.items()}
    time = every * dt * np.arange(len(motion))
    tool, _ = tool_motion(robot.tree, tool_m, motion.q, motion.qd)
    return ShownTorques(robot.tree.names, time, motion.q, tool, motion.torque, predicted)


def shown_payload(
    tree: KinematicTree,
    log: JointLog,
    learned: pd.DataFrame,
    carried: PayloadParameters,
    chosen: DynamicsViewParameters,
) -> ShownPayload:
    """The motion about the pick-up.

    Args:
        tree: the arm.
        log: of the arm that picks the payload up.
        learned: of `follow_payload`.
        carried: the payload.
        chosen: how much of the motion.
    """
    dt = float(log.time[1])
    pick_up_s = carried.at_share * (log.time[-1] + dt)
    near = np.flatnonzero(np.abs(log.time - pick_up_s) <= chosen.payload_s)[:: thinning(dt, chosen.rate_hz)]
    learned = learned[(learned["time_s"] - pick_up_s).abs() <= chosen.payload_s]
    q, qd = log.positions[near], log.velocities[near]
    body, _ = tool_motion(tree, carried.point_m, q, qd)
    return ShownPayload(tree.names, log.time[near], q, body, pick_up_s, carried.mass_kg, learned)
