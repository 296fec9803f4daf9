"""Evidence on the magnetic skin, by the names that `skin_claims.yaml` uses."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.reporting.claims import Evidence, Found, by_case, mean, unknown
from structlearn.tasks.public import public_names

STRUCTURED, PLAIN, COMPONENTS, _ = public_names.SKIN_MODELS
RIDGE = next(iter(public_names.SKIN_FORCE))

ARROW = "\N{RIGHTWARDS ARROW}"

MISSING = unknown("no runs for it are recorded here")


@dataclass(frozen=True)
class SkinRuns:
    """The tables of the skin, with runs called `run 1`, `run 2` in the order of their times.

    Blocks of places are what is independent in a run, as far as anything is: presses of a block lie together.
    Seeds are averaged before.
    """

    tables: Mapping[str, pd.DataFrame]
    tuned_on: tuple[str, ...]

    @cached_property
    def places(self) -> list[str]:
        """Runs over places, by name."""
        return self._named("errors")

    @cached_property
    def numbers(self) -> dict[str, str]:
        """What runs are called, those over places and those on a scale apart."""
        scales = enumerate(self._named("force"), 1)
        return {name: f"run {number}" for number, name in enumerate(self.places, 1)} | {
            name: f"scale run {number}" for number, name in scales
        }

    def __getitem__(self, name: str) -> pd.DataFrame:
        """A table with the runs' numbers."""
        table = self.tables[name]
        columns = [column for column in ("run", "learned_from", "asked_about") if column in table]
        return table.assign(**{column: table[column].map(self.numbers) for column in columns})

    def by_block(self, new: str, error: str, model: str = STRUCTURED) -> pd.Series:
        """Errors by `learned_from`, `asked_about` and `block`, mean over seeds; none where there are none."""
        if "errors" not in self.tables:
            return pd.Series(dtype=float)
        table = self.tables["errors"]
        its = table[(table["new"] == new) & (table["model"] == model)]
        return its.groupby(["learned_from", "asked_about", "block"])[error].mean().dropna()

    def held_out(self, error: str, model: str = STRUCTURED) -> pd.Series:
        """Errors on blocks held out of runs on which no constant was chosen."""
        found = self.by_block(public_names.SKIN_NEW_BLOCKS, error, model)
        return (
            found[[run not in self.tuned_on for run in found.index.get_level_values(0)]]
            if len(found)
            else found
        )

    def tested(self, error: str, model: str = STRUCTURED) -> Evidence:
        """Mean of `held_out`."""
        return of_mean(self.held_out(error, model))

    def across(self, error: str, model: str = STRUCTURED) -> Evidence:
        """Mean over blocks of runs that were not learned from."""
        return of_mean(self.by_block(public_names.SKIN_NEW_RUN, error, model))

    def by_pair(self, found: pd.Series) -> Found:
        """Means by training and test set."""
        if not len(found):
            return MISSING
        groups = found.groupby(level=[0, 1])
        cases = {f"{self.numbers[a]} {ARROW} {self.numbers[b]}": [its.to_numpy()] for (a, b), its in groups}
        return by_case(mean, cases)

    def depth(self, model: str = STRUCTURED) -> Evidence:
        """NMSE of depth on blocks held out, of all runs in which it varies: few do."""
        return of_mean(self.by_block(public_names.SKIN_NEW_BLOCKS, "depth_nmse", model))

    def depth_runs(self) -> list[str]:
        """Runs in which depth varies."""
        found = self.by_block(public_names.SKIN_NEW_BLOCKS, "depth_nmse")
        return [self.numbers[name] for name in found.index.get_level_values(0)]

    def force(self, new: str, model: str = RIDGE) -> Evidence:
        """N, root mean square of a press, mean over presses."""
        if "force" not in self.tables:
            return MISSING
        table = self.tables["force"]
        return of_mean(table[(table["new"] == new) & (table["model"] == model)]["rms_n"])

    def worst_press(self) -> dict[str, object]:
        """Row of the largest error of `force` on another run."""
        if "force" not in self.tables:
            return {}
        table = self["force"]
        its = table[(table["new"] == public_names.SKIN_NEW_RUN) & (table["model"] == RIDGE)]
        return its.loc[its["rms_n"].idxmax()].to_dict() if len(its) else {}

    def trials(self, value: str, model: str, *controllers: str) -> pd.Series:
        """By `learned_from` and `trial`, mean over seeds and controllers."""
        if "servo" not in self.tables:
            return pd.Series(dtype=float)
        table = self.tables["servo"]
        its = table[(table["model"] == model) & table["controller"].isin(controllers)]
        return its.groupby(["learned_from", "asked_about", "trial"])[value].mean().dropna()

    def arrived(self, model: str = STRUCTURED) -> Evidence:
        """Share of trials that our controller brings to their target, mean over seeds."""
        return of_mean(self.trials("arrived", model, public_names.SKIN_SERVO))

    def way(self) -> Evidence:
        """Way over the straight one of those that arrived, geometric mean."""
        ratios = self.trials("length_ratio", STRUCTURED, public_names.SKIN_SERVO)
        found = of_mean(np.log(ratios))
        value, low, high = np.exp([found.value, found.low, found.high]).tolist()
        return Evidence(value, low, high, found.n)

    def _named(self, table: str) -> list[str]:
        return sorted(set(self.tables[table]["learned_from"])) if table in self.tables else []


def of_mean(samples: pd.Series) -> Evidence:
    """Mean of independent samples, `MISSING` of none."""
    return mean(samples.to_numpy(float)) if len(samples) else MISSING


def skin_evidence(runs: SkinRuns) -> dict[str, Found]:
    """By the names of the claims; of what is not there it is `MISSING`."""
    gain = {
        model: of_mean((runs.held_out("map_nmse", model) - runs.held_out("map_nmse")).dropna())
        for model in (PLAIN, COMPONENTS)
    }
    text, ours = (
        of_mean((runs.trials("arrived", STRUCTURED, *its) - runs.trials("arrived", PLAIN, *its)).dropna())
        for its in (public_names.SKIN_SERVO_TEXT, (public_names.SKIN_SERVO,))
    )
    return {
        "signals": runs.tested("signal_nmse"),
        "map_text": runs.tested("map_nmse"),
        "structure": gain,
        "latent": runs.tested("latent_mm"),
        "laid": runs.tested("laid_mm"),
        "cross_run": runs.by_pair(runs.by_block(public_names.SKIN_NEW_RUN, "latent_mm")),
        "pressure": {"pressure": runs.tested("pressure_nmse"), "depth": runs.depth()},
        "force": runs.force(public_names.SKIN_NEW_RUN),
        "servo_structure": text,
        "servo_structure_ours": ours,
        "servo": runs.by_pair(runs.trials("arrived", STRUCTURED, public_names.SKIN_SERVO)),
        "servo_way": runs.way(),
    }
