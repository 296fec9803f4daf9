"""A recording as it came: streams of one demonstration, each with its own clock."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

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
