"""Alignment of a segment with the reference's by weighted least squares (IV.5.2, IV.5.3).

    t_guess = tau t_ref + d        (eq. IV.15)

over the pairs of samples found by dynamic time warping. Pairs at near-zero velocity are ambiguous and
dropped; pairs with different velocities are probably wrong, and their weight falls exponentially.

Nobody looks at every cut, so poor ones are flagged (`cut_warnings`): the crossing disagrees with the
alignment, the aligned movement with the reference's, or the choice with what was expected. The bounds lie
above all values of good cuts of the simulated task, and below those of wrong ones.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from structlearn.segmentation.crossings import Crossing
from structlearn.segmentation.dtw import correspondences
from structlearn.segmentation.parameters import SegmentParameters

METHODS = ("zvc", "dtw", "ls", "wls_published", "wls")
RESULT = "wls"  # method whose cuts are used; the others are kept for comparison
AS_PRINTED = "wls_published"  # the dissertation's method


@dataclass(frozen=True)
class Alignment:
    """Time scale and delay of a guessed segment relative to the reference segment."""

    time_scale: float  # tau, dimensionless
    delay: float  # d in samples

    def guess_time(self, reference_time: np.ndarray) -> np.ndarray:
        """Times in the guess that correspond to times in the reference, in samples (eq. IV.15)."""
        return self.time_scale * reference_time + self.delay


def velocity_weights(
    reference_velocity: np.ndarray, guess_velocity: np.ndarray, near_zero: float, decay: float
) -> np.ndarray:
    """Weights (K,) of pairs: exp(-decay |v_ref - v_guess|), 0 at near-zero velocity (IV.5.3).

    Velocities (K, D) at the pairs are divided by the largest speed of their segment, which also removes the
    time scale. `near_zero`: fraction of the largest speed below which a pair is dropped. `decay`: k.
    """
    speeds = [np.linalg.norm(velocity, axis=1) for velocity in (reference_velocity, guess_velocity)]
    largest = [max(float(speed.max(initial=0.0)), np.finfo(float).tiny) for speed in speeds]
    difference = np.linalg.norm(reference_velocity / largest[0] - guess_velocity / largest[1], axis=1)
    slow = (speeds[0] < near_zero * largest[0]) | (speeds[1] < near_zero * largest[1])
    return np.where(slow, 0.0, np.exp(-decay * difference))


def least_squares(pairs: np.ndarray, weights: np.ndarray | None = None) -> Alignment:
    """Time scale and delay that fit the pairs best (eq. IV.16 and IV.17; IV.18 with weights).

    `pairs`: (K, 2) corresponding times in samples: reference, guess. `weights`: (K,); None: all equal. Raises
    ValueError: fewer than two different reference times have weight, or time would run backwards.
    """
    weights = np.ones(len(pairs)) if weights is None else weights
    used = weights > 0.0
    if not used.any() or np.ptp(pairs[used, 0]) == 0:
        raise ValueError(f"only {int(used.sum())} correspondence pairs are left to align it")
    reference, guess = pairs[used].astype(float).T
    share = weights[used] / weights[used].sum()
    centre_reference, centre_guess = share @ reference, share @ guess  # centred for good conditioning
    deviation = reference - centre_reference
    time_scale = (share * deviation) @ (guess - centre_guess) / ((share * deviation) @ deviation)
    if time_scale <= 0.0:
        raise ValueError("its correspondence pairs run backwards in time")
    return Alignment(float(time_scale), float(centre_guess - time_scale * centre_reference))


def with_crossings(
    alignment: Alignment,
    pairs: np.ndarray,
    weights: np.ndarray,
    crossings: np.ndarray,
    crossing_weight: float,
    tolerance: float,
) -> Alignment:
    """Weighted least squares with the zero-velocity crossings as additional correspondences.

    Departs from the text, whose weights keep only pairs in mid-movement, where two trials of one person
    differ in shape, and extrapolate to the ends, where the cut is made. The crossings are the only
    correspondences there. A crossing far from the published alignment is probably false, and its weight is
    multiplied by 1 / (1 + (distance / tolerance)^2).

    `alignment`: as published, from the pairs (K, 2) with weights (K,). `crossings`: (2, 2) start and end by
    zero-velocity crossing: reference, guess, in samples. `crossing_weight`: total weight of both crossings at
    distance 0, relative to that of all pairs. `tolerance`: distance in samples that halves the weight.
    """
    distance = crossings[:, 1] - alignment.guess_time(crossings[:, 0])
    trust = 0.5 * crossing_weight * weights.sum() / (1.0 + (distance / tolerance) ** 2)
    return least_squares(np.concatenate([pairs, crossings]), np.concatenate([weights, trust]))


@dataclass(frozen=True)
class Movement:
    """Filtered signals along the axis of one primitive in one demonstration, and its crossing."""

    dt: float  # s
    path: np.ndarray  # (T, D) m; rad for orientations
    velocity: np.ndarray  # (T, D) per s
    crossing: Crossing  # in samples


@dataclass(frozen=True)
class Refined:
    """Alignments of one primitive of one demonstration with the reference; times in samples."""

    reference: Movement
    own: Movement
    pairs: np.ndarray  # (K, 2) corresponding samples: reference, own
    weights: np.ndarray  # (K,) of the pairs
    alignments: dict[str, Alignment]  # by method
    cells: int  # size of the warping table

    def ends(self, method: str) -> np.ndarray:
        """(2,) start and end by a method, in samples; ends at events are not refined."""
        reference, own = self.reference.crossing, self.own.crossing
        reference_ends = np.array([reference.start, reference.end], dtype=float)
        crossings = np.array([own.start, own.end], dtype=float)
        if method == "zvc":
            return crossings
        if method == "dtw":
            ends = np.interp(reference_ends, self.pairs[:, 0], self.pairs[:, 1])
        else:
            ends = self.alignments[method].guess_time(reference_ends)
        return np.where([own.start_known, own.end_known], crossings, ends)


def refine_cuts(reference: Movement, own: Movement, parameters: SegmentParameters) -> Refined:
    """Lines 11 to 24 of algorithm IV.1 for one primitive. Raises ValueError: too few samples correspond."""
    if own.crossing.strokes is not None:  # as many as there are: only the ends correspond
        pairs = np.array(
            [[movement.crossing.start, movement.crossing.end] for movement in (reference, own)]
        ).T
        between = least_squares(pairs)
        return Refined(
            reference, own, pairs, np.ones(2), dict.fromkeys(("ls", AS_PRINTED, RESULT), between), 0
        )
    extension = round(parameters.extension_s / reference.dt)
    g = parameters.downsampling
    # Times count from the start of the demonstrations, so the extension need not be subtracted again.
    crossings = [movement.crossing for movement in (reference, own)]
    firsts = [max(crossing.earliest, crossing.start - extension) for crossing in crossings]
    part, own_part = (
        movement.path[first : min(crossing.latest, crossing.end + extension) + 1 : g]
        for movement, crossing, first in zip((reference, own), crossings, firsts, strict=True)
    )
    pairs = g * correspondences(part, own_part, one_scale=parameters.assigns_runs) + np.array(firsts)
    weights = velocity_weights(
        reference.velocity[pairs[:, 0]], own.velocity[pairs[:, 1]], parameters.near_zero, parameters.decay
    )
    ends = np.array([[crossing.start for crossing in crossings], [crossing.end for crossing in crossings]])
    tolerance = parameters.crossing_tolerance_s / reference.dt
    published = least_squares(pairs, weights)
    alignments = {
        "ls": least_squares(pairs),
        "wls_published": published,
        "wls": with_crossings(published, pairs, weights, ends, parameters.crossing_weight, tolerance),
    }
    return Refined(reference, own, pairs, weights, alignments, len(part) * len(own_part))


WARNING_COLUMNS = ["demonstration", "primitive", "reason", "number"]  # the number is beyond its bound

APART = 0.2
"""Largest distance of an end by crossing from the same end by alignment, over the reference's duration."""

OFF_SHAPE = 0.5
"""Largest mean distance of the aligned movement from the reference's, each centred and divided by its RMS
distance from the mean, so that a different amplitude is not a different shape."""

MOST_MISMATCH = 1.0
"""Largest cost of a chosen run of motion (`run_assignment`); 2.7 times the reference's duration costs 1."""

MOST_UNASSIGNED = 0.25
"""Longest path of motion outside all primitives, relative to a mean primitive; ignored motion is shorter."""

MOST_TURNED_DEG = 20.0
"""Largest rotation in degrees outside all primitives; a hand that rests turns by a few degrees."""

MOST_PAUSED_S = 0.35
"""Longest pauses within a primitive, in total; a pause between primitives is longer."""


def cut_warnings(
    demonstration: str, refined: Mapping[str, Refined], reference: bool
) -> list[tuple[str, str, str, float]]:
    """Cut warnings of one demonstration, rows of `WARNING_COLUMNS`; most demonstrations have none.

    `refined`: by primitive with an axis. `reference`: whether it is the reference, which is not compared.
    """
    return [
        (demonstration, primitive, reason, number)
        for primitive, aligned in refined.items()
        for reason, number, bound in _evidence(aligned, reference)
        if number > bound
    ]


def _evidence(refined: Refined, reference: bool) -> Iterator[tuple[str, float, float]]:
    """(reason, number, bound) for the choice of runs and for the alignment with the reference."""
    own, crossing = refined.own.crossing, refined.reference.crossing
    yield "its duration, way or direction is unlike the reference's (cost)", own.mismatch, MOST_MISMATCH
    yield "motion before it belongs to no primitive (ways of a primitive)", own.unassigned[0], MOST_UNASSIGNED
    yield "motion after it belongs to no primitive (ways of a primitive)", own.unassigned[1], MOST_UNASSIGNED
    yield "rotation before it belongs to no primitive (degrees)", own.turned_deg[0], MOST_TURNED_DEG
    yield "rotation after it belongs to no primitive (degrees)", own.turned_deg[1], MOST_TURNED_DEG
    yield "a rest within it was taken for a hesitation (s)", own.paused_s, MOST_PAUSED_S
    if reference or own.strokes is not None:
        return
    duration = max(crossing.end - crossing.start, 1)
    apart = np.abs(refined.ends("zvc") - refined.ends("wls_published")).max() / duration
    yield "crossing and alignment lie apart (durations)", float(apart), APART
    times = np.arange(crossing.start, crossing.end + 1)
    aligned = np.interp(times, times[[0, -1]], refined.ends(RESULT))
    samples = np.arange(len(refined.own.path))
    path = np.stack([np.interp(aligned, samples, x) for x in refined.own.path.T], axis=1)
    centred = [path - path.mean(axis=0) for path in (refined.reference.path[times], path)]
    tiny = np.finfo(float).tiny
    shapes = [path / max(float(np.sqrt(np.mean(np.sum(path**2, axis=1)))), tiny) for path in centred]
    off = float(np.linalg.norm(shapes[1] - shapes[0], axis=1).mean())
    yield "aligned, it has another shape than the reference's (sizes)", off, OFF_SHAPE
