"""Recording of an arm that picks up a payload, and learns online what it carries."""

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.palette import GREY, SKY, VERMILION
from structlearn.testbeds.dynamics.recordings.shown_motions import ShownPayload
from structlearn.viewer.arm_meshes import arm_contents, arm_view, send_arm
from structlearn.viewer.rrd import entity, layout, plot, recording, rgba, send_series, time_column

ARM, BODY = "arm", "payload"

RADIUS_M = 0.05
"""Of the drawn payload."""


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
        stream.log(BODY, rr.Points3D.from_fields(colors=rgba([VERMILION]), radii=RADIUS_M), static=True)
        points = rr.Points3D.columns(positions=shown.body[carried])
        stream.send_columns(BODY, [time_column(shown.time[carried])], points)
        _send_learned(stream, shown)


def _send_learned(stream: rr.RecordingStream, shown: ShownPayload) -> None:
    learned = shown.learned
    times = [time_column(learned["time_s"].to_numpy(float))]
    carried = np.where(shown.time >= shown.pick_up_s, shown.mass_kg, 0.0)[:, None]
    send_series(stream, entity("mass", "carried"), [time_column(shown.time)], carried, ["carried"], [GREY])
    mass = learned["mass_kg"].to_numpy(float)[:, None]
    send_series(stream, entity("mass", "learned"), times, mass, ["learned"], [SKY])
    moments = learned[[f"moment_{axis}_kg_m" for axis in "xyz"]].to_numpy(float)
    send_series(stream, "moment", times, moments, ["x", "y", "z"])
    for name, colour in (("fixed", VERMILION), ("learned", SKY)):
        label = "empty arm" if name == "fixed" else "learned online"
        error = np.log10(learned[f"nmse_{name}"].to_numpy(float))[:, None]
        send_series(stream, entity("error", name), times, error, [label], [colour])


def _blueprint(shown: ShownPayload, title: str) -> rrb.Blueprint:
    contents = [arm_contents(ARM), f"/{BODY}"]
    view = arm_view(title, contents, shown.body)
    plots = (
        plot("mass in the hand (kg)", ["/mass/**"]),
        plot("its first moment (kg m)", ["/moment"]),
        plot("log10 of the NMSE of each batch before it is learned", ["/error/**"]),
    )
    return layout(rrb.Horizontal(view, rrb.Vertical(*plots), column_shares=[3, 3]))
