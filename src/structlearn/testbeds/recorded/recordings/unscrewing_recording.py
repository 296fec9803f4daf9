"""Recording of unscrewing: the hand's turn in every log beside the primitive's, as caps that turn."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.ground import quaternion, signals
from structlearn.palette import LIGHT_GREY
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.trajectory import OrientationTrajectory
from structlearn.primitives.twist_swing import dominant_axes, from_chart, on_chart
from structlearn.testbeds.recorded.names import LEARNED, RECORDED
from structlearn.testbeds.recorded.protocol.movement import turning
from structlearn.viewer.notes import legend, notes_view, send_notes
from structlearn.viewer.rrd import entity, eye_view, layout, plot, recording, rgba, send_series, time_column

RATE_HZ = 50.0

RADIUS, APART = 0.04, 0.11
"""Of the caps in m, and from one's middle to the next one's."""

EYE = np.array([0.26, 0.0, 0.2])
"""Camera in m, from the middle of the row."""

UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Axes of the chart for drawing: the dominant one points up."""

CHART = ("twist", "swing", "second swing")


def write_unscrewing(path: Path, logs: Sequence[OrientationTrajectory], primitive: PosePrimitive) -> None:
    """Write the recording.

    Args:
        path: of the .rrd file.
        logs: the turning hand, smoothed.
        primitive: learned from all of them.
    """
    axes, learned = dominant_axes(logs), turning(primitive)
    shown = [*((f"log {number}", log, RECORDED.colour) for number, log in enumerate(logs, 1))]
    shown.append((LEARNED.name, learned.unroll(logs[0].dt), LEARNED.colour))
    samples = round(learned.duration * RATE_HZ)
    times = [time_column(np.linspace(0.0, learned.duration, samples))]
    with recording(path, "Unscrewing and the primitive") as stream:
        stream.send_blueprint(_blueprint([name for name, _, _ in shown]))
        send_notes(stream, _note(logs))
        for place, (name, turn, colour) in enumerate(shown):
            angles = signals.time_normalised(on_chart(turn, axes).position, samples)  # (samples, 3) rad
            _send_cap(stream, name, colour, place, times, from_chart(angles, UP))
            for chart, values in zip(CHART, np.degrees(angles).T, strict=True):
                send_series(stream, entity(chart, name), times, values[:, None], [name], [colour])


def _note(logs: Sequence[OrientationTrajectory]) -> str:
    return (
        f"A robot's hand unscrews a cap by about a full turn: {len(logs)} recorded logs, and the primitive "
        "learned from all of them. All are stretched to its duration and turn to their goals, where every "
        "pointer meets its mark. The axis of the turn points up; what is left of the motion is the swing.\n\n"
        + legend(dict([RECORDED, LEARNED]))
    )


def _send_cap(
    stream: rr.RecordingStream,
    name: str,
    colour: str,
    place: int,
    times: Sequence[rr.TimeColumn],
    orientation: np.ndarray,
) -> None:
    """A cap with a pointer at its place in the row, turning with orientations (T, 4), and the goal's mark."""
    middle = np.array([0.0, APART * place, 0.0])
    cap = entity("caps", name)
    stream.log(
        cap,
        rr.Cylinders3D(
            lengths=[0.5 * RADIUS],
            radii=[RADIUS],
            colors=rgba([colour], 0.8),
            fill_mode=rr.components.FillMode.Solid,
        ),
        static=True,
    )
    height = 0.27 * RADIUS
    pointer = rr.LineStrips3D(
        [[[0.0, 0.0, height], [RADIUS, 0.0, height]]], colors=rgba([LIGHT_GREY]), radii=0.003
    )
    stream.log(entity("caps", name, "pointer"), pointer, static=True)
    translation = np.tile(middle, (len(orientation), 1))
    turns = rr.Transform3D.columns(translation=translation, quaternion=quaternion.to_xyzw(orientation))
    stream.send_columns(cap, times, turns)
    front = middle + np.array([[1.15 * RADIUS, 0.0, height], [1.8 * RADIUS, 0.0, 0.0]])
    mark = rr.Points3D(front[:1], colors=rgba([colour]), radii=0.004)
    stream.log(entity("marks", name), mark, static=True)
    label = rr.Points3D(front[1:], colors=rgba([colour]), radii=0.0, labels=[name], show_labels=True)
    stream.log(entity("marks", name, "name"), label, static=True)


def _blueprint(shown: Sequence[str]) -> rrb.Blueprint:
    middle = np.array([0.0, 0.5 * APART * (len(shown) - 1), 0.0])
    scene = eye_view("Unscrewing, axis of the turn up", ["/caps/**", "/marks/**"], middle, EYE)
    plots = [plot(f"{name} (degrees to the goal)", [f"{entity(name)}/**"]) for name in CHART]
    left = rrb.Vertical(scene, notes_view(), row_shares=[3, 2])
    return layout(rrb.Horizontal(left, rrb.Vertical(*plots, row_shares=[3, 1, 1]), column_shares=[1, 1]))
