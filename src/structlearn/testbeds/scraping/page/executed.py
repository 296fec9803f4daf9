"""Executions of several models on the board in pairs, and their refinement by trial (IV.9.3, IV.9.4)."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product

import numpy as np
import pandas as pd

from structlearn.core.metrics import matching, mean_interval, verdict
from structlearn.policy_search.refinement import FEEDBACK
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.claims import Evidence
from structlearn.testbeds.scraping.protocol.board_refinement import BoardRefinementParameters
from structlearn.testbeds.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL, cost_ratios
from structlearn.testbeds.scraping.world.layout import hand_roll_deg

ALL = "all"  # In `ExecutionResults.ratios`: the cost summed over the primitives
PUBLISHED_ITERATIONS = 2
"""After which both primitives had converged (IV.9.4.1); also in `published.yaml`, for sentences."""


@dataclass(frozen=True)
class ExecutionResults:
    """Executions of models in all settings; runs of equal name met equal conditions."""

    scores: pd.DataFrame  # of `execution_scores.scores`
    examples: Mapping[str, Sequence[Demonstration]]  # all executions in the setting `example_deg`, by model
    example_deg: float  # setting that is shown in detail
    axis: np.ndarray  # (3,) roll axis

    @property
    def settings_deg(self) -> list[float]:
        """Rolls of the board, rising."""
        return np.unique(self.scores["setting_deg"]).tolist()

    @property
    def tilted_deg(self) -> list[float]:
        """Rolls of the board that are not the default."""
        return [setting for setting in self.settings_deg if setting != 0.0]

    @property
    def adapted(self) -> list[str]:
        """Primitives with feedback, in order of time."""
        return list(self.scores["primitive"].unique())

    @property
    def models(self) -> list[str]:
        """Names of the executed sets, the one without feedback first."""
        return list(self.scores["model"].unique())

    @property
    def runs(self) -> int:
        """Executions per setting and model."""
        return self.scores["run"].nunique()

    @cached_property
    def costs(self) -> pd.DataFrame:
        """Mean and std over the runs of the accumulated cost, per primitive, model and setting."""
        grouped = self.scores.groupby(["primitive", "model", "setting_deg"], sort=False)["cost_rad"]
        return grouped.agg(["mean", "std"]).reset_index()

    @cached_property
    def ratios(self) -> pd.DataFrame:
        """Accumulated cost of each model relative to each of those before it, in pairs.

        One row per `primitive` ("all" is their sum), `model`, `baseline` and `setting_deg`: columns of
        `execution_scores.cost_ratios`, and the `verdict` on the model.
        """
        tables = []
        for name, (baseline, model) in product((*self.adapted, ALL), combinations(self.models, 2)):
            chosen = self.scores if name == ALL else matching(self.scores, primitive=name)
            table = cost_ratios(chosen, model, baseline)
            low, high = table["lower_rad"] - table["half_width"], table["lower_rad"] + table["half_width"]
            keys = {"primitive": name, "model": model, "baseline": baseline}
            tables.append(table.assign(**keys, verdict=verdict(low, high)))
        return pd.concat(tables, ignore_index=True)

    def ratio(self, model: str, baseline: str = NOMINAL, primitive: str = ALL) -> pd.DataFrame:
        """Rows of `ratios` by setting."""
        rows = matching(self.ratios, model=model, baseline=baseline, primitive=primitive)
        return rows.set_index("setting_deg")

    def run_costs(self, model: str, setting_deg: float, primitive: str) -> np.ndarray:
        """(R,) accumulated cost in rad of every run, in the order of their names."""
        runs = matching(self.scores, model=model, setting_deg=setting_deg, primitive=primitive)
        return runs.sort_values("run")["cost_rad"].to_numpy()

    @cached_property
    def hand_roll(self) -> pd.DataFrame:
        """Mean and std of the hand's roll in the setting `example_deg`; 0 is flat on a level board.

        One row per `model` and `moment` (0: start, k: end of primitive k).
        """
        rows = []
        for model, runs in self.examples.items():
            readings = pd.DataFrame([hand_roll_deg(run, self.axis)[moments(run)] for run in runs])
            for moment, (mean, std) in enumerate(zip(readings.mean(), readings.std(), strict=True)):
                rows.append((model, moment, mean, std))
        return pd.DataFrame(rows, columns=["model", "moment", "mean_deg", "std_deg"])


@dataclass(frozen=True)
class RefinementResults(ExecutionResults):
    """Executions without feedback, before and after refinement; `example_deg` is the tilt refined on."""

    history: pd.DataFrame  # of `refinement.history_rows`, with `primitive`
    search: pd.DataFrame  # of `sample_efficiency.compare`, with `primitive`; empty where not made
    parameters: BoardRefinementParameters

    @property
    def refined(self) -> list[str]:
        """Primitives that were refined, in order of time."""
        return list(self.history["primitive"].unique())

    @property
    def seen_deg(self) -> list[float]:
        """Executed settings of whose demonstrations the models were learned."""
        return [setting for setting in self.settings_deg if setting in self.parameters.settings_deg]

    @property
    def unseen_deg(self) -> list[float]:
        """Executed tilts that were neither learned from nor refined on."""
        return [setting for setting in self.settings_deg if self.role(setting) == "unseen"]

    def role(self, setting: float) -> str:
        """What a setting was to the models, in one word."""
        if setting == self.example_deg:
            return "refined"
        if setting in self.parameters.settings_deg:
            return "learned"
        return "default" if setting == 0.0 else "unseen"

    @property
    def evaluated(self) -> bool:
        """Whether the tilt refined on is among the executed settings."""
        return self.example_deg in self.settings_deg

    @cached_property
    def curves(self) -> pd.DataFrame:
        """Figure IV.19: cost over the iterations, of the rollouts that did not fail.

        One row per `primitive`, `iteration` and `kind`: `mean`, `std`, `low`, `high` (extremes) of the
        accumulated cost in rad, `count` of rollouts, `norm_rad` (mean), and `failed` ones.
        """
        failed = self.history["fault"] != ""
        grouped = self.history.assign(failed=failed).groupby(["primitive", "iteration", "kind"], sort=False)
        return grouped.agg(
            mean=("cost_rad", "mean"),
            std=("cost_rad", "std"),
            low=("cost_rad", "min"),
            high=("cost_rad", "max"),
            count=("fault", "size"),
            norm_rad=("norm_rad", "mean"),
            failed=("failed", "sum"),
        ).reset_index()

    def curve(self, primitive: str, kind: str = FEEDBACK) -> pd.DataFrame:
        """Rows of `curves` by iteration; with the network they begin before the refinement."""
        return matching(self.curves, primitive=primitive, kind=kind).set_index("iteration")

    def kept(self, primitive: str) -> int:
        """Iteration whose network is kept: fewest failures, then lowest mean cost."""
        return int(self.curve(primitive).sort_values(["failed", "mean"]).index[0])

    def later_gain(self, primitive: str) -> float:
        """Share of the cost before that the best iteration gains after `PUBLISHED_ITERATIONS`.

        Negative where all later ones cost more; NaN where there is none.
        """
        cost = self.curve(primitive)["mean"]
        later = cost[cost.index > PUBLISHED_ITERATIONS]
        return float((cost[PUBLISHED_ITERATIONS] - later.min()) / cost[0]) if len(later) else np.nan

    @cached_property
    def progress(self) -> pd.DataFrame:
        """What every iteration gained, in pairs: numbered runs meet equal conditions in all iterations.

        One row per `primitive` and `iteration` from 1: mean paired difference `lower_rad` to the iteration
        before and `since_lower_rad` to iteration `PUBLISHED_ITERATIONS` (missing up to it), each with half
        width and verdict.
        """
        rows = []
        for name in self.refined:
            runs = matching(self.history, primitive=name, kind=FEEDBACK)
            wide = runs.pivot_table("cost_rad", "number", "iteration")
            for iteration in wide.columns[1:]:
                later = iteration > PUBLISHED_ITERATIONS
                since = _gain(wide[PUBLISHED_ITERATIONS] - wide[iteration]) if later else (np.nan,) * 3
                rows.append((name, iteration, *_gain(wide[iteration - 1] - wide[iteration]), *since))
        gain = ["lower_rad", "half_width", "verdict"]
        columns = ["primitive", "iteration", *gain, *(f"since_{part}" for part in gain)]
        return pd.DataFrame(rows, columns=columns)

    @cached_property
    def between(self) -> pd.DataFrame:
        """Whether a tilt that was never seen costs between its neighbours.

        One row per `primitive`, `model` (before, after) and `setting_deg`: `below_deg`, `above_deg`, the
        nearest tilts; `mean`, `mean_below`, `mean_above` in rad; the `verdict` on both margins, of which the
        less favourable one counts. Intervals are Welch's: runs at different tilts are no pairs.
        """
        tilts, rows = self.tilted_deg, []
        for below, setting, above in zip(tilts, tilts[1:], tilts[2:], strict=False):
            for name, model in product(self.adapted if setting in self.unseen_deg else (), (BEFORE, AFTER)):
                costs = [self.run_costs(model, one, name) for one in (below, setting, above)]
                low, high = sorted((costs[0], costs[2]), key=np.mean)
                margins = welch(costs[1], low), welch(high, costs[1])
                ends = np.min([(one.low, one.high) for one in margins], axis=0)
                means = dict(zip(("mean_below", "mean", "mean_above"), map(np.mean, costs), strict=True))
                keys = {"primitive": name, "model": model, "setting_deg": setting}
                tilts_beside = {"below_deg": below, "above_deg": above}
                rows.append({**keys, **tilts_beside, **means, "verdict": str(verdict(*ends))})
        return pd.DataFrame(rows)

    @cached_property
    def faults(self) -> pd.DataFrame:
        """Rollouts that failed: `primitive`, `fault` with its numbers left out, `rollouts`."""
        failed = self.history[self.history["fault"] != ""]
        kinds = failed["fault"].map(lambda fault: re.sub(r"\d+(\.\d+)?", "…", fault)).rename("fault")
        return failed.groupby(["primitive", kinds], sort=False).size().rename("rollouts").reset_index()

    @cached_property
    def searches(self) -> pd.DataFrame:
        """Cost of the mean policy over rollouts: mean, `low` and `high` of the searches.

        One row per `primitive`, `method` and `rollouts`; `known` counts the searches whose mean policy did
        not fail.
        """
        grouped = self.search.groupby(["primitive", "method", "rollouts"])["cost_rad"]
        return grouped.agg(mean="mean", low="min", high="max", known="count").reset_index()

    @property
    def searched_primitives(self) -> list[str]:
        """Primitives whose policies were searched by both methods, in order of time."""
        known = self.search["primitive"].unique() if len(self.search) else ()
        return [name for name in self.refined if name in known]

    @cached_property
    def searched(self) -> pd.DataFrame:
        """Where the searches ended, by primitive and method.

        The last rows of `searches`, with `seeds` (number of searches), `updates` and `failed` (rollouts) of
        all, `start_rad`, the cost of the policy that they began with, and `best_rad`, of the best rollout.
        """
        keys = ["primitive", "method"]
        begun = self.search[self.search["update"] == 0].groupby(keys)
        ended = self.search.groupby([*keys, "seed"]).tail(1).groupby(keys)
        last = self.searches.groupby(keys).tail(1).set_index(keys)
        return last.assign(
            seeds=ended.size(),
            updates=ended["update"].max(),
            failed=ended["failed"].sum(),
            start_rad=begun["cost_rad"].mean(),
            best_rad=ended["best_rad"].min(),
        )

    @cached_property
    def pair(self) -> tuple[Demonstration, Demonstration]:
        """Executions before and after under the same conditions; of all pairs that which gained the mean."""
        rows = matching(self.scores, setting_deg=self.example_deg)
        total = rows.groupby(["model", "run"])["cost_rad"].sum()
        gain = total[BEFORE] - total[AFTER]
        name = (gain - gain.mean()).abs().idxmin()
        before, after = ({run.name: run for run in self.examples[model]} for model in (BEFORE, AFTER))
        return before[name], after[name]


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


def _gain(difference: pd.Series) -> tuple[float, float, str]:
    """Mean of paired differences, its half width and verdict; pairs of which one failed are left out."""
    known = difference.dropna().to_numpy()
    lower, half_width = mean_interval(known) if len(known) else (np.nan, np.nan)
    return lower, half_width, str(verdict(lower - half_width, lower + half_width))
