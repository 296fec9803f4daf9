"""Quality of demonstrations: smoothness, idle time, and distance from the others.

Smoothness is measured by the spectral arc length and the log dimensionless jerk (Balasubramanian et al.
2015), which do not depend on a movement's size or duration. There are no fixed bounds: an outlier is a
demonstration that differs from the others of its task.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from structlearn.core import signals
from structlearn.readers.demonstration import Demonstration

CUTOFF_HZ = 10.0  # hands move below it; above is sensor noise
NOISE_SHARE = 0.05  # of the largest amplitude, below which the spectrum is cut off
IDLE_SHARE = 0.05  # of the largest speed, below which the hand counts as idle
OUTLYING = 3.5  # robust z-score (Iglewicz and Hoaglin 1993)
POINTS = 101  # of normalised time at which paths are compared

MEASURES = ("smoothness", "jerk", "idle_share", "distance_mm")
OF_JOINTS = (*MEASURES[:3], "distance_joint")


def spectral_arc_length(speed: np.ndarray, dt: float) -> float:
    """Negative arc length of the normalised amplitude spectrum of a speed profile; closer to 0 is smoother.

    `speed` (T,) m/s, not all zero; `dt` s. The spectrum ends at `CUTOFF_HZ`, or where it stays below
    `NOISE_SHARE` of its largest amplitude. Zero padding makes it independent of the duration.
    """
    count = 2 ** (int(np.ceil(np.log2(len(speed)))) + 4)
    amplitude = np.abs(np.fft.rfft(speed, count))
    frequency, amplitude = np.fft.rfftfreq(count, dt), amplitude / amplitude.max()
    inside = frequency <= CUTOFF_HZ
    last = np.flatnonzero(inside & (amplitude >= NOISE_SHARE))[-1]
    width, heights = np.diff(frequency[: last + 1]) / frequency[last], np.diff(amplitude[: last + 1])
    return float(-np.hypot(width, heights).sum())


def log_dimensionless_jerk(position: np.ndarray, dt: float) -> float:
    """-ln of the integrated squared jerk times duration^3 over the squared peak speed; larger is smoother.

    `position` (T, 3) m; `dt` s. A minimum-jerk movement has -ln(720 / 1.875^2) = -5.32.
    """
    velocity = signals.derivative(position, dt)
    jerk = signals.derivative(signals.derivative(velocity, dt), dt)
    peak = np.linalg.norm(velocity, axis=1).max()
    duration = (len(position) - 1) * dt
    return float(-np.log(duration**3 / peak**2 * np.trapezoid((jerk**2).sum(axis=1), dx=dt)))


def quality(
    runs: Sequence[Demonstration], cuts: dict[str, pd.DataFrame], smoothing_hz: float
) -> pd.DataFrame:
    """Quality measures of every segmented demonstration, and which are outliers.

    `cuts`: by primitive in order of time, index demonstration, columns `start_s`, `end_s`. `smoothing_hz`:
    low-pass of positions before differentiation. Returns `demonstration`, `MEASURES` (means over the
    primitives; `distance_mm` from the mean path of each primitive, relative to its start, over normalised
    time; of joints `OF_JOINTS`, with that distance in their unit), `outlier` (names of outlying measures, or
    empty) and `rank` by the mean of the ranks, best first.
    """
    paths: dict[str, list[np.ndarray]] = {name: [] for name in cuts}
    rows = []
    for run in runs:
        if any(run.name not in table.index for table in cuts.values()):
            continue
        smooth = signals.low_pass(run.position, run.dt, smoothing_hz)
        speed = np.linalg.norm(signals.derivative(smooth, run.dt), axis=1)
        smooth_and_jerk = []
        for name, table in cuts.items():
            start, end = table.loc[run.name, ["start_s", "end_s"]]
            part = (run.time >= start) & (run.time <= end)
            if speed[part].max() > 0.0:  # otherwise pure rotation
                smoothness = spectral_arc_length(speed[part], run.dt)
                smooth_and_jerk.append((smoothness, log_dimensionless_jerk(smooth[part], run.dt)))
            moved = smooth[part] - smooth[part][0]
            paths[name].append(signals.time_normalised(moved, POINTS))
        start = min(table.loc[run.name, "start_s"] for table in cuts.values())
        end = max(table.loc[run.name, "end_s"] for table in cuts.values())
        whole = (run.time >= start) & (run.time <= end)
        idle = float(np.mean(speed[whole] < IDLE_SHARE * speed[whole].max()))
        rows.append((run.name, *np.mean(smooth_and_jerk, axis=0), idle))
    table = pd.DataFrame(rows, columns=["demonstration", *MEASURES[:3]])
    away = [
        np.linalg.norm(np.stack(of_primitive) - np.mean(of_primitive, axis=0), axis=-1).mean(axis=1)
        for of_primitive in paths.values()
    ]
    measures, factor = (OF_JOINTS, 1.0) if runs[0].of_joints else (MEASURES, 1e3)
    table[measures[-1]] = factor * np.mean(away, axis=0)
    table["outlier"] = _outliers(table, measures)
    better_large = dict(zip(measures, (True, True, False, False), strict=True))
    ranks = [table[name].rank(ascending=not large) for name, large in better_large.items()]
    table["rank"] = np.mean(ranks, axis=0).argsort(kind="stable").argsort(kind="stable") + 1
    return table


def _outliers(table: pd.DataFrame, measures: Sequence[str]) -> list[str]:
    """Per demonstration, the measures with a robust z-score beyond `OUTLYING`; needs five demonstrations."""
    if len(table) < 5:
        return [""] * len(table)
    values = table[list(measures)]
    away = (values - values.median()).abs()
    spread = away.median().replace(0.0, np.inf)
    far = 0.6745 * away / spread > OUTLYING
    return [", ".join(values.columns[row]) for row in far.to_numpy()]
