"""Recording of demonstrations: paths and frames in 3-D, all signals over time, and cut points."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import rerun as rr

from structlearn.core import quaternion
from structlearn.palette import AXIS_COLOURS, WHITE, primitive_colour
from structlearn.readers.demonstration import Demonstration, joint_names
from structlearn.segmentation.segments import Segmentation
from structlearn.viewer import items, views
from structlearn.viewer.items import Item, entity
from structlearn.viewer.recording import Recording
from structlearn.viewer.views import Panel

AXES, TURNED, TOUCH = "xyz", "turned (degrees)", "tactile"
DETAILED = 12  # number of demonstrations with a tab each
ELECTRODES_PER_FINGER = 19  # of a BioTac; other numbers of channels share one plot

Part = tuple[int, int, str]  # first and last sample of a stretch of a demonstration, and its colour


def demonstrations(
    runs: Sequence[Demonstration],
    segmentation: Segmentation | None = None,
    title: str = "Demonstrations",
    note: str = "",
    around: Sequence[Item] = (),
    hand: Sequence[Item] = (),
    colours: Sequence[str] | None = None,
) -> Recording:
    """Demonstrations: one tab overlays all, further tabs show one each.

    `segmentation`: colours the paths by primitive; without it `colours` are by demonstration, by default the
    primitives' colours in turn; `note`: description in Markdown; `around`: the scene around the movements;
    `hand`: shown in the first tab only.
    """
    colours = colours or [primitive_colour(place) for place in range(len(runs))]
    cut, joints = segmentation is not None, joint_names(runs[0])
    points = np.zeros((1, 3)) if joints else np.concatenate([run.position for run in runs])
    length = items.axis_length(points)
    shown = [_Shown(run, segmentation, colour, length) for run, colour in zip(runs, colours, strict=True)]
    plots = [
        views.plot(
            axis if joints else f"{axis} (mm)",
            [item for one in shown for item in one.positions(axis, place)],
            legend=False,
        )
        for place, axis in enumerate(joints or AXES)
    ]
    for name in (*runs[0].output_names, *runs[0].digital_names):
        plots.append(views.plot(name, [one.outputs[name] for one in shown], legend=False))
    if turned := [one.signals[TURNED] for one in shown if TURNED in one.signals]:
        plots.append(views.plot(TURNED, turned, legend=False))
    lanes = [views.lanes([lane for one in shown for lane in one.lanes])] if cut else []
    notes = views.notes(f"{note}\n\n{views.origin_sentence(runs)}")
    if joints:
        content = views.row(views.column(*lanes, notes), views.grid(*plots), shares=[1, 4])
        return Recording(f"{title}{views.origin_label(runs)}", content)
    moving = [item for one in shown for item in one.moving]
    overview = views.scene(f"{title}{views.origin_label(runs)}", [*moving, *around, *hand], points)
    left = views.column(overview, notes, shares=[4, 1])
    right = views.column(*lanes, *plots, shares=[3] * len(lanes) + [2] * len(plots))
    whole = views.row(left, right, name="All", shares=[4, 3])
    touch = any(run.tactile is not None for run in runs)
    if not touch and all(run.orientation is None and run.wrench is None for run in runs):
        return Recording(title, whole)
    details = [_detail(one, cut, around) for one in shown[:DETAILED]]
    first = 1 if touch and not around else 0  # the overview does not show touch
    return Recording(title, views.tabs(whole, *details, active=first))


class _Shown:
    """Items of a demonstration, with samples for a screen."""

    def __init__(
        self, run: Demonstration, segmentation: Segmentation | None, colour: str, length: float
    ) -> None:
        self.run, self.kept = run, slice(None, None, items.thinning(run.dt))
        cuts = np.empty((0, 2))
        if segmentation is not None:
            tables = [segmentation.result(name) for name in segmentation.primitives]
            found = [table.loc[run.name, ["start_s", "end_s"]] for table in tables if run.name in table.index]
            cuts = np.array(found, dtype=float).reshape(-1, 2)
        self.parts = [(0, len(run.time) - 1, colour)] if segmentation is None else _parts(run, cuts)
        self.lanes: list[Item] = []
        if segmentation is not None and len(cuts):
            ends = np.append(cuts[:, 0], cuts[-1, 1])
            self.lanes = [items.lane(entity("primitive", run.name), ends, segmentation.primitives)]
        step = items.thinning(run.dt)
        self.outputs = {name: self._output(name, its) for name, its in _outputs(run).items()}
        if run.of_joints:
            self.moving, self.signals = list[Item](), dict[str, Item]()
            return
        strips = [run.position[[*range(first, last, step), last]] for first, last, _ in self.parts]
        path = items.lines(entity("paths", run.name), strips, [part[2] for part in self.parts], -1.0)
        turned = None if run.orientation is None else run.orientation[self.kept]
        pose = (run.time[self.kept], run.position[self.kept], WHITE, turned, length)
        self.moving = [path, items.moving_frame(entity("hands", run.name), *pose)]
        self.signals = {title: self._curve(title, its) for title, its in _signals(run, self.kept).items()}

    def positions(self, axis: str, place: int) -> Iterator[Item]:
        """An axis (mm) or joint as a line coloured by primitive, and points at the cuts."""
        run, first = self.run, [part[0] for part in self.parts]
        path, position = entity("position", axis, run.name), run.position[:, place]
        if not run.of_joints:
            position = 1e3 * position
        colours = rr.SeriesLines.columns(colors=items.rgba([part[2] for part in self.parts]))
        yield Item(path, [rr.SeriesLines(names=run.name, widths=1.0)], run.time[first], colours)
        scalars = rr.Scalars.columns(scalars=position[self.kept])
        yield Item(path, (), run.time[self.kept], scalars)
        if cuts := first[1:]:
            path = entity("cuts", axis, run.name)
            yield items.marks(path, run.time[cuts], position[cuts], "cuts", WHITE)

    def _output(self, name: str, values: np.ndarray) -> Item:
        """An output (T,) as a line."""
        look = (name, primitive_colour(0), 1.0)
        return items.series(
            entity("output", name, self.run.name), self.run.time[self.kept], values[self.kept], *look
        )

    def _curve(self, title: str, values: np.ndarray) -> Item:
        look: Any = (AXES, AXIS_COLOURS, 1.5)
        if title.startswith(TOUCH):
            numbers = range(values.shape[1])
            names, colours = zip(
                *((f"E{number + 1}", primitive_colour(number)) for number in numbers), strict=True
            )
            look = (names, colours, 1.0)
        path = entity(title.split(" (")[0], self.run.name)
        return items.series(path, self.run.time[self.kept], values, *look)


def _signals(run: Demonstration, kept: slice) -> dict[str, np.ndarray]:
    """Plotted signals (T, D) of a demonstration by heading, which begins with the entity's name."""
    signals = {"moved (mm)": 1e3 * (run.position[kept] - run.position[0])}
    if run.orientation is not None:
        orientation = run.orientation[kept]
        steps = quaternion.difference(orientation[1:], orientation[:-1])
        signals[TURNED] = np.degrees(np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)]))
    if run.wrench is not None:
        signals["force (N)"], signals["torque (N m)"] = np.split(run.wrench[kept], 2, axis=1)
    if run.tactile is not None:
        changes = run.tactile[kept] - run.tactile[0]  # resting values differ far more
        fingers, rest = divmod(changes.shape[1], ELECTRODES_PER_FINGER)
        for finger, part in enumerate([changes] if rest else np.split(changes, fingers, axis=1), 1):
            name = TOUCH if rest else f"{TOUCH} {finger}"
            signals[f"{name} (counts since the start)"] = part
    return signals


def _outputs(run: Demonstration) -> dict[str, np.ndarray]:
    """Outputs (T,) by name."""
    beside = ((run.output_names, run.outputs), (run.digital_names, run.digital))
    return {
        name: values
        for names, signal in beside
        if signal is not None
        for name, values in zip(names, signal.T, strict=True)
    }


def _parts(run: Demonstration, cuts: np.ndarray) -> list[Part]:
    """Consecutive stretches of a demonstration between cuts (P, 2) s, from its first to its last sample."""
    last, parts, reached = len(run.time) - 1, list[Part](), 0
    for index, ends_s in enumerate(cuts):
        start, end = np.clip(np.round(ends_s / run.dt).astype(int), 0, last)
        parts += [(reached, start, WHITE), (start, end, primitive_colour(index))]
        reached = end
    return [part for part in [*parts, (reached, last, WHITE)] if part[1] > part[0]]


def _detail(one: _Shown, cut: bool, around: Sequence[Item]) -> Panel:
    """Tab with all signals of one demonstration."""
    name = f"{one.run.name}{views.origin_label([one.run])}"
    scene = views.scene(name, [*one.moving, *around], one.run.position)
    lanes = [views.lanes(one.lanes)] if cut else []
    plots = [views.plot(title, [its], not title.startswith(TOUCH)) for title, its in one.signals.items()]
    left = views.column(scene, *lanes, shares=[5, 1][: 1 + len(lanes)])
    right = views.grid(*plots, columns=1 if len(plots) < 4 else 2)
    return views.row(left, right, name=one.run.name, shares=[2, 3])
