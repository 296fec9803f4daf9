"""The clocks of a topic, before anybody has said what it means: rates, gaps, jitter, disorder, delays.

Nothing is refused here: disorder is counted, not mended, and most numbers need no more of a message than its
stamp. A header is the first field of every message type that has one, so it stands at one place in the bytes
of all of them, also of types that nobody here can decode. Of several transforms in a message the first one's
counts.
"""

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
from mcap.records import Schema
from mcap.well_known import SchemaEncoding

from structlearn.readers.bag import RawMessages

INNER = (5.0, 95.0)
"""Percentiles between which jitter and spread are taken: nine of ten samples, whatever the rest does."""

END_SHARE = 0.1
"""Share of a topic's messages at either end whose delays are compared for a drift of the clocks."""

_HEADERS = {
    re.compile(r"(std_msgs/(msg/)?)?Header\s+\w+"): 4,
    re.compile(r"(geometry_msgs/(msg/)?)?TransformStamped\[\]\s+\w+"): 8,
}
"""First fields of definitions, and the byte where the stamp stands: behind the encapsulation, and behind the
number of transforms."""


@dataclass(frozen=True)
class Stamps:
    """One clock of a topic.

    The rate is one over the median step (NaN of a single stamp), the jitter half the range of the inner nine
    tenths of the steps; `repeated` and `backward` messages have the stamp of the one before, or an earlier.
    """

    count: int
    first_s: float
    last_s: float
    rate_hz: float
    largest_gap_s: float
    gap_at_s: float
    jitter_s: float
    repeated: int
    backward: int

    @property
    def duration_s(self) -> float:
        """From the earliest to the latest."""
        return self.last_s - self.first_s


@dataclass(frozen=True)
class Delay:
    """How much later the recorder's clock says a message came than its header says it was sent.

    The spread is half the range of the inner nine tenths, the drift the median of the last tenth minus that
    of the first.
    """

    median_s: float
    spread_s: float
    drift_s: float


@dataclass(frozen=True)
class TopicClocks:
    """When the recorder got messages, when they were taken by their headers, and the frames of these."""

    log: Stamps
    header: Stamps | None
    delay: Delay | None
    frames: tuple[str, ...]

    @property
    def own(self) -> Stamps:
        """The clock by which the messages are read: the header's, where it is set."""
        return self.header or self.log


def topic_clocks(messages: RawMessages) -> TopicClocks:
    """Both clocks of a topic with at least one message; the header's is None where it is never set."""
    log = stamps_of(messages.log_times)
    places = {_place_in(schema) for schema in messages.schemas}
    place = places.pop() if len(places) == 1 else None
    if place is None or any(len(message) < place + 12 for message in messages.data):
        return TopicClocks(log, None, None, ())
    headers = header_stamps(messages, place)
    frames = tuple(sorted({_frame(message, place) for message in messages.data} - {""}))
    if not headers.any():
        return TopicClocks(log, None, None, frames)
    return TopicClocks(log, stamps_of(headers), delay_of(messages.log_times, headers), frames)


def stamps_of(stamps: np.ndarray) -> Stamps:
    """Rate, gaps, jitter and disorder of (T,) int64 ns in the order of the messages."""
    steps = np.diff(stamps)
    ordered = np.unique(stamps)
    gaps_s = 1e-9 * np.diff(ordered)
    if not len(gaps_s):
        gaps_s = np.array([np.nan])
    at = int(np.argmax(gaps_s))
    low, high = np.percentile(gaps_s, INNER)
    return Stamps(
        count=len(stamps),
        first_s=1e-9 * int(ordered[0]),
        last_s=1e-9 * int(ordered[-1]),
        rate_hz=1.0 / float(np.median(gaps_s)),
        largest_gap_s=float(gaps_s[at]),
        gap_at_s=1e-9 * int(ordered[at] - ordered[0]),
        jitter_s=0.5 * float(high - low),
        repeated=int((steps == 0).sum()),
        backward=int((steps < 0).sum()),
    )


def delay_of(log_times: np.ndarray, headers: np.ndarray) -> Delay:
    """Log times minus header stamps, both (T,) int64 ns of the same messages."""
    delays_s = 1e-9 * (log_times - headers)  # exact: int64 before it is rounded
    ends = max(1, round(END_SHARE * len(delays_s)))
    low, high = np.percentile(delays_s, INNER)
    drift_s = float(np.median(delays_s[-ends:]) - np.median(delays_s[:ends]))
    return Delay(float(np.median(delays_s)), 0.5 * float(high - low), drift_s)


def header_stamps(messages: RawMessages, place: int) -> np.ndarray:
    """Stamps (T,) int64 ns that stand at one byte of all messages; zero where they are not set."""
    end = place + 8
    heads = np.frombuffer(b"".join(message[:end] for message in messages.data), np.uint8).reshape(-1, end)
    stamps = np.zeros(len(heads), dtype=np.int64)
    for order, flag in (("<", 1), (">", 0)):
        mine = heads[:, 1] & 1 == flag
        clock = np.ascontiguousarray(heads[mine, place:end]).view(
            [("sec", f"{order}i4"), ("ns", f"{order}u4")]
        )
        stamps[mine] = clock["sec"][:, 0].astype(np.int64) * 10**9 + clock["ns"][:, 0]
    return stamps


def _place_in(schema: Schema | None) -> int | None:
    """Where the stamp stands in messages of a type; another encoding would put it elsewhere."""
    if schema is None or schema.encoding != SchemaEncoding.ROS2:
        return None
    lines = (line.partition("#")[0].strip() for line in schema.data.decode(errors="replace").splitlines())
    first = next((line for line in lines if line and not re.match(r"\S+\s+[A-Z]\w*\s*=", line)), "")
    return next((place for pattern, place in _HEADERS.items() if pattern.fullmatch(first)), None)


def _frame(message: bytes, place: int) -> str:
    """Name of the frame in a message's header, behind the stamp and its own length."""
    order: Literal["little", "big"] = "little" if message[1] & 1 else "big"
    length = int.from_bytes(message[place + 8 : place + 12], order)
    return message[place + 12 : place + 12 + length].rstrip(b"\0").decode(errors="replace")
