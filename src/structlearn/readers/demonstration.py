"""Recordings as they came, with a clock for each stream, and demonstrations with all signals on one clock."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from structlearn.core.errors import InputError

JointKind = Literal["joint_positions", "joint_velocities", "joint_torques"]
Kind = Literal["pose", "twist", JointKind, "wrench", "tactile", "tool_to_board"]

JOINT_KINDS: tuple[JointKind, ...] = get_args(JointKind)
"""Kinds of stream that the fields position, velocity and effort of a joint state give."""

WIDTHS: Mapping[str, int] = {"pose": 7, "twist": 6, "wrench": 6, "tool_to_board": 4}
"""Columns of each kind of stream; others have any number, constant within the stream."""

Form = Literal["cube", "sphere", "cylinder"]
FORMS: tuple[Form, ...] = get_args(Form)
"""What a shape is; a cuboid is a cube of unequal sides, as in ROS."""

NORM_TOLERANCE = 1e-3
"""How far a quaternion's norm may be from 1: printed digits and float32 stay well below, a wrong column or a
rotation given in another form does not."""

FASTEST = {"position": (10.0, "m/s"), "orientation": (100.0, "rad/s")}
"""No arm and no hand that demonstrates a movement is so fast; a faster step is a jump of the sensor."""

SIGNAL_UNITS = {
    "position": "m",
    "orientation": "",
    "velocity": "m/s",
    "angular_velocity": "rad/s",
    "joint_positions": "rad",
    "joint_velocities": "rad/s",
    "joint_torques": "N m",
    "wrench": "N, N m",
    "tactile": "counts",
    "tool_to_board": "",
}
"""Sampled signals of a demonstration; quaternions w, x, y, z have no unit, a wrench is force, then torque."""


@dataclass(frozen=True)
class NamedShape:
    """A solid at rest beside the movement: an obstacle, or what is reached for."""

    name: str
    form: Form  # a cylinder has the z axis of its frame as axis
    position: np.ndarray  # (3,) m, its centre in the base frame
    orientation: np.ndarray  # (4,) unit quaternion w, x, y, z, shape to base frame
    size: np.ndarray  # (3,) m, full extent along the axes of its frame


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
    joints: tuple[str, ...] = ()  # (D,) names of the joints of a joint signal, where known


@dataclass(frozen=True)
class Recording:
    """Streams of one demonstration before they are put on one clock."""

    name: str  # unique within its set
    # at most one of each kind, except tactile (a stream per finger) and joint signals, where a robot and its
    # hand have a clock each
    streams: tuple[Stream, ...]
    # (P, 2) start and end of each primitive in s since the first stamp of the pose; known only if simulated
    true_segments: np.ndarray | None = None
    # what is known of the origin, string to string; `origin` is `simulated` or `recorded`
    provenance: Mapping[str, str] = field(default_factory=dict)
    shapes: tuple[NamedShape, ...] = ()  # solids around the movement, where recorded

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the first kind of joint signal that names them; or none."""
        return next((names for kind in JOINT_KINDS if (names := self.joints_of(kind))), ())

    def joints_of(self, kind: Kind) -> tuple[str, ...]:
        """Names of the joints of all streams of one kind, side by side."""
        return tuple(name for stream in self.streams if stream.kind == kind for name in stream.joints)


@dataclass(frozen=True)
class Demonstration:
    """Signals of one demonstration (or execution) on one uniform clock.

    Whether it was simulated, recorded by a robot or read from a user's bag makes no difference from here on.
    """

    name: str  # unique within its set; error messages and tables use it
    time: np.ndarray  # (T,) s, starts at 0, uniform step
    position: np.ndarray  # (T, 3) m, end-effector in the base frame
    # (T, 4) unit quaternion w, x, y, z, sign-continuous; None where not recorded
    orientation: np.ndarray | None = None
    # (T, 3) m/s where recorded; otherwise it is derived from the position when needed
    velocity: np.ndarray | None = None
    angular_velocity: np.ndarray | None = None  # (T, 3) rad/s in the base frame, where recorded
    joint_positions: np.ndarray | None = None  # (T, J) rad, where recorded
    joint_velocities: np.ndarray | None = None  # (T, J) rad/s, where recorded
    joint_torques: np.ndarray | None = None  # (T, J) N m, where recorded
    wrench: np.ndarray | None = None  # (T, 6) force in N, torque in N m, where recorded
    tactile: np.ndarray | None = None  # (T, E) sensor counts, where recorded
    # (T, 4) orientation of the tool relative to the board, sign-continuous, where recorded
    tool_to_board: np.ndarray | None = None
    joint_names: tuple[str, ...] = ()  # (J,) in the order of the columns, where known
    true_segments: np.ndarray | None = None  # (P, 2) start and end of each primitive in s, if simulated
    # what is known of the origin (simulated or recorded, seed, source, licence)
    provenance: Mapping[str, str] = field(default_factory=dict)
    shapes: tuple[NamedShape, ...] = ()  # solids at rest around the movement, where recorded

    def __post_init__(self) -> None:
        length = len(self.time)
        if length < 2:
            raise InputError(f"{self.name}: needs at least two samples, has {length}")
        for signal in SIGNAL_UNITS:
            values = getattr(self, signal)
            if values is not None and len(values) != length:
                raise InputError(f"{self.name}: {signal} has {len(values)} samples, the clock has {length}")

    @property
    def dt(self) -> float:
        """Sampling interval in s."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    def signal(self, name: str) -> np.ndarray:
        """One of `SIGNAL_UNITS`; an InputError if it was not recorded."""
        values = getattr(self, name)
        if values is None:
            raise InputError(f"{self.name}: has no {name}")
        return values

    @property
    def simulated(self) -> bool:
        """Whether the data come from a simulation."""
        return self.provenance.get("origin") == "simulated"


def check_recording(recording: Recording) -> None:
    """Check streams one by one and together.

    Raises:
        InputError: there is no pose stream, or several streams of a kind other than tactile and signals of
            different joints; kinds of joint signals have different joints; a stream has fewer than two
            samples, the wrong number of columns, a stamp that repeats or runs back, a value that is not
            finite, or a quaternion whose norm is off by more than `NORM_TOLERANCE`; or two shapes have one
            name. The message names recording, topic and row (counted from 0).
    """
    counts = Counter(stream.kind for stream in recording.streams)
    if counts["pose"] == 0:
        raise InputError(f"{recording.name}: has no pose stream")
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


def at_row(row: int, stamps: np.ndarray) -> str:
    """A place in a stream for messages: row from 0, and its stamp in s, without rounding."""
    stamp = int(stamps[row])
    sign, stamp = ("-", -stamp) if stamp < 0 else ("", stamp)
    return f"row {row} (stamp {sign}{stamp // 10**9}.{stamp % 10**9:09d} s)"


def disorder(stamps: np.ndarray) -> str | None:
    """The first of (T,) stamps that does not come after the one before it, in words; None: all do."""
    steps = np.diff(stamps)
    if (steps > 0).all():
        return None
    row = int(np.argmax(steps <= 0)) + 1
    fault = "repeats the stamp before it" if steps[row - 1] == 0 else "runs back in time"
    return f"{at_row(row, stamps)} {fault}"


def check_speed(name: str, stream: Stream) -> None:
    """Raise an InputError that names the row where a pose jumps, faster than `FASTEST`, from one to the next.

    Bursts of messages are no jumps: a step counts as no shorter than the mean one. A turn in one step may lie
    between two touches of a surface; a reading is off where the next one turns back.
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


def _fault(stream: Stream) -> str | None:
    """The first fault of a stream in words, or None."""
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
