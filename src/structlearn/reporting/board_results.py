"""What came of the executions on the board, with and without feedback (IV.9.3.5)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from scipy import stats

from structlearn import quaternion
from structlearn.artefacts import Metrics
from structlearn.feedback.closed_loop import NOMINAL
from structlearn.feedback.comparison import BETTER, UNDECIDED, WORSE
from structlearn.feedback.evaluation import cost_ratios
from structlearn.feedback.models import POINTWISE, UNROLLED
from structlearn.metrics import mean_interval
from structlearn.recordings.demonstration import Demonstration
from structlearn.reporting.prose import level_name
from structlearn.simulation.layout import FLAT_ORIENTATION

PUBLISHED_HAND_DEG = {NOMINAL: (0.0, 0.0, 0.0, 2.0), POINTWISE: (0.7, 2.5, 5.7, 3.7)}
"""Protractor on the hand at 10 degrees (figure IV.17): at the start and at the ends of primitives 1 to 3."""

LARGEST_FORCE_ERROR_PERCENT = 5.0
"""What this project asks of the force control."""


@dataclass(frozen=True)
class BoardResults:
    """Executions without feedback and with each model.

    Attributes:
        scores: of `closed_loop.scores`.
        traces: of `closed_loop.traces`.
        path_errors: of `models.path_errors`.
        examples: all executions in the setting `example_deg`, by model.
        corrected: corrected demonstrations in this setting.
        example_deg: the largest setting.
        axis: (3,) roll axis.
        force_n: that the robot was asked to hold.
    """

    scores: pd.DataFrame
    traces: pd.DataFrame
    path_errors: pd.DataFrame
    examples: Mapping[str, Sequence[Demonstration]]
    corrected: Sequence[Demonstration]
    example_deg: float
    axis: np.ndarray
    force_n: float

    @cached_property
    def settings_deg(self) -> list[float]:
        """Rolls of the board, rising."""
        return sorted(float(setting) for setting in self.scores["setting_deg"].unique())

    @cached_property
    def tilted_deg(self) -> list[float]:
        """Rolls of the board that are not the default."""
        return [setting for setting in self.settings_deg if setting != 0.0]

    @cached_property
    def primitives(self) -> list[str]:
        """Primitives that are scored, in order of time."""
        return list(self.scores["primitive"].unique())

    @cached_property
    def models(self) -> list[str]:
        """Names of the executed sets, the one without feedback first."""
        return list(self.scores["model"].unique())

    @cached_property
    def runs(self) -> int:
        """Executions per setting and model."""
        return int(self.scores["run"].nunique())

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
    def costs(self) -> pd.DataFrame:
        """Mean and std over the runs of the accumulated cost, per primitive, model and setting."""
        grouped = self.scores.groupby(["primitive", "model", "setting_deg"], sort=False)["cost_rad"]
        return grouped.agg(["mean", "std"]).reset_index()

    @cached_property
    def ratios(self) -> pd.DataFrame:
        """Accumulated cost of each model relative to that of another, in pairs.

        One row per `primitive` ("all" is their sum), `model`, `baseline` and `setting_deg`: `ratio`,
        `lower_rad`, `half_width` of `evaluation.cost_ratios`, and the `verdict` on the model.
        """
        pairs = [(model, NOMINAL) for model in self.models if model != NOMINAL]
        pairs += [(UNROLLED, POINTWISE)] if {UNROLLED, POINTWISE} <= set(self.models) else []
        tables = []
        for name in (*self.primitives, ALL):
            chosen = self.scores if name == ALL else self.scores[self.scores["primitive"] == name]
            for model, baseline in pairs:
                table = cost_ratios(chosen, model, baseline)
                found = [verdict(row.lower_rad, row.half_width) for row in table.itertuples()]
                keys = {"primitive": name, "model": model, "baseline": baseline}
                tables.append(table.assign(**keys, verdict=found))
        return pd.concat(tables, ignore_index=True)

    def ratio(self, model: str, baseline: str = NOMINAL, primitive: str = "all") -> pd.DataFrame:
        """Rows of `ratios` by setting."""
        table = self.ratios
        chosen = (table["model"] == model) & (table["baseline"] == baseline)
        return table[chosen & (table["primitive"] == primitive)].set_index("setting_deg")

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
                    rows.append(row | {"verdict": verdict(lower, half_width)})
        return pd.DataFrame(rows)

    @cached_property
    def hand_roll(self) -> pd.DataFrame:
        """Roll of the hand in the setting `example_deg`, 0 where the tool is flat on the level board.

        Means and std over the runs, per `model` and `moment` (0: start, k: end of primitive k).
        """
        rows = []
        for model, runs in self.examples.items():
            readings = np.array([_hand_readings(run, self.axis) for run in runs])
            spread = readings.std(axis=0, ddof=1) if len(runs) > 1 else np.full(readings.shape[1], np.nan)
            for moment, (mean, std) in enumerate(zip(readings.mean(axis=0), spread, strict=True)):
                rows.append((model, moment, mean, std))
        return pd.DataFrame(rows, columns=["model", "moment", "mean_deg", "std_deg"])


ALL = "all"
"""In `BoardResults.ratios`: the cost summed over the primitives."""


def verdict(gain: float, half_width: float) -> str:
    """Better or worse if the interval of a gain excludes zero; undecided otherwise."""
    if gain - half_width > 0.0:
        return BETTER
    return WORSE if gain + half_width < 0.0 else UNDECIDED


def hand_roll_deg(run: Demonstration, axis: np.ndarray) -> np.ndarray:
    """Roll of the hand about an axis (3,) of the base frame, (T,); 0: the tool is flat on a level board."""
    flat = np.broadcast_to(FLAT_ORIENTATION, run.orientation.shape)
    return np.degrees(quaternion.difference(run.orientation, flat) @ axis)


def tool_roll_deg(run: Demonstration, axis: np.ndarray) -> np.ndarray:
    """Roll of the tool relative to the board, (T,); 0 where it lies flat."""
    return np.degrees(quaternion.rotation_vector(run.tool_to_board) @ axis)


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


def _hand_readings(run: Demonstration, axis: np.ndarray) -> list[float]:
    """At the start, and at the end of every primitive."""
    roll = hand_roll_deg(run, axis)
    moments = [0, *(round(end / run.dt) for end in run.true_segments[:, 1])]
    return [float(roll[min(moment, len(roll) - 1)]) for moment in moments]
