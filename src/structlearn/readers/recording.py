"""A recording as it came: streams of one demonstration, each with its own clock; and its checks."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from structlearn.core.errors import InputError

Kind = Literal[
    "pose",
    "twist",
    "joint_positions",
    "joint_velocities",
    "joint_torques",
    "wrench",
    "tactile",
    "tool_to_board",
]

WIDTHS: Mapping[str, int] = {"pose": 7, "twist": 6, "wrench": 6, "tool_to_board": 4}
"""Columns of each kind of stream; others have any number, constant within the stream."""

JOINT_KINDS: tuple[Kind, ...] = ("joint_positions", "joint_velocities", "joint_torques")
"""Kinds of stream that the fields position, velocity and effort of a joint state give."""

Form = Literal["cube", "sphere", "cylinder"]
FORMS: tuple[Form, ...] = get_args(Form)
"""What a shape is; a cuboid is a cube of unequal sides, as in ROS."""


@dataclass(frozen=True)
class NamedShape:
    """A solid at rest beside the movement: an obstacle, or what is reached for."""

    name: str
    form: Form  # what it is; a cylinder stands along its own z axis
    position: np.ndarray  # (3,) m, its centre in the base frame
    orientation: np.ndarray  # (4,) unit quaternion w, x, y, z, own to base frame
    size: np.ndarray  # (3,) m, full extent along its own axes


@dataclass(frozen=True)
class Stream:
    """Samples of one source with its own, possibly irregular, clock."""

    topic: str  # where it was published, for messages
    # what the columns mean. pose: x, y, z in m, then quaternion w, x, y, z (scalar first). twist: linear m/s,
    # then angular rad/s in the base frame. joint_*: rad, rad/s, N m. wrench: force N, then torque N m.
    # tactile: sensor counts. tool_to_board: quaternion w, x, y, z of the tool relative to the board
    kind: Kind
    stamps: np.ndarray  # (T,) int64 ns, as recorded
    values: np.ndarray  # (T, D) float64
    joints: tuple[str, ...] = ()  # (D,) names of the joints whose signals the columns are, where known


@dataclass(frozen=True)
class Recording:
    """Streams of one demonstration before they are put on one clock."""

    name: str  # unique within its set
    # at most one of each kind, except tactile: several fingers are several streams, and joint signals, where
    # those of a robot and of its hand have a clock each
    streams: tuple[Stream, ...]
    # (P, 2) start and end of each primitive in s since the first stamp of the pose stream, known only when
    # simulated
    true_segments: np.ndarray | None = None
    # what is known of the origin, string to string; `origin` is `simulated` or `recorded`
    provenance: Mapping[str, str] = field(default_factory=dict)
    shapes: tuple[NamedShape, ...] = ()  # solids around the movement, where recorded

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Of the joints whose signals there are, in the order of the first kind's streams; or none."""
        return next((names for kind in JOINT_KINDS if (names := self.joints_of(kind))), ())

    def joints_of(self, kind: Kind) -> tuple[str, ...]:
        """Names of the joints that the streams of one kind have, side by side."""
        return tuple(name for stream in self.streams if stream.kind == kind for name in stream.joints)


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
