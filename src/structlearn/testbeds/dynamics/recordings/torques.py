"""Recording of a robot along its sines: measured joint torques beside those of models (III.4.2)."""

from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from structlearn.ground.metrics import nmse
from structlearn.rigid_body.model_names import model_name
from structlearn.testbeds.dynamics.names import REFERENCE, colour
from structlearn.testbeds.dynamics.recordings.shown_motions import ShownTorques
from structlearn.viewer.arm_meshes import arm_contents, arm_view, send_arm
from structlearn.viewer.notes import COLOUR_NAMES, notes_view, send_notes
from structlearn.viewer.rrd import entity, layout, plot, recording, send_series, time_column

ARM = "arm"

MEASURED = "_measured"
"""Drawn below the models: curves are drawn in the order of their names."""


def write_torques(path: str | Path, urdf: str | Path, shown: ShownTorques, title: str, origin: str) -> None:
    """Write a robot's motion with its torques as a recording, a plot per joint.

    Args:
        path: of the .rrd file.
        urdf: of the robot.
        shown: what to show.
        title: heading, different for every recording.
        origin: whether the robot is simulated, a sentence.
    """
    times = time_column(shown.time)
    with recording(path, title) as stream:
        stream.send_blueprint(_blueprint(shown, title))
        send_arm(stream, ARM, urdf, shown.joints, times, shown.q)
        for number, joint in enumerate(shown.joints):
            measured = shown.measured[:, [number]]
            curve = entity("torque", joint, MEASURED)
            send_series(stream, curve, [times], measured, ["measured"], [REFERENCE], width=3.0)
            for model, torques in shown.predicted.items():
                curve, name = entity("torque", joint, model), model_name(model)
                send_series(stream, curve, [times], torques[:, [number]], [name], [colour(model)])
        send_notes(stream, _notes(shown, title, origin))


def _notes(shown: ShownTorques, title: str, origin: str) -> str:
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


def _blueprint(shown: ShownTorques, title: str) -> rrb.Blueprint:
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
