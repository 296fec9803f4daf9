"""Recordings of movements over the level board: demonstrations, their alignment, learned primitives."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import rerun as rr

from dissertation.scraping.names import CUT_METHODS
from dissertation.scraping.recordings.scraping_scene import SKIN, board, hand, tool
from dissertation.scraping.world.layout import EDGE_M
from structlearn.core import signals
from structlearn.palette import GREY, LIGHT_BLUE, OCHRE, WHITE
from structlearn.primitives.sequence import PosePrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.alignment import RESULT
from structlearn.segmentation.parameters import AXES, SegmentParameters
from structlearn.segmentation.segments import Segmentation
from structlearn.viewer import demonstrations as over_time
from structlearn.viewer import items, views
from structlearn.viewer import primitives as unrolled
from structlearn.viewer.items import Item, entity
from structlearn.viewer.recording import Recording

DEMONSTRATED = """A person guides the tool down to the level board, turns it and scrapes. Colours show the
primitives, white is outside of them (dissertation IV.5). The hand is that of {reference}; every
demonstration has a tab with its signals. Arrows are the axes of each hand: x red, y green, z blue; curves of
turning are orange, green and blue in the same order."""

LEARNED = """Thick: the primitives in turn, from and to the mean start and goals (nominal) and others
(generalised); faint: demonstrations (dissertation IV.4, IV.5). The hand is on the nominal path. Arrows
are axes: x red, y green, z blue."""

SUNK_M = 0.002
"""Distance by which the board is drawn too low, since the edge frame sinks into it under pressure."""


def demonstrations(runs: Sequence[Demonstration], segmentation: Segmentation) -> Recording:
    """Demonstrations over the board, see `viewer.demonstrations`."""
    note, hand = DEMONSTRATED.format(reference=segmentation.reference), _hand(segmentation.reference)
    title = "Scraping: demonstrations"
    return over_time.demonstrations(runs, segmentation, title, note, _level_board(), hand)


def primitives(
    runs: Sequence[Demonstration],
    learned: Sequence[PosePrimitive],
    paths: Mapping[str, pd.DataFrame],
) -> Recording:
    """Learned primitives over the board, see `viewer.primitives`."""
    around = [*_level_board(), *_hand(next(iter(paths)))]
    return unrolled.primitives(runs, learned, paths, "Scraping: primitives", LEARNED, around)


def _level_board() -> list[Item]:
    return [Item("scenery", [rr.Transform3D(translation=[0.0, 0.0, -SUNK_M])]), board("scenery/board")]


def _hand(name: str) -> list[Item]:
    """A hand with the tool below the entity of its moving frame."""
    path = entity("hands", name)
    grasp = Item(f"{path}/tool", [rr.Transform3D(translation=[0.0, 0.0, -EDGE_M])])  # unloaded
    return [*hand(path), grasp, *tool(f"{path}/tool", SKIN)]


NOTE = """### Where the demonstrations correspond

Above, the reference; below, another demonstration: its position along the movement's axis, with some time
before and after. Lines join the samples paired by time warping; brighter pairs have more weight, and
the eight with the largest weights are ochre. Pairs at rest have no weight (dissertation IV.5).

Bars are the cuts: above a curve, by its own velocity only; below it, as used. Each step of the time line
`demonstration` shows another demonstration.
"""

DEMONSTRATION = "demonstration"  # time line with one step per demonstration
HIGHLIGHTED = 8
"""Number of pairs with the largest weights drawn bold, as in the dissertation's figures IV.14 and IV.15."""

SHOWN_PAIRS = 90  # evenly spread over all pairs; more would merge into an area
WIDTH, HEIGHT, GAP = 32.0, 2.6, 2.4
"""Drawing sizes: width of the longest segment, height of a curve, gap between the two curves."""

LEFT, MARGIN = 5.0, 2.4
"""Room for the names left of the curves, and for cut points and time scales above and below them."""

BAR = 0.6  # height of a bar that marks a cut, and of the name at its end
DROPPED = "#30353b"
"""Colour of a pair without weight: just visible on the viewer's dark background."""


@dataclass(frozen=True)
class _Curve:
    """Position along a primitive's axis over one extended segment, and where it is drawn."""

    name: str  # of the demonstration
    time: np.ndarray  # (T,) s since the start of the demonstration
    height: np.ndarray  # (T,) drawing units, downwards
    top: float  # drawing units
    scale: float  # drawing units per s

    def points(self, times: np.ndarray) -> np.ndarray:
        """Drawing coordinates (K, 2) at times (K,) in s."""
        x = self.scale * (times - self.time[0])
        return np.column_stack([x, np.interp(times, self.time, self.height)])


def alignment(
    runs: Sequence[Demonstration], segmentation: Segmentation, parameters: SegmentParameters
) -> Recording:
    """Correspondences of the reference with all other demonstrations, see `NOTE`."""
    by_name, pairs = {run.name: run for run in runs}, segmentation.pairs
    aligned = set(pairs["demonstration"]) & set(segmentation.cuts["demonstration"])
    guesses = [name for name in by_name if name in aligned]
    drawings = []
    for primitive, axis in ((one.name, one.axis) for one in parameters.primitives if one.axis != "between"):
        zvc = segmentation.result(primitive, "zvc")
        scale = WIDTH / (float((zvc["end_s"] - zvc["start_s"]).max()) + 2.0 * parameters.extension_s)
        reference, *others = [
            _curve(by_name[name], zvc.loc[name], axis, parameters, top, scale)
            for name, top in [(segmentation.reference, 0.0), *((name, HEIGHT + GAP) for name in guesses)]
        ]
        shown = [*_drawn(primitive, reference, segmentation)]
        for step, curve in enumerate(others, start=1):
            shown += _drawn(primitive, curve, segmentation, step)
            own = (pairs["demonstration"] == curve.name) & (pairs["primitive"] == primitive)
            shown += _pairs(primitive, reference, curve, pairs[own], step)
        heading = f"{primitive}: position along {axis}{views.origin_label(runs)}"
        drawings.append(views.flat(heading, shown, [-LEFT, WIDTH], [-MARGIN, 2 * HEIGHT + GAP + MARGIN]))
    notes = views.notes(f"{NOTE}\n**{views.origin_sentence(runs)}**")
    content = views.row(views.column(*drawings), notes, shares=[5, 1])
    return Recording("Scraping: alignment", content, DEMONSTRATION, steps_per_s=1.0)


def _curve(
    demonstration: Demonstration,
    cut: pd.Series,
    axis: str,
    parameters: SegmentParameters,
    top: float,
    scale: float,
) -> _Curve:
    """Extended segment along the coordinate that moves most, filtered as for the alignment."""
    smooth = signals.low_pass(demonstration.position, demonstration.dt, parameters.align_cutoff_hz)
    first, last = cut["start_s"] - parameters.extension_s, cut["end_s"] + parameters.extension_s
    inside = (demonstration.time >= first) & (demonstration.time <= last)
    columns = smooth[inside][:, AXES[axis]]
    position = columns[:, np.argmax(np.ptp(columns, axis=0))]
    share = (position.max() - position) / max(np.ptp(position), np.finfo(float).tiny)
    return _Curve(demonstration.name, demonstration.time[inside], top + HEIGHT * share, top, scale)


def _drawn(primitive: str, curve: _Curve, segmentation: Segmentation, step: int = 0) -> Iterator[Item]:
    """A curve with its name, its time scale, and bars at its start and end; `step`: 0 for the reference.

    Bars above mark cuts by crossings alone, bars below the cuts used; for the reference these are the same.
    """
    path, at = entity(primitive, "guess" if step else "reference"), {DEMONSTRATION: step} if step else None
    thinned = curve.time[:: items.thinning(float(curve.time[1] - curve.time[0]))]
    yield items.lines(f"{path}/curve", [curve.points(thinned)], WHITE, -1.5, at=at)

    outside = HEIGHT + 2 * BAR if step else -3 * BAR  # beyond the space between the curves
    seconds = np.arange(np.ceil(2 * curve.time[0]), 2 * curve.time[-1]) / 2
    ticks = np.column_stack([curve.points(seconds)[:, 0], np.full(len(seconds), curve.top + outside)])
    places = [*ticks, [-0.5 * LEFT, curve.top + 0.4 * HEIGHT]]
    name = f"{'demonstration' if step else 'reference'} {curve.name}"
    yield items.texts(f"{path}/scale", places, [*(f"{second:g} s" for second in seconds), name], GREY, at=at)

    tips = {"zvc": -BAR, RESULT: BAR} if step else {"zvc": -BAR}
    for method, tip in tips.items():
        cut, look = segmentation.result(primitive, method).loc[curve.name], CUT_METHODS[method]
        ends = curve.points(np.array([cut["start_s"], cut["end_s"]], dtype=float))
        bars = ends[:, None, :] + np.array([[0.0, 0.0], [0.0, tip]])
        yield items.lines(f"{path}/{method}", bars, look.colour, -2.0, at=at)
        label_at = ends + np.array([0.0, tip if tip > 0 else 2 * tip])  # labels hang below their points
        yield items.texts(f"{path}/{method}/name", label_at, [look.name] * 2, look.colour, at=at)


def _pairs(
    primitive: str, reference: _Curve, guess: _Curve, pairs: pd.DataFrame, step: int
) -> Iterator[Item]:
    """Corresponding samples as lines between the curves."""
    times, weights = pairs[["reference_s", "guess_s"]].to_numpy(), pairs["weight"].to_numpy()
    lines = np.stack([reference.points(times[:, 0]), guess.points(times[:, 1])], axis=1)  # (K, 2, 2)
    shown = np.unique(np.linspace(0, len(lines) - 1, SHOWN_PAIRS).astype(int))
    bold = np.argsort(weights, kind="stable")[::-1][:HIGHLIGHTED]
    share = weights[shown] ** 3  # most weights are close to 1, where differences should be visible
    colours, at = items.blended(share, (DROPPED, LIGHT_BLUE)), {DEMONSTRATION: step}
    yield items.lines(entity(primitive, "pairs"), lines[shown], colours, -0.7, draw_order=-2.0, at=at)
    yield items.lines(entity(primitive, "best pairs"), lines[bold], OCHRE, -1.5, draw_order=-1.0, at=at)
