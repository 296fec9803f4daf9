"""What paired differences over seeds say of a statement that should hold for every one of several things."""

from collections.abc import Mapping

import numpy as np

from structlearn.ground.metrics import mean_interval, verdict
from structlearn.reporting.claim_rows import HOLDS
from structlearn.reporting.prose import listing, with_interval

Pairs = Mapping[str, tuple[np.ndarray, np.ndarray]]
"""By name, values over seeds of which the first should be larger."""


def gains(pairs: Pairs, number_format: str = ".3f") -> tuple[str, str]:
    """The differences with their 95 % intervals, and whether the statement holds.

    Args:
        pairs: see there.
        number_format: of the differences.
    """
    found, words = [], {}
    for name, (larger, smaller) in pairs.items():
        mean, half = mean_interval(larger - smaller)
        found.append(f"{name} {with_interval(mean, half, number_format)}")
        words[name] = HOLDS[str(verdict(mean - half, mean + half))]
    if len(set(words.values())) == 1:
        return "; ".join(found), next(iter(words.values()))
    parts = [
        f"{word}: {listing(name for name, its in words.items() if its == word)}"
        for word in dict.fromkeys(words.values())
    ]
    return "; ".join(found), "; ".join(parts)
