"""Dynamics models on a recorded motion of a Franka Emika Panda: learned on its start, tested on its end."""

from dataclasses import dataclass

import pandas as pd

from structlearn.recordings.joint_log import JointLog
from structlearn.rigid_body.arm_identification import (
    NETWORKS,
    TRAIN,
    NetworkTraining,
    body_table,
    error_table,
    friction_table,
    identify_arm,
    trace_table,
)
from structlearn.rigid_body.dynamics_models import DynamicsModels
from structlearn.rigid_body.learner import LearningParameters
from structlearn.rigid_body.motion import Motion, measured_motion
from structlearn.rigid_body.tree import Robot
from structlearn.testbeds.recorded.protocol.arm_parameters import RecordedDynamicsParameters

TEST = "test"

TRACE_STRIDE = 20
"""Every so manieth sample of the test part is kept for figures: 50 Hz."""


@dataclass(frozen=True)
class RecordedDynamicsResults:
    """Tables of the recorded motion.

    Attributes:
        errors: of `arm_identification.error_table`; parts are `TRAIN` and `TEST`.
        friction: of `friction_table`.
        links: of `body_table`.
        traces: of `trace_table` on the test part.
    """

    errors: pd.DataFrame
    friction: pd.DataFrame
    links: pd.DataFrame
    traces: pd.DataFrame


def panda_motion(log: JointLog, parameters: RecordedDynamicsParameters) -> Motion:
    """The log on one clock, without what is above the cut-off."""
    return measured_motion(
        log.name,
        log.time,
        log.positions,
        log.velocities,
        log.torques,
        parameters.rate_hz,
        parameters.cutoff_hz,
    )


def identify(
    robot: Robot, motion: Motion, parameters: RecordedDynamicsParameters, learning: LearningParameters
) -> tuple[dict[str, DynamicsModels], RecordedDynamicsResults]:
    """Every model on the first part of a motion, and its errors on both parts.

    Args:
        robot: with the inertias of its URDF, where identification starts.
        motion: of the robot.
        parameters: see there.
        learning: of the networks, with their optimiser.

    Returns:
        Models by `KIND` or `KIND_FRICTION`, and the tables.
    """
    parts = dict(zip((TRAIN, TEST), motion.split(parameters.train_share), strict=True))
    training = NetworkTraining(learning, parameters.seeds, parameters.epochs)
    identified = identify_arm(robot, parts, parameters.iterations, dict.fromkeys(NETWORKS, training))
    results = RecordedDynamicsResults(
        errors=error_table(identified, parts),
        friction=friction_table(identified),
        links=body_table(identified, robot),
        traces=trace_table(identified, TEST, parts[TEST], parameters.rate_hz, TRACE_STRIDE),
    )
    files = {
        kind if name in ("none", "viscous") else f"{kind}_{name}": its
        for (kind, name), its in identified.models.items()
    }
    return files, results
