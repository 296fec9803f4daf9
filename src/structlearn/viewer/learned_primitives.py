"""Recording of learned primitives: the unrolled sequence with its demonstrations, phase and forcing terms."""

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
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.twist_swing import TwistSwingPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.viewer import rrd
from structlearn.viewer.recorded_demonstrations import Scenery
from structlearn.viewer.rrd import entity, plot

PHASE = "phase"  # timeline of the elapsed phase, which aligns paths of different durations
PHASE_STEPS = 1000  # steps of that timeline per primitive; rerun's timelines are integers

ALL = slice(None)

UNITS = {"speed": "mm/s", "acceleration": "mm/s²", "turning": "degrees/s"}

CONTEXT, CONTEXT_OPACITY = 20, 0.25  # most demonstrations drawn, evenly chosen among more
PATH_COLOURS = (LIGHT_BLUE, ORANGE, *AXIS_COLOURS[1:])  # colours by path, in plots without primitives


@dataclass(frozen=True)
class _Path:
    """One unrolled sequence, thinned for display."""

    time: np.ndarray  # (T,) s
    place: np.ndarray  # (T,) index of the running primitive
    position: np.ndarray  # (T, 3) m
    orientation: np.ndarray | None  # (T, 4)
    rates: dict[str, np.ndarray]  # by name as in UNITS: (T,)
    elapsed: np.ndarray  # (T,) s since the start of the primitive
    durations: np.ndarray  # (P,) s
    switches: np.ndarray  # (P + 1,) sample at which each primitive starts, and the last one

    @property
    def phase(self) -> tuple[np.ndarray, np.ndarray]:
        """Phase and phase velocity, (T,) each."""
        return canonical.phase(self.elapsed, canonical.TAU_PER_DURATION * self.durations[self.place])

    def indexes(self, at: np.ndarray | slice = ALL) -> list[rr.TimeColumn]:
        """Both time lines at some samples."""
        spent = np.round(PHASE_STEPS * (self.place + 1.0 - self.phase[0])).astype(int)
        return [rrd.time_column(self.time[at]), rr.TimeColumn(PHASE, sequence=spent[at])]


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
    """Write a learned sequence and its demonstrations as a recording.

    `paths`: unrolled `sequence_table` by name; forcing terms are plotted over the first; `note`: description
    in Markdown; `colours`: of the paths by name; default: by primitive.
    """
    unrolled = {name: _path(table, primitives) for name, table in paths.items()}
    places = [one.position for one in demonstrations] + [one.position for one in unrolled.values()]
    points = np.concatenate(places)
    length = rrd.axis_length(points)
    with rrd.recording(path, title) as stream:
        around = [] if scenery is None else scenery(stream)
        heading = f"{title}{rrd.origin_label(demonstrations)}"
        stream.send_blueprint(_blueprint(points, unrolled, heading, len(primitives), around))
        origin = rrd.origin_sentence(demonstrations, "The demonstrations are")
        rrd.send_notes(stream, f"{note}\n\n{origin}")
        for demonstration in demonstrations[:: len(demonstrations) // (CONTEXT + 1) + 1]:
            line = demonstration.position[:: rrd.thinning(demonstration.dt)]
            grey = rr.LineStrips3D([line], colors=rrd.rgba([GREY], CONTEXT_OPACITY), radii=-0.4)
            stream.log(entity("demonstrations", demonstration.name), grey, static=True)
        for primitive in primitives:
            _send_frame(stream, primitive, length)
        names = [primitive.name for primitive in primitives]
        for number, (name, one) in enumerate(unrolled.items()):
            colour = colours[name] if colours else PATH_COLOURS[number % len(PATH_COLOURS)]
            strips = [colour if colours else primitive_colour(place) for place in range(len(primitives))]
            _send_path(stream, name, one, colour, strips, length)
            rrd.send_primitive_lane(stream, entity("primitive", name), one.indexes(one.switches), names)
            _send_rates(stream, name, one, colour)
        _send_forcing(stream, next(iter(unrolled.values())), primitives)


def _path(table: pd.DataFrame, primitives: Sequence[PosePrimitive]) -> _Path:
    """A path from its table, in which the sample of a switch belongs to the successor."""
    places = {primitive.name: place for place, primitive in enumerate(primitives)}
    place, time = np.array([places[name] for name in table["primitive"]]), table["time_s"].to_numpy()
    starts = np.searchsorted(place, np.arange(len(primitives)))
    ends = np.append(time[starts], time[-1])
    kept = np.unique([*range(0, len(time), rrd.thinning(time[1] - time[0])), *starts, len(time) - 1])

    def columns(prefix: str, names: str = "xyz") -> np.ndarray:
        return table[[f"{prefix}{name}" for name in names]].to_numpy()[kept]

    kinds = {"speed": "v", "acceleration": "a"}
    rates = {name: 1e3 * np.linalg.norm(columns(prefix), axis=1) for name, prefix in kinds.items()}
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
    name, white = f"goal of {primitive.name}", rrd.rgba([WHITE])  # the label shows on hovering
    goal = rr.Points3D([point.goal], colors=white, radii=-5.0, labels=name, show_labels=False)
    stream.log(entity("goals", primitive.name), goal, static=True)


def _send_path(
    stream: rr.RecordingStream, name: str, path: _Path, colour: str, strips: Sequence[str], length: float
) -> None:
    """Log the path in the colours of `strips`, its switches, its name in the middle, and the moving frame."""
    ends = zip(path.switches[:-1], path.switches[1:], strict=True)
    parts = [path.position[first : last + 1] for first, last in ends]
    line = rr.LineStrips3D(parts, colors=rrd.rgba(strips), radii=-2.5)
    switches = rr.Points3D(path.position[path.switches], colors=rrd.rgba([colour]), radii=-4.0)
    middle = path.position[[len(path.position) // 2]]  # because paths often share their ends
    label = rr.Points3D(middle, colors=rrd.rgba([colour]), radii=-1.0, labels=[name], show_labels=True)
    for place, shape in {("paths",): line, ("switches",): switches, ("switches", "label"): label}.items():
        stream.log(entity(place[0], name, *place[1:]), shape, static=True)
    hand = entity("hands", name)
    rrd.send_moving_frame(stream, hand, path.indexes(), path.position, path.orientation, colour, length)


def _send_rates(stream: rr.RecordingStream, name: str, path: _Path, colour: str) -> None:
    """Log phase, speeds and accelerations, with marks at the switches, where they must be continuous."""
    for symbol, values in zip("pu", path.phase, strict=True):
        curve = entity("phase", name, symbol)
        rrd.send_series(stream, curve, path.indexes(), values[:, None], [f"{symbol}, {name}"], [colour])
    for plotted, values in path.rates.items():
        rrd.send_series(stream, entity(plotted, name), path.indexes(), values[:, None], [name], [colour])
        marks, at = entity(plotted, name, "switches"), path.switches
        rrd.send_marks(stream, marks, path.indexes(at), values[at], "switches", WHITE)


def _send_forcing(stream: rr.RecordingStream, path: _Path, primitives: Sequence[PosePrimitive]) -> None:
    """Log forcing terms over the path's time, at the demonstrations' mean start and goal."""
    position, orientation, charts = [], [], set()
    for place, (primitive, duration) in enumerate(zip(primitives, path.durations, strict=True)):
        times = path.elapsed[path.place == place]
        local, turn = primitive.position.local, primitive.orientation
        position.append(local.forcing(times, local.start, local.goal, duration))
        charts.add(isinstance(turn, TwistSwingPrimitive))
        if isinstance(turn, TwistSwingPrimitive):
            orientation.append(turn.chart.forcing(times, turn.chart.start, turn.chart.goal, duration))
        elif turn is not None:
            orientation.append(turn.forcing(times, duration))
    rrd.send_series(stream, entity("forcing", "position"), path.indexes(), np.concatenate(position), "xyz")
    if orientation:
        names = ("twist", "swing 1", "swing 2") if charts == {True} else "xyz"
        forcing = np.concatenate(orientation)
        rrd.send_series(stream, entity("forcing", "orientation"), path.indexes(), forcing, names)


def _blueprint(
    points: np.ndarray, paths: Mapping[str, _Path], heading: str, primitives: int, around: Sequence[str]
) -> rrb.Blueprint:
    kinds = ("demonstrations", "paths", "switches", "goals", "frames", "hands")
    scene = rrd.scene_view(heading, [*(f"/{kind}/**" for kind in kinds), *around], points)
    first, path = next(iter(paths.items()))
    plots = [
        plot("phase p (1 to 0) and phase velocity u", ["/phase/**"], legend=False),
        plot(f"forcing of the position ({first}, local axes)", [entity("forcing", "position")]),
    ]
    if path.orientation is not None:
        plots.append(plot(f"forcing of the orientation ({first})", [entity("forcing", "orientation")]))
    plots += [plot(f"{name} ({UNITS[name]})", [f"/{name}/**"]) for name in path.rates]
    running = [rrd.lanes(["/primitive/**"])] if primitives > 1 else []
    left = rrb.Vertical(scene, *running, rrd.notes_view(), row_shares=[4, *(1 for _ in running), 1])
    content = rrb.Horizontal(left, rrb.Grid(*plots, grid_columns=2), column_shares=[2, 3])
    return rrd.layout(content, steps_per_s=PHASE_STEPS / 3)
