"""Whether a test motion repeats the training motion.

Its errors then show how repeatable the arm is, not whether the model generalises.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from structlearn.rigid_body.model_comparison import TRAIN
from structlearn.rigid_body.motion import Motion

REPEATED = 0.25
"""Difference of two motions relative to their spread, below which one repeats the other. On the recorded
arms, repetitions differ by up to 0.17 and other motions by at least 0.5; unrelated ones by about sqrt(2)."""

LEAST_OVERLAP = 0.75  # of the shorter motion: neighbours within one log must not count as its repetition
RATE_HZ = 50.0  # sufficient to compare positions


def repeats(pieces: Mapping[str, Sequence[tuple[str, Motion]]], rate_hz: float) -> pd.DataFrame:
    """Search every test motion in the training motion.

    `pieces`: pieces of motions, each with its log, by part. Returns one row per test part and log: `part`,
    `log`, `trained_on` (log of the most similar motion), `lag_s` of its first piece (between the starts of
    both pieces), `difference` (root mean square of the difference in position, relative to the spread of the
    test motion; smallest over logs and lags), `repeated` (whether it is below `REPEATED`).
    """
    step = max(1, round(rate_hz / RATE_HZ))
    thin = {
        part: [(log, motion.q[::step]) for log, motion in its if len(motion)] for part, its in pieces.items()
    }
    trained, rows = thin.pop(TRAIN), []
    for part, its in thin.items():
        for log in dict.fromkeys(name for name, _ in its):
            tests = [positions for name, positions in its if name == log]
            spread = np.concatenate(tests).var(axis=0).sum()
            closest = [min((*difference(known, test), name) for name, known in trained) for test in tests]
            squared = np.average([one for one, _, _ in closest], weights=[len(test) for test in tests])
            error = float(np.sqrt(squared / spread))
            _, lag, name = closest[0]
            rows.append((part, log, name, lag * step / rate_hz, error, error < REPEATED))
    return pd.DataFrame(rows, columns=["part", "log", "trained_on", "lag_s", "difference", "repeated"])


def difference(known: np.ndarray, test: np.ndarray) -> tuple[float, int]:
    """Least mean squared difference of two motions (T, n), (U, n), summed over joints, and its lag.

    At lag k, sample t of the test motion is compared with sample t + k of the known one; the products at all
    lags are one convolution.
    """
    from scipy.signal import fftconvolve

    middle = test.mean(axis=0)
    known, test = known - middle, test - middle
    lags = np.arange(1 - len(test), len(known))
    first, last = np.maximum(lags, 0), np.minimum(lags + len(test), len(known))
    squares = [np.concatenate([[0.0], np.cumsum((its**2).sum(axis=1))]) for its in (known, test)]
    total = squares[0][last] - squares[0][first] + squares[1][last - lags] - squares[1][first - lags]
    apart = total - 2.0 * fftconvolve(known, test[::-1], axes=0).sum(axis=1)
    enough = last - first >= LEAST_OVERLAP * min(len(known), len(test))
    found = np.where(enough, np.maximum(apart, 0.0) / (last - first), np.inf)
    best = int(found.argmin())
    return float(found[best]), int(lags[best])


def repeat_lines(found: pd.DataFrame) -> list[str]:
    """Text, one line per test motion that repeats the training motion."""
    return [
        f"Warning: the test motion of {row.log} repeats the training motion of {row.trained_on} (lag "
        f"{row.lag_s:+.2f} s, difference {100 * row.difference:.1f} % of its spread): its errors show "
        "repeatability; test on another motion"
        for row in found[found["repeated"]].itertuples()
    ]
