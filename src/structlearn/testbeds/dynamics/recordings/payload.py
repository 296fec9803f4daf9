"""Recording of an arm that picks up a payload, and learns online what it carries."""

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.rigid_body.model_names import GROUND_TRUTH
from structlearn.testbeds.dynamics.names import PAYLOAD, REFERENCE, colour
from structlearn.testbeds.dynamics.recordings.shown_motions import ShownPayload
from structlearn.viewer.arm_meshes import arm_contents, arm_view, followed_plots, send_arm, send_followed
from structlearn.viewer.notes import legend, notes_view, send_notes
from structlearn.viewer.rrd import layout, recording, rgba, time_column

ARM, BODY = "arm", "payload"

RADIUS_M = 0.05
"""Of the drawn payload."""

LEARNED, EMPTY = colour("cov"), colour(GROUND_TRUTH)
"""Of the model that learns online, and of that of the empty arm."""


def write_payload(path: str | Path, urdf: str | Path, shown: ShownPayload, title: str) -> None:
    """Write an arm with a payload, and what is learned of it, as a recording.

    Args:
        path: of the .rrd file.
        urdf: of the arm.
        shown: what to show.
        title: heading, different for every recording.
    """
    with recording(path, title) as stream:
        stream.send_blueprint(_blueprint(shown, title))
        send_arm(stream, ARM, urdf, shown.joints, time_column(shown.time), shown.q)
        carried = shown.time >= shown.pick_up_s
        stream.log(BODY, rr.Points3D.from_fields(colors=rgba([PAYLOAD]), radii=RADIUS_M), static=True)
        points = rr.Points3D.columns(positions=shown.body[carried])
        stream.send_columns(BODY, [time_column(shown.time[carried])], points)
        really = np.where(carried, shown.mass_kg, 0.0)
        send_followed(stream, shown.learned, shown.time, really, (REFERENCE, LEARNED, EMPTY))
        send_notes(stream, _notes(shown, title))


def _blueprint(shown: ShownPayload, title: str) -> rrb.Blueprint:
    view = arm_view(title, [arm_contents(ARM), f"/{BODY}"], shown.body)
    right = rrb.Vertical(*followed_plots(), notes_view(), row_shares=[3, 3, 3, 4])
    return layout(rrb.Horizontal(view, right, column_shares=[3, 3]), at_end=True)


def _notes(shown: ShownPayload, title: str) -> str:
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
