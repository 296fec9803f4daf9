"""Refinement by trial (IV.7, IV.9.4): what stages and studies wrote, and what follows from it."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.core.metrics import BETTER, UNDECIDED, WORSE, mean_interval, verdict
from structlearn.policy_search.refinement import FEEDBACK
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.claims import Evidence
from structlearn.reporting.document import Table
from structlearn.reporting.studies import Study
from structlearn.testbeds.scraping.page.execution_results import ExecutionResults, welch
from structlearn.testbeds.scraping.protocol.board_refinement import BoardRefinementParameters
from structlearn.testbeds.scraping.protocol.execution_scores import AFTER, BEFORE

PUBLISHED_ITERATIONS = 2
"""After which both primitives had converged (IV.9.4.1); also in `published.yaml`, for sentences."""


@dataclass(frozen=True)
class RefinementResults(ExecutionResults):
    """Executions without feedback, before and after refinement; `example_deg` is the tilt refined on."""

    history: pd.DataFrame  # of `refinement.history_rows`, with `primitive`
    search: pd.DataFrame  # of `sample_efficiency.compare`, with `primitive`; empty where not made
    parameters: BoardRefinementParameters

    @cached_property
    def refined(self) -> list[str]:
        """Primitives that were refined, in order of time."""
        return list(self.history["primitive"].unique())

    @cached_property
    def seen_deg(self) -> list[float]:
        """Executed settings of whose demonstrations the models were learned."""
        return [setting for setting in self.settings_deg if setting in self.parameters.settings_deg]

    @cached_property
    def unseen_deg(self) -> list[float]:
        """Executed tilts that were neither learned from nor refined on."""
        known = (*self.parameters.settings_deg, self.example_deg)
        return [setting for setting in self.tilted_deg if setting not in known]

    def role(self, setting: float) -> str:
        """What a setting was to the models, in one word."""
        if setting == self.example_deg:
            return "refined"
        if setting in self.seen_deg:
            return "learned"
        return "default" if setting == 0.0 else "unseen"

    @cached_property
    def evaluated(self) -> bool:
        """Whether the tilt refined on is among the executed settings."""
        return self.example_deg in self.settings_deg

    @cached_property
    def kept(self) -> dict[str, int]:
        """By primitive, the iteration whose network is kept: fewest failures, then lowest mean cost."""
        curves = {name: self.curve(name)[["failed", "mean"]] for name in self.refined}
        return {name: int(rows.sort_values(["failed", "mean"]).index[0]) for name, rows in curves.items()}

    @cached_property
    def curves(self) -> pd.DataFrame:
        """Figure IV.19: cost over the iterations, of the rollouts that did not fail.

        One row per `primitive`, `iteration` and `kind`: `mean`, `std`, `low`, `high` (extremes) of the
        accumulated cost in rad, `count` of rollouts, `norm_rad` (mean), and `failed` ones.
        """
        rows = []
        keys = ["primitive", "iteration", "kind"]
        for key, group in self.history.groupby(keys, sort=False):
            cost = group["cost_rad"]
            row = dict(zip(keys, key, strict=True))
            row |= {"mean": cost.mean(), "std": cost.std(), "low": cost.min(), "high": cost.max()}
            row |= {"count": len(group), "norm_rad": group["norm_rad"].mean()}
            rows.append(row | {"failed": int((group["fault"] != "").sum())})
        return pd.DataFrame(rows)

    def curve(self, primitive: str, kind: str = FEEDBACK) -> pd.DataFrame:
        """Rows of `curves` by iteration; with the network they begin before the refinement."""
        chosen = (self.curves["primitive"] == primitive) & (self.curves["kind"] == kind)
        return self.curves[chosen].set_index("iteration")

    def later_gain(self, primitive: str) -> float:
        """By how much of the cost before the best iteration after `PUBLISHED_ITERATIONS` is below that one.

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
            runs = self._rows(name)
            wide = runs[runs["kind"] == FEEDBACK].pivot_table("cost_rad", "number", "iteration")
            for iteration in wide.columns[1:]:
                row = {"primitive": name, "iteration": iteration}
                row |= _gain(wide[iteration - 1] - wide[iteration], "")
                if iteration > PUBLISHED_ITERATIONS:
                    row |= _gain(wide[PUBLISHED_ITERATIONS] - wide[iteration], "since_")
                rows.append(row)
        columns = [f"{prefix}{part}" for prefix in ("", "since_") for part in GAIN]
        return pd.DataFrame(rows, columns=["primitive", "iteration", *columns])

    def later(self, primitive: str) -> pd.DataFrame:
        """Rows of `progress` after iteration `PUBLISHED_ITERATIONS`."""
        rows = self.progress[self.progress["primitive"] == primitive]
        return rows[rows["iteration"] > PUBLISHED_ITERATIONS]

    @cached_property
    def between(self) -> pd.DataFrame:
        """Whether a tilt that was never seen costs between its neighbours.

        One row per `primitive`, `model` (before, after) and `setting_deg`: `below_deg`, `above_deg`, the
        nearest tilts; `mean`, `mean_below`, `mean_above` in rad; the `verdict` of `margins`.
        """
        rows = []
        for setting in self.unseen_deg:
            place = self.tilted_deg.index(setting)
            if 0 < place < len(self.tilted_deg) - 1:
                near = (self.tilted_deg[place - 1], setting, self.tilted_deg[place + 1])
                for name in self.primitives:
                    for model in (BEFORE, AFTER):
                        means = [self.run_costs(model, one, name).mean() for one in near]
                        row = {"primitive": name, "model": model, "setting_deg": setting}
                        row |= {"below_deg": near[0], "above_deg": near[2]}
                        row |= dict(zip(("mean_below", "mean", "mean_above"), means, strict=True))
                        found = [str(verdict(one.low, one.high)) for one in self.margins(name, model, near)]
                        rows.append(row | {"verdict": _worst(found)})
        return pd.DataFrame(rows)

    def margins(
        self, primitive: str, model: str, near: tuple[float, float, float]
    ) -> tuple[Evidence, Evidence]:
        """By how many rad the middle one of three tilts costs more than the cheaper and less than the dearer.

        Intervals are Welch's over the runs, which at different tilts are no pairs.
        """
        below, own, above = (self.run_costs(model, setting, primitive) for setting in near)
        low, high = sorted((below, above), key=np.mean)
        return welch(own, low), welch(high, own)

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
        keys = ["primitive", "method", "rollouts"]
        grouped = self.search.groupby(keys, sort=False)["cost_rad"]
        found = grouped.agg(mean="mean", low="min", high="max", known="count").reset_index()
        return found.sort_values(keys, kind="stable", ignore_index=True)

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
        rows = self.scores[self.scores["setting_deg"] == self.example_deg]
        total = rows.groupby(["model", "run"])["cost_rad"].sum()
        gain = total[BEFORE] - total[AFTER]
        name = (gain - gain.mean()).abs().idxmin()
        before, after = ({run.name: run for run in self.examples[model]} for model in (BEFORE, AFTER))
        return before[name], after[name]

    def _rows(self, primitive: str) -> pd.DataFrame:
        return self.history[self.history["primitive"] == primitive]


GAIN = ("lower_rad", "half_width", "verdict")


def _gain(difference: pd.Series, prefix: str) -> dict[str, object]:
    """Mean of paired differences, its half width and verdict; pairs of which one failed are left out."""
    known = difference.dropna().to_numpy()
    lower, half_width = mean_interval(known) if len(known) else (np.nan, np.nan)
    values = (lower, half_width, str(verdict(lower - half_width, lower + half_width)))
    return dict(zip((f"{prefix}{part}" for part in GAIN), values, strict=True))


def _worst(verdicts: list[str]) -> str:
    return next((word for word in (WORSE, UNDECIDED) if word in verdicts), BETTER)


ADDED, EXPLORATION = "scraping/added_executions", "scraping/exploration"
"""Studies of parameters that the page shows."""


def study_tables(studies: Mapping[str, Study | None], numbers: Mapping[str, int]) -> dict[str, Table]:
    """A row per variant of the two studies of parameters, mean and interval over the exploration's seeds.

    `studies`: by name; tables of those that were not run are left out. `numbers`: of the refined primitives,
    from 1, by name.
    """
    costs = {f"rl_cost_ratio_prim{number}": f"{name}: cost" for name, number in numbers.items()}
    costs |= {"seen_cost_ratio_after_over_before_max": "seen: cost"}
    searched = {f"search_cost_pi2_prim{number}": f"{name}: search (rad)" for name, number in numbers.items()}
    shown = {"refinement_added": (ADDED, costs), "refinement_exploration": (EXPLORATION, costs | searched)}
    return {
        table: study.summary(columns)
        for table, (name, columns) in shown.items()
        if (study := studies.get(name)) is not None
    }
