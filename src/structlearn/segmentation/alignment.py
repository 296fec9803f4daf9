"""Time scale and delay of a segment relative to the reference, by weighted least squares (IV.5.2, IV.5.3).

    t_guess = tau t_ref + d        (eq. IV.15)

over the corresponding samples that dynamic time warping found. Pairs at near-zero velocity are ambiguous and
dropped; pairs of incompatible velocities are probably wrong and count exponentially less.
"""

from dataclasses import dataclass

import numpy as np

from structlearn.ground.errors import InputError


@dataclass(frozen=True)
class Alignment:
    """How a guessed segment lies relative to the reference segment."""

    time_scale: float  # tau, dimensionless
    delay: float  # d in samples

    def guess_time(self, reference_time: np.ndarray | float) -> np.ndarray | float:
        """Time in the guess that corresponds to a time in the reference, in samples (eq. IV.15)."""
        return self.time_scale * reference_time + self.delay


def velocity_weights(
    reference_velocity: np.ndarray, guess_velocity: np.ndarray, near_zero: float, decay: float
) -> np.ndarray:
    """Weights of correspondence pairs: exp(-decay |v_ref - v_guess|), 0 at near-zero velocity (IV.5.3).

    The velocities are made comparable by the largest speed of each segment; this removes the time scale too.

    `reference_velocity`: (K, D) velocity of the reference at the pairs. `guess_velocity`: (K, D) velocity of
    the guess at the pairs. `near_zero`: fraction of the largest speed below which a pair is dropped. `decay`:
    k, dimensionless. Returns (K,) weights in [0, 1]; 1 for equal velocities.
    """
    speeds = [np.linalg.norm(velocity, axis=1) for velocity in (reference_velocity, guess_velocity)]
    largest = [max(float(speed.max(initial=0.0)), np.finfo(float).tiny) for speed in speeds]
    difference = np.linalg.norm(reference_velocity / largest[0] - guess_velocity / largest[1], axis=1)
    slow = (speeds[0] < near_zero * largest[0]) | (speeds[1] < near_zero * largest[1])
    return np.where(slow, 0.0, np.exp(-decay * difference))


def least_squares(pairs: np.ndarray, weights: np.ndarray | None = None) -> Alignment:
    """Time scale and delay that fit the pairs best (eq. IV.17, with weights IV.18).

    `pairs`: (K, 2) corresponding times in samples: reference, guess. `weights`: (K,) weights; None: ordinary
    least squares. Raises InputError: fewer than two different reference times have weight, or time would run
    backwards.
    """
    weights = np.ones(len(pairs)) if weights is None else weights
    used = weights > 0.0
    if not used.any() or np.ptp(pairs[used, 0]) == 0:
        raise InputError(f"only {int(used.sum())} correspondence pairs are left to align it")
    reference, guess = pairs[used].astype(float).T
    share = weights[used] / weights[used].sum()
    centre_reference, centre_guess = share @ reference, share @ guess  # centred: well-conditioned
    deviation = reference - centre_reference
    time_scale = (share * deviation) @ (guess - centre_guess) / ((share * deviation) @ deviation)
    if time_scale <= 0.0:
        raise InputError("its correspondence pairs run backwards in time")
    return Alignment(float(time_scale), float(centre_guess - time_scale * centre_reference))


def with_crossings(
    alignment: Alignment,
    pairs: np.ndarray,
    weights: np.ndarray,
    crossings: np.ndarray,
    crossing_weight: float,
    tolerance: float,
) -> Alignment:
    """Weighted least squares that also counts the zero-velocity crossings as correspondences.

    A departure from the text. Its weights leave only pairs in mid-movement, where two trials of one person
    differ in shape; at the ends, where the cut is made, it extrapolates. The crossings are the only
    correspondences there. A crossing that lies far from the text's alignment is probably a false one and
    counts less, by 1 / (1 + (distance / tolerance)^2).

    Args:
        alignment: the text's estimate from the pairs alone.
        pairs: (K, 2) corresponding times in samples: reference, guess.
        weights: (K,) their weights.
        crossings: (2, 2) start and end by zero-velocity crossing: reference, guess, in samples.
        crossing_weight: weight of a pair of undoubted crossings relative to all other pairs together.
        tolerance: distance in samples at which a crossing has half its weight.
    """
    distance = crossings[:, 1] - alignment.guess_time(crossings[:, 0])
    trust = 0.5 * crossing_weight * weights.sum() / (1.0 + (distance / tolerance) ** 2)
    return least_squares(np.concatenate([pairs, crossings]), np.concatenate([weights, trust]))
