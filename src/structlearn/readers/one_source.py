"""Whether a signal has one source. Of two that contradict each other, nobody can say which one is right.

Channels of a topic may follow one another (a recorder that was restarted, a split bag), and may repeat each
other's samples; where they overlap otherwise, they are two sources. Publishers that share a channel, as
`ros2 bag record` writes them, cannot be told apart: they show in values that go to and fro.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from structlearn.core.errors import InputError
from structlearn.readers.clock import MAX_GAP_S, at_row, clock_reset, linear
from structlearn.readers.decoded_messages import Decoded
from structlearn.readers.demonstration import Kind

# Signals that do not change to and fro with every sample: their columns, and a change above a sensor's noise
STEADY: Mapping[Kind, Sequence[tuple[slice, float]]] = {
    "pose": ((slice(0, 3), 0.002), (slice(3, 7), 0.01)),  # m, and about twice as many rad
    "joint_positions": ((slice(None), 0.05),),  # rad
    "wrench": ((slice(0, 3), 5.0), (slice(3, 6), 1.0)),  # N, N m
}

CLEAR = 5.0  # times the distances of other samples from such lines
CALM = 0.2  # share of samples that one source has at least, if there are two of which neither is rare
MET = 3  # samples that show that there are two sources; fewer are chance
SHARE = 0.1  # of samples that go to and fro; a single one is an outlier
SAME = 1e-9  # relative difference of samples that are the same


def check_source(
    where: str, kind: Kind, stamps: np.ndarray, values: np.ndarray, channels: np.ndarray | None = None
) -> None:
    """Raise InputError, naming the row, if the values of a signal come from several sources.

    Args:
        where: the signal, for the message.
        kind: of signal.
        stamps: (T,) ns in order of arrival, maybe disordered.
        values: (T, D) as in `Stream`; those that are not finite are not compared.
        channels: (T,) number of the channel of each sample; None: there is one.
    """
    if (np.diff(stamps) < 0).any() and clock_reset(stamps):
        return  # two passes, of which `clock.in_order` says so
    if channels is not None:
        row = _first_of_two(stamps, values[:, ~np.isnan(values).all(axis=0)], channels)
        if row is not None:
            count = len(np.unique(channels))
            place = at_row(row, stamps)
            raise InputError(f"{where}: comes from {count} channels, whose values differ at {place}")
    for columns, least in STEADY.get(kind, ()):
        rows, swung = to_and_fro(stamps, values[:, columns], least, kind == "pose" and columns.start == 3)
        if swung.sum() > max(MET, SHARE * len(swung)):
            place = at_row(int(rows[np.argmax(swung)]), stamps)
            raise InputError(f"{where}: values go to and fro, first at {place}: are there two publishers?")


def check_frames(where: str, stamps: np.ndarray, groups: Sequence[Decoded]) -> str:
    """The frame_id of a topic's messages, without the leading slash of ROS 1; empty if they have none.

    Raises InputError, naming the row: it changes, or the frame that the messages are about.
    """
    frames = [_frames(group) for group in groups]
    for field, first in frames[0].items():
        for group, its in zip(groups, frames, strict=True):
            if its[field] != first:
                place, now = at_row(int(group.rows[0]), stamps), its[field]
                raise InputError(
                    f"{where}: {field} changes from {first or 'none'} to {now or 'none'} at {place}"
                )
    return frames[0].get("frame_id", "")


def to_and_fro(
    stamps: np.ndarray, values: np.ndarray, least: float, turns: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Samples far from the line between their neighbours, where others lie on such lines.

    Compared are the line between the next but one, for sources that alternate, and that of the neighbour
    without the sample, for a source that is rare.

    Args:
        stamps: (T,) ns in order of arrival.
        values: (T, D); rows that are not finite, and columns that nowhere are, do not count.
        least: distance from the line from which samples count.
        turns: values are quaternions, of which both signs are the same.

    Returns:
        rows: (M,) those that count, by their stamps.   mask: (M,) whether each is such a sample.
    """
    rows = np.arange(len(stamps))
    if not (finite := np.isfinite(values)).all():
        values = values[:, finite.any(axis=0)]
        rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    if (np.diff(stamps[rows]) < 0).any():
        rows = rows[np.argsort(stamps[rows], kind="stable")]
    part, swung = values[rows], np.zeros(len(rows), dtype=bool)
    if turns and len(part) and (opposite := part @ part[0] < 0.0).any():
        part = np.where(opposite[:, None], -part, part)
    if not part.size or len(part) < 5:
        return rows, swung
    clock, count = (stamps[rows] - stamps[rows[0]]).astype(float), len(part) - 4

    def off(place: int, first: int, last: int) -> np.ndarray:
        """Distance of samples from the line between two others, each counted from row - 2."""
        times = [clock[at : at + count] for at in (place, first, last)]
        middle, begin, end = (part[at : at + count] for at in (place, first, last))
        span = times[2] - times[1]
        share = np.where(span > 0.0, times[0] - times[1], 0.5) / np.where(span > 0.0, span, 1.0)
        return np.linalg.norm(middle - begin - share[:, None] * (end - begin), axis=1)

    with np.errstate(over="ignore", invalid="ignore"):
        near = off(2, 1, 3)
        if np.count_nonzero(near > least) > MET:  # otherwise the rest takes time for nothing
            calm = np.minimum(off(2, 0, 4), off(1, 0, 3))
            swung[2:-2] = near > CLEAR * (calm + np.quantile(calm, CALM)) + least
    return rows, swung


def _frames(group: Decoded) -> dict[str, str]:
    """Names of the frames of messages."""
    frames = {}
    if hasattr(group.message, "header"):
        frames["frame_id"] = group.message.header.frame_id.lstrip("/")
    if hasattr(group.message, "child_frame_id"):
        frames["child_frame_id"] = group.message.child_frame_id.lstrip("/")
    return frames


def _first_of_two(stamps: np.ndarray, values: np.ndarray, channels: np.ndarray) -> int | None:
    """First row, of `MET` at least, at which a channel says something else than larger ones, or None."""
    if not values.size:
        return None
    clock, sound = stamps - stamps[0], np.isfinite(values).all(axis=1)
    numbers, counts = np.unique(channels[sound], return_counts=True)
    known = np.zeros(0, dtype=int)  # rows of the channels so far
    for channel in numbers[np.argsort(-counts, kind="stable")]:
        own = np.flatnonzero(sound & (channels == channel))
        if len(known) > 1:
            after = np.clip(np.searchsorted(clock[known], clock[own]), 1, len(known) - 1)
            begin, end = clock[known[after - 1]], clock[known[after]]
            longest = max(1e9 * MAX_GAP_S, 2.0 * float(np.median(np.diff(clock[known]))))
            met = own[(clock[own] >= begin) & (clock[own] <= end) & (end - begin <= longest)]
            theirs = linear(clock[met], clock[known], values[known])
            different = met[(np.abs(theirs - values[met]) > SAME * (1.0 + np.abs(theirs))).any(axis=1)]
            if len(different) >= MET:
                return int(different[0])
        every = np.append(known, own)
        known = every[np.unique(clock[every], return_index=True)[1]]
    return None
