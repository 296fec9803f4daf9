"""Parameters of a source of recordings: place, reader, clock, stamps, and which topic carries which signal.

A setting in which people corrected is named by a label, or by a number in its shortest form: `5`, `5.0` and 5
are all "5"; `tilt_left` is a label. The recordings of each setting are in a folder with its label as name.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Discriminator, Field, PlainSerializer, Tag, model_validator

from structlearn.core.params import Name, Parameters


class ClockParameters(Parameters):
    """The uniform clock on which all stages read the demonstrations."""

    rate_hz: float = Field(gt=0, le=10_000)
    max_gap_s: float = Field(gt=0)


class StampPolicy(Parameters):
    """Which stamps of a user's messages are used, and how disorder is handled."""

    # `header`: time of the sample, or the log time if no message of a topic has it. `log`: time of reception
    # by the recorder
    clock: Literal["header", "log"]
    # if a stamp repeats or decreases, `error`: refuse the recording; `drop`: leave out as few samples as
    # possible; `sort`: sort them. Of several samples with one stamp the first is kept
    disorder: Literal["error", "drop", "sort"]


AS_WRITTEN = StampPolicy(clock="header", disorder="error")  # for our own files, whose stamps are in order


class SourceParameters(Parameters):
    """Recordings of one kind of data."""

    kind: ClassVar[str]  # kind of data, under which entries are listed; see `tasks.kinds`

    title: Name | None  # of its page and of its claims; null: its name
    # file or folder; starts with `~` in the home folder, with `$DATA` in the folder of public sets
    source: str = Field(min_length=1)
    # module of `structlearn.readers`, dotted name of another module, or `bags`
    reader: str = Field(pattern=r"^[a-z]\w*(\.[a-z]\w*)*$")
    part: str | int | None  # part of the source, in the reader's terms
    stamps: StampPolicy  # for bags

    def sources(self) -> dict[str, tuple[str, ...]]:
        """All files and folders that are read, as written in the parameters, by purpose."""
        return {"recordings": (self.source,)}

    @property
    def skips_failures(self) -> bool:
        """Whether recordings that cannot be read or cut are left out."""
        return False


def setting_label(setting: Any) -> Any:
    """Label of a setting: the shortest form of a number, other text unchanged."""
    try:
        number = float(setting)
    except (TypeError, ValueError):
        return setting
    return f"{number + 0.0:g}" if math.isfinite(number) else str(setting)  # + 0.0 turns -0 into 0


Setting = Annotated[str, BeforeValidator(setting_label), Field(pattern=r"^-?\w[\w .+()-]*$")]
"""A setting in a parameter file: a number, which may be negative, or a name as in `core.params.NAME`."""


Role = Literal[
    "pose", "twist", "joint_states", "wrench", "tactile", "tool_to_board", "obstacles", "outputs", "digital"
]
Topic = Annotated[str, Field(min_length=1)]
Topics = Annotated[
    tuple[Topic, ...],
    BeforeValidator(lambda value: (value,) if isinstance(value, str) else value),  # a single topic as a list
]

JointNames = Annotated[
    tuple[tuple[str, str], ...],
    BeforeValidator(lambda value: _pairs(value) if isinstance(value, Mapping) else value),
    PlainSerializer(dict),
]
"""Mapping from recorded joint names, or numbers of columns without names, to those of the URDF."""


def _pairs(names: Mapping[Any, Any]) -> tuple[tuple[Any, Any], ...]:
    return tuple((str(name) if type(name) is int else name, other) for name, other in names.items())


Outputs = Annotated[
    tuple[tuple[Name, Topic], ...],
    BeforeValidator(lambda value: _pairs(value) if isinstance(value, Mapping) else value),
    PlainSerializer(dict),
]
"""Mapping from the names of outputs to their topics: of a number, or `TOPIC[JOINT]`, the position of a joint;
in a LeRobotDataset `FEATURE[COLUMN]`."""


def column_of(topic: str) -> tuple[str, str]:
    """Topic and joint of `TOPIC[JOINT]`; without one, the joint is empty."""
    name, _, joint = topic.removesuffix("]").partition("[")
    return name, joint


MAX_FINGERS = 10  # tactile streams in our own files: two hands


class TransformPose(Parameters):
    """Pose of the frame `child` in `parent`, from a chain of transforms on /tf and /tf_static."""

    parent: Topic
    child: Topic
    topic: Topic

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics of the transforms; the second one is static."""
        return self.topic, f"{self.topic}_static"


class JointPose(Parameters):
    """Pose of the link `tip` in the root's frame, from joint states by the robot's kinematics."""

    urdf: str = Field(min_length=1)
    tip: Topic
    topic: Topic
    joints: JointNames = ()
    # of the angles that were recorded; None: rad, and refused if the URDF's limits say that they cannot be
    units: Literal["rad", "deg"] | None = None

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics of the joint states."""
        return (self.topic,)


def _pose_form(value: object) -> str:
    """Intended form of a pose, so that errors are reported for that form alone."""
    if isinstance(value, JointPose) or (isinstance(value, Mapping) and "urdf" in value):
        return "joints"
    return "transforms" if isinstance(value, TransformPose | Mapping) else "topic"


Pose = Annotated[
    Annotated[Topic, Tag("topic")]
    | Annotated[TransformPose, Tag("transforms")]
    | Annotated[JointPose, Tag("joints")],
    Discriminator(_pose_form),
]


class TopicMap(Parameters):
    """Topics of a demonstration in a robot's bag; each topic has one role."""

    must_exist: ClassVar[bool] = True
    """Whether a topic given here must be in every file; the pose always must."""

    # end-effector pose: its topic, or how it is computed, maybe from joint states that are also in
    # `joint_states`; None: the positions of the joints in `joint_states` are the movement
    pose: Pose | None
    twist: Topic | None
    joint_states: Topics  # usually one topic with positions, velocities and torques; several may share them
    # names of the joints to read, in this order; None: those of the publisher with the most joints
    joints: tuple[Topic, ...] | None = Field(min_length=1)
    wrench: Topic | None
    tactile: Topics  # one topic per sensor, in the order in which channels are concatenated
    tool_to_board: Topic | None  # orientation of the tool relative to the board, e.g. from motion capture
    outputs: Outputs = ()  # what the robot commands beside its pose: an opening, a force
    digital: Outputs = ()  # likewise, on or off

    @model_validator(mode="after")
    def _something_moves(self) -> "TopicMap":
        if self.pose is None and not self.joint_states:
            raise ValueError("needs a `pose`, or else `joint_states`, whose joints are learned themselves")
        called = [name for name, _ in (*self.outputs, *self.digital)]
        if repeated := sorted({name for name in called if called.count(name) > 1}):
            raise ValueError(f"output named more than once: {', '.join(repeated)}")
        return self

    @model_validator(mode="after")
    def _each_once(self) -> "TopicMap":
        names = [topic for topic, _ in self.roles()]
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"topic named more than once: {', '.join(repeated)}")
        if self.joints and len(set(self.joints)) < len(self.joints):
            raise ValueError(f"joint named more than once in: {', '.join(self.joints)}")
        return self

    @property
    def topics(self) -> list[str]:
        """Every topic that has to be read, without duplicates."""
        of_pose = () if isinstance(self.pose, str | None) else self.pose.topics
        return list(dict.fromkeys([*of_pose, *(topic for topic, _ in self.roles())]))

    def roles(self) -> list[tuple[str, Role]]:
        """Every topic that is itself a signal, with its role, in a fixed order."""
        pairs: list[tuple[str | None, Role]] = [
            (self.pose if isinstance(self.pose, str) else None, "pose"),
            (self.twist, "twist"),
            *((topic, "joint_states") for topic in self.joint_states),
            (self.wrench, "wrench"),
            *((topic, "tactile") for topic in self.tactile),
            (self.tool_to_board, "tool_to_board"),
            *((topic, "outputs") for _, topic in self.outputs),
            *((topic, "digital") for _, topic in self.digital),
        ]
        return [(topic, role) for topic, role in pairs if topic is not None]


class SceneTopicMap(TopicMap):
    """Topics of a demonstration with solids at rest around the movement."""

    obstacles: Topic | None

    @model_validator(mode="after")
    def _has_a_pose(self) -> "SceneTopicMap":
        if self.pose is None:
            raise ValueError("needs a `pose`")
        return self

    def roles(self) -> list[tuple[str, Role]]:
        """Every topic that is itself a signal, with its role, in a fixed order."""
        return super().roles() + ([(self.obstacles, "obstacles")] if self.obstacles else [])


class OptionalTopicMap(SceneTopicMap):
    """Topics that files have only if the signal was recorded."""

    must_exist: ClassVar[bool] = False


OWN_TOPICS = OptionalTopicMap(
    pose="/pose",
    twist="/twist",
    joint_states=("/joint_states/positions", "/joint_states/velocities", "/joint_states/torques"),
    joints=None,
    wrench="/wrench",
    tactile=tuple(f"/tactile/{finger}" for finger in range(MAX_FINGERS)),
    tool_to_board="/tool_to_board",
    obstacles="/obstacles",
)
"""Topics of the files that this package writes, if recorded. Joint signals have separate topics, since each
may have its own clock."""
