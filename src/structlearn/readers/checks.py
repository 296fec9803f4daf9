"""What a recording must fulfil before it is written or put on one clock."""

from collections import Counter

import numpy as np

from structlearn.core.errors import InputError
from structlearn.readers.recording import JOINT_KINDS, WIDTHS, Recording, Stream

NORM_TOLERANCE = 1e-3
"""How far a quaternion's norm may be from 1: printed digits and float32 stay well below, a wrong column or a
rotation given in another form does not."""

FASTEST = {"position": 10.0, "orientation": 100.0}
"""m/s and rad/s; no arm and no hand that shows one a movement is so fast, so it is the sensor that jumps."""


def check_recording(recording: Recording) -> None:
    """Check streams one by one and together.

    Raises:
        InputError: there is no pose stream or more than one stream of a kind other than tactile, but for
            those of joints with different names; kinds of joint signals have other joints; a stream has
            fewer than two samples, the wrong number of columns, a stamp that repeats or runs back, a value
            that is NaN or infinite, or a quaternion whose norm is off by more than `NORM_TOLERANCE`; or two
            shapes have one name. The message names recording, topic and row (counted from 0).
    """
    counts = Counter(stream.kind for stream in recording.streams)
    if counts["pose"] == 0:
        raise InputError(f"{recording.name}: has no pose stream")
    for kind, count in counts.items():
        its = [stream for stream in recording.streams if stream.kind == kind]
        names = recording.joints_of(kind)
        different = all(stream.joints for stream in its) and len(set(names)) == len(names)
        if count > 1 and kind != "tactile" and not different:
            topics = ", ".join(stream.topic for stream in its)
            raise InputError(f"{recording.name}: {kind} comes from several topics: {topics}")
    for stream in recording.streams:
        if stream.joints and len(stream.joints) != stream.values.shape[-1]:
            raise InputError(
                f"{recording.name}: {stream.topic}: names {len(stream.joints)} joints, has "
                f"{stream.values.shape[-1]} columns"
            )
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
        where = f"{recording.name}: {stream.topic}"
        _check_shape(where, stream)
        if fault := disorder(stream.stamps):
            raise InputError(f"{where}: {fault}")
        _check_values(where, stream)


def at_row(row: int, stamps: np.ndarray) -> str:
    """Words for a place in a stream: row from 0 and its stamp in s, without rounding."""
    stamp = int(stamps[row])
    sign, stamp = ("-", -stamp) if stamp < 0 else ("", stamp)
    return f"row {row} (stamp {sign}{stamp // 10**9}.{stamp % 10**9:09d} s)"


def disorder(stamps: np.ndarray) -> str | None:
    """Words for the first of (T,) stamps that does not come after the one before it; None: all do."""
    steps = np.diff(stamps)
    if (steps > 0).all():
        return None
    row = int(np.argmax(steps <= 0)) + 1
    fault = "repeats the stamp before it" if steps[row - 1] == 0 else "runs back in time"
    return f"{at_row(row, stamps)} {fault}"


def _check_shape(where: str, stream: Stream) -> None:
    width = WIDTHS[stream.kind]
    if stream.values.ndim != 2 or stream.values.shape[1] == 0 or len(stream.stamps) != len(stream.values):
        raise InputError(
            f"{where}: needs a table with one row per stamp, has shape {stream.values.shape} "
            f"and {len(stream.stamps)} stamps"
        )
    if width is not None and stream.values.shape[1] != width:
        raise InputError(f"{where}: {stream.kind} needs {width} columns, has {stream.values.shape[1]}")
    if len(stream.stamps) < 2:
        raise InputError(f"{where}: needs at least two samples, has {len(stream.stamps)}")


def _check_values(where: str, stream: Stream) -> None:
    finite = np.isfinite(stream.values)
    if not finite.all():
        row, column = np.argwhere(~finite)[0]
        value = stream.values[row, column]
        raise InputError(f"{where}: {at_row(row, stream.stamps)}, column {column}: value is {value}")
    if stream.kind in ("pose", "tool_to_board"):
        norm = np.linalg.norm(stream.values[:, -4:], axis=1)
        off = np.abs(norm - 1) > NORM_TOLERANCE
        if off.any():
            row = int(np.argmax(off))
            raise InputError(
                f"{where}: {at_row(row, stream.stamps)}: quaternion has norm {norm[row]:.6g}, not 1"
            )


def check_speed(name: str, stream: Stream) -> None:
    """Refuse poses that nothing can have gone through.

    Bursts of messages are no jumps: a step counts as no shorter than the mean one. A turn in one step may lie
    between two touches of a surface; a reading is off where the next one turns back.

    Raises:
        InputError: a step from one pose to the next is faster than `FASTEST`; topic and row are named.
    """
    where = f"{name}: {stream.topic}"
    steps_s = 1e-9 * np.diff(stream.stamps)
    steps_s = np.maximum(steps_s, np.mean(steps_s))
    with np.errstate(over="ignore"):
        distances = np.linalg.norm(np.diff(stream.values[:, :3], axis=0), axis=1)
    cosines = np.abs(np.sum(stream.values[1:, 3:] * stream.values[:-1, 3:], axis=1))
    turns = 2.0 * np.arccos(np.minimum(cosines, 1.0))
    turns[:-1] = np.minimum(turns[:-1], turns[1:])
    for name, changes, unit in (("position", distances, "m/s"), ("orientation", turns, "rad/s")):
        speeds = changes / steps_s
        if (speeds > FASTEST[name]).any():
            row = int(np.argmax(speeds > FASTEST[name])) + 1
            raise InputError(
                f"{where}: {at_row(row, stream.stamps)}: {name} jumps at {speeds[row - 1]:.3g} {unit}, "
                f"more than {FASTEST[name]:g} {unit}"
            )
