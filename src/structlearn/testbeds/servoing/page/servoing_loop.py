"""Closed loops of servoing: how many reach their target, how fast and by which way (figure II.6)."""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.ground.artefacts import Metrics
from structlearn.testbeds.servoing.protocol.servo_scores import success_by_tolerance, success_rates
from structlearn.testbeds.servoing.protocol.servo_trials import (
    PUBLISHED,
    RESTING,
    ServoTrialParameters,
    Variant,
)

KEYS = tuple(field.name for field in fields(Variant))
"""Columns that name a controller."""

TOLERANCES_MM = np.linspace(0.25, 4.0, 16)
"""At which success is looked at."""

TEXT, ACTING = Variant(PUBLISHED, "NJ"), Variant(RESTING, "NJ")
"""Non-linear model and network's Jacobian: the dissertation's controller, and the more cautious one."""


@dataclass(frozen=True)
class ServoTrials:
    """How trials of several controllers ended, see `simulation.servo_trials.Comparison`.

    Attributes:
        trials: of every controller, all on the same contacts.
        parameters: of the loops.
    """

    trials: pd.DataFrame
    parameters: ServoTrialParameters

    @cached_property
    def rates(self) -> pd.DataFrame:
        """Success per controller, see `simulation.servo_scores.success_rates`; indexed by `KEYS`."""
        return success_rates(self.trials, KEYS).set_index(list(KEYS))

    @cached_property
    def rates_by_motion(self) -> pd.DataFrame:
        """The same, indexed by `KEYS` and `motion`."""
        return success_rates(self.trials, (*KEYS, "motion")).set_index([*KEYS, "motion"])

    @property
    def variants(self) -> list[Variant]:
        """All controllers, in the order of the trials."""
        return [Variant(*key) for key in self.rates.index]

    @property
    def motions(self) -> list[str]:
        """What trials need."""
        return list(self.trials["motion"].unique())

    @property
    def seeds(self) -> int:
        """Number of trained models that were servoed with."""
        return self.trials["seed"].nunique()

    def rate(self, variant: Variant) -> pd.Series:
        """Row of `rates`."""
        return self.rates.loc[key_of(variant)]

    def of(self, table: pd.DataFrame, variant: Variant) -> pd.DataFrame:
        """Rows of one controller of one of the tables."""
        return table[np.logical_and.reduce([table[name] == getattr(variant, name) for name in KEYS])]

    def successes(self, variant: Variant) -> np.ndarray:
        """Share of successes per seed (S,)."""
        return self.of(self.trials, variant).groupby("seed")["success"].mean().to_numpy()

    def table(self) -> pd.DataFrame:
        """A row for each controller.

        Returns:
            `KEYS`; `trials`, `successes`, `rate` with its Wilson interval `low` to `high`, `rate_<motion>`;
            medians of successes `reach_s` and `path_ratio`; medians of all `position_error_mm` and
            `pressure_error`; numbers of trials `lifted` and `off_skin`.
        """
        keys = list(KEYS)
        motions = self.rates_by_motion.reset_index().pivot_table("rate", keys, "motion")
        motions = motions[self.motions].add_prefix("rate_")
        errors = self.trials.groupby(keys)[["position_error_mm", "pressure_error"]].median()
        columns = [
            "trials",
            "successes",
            "rate",
            "low",
            "high",
            "reach_s",
            "path_ratio",
            "lifted",
            "off_skin",
        ]
        return self.rates[columns].join(motions).join(errors).reset_index()


@dataclass(frozen=True)
class ServoLoop(ServoTrials):
    """What the stage `servo` wrote, see `simulation.servo_trials.Comparison`.

    Attributes:
        progress: how trials come closer.
        paths: of some trials over time.
    """

    progress: pd.DataFrame
    paths: pd.DataFrame

    @cached_property
    def by_tolerance(self) -> pd.DataFrame:
        """Share that ends within each of `TOLERANCES_MM`, at the tolerance for pressure."""
        return success_by_tolerance(self.trials, KEYS, TOLERANCES_MM, self.parameters.tolerance.pressure)

    def metrics(self) -> Metrics:
        """Of the resting controller with NJ, where nothing else is said."""
        acting, text = self.rate(ACTING), self.rate(TEXT)
        return {
            "servo_trials": int(acting["trials"]),
            "servo_success_rate": acting["rate"],
            "servo_success_rate_published": text["rate"],
            "servo_success_rate_ll": self.rate(Variant(RESTING, "LL"))["rate"],
            "servo_success_rate_ng": self.rate(Variant(RESTING, "NG"))["rate"],
            "servo_success_rate_nostruct": self.rate(Variant(RESTING, "NJ", structure=False))["rate"],
            "servo_reach_s": acting["reach_s"] if np.isfinite(acting["reach_s"]) else None,
            "servo_path_ratio": acting["path_ratio"] if np.isfinite(acting["path_ratio"]) else None,
            "servo_contacts_lost": int(acting["lifted"] + acting["off_skin"]),
        }


def key_of(variant: Variant) -> tuple[object, ...]:
    """Values of `KEYS`."""
    return tuple(getattr(variant, name) for name in KEYS)


def percent(row: pd.Series) -> str:
    """`96.2 % [94.1, 97.6]`: a share of trials with its Wilson interval."""
    return f"{100 * row['rate']:.1f} % [{100 * row['low']:.1f}, {100 * row['high']:.1f}]"
