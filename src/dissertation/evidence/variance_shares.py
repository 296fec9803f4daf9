"""Share of the variance of what people do that lies between people: the intraclass correlation.

People do the same trials, in the same groups (an obstacle, a setting). With a person's mean over all trials
m_p, the variance s^2 of trials within a group, and n trials of a person,

    share = (MSB - s^2) / (MSB + (n - 1) s^2),   MSB = n var(m_p)

(one-way analysis of variance; what all people do alike in a group is left out). Its interval is that of the
F distribution of MSB / s^2, exact for normal trials and equally many of each person (Searle 1971). Otherwise
n is the harmonic mean of their numbers of trials, which keeps the estimate unbiased, and the interval nearly
exact (Thomas & Hultquist 1978). A share of 0 says that a study of many people repeats one person.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from dissertation.evidence.results import Results, long_table
from structlearn.reporting.evidence import Ends, Evidence, within

SUMS = ("mean", "within", "trials", "freedom")


def trial_sums(
    stage: str, quantity: str, trials: pd.DataFrame, who: str, groups: Sequence[str] = (), unit: str = ""
) -> Iterator[pd.DataFrame]:
    """Rows of results by person from which `between_share` finds the share of a column `quantity` of trials.

    `groups`: columns that name what a person repeats. Quantities are named `<quantity> mean`, ` within` (the
    variance within groups), ` trials` and ` freedom` (trials less groups).
    """
    cells = trials.groupby([who, *groups], sort=False)[quantity]
    left = trials[quantity] - cells.transform("mean")
    squares, count = (left**2).groupby(trials[who], sort=False).sum(), trials.groupby(who, sort=False).size()
    freedom = count - cells.ngroup().groupby(trials[who], sort=False).nunique()
    mean = trials.groupby(who, sort=False)[quantity].mean()
    units = {"mean": unit, "within": f"({unit})^2" if unit else ""}
    for name, values in zip(SUMS, (mean, squares / freedom, count, freedom), strict=True):
        yield long_table(stage, f"{quantity} {name}", values, units.get(name, ""))


def sums_of(results: Results, quantity: str) -> pd.DataFrame:
    """The rows of `trial_sums`, a column each, by person."""
    return pd.DataFrame({name: results.each(f"{quantity} {name}") for name in SUMS}).dropna()


def between_share(sums: pd.DataFrame, comparisons: int = 1) -> Evidence:
    """Share between people, 0 to 1, from their `sums_of`; fewer than two people have none."""
    from scipy.stats import f as f_distribution  # slow to import, and stages only need `trial_sums`

    people, freedom = len(sums), sums["freedom"].sum()
    usual = people / (1.0 / sums["trials"]).sum() if people > 1 else np.nan
    inside = np.average(sums["within"], weights=sums["freedom"])
    ratio = usual * sums["mean"].var() / inside

    def share(its: float) -> float:
        return float(np.clip((its - 1.0) / (its + usual - 1.0), 0.0, 1.0))

    def ends(confidence: float) -> Ends:
        tail = 0.5 * (1.0 - confidence)
        low, high = f_distribution.ppf([1.0 - tail, tail], people - 1, freedom)
        return share(ratio / low), share(ratio / high)

    return within(share(ratio), ends, people, comparisons)
