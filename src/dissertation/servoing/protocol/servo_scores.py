"""Servoing scores: success, time, path length, contact on the skin (II.4.6, figure II.6)."""

from collections.abc import Sequence
from dataclasses import fields

import numpy as np
import pandas as pd

from dissertation.servoing.protocol.servo_variants import ServoVariant, ToleranceParameters
from dissertation.servoing.world.servo_loop import Held, Scene, Servoed
from structlearn.core.metrics import matching
from structlearn.tactile.electrodes import path_length, skin_distance

THINNED = 10  # electrode samples per path point, so that contact tremor does not add path length

KEYS = [field.name for field in fields(ServoVariant)]  # columns that identify a controller


def scored(
    run: Servoed, start: Held, target: Held, scene: Scene, tolerance: ToleranceParameters
) -> pd.DataFrame:
    """Scores of B trials, one row each.

    `position_error_mm`, `pressure_error` and `load_error` (both relative) at the end; `success`; `reach_s`,
    the time from which both tolerances hold to the end, or NaN; `path_mm` of the contact; `geodesic_mm`, the
    shortest path; `lifted`, whether the finger ever left the handle; `off_skin`, whether the contact ever
    passed the skin's edge.
    """
    skin = scene.finger.skin
    judged = round(tolerance.judged_s * scene.sample_hz)
    position, pressure = target_errors(run, target, judged)
    load = np.abs(run.load / target.contact.load - 1)
    kept = (position <= 1e-3 * tolerance.position_mm) & (pressure <= tolerance.pressure)
    final = [error[-judged:].mean(axis=0) for error in (position, pressure, load)]
    outside = np.count_nonzero(~kept[::-1].cumprod(axis=0, dtype=bool), axis=0)
    return pd.DataFrame(
        {
            "position_error_mm": 1e3 * final[0],
            "pressure_error": final[1],
            "load_error": final[2],
            "success": (final[0] <= 1e-3 * tolerance.position_mm) & (final[1] <= tolerance.pressure),
            "reach_s": np.where(kept[-1], outside / scene.sample_hz, np.nan),
            "path_mm": 1e3 * path_length(np.concatenate([start.contact.point[None], run.point[::THINNED]])),
            "geodesic_mm": 1e3 * skin_distance(start.contact.point, target.contact.point, skin),
            "lifted": (run.load <= 0).any(axis=0),
            "off_skin": ~skin.holds(run.point).all(axis=0),
        }
    )


def target_errors(run: Servoed, target: Held, judged: int) -> tuple[np.ndarray, np.ndarray]:
    """Distance from the target in m, and relative pressure error, (N, B) each.

    The target pressure is the mean over the last `judged` samples.
    """
    wanted = -target.signals[-judged:].mean(axis=(0, 2))
    pressure = -run.signals.mean(axis=2)
    return np.linalg.norm(run.point - target.contact.point, axis=2), np.abs(pressure / wanted - 1)


def servo_progress(run: Servoed, target: Held, scene: Scene, tolerance: ToleranceParameters) -> pd.DataFrame:
    """Progress of B trials: `time_s`, `median_mm`, `upper_mm` (90 % quantile), share `within` tolerance."""
    position, pressure = target_errors(run, target, round(tolerance.judged_s * scene.sample_hz))
    within = (position <= 1e-3 * tolerance.position_mm) & (pressure <= tolerance.pressure)
    shown = slice(THINNED - 1, None, THINNED)
    middle, upper = 1e3 * np.quantile(position[shown], [0.5, 0.9], axis=1)
    time = (np.arange(len(position)) + 1)[shown] / scene.sample_hz
    columns = {"time_s": time, "median_mm": middle, "upper_mm": upper, "within": within[shown].mean(axis=1)}
    return pd.DataFrame(columns).astype(np.float32)


def success_rates(trials: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Success rates of groups of rows of `scored`, in order of appearance.

    Columns: `trials`, `successes`, `rate`; medians over successes of `reach_s` and `path_ratio` (path over
    shortest path); numbers of trials `lifted` and `off_skin`.
    """
    success = trials["success"]
    ratio = (trials["path_mm"] / trials["geodesic_mm"]).where(success)
    reached = trials.assign(path_ratio=ratio, reach_s=trials["reach_s"].where(success))
    counts = {"trials": ("success", "size"), "successes": ("success", "sum"), "rate": ("success", "mean")}
    medians = {name: (name, "median") for name in ("reach_s", "path_ratio")}
    sums = {name: (name, "sum") for name in ("lifted", "off_skin")}
    return reached.groupby(list(by), sort=False).agg(**counts, **medians, **sums).reset_index()


def success_by_tolerance(
    trials: pd.DataFrame, by: Sequence[str], positions_mm: np.ndarray, pressure: float
) -> pd.DataFrame:
    """Success rate for each distance tolerance: columns `tolerance_mm`, `by`, `rate`."""
    pressed, keys = trials["pressure_error"] <= pressure, [trials[name] for name in by]
    rates = {
        bound: (pressed & (trials["position_error_mm"] <= bound)).groupby(keys, sort=False).mean()
        for bound in positions_mm
    }
    return pd.concat(rates, names=["tolerance_mm"]).rename("rate").reset_index()


def rows_of(table: pd.DataFrame, variant: ServoVariant) -> pd.DataFrame:
    """Rows of one controller, from a table with the columns `KEYS`."""
    return matching(table, **vars(variant))
