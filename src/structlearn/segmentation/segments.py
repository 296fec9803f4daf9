"""Semi-automatic segmentation of demonstrations into primitives (algorithm IV.1, IV.9.2).

One demonstration is the reference, cut by zero-velocity crossing. The others are guessed in the same way and
then refined by aligning them with the reference. All estimates are kept, to be compared: the crossing alone
(`zvc`), the samples that time warping assigns to the reference's ends (`dtw`), ordinary (`ls`) and weighted
(`wls_text`) least squares as printed, and weighted least squares that counts the crossings as
correspondences too (`wls`), which is the result.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from structlearn.ground import signals
from structlearn.ground.errors import InputError
from structlearn.recordings.demonstration import Demonstration
from structlearn.segmentation.alignment import Alignment, least_squares, velocity_weights, with_crossings
from structlearn.segmentation.crossings import Crossing, Crossings, find_crossings
from structlearn.segmentation.dtw import correspondences
from structlearn.segmentation.motion_runs import path
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.segmentation.result import METHODS, RESULT, Segmentation


@dataclass(frozen=True)
class _Motion:
    """Filtered signals of one primitive's axis in one demonstration, and its crossing."""

    dt: float
    position: np.ndarray  # (T, D) m, of an orientation rad
    velocity: np.ndarray  # (T, D)
    crossing: Crossing


def cut(demonstrations: Sequence[Demonstration], parameters: SegmentParameters) -> Segmentation:
    """Cut demonstrations into primitives.

    Args:
        demonstrations: complete demonstrations with one common sampling interval.
        parameters: see there.

    Returns:
        All cuts.

    Raises:
        InputError: there is no demonstration of the reference's name, the sampling intervals differ, the
            reference cannot be cut, or another cannot and failures are not to be skipped.
    """
    first = demonstrations[0]
    for demonstration in demonstrations:
        if abs(demonstration.dt - first.dt) > 1e-6 * first.dt:
            raise InputError(
                f"{demonstration.name}: sampling interval {demonstration.dt:g} s differs from "
                f"{first.dt:g} s of {first.name}"
            )
    reference, crossings = find_crossings(demonstrations, parameters)
    reference_motions = _motions(reference, crossings[demonstrations.index(reference)], parameters)
    cuts, pairs, left_out = [], [], {}
    for demonstration, found in zip(demonstrations, crossings, strict=True):
        try:
            motions = (
                reference_motions
                if demonstration is reference
                else _motions(demonstration, found, parameters)
            )
            aligned = {
                name: _align(demonstration.name, name, reference_motions[name], motion, parameters)
                for name, motion in motions.items()
            }
            cuts.append(_cut_rows(demonstration, aligned, parameters))
            if demonstration is not reference:
                pairs.append(_pair_rows(demonstration, aligned))
        except InputError as error:
            if demonstration is reference or not parameters.skip_failures:
                raise
            left_out[demonstration.name] = str(error)
    return Segmentation(
        cuts=pd.concat(cuts, ignore_index=True),
        pairs=pd.concat(pairs, ignore_index=True) if pairs else pd.DataFrame(columns=PAIR_COLUMNS),
        left_out=pd.DataFrame(left_out.items(), columns=["demonstration", "reason"]),
        reference=reference.name,
    )


PAIR_COLUMNS = ["demonstration", "primitive", "reference_s", "guess_s", "weight"]


@dataclass(frozen=True)
class _Aligned:
    """How one primitive of one demonstration lies relative to the reference; times in samples."""

    reference: _Motion
    motion: _Motion
    pairs: np.ndarray  # (K, 2) reference, guess
    weights: np.ndarray  # (K,)
    alignments: dict[str, Alignment]  # by method

    def ends(self, method: str) -> np.ndarray:
        """(2,) start and end by a method."""
        reference, own = self.reference.crossing, self.motion.crossing
        reference_ends = np.array([reference.start, reference.end], dtype=float)
        crossings = np.array([own.start, own.end], dtype=float)
        if method == "zvc":
            return crossings
        if method == "dtw":
            ends = np.interp(reference_ends, self.pairs[:, 0], self.pairs[:, 1])
        else:
            ends = self.alignments[method].guess_time(reference_ends)
        return np.where([own.start_known, own.end_known], crossings, ends)


def _motions(
    demonstration: Demonstration, found: Crossings | InputError, parameters: SegmentParameters
) -> dict[str, _Motion]:
    """What is aligned of every primitive with an axis; raises what stands in place of the crossings."""
    if isinstance(found, InputError):
        raise found
    dt, motions = demonstration.dt, {}
    axes = {primitive.name: primitive.axis for primitive in parameters.primitives}
    for name, crossing in found.items():
        smooth = signals.low_pass(path(demonstration, axes[name]), dt, parameters.align_cutoff_hz)
        motions[name] = _Motion(dt, smooth, signals.derivative(smooth, dt), crossing)
    return motions


def _align(
    demonstration: str, primitive: str, reference: _Motion, guess: _Motion, parameters: SegmentParameters
) -> _Aligned:
    """Lines 11 to 24 of algorithm IV.1 for one primitive."""
    extension = round(parameters.extension_s / reference.dt)
    g = parameters.downsampling
    # Times count from the start of the demonstrations, so the extension need not be undone, clipped or not.
    own = [motion.crossing for motion in (reference, guess)]
    firsts = [max(one.earliest, one.start - extension) for one in own]
    parts = [
        motion.position[first : min(one.latest, one.end + extension) + 1 : g]
        for motion, one, first in zip((reference, guess), own, firsts, strict=True)
    ]
    pairs = g * correspondences(*parts, one_scale=parameters.assigns_runs) + np.array(firsts)
    weights = velocity_weights(
        reference.velocity[pairs[:, 0]],
        guess.velocity[pairs[:, 1]],
        parameters.near_zero,
        parameters.decay,
    )
    crossings = np.array([[one.start for one in own], [one.end for one in own]])
    tolerance = parameters.crossing_tolerance_s / reference.dt
    try:
        text = least_squares(pairs, weights)
        alignments = {
            "ls": least_squares(pairs),
            "wls_text": text,
            "wls": with_crossings(text, pairs, weights, crossings, parameters.crossing_weight, tolerance),
        }
    except InputError as error:
        raise InputError(f"{demonstration}: primitive '{primitive}': {error}") from error
    return _Aligned(reference, guess, pairs, weights, alignments)


def _cut_rows(
    demonstration: Demonstration,
    aligned: dict[str, _Aligned],
    parameters: SegmentParameters,
) -> pd.DataFrame:
    """Rows of `Segmentation.cuts`, with the primitives in between filled in, clipped to the recording."""
    dt, duration = demonstration.dt, demonstration.time[-1]
    rows = []
    for method in METHODS:
        found = {name: one.ends(method) for name, one in aligned.items()}
        for index, primitive in enumerate(parameters.primitives):
            if primitive.axis == "between":
                before, after = parameters.primitives[index - 1], parameters.primitives[index + 1]
                start, end = found[before.name][1], found[after.name][0]
            else:
                start, end = found[primitive.name]
            start_s, end_s = np.clip([start * dt, end * dt], 0.0, duration)
            if method == RESULT and end_s - start_s < 2 * dt:
                raise InputError(
                    f"{demonstration.name}: primitive '{primitive.name}' is empty: it would last from "
                    f"{start_s:.3f} to {end_s:.3f} s"
                )
            rows.append((demonstration.name, primitive.name, method, start_s, end_s))
    return pd.DataFrame(rows, columns=["demonstration", "primitive", "method", "start_s", "end_s"])


def _pair_rows(demonstration: Demonstration, aligned: dict[str, _Aligned]) -> pd.DataFrame:
    """Rows of `Segmentation.pairs`."""
    tables = [
        pd.DataFrame(
            {
                "demonstration": demonstration.name,
                "primitive": primitive,
                "reference_s": one.reference.dt * one.pairs[:, 0],
                "guess_s": one.motion.dt * one.pairs[:, 1],
                "weight": one.weights,
            }
        )
        for primitive, one in aligned.items()
    ]
    return pd.concat(tables, ignore_index=True)
