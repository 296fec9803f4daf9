"""Recording of an arm that picks up a payload, and learns online what it carries."""

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.palette import AXIS_COLOURS
from structlearn.rigid_body.model_names import GROUND_TRUTH
from structlearn.testbeds.dynamics.names import PAYLOAD, REFERENCE, colour
from structlearn.testbeds.dynamics.recordings.shown_motions import ShownPayload
from structlearn.viewer.arm_meshes import arm_contents, arm_view, send_arm
from structlearn.viewer.notes import legend, notes_view, send_notes
from structlearn.viewer.rrd import entity, layout, plot, recording, rgba, send_series, time_column

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
        _send_learned(stream, shown)
        send_notes(stream, _notes(shown, title))


def _send_learned(stream: rr.RecordingStream, shown: ShownPayload) -> None:
    learned = shown.learned
    times = [time_column(learned["time_s"].to_numpy(float))]
    carried = np.where(shown.time >= shown.pick_up_s, shown.mass_kg, 0.0)[:, None]
    path = entity("mass", "carried")
    send_series(stream, path, [time_column(shown.time)], carried, ["carried"], [REFERENCE], width=3.0)
    mass = learned["mass_kg"].to_numpy(float)[:, None]
    send_series(stream, entity("mass", "learned"), times, mass, ["learned"], [LEARNED])
    moments = learned[[f"moment_{axis}_kg_m" for axis in "xyz"]].to_numpy(float)
    send_series(stream, "moment", times, moments, ["x", "y", "z"], AXIS_COLOURS)
    for name, label, its_colour in (("fixed", "empty arm", EMPTY), ("learned", "learned online", LEARNED)):
        error = np.log10(learned[f"nmse_{name}"].to_numpy(float))[:, None]
        send_series(stream, entity("error", name), times, error, [label], [its_colour])


def _blueprint(shown: ShownPayload, title: str) -> rrb.Blueprint:
    view = arm_view(title, [arm_contents(ARM), f"/{BODY}"], shown.body)
    plots = (
        plot("mass in the hand (kg)", ["/mass/**"], legend=False),
        plot("its first moment (kg m)", ["/moment"], legend=False),
        plot("log10 of the NMSE of each batch before it is learned", ["/error/**"], legend=False),
    )
    right = rrb.Vertical(*plots, notes_view(), row_shares=[3, 3, 3, 4])
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
