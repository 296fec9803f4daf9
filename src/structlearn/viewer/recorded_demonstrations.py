"""Recording of demonstrations: paths and frames in 3-D, all signals over time, and cut points."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.core import quaternion
from structlearn.palette import AXIS_COLOURS, WHITE, primitive_colour
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.segments import Segmentation
from structlearn.viewer import rrd
from structlearn.viewer.rrd import Recording, entity, plot

AXES = "xyz"
DETAILED = 12  # number of demonstrations with a tab each
ELECTRODES_PER_FINGER = 19  # of a BioTac; other numbers of channels share one plot

Scenery = Callable[[Recording], Sequence[str]]
"""Logs the scene around the movements, and returns query expressions for its entities."""


def write_demonstrations(
    path: str | Path,
    demonstrations: Sequence[Demonstration],
    segmentation: Segmentation | None = None,
    title: str = "Demonstrations",
    note: str = "",
    scenery: Scenery | None = None,
    colours: Sequence[str] | None = None,
) -> None:
    """Record demonstrations: one tab overlays all, further tabs show one each.

    `segmentation`: colours the paths by primitive; without it `colours` are by demonstration, by default the
    primitives' colours in turn; `note`: description in Markdown; `scenery`: see `Scenery`.
    """
    colours = colours or [primitive_colour(place) for place in range(len(demonstrations))]
    points = np.concatenate([demonstration.position for demonstration in demonstrations])
    with rrd.recording(path, title) as to:
        around = [] if scenery is None else scenery(to)
        to.show(_blueprint(demonstrations, segmentation, title, around))
        to.notes(f"{note}\n\n{rrd.origin_sentence(demonstrations)}")
        for demonstration, colour in zip(demonstrations, colours, strict=True):
            parts = _parts(demonstration, segmentation, colour)
            _send_path(to, demonstration, parts)
            _send_positions(to, demonstration, parts)
            _send_signals(to, demonstration, rrd.axis_length(points))
            if segmentation is not None and len(cuts := _cuts(demonstration, segmentation)):
                lane, times = entity("primitive", demonstration.name), np.append(cuts[:, 0], cuts[-1, 1])
                to.lane(lane, times, segmentation.primitives)


Part = tuple[int, int, str]  # first and last sample of a stretch of a demonstration, and its colour


def _parts(demonstration: Demonstration, segmentation: Segmentation | None, colour: str) -> list[Part]:
    """Consecutive stretches of a demonstration, from its first to its last sample."""
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
    """Start and end (P, 2) of each primitive in s; empty if the demonstration could not be cut."""
    tables = [segmentation.result(name) for name in segmentation.primitives]
    name, ends = demonstration.name, ["start_s", "end_s"]
    found = [table.loc[name, ends] for table in tables if name in table.index]
    return np.array(found, dtype=float).reshape(-1, 2)


def _send_path(to: Recording, demonstration: Demonstration, parts: Sequence[Part]) -> None:
    step = rrd.thinning(demonstration.dt)
    strips = [demonstration.position[[*range(first, last, step), last]] for first, last, _ in parts]
    to.lines(entity("paths", demonstration.name), strips, [colour for _, _, colour in parts], -1.0)


def _send_positions(to: Recording, demonstration: Demonstration, parts: Sequence[Part]) -> None:
    """Log each axis as a line coloured by primitive, and points at the cuts."""
    kept = slice(None, None, rrd.thinning(demonstration.dt))
    first = [part[0] for part in parts]
    colours = rr.SeriesLines.columns(colors=rrd.rgba([colour for _, _, colour in parts]))
    for column, axis in enumerate(AXES):
        path, position = entity("position", axis, demonstration.name), 1e3 * demonstration.position[:, column]
        to.still(path, rr.SeriesLines(names=demonstration.name, widths=1.0))
        to.over(path, demonstration.time[first], colours)
        to.over(path, demonstration.time[kept], rr.Scalars.columns(scalars=position[kept]))
        if len(first) > 1:
            cuts, path = first[1:], entity("cuts", axis, demonstration.name)
            to.marks(path, demonstration.time[cuts], position[cuts], "cuts", WHITE)


def _send_signals(to: Recording, demonstration: Demonstration, length: float) -> None:
    """Log the moving frame and the plots of one demonstration."""
    name, kept = demonstration.name, slice(None, None, rrd.thinning(demonstration.dt))
    times = demonstration.time[kept]
    orientation = None if demonstration.orientation is None else demonstration.orientation[kept]
    position = demonstration.position[kept]
    to.moving_frame(entity("hands", name), times, position, WHITE, orientation, length)
    for one in _signals(demonstration):
        width = 1.5 if one.legend else 1.0
        to.series(entity(one.kind, name), times, one.values, one.names, one.colours, width)


class _Signal(NamedTuple):
    """A plot of one demonstration."""

    kind: str  # first part of the entity's path
    title: str
    values: np.ndarray  # (T, D), thinned
    names: Sequence[str] = AXES
    colours: Sequence[str] = AXIS_COLOURS
    legend: bool = True


def _signals(demonstration: Demonstration) -> list[_Signal]:
    kept = slice(None, None, rrd.thinning(demonstration.dt))
    position = demonstration.position[kept]
    found = [_Signal("moved", "moved (mm)", 1e3 * (position - position[0]))]
    if demonstration.orientation is not None:
        orientation = demonstration.orientation[kept]
        steps = quaternion.difference(orientation[1:], orientation[:-1])
        turned = np.degrees(np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)]))
        found.append(_Signal("turned", "turned (degrees)", turned))
    if demonstration.wrench is not None:
        force, torque = np.split(demonstration.wrench[kept], 2, axis=1)
        found += [_Signal("force", "force (N)", force), _Signal("torque", "torque (N m)", torque)]
    if demonstration.tactile is not None:
        changes = demonstration.tactile[kept] - demonstration.tactile[0]  # resting values differ far more
        count, rest = divmod(changes.shape[1], ELECTRODES_PER_FINGER)
        fingers = {"tactile": changes}
        if not rest:
            parts = np.split(changes, count, axis=1)
            fingers = {f"tactile {finger}": part for finger, part in enumerate(parts, 1)}
        for finger, part in fingers.items():
            colours = [primitive_colour(number) for number in range(part.shape[1])]
            electrodes = [f"E{number}" for number in range(1, 1 + part.shape[1])]
            title = f"{finger} (counts since the start)"
            found.append(_Signal(finger, title, part, electrodes, colours, legend=False))
    return found


def _blueprint(
    demonstrations: Sequence[Demonstration],
    segmentation: Segmentation | None,
    title: str,
    around: Sequence[str],
) -> rrb.Container:
    points = np.concatenate([demonstration.position for demonstration in demonstrations])
    heading = f"{title}{rrd.origin_label(demonstrations)}"
    scene = rrd.scene_view(heading, ["/paths/**", "/hands/**", *around], points)
    plots = [plot(f"{axis} (mm)", [f"/position/{axis}/**", f"/cuts/{axis}/**"], False) for axis in AXES]
    if any(demonstration.orientation is not None for demonstration in demonstrations):
        plots.append(plot("turned (degrees)", ["/turned/**"], legend=False))
    cuts = [] if segmentation is None else [rrd.lanes(["/primitive/**"])]
    shares = [3] * len(cuts) + [2] * len(plots)
    overview = rrb.Horizontal(
        rrb.Vertical(scene, rrd.notes_view(), row_shares=[4, 1]),
        rrb.Vertical(*cuts, *plots, row_shares=shares),
        name="All",
        column_shares=[4, 3],
    )
    felt = any(one.tactile is not None for one in demonstrations)
    if not felt and all(one.orientation is None and one.wrench is None for one in demonstrations):
        return overview
    details = [_detail(demonstration, segmentation, around) for demonstration in demonstrations[:DETAILED]]
    first = 1 if felt and not around else 0  # the overview does not show touch
    return rrb.Tabs(overview, *details, active_tab=first)


def _detail(
    demonstration: Demonstration, segmentation: Segmentation | None, around: Sequence[str]
) -> rrb.Horizontal:
    """Tab with all signals of one demonstration."""
    name = demonstration.name
    shown = [*(entity(kind, name) for kind in ("paths", "hands")), *around]
    scene = rrd.scene_view(f"{name}{rrd.origin_label([demonstration])}", shown, demonstration.position)
    plots = [plot(one.title, [entity(one.kind, name)], one.legend) for one in _signals(demonstration)]
    cuts = [] if segmentation is None else [rrd.lanes([entity("primitive", name)])]
    left = rrb.Vertical(scene, *cuts, row_shares=[5, 1][: 1 + len(cuts)])
    right = rrb.Grid(*plots, grid_columns=1 if len(plots) < 4 else 2)
    return rrb.Horizontal(left, right, name=name, column_shares=[2, 3])
