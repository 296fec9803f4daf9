"""Recording of a robot along its sines: measured joint torques beside those of models (III.4.2)."""

from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from structlearn.ground.metrics import nmse
from structlearn.palette import LIGHT_GREY
from structlearn.rigid_body.model_names import model_name
from structlearn.testbeds.dynamics.recordings.shown_motions import COLOUR_WORDS, ShownTorques, colour
from structlearn.viewer.arm_meshes import arm_contents, arm_view, send_arm
from structlearn.viewer.notes import notes_view, send_notes
from structlearn.viewer.rrd import entity, layout, plot, recording, send_series, time_column

ARM = "arm"


def write_torques(path: str | Path, urdf: str | Path, shown: ShownTorques, title: str) -> None:
    """Write a robot's motion with its torques as a recording, a plot per joint.

    Args:
        path: of the .rrd file.
        urdf: of the robot.
        shown: what to show.
        title: heading, different for every recording.
    """
    times = time_column(shown.time)
    with recording(path, title) as stream:
        stream.send_blueprint(_blueprint(shown, title))
        send_arm(stream, ARM, urdf, shown.joints, times, shown.q)
        for number, joint in enumerate(shown.joints):
            for model, torques in shown.predicted.items():
                curve, name = entity("torque", joint, model), model_name(model)
                send_series(stream, curve, [times], torques[:, [number]], [name], [colour(model)])
            measured = shown.measured[:, [number]]
            curve = entity("torque", joint, "measured")
            send_series(stream, curve, [times], measured, ["measured"], [LIGHT_GREY], width=2.5)
        send_notes(stream, _notes(shown))


def _notes(shown: ShownTorques) -> str:
    errors = {model: nmse(torques, shown.measured).mean() for model, torques in shown.predicted.items()}
    rows = [
        f"| {COLOUR_WORDS[colour(model)]} | {model_name(model)} | {error:.3g} |"
        for model, error in errors.items()
    ]
    return (
        "Measured torques (white, thick) and those of models that learned from the whole log, first "
        "seed.\n\n| colour | model | NMSE, mean over joints |\n|---|---|---|\n" + "\n".join(rows) + "\n"
    )


def _blueprint(shown: ShownTorques, title: str) -> rrb.Blueprint:
    plots = []
    for number, joint in enumerate(shown.joints):
        errors = {
            model: float(nmse(torques[:, number], shown.measured[:, number]))
            for model, torques in shown.predicted.items()
        }
        best = min(errors, key=errors.get)
        heading = f"{joint} (N m); best: {model_name(best)}, NMSE {errors[best]:.3f}"
        view = plot(heading, [f"{entity('torque', joint)}/**"], legend=False)
        # models that are far off would hide the measured torque
        low, high = np.quantile(shown.measured[:, number], [0.002, 0.998])
        room = 0.25 * (high - low)
        view.properties["ScalarAxis"] = rrb.ScalarAxis(range=(low - room, high + room))
        plots.append(view)
    arm = arm_view(title, [arm_contents(ARM)], shown.tool)
    right = rrb.Grid(*plots, notes_view(), grid_columns=2)
    return layout(rrb.Horizontal(arm, right, column_shares=[2, 5]))
