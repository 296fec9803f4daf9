"""What came of the executions on the board, with and without feedback (IV.9.3.5)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from scipy import stats

from structlearn.feedback.feedback_models import POINTWISE, UNROLLED
from structlearn.ground.artefacts import Metrics
from structlearn.ground.metrics import BETTER, UNDECIDED, WORSE, mean_interval, verdict
from structlearn.recordings.demonstration import Demonstration
from structlearn.reporting.prose import level_name
from structlearn.testbeds.scraping.page.execution_results import ExecutionResults
from structlearn.testbeds.scraping.protocol.executed_sets import NOMINAL

PUBLISHED_HAND_DEG = {NOMINAL: (0.0, 0.0, 0.0, 2.0), POINTWISE: (0.7, 2.5, 5.7, 3.7)}
"""Protractor on the hand (figure IV.17): at the start and at the ends of primitives 1 to 3."""

PUBLISHED_HAND_SETTING_DEG = 10.0
"""Roll of the board of these readings."""

LARGEST_FORCE_ERROR_PERCENT = 5.0
"""What this project asks of the force control."""


@dataclass(frozen=True)
class BoardResults(ExecutionResults):
    """Executions without feedback and with each model; `example_deg` is the largest setting.

    Attributes:
        traces: of `closed_loop.traces`.
        path_errors: of `models.path_errors`.
        corrected: corrected demonstrations in the setting `example_deg`.
        force_n: that the robot was asked to hold.
    """

    traces: pd.DataFrame
    path_errors: pd.DataFrame
    corrected: Sequence[Demonstration]
    force_n: float

    @cached_property
    def nominal(self) -> pd.DataFrame:
        """Executions without feedback: means over runs per `setting_deg` and `primitive`."""
        rows = self.scores[self.scores["model"] == NOMINAL].drop(columns=["run", "model"])
        return rows.groupby(["setting_deg", "primitive"], sort=True).mean()

    @cached_property
    def force_error_percent(self) -> float:
        """Largest error of the mean force of any execution, with or without feedback."""
        return float(100.0 * (self.scores["force_n"] / self.force_n - 1.0).abs().max())

    @cached_property
    def torque_monotone(self) -> dict[str, bool]:
        """By primitive, whether the roll torque without feedback changes one way with the tilt."""
        steps = {
            name: np.diff(self.nominal.xs(name, level="primitive")["roll_torque_mn_m"])
            for name in self.primitives
        }
        return {name: bool((step > 0).all() or (step < 0).all()) for name, step in steps.items()}

    @cached_property
    def coupling(self) -> pd.DataFrame:
        """Mean coupling term of the pointwise model over a primitive, and its step from setting to setting.

        One row per `primitive` and `setting_deg`: `mean`, `std` over the runs; `step` from the setting below
        with its 95 % interval `low`, `high` (Welch, runs are independent).
        """
        rows = []
        fed = self.traces[self.traces["model"] == POINTWISE]
        each = fed.groupby(["primitive", "setting_deg", "run"])["coupling"].mean()
        for name in self.primitives:
            before = None
            for setting in self.settings_deg:
                values = each[name, setting].to_numpy()
                row = {"primitive": name, "setting_deg": setting, "mean": values.mean()}
                row |= {"std": np.std(values, ddof=1) if len(values) > 1 else np.nan}
                row |= dict.fromkeys(("step", "low", "high"), np.nan)
                if before is not None:
                    row["step"] = values.mean() - before.mean()
                    if len(values) > 1:
                        interval = stats.ttest_ind(values, before, equal_var=False).confidence_interval()
                        row |= {"low": interval.low, "high": interval.high}
                rows.append(row)
                before = values
        return pd.DataFrame(rows)

    @cached_property
    def coupling_verdicts(self) -> dict[str, str]:
        """By primitive, whether the mean coupling term tells every setting from its neighbours."""
        verdicts = {}
        for name, rows in self.coupling.groupby("primitive", sort=False):
            steps = rows.dropna(subset="step")
            towards = np.sign(steps["step"].sum())
            if (towards * steps["step"] <= 0.0).any():
                verdicts[name] = WORSE
            else:
                parted = (steps["low"] * steps["high"] > 0.0).all()
                verdicts[name] = BETTER if parted else UNDECIDED
        return verdicts

    def path_comparison(self, seen_deg: Sequence[float]) -> pd.DataFrame:
        """Errors of the unrolled path, pointwise beside unrolled, in settings learned from and others.

        Returns:
            One row per `primitive` and `seen`: `count` of demonstrations, mean and std of both models, the
            mean paired difference `lower_deg` (pointwise minus unrolled) with its `half_width`, and the
            `verdict` on the unrolled model.
        """
        keys = ["primitive", "setting_deg", "demonstration"]
        wide = self.path_errors.pivot_table("error_deg", keys, "model").reset_index()
        wide["seen"] = wide["setting_deg"].isin(list(seen_deg))
        rows = []
        for name in self.primitives:
            for seen in (True, False):
                part = wide[(wide["primitive"] == name) & (wide["seen"] == seen)]
                if len(part):
                    row = {"primitive": name, "seen": seen, "count": len(part)}
                    for model in (POINTWISE, UNROLLED):
                        row |= {f"{model}_deg": part[model].mean(), f"{model}_std": part[model].std()}
                    lower, half_width = mean_interval((part[POINTWISE] - part[UNROLLED]).to_numpy())
                    row |= {"lower_deg": lower, "half_width": half_width}
                    rows.append(row | {"verdict": str(verdict(lower - half_width, lower + half_width))})
        return pd.DataFrame(rows)


def tables(results: BoardResults, seen_deg: Sequence[float]) -> dict[str, pd.DataFrame]:
    """Tables by name."""
    return {
        "board_nominal": results.nominal.reset_index(),
        "board_costs": results.costs,
        "board_cost_ratios": results.ratios,
        "board_coupling": results.coupling,
        "board_hand_roll": results.hand_roll,
        "path_errors": results.path_comparison(seen_deg),
    }


def metrics(results: BoardResults) -> Metrics:
    """Cost ratios by setting, force and torque."""
    values: Metrics = {}
    for model, name in ((POINTWISE, "feedback"), (UNROLLED, "unrolled")):
        for setting, ratio in results.ratio(model)["ratio"].items():
            values[f"cost_ratio_{name}_over_nominal_{level_name(setting)}"] = float(ratio)
    values["force_largest_error_percent"] = results.force_error_percent
    values["roll_torque_monotone"] = all(results.torque_monotone.values())
    return values
