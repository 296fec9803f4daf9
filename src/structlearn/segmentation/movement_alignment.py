"""One primitive of one demonstration, guessed by zero-velocity crossing and aligned with the reference's.

Lines 11 to 24 of algorithm IV.1. Estimates of where it starts and ends are kept by method, to be compared.
"""

from dataclasses import dataclass

import numpy as np

from structlearn.segmentation.alignment import Alignment, least_squares, velocity_weights, with_crossings
from structlearn.segmentation.crossings import Crossing
from structlearn.segmentation.dtw import warping
from structlearn.segmentation.parameters import SegmentParameters


@dataclass(frozen=True)
class Movement:
    """Filtered signals of one primitive's axis in one demonstration, and its crossing."""

    dt: float  # s
    path: np.ndarray  # (T, D) m, of an orientation rad
    velocity: np.ndarray  # (T, D) of it
    crossing: Crossing  # in samples


@dataclass(frozen=True)
class Refined:
    """How one primitive of one demonstration lies relative to the reference; times in samples.

    Attributes:
        reference, own: the movements.
        pairs: (K, 2) corresponding samples: reference, own.
        weights: (K,) of the pairs.
        alignments: by method.
        cells: of the warping table that were computed.
    """

    reference: Movement
    own: Movement
    pairs: np.ndarray
    weights: np.ndarray
    alignments: dict[str, Alignment]
    cells: int

    def ends(self, method: str) -> np.ndarray:
        """(2,) start and end by a method; what an event says is not refined."""
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


def refine(reference: Movement, own: Movement, parameters: SegmentParameters) -> Refined:
    """Lines 11 to 24 of algorithm IV.1 for one primitive. Raises InputError: too few samples correspond."""
    extension = round(parameters.extension_s / reference.dt)
    g = parameters.downsampling
    # Times count from the start of the demonstrations, so the extension need not be undone, clipped or not.
    crossings = [movement.crossing for movement in (reference, own)]
    firsts = [max(one.earliest, one.start - extension) for one in crossings]
    part, own_part = (
        movement.path[first : min(one.latest, one.end + extension) + 1 : g]
        for movement, one, first in zip((reference, own), crossings, firsts, strict=True)
    )
    matches, cells = warping(part, own_part, one_scale=parameters.assigns_runs)
    pairs = g * matches + np.array(firsts)
    weights = velocity_weights(
        reference.velocity[pairs[:, 0]], own.velocity[pairs[:, 1]], parameters.near_zero, parameters.decay
    )
    ends = np.array([[one.start for one in crossings], [one.end for one in crossings]])
    tolerance = parameters.crossing_tolerance_s / reference.dt
    text = least_squares(pairs, weights)
    alignments = {
        "ls": least_squares(pairs),
        "wls_text": text,
        "wls": with_crossings(text, pairs, weights, ends, parameters.crossing_weight, tolerance),
    }
    return Refined(reference, own, pairs, weights, alignments, cells)
