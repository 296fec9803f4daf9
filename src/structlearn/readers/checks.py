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

    Raises InputError: there is no pose stream or more than one stream of a kind other than tactile, but for
    those of joints with different names; kinds of joint signals have other joints; a stream has fewer than
    two samples, the wrong number of columns, a stamp that repeats or runs back, a value that is NaN or
    infinite, or a quaternion whose norm is off by more than `NORM_TOLERANCE`; or two shapes have one name.
    The message names recording, topic and row (counted from 0).
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


def _fault(stream: Stream) -> str | None:
    """Words for the first thing that is wrong with a stream; None: nothing is."""
    count, values = len(stream.stamps), stream.values
    if values.ndim != 2 or values.shape[1] == 0 or count != len(values):
        return f"needs a table with one row per stamp, has shape {values.shape} and {count} stamps"
    if values.shape[1] != (width := WIDTHS.get(stream.kind, values.shape[1])):
        return f"{stream.kind} needs {width} columns, has {values.shape[1]}"
    if count < 2:
        return f"needs at least two samples, has {count}"
    if fault := disorder(stream.stamps):
        return fault
    if not (finite := np.isfinite(values)).all():
        row, column = np.argwhere(~finite)[0]
        return f"{at_row(row, stream.stamps)}, column {column}: value is {values[row, column]}"
    if stream.kind in ("pose", "tool_to_board"):
        norm = np.linalg.norm(values[:, -4:], axis=1)
        off = np.abs(norm - 1) > NORM_TOLERANCE
        if off.any():
            row = int(np.argmax(off))
            return f"{at_row(row, stream.stamps)}: quaternion has norm {norm[row]:.6g}, not 1"
    return None


def check_speed(name: str, stream: Stream) -> None:
    """Refuse poses that nothing can have gone through.

    Bursts of messages are no jumps: a step counts as no shorter than the mean one. A turn in one step may lie
    between two touches of a surface; a reading is off where the next one turns back. Raises InputError: a
    step from one pose to the next is faster than `FASTEST`; topic and row are named.
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
