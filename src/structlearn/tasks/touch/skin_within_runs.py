"""Errors on the end of each run of a skin after training on its start, as the authors of public runs test.

Every place, depth and force recurs in a run, and so does the path: the end holds nothing new.
"""

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd

from structlearn.readers.touch_log import TouchLog
from structlearn.tactile.pressed_skin import PLANE
from structlearn.tasks.touch.parameters import PublishedErrors
from structlearn.tasks.touch.skin_readings import Estimate, gaussian_process
from structlearn.tasks.touch.skin_touches import NEVER_VARIES

NETWORK = {"hidden_layer_sizes": (128, 128), "batch_size": 64, "learning_rate_init": 1e-3, "alpha": 0.0}
"""The authors' perceptron with its training by Adam (notvenky/eFlesh, `characterization/train.py`)."""

# s before a reading, first and last: skins creep, so force depends on what was felt seconds ago
RECENT_S = ((0.0, 0.2), (0.8, 1.2), (2.6, 3.4), (5.5, 6.5))
MEAN_OF = 7  # times in such a span, whose counts are averaged against noise

TENTHS = 10
"""Stretches of a run's end, over which errors are compared: successive readings are not independent."""


def within_runs(logs: Sequence[TouchLog], published: PublishedErrors) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Errors of a Gaussian process, and of forces by the authors' network, on the end of each run.

    A run whose channels differ from the first run's is of two skins, and its force is a shear force. Inputs
    of the process (`PLACE_INPUTS`, `FORCE_INPUTS`) are chosen per run, on the end of the training part.

    Returns:
        `run`, `quantity` (`place_mm`, `force_n`, `shear_n`), `seen` (the inputs), `rms`, the number of
        `readings` tested on, their standard deviation in the run, `spread`, and the network's `network_rms`
        and `network_training_rms` (NaN for places).
        `run` and `over_network`, the rms force error over the network's, of each tenth of the end.
    """
    rows, rivals, share = [], [], published.first_share
    for log in logs:
        kept, quantity, wanted = np.full(len(log.counts), True), "place_mm", log.place
        if log.force is not None:
            kept, wanted = np.isfinite(log.force), log.force[:, None]
            quantity = "force_n" if log.channels == logs[0].channels else "shear_n"
        elif wanted is not None:
            wanted = 1e3 * wanted[:, :PLANE]
        if wanted is None:
            continue
        wanted, end, alike = wanted[kept], round(share * kept.sum()), log.force is not None
        candidates = FORCE_INPUTS if alike else PLACE_INPUTS
        seen = {name: inputs(log)[kept] for name, inputs in candidates.items()}
        inner = 1.0 - (1.0 - share) / share
        tried = {
            name: np.mean(_end_errors(part[:end], wanted[:end], inner, alike) ** 2)
            for name, part in seen.items()
        }
        best = min(tried, key=lambda name: tried[name])
        missed = _end_errors(seen[best], wanted, share, alike)
        spread = np.sqrt(np.var(wanted, axis=0).sum())
        network = (np.nan, np.nan)
        if alike:
            theirs = _network_errors(log, end, published.epochs)
            network = rms(theirs[end:]), rms(theirs[:end])
            tenths = zip(*(np.array_split(errors, TENTHS) for errors in (missed, theirs[end:])), strict=True)
            rivals += [(log.name, rms(ours) / rms(other)) for ours, other in tenths]
        rows.append((log.name, quantity, best, rms(missed), len(missed), spread, *network))
    names = ["run", "quantity", "seen", "rms", "readings", "spread", "network_rms", "network_training_rms"]
    return pd.DataFrame(rows, columns=names), pd.DataFrame(rivals, columns=["run", "over_network"])


def rms(errors: np.ndarray) -> float:
    """Root mean square of errors (N,)."""
    return float(np.sqrt(np.mean(errors**2)))


def _end_errors(seen: np.ndarray, wanted: np.ndarray, share: float, alike: bool) -> np.ndarray:
    """Errors (norms) of a Gaussian process on the end of a run, after training on its first share.

    `alike`: inputs have the same noise and are scaled together, else each is standardised.
    """
    end = round(share * len(seen))
    spread = np.maximum(seen[:end].std(axis=0), NEVER_VARIES)
    if alike:
        spread = np.sqrt(np.mean(spread**2))
    signals = (seen - seen[:end].mean(axis=0)) / spread
    read = gaussian_process(signals[:end], wanted[:end], end)
    return np.linalg.norm(read(signals[end:]) - wanted[end:], axis=1)


def _network_errors(log: TouchLog, end: int, epochs: int) -> np.ndarray:
    """Force errors (R,) in N of the authors' network at all readings of the scale, of which it knows `end`.

    As theirs, it learns from all samples of the skin, each with the nearest reading of the scale. Units are
    those of the training part alone, while theirs are those of the whole run.
    """
    assert log.force is not None
    assert log.time is not None
    weighed = np.flatnonzero(np.isfinite(log.force))
    known = np.arange(weighed[end - 1] + 1)
    nearest = np.rint(np.interp(log.time[known], log.time[weighed[:end]], np.arange(end))).astype(int)
    read = authors_network(log.counts[known], log.force[weighed[nearest]], epochs)
    return read(log.counts[weighed]) - log.force[weighed]


def authors_network(known: np.ndarray, wanted: np.ndarray, epochs: int) -> Estimate:
    """Perceptron of the set's authors from counts (N, E) to force (N,) in N, after a number of epochs."""
    from sklearn.neural_network import MLPRegressor

    middle, spread = known.mean(axis=0), np.maximum(known.std(axis=0), NEVER_VARIES)
    mean, unit = wanted.mean(), max(wanted.std(), NEVER_VARIES)

    def signals(counts: np.ndarray) -> np.ndarray:
        return ((counts - middle) / spread).astype(np.float32)

    network = MLPRegressor(**NETWORK, random_state=0)
    for _ in range(epochs):
        network.partial_fit(signals(known), ((wanted - mean) / unit).astype(np.float32))
    return lambda counts: mean + unit * network.predict(signals(counts)).astype(float)


def _directions(log: TouchLog) -> np.ndarray:
    """Counts divided by their norm, and the logarithm of the norm."""
    norm = np.maximum(np.linalg.norm(log.counts, axis=1, keepdims=True), 1.0)
    return np.hstack([log.counts / norm, np.log(norm)])


def _recent(log: TouchLog) -> np.ndarray:
    """Mean counts in each of `RECENT_S`; counts before the first reading are as in it."""
    assert log.time is not None
    spans = []
    for first, last in RECENT_S:
        times = log.time[:, None] - np.linspace(first, last, MEAN_OF)
        spans += [np.interp(times, log.time, values).mean(axis=1) for values in log.counts.T]
    return np.stack(spans, axis=1)


def _counts(log: TouchLog) -> np.ndarray:
    return log.counts


Inputs = dict[str, Callable[[TouchLog], np.ndarray]]  # of the Gaussian process, by name
PLACE_INPUTS: Inputs = {"counts": _counts, "counts over their norm": _directions}
# earlier readings would reveal the probe's path over places
FORCE_INPUTS: Inputs = {"counts": _counts, "counts of the last 6 s": _recent}
