"""Claims: what the dissertation states or this project aims at, held against what was found.

A page's claims are data, `claims.yaml` beside its template: statement, source, test, bound, format. What was
found for them is `Evidence` by name. Here is the one evaluator and its one vocabulary:

    yes, no         the 95 % interval lies wholly on that side of the bound
    no difference   it lies on both sides, but wholly within the claim's `margin` of the bound
    undecided       it lies on both sides; `would_decide` estimates how many more people or seeds it takes
    not tested      nothing was found that could decide
    holds by construction   its evidence cannot say "no": the claim is true of whatever is measured

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
    """A number that was found, with its 95 % interval (wider where a claim makes many comparisons)."""

    value: float  # the number; NaN where nothing was found
    # lower end of the interval; the value itself where the number is exact (a largest value, a count)
    low: float
    high: float  # upper end
    n: int  # number of independent things that it rests on (people, seeds, runs)
    count: int | None = None  # of `n`, where the number is a share
    # that the `n` trials of a share are of, where trials of one person are alike; else None
    people: int | None = None
    pooled_low: float = float("nan")  # lower end of the share's interval if all trials were independent
    pooled_high: float = float("nan")  # its upper end
    study: str = ""  # that it is quoted from, run beside the pipeline; empty where this run computed it
    reason: str = ""  # why nothing was found, where the value is NaN


def exact(value: float, n: int = 1) -> Evidence:
    """A number that is known as it is, such as the largest of n values."""
    return Evidence(float(value), float(value), float(value), n)


def mean(samples: np.ndarray, comparisons: int = 1) -> Evidence:
    """Mean of independent samples (N,); one sample alone has no interval, so nothing follows from it."""
    value, half = mean_interval(np.asarray(samples, float), confidence(comparisons))
    return Evidence(value, value - half, value + half, len(samples))


def difference(first: np.ndarray, second: np.ndarray, comparisons: int = 1) -> Evidence:
    """Mean of first minus second, (N,) each, in pairs (same seed, person, scene)."""
    return mean(np.asarray(first, float) - np.asarray(second, float), comparisons)


def geometric_mean(samples: np.ndarray, comparisons: int = 1) -> Evidence:
    """Geometric mean of independent positive samples (N,), e.g. ratios, with the interval of their logs."""
    found = mean(np.log(samples), comparisons)
    value, low, high = (float(np.exp(log)) for log in (found.value, found.low, found.high))
    return Evidence(value, low, high, found.n)


def share(count: int, n: int, comparisons: int = 1) -> Evidence:
    """A rate over independent trials, with Wilson's interval; unknown without any.

    Trials of the same people, models or runs are not independent: they need `clustered_share`.
    """
    if n == 0:
        return UNKNOWN
    low, high = wilson_interval(count, n, confidence(comparisons))
    value = count / n
    return Evidence(value, min(float(low), value), max(float(high), value), n, int(count))


def clustered_share(counts: np.ndarray, trials: np.ndarray, comparisons: int = 1) -> Evidence:
    """A rate over trials that are alike within a person (model, robot), with its interval over people.

    Trials of one person say less than as many of different people, so the interval is that of people's rates
    by the t distribution, never narrower than Wilson's over all trials. Where nobody's trial is a hit, or
    everybody's, rates do not tell how people differ; then all that is known is that none of P people is one
    whose trials are, and the interval ends at `none_of(P)`: none of 8 people leaves up to 31 %.

    For rare events of few people who differ much the t distribution is too narrow: at 5 % and an intraclass
    correlation of 0.1 the interval of 8 people covers in 85 % of all draws, Wilson's over all trials in 52 %.
    `counts` (P,) by person, of `trials`; `trials` (P,) by person, positive; `comparisons`: see `confidence`.
    Returns evidence whose n and count are of trials, with the interval over people and the pooled one.
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
        low, high = 0.0, 1.0  # one person does not tell how people differ
    else:
        found = mean(counts / trials, comparisons)
        low, high = max(found.low, 0.0), min(found.high, 1.0)
    return replace(
        pooled,
        low=min(low, pooled.low),
        high=max(high, pooled.high),
        people=people,
        pooled_low=pooled.low,
        pooled_high=pooled.high,
    )


def none_of(people: int, comparisons: int = 1) -> float:
    """Largest share of a population of which none may be among so many: 1 - alpha^(1 / people), exact."""
    return 1.0 - (1.0 - confidence(comparisons)) ** (1.0 / people)


def rate_difference(first: np.ndarray, second: np.ndarray, comparisons: int = 1) -> Evidence:
    """Mean in % of people's rates (P,), first minus second.

    If nobody's two rates differ, e.g. as nobody hits anything, somebody else's may: then `none_of` bounds the
    mean on both sides.
    """
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
    """Of one interval, so that all of so many together cover with 95 % (Bonferroni)."""
    return 1.0 - 0.05 / comparisons


def counted(count: int, n: int) -> Evidence:
    """How often something happened in n trials: for claims about these trials, not about chances."""
    return Evidence(float(count), float(count), float(count), n, int(count))


UNKNOWN = Evidence(float("nan"), float("nan"), float("nan"), 0)
"""Of what was not run: the verdict is `not tested`."""


def unknown(reason: str) -> Evidence:
    """Of what could not be found, and why: the row says so."""
    return replace(UNKNOWN, reason=reason)


Found = Evidence | Mapping[str, Evidence]  # what was found for one claim: one number, or one by case


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
"""By name, verdict on a number whose interval is known, given the claim's bound."""

MOST = 500
"""People, seeds or runs; no row gets more, so how many more it would take is no matter."""

NEEDS_BOUND = {"at most", "at least", "between"}


class Counterpart(Parameters):
    """The like statement of another testbed."""

    testbed: str  # whose `claims.csv` has it
    statement: str  # as it stands there
    cases: tuple[str, ...] = ()  # those that are meant; all where none is named
    page: str = "index"  # of that testbed
    # whose statement is meant where the text's and ours have the same words; None: they are the same
    by: Literal["text", "ours"] | None = None


class Margin(Parameters):
    """Smallest effect of interest, written down before the result: an interval within it is no difference."""

    size: PositiveFloat | dict[str, PositiveFloat]  # from the bound in the row's unit, or one by case
    reason: str  # why a smaller effect does not matter


class Claim(Parameters):
    """One entry of a `claims.yaml`."""

    # what is claimed; a template that may name the page's facts, as may `published` and `note`
    statement: str
    source: str  # where the dissertation says so, or why this project aims at it
    # `text` where the dissertation states it, `ours` where this project set out to reach it
    by: Literal["text", "ours"] = "text"
    evidence: str  # name of what was found
    test: str | dict[str, str]  # one of `TESTS`, or one by case
    bound: Any = 0.0  # of the test, or one by case; 0 where it is left out
    margin: Margin | None = None  # of an equivalence test; None: only yes, no and undecided
    published: str = ""  # what the dissertation prints
    format: str = ".2f"  # of the numbers, `percent` of ratios, `share` of rates, `count` for `3 of 63`
    unit: str = ""  # written behind them
    note: str = ""  # what else a reader must know, e.g. what the number is of
    by_construction: str = ""  # why no measurement could refute it; it is shown as such and is no yes
    # the like statement of a simulated testbed, for claims about recorded data
    simulated: Counterpart | None = None

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
        """What one number says of the claim."""
        if np.isnan(found.value):
            return NOT_TESTED
        test = self.test[case] if isinstance(self.test, dict) else self.test
        bound = self.bound[case] if isinstance(self.bound, dict) else self.bound
        verdict = TESTS[test](found, bound)
        if verdict == UNDECIDED and self.margin:
            size = self.margin.size
            size = size[case] if isinstance(size, dict) else size
            if bound - size <= found.low and found.high <= bound + size:
                return NO_DIFFERENCE
        return BY_CONSTRUCTION if self.by_construction and verdict == YES else verdict

    def would_decide(self, found: Evidence, case: str = "") -> str:
        """`about 27 would decide`: how many people, seeds or runs an undecided number takes; else empty.

        With so many, and the mean and spread found, 80 % of all draws exclude the nearest bound. Shares are
        counted in people where their trials are of people.
        """
        if self.verdict(found, case) != UNDECIDED:
            return ""
        given = self.bound[case] if isinstance(self.bound, dict) else self.bound
        n = found.people or found.n
        bound = min(np.atleast_1d(given), key=lambda one: abs(found.value - one))
        distance = abs(found.value - bound)
        half = found.value - found.low if found.value > bound else found.high - found.value
        if found.count == 0 and found.people:  # see `none_of`
            count = np.log(0.05) / np.log(1.0 - bound)
        elif n < 2 or distance == 0.0:
            return ""
        else:
            count = n * (half / distance * (ndtri(0.975) + ndtri(0.8)) / stdtrit(n - 1, 0.975)) ** 2
        return (
            f"about {np.ceil(count):.0f} would decide" if count <= MOST else f"more than {MOST} would decide"
        )


@dataclass(frozen=True)
class Judged:
    """A claim with its verdict, as the page's table shows it."""

    claim: Claim  # with its texts rendered
    # name, number in words, n and verdict of each; one with an empty name where there are no cases
    cases: tuple[tuple[str, str, int, str], ...]
    verdict: str  # over all cases
    studies: tuple[str, ...] = ()  # that the cases are quoted from, see `Evidence.study`; empty where none is
    would_decide: tuple[str, ...] = ()  # see `Claim.would_decide`, by case
    heading: str = ""  # of the set of data that it is about, on a page with several
    simulated: str = ""  # verdict on the claim's counterpart; empty where it is not known


def read_claims(path: Path) -> list[Claim]:
    """The claims of a page, in order.

    Raises ValueError: an entry has an unknown key, an unknown test, or lacks something.
    """
    return [Claim(**entry) for entry in read_values(path)]


def combined(verdicts: Sequence[str]) -> str:
    """The verdict on a claim by those on its cases: as bad as the worst."""
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
    """Hold claims against what was found, by the names that they use; a ValueError where some is missing."""
    if missing := {claim.evidence for claim in claims} - set(evidence):
        raise ValueError(f"nothing was found for {sorted(missing)}, which claims name")
    return [_judged(claim, evidence[claim.evidence], environment, facts) for claim in claims]


def _judged(claim: Claim, found: Found, environment: Environment, facts: Mapping[str, object]) -> Judged:
    plain = environment.overlay(autoescape=False)  # the page escapes them, a CSV file needs no escapes
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


def in_sentence(found: Evidence, number_format: str, unit: str = "") -> str:
    """As `in_words`; of a share without n and pooled interval, since the sentence says over whom it is."""
    return in_words(replace(found, people=None), number_format, unit)


def in_words(found: Evidence, number_format: str, unit: str = "") -> str:
    """`0.36 [0.30, 0.42] rad`, `26 % [22, 30]`, `0.0 % [0.0, 31.2] over 8 people, [0.0, 1.2] pooled`.

    A rate is never rounded to 0 or 100 % where it is neither.
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
        assert found.count is not None  # a share is counted
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


def verdict_counts(judged: Sequence[Judged], by: str = "text") -> dict[str, int]:
    """How many claims have each verdict, by who states them."""
    found = Counter(one.verdict for one in judged if one.claim.by == by)
    return {word: found[word] for word in VERDICTS}


def claim_metrics(judged: Sequence[Judged]) -> dict[str, int]:
    """The counts of the dissertation's claims as metrics: `claims_yes`, `claims_no`, ..."""
    return {f"claims_{word.replace(' ', '_')}": count for word, count in verdict_counts(judged).items()}


def verdict_in(table: pd.DataFrame, counterpart: Counterpart) -> str:
    """The verdict on a statement, or on some of its cases, in a `claims_table`; empty where it has none."""
    rows = table[table["statement"] == counterpart.statement]
    if counterpart.cases:
        rows = rows[rows["case"].isin(counterpart.cases)]
    if counterpart.by:
        rows = rows[rows["by"] == counterpart.by]
    return combined(list(rows["verdict"])) if len(rows) else ""


def claims_table(judged: Sequence[Judged]) -> pd.DataFrame:
    """One row per case of each claim, as the CSV file holds them; with its set where there are several.

    Returns `by`, `statement`, `source`, `published`, `case`, `here` (in words), `n`, `verdict`,
    `verdict_of_all`, `by_construction`: why nothing could refute it, `study`: that the number is quoted
    from; both are empty elsewhere; `evidence`, the claim's name, by which the front page finds it; and
    `would_decide`, how many people, seeds or runs an undecided case takes.
    """
    texts = ("by", "statement", "source", "published")
    rows = [
        (
            *(*(getattr(one.claim, name) for name in texts), *case, one.verdict),
            *(one.claim.by_construction, study, one.claim.evidence, more),
        )
        for one in judged
        for case, study, more in zip_longest(one.cases, one.studies, one.would_decide, fillvalue="")
    ]
    columns = [*texts, "case", "here", "n", "verdict", "verdict_of_all"]
    columns += ["by_construction", "study", "evidence", "would_decide"]
    table = pd.DataFrame(rows, columns=columns)
    if any(one.heading for one in judged):
        sets = [
            (one.heading, one.simulated, like.model_dump_json() if (like := one.claim.simulated) else "")
            for one in judged
            for _ in one.cases
        ]
        table[["set", "simulated", "counterpart"]] = pd.DataFrame(sets, index=table.index)
    return table


@dataclass(frozen=True)
class OnRecordings:
    """A statement of a simulated testbed that recorded data speak to as well."""

    statement: str  # as the page of recorded data makes it
    counterpart: Counterpart  # the like one of the simulated testbed
    simulated: str  # verdict on that
    recorded: str  # verdict on recorded data
    found: tuple[str, ...]  # there, in words, one for each case
    heading: str  # of the set of recordings

    @property
    def alike(self) -> bool:
        """Whether both have one verdict."""
        return self.simulated == self.recorded


QUOTED = Path("reports/quoted/recorded")
"""What other reports quote of that on recorded data. It is no output of a stage: the main pipeline would run
that of recorded data first, for which most machines have none."""


def quoted_claims() -> pd.DataFrame:
    """Claims about recorded data with their counterparts, as `make recorded` left them for other reports."""
    return read_csv(QUOTED / "claims.csv", keep_default_na=False)


def on_recordings(recorded: pd.DataFrame, testbed: str, own: pd.DataFrame) -> list[OnRecordings]:
    """What was found on recorded data for the statements of a simulated testbed.

    `recorded`: `claims_table` of recorded data; `own`: its `claims_table`. Returns one entry per statement
    that was tested on both, in the order of the recorded ones.
    """
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
