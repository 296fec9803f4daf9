"""Recordings of arms (III.4): reaches with different models, torques along sines, and a payload."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb
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
from structlearn.viewer.arm_meshes import arm_contents, arm_view, followed_view, send_arm, send_followed
from structlearn.viewer.rrd import (
    Recording,
    Times,
    below,
    entity,
    legend,
    notes_view,
    plot,
    recording,
    rgba,
    table,
    thinning,
)

ARM, BODY, WANTED = "arm", "payload", "wanted"

MEASURED = "_measured"  # drawn first, below the models: curves are drawn in order of name
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


def write_reaches(
    path: str | Path, urdf: str | Path, joints: Sequence[str], shown: Sequence[TrackedReach], title: str
) -> None:
    """Record the reaches of one arm with several models.

    Every model has a view with its arm and the tool's reference and actual path; plots show tool error and
    speed. The first model's run must not have been stopped.
    """
    with recording(path, title) as to:
        to.show(_reaches_blueprint(shown, title))
        for reach in shown:
            send_arm(to, f"arm_{reach.model}", urdf, joints, reach.time, reach.joints)
            _send_tool(to, entity("tools", reach.model), reach.time, reach.tool, colour(reach.model), -2.0)
            for kind, values in (("off", reach.off_mm), ("speed", reach.speeds[0])):
                to.series(entity(kind, reach.model), reach.time, values, reach.label, colour(reach.model))
        first = shown[0]
        _send_tool(to, WANTED, first.time, first.wanted, REFERENCE, -1.0)
        to.series(entity("speed", WANTED), first.time, first.speeds[1], WANTED, REFERENCE, width=3.0)
        rows = [
            f"| {COLOUR_NAMES[colour(reach.model)]} | {reach.label} "
            f"| {'' if reach.stopped else f'{reach.velocity_nmse:.2g}'} | {reach.stopped} |"
            for reach in shown
        ]
        notes = (
            f"### {title}\n\nSimulated. The same reaches ({COLOUR_NAMES[REFERENCE]}: wanted) with one model "
            "after the other in the controller; the first seed of each.\n\n"
            + table("| colour | model | NMSE of the tool's velocity | stopped |", rows)
            + "\n\nA stopped arm stays where it was stopped.\n"
        )
        to.notes(notes)


def _send_tool(to: Recording, place: str, times: Times, tool: np.ndarray, colour: str, width: float) -> None:
    """Log a tool path (T, 3), and the tool moving along it."""
    to.lines(f"{place}/path", [tool], colour, width)
    to.moving_frame(f"{place}/tool", times, tool, colour)


def _reaches_blueprint(shown: Sequence[TrackedReach], title: str) -> rrb.Container:
    views = [
        arm_view(
            f"{reach.label}{f' (stopped: {reach.stopped})' if reach.stopped else ''}",
            [arm_contents(f"arm_{reach.model}"), below("tools", reach.model), f"/{WANTED}/**"],
            shown[0].wanted,
        )
        for reach in shown
    ]
    # limit the axis: an arm that runs away would hide all other curves
    farthest = 1.2 * max(float(np.quantile(reach.off_mm, 0.95)) for reach in shown if len(reach.time) > 1)
    fastest = 2.0 * float(shown[0].speeds[1].max())
    off = plot("tool error (mm)", ["/off/**"], False, (0.0, farthest))
    speed = plot("speed of the tool (m/s)", ["/speed/**"], False, (0.0, fastest))
    right = rrb.Vertical(off, speed, notes_view(), row_shares=[3, 3, 3])
    arms = rrb.Grid(*views, grid_columns=2, name=title)
    return rrb.Horizontal(arms, right, column_shares=[3, 2])


def write_torques(
    path: str | Path,
    urdf: str | Path,
    robot: Robot,
    motion: Motion,
    dt: float,
    models: Mapping[str, DynamicsModels],
    tool_m: tuple[float, float, float],
    chosen: DynamicsViewParameters,
    title: str,
) -> None:
    """Record a robot's motion with a plot per joint of measured torques and those of models.

    `dt` is the sampling interval in s; shown are the URDF's model and the first seed of each learned model;
    `tool_m` is in the last joint's frame.
    """
    every, joints = thinning(dt, chosen.rate_hz), robot.tree.names
    motion = motion.part(slice(0, round(chosen.torques_s / dt), every))
    predicted = {DEFAULT: rigid_body_torques(robot.tree, robot.inertias, motion)}
    predicted |= {name: predicted_torques(its, robot.tree, motion)[0] for name, its in models.items()}
    errors = pd.DataFrame({name: nmse(torques, motion.torque) for name, torques in predicted.items()}, joints)
    tool, _ = tool_motion(robot.tree, tool_m, motion.q, motion.qd)
    times = every * dt * np.arange(len(motion))
    with recording(path, title) as to:
        to.show(_torque_blueprint(errors, motion, tool, title))
        send_arm(to, ARM, urdf, joints, times, motion.q)
        for number, joint in enumerate(joints):
            curve, measured = entity("torque", joint, MEASURED), motion.torque[:, number]
            to.series(curve, times, measured, "measured", REFERENCE, width=3.0)
            for model, torques in predicted.items():
                curve, name = entity("torque", joint, model), model_name(model)
                to.series(curve, times, torques[:, number], name, colour(model))
        rows = [
            f"| {COLOUR_NAMES[colour(model)]} | {model_name(model)} | {error:.3g} |"
            for model, error in errors.mean().items()
        ]
        notes = (
            f"### {title}\n\nSimulated. Measured torques ({COLOUR_NAMES[REFERENCE]}, wide) and those of "
            "models that learned from the whole log, first seed.\n\n"
            + table("| colour | model | NMSE, mean over joints |", rows)
            + "\n"
        )
        to.notes(notes)


def _torque_blueprint(errors: pd.DataFrame, motion: Motion, tool: np.ndarray, title: str) -> rrb.Container:
    """Layout for the NMSE by joint (rows) and model (columns), and the tool path (T, 3) m."""
    plots = []
    for (joint, its), measured in zip(errors.iterrows(), motion.torque.T, strict=True):
        heading = f"{joint} (N m); best: {model_name(its.idxmin())}, NMSE {its.min():.2g}"
        shown = [below("torque", joint)]
        # limit the axis: models that are far off would hide the measured torque
        low, high = np.quantile(measured, [0.002, 0.998])
        room = 0.25 * (high - low)
        plots.append(plot(heading, shown, False, (low - room, high + room)))
    left = rrb.Vertical(arm_view(title, [arm_contents(ARM)], tool), notes_view(), row_shares=[3, 2])
    return rrb.Horizontal(left, rrb.Grid(*plots, grid_columns=2), column_shares=[2, 5])


def write_payload(
    path: str | Path,
    urdf: str | Path,
    tree: KinematicTree,
    log: JointLog,
    learned: pd.DataFrame,
    carried: PayloadParameters,
    chosen: DynamicsViewParameters,
    title: str,
) -> None:
    """Record an arm picking up a payload, and what the model learns of it, around the time of pick-up.

    `learned`: see `rigid_body.payload.follow_payload`.
    """
    dt = float(log.time[1])
    pick_up_s = carried.at_share * (log.time[-1] + dt)
    near = np.flatnonzero(np.abs(log.time - pick_up_s) <= chosen.payload_s)[:: thinning(dt, chosen.rate_hz)]
    learned = learned[(learned["time_s"] - pick_up_s).abs() <= chosen.payload_s]
    time, q = log.time[near], log.positions[near]
    body, _ = tool_motion(tree, carried.point_m, q, log.velocities[near])
    held = time >= pick_up_s
    view = arm_view(title, [arm_contents(ARM), f"/{BODY}"], body)
    colours = {
        "the payload, once it is carried": PAYLOAD,
        "true mass of the payload (wide)": REFERENCE,
        "online estimate of the last link (Cov), and its error": LEARNED,
        "error of the model of the empty arm": EMPTY,
    }
    with recording(path, title) as to:
        to.show(followed_view(view))
        send_arm(to, ARM, urdf, tree.names, time, q)
        to.still(BODY, rr.Points3D.from_fields(colors=rgba(PAYLOAD), radii=RADIUS_M))
        to.over(BODY, time[held], rr.Points3D.columns(positions=body[held]))
        really = np.where(held, carried.mass_kg, 0.0)
        send_followed(to, learned, time, really, (REFERENCE, LEARNED, EMPTY))
        notes = (
            f"### {title}\n\nSimulated. After {pick_up_s:g} s the arm picks up {carried.mass_kg:g} kg, "
            f"which the model is not told.\n\n{legend(colours)}\n\n"
            "First moment of the mass: x orange, y green, z blue.\n"
        )
        to.notes(notes)
