"""Checks of recordings, repair of their stamps, and synchronisation of streams on one uniform clock."""

from bisect import bisect_left
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers.demonstration import FIELDS, JOINT_KINDS, Demonstration, Kind, Recording, Stream
from structlearn.readers.source import StampPolicy

# Longest gap in a stream that is bridged by interpolation by default: robot controllers and bag recorders
# occasionally drop out for 0.15 s; a longer gap hides a movement.
MAX_GAP_S = 0.2

# A clock that goes back by more, for many samples, was set back; less is jitter of messages
MOST_BACK_NS = 200_000_000
SMOOTHED = 5  # stamps: two wrong ones among them do not count
MET_AGAIN = 3  # samples in a time that comes again
FEW = 0.05  # share of samples that may be dropped because their clock was not set yet

FASTEST_HZ = 10_000.0  # no robot reports its pose faster; the stamps of a faster clock are meaningless

# Columns of each kind of stream; other kinds have any number, constant within the stream.
COLUMNS: Mapping[str, Sequence[str]] = {
    "pose": ("x", "y", "z", "qw", "qx", "qy", "qz"),
    "twist": ("vx", "vy", "vz", "wx", "wy", "wz"),
    "wrench": ("fx", "fy", "fz", "tx", "ty", "tz"),
    "tool_to_board": ("qw", "qx", "qy", "qz"),
}
WIDTHS: Mapping[str, int] = {kind: len(columns) for kind, columns in COLUMNS.items()}

# Tolerance of a quaternion's norm: printed digits and float32 stay well below; a wrong column or another
# representation of rotations does not.
NORM_TOLERANCE = 1e-3

# No demonstrating arm or hand is faster; a faster step is a jump of the sensor.
FASTEST = {"position": (10.0, "m/s"), "orientation": (100.0, "rad/s")}

# Share of a joint's range in one step, and step in any unit, from which its angle wrapped around
WHOLE, LEAST_WRAP = 0.9, 2.0


def check_recording(recording: Recording) -> None:
    """Check streams individually and together.

    Raises:
        InputError: there is neither a pose nor positions of joints, or several streams of a kind other than
            tactile, outputs and joint signals of different joints; kinds of joint signals have different
            joints; a stream has fewer than two samples, the wrong number of columns, a stamp that repeats or
            decreases, a value that is not finite, or a quaternion whose norm is off by more than
            `NORM_TOLERANCE`; or two shapes have the same name. The message names recording, topic and row
            (counted from 0).
    """
    counts = Counter(stream.kind for stream in recording.streams)
    _ = recording.leading
    for kind, count in counts.items():
        streams = [stream for stream in recording.streams if stream.kind == kind]
        names = recording.joints_of(kind)
        different = all(stream.joints for stream in streams) and len(set(names)) == len(names)
        if count > 1 and kind != "tactile" and not different:
            topics = ", ".join(stream.topic for stream in streams)
            raise InputError(f"{recording.name}: {kind} comes from several topics: {topics}")
    for stream in recording.streams:
        width = stream.values.shape[-1]
        if stream.joints and len(stream.joints) != width:
            named = f"names {len(stream.joints)} joints, has {width} columns"
            raise InputError(f"{recording.name}: {stream.topic}: {named}")
    for kind in JOINT_KINDS:
        names = recording.joints_of(kind)
        if names and set(names) != set(recording.joint_names):
            raise InputError(
                f"{recording.name}: {kind} are of the joints {', '.join(names)}, other signals of "
                f"{', '.join(recording.joint_names)}"
            )
    shapes = Counter(shape.name for shape in recording.shapes)
    if repeated := [name for name, count in shapes.items() if count > 1]:
        raise InputError(f"{recording.name}: several shapes have the name {', '.join(repeated)}")
    for stream in recording.streams:
        if fault := _fault(stream):
            raise InputError(f"{recording.name}: {stream.topic}: {fault}")


def non_finite(stream: Stream) -> str | None:
    """Description of the first value of a stream that is not finite, by joint and field, or None."""
    if (finite := np.isfinite(stream.values)).all():
        return None
    row, column = np.argwhere(~finite)[0].tolist()
    name = f"column {column}: value"
    if stream.joints:
        name = f"{FIELDS.get(stream.kind, 'value')} of {stream.joints[column]}"
    value = f"{at_row(row, stream.stamps)}, {name} is {stream.values[row, column]}"
    return f"{value} ({COLUMNS[stream.kind][column]})" if stream.kind in COLUMNS else value


def at_row(row: int, stamps: np.ndarray) -> str:
    """Row (from 0) and exact stamp in s of a sample, for messages."""
    stamp = int(stamps[row])
    sign, stamp = ("-", -stamp) if stamp < 0 else ("", stamp)
    return f"row {row} (stamp {sign}{stamp // 10**9}.{stamp % 10**9:09d} s)"


def disorder(stamps: np.ndarray) -> str | None:
    """Description of the first of (T,) stamps that is not later than its predecessor, or None."""
    steps = np.diff(stamps)
    if (steps > 0).all():
        return None
    row = int(np.argmax(steps <= 0)) + 1
    fault = "repeats the stamp before it" if steps[row - 1] == 0 else "runs back in time"
    return f"{at_row(row, stamps)} {fault}"


def check_speed(name: str, stream: Stream) -> None:
    """Raise InputError, naming the row, if a pose jumps faster than `FASTEST` from one sample to the next.

    Bursts of messages are not jumps: a step counts as at least the mean one. A rotation in one step may lie
    between two touches of a surface; it is an error of the sensor if the next step reverses it.
    """
    steps_s = 1e-9 * np.diff(stream.stamps)
    steps_s = np.maximum(steps_s, np.mean(steps_s))
    with np.errstate(over="ignore"):
        distances = np.linalg.norm(np.diff(stream.values[:, :3], axis=0), axis=1)
    cosines = np.abs(np.sum(stream.values[1:, 3:] * stream.values[:-1, 3:], axis=1))
    turns = 2.0 * np.arccos(np.minimum(cosines, 1.0))
    turns[:-1] = np.minimum(turns[:-1], turns[1:])
    for changes, (signal, (fastest, unit)) in zip((distances, turns), FASTEST.items(), strict=True):
        speeds = changes / steps_s
        if (speeds > fastest).any():
            row = int(np.argmax(speeds > fastest)) + 1
            raise InputError(
                f"{name}: {stream.topic}: {at_row(row, stream.stamps)}: {signal} jumps at "
                f"{speeds[row - 1]:.3g} {unit}, more than {fastest:g} {unit}"
            )


def check_wraps(name: str, stream: Stream) -> None:
    """Raise InputError, naming row and joint, if a position jumps through its whole range in one step.

    So does the angle of an encoder that wraps around, in rad or degrees.
    """
    steps, ranges = np.abs(np.diff(stream.values, axis=0)), np.ptp(stream.values, axis=0)
    if (wraps := (steps > WHOLE * ranges) & (steps > LEAST_WRAP)).any():
        row, column = np.argwhere(wraps)[0].tolist()
        joint = stream.joints[column] if stream.joints else str(column)
        raise InputError(
            f"{name}: {stream.topic}: {at_row(row + 1, stream.stamps)}: the position of {joint} jumps by "
            f"{steps[row, column]:.3g}, its whole range"
        )


def _fault(stream: Stream) -> str | None:
    """Description of the first fault of a stream, or None."""
    count, values = len(stream.stamps), stream.values
    if values.ndim != 2 or values.shape[1] == 0 or count != len(values):
        return f"needs a table with one row per stamp, has shape {values.shape} and {count} stamps"
    if values.shape[1] != (width := WIDTHS.get(stream.kind, values.shape[1])):
        return f"{stream.kind} needs {width} columns, has {values.shape[1]}"
    if count < 2 and stream.kind != "digital":  # of which a single sample may hold throughout
        return f"needs at least two samples, has {count}"
    if fault := disorder(stream.stamps):
        return fault
    if fault := non_finite(stream):
        return fault
    if stream.kind in ("pose", "tool_to_board"):
        norm = np.linalg.norm(values[:, -4:], axis=1)
        off = np.abs(norm - 1) > NORM_TOLERANCE
        if off.any():
            row = int(np.argmax(off))
            return f"{at_row(row, stream.stamps)}: quaternion has norm {norm[row]:.6g}, not 1"
    return None


def clock_reset(stamps: np.ndarray) -> tuple[int, float] | None:
    """First of the rows of (T,) ns from which a clock was set back, and by how many s; None if it was not.

    A clock that was set back covers a time again, or puts a good part of the samples before all others.
    Samples that come late fill a hole, and single wrong stamps are outliers: both can be mended.
    """
    if len(stamps) < 2 * SMOOTHED:
        return None
    padded = np.pad(stamps, SMOOTHED // 2, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, SMOOTHED)
    smooth = np.sort(windows, axis=1)[:, SMOOTHED // 2]
    latest = np.maximum.accumulate(smooth)
    late = np.diff((latest - smooth > MOST_BACK_NS).astype(int), prepend=0, append=0)
    blocks = zip(np.flatnonzero(late == 1).tolist(), np.flatnonzero(late == -1).tolist(), strict=True)
    first, last = max(blocks, key=lambda block: block[1] - block[0], default=(0, 0))
    if first == last:
        return None
    before, again = stamps[:first], smooth[first:last]
    met = int(np.sum((before > again.min()) & (before < again.max())))
    whole = again.max() < smooth[:first].min() and min(first, last - first) > FEW * len(stamps)
    if met < MET_AGAIN and not whole:
        return None
    back = int(stamps[first - 1] - stamps[first])
    return first, 1e-9 * float(back if back > 0 else latest[first] - smooth[first])


def in_order(where: str, stamps: np.ndarray, policy: StampPolicy) -> tuple[np.ndarray, str | None]:
    """Rows (M,) with increasing stamps, of (T,) ns, and a description of the policy's changes, or None.

    Raises InputError: stamps are not in order and the policy refuses it, or the clock was set back, where
    dropping and sorting would mix what was recorded before and after.
    """
    fault = disorder(stamps)
    if fault is None:
        return np.arange(len(stamps)), None
    if reset := clock_reset(stamps):
        row, back_s = reset
        other = "" if policy.clock == "log" else ", or `clock: log` under `stamps` reads it"
        raise InputError(
            f"{where}: the clock goes back by {back_s:.3g} s at {at_row(row, stamps)}: cut the recording "
            f"there{other}"
        )
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
    """Indices (M,) of the longest strictly increasing subsequence of (T,) numbers, by patience sorting.

    Dropping every stamp that is not later than the latest so far would lose all after a single outlier.
    """
    ends: list[int] = []  # smallest last stamp of an increasing subsequence of each length
    places: list[int] = []  # its index
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

    The clock covers the time that all streams cover: it starts at the latest of their first stamps, ticks at
    `rate_hz` and ends at the last tick before the earliest of their last stamps. Time is counted from its
    start. Nothing is extrapolated.

    Signals are interpolated linearly between neighbouring samples, orientations by slerp. The error for a
    signal x and samples `gap` apart is at most gap^2 / 8 * max|x''|: at 150 Hz and 10 m/s^2 that is 0.06 mm,
    over a gap of 0.15 s it is 28 mm. No filter is applied: downsampled signals keep their noise.

    Args:
        recording: streams with their own clocks.
        rate_hz: sampling rate; None: one over the median step of the leading stream (pose or joints).
        max_gap_s: longest step between neighbouring samples of a stream within the clock's time.
        refuse_jumps: False if the caller checks speeds itself, and leaves out what the sensor lost.

    Returns:
        All signals at (T,) ticks. Orientations have unit norm and no sign flips. Several tactile streams, and
        joint signals of several sources, are concatenated in the order of the streams, likewise outputs;
        digital ones keep their value until the next sample, and need not cover the clock's time. True
        segments are counted from the new start and clipped to the clock. If the provenance says that the
        orientation was not recorded (`"orientation": "not recorded"`), it and the angular velocity are None.

    Raises:
        InputError: the rate is not positive, a stream fails `check_recording`, has a gap longer than
            `max_gap_s`, the pose fails `check_speed` or the joints `check_wraps`, or the streams do not share
            at least two ticks.
    """
    check_recording(recording)
    leading = recording.leading
    lasting = [stream for stream in recording.streams if stream.kind != "digital"]
    start, duration = _shared_time(recording.name, lasting, max_gap_s)
    for stream in recording.streams if refuse_jumps else ():
        if stream is leading and leading.kind == "pose":
            check_speed(recording.name, stream)
        elif stream.kind == leading.kind:
            check_wraps(recording.name, stream)
    ticks = _ticks(recording.name, duration, leading, rate_hz)
    signals: dict[str, np.ndarray] = {}
    side_by_side: dict[Kind, list[np.ndarray]] = {}
    for stream in recording.streams:
        stamps = (stream.stamps - start).astype(float)  # ns; subtracted as int64 to stay exact
        if stream.kind == "pose":
            signals["position"] = linear(ticks, stamps, stream.values[:, :3])
            signals["orientation"] = slerp(ticks, stamps, stream.values[:, 3:])
        elif stream.kind == "twist":
            signals["velocity"], signals["angular_velocity"] = np.split(
                linear(ticks, stamps, stream.values), 2, axis=1
            )
        elif stream.kind == "tool_to_board":
            signals["tool_to_board"] = slerp(ticks, stamps, stream.values)
        elif stream.kind == "digital":
            valid = np.maximum(np.searchsorted(stamps, ticks, side="right") - 1, 0)
            side_by_side.setdefault(stream.kind, []).append(stream.values[valid])
        else:
            side_by_side.setdefault(stream.kind, []).append(linear(ticks, stamps, stream.values))
    for kind, columns in side_by_side.items():
        signals[kind] = np.hstack(columns)
        names = recording.joints_of(kind)
        if kind in JOINT_KINDS and names != recording.joint_names and names:
            signals[kind] = signals[kind].take([names.index(name) for name in recording.joint_names], axis=1)
    if recording.provenance.get("orientation") == "not recorded":
        signals.pop("orientation", None)
        signals.pop("angular_velocity", None)
    if leading.kind != "pose":
        signals["position"] = signals[leading.kind]
    time, segments = ticks * 1e-9, recording.true_segments
    if segments is not None:
        late = (start - int(leading.stamps[0])) * 1e-9
        segments = np.clip(np.asarray(segments, dtype=float) - late, 0.0, time[-1])
    return Demonstration(
        name=recording.name,
        time=time,
        true_segments=segments,
        provenance=dict(recording.provenance),
        shapes=recording.shapes,
        joint_names=recording.joint_names,
        output_names=recording.joints_of("outputs"),
        digital_names=recording.joints_of("digital"),
        of_joints=leading.kind != "pose",
        **signals,
    )


def on_one_clock(
    name: str, streams: Sequence[Stream], rate_hz: float, max_gap_s: float = MAX_GAP_S
) -> tuple[np.ndarray, list[np.ndarray]]:
    """As `synchronise`, for streams without orientations; no pose is needed, and no values are checked.

    Returns times (T,) of the ticks in s since the start, and each stream's values (T, D).
    """
    start, duration = _shared_time(name, streams, max_gap_s)
    ticks = _ticks(name, duration, streams[0], rate_hz)
    sampled = [linear(ticks, (stream.stamps - start).astype(float), stream.values) for stream in streams]
    return ticks * 1e-9, sampled


def held_out_error(stream: Stream) -> tuple[float, float]:
    """Measured error of linear interpolation: every second sample is predicted from its two neighbours.

    The gaps bridged here are twice the stream's own, so for a smooth signal the error is up to four times
    that of `synchronise`; sensor noise counts in full. Needs three samples; for a pose only the position is
    used. Returns the RMS and the largest error over all columns.
    """
    stamps = (stream.stamps - stream.stamps[0]).astype(float)
    values = stream.values[:, :3] if stream.kind == "pose" else stream.values
    error = linear(stamps[1:-1:2], stamps[::2], values[::2]) - values[1:-1:2]
    return float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())


def shared_stamps(sources: Sequence[np.ndarray]) -> np.ndarray:
    """Common clock of several sources (T,) ns: that of the slowest one.

    Returns the stamps (M,) int64 ns, maybe none, of the source with the fewest in the time that all cover
    (the first of several). Stamps within a gap of another source, longer than two mean steps of the slowest
    one, are left out, so the combined signal keeps that gap.
    """
    start, end = max(int(stamps[0]) for stamps in sources), min(int(stamps[-1]) for stamps in sources)
    inside = [stamps[(stamps >= start) & (stamps <= end)] for stamps in sources]
    ticks = min(inside, key=len)
    if len(ticks) < 2:
        return ticks
    longest = 2.0 * float(np.mean(np.diff(ticks)))  # the mean, because most steps in bursts are short
    bridged = np.ones(len(ticks), dtype=bool)
    for stamps in sources:
        after = np.searchsorted(stamps, ticks)  # first stamp at or after the tick
        met = stamps[after] == ticks
        bridged &= met | (stamps[after] - stamps[np.maximum(after - 1, 0)] <= longest)
    return ticks[bridged]


def linear(ticks: np.ndarray, stamps: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Linear interpolation of all columns between the stamps: (M,), (T,), (T, D) -> (M, D)."""
    return np.stack([np.interp(ticks, stamps, column) for column in values.T], axis=1)


def slerp(ticks: np.ndarray, stamps: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Interpolation of orientations: (M,), (T,), (T, 4) -> (M, 4) of unit norm, without sign flips."""
    path = quaternion.sign_continuous(quaternion.normalised(path))
    ticks = np.clip(ticks, stamps[0], stamps[-1])  # rounding may put the last tick past the end
    return quaternion.sign_continuous(quaternion.normalised(quaternion.interpolate(ticks, stamps, path)))


def _ticks(name: str, duration: int, pose: Stream, rate_hz: float | None) -> np.ndarray:
    """(T,) ticks in ns from 0 to `duration`, with a tolerance of 1e-6 steps at the end."""
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
    """First ns that all streams cover, and duration in ns. Raises InputError: a gap in it is too long.

    Checked before ticks are made, since one outlying stamp would ask for terabytes of them.
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
