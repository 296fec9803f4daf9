"""What the calibration page shows: tables of both worlds, and the metrics made of them."""

from dataclasses import dataclass
from functools import cached_property

import pandas as pd

from structlearn.ground.artefacts import Metrics
from structlearn.testbeds.recorded.protocol.touch_calibration import REFERENCE, SIMULATED

STATISTICS = {
    "contact_strongest": "contact, strongest electrode (counts)",
    "contact_second": "contact, second strongest (counts)",
    "contact_fourth": "contact, fourth strongest (counts)",
    "contact_median": "contact, median electrode (counts)",
    "contact_many": "contact, electrodes beyond 100 counts",
    "range_strongest": "range, strongest electrode (counts)",
    "range_second": "range, second strongest (counts)",
    "range_fourth": "range, fourth strongest (counts)",
    "range_median": "range, median electrode (counts)",
    "noise_median": "noise, median electrode (counts)",
    "noise_largest": "noise, noisiest electrode (counts)",
    "active": "active electrodes",
    "pca_dimensions": "principal components",
    "power_slow": "0.4 to 2 Hz, strongest electrode (counts)",
    "power_middle": "2 to 10 Hz, strongest electrode (counts)",
    "power_fast": "10 to 50 Hz, strongest electrode (counts)",
}
"""What the statistics of `recorded.calibration.comparison` are called on the page."""


@dataclass(frozen=True)
class CalibrationResults:
    """All that the page shows; the attributes are tables of the functions in `recorded.calibration`."""

    comparison: pd.DataFrame
    electrodes: pd.DataFrame
    fingers: pd.DataFrame
    spectra: pd.DataFrame
    components: pd.DataFrame
    traces: pd.DataFrame

    @cached_property
    def groups(self) -> list[str]:
        """The sets, the two of the same task first."""
        rest = [
            group for group in dict.fromkeys(self.fingers["group"]) if group not in (REFERENCE, SIMULATED)
        ]
        return [REFERENCE, SIMULATED, *rest]

    @cached_property
    def medians(self) -> pd.DataFrame:
        """Median over runs and fingers of every statistic (rows) in every set (columns)."""
        names = [name for name in STATISTICS if name in self.fingers]
        table = self.fingers.groupby("group")[names].median().T[self.groups]
        return table.rename_axis("statistic").reset_index()

    def strongest(self, group: str) -> pd.DataFrame:
        """The two electrodes of every finger that contact moves most, in the first run of a set."""
        its = self.electrodes[self.electrodes["group"] == group]
        its = its[its["run"] == its["run"].iloc[0]]
        order = its["contact"].abs().sort_values(ascending=False, kind="stable").index
        return its.loc[order].groupby("finger", sort=True).head(2)


def metrics(results: CalibrationResults) -> Metrics:
    """The flat metrics of the comparison."""
    values: Metrics = {}
    for row in results.comparison.itertuples():
        values[f"{row.statistic}_recorded"] = row.recorded
        values[f"{row.statistic}_simulated"] = row.simulated
    values["agree"] = int(results.comparison["agrees"].sum())
    values["compared"] = len(results.comparison)
    return values


def tables(results: CalibrationResults) -> dict[str, pd.DataFrame]:
    """Tables of the page by name."""
    return {
        "comparison": results.comparison,
        "fingers": results.fingers,
        "spectra": results.spectra,
        "components": results.components,
    }
