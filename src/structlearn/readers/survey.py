"""The clocks of a topic, before anybody has said what it means: rates, gaps, disorder, delays.

Nothing is refused here: disorder is counted, not mended. A header is the first field of every message type
that has one, so its stamp stands at one place in the bytes, also of types that nobody here can decode. Of
several transforms in a message the first one's counts.
"""

import re
from typing import NamedTuple

import numpy as np
from mcap.records import Schema
from mcap.well_known import SchemaEncoding

from structlearn.readers.bag import RawMessages

HEADERS = {
    re.compile(r"(std_msgs/(msg/)?)?Header\s+\w+"): 4,
    re.compile(r"(geometry_msgs/(msg/)?)?TransformStamped\[\]\s+\w+"): 8,
}
"""First fields of definitions, and the byte of the stamp: behind the encapsulation, or a number of links."""


class Stamps(NamedTuple):
    """One clock of a topic; its rate is one over the median step (NaN of a single stamp).

    `repeated` and `backward` messages have the stamp of the one before, or an earlier one.
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
        """Share of stamps that do not come after the one before."""
        return (self.repeated + self.backward) / self.count


class TopicClocks(NamedTuple):
    """When the recorder got messages, and when they were taken by their headers, None where none is set.

    `delay_s`: median of log time minus header stamp.
    """

    log: Stamps
    header: Stamps | None = None
    delay_s: float = np.nan

    @property
    def own(self) -> Stamps:
        """The clock by which the messages are read: the header's, where it is set."""
        return self.header or self.log


def topic_clocks(messages: RawMessages) -> TopicClocks:
    """Both clocks of a topic with at least one message."""
    log = stamps_of(messages.log_times)
    places = {_place_in(schema) for schema in messages.schemas}
    place = places.pop() if len(places) == 1 else None
    if place is None or any(len(message) < place + 8 for message in messages.data):
        return TopicClocks(log)
    headers = _header_stamps(messages, place)
    if not headers.any():
        return TopicClocks(log)
    delays_s = 1e-9 * (messages.log_times - headers)  # exact: int64 before it is rounded
    return TopicClocks(log, stamps_of(headers), float(np.median(delays_s)))


def stamps_of(stamps: np.ndarray) -> Stamps:
    """Rate, gaps and disorder of (T,) int64 ns in the order of the messages."""
    steps = np.diff(stamps)
    ordered = np.unique(stamps)
    gaps_s = 1e-9 * np.diff(ordered) if len(ordered) > 1 else np.array([np.nan])
    at = int(np.argmax(gaps_s))
    return Stamps(
        count=len(stamps),
        first_s=1e-9 * int(ordered[0]),
        last_s=1e-9 * int(ordered[-1]),
        rate_hz=1.0 / float(np.median(gaps_s)),
        largest_gap_s=float(gaps_s[at]),
        gap_at_s=1e-9 * int(ordered[at] - ordered[0]),
        repeated=int((steps == 0).sum()),
        backward=int((steps < 0).sum()),
    )


def _header_stamps(messages: RawMessages, place: int) -> np.ndarray:
    """(T,) int64 ns at one byte of all messages; zero where they are not set."""
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
    return next((place for pattern, place in HEADERS.items() if pattern.fullmatch(first)), None)
