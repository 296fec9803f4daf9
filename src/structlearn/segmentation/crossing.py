"""Zero-velocity crossing: where a movement starts and ends, by its speed (IV.5, IV.9.1.3).

A heavily smoothed speed finds the movement, a lightly smoothed one places the cut: heavy smoothing spreads an
onset over a tenth of a second, light smoothing leaves crossings in the noise of a hand at rest.
"""

import numpy as np

from structlearn.ground.errors import InputError

REST_FRACTION = 0.2
"""Fraction of the threshold below which the point counts as resting; the descent to the local minimum stops
there, for within a resting hand it would wander to the next minimum of the noise."""


def moving_interval(
    smooth_speed: np.ndarray, speed: np.ndarray, threshold: float, bridge: int, first: int = 0
) -> tuple[int, int]:
    """First and last sample of the largest movement.

    The run of smoothed speed above the threshold that holds its maximum is joined with neighbouring runs
    across dips of at most `bridge` samples (a hesitation is not an end). From its crossings the cut points
    go down the lightly smoothed speed to its local minimum, or to rest.

    `smooth_speed`: (T,) heavily smoothed speed in m/s. `speed`: (T,) lightly smoothed speed in m/s.
    `threshold`: h in m/s. Returns s, e: first and last sample. Raises InputError: the speed does not cross
    the threshold; the caller adds whose speed it is.
    """
    above = np.flatnonzero(smooth_speed[first:] > threshold) + first
    if len(above) == 0:
        peak = smooth_speed[first:].max(initial=0.0)
        raise InputError(f"its speed never exceeds {threshold:g} m/s (largest {peak:.3g} m/s)")
    runs = np.split(above, np.flatnonzero(np.diff(above) > bridge + 1) + 1)
    run = max(runs, key=lambda samples: smooth_speed[samples].max())
    rest = REST_FRACTION * threshold
    return cut_points(speed, (int(run[0]), int(run[-1])), threshold, rest, (first, len(speed) - 1))


def cut_points(
    speed: np.ndarray, run: tuple[int, int], threshold: float, rest: float, limits: tuple[int, int]
) -> tuple[int, int]:
    """Where a movement starts and ends, from a run of its heavily smoothed speed above the threshold.

    `speed`: (T,) lightly smoothed speed. `threshold`: above which it moves, in the unit of the speed. `rest`:
    below which it counts as resting. Returns s, e: first and last sample of the movement.
    """
    s, e = run
    moving = np.flatnonzero(speed[s : e + 1] > threshold)
    if len(moving) > 0:  # smoothing reaches beyond the movement: come back to the crossing itself
        s, e = s + int(moving[0]), s + int(moving[-1])
    return _descend(speed, s, -1, limits[0], rest), _descend(speed, e, +1, limits[1], rest)


def _descend(speed: np.ndarray, sample: int, step: int, limit: int, rest: float) -> int:
    """Follow the falling speed outwards to its local minimum, to rest or to the limit."""
    while sample != limit and speed[sample] > rest and speed[sample + step] < speed[sample]:
        sample += step
    return sample
