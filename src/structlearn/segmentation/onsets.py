"""Start and end of a movement, extrapolated from its minimum-jerk profile near rest.

The speed passes a threshold only some time after the movement has begun, the later the slower the movement,
and sway of a resting hand passes it at random. Near its ends, a movement from rest to rest follows the
minimum-jerk profile

    y(phase) = 10 phase^3 - 15 phase^4 + 6 phase^5

for the share y of the distance covered, whatever its pace in the middle. The inverse of y gives the phase of
each sample, and the line through (phase, time) of the first few per cent of the distance reaches phase 0 at
the onset. The end is the onset of the reversed movement. Not in the dissertation, which cuts by zero-velocity
crossing (IV.5).
"""

import numpy as np

from structlearn.core.signals import minimum_jerk

PHASE = np.linspace(0.0, 1.0, 2001)
PROGRESS = minimum_jerk(PHASE)

REST_WINDOW_S = 0.3
"""Longest time before the crossing that is used to estimate the rest position and its sway."""

FIRST_SHARE, LAST_SHARE = 0.01, 0.05
"""Range of the covered share from which samples are used; tuned on simulated people of the seeds 1 to 5."""

SWAY, LARGEST_SHARE, SHARES = 5.0, 0.15, 3.0
"""The first share is at least `SWAY` standard deviations of the sway at rest, but at most `LARGEST_SHARE`;
the last is at least `SHARES` times the first."""

STRAIGHT = 0.5
"""Least distance between the ends over the path length, for a movement that progresses steadily."""

FEWEST_SAMPLES = 4
"""Fewest samples for the line."""


def movement_ends(
    path: np.ndarray, dt: float, crossing: tuple[int, int], limits: tuple[int, int]
) -> tuple[int, int]:
    """First and last sample of a movement from rest to rest, starting from its zero-velocity crossing.

    `path`: (T, D) m or rad, lightly smoothed. `crossing`: first and last sample. `limits`: samples beyond
    which other motion begins. An end that cannot be extrapolated stays at the crossing: the movement turns
    back, or too few samples remain.
    """
    last = len(path) - 1
    start = _onset(path, dt, crossing, limits)
    mirrored = [(last - late, last - early) for early, late in (crossing, limits)]
    end = last - _onset(path[::-1], dt, *mirrored)
    return (start, end) if start < end else crossing


def _onset(path: np.ndarray, dt: float, crossing: tuple[int, int], limits: tuple[int, int]) -> int:
    """Sample at which the movement leaves rest; arguments as in `movement_ends`."""
    start, end = crossing
    earliest, rest = limits[0], round(REST_WINDOW_S / dt)
    before, after = path[max(earliest, start - rest) : start + 1], path[end : min(limits[1], end + rest) + 1]
    origin = np.median(before, axis=0)  # median, since some of these samples may be moving
    displacement = np.median(after, axis=0) - origin
    distance = float(np.linalg.norm(displacement))
    length = float(np.linalg.norm(np.diff(path[start : end + 1], axis=0), axis=1).sum())
    if distance <= STRAIGHT * length:
        return start
    share = (path - origin) @ displacement / distance**2
    sway = float(share[start - len(before) + 1 : start + 1].std())
    first = min(max(FIRST_SHARE, SWAY * sway), LARGEST_SHARE)
    last = max(LAST_SHARE, SHARES * first)
    passed = start + int(np.argmax(share[start : end + 1] > last))
    below = np.flatnonzero(share[earliest:passed] < first)
    samples = np.arange(earliest + (int(below[-1]) + 1 if len(below) else 0), passed)
    phase = np.interp(share[samples], PROGRESS, PHASE)
    if len(samples) < FEWEST_SAMPLES or np.ptp(phase) == 0.0:
        return start
    slope, onset = np.polyfit(phase, samples, 1)
    return int(np.clip(round(onset), earliest, passed)) if slope > 0 else start
