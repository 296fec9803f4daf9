"""Refinement by trial (IV.7, IV.9.4): what stages and studies wrote, and the numbers that follow.

Of each person of the study `scraping/people` the whole branch was run anew, demonstrations, sensor, models
and refinement, once with the parameters as they are (`ours`) and once as in the text (`text`). The numbers
are those of `details.json` by the same keys. So a refinement is one number, judged over people.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.core.artefacts import Metrics
from structlearn.core.metrics import BETTER, UNDECIDED, WORSE, mean_interval, verdict
from structlearn.policy_search.refinement import FEEDBACK
from structlearn.policy_search.sample_efficiency import CMA_ES, PI2
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.claims import Evidence, Found, by_case, geometric_mean, mean
from structlearn.reporting.document import Table
from structlearn.reporting.prose import level_name
from structlearn.reporting.studies import Study
from structlearn.testbeds.scraping.page.execution_results import ALL, ExecutionResults, welch
from structlearn.testbeds.scraping.protocol.board_refinement import BoardRefinementParameters
from structlearn.testbeds.scraping.protocol.execution_scores import AFTER, BEFORE, NOMINAL

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

    def metrics(self, number: Callable[[str], int]) -> Metrics:
        """Key figures; what was not executed is left out.

        `rl_cost_before_prim<number>` and `rl_cost_after_prim<number>` are the mean accumulated cost in rad at
        the tilt refined on, `rl_cost_ratio_prim<number>` is the latter over the former, and
        `rl_cost_ratio_at_<tilt>` at any tilt, summed over the primitives;
        `seen_cost_ratio_after_over_before_max` is the largest of these over the settings learned from.
        `rl_over_nominal_max_prim<number>` is the largest ratio to the cost without feedback over all tilts,
        before and after; `rl_over_nominal_0` that after, of all primitives, on the level board.
        `rl_between_<model>_prim<number>` is by how many rad a tilt never seen costs more than the cheaper and
        less than the dearer of its neighbours, whichever is less. `rl_later_gain_prim<number>`: see
        `later_gain`; `rl_kept_iteration_prim<number>`: see `kept`. `rl_rollouts` are all,
        `rl_failed_rollouts` those that failed. `search_cost_<method>_prim<number>` is the mean cost of what
        the searches ended with.
        """
        values: dict[str, float] = {}
        for name in self.refined if self.evaluated else ():
            before, after = (
                float(self.run_costs(model, self.example_deg, name).mean()) for model in (BEFORE, AFTER)
            )
            values |= {f"rl_cost_before_prim{number(name)}": before}
            values |= {f"rl_cost_after_prim{number(name)}": after}
            values |= {f"rl_cost_ratio_prim{number(name)}": after / before}
        ratios = self.ratio(AFTER, BEFORE, ALL)["ratio"]
        values |= {f"rl_cost_ratio_at_{level_name(tilt)}": float(ratios[tilt]) for tilt in self.tilted_deg}
        if self.seen_deg:
            values["seen_cost_ratio_after_over_before_max"] = float(ratios[self.seen_deg].max())
        for name in self.primitives if self.tilted_deg else ():
            worst = [
                self.ratio(one, NOMINAL, name)["ratio"][self.tilted_deg].max() for one in (BEFORE, AFTER)
            ]
            values[f"rl_over_nominal_max_prim{number(name)}"] = float(max(worst))
        if 0.0 in self.settings_deg:
            values["rl_over_nominal_0"] = float(self.ratio(AFTER).loc[0.0, "ratio"])
        for row in self.between.itertuples():
            low, high = sorted((row.mean_below, row.mean_above))
            key = f"rl_between_{row.model}_prim{number(row.primitive)}"
            values[key] = min(values.get(key, np.inf), row.mean - low, high - row.mean)
        for name in self.refined:
            values[f"rl_kept_iteration_prim{number(name)}"] = self.kept[name]
            values[f"rl_later_gain_prim{number(name)}"] = self.later_gain(name)
        values["rl_rollouts"] = len(self.history)
        values["rl_failed_rollouts"] = int(self.faults["rollouts"].sum())
        for method in (PI2, CMA_ES) if len(self.search) else ():
            for name in self.searched_primitives:
                cost = self.searched["mean"].get((name, method), np.nan)
                values[f"search_cost_{method}_prim{number(name)}"] = float(cost)
        return {name: value for name, value in values.items() if np.isfinite(value)}

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


PEOPLE, ADDED, EXPLORATION = "scraping/people", "scraping/added_executions", "scraping/exploration"
STUDIES = (PEOPLE, ADDED, EXPLORATION)  # That the page rests on
FORMS = ("text", "ours")  # Variants of the study over people

Studies = Mapping[str, Study | None]


def refinement_evidence(
    results: RefinementResults, studies: Studies, number: Callable[[str], int]
) -> dict[str, Found]:
    """Of the page on refinement by trial; nothing where no people were studied.

    `results`: of the person shown, which say what was executed; their numbers decide nothing. `studies`: by
    name.
    """
    found: dict[str, Found] = {}
    for form, people in _by_form(studies, number(results.refined[0])).items():
        found |= _of_form(form, people, results, number)
    return found


def _by_form(studies: Studies, number: int) -> dict[str, Study]:
    """The study over people, once per form of which it says what became of a primitive."""
    people = studies.get(PEOPLE)
    if people is None or f"rl_cost_ratio_prim{number}" not in people.table:
        return {}
    return {form: people for form in FORMS if (people.table["variant"] == form).any()}


def _of_form(
    form: str, people: Study, results: RefinementResults, number: Callable[[str], int]
) -> dict[str, Found]:
    def of(key: str, name: str = "") -> np.ndarray:
        key = f"{key}_prim{number(name)}" if name else key
        return people.values(form, key) if key in people.table else np.array([np.nan])

    refined, executed = results.refined, results.primitives
    found: dict[str, Found] = {
        "lower": by_case(geometric_mean, {name: (of("rl_cost_ratio", name),) for name in refined}),
        "converged": by_case(mean, {name: (of("rl_later_gain", name),) for name in refined}),
        "seen": by_case(
            geometric_mean,
            {f"{tilt:g}°": (of(f"rl_cost_ratio_at_{level_name(tilt)}"),) for tilt in results.seen_deg},
        ),
        "between": by_case(
            mean,
            {
                f"{name}, {model}": (of(f"rl_between_{model}", name),)
                for name in executed
                for model in ((BEFORE, AFTER) if form == "text" else (AFTER,))  # before, both are the same
            },
        ),
        "level_board": geometric_mean(of("rl_over_nominal_0")),
        "search": by_case(
            geometric_mean,
            {name: (of("search_cost_pi2", name) / of("search_cost_cma_es", name),) for name in refined},
        ),
    }
    if form == "text":  # before refinement both are the same, and cost more than after
        found["nominal_is_worst"] = by_case(
            geometric_mean, {name: (of("rl_over_nominal_max", name),) for name in executed}
        )
    return {f"{name}_{form}": one for name, one in found.items()}


def population_metrics(studies: Studies, numbers: Sequence[int]) -> Metrics:
    """`rl_cost_ratio_prim<number>_mean` and `_worst` over people, `seen_cost_ratio_mean`.

    Means are geometric; `seen_cost_ratio_mean` is that of `seen_cost_ratio_after_over_before_max`. Numbers of
    the published form end with `_text`. Nothing where no people were studied.

    `studies`: by name.
    """
    values: Metrics = {}
    for form, people in _by_form(studies, numbers[0]).items():
        ending = "" if form == "ours" else f"_{form}"
        for number in numbers:
            ratios = people.values(form, f"rl_cost_ratio_prim{number}")
            values[f"rl_cost_ratio_prim{number}_mean{ending}"] = geometric_mean(ratios).value
            values[f"rl_cost_ratio_prim{number}_worst{ending}"] = float(ratios.max())
        seen = people.values(form, "seen_cost_ratio_after_over_before_max")
        values[f"seen_cost_ratio_mean{ending}"] = geometric_mean(seen).value
    return values


def study_tables(studies: Studies, numbers: Mapping[str, int]) -> dict[str, Table]:
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
