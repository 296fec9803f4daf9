"""Whether one way of finding cut points is better than another: paired comparisons over simulated people."""

import numpy as np
import pandas as pd

from structlearn.metrics import mean_interval
from structlearn.segmentation.result import METHODS, RESULT

BETTER, WORSE, UNDECIDED = "better", "worse", "undecided"


def errors_by_seed(noise: pd.DataFrame) -> pd.DataFrame:
    """Mean absolute cut error of every simulated person.

    Args:
        noise: of `simulation.cut_sweep.noise_sweep`.

    Returns:
        `noise_mm`, `seed`, `method`, `error_ms`: mean over demonstrations, primitives and both ends.
    """
    found = noise[noise["method"] != "left_out"]
    both_ends = found[["start_error_s", "end_error_s"]].abs().mean(axis=1)
    table = found[["noise_mm", "seed", "method"]].assign(error_ms=1e3 * both_ends)
    return table.groupby(["noise_mm", "seed", "method"], as_index=False)["error_ms"].mean()


def errors_by_level(by_seed: pd.DataFrame) -> pd.DataFrame:
    """Mean over the seeds and half the width of its 95 % confidence interval, per noise level and method.

    Args:
        by_seed: of `errors_by_seed`.

    Returns:
        `noise_mm`, `method`, `mean_ms`, `half_width_ms`; methods in their own order.
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

    Args:
        by_seed: of `errors_by_seed`.

    Returns:
        `noise_mm`, `method` (the other), `seeds`, `difference_ms` (positive where the result is better),
        `low_ms`, `high_ms` (95 % confidence interval) and `verdict` on the result: better, worse or undecided.
    """
    wide = by_seed.pivot(index=["noise_mm", "seed"], columns="method", values="error_ms")
    others = [method for method in METHODS if method in wide.columns and method != RESULT]
    rows = []
    for other in others:
        differences = (wide[other] - wide[RESULT]).dropna()
        for level, at_level in differences.groupby(level="noise_mm"):
            mean, half = mean_interval(at_level.to_numpy())
            rows.append((level, other, len(at_level), mean, mean - half, mean + half))
    columns = ["noise_mm", "method", "seeds", "difference_ms", "low_ms", "high_ms"]
    table = pd.DataFrame(rows, columns=columns)
    verdict = np.select([table["low_ms"] > 0, table["high_ms"] < 0], [BETTER, WORSE], UNDECIDED)
    return table.assign(verdict=verdict)


def wins_at_every_noise_level(by_level: pd.DataFrame) -> bool:
    """Whether the result's mean error is the smallest at every level with noise.

    Args:
        by_level: of `errors_by_level`.
    """
    means = by_level.pivot(index="noise_mm", columns="method", values="mean_ms")
    means = means[means.index > 0]
    return bool((means.drop(columns=RESULT).min(axis=1) > means[RESULT]).all())
