"""Recording of learned primitives: sequences unrolled among demonstrations, phase, rates, forcing terms."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import rerun as rr

from structlearn.core.frames import local_frame
from structlearn.palette import AXIS_COLOURS, GREY, LIGHT_BLUE, ORANGE, WHITE, primitive_colour
from structlearn.primitives import canonical
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.twist_swing import TwistSwingPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.viewer import items, views
from structlearn.viewer.items import TIME, Item, entity
from structlearn.viewer.recording import Recording

PHASE = "phase"  # time line of elapsed phase, on which paths of different durations are synchronous
PHASE_STEPS = 1000  # steps of that time line per primitive, since rerun's sequence time lines are integers

ALL = slice(None)

PREFIXES = {"speed": ("v", 1e3), "acceleration": ("a", 1e3), "turning": ("w", 180.0 / np.pi)}
UNITS = {"speed": "mm/s", "acceleration": "mm/s²", "turning": "degrees/s"}
"""Rates of a path: columns of sequence tables, factors and units."""

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

    def times(self, at: np.ndarray | slice = ALL) -> dict[str, np.ndarray]:
        """Both time lines at selected samples."""
        spent = np.round(PHASE_STEPS * (self.place + 1.0 - self.phase[0])).astype(int)
        return {TIME: self.time[at], PHASE: spent[at]}


def primitives(
    runs: Sequence[Demonstration],
    learned: Sequence[PosePrimitive],
    paths: Mapping[str, pd.DataFrame],
    title: str = "Primitives",
    note: str = "",
    around: Sequence[Item] = (),
    colours: Mapping[str, str] | None = None,
) -> Recording:
    """A learned sequence with its demonstrations.

    `paths`: unrolled `sequence_table` by name; forcing terms are plotted for the first; `note`: description
    in Markdown; `around`: the scene around the movements; `colours`: by path name, default by primitive.
    """
    unrolled = {name: _path(table, learned) for name, table in paths.items()}
    points = np.concatenate([one.position for one in [*runs, *unrolled.values()]])
    length, names = items.axis_length(points), [primitive.name for primitive in learned]
    shown = [*around]
    for run in runs[:: len(runs) // (CONTEXT + 1) + 1]:
        line, faint = run.position[:: items.thinning(run.dt)], {"opacity": CONTEXT_OPACITY}
        shown.append(items.lines(entity("demonstrations", run.name), [line], GREY, -0.4, **faint))
    for primitive in learned:
        point, goal = primitive.position, f"goal of {primitive.name}"  # the label is shown on hover
        axes = rr.Transform3D(
            translation=point.start, mat3x3=local_frame(point.start, point.goal, point.frame)
        )
        shown.append(Item(entity("frames", primitive.name), [axes, rr.TransformAxes3D(2.0 * length)]))
        look = {"labels": goal, "show_labels": False}
        shown.append(items.dots(entity("goals", primitive.name), [point.goal], WHITE, -5.0, **look))
    curves, lanes = defaultdict[str, list[Item]](list), []
    for number, (name, path) in enumerate(unrolled.items()):
        colour = colours[name] if colours else PATH_COLOURS[number % len(PATH_COLOURS)]
        strips = [colour if colours else primitive_colour(place) for place in range(len(learned))]
        shown += _moving(name, path, colour, strips, length)
        lanes.append(items.lane(entity("primitive", name), path.times(path.switches), names))
        for symbol, values in zip("pu", path.phase, strict=True):
            curve = (entity("phase", name, symbol), path.times(), values, f"{symbol}, {name}", colour)
            curves["phase"].append(items.series(*curve))
        for rate, values in path.rates.items():  # none should jump at the switches
            switches = (path.times(path.switches), values[path.switches], "switches", WHITE)
            curves[rate].append(items.series(entity(rate, name), path.times(), values, name, colour))
            curves[rate].append(items.marks(entity(rate, name, "switches"), *switches))
    first, path = next(iter(unrolled.items()))
    position, *orientation = _forcing(path, learned)
    plots = [
        views.plot("phase p (1 to 0) and phase velocity u", curves.pop("phase"), legend=False),
        views.plot(f"forcing of the position ({first}, local axes)", [position]),
        *(views.plot(f"forcing of the orientation ({first})", [turn]) for turn in orientation),
        *(views.plot(f"{rate} ({UNITS[rate]})", its) for rate, its in curves.items()),
    ]
    scene = views.scene(f"{title}{views.origin_label(runs)}", shown, points)
    notes = views.notes(f"{note}\n\n{views.origin_sentence(runs, 'The demonstrations are')}")
    running = [views.lanes(lanes)] if len(learned) > 1 else []
    left = views.column(scene, *running, notes, shares=[4, *(1 for _ in running), 1])
    content = views.row(left, views.grid(*plots), shares=[2, 3])
    return Recording(title, content, steps_per_s=PHASE_STEPS / 3)


def _path(table: pd.DataFrame, learned: Sequence[PosePrimitive]) -> _Path:
    """Convert a sequence table to a path; as there, the sample at a switch belongs to the next primitive."""
    places = {primitive.name: place for place, primitive in enumerate(learned)}
    place, time = np.array([places[name] for name in table["primitive"]]), table["time_s"].to_numpy()
    starts = np.searchsorted(place, np.arange(len(learned)))
    ends = np.append(time[starts], time[-1])
    kept = np.unique([*range(0, len(time), items.thinning(time[1] - time[0])), *starts, len(time) - 1])

    def columns(prefix: str, names: str = "xyz") -> np.ndarray:
        return table[[f"{prefix}{name}" for name in names]].to_numpy()[kept]

    rates = {
        name: factor * np.linalg.norm(columns(prefix), axis=1)
        for name, (prefix, factor) in PREFIXES.items()
        if f"{prefix}x" in table
    }
    return _Path(
        time=time[kept],
        place=place[kept],
        position=columns(""),
        orientation=columns("q", "wxyz") if "qw" in table else None,
        rates=rates,
        elapsed=(time - ends[place])[kept],
        durations=np.diff(ends),
        switches=np.searchsorted(kept, np.append(starts, len(time) - 1)),
    )


def _moving(name: str, path: _Path, colour: str, strips: Sequence[str], length: float) -> Iterator[Item]:
    """The path in the colours of `strips`, its switches, its name at half-way, and a moving frame."""
    ends = zip(path.switches[:-1], path.switches[1:], strict=True)
    parts = [path.position[first : last + 1] for first, last in ends]
    middle = path.position[[len(path.position) // 2]]  # paths often share their ends
    yield items.lines(entity("paths", name), parts, strips, -2.5)
    yield items.dots(entity("switches", name), path.position[path.switches], colour, -4.0)
    yield items.dots(entity("switches", name, "label"), middle, colour, -1.0, labels=[name])
    pose = (path.position, colour, path.orientation, length)
    yield items.moving_frame(entity("hands", name), path.times(), *pose)


def _forcing(path: _Path, learned: Sequence[PosePrimitive]) -> Iterator[Item]:
    """Forcing terms over the path's time, for the demonstrations' mean start and goal."""
    position, orientation = [], []
    for place, (primitive, duration) in enumerate(zip(learned, path.durations, strict=True)):
        times = path.elapsed[path.place == place]
        local, turn = primitive.position.local, primitive.orientation
        position.append(local.forcing(times, local.start, local.goal, duration))
        if isinstance(turn, TwistSwingPrimitive):
            orientation.append(turn.chart.forcing(times, turn.chart.start, turn.chart.goal, duration))
        elif turn is not None:
            orientation.append(turn.forcing(times, duration))
    yield items.series(entity("forcing", "position"), path.times(), np.concatenate(position), "xyz")
    if orientation:
        charted = all(isinstance(primitive.orientation, TwistSwingPrimitive) for primitive in learned)
        names = ("twist", "swing 1", "swing 2") if charted else "xyz"
        yield items.series(entity("forcing", "orientation"), path.times(), np.concatenate(orientation), names)
