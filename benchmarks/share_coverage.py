"""How often intervals of rates, and of differences of two rates of the same people, contain the truth.

Simulated people have rates of their own, beta distributed about the population's, and hit in some of their
trials. Two further populations are not beta: one person in ten has ten times the others' rate, or hits in
half of all trials.
"""

import argparse
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import count, product
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.special import ndtr
from scipy.stats import beta

from structlearn.core import rates
from structlearn.core.artefacts import write_csv
from structlearn.reporting.evidence import rate_difference

RATES = (0.001, 0.01, 0.03, 0.1, 0.25, 0.5)
CORRELATIONS = (0.0, 0.03, 0.1, 0.2, 0.3)  # intraclass
PEOPLE = (3, 5, 8, 12, 20, 40)
TRIALS = (10, 40, 120)
PAIRS = ((0.01, 0.01), (0.05, 0.001), (0.1, 0.1), (0.3, 0.1), (0.5, 0.5))
ALIKE = ((0.0, 0.0), (0.1, 0.0), (0.1, 0.9), (0.3, 0.0), (0.3, 0.9))  # intraclass, and between the two rates
BAD_PEOPLE = 0.1  # share of people who are not like the others
BAD = {"one in ten: 10 times the rate": 10.0, "one in ten: 0.5": None}
BAD_RATES = (0.06, 0.1)


@dataclass(frozen=True)
class Population:
    """People with rates of their own."""

    rate: float  # mean of people's rates
    correlation: float  # intraclass: variance of people's rates / rate (1 - rate)
    people: int
    trials: int  # of each person

    def of_quantiles(self, quantiles: np.ndarray) -> np.ndarray:
        """Rates of people, from uniform numbers of any shape."""
        if self.correlation == 0.0:
            return np.full(quantiles.shape, self.rate)
        strength = 1.0 / self.correlation - 1.0
        return beta.ppf(quantiles, strength * self.rate, strength * (1.0 - self.rate))


@dataclass(frozen=True)
class Found:
    """What intervals did in all draws."""

    coverage: float  # share of intervals that contain the truth
    above: float  # share that lie above it
    below: float
    width: float  # mean width, of rates or in percentage points


def found(low: np.ndarray, high: np.ndarray, truth: float) -> Found:
    """Coverage of intervals (draws,)."""
    above, below = np.mean(low > truth), np.mean(high < truth)
    return Found(*(round(float(one), 4) for one in (1.0 - above - below, above, below, np.mean(high - low))))


def rate_coverage(population: Population, draws: int, seed: int, own: np.ndarray | None = None) -> Found:
    """Intervals of one rate; `own`: rates of people (draws, people) if they are not beta distributed.

    All draws share a grid of rates about the truth, and the likelihoods of each count.
    """
    rng = np.random.default_rng(seed)
    people, trials, rate = population.people, population.trials, population.rate
    own = population.of_quantiles(rng.random((draws, people))) if own is None else own
    hits = rng.binomial(trials, own)
    unlike, place = np.unique(np.sort(hits), axis=0, return_inverse=True)
    having = np.stack(
        [np.bincount(draw, minlength=trials + 1) for draw in unlike]
    )  # people by number of hits
    counts = np.flatnonzero(having.any(axis=0))
    grid = rates.logit_grid(rate * people * trials, people * trials)
    likelihoods = rates.person_likelihoods(counts, np.full(len(counts), trials), grid)
    average = rates.average_likelihood(having[:, counts], likelihoods)
    ends = rates.interval_ends(average, grid, unlike.sum(axis=1), people * trials, 0.95)
    return found(*(its[place.ravel()] for its in ends), rate)


def bad_person_rates(rate: float, people: int, times: float | None, draws: int, seed: int) -> np.ndarray:
    """Rates (draws, people) with mean `rate` of which one in ten is `times` the others', or 0.5 if None."""
    bad = np.random.default_rng(seed).random((draws, people)) < BAD_PEOPLE
    if times is None:
        return np.where(bad, 0.5, (rate - 0.5 * BAD_PEOPLE) / (1.0 - BAD_PEOPLE))
    usual = rate / (1.0 + (times - 1.0) * BAD_PEOPLE)
    return np.where(bad, times * usual, usual)


def difference_coverage(first: Population, second: Population, shared: float, draws: int, seed: int) -> Found:
    """Intervals of the difference of two rates; those of a person correlate by a Gaussian copula."""
    rng = np.random.default_rng(seed)
    normal, noise = rng.standard_normal((2, draws, first.people))
    other = shared * normal + np.sqrt(1.0 - shared**2) * noise
    own = (first.of_quantiles(ndtr(normal)), second.of_quantiles(ndtr(other)))
    hits = (rng.binomial(first.trials, its) for its in own)
    trials = np.full(first.people, first.trials)
    ends = [rate_difference((one, trials), (two, trials)) for one, two in zip(*hits, strict=True)]
    low, high = np.transpose([(one.low, one.high) for one in ends])
    return found(low, high, 100 * (first.rate - second.rate))


def rows(draws: int) -> Iterator[dict[str, object]]:
    """Rows of the table, each with draws of its own."""
    seeds = count()
    for its in product(RATES, CORRELATIONS, PEOPLE, TRIALS):
        one = Population(*its)
        yield row("rate", "beta", one, rate_coverage(one, draws, next(seeds)))
    for (kind, times), rate, people, trials in product(BAD.items(), BAD_RATES, PEOPLE, TRIALS):
        seed = next(seeds)
        own = bad_person_rates(rate, people, times, draws, seed)
        one = Population(rate, round(float(own.var() / (rate * (1.0 - rate))), 3), people, trials)
        yield row("rate", kind, one, rate_coverage(one, draws, seed, own))
    for (high, low), (correlation, shared), people, trials in product(PAIRS, ALIKE, (5, 12, 40), (10, 120)):
        first, second = (Population(rate, correlation, people, trials) for rate in (high, low))
        its = difference_coverage(first, second, shared, draws // 5, next(seeds))
        yield row("difference", "beta", first, its) | {"minus_rate": low, "shared": shared}


def row(of: str, people_differ: str, population: Population, its: Found) -> dict[str, object]:
    """One row."""
    return {"of": of, "people_differ": people_differ} | asdict(population) | asdict(its)


def main() -> None:
    """Write the table, and print the least and mean coverage by number of people."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("reports/benchmarks/share_coverage.csv"))
    parser.add_argument("--draws", type=int, default=1000)
    chosen = parser.parse_args()
    table = pd.DataFrame(rows(chosen.draws))
    write_csv(table, chosen.output)
    print(table.groupby(["of", "people_differ", "people"])["coverage"].agg(["min", "mean"]).to_string())


if __name__ == "__main__":
    main()
