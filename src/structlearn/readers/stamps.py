"""Which clock stamps a message, and what becomes of stamps that do not increase."""

from bisect import bisect_left
from typing import Literal

import numpy as np

from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.readers.checks import disorder


class StampPolicy(Parameters):
    """How the stamps of a user's messages are taken."""

    # `header`: when a sample was taken; the log time where no message of a topic says so. `log`: when the
    # recorder got it
    clock: Literal["header", "log"]
    # where a stamp repeats or runs back, `error`: refuse the recording; `drop`: leave out as few samples as
    # possible; `sort`: put them in order. Of several with one stamp the first stays
    disorder: Literal["error", "drop", "sort"]


AS_WRITTEN = StampPolicy(clock="header", disorder="error")
"""How our own files are read: whoever wrote them had the stamps in order."""


def in_order(where: str, stamps: np.ndarray, policy: StampPolicy) -> tuple[np.ndarray, str | None]:
    """Rows (M,) of samples whose stamps (T,) in ns increase, and what was done in words; None: nothing was.

    Raises:
        InputError: the stamps do not increase and the policy is `error`; the message names the row.
    """
    fault = disorder(stamps)
    if fault is None:
        return np.arange(len(stamps)), None
    if policy.disorder == "error":
        raise InputError(f"{where}: {fault}; with `disorder: drop` or `sort` under `stamps` it is mended")
    if policy.disorder == "drop":
        rows = longest_increase(stamps)
        return rows, f"{len(stamps) - len(rows)} dropped of {len(stamps)}"
    rows = np.argsort(stamps, kind="stable")
    rows = rows[np.append(True, np.diff(stamps[rows]) > 0)]
    moved = int(np.sum(stamps < np.maximum.accumulate(stamps)))
    return rows, f"{moved} moved and {len(stamps) - len(rows)} dropped of {len(stamps)}"


def longest_increase(stamps: np.ndarray) -> np.ndarray:
    """Places (M,) of the longest strictly increasing subsequence of (T,) numbers, by patience sorting.

    Dropping all that is not later than the latest so far would lose everything behind one far stamp.
    """
    ends: list[int] = []  # smallest last stamp of an increase of each length ...
    places: list[int] = []  # ... and where it is
    before = np.full(len(stamps), -1)
    for place, stamp in enumerate(stamps.tolist()):
        length = bisect_left(ends, stamp)
        if length:
            before[place] = places[length - 1]
        ends[length : length + 1], places[length : length + 1] = [stamp], [place]
    rows = np.empty(len(ends), dtype=int)
    place = places[-1]
    for row in reversed(range(len(rows))):
        rows[row] = place
        place = before[place]
    return rows
