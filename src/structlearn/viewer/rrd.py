"""Writing .rrd files: open a recording, log signals and frames, set up its views."""

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

TIME = "time"  # time line in s since the start of a demonstration or movement
VIEW_RATE_HZ = 100.0  # signals are thinned to about this rate, enough for a screen
AXIS_SHARE = 0.12  # length of a moving frame's axes as a fraction of the scene's radius
SHORTEST_AXES = 0.01  # m; for scenes in which hardly anything but the orientation moves
NEAREST = 0.06  # m; distance of the camera in such scenes
HALF_FIELD_OF_VIEW = np.radians(27.5)  # of rerun's camera, from the centre of a view to its upper edge
NARROWEST = 0.8  # width over height of the narrowest 3-D view that should show the whole scene
ROOM = 1.15  # factor on the distance at which all points are just visible, for frames and labels
ELEVATION = np.radians(25.0)  # of the camera: shows both paths on a board and heights
FLOOR_SQUARE_M = 0.1
GROUND = (13, 13, 13)  # RGB background, dark also in browsers with a light theme
RESTING = "#565d66"  # electrode that reads as expected

Colours = str | Sequence[str] | np.ndarray
"""One `#rrggbb`, several, or numbers as of `rgba`."""

Times = np.ndarray | rr.TimeColumn | Sequence[rr.TimeColumn]
"""T times in s on the time line of seconds, or on other time lines."""


class Recording(rr.RecordingStream):
    """An open recording: what testbeds draw with; `path` is an entity's, radii below 0 are in points."""

    def still(self, path: str, *shapes: rr.AsComponents) -> None:
        """Log what does not change."""
        self.log(path, *shapes, static=True)

    def over(self, path: str, times: Times, columns: Any) -> None:
        """Log T values of components over times."""
        self.send_columns(path, time_columns(times), columns)

    def series(
        self,
        path: str,
        times: Times,
        values: np.ndarray,
        names: str | Sequence[str],
        colours: str | Sequence[str] = AXIS_COLOURS,
        width: float = 1.5,
    ) -> None:
        """Log one signal (T,) with a name and a colour, or D signals (T, D), as lines of one plot."""
        count = values.size // max(len(values), 1)
        called = [names] if isinstance(names, str) and values.ndim == 1 else list(names)
        shown = rgba(colours if isinstance(colours, str) else colours[: len(called)])
        self.still(path, rr.SeriesLines(names=called, colors=shown, widths=[width] * len(called)))
        columns = rr.Scalars.columns(scalars=values.ravel())
        self.over(path, times, columns.partition([count] * len(values)))

    def marks(self, path: str, times: Times, values: np.ndarray, name: str, colour: str) -> None:
        """Log single samples (K,) as points in a plot, e.g. a curve's cut points."""
        style = rr.SeriesPoints(names=name, colors=rgba(colour), markers="circle", marker_sizes=3.0)
        self.still(path, style)
        self.over(path, times, rr.Scalars.columns(scalars=values))

    def lines(self, path: str, strips: Any, colours: Colours, radii: float, **look: Any) -> None:
        """Log N lines of points (2,) or (3,), with N colours or one; `look`: as for `lines`."""
        self.still(path, lines(strips, colours, radii, **look))

    def dots(self, path: str, points: Any, colours: Colours, radii: float, **look: Any) -> None:
        """Log N points (2,) or (3,), with N colours or one; `look`: as for `dots`."""
        self.still(path, dots(points, colours, radii, **look))

    def solid(self, path: str, kind: Any, colours: Colours, opacity: float = 1.0, **shape: Any) -> None:
        """Log N filled bodies of a kind of rerun's, e.g. `Capsules3D`, with N colours or one."""
        filled = rr.components.FillMode.Solid
        self.still(path, kind(colors=rgba(colours, opacity), fill_mode=filled, **shape))

    def boxes(self, path: str, sizes: Any, centres: Any, colours: Colours, opacity: float = 1.0) -> None:
        """Log N filled boxes with sizes and centres (3,) in m, with N colours or one."""
        self.solid(path, rr.Boxes3D, colours, opacity, sizes=sizes, centers=centres)

    def moving_point(
        self,
        path: str,
        times: Times,
        places: np.ndarray,
        colour: str,
        radius: float,
        there: np.ndarray | None = None,
        **look: Any,
    ) -> None:
        """Log a moving point (T, 2) or (T, 3); hidden where `there` (T,) is False."""
        kind: Any = rr.Points3D if places.shape[1] == 3 else rr.Points2D
        self.still(path, kind.from_fields(colors=rgba(colour), radii=radius, **look))
        shown = np.full(len(places), True) if there is None else there
        self.over(path, times, kind.columns(positions=places[shown]).partition(shown.astype(int)))

    def trail(
        self, path: str, times: Times, places: np.ndarray, colour: str, radius: float, **look: Any
    ) -> None:
        """Log the path (T, 2) or (T, 3) travelled so far."""
        kind: Any = rr.LineStrips3D if places.shape[1] == 3 else rr.LineStrips2D
        self.still(path, kind.from_fields(radii=radius, colors=rgba(colour), **look))
        trails = [places[: max(end, 2)] for end in range(1, len(places) + 1)]
        self.over(path, times, kind.columns(strips=trails))

    def moving_frame(
        self,
        path: str,
        times: Times,
        position: np.ndarray,
        colour: str,
        orientation: np.ndarray | None = None,
        axis_length: float = 0.0,
    ) -> None:
        """Log a pose over time, (T, 3) m and, if known, (T, 4), as a point with axes of a length in m."""
        pose: dict[str, Any] = {"translation": position}
        if orientation is not None:
            pose["quaternion"] = quaternion.to_xyzw(orientation)
            if axis_length > 0.0:
                self.still(path, rr.TransformAxes3D(axis_length))
        self.dots(path, [[0.0, 0.0, 0.0]], colour, -3.0)
        self.over(path, times, rr.Transform3D.columns(**pose))

    def readings(
        self, path: str, times: Times, points: rr.Points2D | rr.Points3D, deviation: np.ndarray, scale: float
    ) -> None:
        """Log E electrodes, coloured by deviations (T, E): light blue below what is expected."""
        self.still(path, points)
        colours = blended(0.5 + 0.5 * deviation / scale, (LIGHT_BLUE, RESTING, ORANGE))
        columns = points.columns(colors=colours.ravel()).partition([colours.shape[1]] * len(colours))
        self.over(path, times, columns)

    def floor_axes(self, path: str, points: np.ndarray) -> float:
        """Log x, y and z arrows, one floor square long, at the corner of a floor below points (N, 3) m.

        Returns the height of the floor in m, for `scene_view`.
        """
        corner = points.min(axis=0)
        look: dict[str, Any] = {"colors": rgba(AXIS_COLOURS), "labels": ["x", "y", "z"], "show_labels": True}
        self.still(path, rr.Arrows3D(origins=[corner] * 3, vectors=FLOOR_SQUARE_M * np.eye(3), **look))
        return float(corner[2])

    def lane(self, path: str, times: Times, names: Sequence[str]) -> None:
        """Log a coloured lane of P primitives with P + 1 times: their starts and the last end."""
        colours = [primitive_colour(place) for place in range(len(names))]
        self.still(path, rr.StateConfiguration(values=names, colors=rgba(colours)))
        self.over(path, times, rr.StateChange.columns(state=[*names, ""]))

    def notes(self, text: str, *parts: str) -> None:
        """Log notes on the contents, in Markdown."""
        self.still(entity("notes", *parts), rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))

    def show(
        self,
        content: rrb.Container | rrb.View | Sequence[rrb.Container],
        timeline: str = TIME,
        steps_per_s: float | None = None,
    ) -> None:
        """Set up the views, or tabs, with collapsed side panels; the time line is played in a loop.

        `steps_per_s`: playback speed of integer time lines.
        """
        shown = rrb.Tabs(*content, active_tab=0) if isinstance(content, Sequence) else content
        looped: dict[str, Any] = {"timeline": timeline, "play_state": "playing", "loop_mode": "all"}
        panels = rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")
        time = rrb.TimePanel(state="collapsed", fps=steps_per_s, **looped)
        self.send_blueprint(rrb.Blueprint(shown, *panels, time))


@contextmanager
def recording(path: str | Path, title: str) -> Iterator[Recording]:
    """Write a recording: yields the stream; the file is written, complete, when the block ends without error.

    Data are collected in memory, since rerun's file sink reports a full disk in its log at most. The viewer
    keeps one blueprint per application and merges recordings of equal id; both are named after the title, so
    that several recordings can be open side by side. No wall-clock time is logged.

    Raises OSError: the file cannot be written; InputError: it cannot be read back.
    """
    application = f"structlearn: {re.sub(r'[^A-Za-z0-9 ,:_-]', '', title)}"  # rerun replaces other characters
    stream = Recording(application, recording_id=title, send_properties=False)
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
        RrdReader(path).recordings()  # requires the footer
    except RuntimeError as error:
        raise InputError(f"{path}: is not on the disk as it was written: {error}") from error


def entity(*parts: str) -> str:
    """Entity path from its parts, with special characters escaped."""
    return rr.new_entity_path(list(parts))


def below(*parts: str) -> str:
    """Query expression for an entity and all below it."""
    return f"{entity(*parts)}/**"


def rgba(colours: Colours, opacity: float = 1.0) -> np.ndarray:
    """Colours 0xRRGGBBAA (N,) for rerun, from one `#rrggbb` or N; numbers stay."""
    if isinstance(colours, np.ndarray):
        return colours
    colours = [colours] if isinstance(colours, str) else colours
    alpha = f"{round(255 * opacity):02x}"
    return np.array([int(f"{colour[1:]}{alpha}", 16) for colour in colours], dtype=np.uint32)


def blended(share: np.ndarray, colours: Sequence[str]) -> np.ndarray:
    """Colours 0xRRGGBBAA (...) interpolated over `colours`, from the first at share 0 to the last at 1."""
    stops = np.array([[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in colours])
    places = np.linspace(0.0, 1.0, len(stops))
    red, green, blue = (np.interp(share, places, stops[:, part]).astype(np.uint32) for part in range(3))
    return (red << 24) | (green << 16) | (blue << 8) | 0xFF


def lines(strips: Any, colours: Colours, radii: float, opacity: float = 1.0, **look: Any) -> rr.AsComponents:
    """N lines of points (2,) or (3,), with N colours or one."""
    kind: Any = rr.LineStrips3D if np.shape(strips[0])[-1] == 3 else rr.LineStrips2D
    return kind(strips, colors=rgba(colours, opacity), radii=radii, **look)


def dots(points: Any, colours: Colours, radii: float, opacity: float = 1.0, **look: Any) -> rr.AsComponents:
    """N points (2,) or (3,), with N colours or one; with `labels`, they are shown."""
    kind: Any = rr.Points3D if np.shape(points)[-1] == 3 else rr.Points2D
    shown = {"show_labels": True} if "labels" in look else {}
    return kind(points, colors=rgba(colours, opacity), radii=radii, **(shown | look))


def origin_label(demonstrations: Sequence[Demonstration]) -> str:
    """Suffix for headings that labels simulated data; empty if all data were recorded."""
    simulated = [demonstration.simulated for demonstration in demonstrations]
    if not any(simulated):
        return ""
    return " (simulated)" if all(simulated) else f" ({sum(simulated)} of {len(simulated)} simulated)"


def thinning(dt: float, rate_hz: float = VIEW_RATE_HZ) -> int:
    """Step between kept samples that thins a signal to about `rate_hz`."""
    return max(1, round(1.0 / (rate_hz * dt)))


def time_columns(times: Times) -> list[rr.TimeColumn]:
    """Columns of T times on each time line."""
    if isinstance(times, np.ndarray):
        return [rr.TimeColumn(TIME, duration=times)]
    return [times] if isinstance(times, rr.TimeColumn) else list(times)


def axis_length(points: np.ndarray) -> float:
    """Axis length in m for frames that move among points (N, 3) m."""
    radius = 0.5 * float(np.linalg.norm(np.ptp(points, axis=0)))
    return max(AXIS_SHARE * radius, SHORTEST_AXES)


def scene_view(
    name: str, contents: Sequence[str], points: np.ndarray, floor_m: float | None = None
) -> rrb.Spatial3DView:
    """3-D view of points (N, 3) m, along the horizontal direction of least extent and slightly from above."""
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    horizontal = points[:, :2] - points[:, :2].mean(axis=0)
    least = np.linalg.eigh(horizontal.T @ horizontal)[1][:, 0]
    least = least if least.sum() >= 0 else -least  # eigenvectors have arbitrary sign; keep one side
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
    """3-D view of `target` (3,) m from the relative position `from_target` (3,) m; `floor_m`: grid height."""
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
    """2-D view of the drawing below one or several entity paths, y downwards."""
    contents = [f"{path}/**" for path in ([paths] if isinstance(paths, str) else paths)]
    bounds = rrb.VisualBounds2D(x_range=x_range, y_range=y_range)
    return rrb.Spatial2DView(
        name=name, origin="/", contents=contents, background=GROUND, visual_bounds=bounds
    )


def plot(
    name: str, contents: Sequence[str], legend: bool = True, limits: tuple[float, float] | None = None
) -> rrb.TimeSeriesView:
    """Plot over time, with its time axis linked to all others; `limits`: of values."""
    view = rrb.TimeSeriesView(
        name=name,
        origin="/",
        contents=list(contents),
        background=rrb.archetypes.PlotBackground(color=GROUND),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop, visible=legend),
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
    )
    if limits is not None:
        view.properties["ScalarAxis"] = rrb.ScalarAxis(range=limits)
    return view


def lanes(contents: Sequence[str]) -> rrb.StateTimelineView:
    """Lanes of primitives over time."""
    return rrb.StateTimelineView(name="Primitives", origin="/", contents=list(contents))


def notes_view(*parts: str, name: str = "what is shown") -> rrb.TextDocumentView:
    """Panel that shows notes."""
    path = entity("notes", *parts)
    return rrb.TextDocumentView(name=name, origin=path, contents=[path])


def colour_words(colours: dict[str, str]) -> str:
    """Markdown legend from meanings keyed by colour name."""
    return " · ".join(f"**{colour}** {meaning}" for colour, meaning in colours.items())


def legend(colours: Mapping[str, str]) -> str:
    """Markdown legend, on one line since panels are low, from palette colours keyed by name."""
    return " · ".join(f"**{COLOUR_NAMES[colour]}** {name}" for name, colour in colours.items())


def table(heads: str, rows: Sequence[str]) -> str:
    """Markdown table of a row of heads and other rows, `| a | b |`."""
    return "\n".join([heads, "|---" * (heads.count("|") - 1) + "|", *rows])


def origin_sentence(runs: Sequence[Demonstration], subject: str = "Everything here is") -> str:
    """Sentence that says whether runs are simulated or recorded."""
    simulated = sum(run.simulated for run in runs)
    if simulated in (0, len(runs)):
        return f"{subject} {'simulated' if simulated else 'recorded'}."
    return f"{simulated} of {len(runs)} runs are simulated, the others recorded."
