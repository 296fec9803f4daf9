"""Rates of trials that are correlated within a person (a model, a robot), and their intervals.

Each person has a rate of its own. The rates scatter about the population's rate p by r times the largest
scatter possible, so that r^2 is the intraclass correlation, and are taken to be beta distributed, hence hits
beta-binomial. Before the data, every r from 0 to sqrt(`MOST_ALIKE`) counts alike; the counts decide:

    L(p) = mean over r of prod_i BetaBinomial(c_i; m_i, p, r^2)

The interval ends at a quantile of L(p) / p below and of L(p) / (1 - p) above, as if there were one hit less
or one more. With one trial each, this is Clopper and Pearson's interval; no hits have the lowest upper end of
all counts. A bound on the correlation is needed: 0 hits of 40 people, each of whom might hit always or never,
allow 7 %. `benchmarks/share_coverage.py` measures how often the intervals contain the rate.
"""

import numpy as np
from scipy.special import expit, gammaln, log_expit, logit, ndtri

MOST_ALIKE = 0.5  # largest intraclass correlation that is allowed for
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)  # quadrature over r
_CORRELATIONS = MOST_ALIKE * (0.5 + 0.5 * _NODES) ** 2  # (R,)
_STEPS = np.linspace(-1.0, 1.0, 513)  # (G,) of the grid over rates
_FARTHEST = 38.0  # end of the grid in logits: a rate of 3e-17


def rate_interval(hits: np.ndarray, trials: np.ndarray, confidence: float = 0.95) -> tuple[float, float]:
    """Interval of the population's rate from the hits (P,) of people with so many trials (P,), positive."""
    (own, of), people = np.unique(np.stack([hits, trials]), axis=1, return_counts=True)
    grid = logit_grid(np.sum(hits), np.sum(trials))
    found = average_likelihood(people, person_likelihoods(own, of, grid))
    low, high = interval_ends(found, grid, np.sum(hits), np.sum(trials), confidence)
    return float(low), float(high)


def logit_grid(hits: float, trials: float) -> np.ndarray:
    """Logits (G,) of rates, densest where so many hits of independent trials put the rate."""
    rate = (hits + 0.5) / (trials + 1.0)
    width = 1.0 / np.sqrt(trials * rate * (1.0 - rate))
    return logit(rate) + width * np.sinh(np.arcsinh(_FARTHEST / width) * _STEPS)


def person_likelihoods(hits: np.ndarray, trials: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Log beta-binomial likelihoods (U, R, G) of hits (U,) in trials (U,), by correlation and rate."""
    strength = (1.0 / _CORRELATIONS - 1.0)[:, np.newaxis]  # sum of the beta distribution's parameters

    def rising(start: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Log of start (start + 1) ... (start + steps - 1)."""
        return gammaln(start + np.reshape(steps, (-1, 1, 1))) - gammaln(start)

    hit, missed = strength * expit(grid), strength * expit(-grid)
    return rising(hit, hits) + rising(missed, np.subtract(trials, hits)) - rising(strength, trials)


def average_likelihood(people: np.ndarray, likelihoods: np.ndarray) -> np.ndarray:
    """Log L (..., G) of numbers of people (..., U) with each of the `person_likelihoods` (U, R, G)."""
    shape = likelihoods.shape
    of_all = (people @ likelihoods.reshape(shape[0], -1)).reshape(*people.shape[:-1], *shape[1:])
    highest = of_all.max(axis=-2, keepdims=True)
    of_all -= highest
    return np.log(_WEIGHTS @ np.exp(of_all, out=of_all)) + highest[..., 0, :]


def interval_ends(
    log_likelihood: np.ndarray, grid: np.ndarray, hits: np.ndarray, trials: np.ndarray, confidence: float
) -> tuple[np.ndarray, np.ndarray]:
    """Ends (...) of intervals from log L (..., G) and the total hits and trials (...)."""
    tail = 0.5 * (1.0 - confidence)
    # with dp = p (1 - p) dlogit, L(p) / p has the density L (1 - p) over the logit
    low = _quantile(log_likelihood + log_expit(-grid), grid, tail)
    high = _quantile(log_likelihood + log_expit(grid), grid, 1.0 - tail)
    return np.where(np.equal(hits, 0), 0.0, low), np.where(np.equal(hits, trials), 1.0, high)


def _quantile(log_density: np.ndarray, grid: np.ndarray, share: float) -> np.ndarray:
    """Rate (...) at a quantile of densities (..., G) over the logit."""
    density = np.exp(log_density - log_density.max(axis=-1, keepdims=True))
    mass = np.cumsum(0.5 * (density[..., 1:] + density[..., :-1]) * np.diff(grid), axis=-1)
    wanted = share * mass[..., -1:]
    after = np.argmax(mass >= wanted, axis=-1)[..., np.newaxis]  # step in which it lies
    reached = np.take_along_axis(mass, after, -1)
    step = reached - np.where(after > 0, np.take_along_axis(mass, np.maximum(after - 1, 0), -1), 0.0)
    back = (reached - wanted) / step
    return expit(grid[after + 1] - back * (grid[after + 1] - grid[after]))[..., 0]


def intraclass_correlation(hits: np.ndarray, trials: np.ndarray) -> float:
    """Correlation of two trials of one person (analysis of variance), from hits (P,) in trials (P,).

    NaN if it cannot be seen: all trials are alike, there is one person, or nobody has two trials.
    """
    hits, trials = np.asarray(hits, float), np.asarray(trials, float)
    people, n, rate = len(hits), trials.sum(), hits.sum() / trials.sum()
    if people < 2 or n == people or rate in (0.0, 1.0):
        return float("nan")
    between = np.sum(trials * (hits / trials - rate) ** 2) / (people - 1)
    within = np.sum(hits * (1.0 - hits / trials)) / (n - people)
    usual = (n - np.sum(trials**2) / n) / (people - 1)  # trials of a person
    return float((between - within) / (between + (usual - 1.0) * within))


def estimate(hits: np.ndarray, trials: np.ndarray) -> float:
    """Population's rate: mean of people's rates, weighted as their trials correlate (Kleinman 1973).

    With correlation rho, m trials of a person count like m / (1 + (m - 1) rho) independent ones: the rate is
    that of all trials if nothing correlates or all have equally many, else nearer the mean of people's rates.
    """
    correlation = np.clip(np.nan_to_num(intraclass_correlation(hits, trials)), 0.0, MOST_ALIKE)
    return float(np.average(hits / trials, weights=trials / (1.0 + (trials - 1.0) * correlation)))


def certain_correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Correlation of people's two rates (P,) that is exceeded in 95 % of cases (Fisher's z), at least 0."""
    people = len(first)
    if people < 4 or np.ptp(first) == 0.0 or np.ptp(second) == 0.0:
        return 0.0
    found = np.clip(np.corrcoef(first, second)[0, 1], 0.0, 1.0 - 1.0 / people)  # the next person's may differ
    return max(0.0, float(np.tanh(np.arctanh(found) - ndtri(0.95) / np.sqrt(people - 3))))
