"""Recording of the alignment: which sample of the reference corresponds to which of another demonstration."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb

from structlearn.ground import signals
from structlearn.palette import GREY, LIGHT_GREY, METHOD_COLOURS, ORANGE, SKY
from structlearn.recordings.demonstration import Demonstration
from structlearn.segmentation.parameters import AXES, SegmentParameters
from structlearn.segmentation.result import RESULT, Segmentation
from structlearn.viewer.rrd import entity, layout, origin_label, recording, rgba, thinning

DEMONSTRATION = "demonstration"
"""Time line on which each step is another demonstration."""

HIGHLIGHTED = 8
"""Pairs of largest weight that are drawn bold, as many as in the text's figures IV.14 and IV.15."""

SHOWN_PAIRS = 90
"""Of all pairs, evenly spread: more of them merge into an area."""

WIDTH, HEIGHT, GAP = 32.0, 2.6, 2.4
"""Size of the drawing: of the longest segment in time, of a curve, and between the two curves."""

LEFT, MARGIN = 5.0, 2.4
"""Room for the names left of the curves, and for cut points and time scales above and below them."""

BAR = 0.6
"""Height of a bar that marks a cut, and of the name at its end."""

DROPPED = "#30353b"
"""Colour of a pair without weight: just visible on the viewer's dark ground."""


@dataclass(frozen=True)
class _Curve:
    """Position along a primitive's axis over one extended segment, and where it is drawn."""

    time: np.ndarray  # (T,) s since the start of the demonstration
    height: np.ndarray  # (T,) in the drawing, downwards
    scale: float  # drawing units per s

    def points(self, times: np.ndarray) -> np.ndarray:
        """Points (K, 2) of the drawing at times (K,) in s."""
        x = self.scale * (times - self.time[0])
        return np.column_stack([x, np.interp(times, self.time, self.height)])


def write_alignment(
    path: str | Path,
    demonstrations: Sequence[Demonstration],
    segmentation: Segmentation,
    parameters: SegmentParameters,
    title: str = "Alignment",
) -> None:
    """Write the correspondences of the reference with every other demonstration as a recording.

    One view per primitive that has an axis: above the reference, below the other demonstration, between them
    the corresponding samples, brighter with their weight. The time line goes through the demonstrations.

    Args:
        path: of the .rrd file.
        demonstrations: complete ones.
        segmentation: of these demonstrations.
        parameters: it was made with.
        title: heading, different for every recording.
    """
    by_name = {demonstration.name: demonstration for demonstration in demonstrations}
    axes = {
        primitive.name: primitive.axis for primitive in parameters.primitives if primitive.axis != "between"
    }
    aligned = set(segmentation.pairs["demonstration"]) & set(segmentation.cuts["demonstration"])
    guesses = [name for name in by_name if name in aligned]
    with recording(path, title) as stream:
        stream.send_blueprint(_blueprint(axes, f"{title}{origin_label(demonstrations)}"))
        for primitive, axis in axes.items():
            zvc = segmentation.result(primitive, "zvc")
            shown = [by_name[name] for name in (segmentation.reference, *guesses)]
            longest_s = float((zvc["end_s"] - zvc["start_s"]).max()) + 2.0 * parameters.extension_s
            reference, *others = [
                _curve(one, zvc.loc[one.name], axis, parameters, WIDTH / longest_s, float(below))
                for below, one in zip([0.0] + [HEIGHT + GAP] * len(guesses), shown, strict=True)
            ]
            stream.reset_time()
            _send_curve(stream, primitive, "reference", reference, f"reference {segmentation.reference}", 0.0)
            _send_cuts(stream, primitive, "reference", reference, segmentation, segmentation.reference)
            for number, (name, curve) in enumerate(zip(guesses, others, strict=True), start=1):
                stream.set_time(DEMONSTRATION, sequence=number)
                _send_curve(stream, primitive, "guess", curve, f"demonstration {name}", HEIGHT + GAP)
                _send_cuts(stream, primitive, "guess", curve, segmentation, name)
                of_this = (segmentation.pairs["demonstration"] == name) & (
                    segmentation.pairs["primitive"] == primitive
                )
                _send_pairs(stream, primitive, reference, curve, segmentation.pairs[of_this])


def _curve(
    demonstration: Demonstration,
    cut: pd.Series,
    axis: str,
    parameters: SegmentParameters,
    scale: float,
    below: float,
) -> _Curve:
    """The extended segment that was aligned, filtered as it was then; `below` is where its top is drawn.

    Of several axes the one with the largest movement is drawn.
    """
    smooth = signals.low_pass(demonstration.position, demonstration.dt, parameters.align_cutoff_hz)
    first, last = cut["start_s"] - parameters.extension_s, cut["end_s"] + parameters.extension_s
    inside = (demonstration.time >= first) & (demonstration.time <= last)
    columns = smooth[inside][:, AXES[axis]]
    position = columns[:, np.argmax(np.ptp(columns, axis=0))]
    share = (position.max() - position) / max(np.ptp(position), np.finfo(float).tiny)
    return _Curve(demonstration.time[inside], below + HEIGHT * share, scale)


def _send_curve(
    stream: rr.RecordingStream, primitive: str, role: str, curve: _Curve, label: str, below: float
) -> None:
    """A curve with its name and a scale of its demonstration's own time; `below` is where its top is."""
    static = role == "reference"
    thinned = curve.time[:: thinning(float(curve.time[1] - curve.time[0]))]
    line = rr.LineStrips2D([curve.points(thinned)], colors=rgba([LIGHT_GREY]), radii=-1.5)
    stream.log(entity(primitive, role, "curve"), line, static=static)

    outside = below - 3 * BAR if static else below + HEIGHT + 2 * BAR  # of the space between the curves
    seconds = np.arange(np.ceil(2 * curve.time[0]), 2 * curve.time[-1]) / 2
    ticks = np.column_stack([curve.points(seconds)[:, 0], np.full(len(seconds), outside)])
    texts = rr.Points2D(
        np.concatenate([ticks, [[-0.5 * LEFT, below + 0.4 * HEIGHT]]]),
        labels=[*(f"{second:g} s" for second in seconds), label],
        colors=rgba([GREY]),
        radii=0.0,
        show_labels=True,
    )
    stream.log(entity(primitive, role, "scale"), texts, static=static)


def _send_cuts(
    stream: rr.RecordingStream,
    primitive: str,
    role: str,
    curve: _Curve,
    segmentation: Segmentation,
    demonstration: str,
) -> None:
    """Bars at the start and end of a curve: above it by crossing alone, below it as they result.

    The reference is cut by crossing; its result is the same.
    """
    static = role == "reference"
    for method, name, tip in (("zvc", "crossing", -BAR), (RESULT, "result", BAR)):
        if static and method == RESULT:
            continue
        cut = segmentation.result(primitive, method).loc[demonstration]
        ends = curve.points(np.array([cut["start_s"], cut["end_s"]], dtype=float))
        bars = ends[:, None, :] + np.array([[0.0, 0.0], [0.0, tip]])
        path, colour = entity(primitive, role, name), rgba([METHOD_COLOURS[method]])
        stream.log(path, rr.LineStrips2D(bars, colors=colour, radii=-2.0), static=static)
        label_at = ends + np.array([0.0, tip if tip > 0 else 2 * tip])  # a label hangs below its point
        texts = rr.Points2D(label_at, labels=[name] * 2, colors=colour, radii=0.0, show_labels=True)
        stream.log(f"{path}/name", texts, static=static)


def _send_pairs(
    stream: rr.RecordingStream, primitive: str, reference: _Curve, guess: _Curve, pairs: pd.DataFrame
) -> None:
    """Corresponding samples as lines from curve to curve."""
    times, weights = pairs[["reference_s", "guess_s"]].to_numpy(), pairs["weight"].to_numpy()
    lines = np.stack([reference.points(times[:, 0]), guess.points(times[:, 1])], axis=1)  # (K, 2, 2)
    shown = np.unique(np.linspace(0, len(lines) - 1, SHOWN_PAIRS).astype(int))
    bold = np.argsort(weights)[::-1][:HIGHLIGHTED]
    thin = rr.LineStrips2D(lines[shown], colors=_brightness(weights[shown]), radii=-0.7, draw_order=-2.0)
    stream.log(entity(primitive, "pairs"), thin)
    thick = rr.LineStrips2D(lines[bold], colors=rgba([ORANGE]), radii=-1.5, draw_order=-1.0)
    stream.log(entity(primitive, "best pairs"), thick)


def _brightness(weights: np.ndarray) -> np.ndarray:
    """Colours (K, 3) of weights (K,) in [0, 1]: from nearly the ground's to full."""
    share = weights[:, None] ** 3  # most weights lie close to 1, where differences are to be seen
    dim, full = (np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) for colour in (DROPPED, SKY))
    return (dim + share * (full - dim)).astype(np.uint8)


def _blueprint(axes: dict[str, str], heading: str) -> rrb.Blueprint:
    views = [
        rrb.Spatial2DView(
            name=f"{heading}: {primitive}, {axis}",
            origin="/",
            contents=[f"{entity(primitive)}/**"],
            visual_bounds=rrb.VisualBounds2D(
                x_range=[-LEFT, WIDTH], y_range=[-MARGIN, 2 * HEIGHT + GAP + MARGIN]
            ),
        )
        for primitive, axis in axes.items()
    ]
    return layout(rrb.Vertical(*views), DEMONSTRATION, steps_per_s=1.0)
