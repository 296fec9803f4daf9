"""Evidence: a number with its 95 % interval and sample size, made from samples or counts.

A statement on k cases holds if each case's 95 % interval says so. It fails if any case fails, and with many
cases one fails by chance: such a verdict needs the interval of confidence 1 - 0.05 / k (`Evidence.widened`).
Positive quantities (errors, costs, ratios) take `geometric_mean` or `median`, whose intervals stay positive.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from structlearn.core import rates
from structlearn.core.metrics import mean_interval, median_interval
from structlearn.reporting.prose import interval, percent, rounded

NOT_TESTED = "not tested"
Ends = tuple[float, float]


@dataclass(frozen=True)
class Evidence:
    """A number with its 95 % interval."""

    value: float  # NaN if nothing was found
    low: float  # lower end of the interval; equal to the value if it is exact (a maximum, a count)
    high: float  # upper end
    n: int  # independent samples (people, seeds, runs)
    count: int | None = None  # hits among the `n` trials, if the number is a share
    people: int | None = None  # people behind the `n` trials of a share, if one person's are correlated
    correlation: float | None = None  # of these trials within a person, as observed; None if it is unknown
    widened: Ends | None = None  # interval of confidence 1 - 0.05 / k of one of k cases; None: of one alone
    unit: str = ""
    study: str = ""  # study that it is quoted from; empty if this run computed it
    reason: str = ""  # why nothing was found
    remark: str = ""  # what must be said with the number, such as `one person`

    @property
    def refuting(self) -> Ends:
        """Interval that decides whether a statement on several cases fails in this one."""
        return self.widened or (self.low, self.high)

    def mapped(self, increasing: Callable[[float], float]) -> "Evidence":
        """Evidence on an increasing function of the number, e.g. `np.exp` of a mean of logs."""
        value, low, high, *wide = (
            float(increasing(one)) for one in (self.value, self.low, self.high, *self.refuting)
        )
        widened = (wide[0], wide[1]) if self.widened else None
        return replace(self, value=value, low=low, high=high, widened=widened)


def within(value: float, ends: Callable[[float], Ends], n: int, comparisons: int = 1) -> Evidence:
    """Evidence on one of `comparisons` cases, from the interval's ends as a function of its confidence."""
    low, high = map(float, ends(confidence(1)))
    if comparisons == 1:
        return Evidence(value, low, high, n)
    least, most = map(float, ends(confidence(comparisons)))
    return Evidence(value, low, high, n, widened=(least, most))


def confidence(comparisons: int) -> float:
    """Confidence of one interval for a joint coverage of 95 % (Bonferroni)."""
    return 1.0 - 0.05 / comparisons


def exact(value: float, n: int = 1) -> Evidence:
    """An exact number without an interval, such as the largest of n values."""
    return Evidence(float(value), float(value), float(value), n)


def maximum(samples: np.ndarray) -> Evidence:
    """Largest of N values (N,), for statements that hold for each."""
    return exact(np.max(samples), len(samples))


def minimum(samples: np.ndarray) -> Evidence:
    """Smallest of N values (N,)."""
    return exact(np.min(samples), len(samples))


def exact_count(count: int, n: int) -> Evidence:
    """Exact count in n trials, for statements about these trials rather than probabilities."""
    return Evidence(float(count), float(count), float(count), n, int(count))


def mean(samples: np.ndarray, comparisons: int = 1) -> Evidence:
    """Mean of independent samples (N,); a single sample has no interval, so it decides nothing."""
    samples = np.asarray(samples, float)
    value = float(np.mean(samples))

    def ends(confidence: float) -> Ends:
        _, half = mean_interval(samples, confidence)
        return value - half, value + half

    return within(value, ends, len(samples), comparisons)


def difference(first: np.ndarray, second: np.ndarray, comparisons: int = 1) -> Evidence:
    """Mean of paired differences first minus second, (N,) each (same seed, person, scene)."""
    return mean(np.asarray(first, float) - np.asarray(second, float), comparisons)


def geometric_mean(samples: np.ndarray, comparisons: int = 1) -> Evidence:
    """Geometric mean of independent positive samples (N,), e.g. ratios, with the interval of their logs."""
    return mean(np.log(samples), comparisons).mapped(np.exp)


def median(samples: np.ndarray, comparisons: int = 1) -> Evidence:
    """Median of independent samples (N,) of any distribution; below 6 samples it has no interval."""
    samples = np.asarray(samples, float)
    value = float(np.median(samples))
    return within(value, lambda confidence: median_interval(samples, confidence), len(samples), comparisons)


def share(count: int, n: int, comparisons: int = 1) -> Evidence:
    """Rate over n independent trials, with Clopper and Pearson's interval."""
    one_each = clustered_share(np.arange(n) < count, np.ones(n), comparisons)
    return replace(one_each, people=None)


def clustered_share(hits: np.ndarray, trials: np.ndarray, comparisons: int = 1) -> Evidence:
    """Rate over trials that are correlated within a person (model, robot); see `core.rates`.

    `hits` (P,) by person in `trials` (P,). People without trials are left out. With equally many trials, the
    rate is that of all of them; otherwise see `rates.estimate`.
    """
    hits, trials = np.asarray(hits, float), np.asarray(trials, float)
    hits, trials = hits[trials > 0], trials[trials > 0]
    if not len(trials):
        return UNKNOWN
    value, n = rates.estimate(hits, trials), int(trials.sum())

    def ends(confidence: float) -> Ends:
        low, high = rates.rate_interval(hits, trials, confidence)
        return min(low, value), max(high, value)  # a rate of very different people may lie outside

    correlation = rates.intraclass_correlation(hits, trials)
    return replace(
        within(value, ends, n, comparisons),
        count=int(hits.sum()),
        people=len(trials),
        correlation=None if np.isnan(correlation) else correlation,
    )


Counts = tuple[np.ndarray, np.ndarray]
"""Hits (P,) by person in trials (P,)."""


def rate_difference(first: Counts, second: Counts, comparisons: int = 1) -> Evidence:
    """Difference first minus second of two rates of the same people, in percentage points.

    The distances of the ends of both rates' intervals from the rates are added like standard errors (MOVER,
    Zou and Donner 2008), as correlated as people's rates certainly are (`rates.certain_correlation`).
    """
    if not np.size(first[0]):
        return UNKNOWN
    one, other = clustered_share(*first, comparisons), clustered_share(*second, comparisons)
    correlation = rates.certain_correlation(np.divide(*first), np.divide(*second))
    value = 100 * (one.value - other.value)

    def half(less: float, more: float) -> float:
        return 100 * float(np.sqrt(less**2 + more**2 - 2.0 * correlation * less * more))

    def ends(its: Ends, others: Ends) -> Ends:
        below = half(one.value - its[0], others[1] - other.value)
        return value - below, value + half(its[1] - one.value, other.value - others[0])

    widened = ends(one.refuting, other.refuting) if comparisons > 1 else None
    found = ends((one.low, one.high), (other.low, other.high))
    return Evidence(value, *found, len(first[0]), widened=widened)


def smallest(found: Iterable[Evidence]) -> Evidence:
    """The smallest of several numbers, for "all are above": an unknown one makes it unknown.

    Its interval begins at the lowest lower end of the cases and ends at the lowest upper end of their widened
    intervals: a bound lies below it if it lies below every case, and above it if above any.
    """
    found = list(found)
    unknown = [one for one in found if not np.isfinite([one.value, one.low, one.high]).all()]
    if not found or unknown:
        return unknown[0] if unknown else UNKNOWN
    least = min(found, key=lambda one: one.value)
    low, high = min(one.low for one in found), min(one.refuting[1] for one in found)
    return replace(least, low=low, high=high, widened=None)


def largest(found: Iterable[Evidence]) -> Evidence:
    """The largest of several numbers, for "all are below"; see `smallest`."""
    least = smallest(_negative(one) for one in found)
    return _negative(least) if np.isfinite(least.value) else least


def _negative(found: Evidence) -> Evidence:
    widened = (-found.widened[1], -found.widened[0]) if found.widened else None
    return replace(found, value=-found.value, low=-found.high, high=-found.low, widened=widened)


UNKNOWN = Evidence(float("nan"), float("nan"), float("nan"), 0)  # nothing was tested


def unknown(reason: str) -> Evidence:
    """No evidence, with the reason why."""
    return replace(UNKNOWN, reason=reason)


Found = Evidence | Mapping[str, Evidence]  # a single number, or one by case


def in_words(found: Evidence, number_format: str, unit: str = "") -> str:
    """Evidence as text with its remark, e.g. `0.36 [0.30, 0.42] rad (one person)`, see `_number`."""
    known = replace(found, low=found.value, high=found.value) if np.isinf(found.low) else found
    text = _number(known, number_format, unit)
    return f"{text} ({found.remark})" if found.remark else text


def _number(found: Evidence, number_format: str, unit: str) -> str:
    """Evidence as text, e.g. `0.36 [0.30, 0.42] rad`, `26 % [22, 30]`; in its own unit if none is given.

    A share of people has its intraclass correlation (ICC): `1.2 % [0.4, 2.3] over 40 people, ICC 0.08`. Rates
    are never rounded to 0 or 100 % unless they are exactly that.
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
        text = percent(found.value, 1, 1)
        if found.low != found.high:
            text += f" {interval(100 * found.low, 100 * found.high)}"
        if found.people is None:
            return text
        text += " over 1 person" if found.people == 1 else f" over {found.people} people"
        return text if found.correlation is None else f"{text}, ICC {rounded(found.correlation, '.2f')}"
    text = rounded(found.value, number_format)
    if found.low != found.high:
        text += f" {interval(found.low, found.high, number_format)}"
    return f"{text} {unit or found.unit}".rstrip()


def number_in_words(found: Evidence, number_format: str) -> str:
    """The number alone, e.g. `0.36`, `26 %`, `3 of 63`; see `in_words`."""
    if np.isnan(found.value):
        return NOT_TESTED
    if number_format == "share":
        return percent(found.value, 1, 1)
    alone = replace(found, low=found.value, high=found.value, unit="", remark="")
    return _number(alone, number_format, "")
