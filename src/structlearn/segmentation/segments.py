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
from structlearn.segmentation.crossing import moving_interval
from structlearn.segmentation.dtw import correspondences
from structlearn.segmentation.parameters import AXES, SegmentParameters
from structlearn.segmentation.result import METHODS, RESULT, Segmentation


@dataclass(frozen=True)
class _Motion:
    """Filtered signals of one primitive's axis in one demonstration, and its crossing."""

    dt: float
    position: np.ndarray  # (T, D)
    velocity: np.ndarray  # (T, D)
    start: int
    end: int


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
    reference = _reference(demonstrations, parameters)
    for demonstration in demonstrations:
        if abs(demonstration.dt - reference.dt) > 1e-6 * reference.dt:
            raise InputError(
                f"{demonstration.name}: sampling interval {demonstration.dt:g} s differs from "
                f"{reference.dt:g} s of the reference {reference.name}"
            )
    reference_motions = _guess(reference, parameters)
    cuts, pairs, left_out = [], [], {}
    for demonstration in demonstrations:
        try:
            motions = reference_motions if demonstration is reference else _guess(demonstration, parameters)
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
        reference_ends = np.array([self.reference.start, self.reference.end], dtype=float)
        if method == "zvc":
            return np.array([self.motion.start, self.motion.end], dtype=float)
        if method == "dtw":
            return np.interp(reference_ends, self.pairs[:, 0], self.pairs[:, 1])
        return self.alignments[method].guess_time(reference_ends)


def _reference(demonstrations: Sequence[Demonstration], parameters: SegmentParameters) -> Demonstration:
    if parameters.reference is None:
        return demonstrations[0]
    for demonstration in demonstrations:
        if demonstration.name == parameters.reference:
            return demonstration
    raise InputError(f"segment.reference: there is no demonstration named '{parameters.reference}'")


def _guess(demonstration: Demonstration, parameters: SegmentParameters) -> dict[str, _Motion]:
    """Zero-velocity crossing of every primitive with an axis, each looked for after the one before."""
    dt, motions, first = demonstration.dt, {}, 0
    for primitive in parameters.primitives:
        if primitive.axis == "between":
            continue
        position = demonstration.position[:, AXES[primitive.axis]]
        speeds = [
            np.linalg.norm(signals.derivative(signals.low_pass(position, dt, cutoff), dt), axis=1)
            for cutoff in (parameters.guess_cutoff_hz, parameters.cut_cutoff_hz)
        ]
        try:
            start, end = moving_interval(
                *speeds, primitive.threshold_m_s, round(parameters.bridge_s / dt), first
            )
        except InputError as error:
            raise InputError(f"{demonstration.name}: primitive '{primitive.name}': {error}") from error
        smooth = signals.low_pass(position, dt, parameters.align_cutoff_hz)
        motions[primitive.name] = _Motion(dt, smooth, signals.derivative(smooth, dt), start, end)
        first = end
    return motions


def _align(
    demonstration: str, primitive: str, reference: _Motion, guess: _Motion, parameters: SegmentParameters
) -> _Aligned:
    """Lines 11 to 24 of algorithm IV.1 for one primitive."""
    extension = round(parameters.extension_s / reference.dt)
    g = parameters.downsampling
    # Times count from the start of the demonstrations, so the extension need not be undone, clipped or not.
    firsts = [max(0, motion.start - extension) for motion in (reference, guess)]
    parts = [
        motion.position[first : motion.end + extension + 1 : g]
        for motion, first in zip((reference, guess), firsts, strict=True)
    ]
    pairs = g * correspondences(*parts) + np.array(firsts)
    weights = velocity_weights(
        reference.velocity[pairs[:, 0]],
        guess.velocity[pairs[:, 1]],
        parameters.near_zero,
        parameters.decay,
    )
    crossings = np.array([[reference.start, guess.start], [reference.end, guess.end]])
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
