"""Evidence: a number with its 95 % interval and sample size, made from samples or counts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from structlearn.core.metrics import mean_interval, wilson_interval
from structlearn.reporting.prose import interval, percent, rounded

NOT_TESTED = "not tested"


@dataclass(frozen=True)
class Evidence:
    """A number with its 95 % interval, widened if several comparisons are made at once."""

    value: float  # NaN if nothing was found
    low: float  # lower end of the interval; equal to the value if it is exact (a maximum, a count)
    high: float  # upper end
    n: int  # independent samples (people, seeds, runs)
    count: int | None = None  # hits among the `n` trials, if the number is a share
    people: int | None = None  # people behind the `n` trials of a share, if one person's are correlated
    pooled_low: float = float("nan")  # lower end of the share's interval if all trials were independent
    pooled_high: float = float("nan")  # its upper end
    study: str = ""  # study that it is quoted from; empty if this run computed it
    reason: str = ""  # why nothing was found
    remark: str = ""  # what must be said with the number, such as `one person`


def exact(value: float, n: int = 1) -> Evidence:
    """An exact number without an interval, such as the largest of n values."""
    return Evidence(float(value), float(value), float(value), n)


def largest(samples: np.ndarray) -> Evidence:
    """Largest of N values (N,), for statements that hold for each."""
    return exact(np.max(samples), len(samples))


def smallest(samples: np.ndarray) -> Evidence:
    """Smallest of N values (N,)."""
    return exact(np.min(samples), len(samples))


def mean(samples: np.ndarray, comparisons: int = 1) -> Evidence:
    """Mean of independent samples (N,); a single sample has an infinite interval, so it decides nothing."""
    value, half = mean_interval(np.asarray(samples, float), confidence(comparisons))
    return Evidence(value, value - half, value + half, len(samples))


def difference(first: np.ndarray, second: np.ndarray, comparisons: int = 1) -> Evidence:
    """Mean of paired differences first minus second, (N,) each (same seed, person, scene)."""
    return mean(np.asarray(first, float) - np.asarray(second, float), comparisons)


def geometric_mean(samples: np.ndarray, comparisons: int = 1) -> Evidence:
    """Geometric mean of independent positive samples (N,), e.g. ratios, with the interval of their logs."""
    found = mean(np.log(samples), comparisons)
    value, low, high = (float(np.exp(log)) for log in (found.value, found.low, found.high))
    return Evidence(value, low, high, found.n)


def share(count: int, n: int, comparisons: int = 1) -> Evidence:
    """Rate over independent trials with Wilson's interval; for correlated trials see `clustered_share`."""
    if n == 0:
        return UNKNOWN
    low, high = wilson_interval(count, n, confidence(comparisons))
    value = count / n
    return Evidence(value, min(float(low), value), max(float(high), value), n, int(count))


def clustered_share(counts: np.ndarray, trials: np.ndarray, comparisons: int = 1) -> Evidence:
    """Rate over trials that are correlated within a person (model, robot), with an interval over people.

    The interval is that of the people's rates by the t distribution, at least Wilson's over all trials. If no
    trial is a hit, or every one is, the rates do not show how people differ, and the interval ends at
    `none_of(P)`: none of 8 people allows up to 31 %. For rare events in few, very different people it is too
    narrow: at 5 % and an intraclass correlation of 0.1, the interval for 8 people covers in 85 % of all
    draws, Wilson's over all trials in 52 %. `counts` (P,): hits by person in `trials` (P,), positive.
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
    """Exact upper limit of a population's share if none of `people` has it: 1 - alpha^(1 / people)."""
    return 1.0 - (1.0 - confidence(comparisons)) ** (1.0 / people)


def rate_difference(first: np.ndarray, second: np.ndarray, comparisons: int = 1) -> Evidence:
    """Mean difference of people's rates (P,) in %; bounded by `none_of` if nobody's two rates differ."""
    first, second = np.asarray(first, float), np.asarray(second, float)
    found = difference(100 * first, 100 * second, comparisons)
    if np.array_equal(first, second):
        bound = 100 * none_of(len(first), comparisons)
        found = replace(found, low=-bound, high=bound)
    return found


def by_case(make: Callable[..., Evidence], cases: Mapping[str, Sequence[Any]]) -> dict[str, Evidence]:
    """Evidence by case: `make(*arguments, comparisons=number of cases)` for each."""
    return {name: make(*arguments, comparisons=len(cases)) for name, arguments in cases.items()}


def confidence(comparisons: int) -> float:
    """Confidence of one interval for a joint coverage of 95 % (Bonferroni)."""
    return 1.0 - 0.05 / comparisons


def exact_count(count: int, n: int) -> Evidence:
    """Exact count in n trials, for statements about these trials rather than probabilities."""
    return Evidence(float(count), float(count), float(count), n, int(count))


UNKNOWN = Evidence(float("nan"), float("nan"), float("nan"), 0)  # nothing was tested


def unknown(reason: str) -> Evidence:
    """No evidence, with the reason why."""
    return replace(UNKNOWN, reason=reason)


Found = Evidence | Mapping[str, Evidence]  # a single number, or one by case


def in_words(found: Evidence, number_format: str, unit: str = "") -> str:
    """Evidence as text with its remark, see `_in_words`."""
    text = _in_words(
        replace(found, low=found.value, high=found.value) if np.isinf(found.low) else found,
        number_format,
        unit,
    )
    return f"{text} ({found.remark})" if found.remark else text


def _in_words(found: Evidence, number_format: str, unit: str) -> str:
    """Evidence as text, e.g. `0.36 [0.30, 0.42] rad`, `26 % [22, 30]`; shares of people have both intervals.

    A rate is never rounded to 0 or 100 % unless it is exactly that.
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
