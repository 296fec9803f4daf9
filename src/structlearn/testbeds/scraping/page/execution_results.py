"""Executions of several models on the board in pairs: what the evaluations before and after trial share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
import pandas as pd

from structlearn.core import quaternion
from structlearn.core.metrics import verdict
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.claims import Evidence
from structlearn.testbeds.scraping.protocol.execution_scores import NOMINAL, cost_ratios
from structlearn.testbeds.scraping.world.layout import FLAT_ORIENTATION

ALL = "all"  # In `ExecutionResults.ratios`: the cost summed over the primitives


@dataclass(frozen=True)
class ExecutionResults:
    """Executions of models in all settings; runs of equal name met equal conditions."""

    scores: pd.DataFrame  # of `execution_scores.scores`
    examples: Mapping[str, Sequence[Demonstration]]  # all executions in the setting `example_deg`, by model
    example_deg: float  # setting that is shown in detail
    axis: np.ndarray  # (3,) roll axis

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
    def costs(self) -> pd.DataFrame:
        """Mean and std over the runs of the accumulated cost, per primitive, model and setting."""
        grouped = self.scores.groupby(["primitive", "model", "setting_deg"], sort=False)["cost_rad"]
        return grouped.agg(["mean", "std"]).reset_index()

    @cached_property
    def ratios(self) -> pd.DataFrame:
        """Accumulated cost of each model relative to each of those before it, in pairs.

        One row per `primitive` ("all" is their sum), `model`, `baseline` and `setting_deg`: `ratio`,
        `lower_rad`, `half_width` of `execution_scores.cost_ratios`, and the `verdict` on the model.
        """
        tables = []
        for name in (*self.primitives, ALL):
            chosen = self.scores if name == ALL else self.scores[self.scores["primitive"] == name]
            for baseline, model in combinations(self.models, 2):
                table = cost_ratios(chosen, model, baseline)
                low, high = table["lower_rad"] - table["half_width"], table["lower_rad"] + table["half_width"]
                keys = {"primitive": name, "model": model, "baseline": baseline}
                tables.append(table.assign(**keys, verdict=verdict(low, high)))
        return pd.concat(tables, ignore_index=True)

    def ratio(self, model: str, baseline: str = NOMINAL, primitive: str = ALL) -> pd.DataFrame:
        """Rows of `ratios` by setting."""
        table = self.ratios
        chosen = (table["model"] == model) & (table["baseline"] == baseline)
        return table[chosen & (table["primitive"] == primitive)].set_index("setting_deg")

    def run_costs(self, model: str, setting_deg: float, primitive: str) -> np.ndarray:
        """(R,) accumulated cost in rad of every run, in the order of their names."""
        keys = {"model": model, "setting_deg": setting_deg, "primitive": primitive}
        chosen = (self.scores[list(keys)] == pd.Series(keys)).all(axis=1)
        return self.scores[chosen].sort_values("run")["cost_rad"].to_numpy()

    @cached_property
    def hand_roll(self) -> pd.DataFrame:
        """Roll of the hand in the setting `example_deg`, 0 where the tool is flat on the level board.

        Means and std over the runs, per `model` and `moment` (0: start, k: end of primitive k).
        """
        rows = []
        for model, runs in self.examples.items():
            readings = np.array([hand_roll_deg(run, self.axis)[moments(run)] for run in runs])
            spread = readings.std(axis=0, ddof=1) if len(runs) > 1 else np.full(readings.shape[1], np.nan)
            for moment, (mean, std) in enumerate(zip(readings.mean(axis=0), spread, strict=True)):
                rows.append((model, moment, mean, std))
        return pd.DataFrame(rows, columns=["model", "moment", "mean_deg", "std_deg"])


def hand_roll_deg(run: Demonstration, axis: np.ndarray) -> np.ndarray:
    """Roll of the hand about an axis (3,) of the base frame, (T,); 0: the tool is flat on a level board."""
    orientation = run.signal("orientation")
    flat = np.broadcast_to(FLAT_ORIENTATION, orientation.shape)
    return np.degrees(quaternion.difference(orientation, flat) @ axis)


def tool_roll_deg(run: Demonstration, axis: np.ndarray) -> np.ndarray:
    """Roll of the tool relative to the board, (T,); 0 where it lies flat."""
    return np.degrees(quaternion.rotation_vector(run.signal("tool_to_board")) @ axis)


def moments(run: Demonstration) -> list[int]:
    """Samples of an execution's start, and of the end of every primitive."""
    last = len(run.time) - 1
    return [0, *(min(round(end / run.dt), last) for end in run.signal("true_segments")[:, 1])]


def welch(first: np.ndarray, second: np.ndarray) -> Evidence:
    """Mean of first minus second of independent runs, with Welch's interval; none of a single run."""
    from scipy import stats

    value, count = float(np.mean(first) - np.mean(second)), min(len(first), len(second))
    if count < 2:
        return Evidence(value, np.nan, np.nan, count)
    found = stats.ttest_ind(first, second, equal_var=False).confidence_interval()
    return Evidence(value, float(found.low), float(found.high), count)
