"""Whether one way of finding cut points is better than another, in pairs and with confidence intervals."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from structlearn.ground.metrics import mean_interval, verdict
from structlearn.recordings.demonstration import Demonstration
from structlearn.segmentation.cut_errors import aligned_spread_mm, distances_to_reference_mm
from structlearn.segmentation.parameters import PrimitiveParameters
from structlearn.segmentation.result import METHODS, RESULT, Segmentation

BASELINE = "ls"
"""The method that the text compares weighted least squares with."""


def errors_by_seed(noise: pd.DataFrame) -> pd.DataFrame:
    """Mean absolute cut error of every simulated person.

    `noise`: of `simulation.cut_sweep.noise_sweep`. Returns `noise_mm`, `seed`, `method`, `error_ms`: mean
    over demonstrations, primitives and both ends.
    """
    found = noise[noise["method"] != "left_out"]
    both_ends = found[["start_error_s", "end_error_s"]].abs().mean(axis=1)
    table = found[["noise_mm", "seed", "method"]].assign(error_ms=1e3 * both_ends)
    return table.groupby(["noise_mm", "seed", "method"], as_index=False)["error_ms"].mean()


def errors_by_level(by_seed: pd.DataFrame) -> pd.DataFrame:
    """Mean over the seeds and half the width of its 95 % confidence interval, per noise level and method.

    `by_seed`: of `errors_by_seed`. Returns `noise_mm`, `method`, `mean_ms`, `half_width_ms`; methods in their
    own order.
    """
    rows = []
    for level, at_level in by_seed.groupby("noise_mm"):
        errors = at_level.set_index("method")["error_ms"]
        for method in METHODS:
            if method in errors.index:
                rows.append((level, method, *mean_interval(errors.loc[[method]].to_numpy())))
    return pd.DataFrame(rows, columns=["noise_mm", "method", "mean_ms", "half_width_ms"])


def paired_comparison(by_seed: pd.DataFrame) -> pd.DataFrame:
    """Error of every other method minus that of the result's, in pairs over the seeds.

    People differ more than methods do; the same person cut by two methods shows the difference.

    `by_seed`: of `errors_by_seed`. Returns `noise_mm`, `method` (the other), `seeds`, `difference_ms`
    (positive where the result is better), `low_ms`, `high_ms` (95 % confidence interval) and `verdict` on the
    result.
    """
    wide = by_seed.pivot_table(index=["noise_mm", "seed"], columns="method", values="error_ms")
    others = [method for method in METHODS if method in wide.columns and method != RESULT]
    rows = []
    for other in others:
        differences = (wide[other] - wide[RESULT]).dropna()
        for level, at_level in differences.groupby(level="noise_mm"):
            mean, half = mean_interval(at_level.to_numpy())
            rows.append((level, other, len(at_level), mean, mean - half, mean + half))
    columns = ["noise_mm", "method", "seeds", "difference_ms", "low_ms", "high_ms"]
    table = pd.DataFrame(rows, columns=columns)
    return table.assign(verdict=verdict(table["low_ms"], table["high_ms"]))


def wins_at_every_noise_level(by_level: pd.DataFrame) -> bool:
    """Whether the result's mean error is the smallest at every level with noise; False if there is none.

    `by_level`: of `errors_by_level`.
    """
    means = by_level.pivot_table(index="noise_mm", columns="method", values="mean_ms")
    means = means[means.index > 0]
    wins = means.drop(columns=RESULT).min(axis=1) > means[RESULT]
    return len(wins) > 0 and bool(wins.all())


def alignment_comparison(
    demonstrations: Sequence[Demonstration],
    segmentation: Segmentation,
    primitives: Sequence[PrimitiveParameters],
) -> pd.DataFrame:
    """How closely the refined segments lie together, and whether closer than by ordinary least squares.

    The spread is one number for the whole set, so the test is on the distances from the reference's segment,
    in pairs over the demonstrations.

    `segmentation`: of these, with at least one demonstration beside the reference. Returns one row per
    primitive and method: `primitive`, `method`, `spread_mm`, `distance_mm` (mean over the demonstrations),
    `gain_mm` (distance by ordinary least squares minus this one, positive where this one is closer),
    `low_mm`, `high_mm` (95 % confidence interval) and `verdict` on this method.
    """
    rows = []
    for primitive in primitives:
        chosen = (demonstrations, segmentation, primitive.name)
        baseline = distances_to_reference_mm(*chosen, BASELINE, primitive.shown_by)
        for method in METHODS:
            distances = distances_to_reference_mm(*chosen, method, primitive.shown_by)
            spread = aligned_spread_mm(*chosen, method, primitive.shown_by)
            mean, half = mean_interval((baseline - distances).to_numpy())
            rows.append((primitive.name, method, spread, distances.mean(), mean, mean - half, mean + half))
    columns = ["primitive", "method", "spread_mm", "distance_mm", "gain_mm", "low_mm", "high_mm"]
    table = pd.DataFrame(rows, columns=columns)
    verdicts = np.where(table["method"] == BASELINE, "", verdict(table["low_mm"], table["high_mm"]))
    return table.assign(verdict=verdicts)
