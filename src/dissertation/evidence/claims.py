"""Claims of the dissertation and aims of this project, judged by the evidence found.

A page's claims are data, `claims.yaml` beside its template: statement, source, test, bound, format. Their
evidence is looked up by name (`Evidence`). Verdicts:

    yes, no         the 95 % interval lies entirely on that side of the bound
    no difference   it includes both sides, but lies within the claim's `margin` of the bound
    undecided       it includes both sides; `would_decide` estimates the sample size needed
    not tested      there is no evidence
    holds by construction   no measurement could refute the claim

A claim with several cases (people, primitives, models) is yes only if every case is, and no if any is. Yes
and no difference rest on each case's 95 % interval: they are wrong only if that of a failing case is. No
rests on the interval widened for a joint coverage of 95 % (`Evidence.refuting`), because one of many cases
fails by chance.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from pydantic import PositiveFloat, model_validator
from scipy.special import stdtr, stdtrit

from structlearn.core.artefacts import read_csv
from structlearn.core.params import Parameters, read_values
from structlearn.core.rates import rate_interval
from structlearn.reporting.document import environment
from structlearn.reporting.evidence import NOT_TESTED, Evidence, Found, in_words, number_in_words
from structlearn.reporting.prose import capitalised

YES, NO, UNDECIDED = "yes", "no", "undecided"
NO_DIFFERENCE, BY_CONSTRUCTION = "no difference", "holds by construction"
VERDICTS = (YES, NO, NO_DIFFERENCE, UNDECIDED, NOT_TESTED, BY_CONSTRUCTION)


def _decided(holds: bool, fails: bool) -> str:
    return YES if holds else NO if fails else UNDECIDED


TESTS: Mapping[str, Callable[[Evidence, Any], str]] = {
    "above": lambda found, bound: _decided(found.low > bound, found.refuting[1] <= bound),
    "below": lambda found, bound: _decided(found.high < bound, found.refuting[0] >= bound),
    "at most": lambda found, bound: _decided(found.high <= bound, found.refuting[0] > bound),
    "at least": lambda found, bound: _decided(found.low >= bound, found.refuting[1] < bound),
    "between": lambda found, bound: _decided(
        bound[0] <= found.low and found.high <= bound[1],
        found.refuting[1] < bound[0] or found.refuting[0] > bound[1],
    ),
    "zero": lambda found, bound: _decided(
        found.low == found.high == 0.0, found.refuting[0] > 0.0 or found.refuting[1] < 0.0
    ),
}
"""Tests by name: verdict on a number with a known interval, given the claim's bound."""

MOST = 500  # people, seeds or runs; larger sample sizes are only reported as more
NEEDS_BOUND = {"at most", "at least", "between"}


class Counterpart(Parameters):
    """The corresponding claim of a simulated testbed, found by its finding."""

    testbed: str  # whose `claims.csv` has the claim
    evidence: str  # name of its finding
    cases: tuple[str, ...] = ()  # all if empty
    page: str = "index"  # of that testbed


class Margin(Parameters):
    """Smallest effect of interest, fixed before the result: an interval within it means no difference."""

    size: PositiveFloat | dict[str, PositiveFloat]  # distance from the bound in the row's unit, or by case
    reason: str  # why a smaller effect does not matter


class Claim(Parameters):
    """One entry of a `claims.yaml`."""

    statement: str  # a template that may use the page's facts, like `published` and `note`
    source: str  # section of the dissertation, or why this project has the aim
    by: Literal["published", "ours"] = "published"  # stated by the dissertation, or an aim of this project
    evidence: str  # name of the finding
    test: str | dict[str, str]  # one of `TESTS`, or one by case
    bound: Any = 0.0  # of the test, or one by case
    margin: Margin | None = None  # for an equivalence test; None: only yes, no and undecided
    published: str = ""  # as printed in the dissertation
    format: str = ".2f"  # of numbers; `percent` for ratios, `share` for rates, `count` for `3 of 63`
    unit: str = ""  # of numbers, with the direction of a difference or ratio (`ms less`); else the finding's
    note: str = ""  # what else a reader must know
    by_construction: str = ""  # why no measurement could refute it
    simulated: Counterpart | None = None  # for claims about recorded data

    @model_validator(mode="after")
    def _is_known(self) -> "Claim":
        names = set(self.test.values()) if isinstance(self.test, dict) else {self.test}
        if not names <= set(TESTS):
            raise ValueError(f"unknown test {sorted(names - set(TESTS))}; there are {sorted(TESTS)}")
        if names & NEEDS_BOUND and "bound" not in self.model_fields_set:
            raise ValueError(f"test {sorted(names & NEEDS_BOUND)} needs a bound")
        if self.margin and names & {"between", "zero"}:
            raise ValueError("a margin is for tests with one bound")
        return self

    def verdict(self, found: Evidence, case: str = "") -> str:
        """Verdict on the claim from one number."""
        if np.isnan(found.value):
            return NOT_TESTED
        bound = _of_case(self.bound, case)
        verdict = TESTS[_of_case(self.test, case)](found, bound)
        if verdict == UNDECIDED and self.margin:
            size = _of_case(self.margin.size, case)
            if bound - size <= found.low and found.high <= bound + size:
                return NO_DIFFERENCE
        return BY_CONSTRUCTION if self.by_construction and verdict == YES else verdict

    def test_of(self, case: str) -> str:
        """Name of the test of a case, capitalised or not."""
        return str(_of_case(self.test, case))

    def bound_of(self, case: str) -> Any:
        """Bound of a case, capitalised or not."""
        return _of_case(self.bound, case)

    def would_decide(self, found: Evidence, case: str = "", cases: int = 1) -> str:
        """Sample size that would decide an undecided case, e.g. `about 27 would decide`; otherwise empty.

        Counts people if trials are clustered by person. With this size in each of `cases` undecided cases,
        and the means and spreads found, all of them would exclude the nearest bound in 80 % of draws.
        """
        n = found.people or found.n
        if self.verdict(found, case) != UNDECIDED or n < 2:
            return ""
        bounds = np.atleast_1d(_of_case(self.bound, case))
        bound = min(bounds, key=lambda one: abs(found.value - one))
        distance = abs(found.value - bound)
        if found.count in (0, found.n):  # without a spread; by symmetry, none
            enough = partial(_none_decide, trials=found.n // n, bound=distance)
        else:
            own, half = (
                found.value - low if found.value > bound else high - found.value
                for low, high in ((found.low, found.high), self._interval_in_favour(found, case))
            )
            if distance == 0.0 or own == 0.0:
                return ""
            spread = own / stdtrit(n - 1, 0.975)  # standard error at this size
            level = stdtr(n - 1, half / spread)  # of the end of the interval that must exclude the bound
            enough = partial(
                _sample_decides,
                distance=distance / (np.sqrt(n) * spread),
                levels=(level, 0.8 ** (1.0 / cases)),
            )
        sizes = range(n + 1, MOST + 1)
        place = bisect_left(sizes, True, key=enough)
        size = f"about {sizes[place]}" if place < len(sizes) else f"more than {MOST}"
        return f"{size} would decide"

    def _interval_in_favour(self, found: Evidence, case: str) -> tuple[float, float]:
        """Interval that counts for the verdict that the number itself has."""
        sure = replace(found, low=found.value, high=found.value, widened=None)
        return found.refuting if self.verdict(sure, case) == NO else (found.low, found.high)


def _none_decide(people: int, trials: int, bound: float) -> bool:
    """Whether no hits of so many people in so many trials each put a rate below the bound."""
    return rate_interval(np.zeros(people), np.full(people, trials))[1] <= bound


def _sample_decides(n: int, distance: float, levels: tuple[float, float]) -> bool:
    """Whether n samples are enough to exclude a bound at a distance in standard deviations.

    `levels`: of the interval's end, and the power.
    """
    return sum(stdtrit(n - 1, levels)) <= distance * np.sqrt(n)


def _of_case(given: Any, case: str) -> Any:
    if not isinstance(given, dict):
        return given
    return given[case] if case in given else {capitalised(name): one for name, one in given.items()}[case]


@dataclass(frozen=True)
class Judged:
    """A claim with its verdict: a row of the page's table."""

    claim: Claim  # with rendered texts
    cases: tuple[tuple[str, str, int, str], ...]  # name (empty if there is only one), number, n, verdict
    verdict: str  # over all cases
    found: tuple[Evidence, ...] = ()  # by case
    would_decide: tuple[str, ...] = ()  # by case, see `Claim.would_decide`
    heading: str = ""  # name of the data set, on pages with several
    simulated: str = ""  # verdict on the claim's counterpart; empty if unknown
    there: str = ""  # the statement of the counterpart


def read_claims(path: Path) -> list[Claim]:
    """Read a page's claims, in order. Raises ValueError: an entry is invalid."""
    return [Claim(**entry) for entry in read_values(path)]


def combined(verdicts: Sequence[str]) -> str:
    """Verdict on a claim from the verdicts on its cases: the worst."""
    return next(
        (word for word in (NO, UNDECIDED, NOT_TESTED, NO_DIFFERENCE, BY_CONSTRUCTION) if word in verdicts),
        YES if verdicts else NOT_TESTED,
    )


def judge(
    claims: Sequence[Claim], evidence: Mapping[str, Found], facts: Mapping[str, object]
) -> list[Judged]:
    """Judge claims by evidence, looked up by name. Raises ValueError: evidence is missing."""
    if missing := {claim.evidence for claim in claims} - set(evidence):
        raise ValueError(f"nothing was found for {sorted(missing)}, which claims name")
    return [_judged(claim, evidence[claim.evidence], facts) for claim in claims]


def rendered(text: str, facts: Mapping[str, object]) -> str:
    """Text of a claim without escapes; a page escapes it later, a CSV file does not."""
    return environment().overlay(autoescape=False).from_string(text).render(facts)


def _judged(claim: Claim, found: Found, facts: Mapping[str, object]) -> Judged:
    texts = {
        name: rendered(getattr(claim, name), facts) for name in ("statement", "source", "published", "note")
    }
    by_case = {"": found} if isinstance(found, Evidence) else found
    undecided = sum(claim.verdict(one, case) == UNDECIDED for case, one in by_case.items())
    cases = tuple(
        (capitalised(case), in_words(one, claim.format, claim.unit), one.n, claim.verdict(one, case))
        for case, one in by_case.items()
    )
    return Judged(
        claim=claim.model_copy(update=texts),
        cases=cases,
        verdict=combined([case[-1] for case in cases]),
        found=tuple(by_case.values()),
        would_decide=tuple(claim.would_decide(one, case, undecided) for case, one in by_case.items()),
    )


def verdict_counts(judged: Sequence[Judged], by: str = "published") -> dict[str, int]:
    """Number of claims with each verdict, for published claims or ours."""
    found = Counter(one.verdict for one in judged if one.claim.by == by)
    return {word: found[word] for word in VERDICTS}


def claim_metrics(judged: Sequence[Judged]) -> dict[str, int]:
    """Verdict counts of the dissertation's claims as metrics: `claims_yes`, `claims_no`, ..."""
    return {f"claims_{word.replace(' ', '_')}": count for word, count in verdict_counts(judged).items()}


def verdict_in(table: pd.DataFrame, counterpart: Counterpart) -> tuple[str, str]:
    """Verdict on a claim, or on some of its cases, in a `claims_table`, and its statement; or empty texts."""
    rows = table[table["evidence"] == counterpart.evidence]
    if counterpart.cases:
        rows = rows[rows["case"].isin(counterpart.cases)]
    return (combined(list(rows["verdict"])), rows["statement"].iloc[0]) if len(rows) else ("", "")


def claims_table(judged: Sequence[Judged], pages: Mapping[str, str] | None = None) -> pd.DataFrame:
    """Table for `claims.csv`: one row per case of each claim, with the data set if there are several.

    `number` is `here` without its interval; `low` and `high` are the interval's ends; `bound` is that of the
    test, two of a range; both are empty if it was not tested; `page` has the row (`pages` by evidence).
    """
    rows = []
    for one in judged:
        claim = one.claim
        shared = {name: getattr(claim, name) for name in ("by", "statement", "source", "published")}
        shared |= {"verdict_of_all": one.verdict, "by_construction": claim.by_construction}
        shared |= {"evidence": claim.evidence, "page": (pages or {}).get(claim.evidence, "index")}
        of_set = {"set": one.heading, "simulated": one.simulated}
        of_set["counterpart"] = claim.simulated.model_dump_json() if claim.simulated else ""
        for cell, found, more in zip_longest(one.cases, one.found, one.would_decide, fillvalue=None):
            case, here, n, verdict = cell or ("", "", 0, "")
            row = {"case": case, "here": here, "n": n, "verdict": verdict, "would_decide": more or ""}
            if found is not None:
                row |= {"number": number_in_words(found, claim.format), "study": found.study}
                row |= {"value": found.value, "low": found.low, "high": found.high}
                row["unit"] = claim.unit or found.unit
            if found is not None and not np.isnan(found.value):  # else its cases may be unknown
                row["test"] = claim.test_of(case)
                row["bound"] = " ".join(f"{bound:g}" for bound in np.atleast_1d(claim.bound_of(case)))
            rows.append(shared | row | of_set)
    table = pd.DataFrame(rows).reindex(columns=[*COLUMNS, *OF_SETS])
    return table if any(one.heading for one in judged) else table[COLUMNS]


COLUMNS = ["by", "statement", "source", "published", "case", "here", "n", "verdict", "verdict_of_all"]
COLUMNS += ["by_construction", "study", "evidence", "would_decide"]
COLUMNS += ["number", "value", "low", "high", "unit", "test", "bound", "page"]
OF_SETS = ["set", "simulated", "counterpart"]  # columns of tables with several data sets


@dataclass(frozen=True)
class OnRecordings:
    """A statement tested both in simulation and on recorded data."""

    statement: str  # on the page of recorded data
    counterpart: Counterpart  # of the simulated testbed
    there: str  # the statement of the counterpart
    simulated: str  # verdict on it
    recorded: str  # verdict on recorded data
    found: tuple[str, ...]  # as text, by case
    heading: str  # name of the data set

    @property
    def alike(self) -> bool:
        """Whether both verdicts are the same."""
        return self.simulated == self.recorded


QUOTED = Path("reports/quoted/recorded")
"""Results on recorded data that other reports quote. They are in git and no stage's output; otherwise the
main pipeline would first run that of recorded data, which most machines do not have."""


def quoted_claims() -> pd.DataFrame:
    """Claims about recorded data with their counterparts, as copied by `make recorded` for other reports."""
    return read_csv(QUOTED / "claims.csv", keep_default_na=False)


def quoted_people() -> pd.DataFrame:
    """How recorded people differ (`recorded.people`), by quantity and case, as copied by `make recorded`."""
    return read_csv(QUOTED / "people.csv").set_index(["quantity", "case"])


def on_recordings(recorded: pd.DataFrame, testbed: str, own: pd.DataFrame) -> list[OnRecordings]:
    """Statements tested on recorded data and on a simulated testbed, given a `claims_table` of each."""
    rows = recorded[recorded["counterpart"].astype(bool) & (recorded["verdict_of_all"] != NOT_TESTED)]
    both = []
    for (heading, statement, like), cases in rows.groupby(["set", "statement", "counterpart"], sort=False):
        counterpart = Counterpart.model_validate_json(like)
        simulated, there = verdict_in(own, counterpart)
        if counterpart.testbed == testbed and simulated not in ("", NOT_TESTED):
            found = tuple(
                f"{case}: {here}" if case else here
                for case, here in zip(cases["case"], cases["here"], strict=True)
            )
            verdict = cases["verdict_of_all"].iloc[0]
            both.append(OnRecordings(statement, counterpart, there, simulated, verdict, found, heading))
    return both
