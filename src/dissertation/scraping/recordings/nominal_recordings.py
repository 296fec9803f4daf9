"""Recordings of movements over the level board: demonstrations, their alignment, learned primitives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb

from dissertation.scraping.names import CUT_METHODS
from dissertation.scraping.recordings.scraping_scene import SKIN, send_board, send_hand, send_tool
from dissertation.scraping.world.layout import EDGE_M
from structlearn.core import signals
from structlearn.palette import GREY, LIGHT_BLUE, OCHRE, WHITE
from structlearn.primitives.sequence import PosePrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.alignment import RESULT
from structlearn.segmentation.parameters import AXES, SegmentParameters
from structlearn.segmentation.segments import Segmentation
from structlearn.viewer import learned_primitives, recorded_demonstrations, rrd
from structlearn.viewer.diagram import texts
from structlearn.viewer.rrd import Recording

DEMONSTRATED = """A person guides the tool down to the level board, turns it and scrapes. Colours show the
primitives, white is outside of them (dissertation IV.5). The hand is that of {reference}; every
demonstration has a tab with its signals. Arrows are the axes of each hand: x red, y green, z blue; curves of
turning are orange, green and blue in the same order."""

LEARNED = """Thick: the primitives in turn, from and to the mean start and goals (nominal) and others
(generalised); faint: demonstrations (dissertation IV.4, IV.5). The hand is on the nominal path. Arrows
are axes: x red, y green, z blue."""

SUNK_M = 0.002
"""Distance by which the board is drawn too low, since the edge frame sinks into it under pressure."""


def write_demonstrations(
    path: str | Path, demonstrations: Sequence[Demonstration], segmentation: Segmentation, title: str
) -> None:
    """Record demonstrations over the board, see `recorded_demonstrations`."""
    note = DEMONSTRATED.format(reference=segmentation.reference)
    scenery = partial(_send_scenery, hand=rrd.entity("hands", segmentation.reference))
    recorded_demonstrations.write_demonstrations(path, demonstrations, segmentation, title, note, scenery)


def write_primitives(
    path: str | Path,
    demonstrations: Sequence[Demonstration],
    primitives: Sequence[PosePrimitive],
    paths: Mapping[str, pd.DataFrame],
    title: str,
) -> None:
    """Record learned primitives over the board, see `learned_primitives`."""
    scenery = partial(_send_scenery, hand=rrd.entity("hands", next(iter(paths))))
    learned_primitives.write_primitives(path, demonstrations, primitives, paths, title, LEARNED, scenery)


def _send_scenery(to: Recording, hand: str) -> list[str]:
    """Log the level board, and a hand with the tool below the entity of its moving frame; see `Scenery`."""
    to.still("scenery", rr.Transform3D(translation=[0.0, 0.0, -SUNK_M]))
    send_board(to, "scenery/board")
    send_hand(to, hand)
    grasp = rr.Transform3D(translation=[0.0, 0.0, -EDGE_M])  # unloaded
    to.still(f"{hand}/tool", grasp)
    send_tool(to, f"{hand}/tool", SKIN)
    return ["/scenery/**"]


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


def write_alignment(
    path: str | Path,
    demonstrations: Sequence[Demonstration],
    segmentation: Segmentation,
    parameters: SegmentParameters,
    title: str = "Alignment",
) -> None:
    """Record the correspondences of the reference with all other demonstrations, see `NOTE`."""
    by_name = {demonstration.name: demonstration for demonstration in demonstrations}
    pairs = segmentation.pairs
    aligned = set(pairs["demonstration"]) & set(segmentation.cuts["demonstration"])
    guesses = [name for name in by_name if name in aligned]
    views = []
    with rrd.recording(path, title) as to:
        to.notes(f"{NOTE}\n**{rrd.origin_sentence(demonstrations)}**")
        for one in parameters.primitives:
            if one.axis == "between":
                continue
            zvc = segmentation.result(one.name, "zvc")
            scale = WIDTH / (float((zvc["end_s"] - zvc["start_s"]).max()) + 2.0 * parameters.extension_s)
            reference, *others = [
                _curve(by_name[name], zvc.loc[name], one.axis, parameters, top, scale)
                for name, top in [(segmentation.reference, 0.0), *((name, HEIGHT + GAP) for name in guesses)]
            ]
            to.reset_time()
            _send_curve(to, one.name, reference, segmentation, is_reference=True)
            for number, curve in enumerate(others, start=1):
                to.set_time(DEMONSTRATION, sequence=number)
                _send_curve(to, one.name, curve, segmentation)
                own = (pairs["demonstration"] == curve.name) & (pairs["primitive"] == one.name)
                _send_pairs(to, one.name, reference, curve, pairs[own])
            bounds = ([-LEFT, WIDTH], [-MARGIN, 2 * HEIGHT + GAP + MARGIN])
            heading = f"{one.name}: position along {one.axis}{rrd.origin_label(demonstrations)}"
            views.append(rrd.flat_view(heading, rrd.entity(one.name), *bounds))
        shown = rrb.Horizontal(rrb.Vertical(*views), rrd.notes_view(), column_shares=[5, 1])
        to.show(shown, DEMONSTRATION, steps_per_s=1.0)


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


def _send_curve(
    to: Recording, primitive: str, curve: _Curve, segmentation: Segmentation, is_reference: bool = False
) -> None:
    """Log a curve with its name, its time scale, and bars at its start and end.

    Bars above mark cuts by crossings alone, bars below the cuts used; for the reference these are the same.
    """
    path = rrd.entity(primitive, "reference" if is_reference else "guess")
    thinned = curve.time[:: rrd.thinning(float(curve.time[1] - curve.time[0]))]
    line = rr.LineStrips2D([curve.points(thinned)], colors=rrd.rgba(WHITE), radii=-1.5)
    to.log(f"{path}/curve", line, static=is_reference)

    outside = -3 * BAR if is_reference else HEIGHT + 2 * BAR  # beyond the space between the curves
    seconds = np.arange(np.ceil(2 * curve.time[0]), 2 * curve.time[-1]) / 2
    ticks = np.column_stack([curve.points(seconds)[:, 0], np.full(len(seconds), curve.top + outside)])
    places = [*ticks, [-0.5 * LEFT, curve.top + 0.4 * HEIGHT]]
    name = f"{'reference' if is_reference else 'demonstration'} {curve.name}"
    labels = texts(places, [*(f"{second:g} s" for second in seconds), name], [GREY])
    to.log(f"{path}/scale", labels, static=is_reference)

    tips = {"zvc": -BAR} if is_reference else {"zvc": -BAR, RESULT: BAR}
    for method, tip in tips.items():
        cut, look = segmentation.result(primitive, method).loc[curve.name], CUT_METHODS[method]
        ends = curve.points(np.array([cut["start_s"], cut["end_s"]], dtype=float))
        bars = ends[:, None, :] + np.array([[0.0, 0.0], [0.0, tip]])
        strips = rr.LineStrips2D(bars, colors=rrd.rgba(look.colour), radii=-2.0)
        to.log(f"{path}/{method}", strips, static=is_reference)
        label_at = ends + np.array([0.0, tip if tip > 0 else 2 * tip])  # labels hang below their points
        labels = texts(label_at, [look.name] * 2, [look.colour])
        to.log(f"{path}/{method}/name", labels, static=is_reference)


def _send_pairs(to: Recording, primitive: str, reference: _Curve, guess: _Curve, pairs: pd.DataFrame) -> None:
    """Log corresponding samples as lines between the curves."""
    times, weights = pairs[["reference_s", "guess_s"]].to_numpy(), pairs["weight"].to_numpy()
    lines = np.stack([reference.points(times[:, 0]), guess.points(times[:, 1])], axis=1)  # (K, 2, 2)
    shown = np.unique(np.linspace(0, len(lines) - 1, SHOWN_PAIRS).astype(int))
    bold = np.argsort(weights)[::-1][:HIGHLIGHTED]
    share = weights[shown] ** 3  # most weights are close to 1, where differences should be visible
    thin = rr.LineStrips2D(
        lines[shown], colors=rrd.blended(share, (DROPPED, LIGHT_BLUE)), radii=-0.7, draw_order=-2.0
    )
    to.log(rrd.entity(primitive, "pairs"), thin)
    thick = rr.LineStrips2D(lines[bold], colors=rrd.rgba(OCHRE), radii=-1.5, draw_order=-1.0)
    to.log(rrd.entity(primitive, "best pairs"), thick)
