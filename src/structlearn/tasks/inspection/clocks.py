"""Clocks of a recorded topic: rates, gaps, disorder, delays. Disorder is counted, not corrected."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from structlearn.readers.decoded_messages import decoded
from structlearn.readers.messages import fields_named, nanoseconds
from structlearn.readers.raw_messages import RawMessages


@dataclass(frozen=True)
class Stamps:
    """Statistics of one clock; the rate is one over the median step (NaN for a single stamp).

    `repeated` and `backward` count messages whose stamp equals, or is earlier than, the one before.
    """

    count: int
    first_s: float
    last_s: float
    rate_hz: float
    largest_gap_s: float
    gap_at_s: float
    repeated: int
    backward: int

    @property
    def disorder(self) -> float:
        """Share of stamps that are not later than the one before."""
        return (self.repeated + self.backward) / self.count


class TopicClocks(NamedTuple):
    """Clock of the recorder, and of the message headers (None if no header is set)."""

    log: Stamps
    header: Stamps | None = None
    delay_s: float = np.nan  # median of log time minus header stamp

    @property
    def own(self) -> Stamps:
        """The clock used for reading: the header's if set, otherwise the recorder's."""
        return self.header or self.log


def topic_clocks(where: str, messages: RawMessages) -> TopicClocks:
    """Both clocks of a topic with at least one message; messages with transforms use the first one's header.

    Raises InputError: a message cannot be decoded, or its stamp contradicts itself.
    """
    log, headers = stamp_statistics(messages.log_times), np.zeros(len(messages.log_times), dtype=np.int64)
    with fields_named(where):
        for group in decoded(where, messages):
            transforms = getattr(group.message, "transforms", None)
            first = transforms[0] if transforms else group.message
            if hasattr(first, "header"):
                headers[group.rows] = nanoseconds(first.header.stamp)
    if not headers.any():
        return TopicClocks(log)
    delays_s = 1e-9 * (messages.log_times - headers)  # exact: the difference is taken in int64
    return TopicClocks(log, stamp_statistics(headers), float(np.median(delays_s)))


def stamp_statistics(stamps: np.ndarray) -> Stamps:
    """Rate, gaps and disorder of stamps (T,) int64 ns, in message order."""
    steps, ordered = np.diff(stamps), np.unique(stamps)
    gaps_s = 1e-9 * np.diff(ordered) if len(ordered) > 1 else np.array([np.nan])
    at = int(np.argmax(gaps_s))
    first_s, last_s = 1e-9 * int(ordered[0]), 1e-9 * int(ordered[-1])
    rate_hz, gap_at_s = 1.0 / float(np.median(gaps_s)), 1e-9 * int(ordered[at] - ordered[0])
    repeated, backward = int((steps == 0).sum()), int((steps < 0).sum())
    return Stamps(len(stamps), first_s, last_s, rate_hz, float(gaps_s[at]), gap_at_s, repeated, backward)
