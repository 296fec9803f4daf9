"""How well fingers were servoed: success, time, path, and whether the contact stayed on the skin (II.4.6)."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from pydantic import Field

from structlearn.ground.params import Parameters
from structlearn.tactile.electrodes import path_length, skin_distance
from structlearn.testbeds.servoing.world.servo_loop import Held, Scene, Servoed

THINNED = 10
"""Samples of the electrodes per point of a path; tremor of the contact between them is no travel."""


class ToleranceParameters(Parameters):
    """When a target counts as reached. Fields: `params.yaml`, `servo.tolerance`."""

    position_mm: float = Field(gt=0)
    pressure: float = Field(gt=0)
    judged_s: float = Field(gt=0)


def scored(
    run: Servoed, start: Held, target: Held, scene: Scene, tolerance: ToleranceParameters
) -> pd.DataFrame:
    """Scores of B trials.

    Returns one row per trial: `position_error_mm`, `pressure_error` and `load_error` (both relative) at the
    end; `success`; `reach_s` from which on both tolerances are kept until the end, NaN where they are not;
    `path_mm` that the contact travelled and `geodesic_mm` it had to; `lifted` whether the finger was ever in
    the air; `off_skin` whether the contact was ever beyond the ends of the skin.
    """
    skin = scene.finger.skin
    judged = round(tolerance.judged_s * scene.sample_hz)
    position, pressure = errors(run, target, judged)
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


def errors(run: Servoed, target: Held, judged: int) -> tuple[np.ndarray, np.ndarray]:
    """Distance from the target in m and relative error of the pressure, (N, B) each.

    `run`: of B trials; `target`: of the same trials; its pressure is the mean over its last samples.
    """
    wanted = -target.signals[-judged:].mean(axis=(0, 2))
    pressure = -run.signals.mean(axis=2)
    return np.linalg.norm(run.point - target.contact.point, axis=2), np.abs(pressure / wanted - 1)


def progress(run: Servoed, target: Held, scene: Scene, tolerance: ToleranceParameters) -> pd.DataFrame:
    """How B trials come closer: `time_s`, `median_mm`, `upper_mm` (90 %), share `within` tolerance."""
    position, pressure = errors(run, target, round(tolerance.judged_s * scene.sample_hz))
    within = (position <= 1e-3 * tolerance.position_mm) & (pressure <= tolerance.pressure)
    shown = slice(THINNED - 1, None, THINNED)
    middle, upper = 1e3 * np.quantile(position[shown], [0.5, 0.9], axis=1)
    time = (np.arange(len(position)) + 1)[shown] / scene.sample_hz
    return pd.DataFrame(
        {
            "time_s": time.astype(np.float32),
            "median_mm": middle.astype(np.float32),
            "upper_mm": upper.astype(np.float32),
            "within": within[shown].mean(axis=1).astype(np.float32),
        }
    )


def success_rates(trials: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Success by groups of trials.

    `trials`: rows of `scored`, with the columns that tell groups. Returns a row per group, in the order of
    the trials: `trials`, `successes`, `rate`, `reach_s` and `path_ratio` (path over shortest path) as medians
    of successes, and the numbers `lifted` and `off_skin`.
    """
    reached = trials.assign(
        path_ratio=(trials["path_mm"] / trials["geodesic_mm"]).where(trials["success"]),
        reach_s=trials["reach_s"].where(trials["success"]),
    )
    groups = reached.groupby(list(by), sort=False)
    return groups.agg(
        trials=("success", "size"),
        successes=("success", "sum"),
        rate=("success", "mean"),
        reach_s=("reach_s", "median"),
        path_ratio=("path_ratio", "median"),
        lifted=("lifted", "sum"),
        off_skin=("off_skin", "sum"),
    ).reset_index()


def success_by_tolerance(
    trials: pd.DataFrame, by: Sequence[str], positions_mm: np.ndarray, pressure: float
) -> pd.DataFrame:
    """Share of trials that end within each distance of the target: columns `by`, `tolerance_mm`, `rate`."""
    rows = []
    for key, group in trials.groupby(list(by), sort=False):
        pressed = (group["pressure_error"] <= pressure).to_numpy()
        for bound in positions_mm:
            rate = np.mean(pressed & (group["position_error_mm"].to_numpy() <= bound))
            rows.append((*key, bound, rate))
    return pd.DataFrame(rows, columns=[*by, "tolerance_mm", "rate"])
