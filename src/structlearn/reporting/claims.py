"""Claims of the dissertation and aims of this project, and their verdicts from evidence.

A page's claims are data, `claims.yaml` beside its template: statement, source, test, bound, format. The
evidence for them is `Evidence` by name. Verdicts:

    yes, no         the 95 % interval lies wholly on that side of the bound
    no difference   it lies on both sides, but wholly within the claim's `margin` of the bound
    undecided       it lies on both sides; `would_decide` estimates the sample size it takes
    not tested      there is no evidence
    holds by construction   no measurement could refute the claim

A claim with several cases (people, primitives, models) is yes only if every case is, and no if any is; their
intervals are widened so that all of them together cover with 95 % (`comparisons`).
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from jinja2 import Environment
from pydantic import PositiveFloat, model_validator
from scipy.special import ndtri, stdtrit

from structlearn.core.artefacts import read_csv
from structlearn.core.metrics import mean_interval, wilson_interval
from structlearn.core.params import Parameters, read_values
from structlearn.reporting.prose import capitalised, interval, percent, rounded

YES, NO, UNDECIDED, NOT_TESTED = "yes", "no", "undecided", "not tested"
NO_DIFFERENCE, BY_CONSTRUCTION = "no difference", "holds by construction"
VERDICTS = (YES, NO, NO_DIFFERENCE, UNDECIDED, NOT_TESTED, BY_CONSTRUCTION)


@dataclass(frozen=True)
class Evidence:
    """A number with its 95 % interval, which is wider if a claim makes many comparisons."""

    value: float  # NaN without evidence
    low: float  # lower end of the interval; the value itself if it is exact (a largest value, a count)
    high: float  # upper end
    n: int  # independent samples (people, seeds, runs)
    count: int | None = None  # of `n`, if the number is a share
    people: int | None = None  # number of people, if the `n` trials of a share are correlated within a person
    pooled_low: float = float("nan")  # lower end of the share's interval if all trials were independent
    pooled_high: float = float("nan")  # its upper end
    study: str = ""  # study that it is quoted from; empty if this run computed it
    reason: str = ""  # why there is no evidence


def exact(value: float, n: int = 1) -> Evidence:
    """An exact number, such as the largest of n values."""
    return Evidence(float(value), float(value), float(value), n)


def mean(samples: np.ndarray, comparisons: int = 1) -> Evidence:
    """Mean of independent samples (N,); a single sample has no interval, so it decides nothing."""
    value, half = mean_interval(np.asarray(samples, float), confidence(comparisons))
    return Evidence(value, value - half, value + half, len(samples))


def difference(first: np.ndarray, second: np.ndarray, comparisons: int = 1) -> Evidence:
    """Mean of first minus second, (N,) each, paired (same seed, person, scene)."""
    return mean(np.asarray(first, float) - np.asarray(second, float), comparisons)


def geometric_mean(samples: np.ndarray, comparisons: int = 1) -> Evidence:
    """Geometric mean of independent positive samples (N,), e.g. ratios, with the interval of their logs."""
    found = mean(np.log(samples), comparisons)
    value, low, high = (float(np.exp(log)) for log in (found.value, found.low, found.high))
    return Evidence(value, low, high, found.n)


def share(count: int, n: int, comparisons: int = 1) -> Evidence:
    """Rate over independent trials with Wilson's interval; else see `clustered_share`."""
    if n == 0:
        return UNKNOWN
    low, high = wilson_interval(count, n, confidence(comparisons))
    value = count / n
    return Evidence(value, min(float(low), value), max(float(high), value), n, int(count))


def clustered_share(counts: np.ndarray, trials: np.ndarray, comparisons: int = 1) -> Evidence:
    """Rate over trials that are correlated within a person (model, robot), with its interval over people.

    The interval is that of people's rates by the t distribution, at least Wilson's over all trials. If all
    trials are hits, or none, rates do not show how people differ, and the interval ends at `none_of(P)`: none
    of 8 people leaves up to 31 %. For rare events among few, very different people it is too narrow: at 5 %
    and an intraclass correlation of 0.1 the interval of 8 people covers in 85 % of all draws, Wilson's over
    all trials in 52 %. `counts` (P,) by person, of `trials` (P,), positive.
    """
    counts, trials = np.asarray(counts), np.asarray(trials)
    pooled = share(int(counts.sum()), int(trials.sum()), comparisons)
    if pooled.n == 0:
        return UNKNOWN
    people = len(counts)
    if pooled.count == 0:
        low, high = 0.0, none_of(people, comparisons)
    elif pooled.count == pooled.n:
        low, high = 1.0 - none_of(people, comparisons), 1.0
    elif people == 1:
        low, high = 0.0, 1.0  # one person does not show how people differ
    else:
        found = mean(counts / trials, comparisons)
        low, high = max(found.low, 0.0), min(found.high, 1.0)
    low, high = min(low, pooled.low), max(high, pooled.high)
    return Evidence(pooled.value, low, high, pooled.n, pooled.count, people, pooled.low, pooled.high)


def none_of(people: int, comparisons: int = 1) -> float:
    """Upper limit of a share of a population if none of `people` has it: 1 - alpha^(1 / people), exact."""
    return 1.0 - (1.0 - confidence(comparisons)) ** (1.0 / people)


def rate_difference(first: np.ndarray, second: np.ndarray, comparisons: int = 1) -> Evidence:
    """Mean difference in % of people's rates (P,); if nobody's two rates differ, `none_of` bounds it."""
    first, second = np.asarray(first, float), np.asarray(second, float)
    found = difference(100 * first, 100 * second, comparisons)
    if np.array_equal(first, second):
        bound = 100 * none_of(len(first), comparisons)
        found = replace(found, low=-bound, high=bound)
    return found


def by_case(make: Callable[..., Evidence], cases: Mapping[str, Sequence[Any]]) -> dict[str, Evidence]:
    """Evidence for a claim with several cases: `make(*arguments, comparisons=number of cases)` of each."""
    return {name: make(*arguments, comparisons=len(cases)) for name, arguments in cases.items()}


def confidence(comparisons: int) -> float:
    """Confidence of one interval such that several jointly cover with 95 % (Bonferroni)."""
    return 1.0 - 0.05 / comparisons


def counted(count: int, n: int) -> Evidence:
    """Exact count in n trials: for claims about these trials, not about probabilities."""
    return Evidence(float(count), float(count), float(count), n, int(count))


UNKNOWN = Evidence(float("nan"), float("nan"), float("nan"), 0)  # the verdict is `not tested`


def unknown(reason: str) -> Evidence:
    """No evidence, and why."""
    return replace(UNKNOWN, reason=reason)


Found = Evidence | Mapping[str, Evidence]  # evidence for one claim: one number, or one by case


def _decided(holds: bool, fails: bool) -> str:
    return YES if holds else NO if fails else UNDECIDED


TESTS: Mapping[str, Callable[[Evidence, Any], str]] = {
    "above": lambda found, bound: _decided(found.low > bound, found.high <= bound),
    "below": lambda found, bound: _decided(found.high < bound, found.low >= bound),
    "at most": lambda found, bound: _decided(found.high <= bound, found.low > bound),
    "at least": lambda found, bound: _decided(found.low >= bound, found.high < bound),
    "between": lambda found, bound: _decided(
        bound[0] <= found.low and found.high <= bound[1], found.high < bound[0] or found.low > bound[1]
    ),
    "zero": lambda found, bound: _decided(found.low == found.high == 0.0, found.value != 0.0),
}
"""Verdicts by name of the test, for a number with an interval, given the claim's bound."""

MOST = 500  # people, seeds or runs; larger sample sizes are not estimated
NEEDS_BOUND = {"at most", "at least", "between"}


class Counterpart(Parameters):
    """The corresponding statement of a simulated testbed."""

    testbed: str  # testbed whose `claims.csv` has it
    statement: str  # its wording there
    cases: tuple[str, ...] = ()  # default: all
    page: str = "index"  # of that testbed
    by: Literal["published", "ours"] | None = None  # if both statements have the same wording


class Margin(Parameters):
    """Smallest effect of interest, fixed before the result: an interval within it is no difference."""

    size: PositiveFloat | dict[str, PositiveFloat]  # from the bound in the row's unit, or one by case
    reason: str  # why a smaller effect does not matter


class Claim(Parameters):
    """One entry of a `claims.yaml`."""

    statement: str  # a template that may use the page's facts, as may `published` and `note`
    source: str  # section of the dissertation, or the reason for this project's aim
    by: Literal["published", "ours"] = "published"  # stated by the dissertation, or an aim of this project
    evidence: str  # name of the evidence
    test: str | dict[str, str]  # one of `TESTS`, or one by case
    bound: Any = 0.0  # of the test, or one by case
    margin: Margin | None = None  # of an equivalence test; None: only yes, no and undecided
    published: str = ""  # value printed in the dissertation
    format: str = ".2f"  # of the numbers: also `percent` for ratios, `share` for rates, `count` for `3 of 63`
    unit: str = ""  # of the numbers
    note: str = ""  # further information for the reader
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
        """Verdict of one number on the claim."""
        if np.isnan(found.value):
            return NOT_TESTED
        bound = _of_case(self.bound, case)
        verdict = TESTS[_of_case(self.test, case)](found, bound)
        if verdict == UNDECIDED and self.margin:
            size = _of_case(self.margin.size, case)
            if bound - size <= found.low and found.high <= bound + size:
                return NO_DIFFERENCE
        return BY_CONSTRUCTION if self.by_construction and verdict == YES else verdict

    def would_decide(self, found: Evidence, case: str = "") -> str:
        """`about 27 would decide`: sample size (of people, if trials are of people) if undecided; else empty.

        With this size and the present mean and spread, 80 % of all draws exclude the nearest bound.
        """
        if self.verdict(found, case) != UNDECIDED:
            return ""
        n = found.people or found.n
        bounds = np.atleast_1d(_of_case(self.bound, case))
        bound = min(bounds, key=lambda one: abs(found.value - one))
        distance = abs(found.value - bound)
        half = found.value - found.low if found.value > bound else found.high - found.value
        if found.count == 0 and found.people:  # see `none_of`
            count = np.log(0.05) / np.log(1.0 - bound)
        elif n < 2 or distance == 0.0:
            return ""
        else:
            count = n * (half / distance * (ndtri(0.975) + ndtri(0.8)) / stdtrit(n - 1, 0.975)) ** 2
        size = f"about {np.ceil(count):.0f}" if count <= MOST else f"more than {MOST}"
        return f"{size} would decide"


def _of_case(given: Any, case: str) -> Any:
    return given[case] if isinstance(given, dict) else given


@dataclass(frozen=True)
class Judged:
    """A claim with its verdict, a row of the page's table."""

    claim: Claim  # with its texts rendered
    cases: tuple[tuple[str, str, int, str], ...]  # name (empty if there is only one), number, n, verdict
    verdict: str  # over all cases
    studies: tuple[str, ...] = ()  # by case, see `Evidence.study`
    would_decide: tuple[str, ...] = ()  # by case, see `Claim.would_decide`
    heading: str = ""  # set of data, on a page with several
    simulated: str = ""  # verdict on the claim's counterpart; empty if unknown


def read_claims(path: Path) -> list[Claim]:
    """Claims of a page, in order. Raises ValueError: an entry is invalid."""
    return [Claim(**entry) for entry in read_values(path)]


def combined(verdicts: Sequence[str]) -> str:
    """Verdict on a claim from those on its cases: the worst one."""
    return next(
        (word for word in (NO, UNDECIDED, NOT_TESTED, NO_DIFFERENCE, BY_CONSTRUCTION) if word in verdicts),
        YES if verdicts else NOT_TESTED,
    )


def judge(
    claims: Sequence[Claim],
    evidence: Mapping[str, Found],
    environment: Environment,
    facts: Mapping[str, object],
) -> list[Judged]:
    """Verdicts on claims, given evidence by name. Raises ValueError: evidence is missing."""
    if missing := {claim.evidence for claim in claims} - set(evidence):
        raise ValueError(f"nothing was found for {sorted(missing)}, which claims name")
    return [_judged(claim, evidence[claim.evidence], environment, facts) for claim in claims]


def _judged(claim: Claim, found: Found, environment: Environment, facts: Mapping[str, object]) -> Judged:
    plain = environment.overlay(autoescape=False)  # the page escapes; a CSV file needs no escapes
    texts = {
        name: plain.from_string(getattr(claim, name)).render(facts)
        for name in ("statement", "source", "published", "note")
    }
    by_case = {"": found} if isinstance(found, Evidence) else found
    cases = tuple(
        (capitalised(case), in_words(one, claim.format, claim.unit), one.n, claim.verdict(one, case))
        for case, one in by_case.items()
    )
    return Judged(
        claim=claim.model_copy(update=texts),
        cases=cases,
        verdict=combined([case[-1] for case in cases]),
        studies=tuple(one.study for one in by_case.values()),
        would_decide=tuple(claim.would_decide(one, case) for case, one in by_case.items()),
    )


def in_words(found: Evidence, number_format: str, unit: str = "") -> str:
    """`0.36 [0.30, 0.42] rad`, `26 % [22, 30]`, `0.0 % [0.0, 31.2] over 8 people, [0.0, 1.2] pooled`.

    A rate is never rounded to 0 or 100 % unless exact.
    """
    if np.isnan(found.value):
        return f"{NOT_TESTED}: {found.reason}" if found.reason else NOT_TESTED
    if number_format == "count":
        return f"{found.count} of {found.n}"
    if number_format == "percent":
        text = f"{rounded(100 * found.value, '.0f')} %"
        ends = interval(100 * found.low, 100 * found.high, ".0f")
        return text if found.low == found.high else f"{text} {ends}"
    if number_format == "share":
        assert found.count is not None  # shares have a count
        text = f"{percent(found.count, found.n, 1)} {interval(100 * found.low, 100 * found.high)}"
        if found.people is None:
            return text
        people = "1 person" if found.people == 1 else f"{found.people} people"
        pooled = interval(100 * found.pooled_low, 100 * found.pooled_high)
        return f"{text} over {people}, {pooled} pooled"
    text = rounded(found.value, number_format)
    if found.low != found.high:
        text += f" {interval(found.low, found.high, number_format)}"
    return f"{text} {unit}".rstrip()


def verdict_counts(judged: Sequence[Judged], by: str = "published") -> dict[str, int]:
    """Number of claims with each verdict, published or ours."""
    found = Counter(one.verdict for one in judged if one.claim.by == by)
    return {word: found[word] for word in VERDICTS}


def claim_metrics(judged: Sequence[Judged]) -> dict[str, int]:
    """The counts of the dissertation's claims as metrics: `claims_yes`, `claims_no`, ..."""
    return {f"claims_{word.replace(' ', '_')}": count for word, count in verdict_counts(judged).items()}


def verdict_in(table: pd.DataFrame, counterpart: Counterpart) -> str:
    """Verdict on a statement, or on some of its cases, in a `claims_table`; empty if it has none."""
    rows = table[table["statement"] == counterpart.statement]
    if counterpart.cases:
        rows = rows[rows["case"].isin(counterpart.cases)]
    if counterpart.by:
        rows = rows[rows["by"] == counterpart.by]
    return combined(list(rows["verdict"])) if len(rows) else ""


def claims_table(judged: Sequence[Judged]) -> pd.DataFrame:
    """`claims.csv`: one row per case of each claim, as text; with its set of data on a page with several."""
    rows = []
    for one in judged:
        claim = one.claim
        like = claim.simulated.model_dump_json() if claim.simulated else ""
        for case, study, more in zip_longest(one.cases, one.studies, one.would_decide, fillvalue=""):
            told = (claim.by, claim.statement, claim.source, claim.published, *case, one.verdict)
            told += (claim.by_construction, study, claim.evidence, more)
            rows.append((*told, one.heading, one.simulated, like))
    columns = ["by", "statement", "source", "published", "case", "here", "n", "verdict", "verdict_of_all"]
    columns += ["by_construction", "study", "evidence", "would_decide"]
    of_sets = ["set", "simulated", "counterpart"]
    table = pd.DataFrame(rows, columns=[*columns, *of_sets])
    return table if any(one.heading for one in judged) else table[columns]


@dataclass(frozen=True)
class OnRecordings:
    """A statement of a simulated testbed that was also tested on recorded data."""

    statement: str  # on the page of recorded data
    counterpart: Counterpart  # of the simulated testbed
    simulated: str  # verdict there
    recorded: str  # verdict on recorded data
    found: tuple[str, ...]  # numbers as text, by case
    heading: str  # of the set of recordings

    @property
    def alike(self) -> bool:
        """Whether both verdicts are the same."""
        return self.simulated == self.recorded


QUOTED = Path("reports/quoted/recorded")
"""Claims on recorded data that other reports quote; in git and no output of a stage, since otherwise the main
pipeline would depend on that of recorded data, which most machines do not have."""


def quoted_claims() -> pd.DataFrame:
    """Claims about recorded data with their counterparts, copied for other reports by `make recorded`."""
    return read_csv(QUOTED / "claims.csv", keep_default_na=False)


def on_recordings(recorded: pd.DataFrame, testbed: str, own: pd.DataFrame) -> list[OnRecordings]:
    """Statements tested on recorded data and on a simulated testbed, given a `claims_table` of each."""
    rows = recorded[recorded["counterpart"].astype(bool) & (recorded["verdict_of_all"] != NOT_TESTED)]
    both = []
    for (heading, statement, like), cases in rows.groupby(["set", "statement", "counterpart"], sort=False):
        counterpart = Counterpart.model_validate_json(like)
        simulated = verdict_in(own, counterpart)
        if counterpart.testbed == testbed and simulated not in ("", NOT_TESTED):
            found = tuple(
                f"{case}: {here}" if case else here
                for case, here in zip(cases["case"], cases["here"], strict=True)
            )
            verdict = cases["verdict_of_all"].iloc[0]
            both.append(OnRecordings(statement, counterpart, simulated, verdict, found, heading))
    return both
