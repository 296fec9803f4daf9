"""Dynamic time warping with the path, beside dtaidistance and tslearn.

`segmentation.dtw.correspondences` sums Euclidean distances. The peers' ways to the same path:

- tslearn `dtw_path_from_metric(metric="euclidean")`, numpy backend, compiled by numba.
- dtaidistance `warping_paths_fast(inner_dist="euclidean")` in C, then `best_path`.

Both libraries have a quicker routine that sums squared distances and cannot do otherwise: tslearn `dtw_path`,
dtaidistance `warping_path_fast`, C throughout. The recurrence and the size are the same but the path is
another one, so they are rows of their own, called "squared", and held against their own optimum.

Last, the alignment of every g-th sample only, which divides the work by g^2 (dissertation, appendix C).
"""

from collections.abc import Callable
from functools import cache, partial

import numpy as np
from timing import Case, Contender, measure

from structlearn.core.signals import standardise
from structlearn.segmentation.dtw import correspondences

SEED = 4
LONGEST = 3000  # samples of the signals that are down-sampled
FACTORS = (2, 4, 8)  # g
RATIO_SECONDS = 1.0  # some twenty rounds; notes are written before the rows are timed, so apart from them


def signals(samples: int, axes: int) -> tuple[np.ndarray, np.ndarray]:
    """A smooth signal, and the same at another pace with noise; both standardised, (samples, axes)."""
    rng = np.random.default_rng(SEED)
    time = np.linspace(0.0, 1.0, samples)
    pace = time + 0.08 * np.sin(2.0 * np.pi * time)
    waves = rng.uniform(1.0, 12.0, (6, axes)), rng.uniform(0.0, 2.0 * np.pi, (6, axes))
    pair = [
        np.sin(2.0 * np.pi * waves[0] * clock[:, None, None] + waves[1]).sum(axis=1) for clock in (time, pace)
    ]
    reference, guess = (signal + 0.05 * rng.normal(size=signal.shape) for signal in pair)
    return standardise(reference), standardise(guess)


def cheapest_cost(distances: np.ndarray) -> float:
    """Cost of the cheapest warping path, by plain dynamic programming along the antidiagonals."""
    rows, columns = distances.shape
    costs = np.full((rows + 1, columns + 1), np.inf)
    costs[0, 0] = 0.0
    for diagonal in range(rows + columns - 1):
        i = np.arange(max(0, diagonal - columns + 1), min(rows, diagonal + 1))
        j = diagonal - i
        costs[i + 1, j + 1] = distances[i, j] + np.minimum(
            np.minimum(costs[i, j], costs[i, j + 1]), costs[i + 1, j]
        )
    return float(costs[-1, -1])


def path_cost(path: np.ndarray, distances: np.ndarray) -> float:
    """Cost of a full warping path (K, 2); infinite when it is none."""
    steps, ends = np.diff(path, axis=0), path[[0, -1]]
    whole = np.array_equal(ends, [[0, 0], np.array(distances.shape) - 1])
    if not whole or steps.min() < 0 or steps.max() > 1 or not steps.any(axis=1).all():
        return np.inf
    return float(distances[tuple(path.T)].sum())


def completed_cost(pairs: np.ndarray, distances: np.ndarray) -> float:
    """Cost of the cheapest warping path whose matching moves are exactly the given pairs (K, 2)."""
    cost, corner = 0.0, (0, 0)
    for i, j in [*pairs, distances.shape]:
        gap = distances[corner[0] : i, corner[1] : j]  # crossed by insertions and deletions only
        costs = np.cumsum(gap[0])
        for row in gap[1:]:
            costs[0] += row[0]
            for column in range(1, len(row)):
                costs[column] = min(costs[column - 1], costs[column]) + row[column]
        cost += costs[-1]
        corner = (i, j)
    return cost


def case(samples: int, axes: int, aim_ms: float) -> Case:
    """Warping of two signals of equal length."""
    reference, guess = signals(samples, axes)
    squared = np.sum((reference[:, None] - guess) ** 2, axis=-1)
    euclidean = np.sqrt(squared)
    cheapest = {"euclidean": cheapest_cost(euclidean), "squared": cheapest_cost(squared)}
    first, second = (signal if axes > 1 else signal[:, 0].copy() for signal in (reference, guess))

    def ours_error(pairs: np.ndarray) -> float:
        return abs(completed_cost(pairs, euclidean) / cheapest["euclidean"] - 1.0)

    def error(path: list, metric: str) -> float:
        distances = euclidean if metric == "euclidean" else squared
        return abs(path_cost(np.array(path), distances) / cheapest[metric] - 1.0)

    def tslearn() -> Contender:
        from tslearn.metrics import dtw_path_from_metric

        return Contender(
            lambda: dtw_path_from_metric(reference, guess, metric="euclidean")[0],
            partial(error, metric="euclidean"),
        )

    def tslearn_squared() -> Contender:
        from tslearn.metrics import dtw_path

        return Contender(lambda: dtw_path(reference, guess)[0], partial(error, metric="squared"))

    def dtaidistance() -> Contender:
        from dtaidistance import dtw

        def run() -> list:
            _, paths = dtw.warping_paths_fast(first, second, use_ndim=axes > 1, inner_dist="euclidean")
            return dtw.best_path(paths)

        return Contender(run, partial(error, metric="euclidean"))

    def dtaidistance_squared() -> Contender:
        from dtaidistance import dtw

        return Contender(lambda: dtw.warping_path_fast(first, second), partial(error, metric="squared"))

    return Case(
        work=f"DTW with path {samples}^2, {axes}-D",
        ours=Contender(lambda: correspondences(reference, guess), ours_error),
        peers={
            "tslearn": tslearn,
            "dtaidistance": dtaidistance,
            "tslearn, squared": tslearn_squared,
            "dtaidistance, squared": dtaidistance_squared,
        },
        aim_ms=aim_ms,
        tolerance=1e-9,
        note="ours includes the standardisation, the peers are given standardised signals",
    )


def downsampled_case(factor: int) -> Case:
    """Alignment of every g-th sample of two long scalar signals (appendix C)."""
    return Case(
        work=f"DTW with path {LONGEST}^2, 1-D, g = {factor}",
        ours=_downsampled(factor),
        tolerance=1e-9,
        note=f"takes {time_ratios()[factor]:.3g} of the time of g = 1, the two measured in turns; "
        f"1 / g^2 = {factor**-2:.3g}",
    )


@cache
def time_ratios() -> dict[int, float]:
    """Time of the alignment by factor, relative to g = 1; timed in turns, as the machine's speed drifts."""
    peers = {f"g = {factor}": partial(_downsampled, factor) for factor in FACTORS}
    rows = measure(Case("down-sampling", _downsampled(1), peers, tolerance=1e-9), RATIO_SECONDS)
    return {factor: row.ratio for factor, row in zip(FACTORS, rows, strict=True)}


def _downsampled(factor: int) -> Contender:
    """The alignment as `segmentation.segments` does it, held against the optimum of the samples it uses."""
    reference, guess = signals(LONGEST, 1)
    distances = np.abs(standardise(reference[::factor]) - standardise(guess[::factor]).T)
    cheapest = cheapest_cost(distances)
    return Contender(
        lambda: factor * correspondences(reference[::factor], guess[::factor]),
        lambda pairs: abs(completed_cost(pairs // factor, distances) / cheapest - 1.0),
    )


CASES: tuple[Callable[[], Case], ...] = (
    partial(case, 1000, 1, 3.0),
    partial(case, 1000, 3, 5.0),
    partial(case, LONGEST, 1, 30.0),
    *(partial(downsampled_case, factor) for factor in FACTORS),
    partial(case, LONGEST, 3, 50.0),
)
