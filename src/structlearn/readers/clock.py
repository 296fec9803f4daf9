"""Stamps of messages put in order, and streams with clocks of their own put on one uniform clock."""

from bisect import bisect_left
from collections.abc import Sequence

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers.demonstration import (
    Demonstration,
    Kind,
    Recording,
    Stream,
    at_row,
    check_recording,
    check_speed,
    disorder,
)
from structlearn.readers.source import StampPolicy

MAX_GAP_S = 0.2
"""Longest hole in a stream that is bridged by interpolation unless told otherwise: robot controllers and bag
recorders drop out for 0.15 s now and then, a hole of more than that hides a movement."""

FASTEST_HZ = 10_000.0
"""No robot reports its pose more often; a faster clock is one whose stamps say nothing."""


def in_order(where: str, stamps: np.ndarray, policy: StampPolicy) -> tuple[np.ndarray, str | None]:
    """Rows (M,) of samples whose stamps (T,) in ns increase, and what was done in words; None: nothing was.

    Raises InputError: the stamps do not increase and the policy is `error`; the message names the row.
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

    Dropping all that is not later than the latest so far would lose everything after one far stamp.
    """
    ends: list[int] = []  # smallest last stamp of an increase of each length ...
    places: list[int] = []  # ... and where it is
    before = np.full(len(stamps), -1)
    for place, stamp in enumerate(stamps.tolist()):
        length = bisect_left(ends, stamp)
        if length:
            before[place] = places[length - 1]
        ends[length : length + 1], places[length : length + 1] = [stamp], [place]
    rows = [places[-1]]
    while before[rows[-1]] >= 0:
        rows.append(before[rows[-1]])
    return np.array(rows[::-1])


def synchronise(
    recording: Recording,
    rate_hz: float | None = None,
    max_gap_s: float = MAX_GAP_S,
    refuse_jumps: bool = True,
) -> Demonstration:
    """Sample all streams of a recording on one uniform clock.

    The clock runs over the time that all streams cover: it starts at the latest of their first stamps, ticks
    at `rate_hz` and ends at the last tick before the earliest of their last stamps. Time is counted from that
    start. Nothing is extrapolated.

    Signals are interpolated linearly between neighbouring samples, orientations by slerp. For a signal x and
    neighbouring samples `gap` apart the error is at most gap^2 / 8 * max|x''|: at 150 Hz and 10 m/s^2 that is
    0.06 mm, over a hole of 0.15 s it is 28 mm. No filter is applied: a signal sampled down keeps its noise.

    Args:
        recording: streams with a clock each.
        rate_hz: ticks per second; None: one over the median step of the pose stream.
        max_gap_s: longest step between neighbouring samples of a stream within the clock's time.
        refuse_jumps: False if the caller checks speeds itself, and leaves out what the sensor lost.

    Returns:
        All signals at (T,) ticks. Orientations have unit norm and no jumps between Q and -Q. Several tactile
        streams, and joint signals of several sources, are put side by side in the order of the streams. True
        segments are counted from the new start and clipped to the clock. Where provenance says that the
        orientation was not recorded (`"orientation": "not recorded"`), it and angular velocity are None.

    Raises:
        InputError: the rate is not positive, a stream fails `check_recording`, has a gap longer than
            `max_gap_s`, the pose fails `check_speed`, or the streams do not share at least two ticks.
    """
    check_recording(recording)
    pose = next(stream for stream in recording.streams if stream.kind == "pose")
    start, duration = _shared_time(recording.name, recording.streams, max_gap_s)
    if refuse_jumps:
        check_speed(recording.name, pose)
    ticks = _ticks(recording.name, duration, pose, rate_hz)
    signals: dict[str, np.ndarray] = {}
    side_by_side: dict[Kind, list[np.ndarray]] = {}
    for stream in recording.streams:
        stamps = (stream.stamps - start).astype(float)  # ns; exact: int64 before the difference
        if stream.kind == "pose":
            signals["position"] = linear(ticks, stamps, stream.values[:, :3])
            signals["orientation"] = slerp(ticks, stamps, stream.values[:, 3:])
        elif stream.kind == "twist":
            signals["velocity"], signals["angular_velocity"] = np.split(
                linear(ticks, stamps, stream.values), 2, axis=1
            )
        elif stream.kind == "tool_to_board":
            signals["tool_to_board"] = slerp(ticks, stamps, stream.values)
        else:
            side_by_side.setdefault(stream.kind, []).append(linear(ticks, stamps, stream.values))
    for kind, columns in side_by_side.items():
        signals[kind] = np.hstack(columns)
        names = recording.joints_of(kind)
        if names != recording.joint_names and names:
            signals[kind] = signals[kind].take([names.index(name) for name in recording.joint_names], axis=1)
    if recording.provenance.get("orientation") == "not recorded":
        signals.pop("orientation")
        signals.pop("angular_velocity", None)
    time, segments = ticks * 1e-9, recording.true_segments
    if segments is not None:
        late = (start - int(pose.stamps[0])) * 1e-9
        segments = np.clip(np.asarray(segments, dtype=float) - late, 0.0, time[-1])
    return Demonstration(
        name=recording.name,
        time=time,
        true_segments=segments,
        provenance=dict(recording.provenance),
        shapes=recording.shapes,
        joint_names=recording.joint_names,
        **signals,
    )


def on_one_clock(
    name: str, streams: Sequence[Stream], rate_hz: float, max_gap_s: float = MAX_GAP_S
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Sample streams without orientations as `synchronise` does; none need be a pose, no value is checked.

    Returns times (T,) of the ticks in s since the start, and each stream's values (T, D).
    """
    start, duration = _shared_time(name, streams, max_gap_s)
    ticks = _ticks(name, duration, streams[0], rate_hz)
    sampled = [linear(ticks, (stream.stamps - start).astype(float), stream.values) for stream in streams]
    return ticks * 1e-9, sampled


def held_out_error(stream: Stream) -> tuple[float, float]:
    """Error of linear interpolation, measured: every second sample is predicted from its two neighbours.

    The gaps that are bridged here are twice the stream's own, so a smooth signal suffers up to four times the
    error of `synchronise`; noise of the sensor counts in full. Needs three samples; of a pose only the
    position is taken. Returns the root mean squared and the largest error over all columns.
    """
    stamps = (stream.stamps - stream.stamps[0]).astype(float)
    values = stream.values[:, :3] if stream.kind == "pose" else stream.values
    error = linear(stamps[1:-1:2], stamps[::2], values[::2]) - values[1:-1:2]
    return float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())


def shared_stamps(sources: Sequence[np.ndarray]) -> np.ndarray:
    """The clock on which several sources (T,) ns are put together: that of the slowest one.

    These are the stamps (M,) int64 ns, maybe none, of the source that has the fewest in the time that all
    cover; of several with as few, the first. It leaves out times at which another source has a hole, more
    than two mean steps of the slowest one: what is put together has that hole too.
    """
    start, end = max(int(one[0]) for one in sources), min(int(one[-1]) for one in sources)
    inside = [one[(one >= start) & (one <= end)] for one in sources]
    ticks = min(inside, key=len)
    if len(ticks) < 2:
        return ticks
    longest = 2.0 * float(np.mean(np.diff(ticks)))  # in bursts most steps are short
    bridged = np.ones(len(ticks), dtype=bool)
    for stamps in sources:
        after = np.searchsorted(stamps, ticks)  # the first stamp that is not before the tick
        met = stamps[after] == ticks
        bridged &= met | (stamps[after] - stamps[np.maximum(after - 1, 0)] <= longest)
    return ticks[bridged]


def linear(ticks: np.ndarray, stamps: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Linear interpolation of all columns between the stamps: (M,), (T,), (T, D) -> (M, D)."""
    return np.stack([np.interp(ticks, stamps, column) for column in values.T], axis=1)


def slerp(ticks: np.ndarray, stamps: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Interpolation of orientations: (M,), (T,), (T, 4) -> (M, 4) of unit norm, without sign flips."""
    path = quaternion.sign_continuous(quaternion.normalised(path))
    ticks = np.clip(ticks, stamps[0], stamps[-1])  # the last tick may be rounded past the end
    return quaternion.sign_continuous(quaternion.normalised(quaternion.interpolate(ticks, stamps, path)))


def _ticks(name: str, duration: int, pose: Stream, rate_hz: float | None) -> np.ndarray:
    """(T,) ticks in ns from 0 to `duration`; a tick at most 1e-6 steps after the end still counts."""
    if rate_hz is None:
        rate_hz = 1e9 / float(np.median(np.diff(pose.stamps)))
        if rate_hz > FASTEST_HZ:
            raise InputError(
                f"{name}: {pose.topic}: poses come at {rate_hz:.3g} Hz, more than {FASTEST_HZ:g} Hz"
            )
    if not (np.isfinite(rate_hz) and rate_hz > 0):
        raise InputError(f"{name}: rate_hz must be positive, is {rate_hz}")
    count = int(np.floor(duration * 1e-9 * rate_hz + 1e-6)) + 1
    if count < 2:
        raise InputError(
            f"{name}: the streams share {duration * 1e-9:.6g} s, less than one step at {rate_hz:.6g} Hz"
        )
    return np.arange(count) * (1e9 / rate_hz)


def _shared_time(name: str, streams: Sequence[Stream], max_gap_s: float) -> tuple[int, int]:
    """First ns that all streams cover, and for how many ns; an InputError where a gap in it is too long.

    Gaps are checked before there are ticks: one far stamp would ask for terabytes of them.
    """
    late = max(streams, key=lambda stream: int(stream.stamps[0]))
    early = min(streams, key=lambda stream: int(stream.stamps[-1]))
    start, end = int(late.stamps[0]), int(early.stamps[-1])
    if end <= start:
        raise InputError(
            f"{name}: {late.topic} starts at {at_row(0, late.stamps)}, when {early.topic} has ended at "
            f"{at_row(len(early.stamps) - 1, early.stamps)}; the streams need clocks of one origin, which "
            "`clock: log` under `stamps` gives them"
        )
    for stream in streams:
        before, after = stream.stamps[:-1], stream.stamps[1:]
        gaps = (after - before) * 1e-9
        too_long = (gaps > max_gap_s * (1 + 1e-9)) & (after > start) & (before < end)
        if too_long.any():
            row = int(np.argmax(too_long))
            raise InputError(
                f"{name}: {stream.topic}: {at_row(row, stream.stamps)} is followed by a gap of "
                f"{gaps[row]:.6g} s, longer than {max_gap_s:g} s"
            )
    return start, end - start
