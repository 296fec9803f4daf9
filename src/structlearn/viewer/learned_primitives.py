"""Recording of learned primitives: sequences unrolled among demonstrations, phase, rates, forcing terms."""

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
from structlearn.viewer.rrd import Recording, entity, plot

PHASE = "phase"  # time line of elapsed phase, on which paths of different durations are synchronous
PHASE_STEPS = 1000  # steps of that time line per primitive, since rerun's sequence time lines are integers

ALL = slice(None)

UNITS = {"speed": "mm/s", "acceleration": "mm/s²", "turning": "degrees/s"}

CONTEXT, CONTEXT_OPACITY = 20, 0.25  # number of demonstrations drawn, spread evenly over all
PATH_COLOURS = (LIGHT_BLUE, ORANGE, *AXIS_COLOURS[1:])  # curves by path, in plots without primitives


@dataclass(frozen=True)
class _Path:
    """One unrolled sequence, thinned for display."""

    time: np.ndarray  # (T,) s
    place: np.ndarray  # (T,) index of the running primitive
    position: np.ndarray  # (T, 3) m
    orientation: np.ndarray | None  # (T, 4)
    rates: dict[str, np.ndarray]  # (T,) each, keyed as UNITS
    elapsed: np.ndarray  # (T,) s since the start of the primitive
    durations: np.ndarray  # (P,) s
    switches: np.ndarray  # (P + 1,) index of each primitive's first sample, and of the last sample

    @property
    def phase(self) -> tuple[np.ndarray, np.ndarray]:
        """Phase and phase velocity, (T,) each."""
        return canonical.phase(self.elapsed, canonical.TAU_PER_DURATION * self.durations[self.place])

    def indexes(self, at: np.ndarray | slice = ALL) -> list[rr.TimeColumn]:
        """Both time lines at selected samples."""
        spent = np.round(PHASE_STEPS * (self.place + 1.0 - self.phase[0])).astype(int)
        return [*rrd.time_columns(self.time[at]), rr.TimeColumn(PHASE, sequence=spent[at])]


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
    """Record a learned sequence with its demonstrations.

    `paths`: unrolled `sequence_table` by name; forcing terms are plotted for the first; `note`: description
    in Markdown; `scenery`: see `Scenery`; `colours`: by path name, default by primitive.
    """
    unrolled = {name: _path(table, primitives) for name, table in paths.items()}
    places = [one.position for one in demonstrations] + [one.position for one in unrolled.values()]
    points = np.concatenate(places)
    length = rrd.axis_length(points)
    with rrd.recording(path, title) as to:
        around = [] if scenery is None else scenery(to)
        heading = f"{title}{rrd.origin_label(demonstrations)}"
        to.show(_blueprint(points, unrolled, heading, len(primitives), around), steps_per_s=PHASE_STEPS / 3)
        origin = rrd.origin_sentence(demonstrations, "The demonstrations are")
        to.notes(f"{note}\n\n{origin}")
        for demonstration in demonstrations[:: len(demonstrations) // (CONTEXT + 1) + 1]:
            line = demonstration.position[:: rrd.thinning(demonstration.dt)]
            to.lines(
                entity("demonstrations", demonstration.name), [line], GREY, -0.4, opacity=CONTEXT_OPACITY
            )
        for primitive in primitives:
            _send_frame(to, primitive, length)
        names = [primitive.name for primitive in primitives]
        for number, (name, one) in enumerate(unrolled.items()):
            colour = colours[name] if colours else PATH_COLOURS[number % len(PATH_COLOURS)]
            strips = [colour if colours else primitive_colour(place) for place in range(len(primitives))]
            _send_path(to, name, one, colour, strips, length)
            to.lane(entity("primitive", name), one.indexes(one.switches), names)
            _send_rates(to, name, one, colour)
        _send_forcing(to, next(iter(unrolled.values())), primitives)


def _path(table: pd.DataFrame, primitives: Sequence[PosePrimitive]) -> _Path:
    """Convert a sequence table to a path; as there, the sample at a switch belongs to the next primitive."""
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


def _send_frame(to: Recording, primitive: PosePrimitive, length: float) -> None:
    """Log a primitive's local frame at the mean start, and its mean goal."""
    point = primitive.position
    axes = local_frame(point.start, point.goal, point.frame)
    path = entity("frames", primitive.name)
    to.still(path, rr.Transform3D(translation=point.start, mat3x3=axes))
    to.still(path, rr.TransformAxes3D(2.0 * length))
    name, white = f"goal of {primitive.name}", rrd.rgba(WHITE)  # the label is shown on hover
    to.dots(entity("goals", primitive.name), [point.goal], white, -5.0, labels=name, show_labels=False)


def _send_path(
    to: Recording, name: str, path: _Path, colour: str, strips: Sequence[str], length: float
) -> None:
    """Log the path in the colours of `strips`, its switches, its name at half-way, and a moving frame."""
    ends = zip(path.switches[:-1], path.switches[1:], strict=True)
    parts = [path.position[first : last + 1] for first, last in ends]
    middle = path.position[[len(path.position) // 2]]  # paths often share their ends
    to.lines(entity("paths", name), parts, strips, -2.5)
    to.dots(entity("switches", name), path.position[path.switches], colour, -4.0)
    to.dots(entity("switches", name, "label"), middle, colour, -1.0, labels=[name])
    to.moving_frame(entity("hands", name), path.indexes(), path.position, colour, path.orientation, length)


def _send_rates(to: Recording, name: str, path: _Path, colour: str) -> None:
    """Log phase, speeds and accelerations, with marks at the switches, where none should jump."""
    for symbol, values in zip("pu", path.phase, strict=True):
        curve = entity("phase", name, symbol)
        to.series(curve, path.indexes(), values, f"{symbol}, {name}", colour)
    for plotted, values in path.rates.items():
        to.series(entity(plotted, name), path.indexes(), values, name, colour)
        marks, at = entity(plotted, name, "switches"), path.switches
        to.marks(marks, path.indexes(at), values[at], "switches", WHITE)


def _send_forcing(to: Recording, path: _Path, primitives: Sequence[PosePrimitive]) -> None:
    """Log forcing terms over the path's time, for the demonstrations' mean start and goal."""
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
    to.series(entity("forcing", "position"), path.indexes(), np.concatenate(position), "xyz")
    if orientation:
        names = ("twist", "swing 1", "swing 2") if charts == {True} else "xyz"
        forcing = np.concatenate(orientation)
        to.series(entity("forcing", "orientation"), path.indexes(), forcing, names)


def _blueprint(
    points: np.ndarray, paths: Mapping[str, _Path], heading: str, primitives: int, around: Sequence[str]
) -> rrb.Container:
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
    return content
