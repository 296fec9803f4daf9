"""Recording of demonstrations: paths and frames in 3-D, all signals over time, and where they were cut."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.core import quaternion
from structlearn.palette import WHITE, primitive_colour
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.segments import Segmentation
from structlearn.viewer.rrd import (
    axis_length,
    entity,
    lanes,
    layout,
    notes_view,
    origin_label,
    origin_sentence,
    plot,
    recording,
    rgba,
    scene_view,
    send_marks,
    send_moving_frame,
    send_notes,
    send_primitive_lane,
    send_series,
    thinning,
    time_column,
)

AXES = "xyz"

DETAILED = 12
"""Demonstrations with a tab of their own; of a larger set the first ones, or the bar of tabs is no use."""

ELECTRODES_PER_FINGER = 19  # of a BioTac; other numbers of channels are shown in one plot

Scenery = Callable[[rr.RecordingStream], Sequence[str]]
"""Logs what stands around the movements, and returns the query expressions of its entities."""


def write_demonstrations(
    path: str | Path,
    demonstrations: Sequence[Demonstration],
    segmentation: Segmentation | None = None,
    title: str = "Demonstrations",
    note: str = "",
    scenery: Scenery | None = None,
    colours: Sequence[str] | None = None,
) -> None:
    """Write demonstrations as a recording.

    The first tab overlays all demonstrations, each with its clock started at 0; the others show one each.
    `segmentation`: of these demonstrations; colours the paths by primitive. None: by demonstration; `note`:
    what is shown, in Markdown; that it is recorded or simulated is added; `colours`: of the demonstrations,
    where there is no segmentation; default those of primitives in turn.
    """
    colours = colours or [primitive_colour(place) for place in range(len(demonstrations))]
    points = np.concatenate([demonstration.position for demonstration in demonstrations])
    with recording(path, title) as stream:
        around = [] if scenery is None else scenery(stream)
        stream.send_blueprint(_blueprint(demonstrations, segmentation, title, around))
        send_notes(stream, f"{note}\n\n{origin_sentence(demonstrations)}")
        for demonstration, colour in zip(demonstrations, colours, strict=True):
            parts = _parts(demonstration, segmentation, colour)
            _send_path(stream, demonstration, parts)
            _send_positions(stream, demonstration, parts)
            _send_signals(stream, demonstration, axis_length(points))
            if segmentation is not None and len(cuts := _cuts(demonstration, segmentation)):
                lane, times = entity("primitive", demonstration.name), np.append(cuts[:, 0], cuts[-1, 1])
                send_primitive_lane(stream, lane, [time_column(times)], segmentation.primitives)


Part = tuple[int, int, str]  # first and last sample of a stretch of a demonstration, and its colour


def _parts(demonstration: Demonstration, segmentation: Segmentation | None, colour: str) -> list[Part]:
    """The stretches of a demonstration in order, from its first to its last sample."""
    last = len(demonstration.time) - 1
    if segmentation is None:
        return [(0, last, colour)]
    parts, reached = [], 0
    for index, ends_s in enumerate(_cuts(demonstration, segmentation)):
        start, end = np.clip(np.round(ends_s / demonstration.dt).astype(int), 0, last)
        parts += [(reached, start, WHITE), (start, end, primitive_colour(index))]
        reached = end
    return [part for part in [*parts, (reached, last, WHITE)] if part[1] > part[0]]


def _cuts(demonstration: Demonstration, segmentation: Segmentation) -> np.ndarray:
    """(P, 2) start and end of each primitive in s; none of a demonstration that could not be cut."""
    tables = [segmentation.result(name) for name in segmentation.primitives]
    found = [
        table.loc[demonstration.name, ["start_s", "end_s"]]
        for table in tables
        if demonstration.name in table.index
    ]
    return np.array(found, dtype=float).reshape(-1, 2)


def _send_path(stream: rr.RecordingStream, demonstration: Demonstration, parts: Sequence[Part]) -> None:
    step = thinning(demonstration.dt)
    strips = [demonstration.position[[*range(first, last, step), last]] for first, last, _ in parts]
    colours = rgba([colour for _, _, colour in parts])
    path = entity("paths", demonstration.name)
    stream.log(path, rr.LineStrips3D(strips, colors=colours, radii=-1.0), static=True)


def _send_positions(stream: rr.RecordingStream, demonstration: Demonstration, parts: Sequence[Part]) -> None:
    """Each axis as a line that changes its colour with the primitive, and points at the cuts."""
    kept = slice(None, None, thinning(demonstration.dt))
    times = time_column(demonstration.time[kept])
    first = [part[0] for part in parts]
    changes = time_column(demonstration.time[first])
    colours = rr.SeriesLines.columns(colors=rgba([colour for _, _, colour in parts]))
    for column, axis in enumerate(AXES):
        path, position = entity("position", axis, demonstration.name), 1e3 * demonstration.position[:, column]
        stream.log(path, rr.SeriesLines(names=demonstration.name, widths=1.0), static=True)
        stream.send_columns(path, [changes], colours)
        stream.send_columns(path, [times], rr.Scalars.columns(scalars=position[kept]))
        if len(first) > 1:
            cuts = first[1:]
            path, times_of_cuts = entity("cuts", axis, demonstration.name), demonstration.time[cuts]
            send_marks(stream, path, [time_column(times_of_cuts)], position[cuts], "cuts", WHITE)


def _send_signals(stream: rr.RecordingStream, demonstration: Demonstration, length: float) -> None:
    """The moving frame, and the plots of one demonstration."""
    name, kept = demonstration.name, slice(None, None, thinning(demonstration.dt))
    times = [time_column(demonstration.time[kept])]
    orientation = None if demonstration.orientation is None else demonstration.orientation[kept]
    position = demonstration.position[kept]
    send_moving_frame(stream, entity("hands", name), times, position, orientation, WHITE, length)

    moved = 1e3 * (position - position[0])
    send_series(stream, entity("moved", name), times, moved, AXES)
    if orientation is not None:
        steps = quaternion.difference(orientation[1:], orientation[:-1])
        turned = np.degrees(np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)]))
        send_series(stream, entity("turned", name), times, turned, AXES)
    if demonstration.wrench is not None:
        send_series(stream, entity("force", name), times, demonstration.wrench[kept, :3], AXES)
        send_series(stream, entity("torque", name), times, demonstration.wrench[kept, 3:], AXES)
    for finger, counts in _fingers(demonstration).items():
        electrodes = [f"E{number + 1}" for number in range(counts.shape[1])]
        colours = [primitive_colour(number) for number in range(counts.shape[1])]
        changes = counts[kept] - counts[0]  # resting values differ by far more than touch changes them
        send_series(stream, entity(finger, name), times, changes, electrodes, colours, width=1.0)


def _fingers(demonstration: Demonstration) -> dict[str, np.ndarray]:
    """Electrodes (T, E) of each finger by the finger's name."""
    if demonstration.tactile is None:
        return {}
    count, rest = divmod(demonstration.tactile.shape[1], ELECTRODES_PER_FINGER)
    if rest:
        return {"tactile": demonstration.tactile}
    return {
        f"tactile {finger + 1}": counts
        for finger, counts in enumerate(np.split(demonstration.tactile, count, axis=1))
    }


def _blueprint(
    demonstrations: Sequence[Demonstration],
    segmentation: Segmentation | None,
    title: str,
    around: Sequence[str],
) -> rrb.Blueprint:
    points = np.concatenate([demonstration.position for demonstration in demonstrations])
    heading = f"{title}{origin_label(demonstrations)}"
    scene = scene_view(heading, ["/paths/**", "/hands/**", *around], points)
    plots = [plot(f"{axis} (mm)", [f"/position/{axis}/**", f"/cuts/{axis}/**"], False) for axis in AXES]
    if any(demonstration.orientation is not None for demonstration in demonstrations):
        plots.append(plot("turned (degrees)", ["/turned/**"], legend=False))
    cuts = [] if segmentation is None else [lanes(["/primitive/**"])]
    shares = [3] * len(cuts) + [2] * len(plots)
    overview = rrb.Horizontal(
        rrb.Vertical(scene, notes_view(), row_shares=[4, 1]),
        rrb.Vertical(*cuts, *plots, row_shares=shares),
        name="All",
        column_shares=[4, 3],
    )
    only_positions = all(
        demonstration.orientation is None and demonstration.wrench is None and demonstration.tactile is None
        for demonstration in demonstrations
    )
    if only_positions:
        return layout(overview)
    details = [_detail(demonstration, segmentation, around) for demonstration in demonstrations[:DETAILED]]
    felt = any(demonstration.tactile is not None for demonstration in demonstrations)
    first = 1 if felt and not around else 0  # all paths together say nothing of what fingers felt
    return layout(rrb.Tabs(overview, *details, active_tab=first))


def _detail(
    demonstration: Demonstration, segmentation: Segmentation | None, around: Sequence[str]
) -> rrb.Horizontal:
    """Tab of one demonstration with every signal that it has."""
    name = demonstration.name
    shown = [*(entity(kind, name) for kind in ("paths", "hands")), *around]
    scene = scene_view(f"{name}{origin_label([demonstration])}", shown, demonstration.position)
    plots = [plot("moved (mm)", [entity("moved", name)])]
    if demonstration.orientation is not None:
        plots.append(plot("turned (degrees)", [entity("turned", name)]))
    if demonstration.wrench is not None:
        plots += [plot("force (N)", [entity("force", name)]), plot("torque (N m)", [entity("torque", name)])]
    fingers = _fingers(demonstration)
    plots += [plot(f"{finger} (counts since the start)", [entity(finger, name)], False) for finger in fingers]
    cuts = [] if segmentation is None else [lanes([entity("primitive", name)])]
    left = rrb.Vertical(scene, *cuts, row_shares=[5, 1][: 1 + len(cuts)])
    right = rrb.Grid(*plots, grid_columns=1 if len(plots) < 4 else 2)
    return rrb.Horizontal(left, right, name=name, column_shares=[2, 3])
