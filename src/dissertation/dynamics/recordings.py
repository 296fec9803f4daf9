"""Recordings of arms (III.4): reaches with different models, torque errors along sines, and a payload."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import Field

from dissertation.dynamics.names import PAYLOAD, REFERENCE, colour
from dissertation.dynamics.protocol.tracking import TrackedReach
from dissertation.dynamics.world.joint_logs import PayloadParameters
from dissertation.dynamics.world.operational_space import tool_motion
from structlearn.core.metrics import nmse
from structlearn.core.params import Parameters
from structlearn.palette import COLOUR_NAMES
from structlearn.readers.joint_log import JointLog
from structlearn.rigid_body.dynamics_models import DynamicsModels, predicted_torques, rigid_body_torques
from structlearn.rigid_body.model_names import DEFAULT, GROUND_TRUTH, model_name
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.robot import Robot
from structlearn.rigid_body.tree import KinematicTree
from structlearn.viewer import items, views
from structlearn.viewer.arms import arm_scene, followed, meshes
from structlearn.viewer.items import entity, series
from structlearn.viewer.recording import Recording

ARM, BODY, WANTED = "arm", "payload", "wanted"

RADIUS_M = 0.05  # drawn size of the payload

LEARNED, EMPTY = colour("cov"), colour(GROUND_TRUTH)
"""Colours of the online model and of the empty arm's model."""


class DynamicsViewParameters(Parameters):
    """Contents of the recordings."""

    models: tuple[str, ...] = Field(min_length=1)
    robot_models: tuple[str, ...] = Field(min_length=1)
    torque_models: tuple[str, ...] = Field(min_length=1)
    torques_s: float = Field(gt=0)
    rate_hz: float = Field(gt=0)
    payload_s: float = Field(gt=0)


def reaches(urdf: str | Path, joints: Sequence[str], shown: Sequence[TrackedReach], title: str) -> Recording:
    """The reaches of one arm with several models.

    Every model has a view with its arm and the tool's reference and actual path; plots show tool error and
    speed. The first model's run must not have been stopped.
    """
    first = shown[0]
    wanted = items.travelled(WANTED, first.time, first.wanted, REFERENCE, -1.0, "tool")
    times, speed = first.time, first.speeds[1]
    off, speeds, arms = [], [series(entity("speed", WANTED), times, speed, WANTED, REFERENCE, width=3.0)], []
    for reach in shown:
        look = reach.label, colour(reach.model)
        off.append(series(entity("off", reach.model), reach.time, reach.off_mm, *look))
        speeds.append(series(entity("speed", reach.model), reach.time, reach.speeds[0], *look))
        arm = meshes(f"arm_{reach.model}", urdf, joints, reach.time, reach.joints)
        tool = (reach.time, reach.tool, colour(reach.model), -2.0, "tool")
        heading = f"{reach.label} (stopped: {reach.stopped})" if reach.stopped else reach.label
        arms.append(
            arm_scene(
                heading, [*arm, *items.travelled(entity("tools", reach.model), *tool), *wanted], first.wanted
            )
        )
    rows = [
        f"| {COLOUR_NAMES[colour(reach.model)]} | {reach.label} "
        f"| {'' if reach.stopped else f'{reach.velocity_nmse:.2g}'} | {reach.stopped} |"
        for reach in shown
    ]
    notes = (
        f"### {title}\n\nSimulated. The same reaches ({COLOUR_NAMES[REFERENCE]}: wanted) with one model "
        "after the other in the controller; the first seed of each.\n\n"
        + views.table("| colour | model | NMSE of the tool's velocity | stopped |", rows)
        + "\n\nA stopped arm stays where it was stopped.\n"
    )
    # limit the axis: an arm that runs away would hide all other curves
    farthest = 1.2 * max(float(np.quantile(reach.off_mm, 0.95)) for reach in shown if len(reach.time) > 1)
    right = views.column(
        views.plot("tool error (mm)", off, False, (0.0, farthest)),
        views.plot("speed of the tool (m/s)", speeds, False, (0.0, 2.0 * float(speed.max()))),
        views.notes(notes),
        shares=[3, 3, 3],
    )
    return Recording(title, views.row(views.grid(*arms, name=title), right, shares=[3, 2]))


def torques(
    urdf: str | Path,
    robot: Robot,
    motion: Motion,
    dt: float,
    models: Mapping[str, DynamicsModels],
    tool_m: tuple[float, float, float],
    chosen: DynamicsViewParameters,
) -> Recording:
    """A robot's motion with a plot per joint of the torque errors of models, which overlap as torques.

    `dt` is the sampling interval in s; shown are the URDF's model and the first seed of each learned model;
    `tool_m` is in the last joint's frame.
    """
    every, joints = items.thinning(dt, chosen.rate_hz), robot.tree.names
    motion = motion.part(slice(0, round(chosen.torques_s / dt), every))
    predicted = {DEFAULT: rigid_body_torques(robot.tree, robot.inertias, motion)}
    predicted |= {name: predicted_torques(its, robot.tree, motion)[0] for name, its in models.items()}
    errors = pd.DataFrame({name: nmse(torques, motion.torque) for name, torques in predicted.items()}, joints)
    times, plots = every * dt * np.arange(len(motion)), []
    for number, (joint, its) in enumerate(errors.iterrows()):
        off = {model: (torque - motion.torque)[:, number] for model, torque in predicted.items()}
        curves = [
            series(entity("torque", str(joint), model), times, values, model_name(model), colour(model))
            for model, values in off.items()
        ]
        # limit the axis: the default model is so far off that it would hide the others
        far = 1.3 * max(float(np.quantile(np.abs(off[model]), 0.995)) for model in models)
        heading = f"{joint}: error (N m); best: {model_name(its.idxmin())}, NMSE {its.min():.2g}"
        plots.append(views.plot(heading, curves, False, (-far, far)))
    rows = [
        f"| {COLOUR_NAMES[colour(model)]} | {model_name(model)} | {error:.3g} |"
        for model, error in errors.mean().items()
    ]
    title = "Dynamics: torque errors of the perturbed robot (simulated)"
    notes = (
        f"### {title}\n\nSimulated. Torques of models minus the measured ones; the models learned from the "
        "whole log, first seed. What is far off leaves its plot.\n\n"
        + views.table("| colour | model | NMSE, mean over joints |", rows)
        + "\n"
    )
    tool, _ = tool_motion(robot.tree, tool_m, motion.q, motion.qd)
    arm = arm_scene(title, meshes(ARM, urdf, joints, times, motion.q), tool)
    left = views.column(arm, views.notes(notes), shares=[3, 2])
    return Recording(title, views.row(left, views.grid(*plots), shares=[2, 5]))


def payload(
    urdf: str | Path,
    tree: KinematicTree,
    log: JointLog,
    learned: pd.DataFrame,
    carried: PayloadParameters,
    chosen: DynamicsViewParameters,
) -> Recording:
    """An arm picking up a payload, and what the model learns of it, around the time of pick-up.

    `learned`: see `rigid_body.payload.follow_payload`.
    """
    dt = float(log.time[1])
    pick_up_s = carried.at_share * (log.time[-1] + dt)
    near = np.flatnonzero(np.abs(log.time - pick_up_s) <= chosen.payload_s)
    near = near[:: items.thinning(dt, chosen.rate_hz)]
    learned = learned[(learned["time_s"] - pick_up_s).abs() <= chosen.payload_s]
    time, q = log.time[near], log.positions[near]
    body, _ = tool_motion(tree, carried.point_m, q, log.velocities[near])
    held = time >= pick_up_s
    legend = {
        "the payload, once it is carried": PAYLOAD,
        "true mass of the payload (wide)": REFERENCE,
        "online estimate of the last link (Cov), and its error": LEARNED,
        "error of the model of the empty arm": EMPTY,
    }
    title = "Dynamics: a payload picked up (simulated)"
    notes = (
        f"### {title}\n\nSimulated. After {pick_up_s:g} s the arm picks up {carried.mass_kg:g} kg, "
        f"which the model is not told.\n\n{views.legend(legend)}\n\n"
        "First moment of the mass: x orange, y green, z blue.\n"
    )
    load = items.moving_point(BODY, time[held], body[held], PAYLOAD, RADIUS_M)
    arm = arm_scene(title, [*meshes(ARM, urdf, tree.names, time, q), load], body)
    really = np.where(held, carried.mass_kg, 0.0)
    return Recording(title, followed(arm, learned, time, really, (REFERENCE, LEARNED, EMPTY), notes))
