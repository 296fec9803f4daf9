"""Recording of learned primitives: the sequence unrolled among its demonstrations, and what drives it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb

from structlearn.core.frames import local_frame
from structlearn.palette import AXIS_COLOURS, GREY, LIGHT_BLUE, ORANGE, WHITE, primitive_colour
from structlearn.primitives import canonical
from structlearn.primitives.sequence import OrientationPrimitive, PosePrimitive
from structlearn.primitives.twist_swing import TwistSwingPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.viewer.recorded_demonstrations import Scenery
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

PHASE = "phase"  # time line of the phase that is spent: paths of different durations move in step on it
PHASE_STEPS = 1000  # steps of that time line per primitive; time lines of rerun are whole numbers

ALL = slice(None)

UNITS = {"speed": "mm/s", "acceleration": "mm/s²", "turning": "degrees/s"}

CONTEXT, CONTEXT_OPACITY = 20, 0.25
"""Demonstrations whose paths are drawn, of a larger set an even choice, and how faintly: they must not hide
the unrolled path in their midst."""

PATH_COLOURS = (LIGHT_BLUE, ORANGE, *AXIS_COLOURS[1:])
"""Curves of one path each, in plots where no primitive has a colour."""


@dataclass(frozen=True)
class _Path:
    """One unrolled sequence, thinned for the screen."""

    time: np.ndarray  # (T,) s
    place: np.ndarray  # (T,) index of the primitive that runs
    position: np.ndarray  # (T, 3) m
    orientation: np.ndarray | None  # (T, 4)
    rates: dict[str, np.ndarray]  # by name as in UNITS: (T,)
    elapsed: np.ndarray  # (T,) s since the primitive began
    durations: np.ndarray  # (P,) s
    switches: np.ndarray  # (P + 1,) sample at which each primitive starts, and the last one

    @property
    def phase(self) -> tuple[np.ndarray, np.ndarray]:
        """Phase and phase velocity, (T,) each."""
        return canonical.phase(self.elapsed, canonical.TAU_PER_DURATION * self.durations[self.place])

    def indexes(self, at: np.ndarray | slice = ALL) -> list[rr.TimeColumn]:
        """Both time lines at some samples."""
        spent = np.round(PHASE_STEPS * (self.place + 1.0 - self.phase[0])).astype(int)
        return [time_column(self.time[at]), rr.TimeColumn(PHASE, sequence=spent[at])]


def write_primitives(
    path: str | Path,
    demonstrations: Sequence[Demonstration],
    primitives: Sequence[PosePrimitive],
    paths: Mapping[str, pd.DataFrame],
    title: str = "Primitives",
    note: str = "",
    scenery: Scenery | None = None,
    colours: Mapping[str, str] | None = None,
) -> None:
    """Write a learned sequence as a recording.

    `demonstrations`: that it was learned from, as context; of more than `CONTEXT` an even choice is drawn;
    `paths`: unrolled sequences by name, as `sequence.sequence_table` has them; the first one is that of the
    plotted forcing terms; `note`: what is shown, in Markdown; that demonstrations are recorded or simulated
    is added; `colours`: of the paths by name; default by primitive, and a colour each for their curves.
    """
    unrolled = {name: _path(table, primitives) for name, table in paths.items()}
    points = np.concatenate(
        [one.position for one in demonstrations] + [one.position for one in unrolled.values()]
    )
    length = axis_length(points)
    with recording(path, title) as stream:
        around = [] if scenery is None else scenery(stream)
        heading = f"{title}{origin_label(demonstrations)}"
        stream.send_blueprint(_blueprint(points, unrolled, heading, len(primitives), around))
        origin = origin_sentence(demonstrations, "The demonstrations are")
        send_notes(stream, f"{note}\n\n{origin}")
        for demonstration in demonstrations[:: len(demonstrations) // (CONTEXT + 1) + 1]:
            line = demonstration.position[:: thinning(demonstration.dt)]
            grey = rr.LineStrips3D([line], colors=rgba([GREY], CONTEXT_OPACITY), radii=-0.4)
            stream.log(entity("demonstrations", demonstration.name), grey, static=True)
        for primitive in primitives:
            _send_frame(stream, primitive, length)
        names = [primitive.name for primitive in primitives]
        for number, (name, one) in enumerate(unrolled.items()):
            colour = colours[name] if colours else PATH_COLOURS[number % len(PATH_COLOURS)]
            strips = [colour if colours else primitive_colour(place) for place in range(len(primitives))]
            _send_path(stream, name, one, colour, strips, length)
            send_primitive_lane(stream, entity("primitive", name), one.indexes(one.switches), names)
            _send_rates(stream, name, one, colour)
        _send_forcing(stream, next(iter(unrolled.values())), primitives)


def _path(table: pd.DataFrame, primitives: Sequence[PosePrimitive]) -> _Path:
    """A path from its table; the sample of a switch belongs to the successor, as there."""
    places = {primitive.name: place for place, primitive in enumerate(primitives)}
    place, time = np.array([places[name] for name in table["primitive"]]), table["time_s"].to_numpy()
    starts = np.searchsorted(place, np.arange(len(primitives)))
    ends = np.append(time[starts], time[-1])
    kept = np.unique([*range(0, len(time), thinning(time[1] - time[0])), *starts, len(time) - 1])

    def columns(prefix: str, names: str = "xyz") -> np.ndarray:
        return table[[f"{prefix}{name}" for name in names]].to_numpy()[kept]

    rates = {
        "speed": 1e3 * np.linalg.norm(columns("v"), axis=1),
        "acceleration": 1e3 * np.linalg.norm(columns("a"), axis=1),
    }
    turns = "qw" in table
    if turns:
        rates["turning"] = np.degrees(np.linalg.norm(columns("w"), axis=1))
    return _Path(
        time=time[kept],
        place=place[kept],
        position=columns(""),
        orientation=columns("q", "wxyz") if turns else None,
        rates=rates,
        elapsed=(time - ends[place])[kept],
        durations=np.diff(ends),
        switches=np.searchsorted(kept, np.append(starts, len(time) - 1)),
    )


def _send_frame(stream: rr.RecordingStream, primitive: PosePrimitive, length: float) -> None:
    """The local frame at the mean start, and the mean goal."""
    point = primitive.position
    axes = local_frame(point.start, point.goal, point.frame)
    path = entity("frames", primitive.name)
    stream.log(path, rr.Transform3D(translation=point.start, mat3x3=axes), static=True)
    stream.log(path, rr.TransformAxes3D(2.0 * length), static=True)
    goal = rr.Points3D(
        [point.goal],
        colors=rgba([WHITE]),
        radii=-5.0,
        labels=f"goal of {primitive.name}",
        show_labels=False,  # goals may lie close together; the label shows when the point is pointed at
    )
    stream.log(entity("goals", primitive.name), goal, static=True)


def _send_path(
    stream: rr.RecordingStream,
    name: str,
    path: _Path,
    colour: str,
    strip_colours: Sequence[str],
    length: float,
) -> None:
    """The path in its colours, where it switches, its name in the middle, and the moving frame."""
    ends = list(zip(path.switches[:-1], path.switches[1:], strict=True))
    strips = [path.position[first : last + 1] for first, last in ends]
    line = rr.LineStrips3D(strips, colors=rgba(strip_colours), radii=-2.5)
    stream.log(entity("paths", name), line, static=True)
    switches = rr.Points3D(path.position[path.switches], colors=rgba([colour]), radii=-4.0)
    stream.log(entity("switches", name), switches, static=True)
    middle = path.position[[len(path.position) // 2]]  # paths often share their ends
    label = rr.Points3D(middle, colors=rgba([colour]), radii=-1.0, labels=[name], show_labels=True)
    stream.log(entity("switches", name, "label"), label, static=True)
    hand = entity("hands", name)
    send_moving_frame(stream, hand, path.indexes(), path.position, path.orientation, colour, length)


def _send_rates(stream: rr.RecordingStream, name: str, path: _Path, colour: str) -> None:
    """Phase, speeds and accelerations; the latter must not jump at the switches."""
    for symbol, values in zip("pu", path.phase, strict=True):
        curve = entity("phase", name, symbol)
        send_series(stream, curve, path.indexes(), values[:, None], [f"{symbol}, {name}"], [colour])
    for plotted, values in path.rates.items():
        send_series(stream, entity(plotted, name), path.indexes(), values[:, None], [name], [colour])
        marks, at = entity(plotted, name, "switches"), path.switches
        send_marks(stream, marks, path.indexes(at), values[at], "switches", WHITE)


def _send_forcing(stream: rr.RecordingStream, path: _Path, primitives: Sequence[PosePrimitive]) -> None:
    """Learned forcing terms, at the demonstrations' mean start and goal, in the path's time."""
    position, orientation = [], []
    for place, (primitive, duration) in enumerate(zip(primitives, path.durations, strict=True)):
        times = path.elapsed[path.place == place]
        local = primitive.position.local
        position.append(local.forcing(times, local.start, local.goal, duration))
        if primitive.orientation is not None:
            orientation.append(_orientation_forcing(primitive.orientation, times, duration))
    send_series(stream, entity("forcing", "position"), path.indexes(), np.concatenate(position), "xyz")
    if orientation:
        charts = {isinstance(primitive.orientation, TwistSwingPrimitive) for primitive in primitives}
        names = ("twist", "swing 1", "swing 2") if charts == {True} else "xyz"
        entity_path, forcing = entity("forcing", "orientation"), np.concatenate(orientation)
        send_series(stream, entity_path, path.indexes(), forcing, names)


def _orientation_forcing(primitive: OrientationPrimitive, times: np.ndarray, duration: float) -> np.ndarray:
    """Forcing term (T, 3): about the base axes, or of twist and swing where that is the primitive's form."""
    if isinstance(primitive, TwistSwingPrimitive):
        return primitive.chart.forcing(times, primitive.chart.start, primitive.chart.goal, duration)
    return primitive.forcing(times, duration)


def _blueprint(
    points: np.ndarray, paths: Mapping[str, _Path], heading: str, primitives: int, around: Sequence[str]
) -> rrb.Blueprint:
    kinds = ("demonstrations", "paths", "switches", "goals", "frames", "hands")
    scene = scene_view(heading, [*(f"/{kind}/**" for kind in kinds), *around], points)
    first, rates = next(iter(paths)), next(iter(paths.values())).rates
    turns = next(iter(paths.values())).orientation is not None
    plots = [
        plot("phase p (1 to 0) and phase velocity u", ["/phase/**"], legend=False),
        plot(f"forcing of the position ({first}, local axes)", [entity("forcing", "position")]),
        *(
            [plot(f"forcing of the orientation ({first})", [entity("forcing", "orientation")])]
            if turns
            else []
        ),
        *(plot(f"{name} ({UNITS[name]})", [f"/{name}/**"]) for name in rates),
    ]
    running = [lanes(["/primitive/**"])] if primitives > 1 else []
    left = rrb.Vertical(scene, *running, notes_view(), row_shares=[4, *(1 for _ in running), 1])
    return layout(
        rrb.Horizontal(left, rrb.Grid(*plots, grid_columns=2), column_shares=[2, 3]),
        steps_per_s=PHASE_STEPS / 3,
    )
