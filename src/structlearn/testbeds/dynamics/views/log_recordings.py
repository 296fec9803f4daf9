"""Recordings of an arm along its sines: measured torques beside those of models, and a payload picked up."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb
from pydantic import Field

from structlearn.core.metrics import nmse
from structlearn.core.params import Parameters
from structlearn.readers.joint_log import JointLog
from structlearn.rigid_body.dynamics_models import DynamicsModels, predicted_torques, rigid_body_torques
from structlearn.rigid_body.model_names import DEFAULT, GROUND_TRUTH, model_name
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.operational_space_velocity import tool_motion
from structlearn.rigid_body.tree import KinematicTree, Robot
from structlearn.testbeds.dynamics.names import PAYLOAD, REFERENCE, colour
from structlearn.testbeds.dynamics.world.joint_logs import PayloadParameters
from structlearn.viewer.arm_meshes import arm_contents, arm_view, followed_plots, send_arm, send_followed
from structlearn.viewer.rrd import (
    COLOUR_NAMES,
    entity,
    layout,
    legend,
    notes_view,
    plot,
    recording,
    rgba,
    send_notes,
    send_series,
    thinning,
    time_column,
)

ARM, BODY = "arm", "payload"

MEASURED = "_measured"
"""Drawn below the models: curves are drawn in the order of their names."""

RADIUS_M = 0.05
"""Of the drawn payload."""

LEARNED, EMPTY = colour("cov"), colour(GROUND_TRUTH)
"""Of the model that learns online, and of that of the empty arm."""


class DynamicsViewParameters(Parameters):
    """Contents of the recordings."""

    models: tuple[str, ...] = Field(min_length=1)
    robot_models: tuple[str, ...] = Field(min_length=1)
    torque_models: tuple[str, ...] = Field(min_length=1)
    torques_s: float = Field(gt=0)
    rate_hz: float = Field(gt=0)
    payload_s: float = Field(gt=0)


@dataclass(frozen=True)
class ShownTorques:
    """A robot's motion (T, n) in rad with its torques (T, n) in N m, measured and by models.

    The tool (T, 3) is in m in the base frame.
    """

    joints: tuple[str, ...]
    time: np.ndarray
    q: np.ndarray
    tool: np.ndarray
    measured: np.ndarray
    predicted: Mapping[str, np.ndarray]


@dataclass(frozen=True)
class ShownPayload:
    """An arm (T, n) in rad that picks up a payload, and what is learned of it.

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

    `dt` is the s between samples; the tool point is in the last joint's frame.
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
    """The motion about the pick-up; `learned` is of `follow_payload`."""
    dt = float(log.time[1])
    pick_up_s = carried.at_share * (log.time[-1] + dt)
    near = np.flatnonzero(np.abs(log.time - pick_up_s) <= chosen.payload_s)[:: thinning(dt, chosen.rate_hz)]
    learned = learned[(learned["time_s"] - pick_up_s).abs() <= chosen.payload_s]
    q, qd = log.positions[near], log.velocities[near]
    body, _ = tool_motion(tree, carried.point_m, q, qd)
    return ShownPayload(tree.names, log.time[near], q, body, pick_up_s, carried.mass_kg, learned)


def write_torques(path: str | Path, urdf: str | Path, shown: ShownTorques, title: str, origin: str) -> None:
    """Write a robot's motion with its torques as a recording, a plot per joint.

    The origin says whether the robot is simulated, a sentence; every recording has a title of its own.
    """
    times = time_column(shown.time)
    with recording(path, title) as stream:
        stream.send_blueprint(_torque_blueprint(shown, title))
        send_arm(stream, ARM, urdf, shown.joints, times, shown.q)
        for number, joint in enumerate(shown.joints):
            measured = shown.measured[:, [number]]
            curve = entity("torque", joint, MEASURED)
            send_series(stream, curve, [times], measured, ["measured"], [REFERENCE], width=3.0)
            for model, torques in shown.predicted.items():
                curve, name = entity("torque", joint, model), model_name(model)
                send_series(stream, curve, [times], torques[:, [number]], [name], [colour(model)])
        send_notes(stream, _torque_notes(shown, title, origin))


def _torque_notes(shown: ShownTorques, title: str, origin: str) -> str:
    errors = {model: nmse(torques, shown.measured).mean() for model, torques in shown.predicted.items()}
    rows = [
        f"| {COLOUR_NAMES[colour(model)]} | {model_name(model)} | {error:.3g} |"
        for model, error in errors.items()
    ]
    return (
        f"### {title}\n\n{origin} Measured torques ({COLOUR_NAMES[REFERENCE]}, wide) and those of models "
        "that learned from the whole log, first seed.\n\n"
        "| colour | model | NMSE, mean over joints |\n|---|---|---|\n" + "\n".join(rows) + "\n"
    )


def _torque_blueprint(shown: ShownTorques, title: str) -> rrb.Blueprint:
    plots = []
    for number, joint in enumerate(shown.joints):
        errors = {
            model: float(nmse(torques[:, number], shown.measured[:, number]))
            for model, torques in shown.predicted.items()
        }
        best = min(errors, key=lambda model: errors[model])
        heading = f"{joint} (N m); best: {model_name(best)}, NMSE {errors[best]:.2g}"
        view = plot(heading, [f"{entity('torque', joint)}/**"], legend=False)
        # models that are far off would hide the measured torque
        low, high = np.quantile(shown.measured[:, number], [0.002, 0.998])
        room = 0.25 * (high - low)
        view.properties["ScalarAxis"] = rrb.ScalarAxis(range=(low - room, high + room))
        plots.append(view)
    left = rrb.Vertical(arm_view(title, [arm_contents(ARM)], shown.tool), notes_view(), row_shares=[3, 2])
    return layout(rrb.Horizontal(left, rrb.Grid(*plots, grid_columns=2), column_shares=[2, 5]))


def write_payload(path: str | Path, urdf: str | Path, shown: ShownPayload, title: str) -> None:
    """Write an arm with a payload, and what is learned of it, as a recording."""
    with recording(path, title) as stream:
        stream.send_blueprint(_payload_blueprint(shown, title))
        send_arm(stream, ARM, urdf, shown.joints, time_column(shown.time), shown.q)
        carried = shown.time >= shown.pick_up_s
        stream.log(BODY, rr.Points3D.from_fields(colors=rgba([PAYLOAD]), radii=RADIUS_M), static=True)
        points = rr.Points3D.columns(positions=shown.body[carried])
        stream.send_columns(BODY, [time_column(shown.time[carried])], points)
        really = np.where(carried, shown.mass_kg, 0.0)
        send_followed(stream, shown.learned, shown.time, really, (REFERENCE, LEARNED, EMPTY))
        send_notes(stream, _payload_notes(shown, title))


def _payload_blueprint(shown: ShownPayload, title: str) -> rrb.Blueprint:
    view = arm_view(title, [arm_contents(ARM), f"/{BODY}"], shown.body)
    right = rrb.Vertical(*followed_plots(), notes_view(), row_shares=[3, 3, 3, 4])
    return layout(rrb.Horizontal(view, right, column_shares=[3, 3]))


def _payload_notes(shown: ShownPayload, title: str) -> str:
    colours = {
        "the payload, once it is carried": PAYLOAD,
        "the mass that is really carried (wide)": REFERENCE,
        "what is learned online of the last link (Cov), and its error": LEARNED,
        "error of the empty arm's model": EMPTY,
    }
    return (
        f"### {title}\n\nSimulated. After {shown.pick_up_s:g} s the arm takes hold of {shown.mass_kg:g} kg, "
        f"which nobody tells the model.\n\n{legend(colours)}\n\nIts first moment: x red, y green, z blue.\n"
    )
