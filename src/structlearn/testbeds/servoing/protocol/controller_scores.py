"""How often and how well each controller reaches its targets (figure II.6)."""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.testbeds.servoing.protocol.servo_scores import success_rates
from structlearn.testbeds.servoing.protocol.servo_variants import Variant

KEYS = [field.name for field in fields(Variant)]
"""Columns that name a controller."""


@dataclass(frozen=True)
class ControllerScores:
    """Closed loops of several controllers."""

    trials: pd.DataFrame  # see `protocol.servo_variants.Comparison`; all controllers met the same contacts

    @cached_property
    def rates(self) -> pd.DataFrame:
        """Success per controller, see `protocol.servo_scores.success_rates`; indexed by `KEYS`."""
        return success_rates(self.trials, KEYS).set_index(KEYS)

    def rate(self, variant: Variant) -> pd.Series:
        """Row of `rates`."""
        return self.rates.loc[tuple(vars(variant).values())]

    def successes(self, variant: Variant) -> np.ndarray:
        """Targets reached per seed (S,), in %."""
        return 100 * rows_of(self.trials, variant).groupby("seed")["success"].mean().to_numpy()

    def counts(self, variant: Variant) -> pd.DataFrame:
        """Numbers by seed: `trials`, `success`, and `lost`, once in the air or beyond the ends of skin."""
        rows = rows_of(self.trials, variant)
        lost = rows["lifted"] | rows["off_skin"]
        groups = rows.assign(lost=lost, trials=1).groupby("seed")
        return groups[["trials", "success", "lost"]].sum()

    def only_pressed_wrong(self, variant: Variant, position_mm: float) -> int:
        """How many of the missed targets the contact is within a distance of: only its pressure is off."""
        rows = rows_of(self.trials, variant)
        return int((~rows["success"] & (rows["position_error_mm"] <= position_mm)).sum())

    def table(self) -> pd.DataFrame:
        """A row for each controller.

        Returns `KEYS`; `trials`, `successes`, `rate`; medians of successes `reach_s` and `path_ratio`;
        numbers of trials `lifted` and `off_skin`; `rate_<motion>`; medians of all `position_error_mm` and
        `pressure_error`.
        """
        motions = success_rates(self.trials, [*KEYS, "motion"]).pivot_table("rate", KEYS, "motion")
        motions = motions[self.trials["motion"].unique()].add_prefix("rate_")
        errors = self.trials.groupby(KEYS)[["position_error_mm", "pressure_error"]].median()
        columns = ["trials", "successes", "rate", "reach_s", "path_ratio", "lifted", "off_skin"]
        return self.rates[columns].join(motions).join(errors).reset_index()


def rows_of(table: pd.DataFrame, variant: Variant) -> pd.DataFrame:
    """Rows of one controller of a table with the columns `KEYS`."""
    return table[np.logical_and.reduce([table[name] == getattr(variant, name) for name in KEYS])]
