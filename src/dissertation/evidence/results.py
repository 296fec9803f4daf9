"""Results of a testbed: one long table, of this run and of the people (robots, seeds) that its study adds.

A testbed's `protocol/results.py` reduces what the evaluating stages wrote to rows of

    stage      name in dvc.yaml of the stage that the value was computed from
    quantity   e.g. `cost`
    value      number in `unit`
    unit       SI or as the quantity says; empty for ratios
    ...        keys, which differ by testbed: who (`person` or `seed`), and primitive, setting, model,
               variant, fold; empty text or NaN where a key does not apply

and the stage `<testbed>_results` writes them to `data/results/<testbed>.parquet`. A study keeps the same
table for other people (`reports/studies/<testbed>/<name>/results.parquet`).

A finding is a function of `Results`, one expression that shows population and pairing:

    @register.finding(mean, unit="ms")
    def least_cut_error(results):
        return results.each("cut_error", method="zvc") - results.each("cut_error", method="wls")

Rows of a study count if the parameters of the stages that they rest on are those of this run, whatever else
was changed. A finding without such rows shows this run's person, which decides nothing, beside the study's
number, which was found with other parameters.
"""

from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dissertation.evidence.studies import Study, digests
from structlearn.core.artefacts import read_table
from structlearn.core.params import read_values
from structlearn.reporting.evidence import UNKNOWN, Evidence, Found, in_words
from structlearn.reporting.findings import Findings

FOLDER = Path("data/results")
COLUMNS = ["stage", "quantity", "value", "unit"]  # of every table of results; keys follow


def long_table(
    stage: str, quantity: str, values: pd.Series | float, unit: str = "", **keys: object
) -> pd.DataFrame:
    """Rows of one quantity of a stage; levels of the index become keys, `keys` are the same in all."""
    series = values if isinstance(values, pd.Series) else pd.Series([float(values)])
    named = series.rename("value").astype(float)
    frame = named.reset_index() if any(named.index.names) else named.to_frame()
    return frame.assign(stage=stage, quantity=quantity, unit=unit, **keys)


def joined_results(parts: Iterable[pd.DataFrame], keys: Mapping[str, type]) -> pd.DataFrame:
    """Table of results from tables of `long_table`, with key columns of the given types in this order.

    Raises ValueError: a part has a key that is not listed, or two rows have the same quantity and keys.
    """
    table = pd.concat(list(parts), ignore_index=True)
    if unknown := set(table) - {*COLUMNS, *keys}:
        raise ValueError(f"results have unknown keys {sorted(unknown)}")
    table = table.reindex(columns=[*COLUMNS, *keys])
    for name, kind in keys.items():
        table[name] = (
            table[name].astype(object).fillna("").astype(str) if kind is str else table[name].astype(kind)
        )
    if (twice := table.duplicated(["quantity", *keys])).any():
        raise ValueError(f"two results have the same keys: {table[twice].iloc[0].to_dict()}")
    return table


@dataclass(frozen=True)
class Results:
    """Results by person (robot, seed), with the population that findings are about."""

    table: pd.DataFrame  # see above; each row once
    who: str  # key that counts independent samples: `person` or `seed`
    population: Collection[int] | None = None  # on whom nothing was tuned; None: all

    def rows(self, quantity: str, **keys: object) -> pd.DataFrame:
        """Rows of a quantity of the population; of keys with a list or tuple, all its values."""
        rows = self._of_population.get(quantity, self.table[:0])
        chosen = np.ones(len(rows), bool)
        for name, wanted in keys.items():
            several = isinstance(wanted, list | tuple)
            chosen &= rows[name].isin(wanted) if several else rows[name].to_numpy(object) == wanted
        return rows[chosen]

    @cached_property
    def _of_population(self) -> dict[Hashable, pd.DataFrame]:
        """Rows of the population by quantity."""
        chosen = self.table
        if self.population is not None:
            chosen = chosen[chosen[self.who].isin(list(self.population))]
        return dict(iter(chosen.groupby("quantity", sort=False)))

    def each(self, quantity: str, **keys: object) -> pd.Series:
        """One value per person, indexed by person; empty if it was not run.

        Raises ValueError: a person has several values, so that a key is missing.
        """
        rows = self.rows(quantity, **keys)
        if rows[self.who].duplicated().any():
            raise ValueError(f"several values of {quantity} for one {self.who}, given {sorted(keys)}")
        return rows.set_index(self.who)["value"].sort_index(kind="stable")

    def wide(self, quantity: str, columns: str | Sequence[str], **keys: object) -> pd.DataFrame:
        """One row per person, one column per value of the keys `columns`, in order of appearance.

        Raises ValueError: a person has several values for the same columns.
        """
        rows, columns = self.rows(quantity, **keys), [columns] if isinstance(columns, str) else list(columns)
        if rows.duplicated([self.who, *columns]).any():
            raise ValueError(f"several values of {quantity} for one {self.who} and {columns}")
        wide = rows.pivot_table("value", self.who, columns)
        order = pd.MultiIndex.from_frame(rows[columns].drop_duplicates())
        return wide.reindex(columns=order if len(columns) > 1 else order.get_level_values(0))

    def has(self, quantity: str) -> bool:
        """Whether anybody of the population has this quantity."""
        return bool(len(self.rows(quantity)))


def read_results(testbed: str, folder: Path = FOLDER) -> pd.DataFrame:
    """Results of this run. Raises InputError: the stage `<testbed>_results` has not run."""
    return read_table(folder / f"{testbed}.parquet", COLUMNS)


@dataclass(frozen=True)
class Population:
    """Results of this run joined with those of a study, as findings need them."""

    results: Results  # of the population; of a study's rows those with this run's parameters
    one: Results  # of all people of this run
    studied: Results | None  # the whole study, if some of it was made with other parameters

    @property
    def moved(self) -> bool:
        """Whether parameters of this run differ from the study's."""
        return self.studied is not None


def with_study(
    own: pd.DataFrame, study: Study | None, who: str, tested: Collection[int] | None, **only: str
) -> Population:
    """Join this run's results with a study's.

    `tested`: people of this run on whom nothing was tuned; None: all. The study's people count unless they
    are others of this run. `only`: keys by which study rows are chosen, e.g. `variant="ours"`.
    """
    one = Results(own, who)
    mine = own if tested is None else own[own[who].isin(list(tested))]
    if study is None:
        return Population(Results(mine, who), one, None)
    more = study.results[~study.results[who].isin(set(own[who]) - set(mine[who]))]
    for name, value in only.items():
        more = more[more[name] == value]
    more = more.reindex(columns=own.columns).astype(own.dtypes)
    moved = moved_stages(study, own["stage"].unique())
    counted = more[~more["stage"].isin(moved) & ~more[who].isin(mine[who])]
    joined = pd.concat([mine, counted], ignore_index=True)
    whole = Results(pd.concat([mine[~mine["stage"].isin(moved)], more], ignore_index=True), who)
    return Population(Results(joined, who), one, whole if moved else None)


def moved_stages(
    study: Study,
    stages: Iterable[str],
    pipeline: Path = Path("dvc.yaml"),
    parameters: Path = Path("params.yaml"),
) -> set[str]:
    """Stages that rest on a parameter with another value than in the study, its seeds left out."""
    grounds, made = parameters_of(read_values(pipeline)["stages"]), study.made
    here = digests(read_values(parameters), list(made.parameters), made.seeds)
    changed = {key for key, digest in made.parameters.items() if here[key] != digest}
    return {stage for stage in stages if grounds[stage] & changed}


def parameters_of(stages: Mapping[str, Mapping[str, Any]]) -> dict[str, set[str]]:
    """Keys of `params.yaml` that each stage of a pipeline rests on: its own and those of stages before it."""
    outs = {
        _path(out): stage
        for stage, its in stages.items()
        for out in (*its.get("outs", []), *its.get("metrics", []))
    }
    found: dict[str, set[str]] = {}

    def ground(stage: str) -> set[str]:
        if stage not in found:
            its = stages[stage]
            found[stage] = {key.split(".")[0] for key in its.get("params", []) if isinstance(key, str)}
            for needed in its.get("deps", []):
                if needed in outs:
                    found[stage] |= ground(outs[needed])
        return found[stage]

    return {stage: ground(stage) for stage in stages}


def _path(out: str | Mapping[str, Any]) -> str:
    return out if isinstance(out, str) else next(iter(out))


Samples = Callable[[Results], Any]
"""Samples of a finding, or a mapping of samples by case: arguments of its statistic; see `Findings.by`."""


@dataclass(frozen=True)
class Finding:
    """A number of a page: how it is computed from results."""

    name: str
    statistic: Callable[..., Evidence]  # constructor in `structlearn.reporting.evidence`
    samples: Samples
    unit: str = ""
    headline: bool | Collection[str] = False


@dataclass
class Register:
    """Findings of a page, in order."""

    findings: list[Finding] = field(default_factory=list)

    def finding(
        self,
        statistic: Callable[..., Evidence],
        unit: str = "",
        headline: bool | Collection[str] = False,
        name: str = "",
    ) -> Callable[[Samples], Samples]:
        """Decorator that registers a function of `Results`, by its own name unless one is given."""

        def register(samples: Samples) -> Samples:
            self.findings.append(Finding(name or samples.__name__, statistic, samples, unit, headline))
            return samples

        return register

    def evaluate(self, find: Findings, population: Population) -> None:
        """Add all findings to `find`.

        One that the population has no results for shows this run's person, without an interval and marked so.
        Where a study was made with other parameters, its number stands beside.
        """
        for finding in self.findings:
            found = evidence_of(finding, population.results)
            if not _tested(found):
                one = evidence_of(finding, population.one)
                found = _of_one(one) if _tested(one) else found
            if population.studied:
                found = _beside(found, evidence_of(finding, population.studied), finding.unit)
            find.add(finding.name, found, unit=finding.unit, headline=finding.headline)


def evidence_of(finding: Finding, results: Results) -> Found:
    """Evidence of one finding in some results; who lacks one value of a pair does not count."""
    samples = finding.samples(results)
    if isinstance(samples, dict) and not samples:
        return UNKNOWN
    by_case = {case: _present(one) for case, one in samples.items()} if isinstance(samples, dict) else None
    return Findings().by(finding.statistic, finding.name, _present(samples) if by_case is None else by_case)


def _present(samples: Any) -> Any:
    """Samples without NaN."""
    return samples.dropna() if isinstance(samples, pd.Series) else samples


def _tested(found: Found) -> bool:
    cases = [found] if isinstance(found, Evidence) else list(found.values())
    return any(np.isfinite(case.value) for case in cases)


def _of_one(found: Found) -> Found:
    """Evidence of one person, which decides nothing; a share keeps its trials as n."""
    if isinstance(found, Evidence):
        n = found.n if found.people else min(found.n, 1)
        return replace(found, low=-np.inf, high=np.inf, widened=None, n=n, remark="one person")
    return {case: _of_one(one) for case, one in found.items()}  # type: ignore[misc]


def _beside(found: Found, other: Found, unit: str) -> Found:
    """Evidence remarked with the study's number, where that is another."""
    if isinstance(found, Evidence) and isinstance(other, Evidence):
        if not np.isfinite(other.value) or other == found:
            return found
        remark = f"{in_words(other, '.3g', unit)} with other parameters"
        return replace(found, remark=f"{found.remark}; {remark}" if found.remark else remark)
    cases = dict(found) if isinstance(found, Mapping) else {}  # none, if nothing was found
    others = dict(other) if isinstance(other, Mapping) else {}
    cases |= {case: UNKNOWN for case in others if case not in cases}
    return {case: _beside(one, others.get(case, UNKNOWN), unit) for case, one in cases.items()}  # type: ignore[misc]
