"""Recording of an arm that reaches with one model of its dynamics after the other (III.4)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.testbeds.dynamics.names import REFERENCE, colour
from structlearn.testbeds.dynamics.protocol.tracking import TrackedReach
from structlearn.viewer.arm_meshes import arm_contents, arm_view, send_arm
from structlearn.viewer.rrd import (
    COLOUR_NAMES,
    entity,
    layout,
    notes_view,
    plot,
    recording,
    rgba,
    send_moving_frame,
    send_notes,
    send_series,
    time_column,
)

WANTED = "wanted"


def write_reaches(
    path: str | Path, urdf: str | Path, joints: Sequence[str], shown: Sequence[TrackedReach], title: str
) -> None:
    """Write the reaches of one arm with several models as a recording.

    Every model has a view with its arm, the wanted path of the tool and its own; plots show how far each
    tool is off and how fast it is. The first of the models ran through.
    """
    with recording(path, title) as stream:
        stream.send_blueprint(_blueprint(shown, title))
        for reach in shown:
            times = time_column(reach.time)
            its_colour = colour(reach.model)
            send_arm(stream, _arm(reach), urdf, joints, times, reach.joints)
            scene = entity("tools", reach.model)
            strips = rr.LineStrips3D([reach.tool], colors=rgba([its_colour]), radii=-2.0)
            stream.log(f"{scene}/path", strips, static=True)
            send_moving_frame(stream, f"{scene}/tool", [times], reach.tool, None, its_colour, 0.0)
            speed, _ = reach.speeds
            for kind, values in (("off", reach.off_mm), ("speed", speed)):
                curve = entity(kind, reach.model)
                send_series(stream, curve, [times], values[:, None], [reach.label], [its_colour])
        _send_wanted(stream, shown[0])
        send_notes(stream, _notes(shown, title))


def _arm(reach: TrackedReach) -> str:
    return f"arm_{reach.model}"


def _send_wanted(stream: rr.RecordingStream, reach: TrackedReach) -> None:
    """Where all tools should be."""
    times = [time_column(reach.time)]
    strips = rr.LineStrips3D([reach.wanted], colors=rgba([REFERENCE]), radii=-1.0)
    stream.log(f"{WANTED}/path", strips, static=True)
    send_moving_frame(stream, f"{WANTED}/tool", times, reach.wanted, None, REFERENCE, 0.0)
    _, speed = reach.speeds
    send_series(stream, entity("speed", WANTED), times, speed[:, None], [WANTED], [REFERENCE], width=3.0)


def _blueprint(shown: Sequence[TrackedReach], title: str) -> rrb.Blueprint:
    points = shown[0].wanted
    views = [
        arm_view(
            f"{reach.label}{f' (stopped: {reach.stopped})' if reach.stopped else ''}",
            [arm_contents(_arm(reach)), f"{entity('tools', reach.model)}/**", f"/{WANTED}/**"],
            points,
        )
        for reach in shown
    ]
    arms = rrb.Grid(*views, grid_columns=2, name=title)
    off = plot("tool off by (mm)", ["/off/**"], legend=False)
    # an arm that runs away would hide all others
    off.properties["ScalarAxis"] = rrb.ScalarAxis(range=(0.0, _range([reach.off_mm for reach in shown])))
    speed = plot("speed of the tool (m/s)", ["/speed/**"], legend=False)
    highest = 2.0 * float(shown[0].speeds[1].max())
    speed.properties["ScalarAxis"] = rrb.ScalarAxis(range=(0.0, highest))
    right = rrb.Vertical(off, speed, notes_view(), row_shares=[3, 3, 3])
    return layout(rrb.Horizontal(arms, right, column_shares=[3, 2]))


def _range(curves: Sequence[np.ndarray]) -> float:
    """Upper end of a plot in which all curves can be told apart for most of the time."""
    return 1.2 * max(float(np.quantile(curve, 0.95)) for curve in curves if len(curve) > 1)


def _notes(shown: Sequence[TrackedReach], title: str) -> str:
    rows = [
        f"| {COLOUR_NAMES[colour(reach.model)]} | {reach.label} "
        f"| {'' if reach.stopped else f'{reach.velocity_nmse:.2g}'} | {reach.stopped} |"
        for reach in shown
    ]
    return (
        f"### {title}\n\nSimulated. The same reaches ({COLOUR_NAMES[REFERENCE]}: wanted) with one model "
        "after the other in the controller; the first seed of each.\n\n"
        "| colour | model | NMSE of the tool's velocity | stopped |\n|---|---|---|---|\n"
        + "\n".join(rows)
        + "\n\nAn arm that was stopped stays where it was then.\n"
    )
