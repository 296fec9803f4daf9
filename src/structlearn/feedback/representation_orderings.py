"""Which representations of the feedback are compared, and whether the dissertation's orderings hold."""

import pandas as pd

from structlearn.ground.metrics import mean_interval, verdict

REPRESENTATIONS = ("pmnn_100", "pmnn_6", "pmnn_0", "ffnn_phase", "ffnn", "pca", "autoencoder")

STOPPINGS = ("validation", "generalization")
"""The part whose error names the step; generalization is the dissertation's, optimistic choice."""

CLAIMS = (
    ("pmnn_100", "pmnn_0"),
    ("pmnn_0", "ffnn_phase"),
    ("ffnn_phase", "ffnn"),
    ("pmnn_100", "ffnn_phase"),
    ("pmnn_100", "ffnn"),
    ("pmnn_100", "pmnn_6"),
    ("pmnn_100", "pca"),
    ("pmnn_100", "autoencoder"),
    ("pmnn_6", "pca"),
    ("pmnn_6", "autoencoder"),
)
"""Pairs (better, worse) of figure IV.16 and its text."""


def paired_orderings(table: pd.DataFrame) -> pd.DataFrame:
    """Whether the dissertation's orderings hold, in pairs over the folds.

    Folds share most of their training samples, so their differences are not independent and the intervals
    are somewhat too narrow.

    Args:
        table: of `model_comparison.compare_representations`.

    Returns:
        Per stopping and claim: `better`, `worse` (as claimed), `difference` (mean over folds of the latter's
        generalisation NMSE minus the former's; positive as claimed), `half_width` of its 95 % confidence
        interval, `p_value` (two-sided Wilcoxon signed-rank test) and the `verdict`: better, worse or
        undecided, by the interval.
    """
    from scipy import stats

    rows = []
    for stopping in STOPPINGS:
        errors = table[table["stopping"] == stopping].pivot_table("generalization", "fold", "representation")
        for better, worse in CLAIMS:
            if better in errors and worse in errors:
                difference = (errors[worse] - errors[better]).to_numpy()
                mean, half_width = mean_interval(difference)
                p_value = float(stats.wilcoxon(difference).pvalue) if difference.any() else 1.0
                found = str(verdict(mean - half_width, mean + half_width))
                rows.append((stopping, better, worse, mean, half_width, p_value, found))
    columns = ["stopping", "better", "worse", "difference", "half_width", "p_value", "verdict"]
    return pd.DataFrame(rows, columns=columns)
