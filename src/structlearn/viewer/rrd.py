"""Writing of .rrd recordings: opening a file, logging signals and frames, and views of a scene."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader
from rerun.error_utils import set_strict_mode, strict_mode

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.palette import AXIS_COLOURS, COLOUR_NAMES, LIGHT_BLUE, ORANGE, primitive_colour
from structlearn.readers.demonstration import Demonstration

TIME = "time"  # timeline in seconds since the start of a demonstration or movement
VIEW_RATE_HZ = 100.0  # approximate rate of displayed signals
AXIS_SHARE = 0.12  # length of a moving frame's axes as a fraction of the scene's radius
SHORTEST_AXES = 0.01  # m; also in a scene with little but rotation
NEAREST = 0.06  # m; distance of the camera from such a scene
HALF_FIELD_OF_VIEW = np.radians(27.5)  # of rerun's camera, from the middle of a view to its upper edge
NARROWEST = 0.8  # width over height of the narrowest 3-D view into which the scene must fit
ROOM = 1.15  # factor on the distance at which all points are just visible, for frames and labels
ELEVATION = np.radians(25.0)  # of the camera: shows paths on a board from above, and heights
FLOOR_SQUARE_M = 0.1
GROUND = (13, 13, 13)  # rgb of the background, dark also in browsers with a light theme
RESTING = "#565d66"  # colour of an electrode that reads as expected


@contextmanager
def recording(path: str | Path, title: str) -> Iterator[rr.RecordingStream]:
    """Write a recording: yields the stream; the file is complete when the block ends, or absent.

    The data are collected in memory, since rerun's file sink at most logs that a disk is full. The viewer
    keeps one blueprint per application and merges recordings with equal ids, so both are named after the
    title, and several recordings can be open side by side. No wall-clock time is logged. Raises OSError: the
    file cannot be written; InputError: it cannot be read back.
    """
    application = f"structlearn: {re.sub(r'[^A-Za-z0-9 ,:_-]', '', title)}"  # rerun renames other characters
    stream = rr.RecordingStream(application, recording_id=title, send_properties=False)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    memory = stream.memory_recording()
    strict = strict_mode()
    set_strict_mode(True)  # otherwise rerun turns errors into warnings and leaves views empty
    try:
        stream.send_recording_name(title)
        yield stream
        written = memory.drain_as_bytes()  # with the footer that `rerun rrd verify` requires
    finally:
        set_strict_mode(strict)
        stream.disconnect()
    Path(path).write_bytes(written)
    try:
        RrdReader(path).recordings()  # needs the footer
    except RuntimeError as error:
        raise InputError(f"{path}: is not on the disk as it was written: {error}") from error


def entity(*parts: str) -> str:
    """Path of an entity from names, with special characters escaped."""
    return rr.new_entity_path(list(parts))


def rgba(colours: Sequence[str], opacity: float = 1.0) -> np.ndarray:
    """Colours `#rrggbb` in rerun's format, (N,) 0xRRGGBBAA."""
    alpha = f"{round(255 * opacity):02x}"
    return np.array([int(f"{colour[1:]}{alpha}", 16) for colour in colours], dtype=np.uint32)


def blended(share: np.ndarray, colours: Sequence[str]) -> np.ndarray:
    """Colours 0xRRGGBBAA (...) of shares (...), interpolated from the first colour at 0 to the last at 1."""
    stops = np.array([[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in colours])
    places = np.linspace(0.0, 1.0, len(stops))
    red, green, blue = (np.interp(share, places, stops[:, part]).astype(np.uint32) for part in range(3))
    return (red << 24) | (green << 16) | (blue << 8) | 0xFF


def deviation_colours(deviation: np.ndarray, scale: float) -> np.ndarray:
    """Colours 0xRRGGBBAA of deviations (...): light blue below the expected reading, orange above."""
    return blended(0.5 + 0.5 * deviation / scale, (LIGHT_BLUE, RESTING, ORANGE))


def origin_label(demonstrations: Sequence[Demonstration]) -> str:
    """Origin of data for a heading; empty if all of it was recorded."""
    simulated = [demonstration.simulated for demonstration in demonstrations]
    if not any(simulated):
        return ""
    return " (simulated)" if all(simulated) else f" ({sum(simulated)} of {len(simulated)} simulated)"


def thinning(dt: float, rate_hz: float = VIEW_RATE_HZ) -> int:
    """Stride that thins samples to about this rate."""
    return max(1, round(1.0 / (rate_hz * dt)))


def time_column(times: np.ndarray) -> rr.TimeColumn:
    """Times (T,) in s on the timeline of seconds."""
    return rr.TimeColumn(TIME, duration=times)


def send_series(
    stream: rr.RecordingStream,
    path: str,
    indexes: Sequence[rr.TimeColumn],
    values: np.ndarray,
    names: Sequence[str],
    colours: Sequence[str] = AXIS_COLOURS,
    width: float = 1.5,
) -> None:
    """Log D signals, (T, D) with T times on each timeline, as lines of one plot."""
    style = rr.SeriesLines(names=list(names), colors=rgba(colours[: len(names)]), widths=[width] * len(names))
    stream.log(path, style, static=True)
    columns = rr.Scalars.columns(scalars=values.ravel())
    stream.send_columns(path, indexes, columns.partition([values.shape[1]] * len(values)))


def send_curve(
    stream: rr.RecordingStream, path: str, time: np.ndarray, values: np.ndarray, name: str, colour: str
) -> None:
    """Log one signal (T,) over time (T,) in s as a line of a plot."""
    send_series(stream, path, [time_column(time)], values[:, None], [name], [colour])


def send_marks(
    stream: rr.RecordingStream,
    path: str,
    indexes: Sequence[rr.TimeColumn],
    values: np.ndarray,
    name: str,
    colour: str,
) -> None:
    """Log single samples (K,) of a plot as points, e.g. a curve's cut points."""
    style = rr.SeriesPoints(names=name, colors=rgba([colour]), markers="circle", marker_sizes=3.0)
    stream.log(path, style, static=True)
    stream.send_columns(path, indexes, rr.Scalars.columns(scalars=values))


def send_moving_point(
    stream: rr.RecordingStream,
    path: str,
    time: np.ndarray,
    places: np.ndarray,
    colour: str,
    radius: float,
    order: float | None = None,
    there: np.ndarray | None = None,
) -> None:
    """Log a point, (T, 2) or (T, 3) over times (T,) in s; it is hidden where it is not `there` (T,).

    `radius`: in the unit of the places; `order`: draw order on a flat picture.
    """
    kind: Any = rr.Points3D if places.shape[1] == 3 else rr.Points2D
    look = {"colors": rgba([colour]), "radii": radius} | ({} if order is None else {"draw_order": order})
    stream.log(path, kind.from_fields(**look), static=True)
    shown = np.full(len(time), True) if there is None else there
    columns = kind.columns(positions=places[shown]).partition(shown.astype(int))
    stream.send_columns(path, [time_column(time)], columns)


def send_moving_frame(
    stream: rr.RecordingStream,
    path: str,
    indexes: Sequence[rr.TimeColumn],
    position: np.ndarray,
    orientation: np.ndarray | None,
    colour: str,
    axis_length: float,
) -> None:
    """Log a pose over time, (T, 3) m and (T, 4) if known, as a point with axes of a length in m."""
    pose: dict[str, Any] = {"translation": position}
    if orientation is not None:
        pose["quaternion"] = quaternion.to_xyzw(orientation)
    if orientation is not None and axis_length > 0.0:
        stream.log(path, rr.TransformAxes3D(axis_length), static=True)
    stream.log(path, rr.Points3D([[0.0, 0.0, 0.0]], colors=rgba([colour]), radii=-3.0), static=True)
    stream.send_columns(path, indexes, rr.Transform3D.columns(**pose))


def send_floor_axes(stream: rr.RecordingStream, path: str, points: np.ndarray) -> float:
    """Log x, y and z as arrows of a square's length at the corner of a floor below points (N, 3) in m.

    Returns the height of the floor, for `scene_view`.
    """
    corner = points.min(axis=0)
    arrows = rr.Arrows3D(
        origins=[corner] * 3,
        vectors=FLOOR_SQUARE_M * np.eye(3),
        colors=rgba(AXIS_COLOURS),
        labels=["x", "y", "z"],
        show_labels=True,
    )
    stream.log(path, arrows, static=True)
    return float(corner[2])


def solid_boxes(
    sizes: Sequence[Sequence[float] | np.ndarray],
    centres: Sequence[Sequence[float] | np.ndarray],
    colours: Sequence[str],
    opacity: float = 1.0,
) -> rr.Boxes3D:
    """N filled boxes of sizes and centres in m, with N colours or one for all."""
    filled = rr.components.FillMode.Solid
    return rr.Boxes3D(sizes=sizes, centers=centres, colors=rgba(colours, opacity), fill_mode=filled)


def send_primitive_lane(
    stream: rr.RecordingStream, path: str, indexes: Sequence[rr.TimeColumn], names: Sequence[str]
) -> None:
    """Log a coloured lane of P primitives from P + 1 times: their starts, and the end of the last."""
    colours = [primitive_colour(place) for place in range(len(names))]
    stream.log(path, rr.StateConfiguration(values=names, colors=rgba(colours)), static=True)
    stream.send_columns(path, indexes, rr.StateChange.columns(state=[*names, ""]))


def axis_length(points: np.ndarray) -> float:
    """Length in m of the axes of frames moving among the points (N, 3)."""
    radius = 0.5 * float(np.linalg.norm(np.ptp(points, axis=0)))
    return max(AXIS_SHARE * radius, SHORTEST_AXES)


def scene_view(
    name: str, contents: Sequence[str], points: np.ndarray, floor_m: float | None = None
) -> rrb.Spatial3DView:
    """3-D view of points (N, 3) m, along the horizontal direction of least extent and slightly from above."""
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    horizontal = points[:, :2] - points[:, :2].mean(axis=0)
    least = np.linalg.eigh(horizontal.T @ horizontal)[1][:, 0]
    least = least if least.sum() >= 0 else -least  # an eigenvector's sign is arbitrary: always the same side
    backward = np.array([*(np.cos(ELEVATION) * least), np.sin(ELEVATION)])
    right = np.array([-least[1], least[0], 0.0])
    across = np.abs((points - centre) @ np.column_stack([right, np.cross(backward, right)]))  # (N, 2)
    needed = np.max(across / [NARROWEST, 1.0], axis=1) / np.tan(HALF_FIELD_OF_VIEW)
    distance = max(float(np.max(needed + (points - centre) @ backward)), NEAREST)
    return eye_view(name, contents, centre, ROOM * distance * backward, floor_m)


def eye_view(
    name: str,
    contents: Sequence[str],
    target: np.ndarray,
    from_target: np.ndarray,
    floor_m: float | None = None,
) -> rrb.Spatial3DView:
    """3-D view of a target (3,) m from a relative position (3,) m; `floor_m`: height of a grid."""
    floor = floor_m is not None and rrb.LineGrid3D(
        visible=True,
        spacing=FLOOR_SQUARE_M,
        plane=rr.components.Plane3D.XY.with_distance(floor_m),
        color=rgba([RESTING])[0],
    )
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=target + from_target, look_target=target, eye_up=[0.0, 0.0, 1.0]
    )
    return rrb.Spatial3DView(
        name=name, origin="/", contents=list(contents), background=GROUND, eye_controls=eye, line_grid=floor
    )


def flat_view(
    name: str, paths: str | Sequence[str], x_range: Sequence[float], y_range: Sequence[float]
) -> rrb.Spatial2DView:
    """View of a drawing below one or several entity paths, y downwards."""
    contents = [f"{path}/**" for path in ([paths] if isinstance(paths, str) else paths)]
    bounds = rrb.VisualBounds2D(x_range=x_range, y_range=y_range)
    return rrb.Spatial2DView(
        name=name, origin="/", contents=contents, background=GROUND, visual_bounds=bounds
    )


def plot(name: str, contents: Sequence[str], legend: bool = True) -> rrb.TimeSeriesView:
    """Plot over time, with its time axis linked to all others."""
    return rrb.TimeSeriesView(
        name=name,
        origin="/",
        contents=list(contents),
        background=rrb.archetypes.PlotBackground(color=GROUND),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop, visible=legend),
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
    )


def lanes(contents: Sequence[str]) -> rrb.StateTimelineView:
    """Lanes of primitives over time."""
    return rrb.StateTimelineView(name="Primitives", origin="/", contents=list(contents))


def layout(
    content: rrb.Container | rrb.View, timeline: str = TIME, steps_per_s: float | None = None
) -> rrb.Blueprint:
    """Blueprint with collapsed side panels, which plays a timeline in a loop.

    `steps_per_s`: speed of integer timelines.
    """
    looped: dict[str, Any] = {"timeline": timeline, "play_state": "playing", "loop_mode": "all"}
    panels = rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")
    return rrb.Blueprint(content, *panels, rrb.TimePanel(state="collapsed", fps=steps_per_s, **looped))


def send_notes(stream: rr.RecordingStream, text: str, *parts: str) -> None:
    """Log a description in Markdown."""
    stream.log(notes_path(*parts), rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)


def notes_view(*parts: str, name: str = "what is shown") -> rrb.TextDocumentView:
    """Panel with the text of `send_notes`."""
    path = notes_path(*parts)
    return rrb.TextDocumentView(name=name, origin=path, contents=[path])


def notes_path(*parts: str) -> str:
    """Entity of the notes."""
    return entity("notes", *parts)


def colour_words(colours: dict[str, str]) -> str:
    """A legend in Markdown of meanings by name of the colour."""
    return " · ".join(f"**{colour}** {meaning}" for colour, meaning in colours.items())


def legend(colours: Mapping[str, str]) -> str:
    """A legend in Markdown of names with their colours of the palette, in one line: panels are low."""
    return " · ".join(f"**{COLOUR_NAMES[colour]}** {name}" for name, colour in colours.items())


def origin_sentence(runs: Sequence[Demonstration], subject: str = "Everything here is") -> str:
    """A sentence on whether runs are simulated or recorded."""
    simulated = sum(run.simulated for run in runs)
    if simulated in (0, len(runs)):
        return f"{subject} {'simulated' if simulated else 'recorded'}."
    return f"{simulated} of {len(runs)} runs are simulated, the others recorded."
