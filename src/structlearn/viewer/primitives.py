"""Recording of learned primitives: sequences unrolled among demonstrations, phase, rates, forcing terms."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd
import rerun as rr

from structlearn.core.frames import local_frame
from structlearn.palette import AXIS_COLOURS, GREY, LIGHT_BLUE, ORANGE, WHITE, primitive_colour
from structlearn.primitives import canonical, rhythmic
from structlearn.primitives.sequence import PosePrimitive, columns_of
from structlearn.primitives.twist_swing import TwistSwingPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.viewer import items, views
from structlearn.viewer.items import TIME, Item, entity, series
from structlearn.viewer.recording import Recording

PHASE = "phase"  # time line of elapsed phase, on which paths of different durations are synchronous
PHASE_STEPS = 1000  # steps of that time line per primitive, since rerun's sequence time lines are integers

RATES = {
    "speed (mm/s)": ("v", 1e3),
    "acceleration (mm/s²)": ("a", 1e3),
    "turning (degrees/s)": ("w", 180.0 / np.pi),
}
"""Plotted rates: columns of sequence tables, and factors."""

CONTEXT, CONTEXT_OPACITY = 20, 0.25  # number of demonstrations drawn, spread evenly over all
PATH_COLOURS = (LIGHT_BLUE, ORANGE, *AXIS_COLOURS[1:])  # curves by path, in plots without primitives


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
    unrolled = {name: _thinned(table, learned) for name, table in paths.items()}
    if learned[0].position.frame == "none":
        return _of_joints(runs, learned, unrolled, title, note)
    places = [run.position for run in runs] + [_columns(path, "") for path in unrolled.values()]
    points = np.concatenate(places)
    length, names = items.axis_length(points), [primitive.name for primitive in learned]
    shown = [*around]
    for run in runs[:: len(runs) // (CONTEXT + 1) + 1]:
        line = run.position[:: items.thinning(run.dt)]
        shown.append(items.lines(entity("demonstrations", run.name), [line], GREY, -0.4, CONTEXT_OPACITY))
    for primitive in learned:
        point, goal = primitive.position, entity("goals", primitive.name)
        axes = local_frame(point.start, point.goal, point.frame)
        frame = [rr.Transform3D(translation=point.start, mat3x3=axes), rr.TransformAxes3D(2.0 * length)]
        label = f"goal of {primitive.name}"  # shown on hover
        shown.append(Item(entity("frames", primitive.name), frame))
        shown.append(items.dots(goal, [point.goal], WHITE, -5.0, labels=label, show_labels=False))
    phases, lanes, rates = list[Item](), list[Item](), defaultdict[str, list[Item]](list)
    for number, (name, path) in enumerate(unrolled.items()):
        colour = colours[name] if colours else PATH_COLOURS[number % len(PATH_COLOURS)]
        strips = [colour if colours else primitive_colour(place) for place in range(len(learned))]
        times, at = _times(path), _switches(path)
        shown += _moving(name, path, colour, strips, length)
        lanes.append(items.lane(entity("primitive", name), _times(path.iloc[at]), names))
        for symbol in "pu":
            curve = (times, path[symbol].to_numpy(), f"{symbol}, {name}", colour)
            phases.append(series(entity("phase", name, symbol), *curve))
        for heading, (prefix, factor) in RATES.items():
            if f"{prefix}x" in path:
                values, rate = factor * np.linalg.norm(_columns(path, prefix), axis=1), heading.split()[0]
                marks = (_times(path.iloc[at]), values[at], "switches", WHITE)  # none should jump there
                rates[heading].append(series(entity(rate, name), times, values, name, colour))
                rates[heading].append(items.marks(entity(rate, name, "switches"), *marks))
    first, path = next(iter(unrolled.items()))
    position, *orientation = _forcing(path, learned)
    plots = [
        views.plot("phase p (1 to 0) and phase velocity u", phases, legend=False),
        views.plot(f"forcing of the position ({first}, local axes)", [position]),
        *(views.plot(f"forcing of the orientation ({first})", [turn]) for turn in orientation),
        *views.plots(rates),
        *_outputs(unrolled),
    ]
    scene = views.scene(f"{title}{views.origin_label(runs)}", shown, points)
    notes = views.notes(f"{note}\n\n{views.origin_sentence(runs, 'The demonstrations are')}")
    running = [views.lanes(lanes)] if len(learned) > 1 else []
    left = views.column(scene, *running, notes, shares=[4, *(1 for _ in running), 1])
    content = views.row(left, views.grid(*plots), shares=[2, 3])
    return Recording(title, content, steps_per_s=PHASE_STEPS / 3)


def _of_joints(
    runs: Sequence[Demonstration],
    learned: Sequence[PosePrimitive],
    unrolled: Mapping[str, pd.DataFrame],
    title: str,
    note: str,
) -> Recording:
    """Each joint and output over time and phase."""
    plots, lanes = [], list[Item]()
    names = [primitive.name for primitive in learned]
    for joint in columns_of(next(iter(unrolled.values()))):
        plots.append(_plot(joint.removeprefix("q."), joint, unrolled))
    for name, path in unrolled.items():
        lanes.append(items.lane(entity("primitive", name), _times(path.iloc[_switches(path)]), names))
    notes = views.notes(f"{note}\n\n{views.origin_sentence(runs, 'The demonstrations are')}")
    running = [views.lanes(lanes)] if len(learned) > 1 else []
    content = views.row(views.column(*running, notes), views.grid(*plots, *_outputs(unrolled)), shares=[1, 4])
    return Recording(title, content, steps_per_s=PHASE_STEPS / 3)


def _outputs(unrolled: Mapping[str, pd.DataFrame]) -> list[views.Panel]:
    """A plot for each output of sequence tables."""
    columns = [name for name in next(iter(unrolled.values())) if name.startswith(("output.", "digital."))]
    return [_plot(column.partition(".")[2], column, unrolled) for column in columns]


def _plot(heading: str, column: str, unrolled: Mapping[str, pd.DataFrame]) -> views.Panel:
    """A plot of one column of sequence tables."""
    curves = [
        series(entity("curves", column, name), _times(path), path[column].to_numpy(float), name, colour)
        for (name, path), colour in zip(unrolled.items(), PATH_COLOURS, strict=False)
    ]
    return views.plot(heading, curves)


def _thinned(table: pd.DataFrame, learned: Sequence[PosePrimitive]) -> pd.DataFrame:
    """A sequence table for a screen, with `p`, `u`, and each primitive's `place`, `elapsed_s`, `duration_s`.

    `p` and `u` of strokes are those of the cycle; `progress`: 0 -> 1 over each primitive, in phase steps.
    As there, the sample at a switch belongs to the next primitive; all switches and the last sample are kept.
    """
    places = {primitive.name: place for place, primitive in enumerate(learned)}
    place, time = table["primitive"].map(places).to_numpy(), table["time_s"].to_numpy()
    starts = np.searchsorted(place, np.arange(len(learned)))
    ends = np.append(time[starts], time[-1])
    elapsed, duration = time - ends[place], np.diff(ends)[place]
    p, u = canonical.phase(elapsed, canonical.TAU_PER_DURATION * duration)
    progress = 1.0 - p
    for at, primitive in enumerate(learned):
        if primitive.rhythm is not None:
            own = place == at
            p[own], u[own] = rhythmic.phase(
                primitive.rhythm.cycles * (elapsed / duration)[own], primitive.rhythm
            )
    kept = np.unique([*range(0, len(time), items.thinning(time[1] - time[0])), *starts, len(time) - 1])
    columns = {"elapsed_s": elapsed, "duration_s": duration, "p": p, "u": u, "progress": progress}
    return table.assign(place=place, **columns).iloc[kept]


def _columns(path: pd.DataFrame, prefix: str, names: str = "xyz") -> np.ndarray:
    return path[[f"{prefix}{name}" for name in names]].to_numpy()


def _times(path: pd.DataFrame) -> dict[str, np.ndarray]:
    """Both time lines."""
    spent = np.round(PHASE_STEPS * (path["place"] + path["progress"])).astype(int)
    return {TIME: path["time_s"].to_numpy(), PHASE: spent.to_numpy()}


def _switches(path: pd.DataFrame) -> np.ndarray:
    """Index (P + 1,) of each primitive's first sample, and of the last sample."""
    return np.append(np.flatnonzero(np.diff(path["place"], prepend=-1)), len(path) - 1)


def _moving(
    name: str, path: pd.DataFrame, colour: str, strips: Sequence[str], length: float
) -> Iterator[Item]:
    """The path in the colours of `strips`, its switches, its name at half-way, and a moving frame."""
    position, at = _columns(path, ""), _switches(path)
    parts = [position[first : last + 1] for first, last in pairwise(at)]
    middle = position[[len(position) // 2]]  # paths often share their ends
    yield items.lines(entity("paths", name), parts, strips, -2.5)
    yield items.dots(entity("switches", name), position[at], colour, -4.0)
    yield items.dots(entity("switches", name, "label"), middle, colour, -1.0, labels=[name])
    turned = _columns(path, "q", "wxyz") if "qw" in path else None
    yield items.moving_frame(entity("hands", name), _times(path), position, colour, turned, length)


def _forcing(path: pd.DataFrame, learned: Sequence[PosePrimitive]) -> Iterator[Item]:
    """Forcing terms over the path's time, for the demonstrations' mean start and goal."""
    position, orientation = [], []
    for primitive, (_, rows) in zip(learned, path.groupby("place"), strict=True):
        times, duration = rows["elapsed_s"].to_numpy(), rows["duration_s"].iloc[0]
        local, turn = primitive.position.local, primitive.orientation
        position.append(local.forcing(times, local.start, local.goal, duration))
        if isinstance(turn, TwistSwingPrimitive):
            orientation.append(turn.chart.forcing(times, turn.chart.start, turn.chart.goal, duration))
        elif turn is not None:
            orientation.append(turn.forcing(times, duration))
    yield series(entity("forcing", "position"), _times(path), np.concatenate(position), "xyz")
    if orientation:
        charted = all(isinstance(primitive.orientation, TwistSwingPrimitive) for primitive in learned)
        names = ("twist", "swing 1", "swing 2") if charted else "xyz"
        yield series(entity("forcing", "orientation"), _times(path), np.concatenate(orientation), names)
