"""Findings: every number that a page states, defined once with its interval, n and population.

A report computes its findings before it draws figures:

    find = Findings("20 simulated people")
    find.mean("cost_ratio", {"10 degrees": ratios}, headline=True)   # a row per case
    find.exact("rnea_max_error", 1e-13, unit="N m")

They are written to `findings.csv`. Templates refer to their values (`{{ cost_ratio_level | f(".2f") }}`, see
`values_by_key`), and `metrics.json` has the headlines.
"""

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.artefacts import Metrics, read_csv
from structlearn.reporting import evidence
from structlearn.reporting.evidence import UNKNOWN, Evidence, Found, unknown

EXACT = (evidence.exact, evidence.exact_count, evidence.maximum, evidence.minimum)  # without an interval
COLUMNS = ["name", "case", "value", "low", "high", "n", "unit", "population", "headline", "study", "reason"]


@dataclass(frozen=True)
class _Row:
    found: Found
    population: str
    headline: bool | Collection[str]


def _finder(make: Callable[..., Evidence]) -> Callable[..., Found]:
    """Method of `Findings` that adds a row by a constructor of evidence."""

    def find(self: "Findings", name: str, *given: Any, **row: Any) -> Found:
        return self.by(make, name, *given, **row)

    find.__doc__ = make.__doc__
    return find


class Findings(Mapping[str, Found]):
    """Evidence of a page by name: a single number, or one by case."""

    def __init__(self, population: str = "", study: str = "") -> None:
        """`population`: what n counts, as text; `study`: source of the numbers, if they are quoted."""
        self._rows: dict[str, _Row] = {}
        self._population, self._study = population, study

    def among(self, population: str, study: str = "") -> "Findings":
        """View of the same findings that adds rows of another population."""
        other = Findings(population, study)
        other._rows = self._rows
        return other

    def add(
        self, name: str, found: Found, *, unit: str = "", headline: bool | Collection[str] = False
    ) -> Found:
        """Add a row with its evidence, in a unit; `headline`: which cases go to `metrics.json`, or all.

        Raises ValueError: there is a row of that name.
        """
        if name in self._rows:
            raise ValueError(f"two findings are called {name}")
        if self._study or unit:
            study = self._study
            marked = {
                case: replace(one, study=study or one.study, unit=unit or one.unit)
                for case, one in _cases(found)
            }
            found = marked[""] if isinstance(found, Evidence) else marked
        self._rows[name] = _Row(found, self._population, headline)
        return found

    def include(self, other: "Findings") -> None:
        """Add all rows of other findings. Raises ValueError: a name occurs in both."""
        if twice := set(self._rows) & set(other._rows):
            raise ValueError(f"two findings are called {', '.join(sorted(twice))}")
        self._rows |= other._rows

    def mark(self, headlines: Mapping[str, bool | Collection[str]]) -> None:
        """Set which cases of the named rows are headlines; unknown names are ignored."""
        for name in headlines.keys() & self._rows.keys():
            self._rows[name] = replace(self._rows[name], headline=headlines[name])

    def by(
        self, make: Callable[..., Evidence], name: str, *given: Any, missing: str = "", **row: Any
    ) -> Found:
        """Add a row by a constructor of evidence, from its arguments or from a mapping of arguments by case.

        Several cases also have intervals widened for a joint coverage of 95 %, see `Evidence`. A case without
        samples, or with None, is not tested, with `missing` as the reason, and does not widen the others.
        `row`: see `add`.
        """
        lacking = unknown(missing) if missing else UNKNOWN
        if not isinstance(given[0], Mapping):
            return self.add(name, make(*given) if _there(given) else lacking, **row)
        cases = {str(case): one if isinstance(one, tuple) else (one,) for case, one in given[0].items()}
        there = {case: one for case, one in cases.items() if _there(one)}
        many = {} if make in EXACT else {"comparisons": len(there)}
        found = {case: make(*one, **many) if case in there else lacking for case, one in cases.items()}
        return self.add(name, found, **row)

    def unknown(self, name: str, reason: str = "") -> Found:
        """Add a row without a number, and the reason."""
        return self.add(name, unknown(reason))

    exact = _finder(evidence.exact)
    mean = _finder(evidence.mean)
    difference = _finder(evidence.difference)
    geometric_mean = _finder(evidence.geometric_mean)
    median = _finder(evidence.median)
    share = _finder(evidence.share)
    clustered_share = _finder(evidence.clustered_share)
    rate_difference = _finder(evidence.rate_difference)
    exact_count = _finder(evidence.exact_count)

    def __getitem__(self, name: str) -> Found:
        return self._rows[name].found

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def table(self) -> pd.DataFrame:
        """Rows of `findings.csv`, one per case."""
        rows = [
            {"name": name, "case": case, "value": one.value, "low": one.low, "high": one.high, "n": one.n}
            | {"unit": one.unit, "population": row.population, "study": one.study, "reason": one.reason}
            | {"headline": row.headline if isinstance(row.headline, bool) else case in row.headline}
            for name, row in self._rows.items()
            for case, one in _cases(row.found)
        ]
        return pd.DataFrame(rows, columns=COLUMNS).astype({"headline": bool})  # also without rows

    def numbers(self) -> Metrics:
        """Values for the template's sentences, see `values_by_key`."""
        return values_by_key(self.table())

    @classmethod
    def of_metrics(cls, metrics: Metrics, headlines: tuple[str, ...] = ()) -> "Findings":
        """Findings from numbers without intervals; texts are ignored, None is not tested."""
        find = cls()
        for name, value in metrics.items():
            if value is None:
                find.unknown(name)
            elif not isinstance(value, str):
                find.exact(name, value, headline=name in headlines)
        return find


def _there(samples: tuple[Any, ...]) -> bool:
    return all(one is not None and (np.ndim(one) == 0 or len(one) > 0) for one in samples)


def values_by_key(table: pd.DataFrame) -> Metrics:
    """Values of a findings table, keyed by `name` or, with cases, `name_case`; unknown ones are left out.

    Whole numbers become integers, so that a sentence says `3 robots`.
    """
    return {
        f"{name}_{case}" if case else name: int(value) if value == round(value) else float(value)
        for name, case, value in table[["name", "case", "value"]].itertuples(index=False)
        if math.isfinite(value)
    }


def _cases(found: Found) -> Iterable[tuple[str, Evidence]]:
    return [("", found)] if isinstance(found, Evidence) else found.items()


def read_findings(path: Path | Any) -> pd.DataFrame:
    """Read `findings.csv` from a path or an open file. Raises InputError: it is missing or no table."""
    texts = dict.fromkeys(("name", "case", "unit", "population", "study", "reason"), "")
    return read_csv(path, dtype=dict.fromkeys(texts, str)).fillna(texts)
