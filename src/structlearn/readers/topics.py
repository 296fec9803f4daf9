"""Which topic of a bag carries which signal."""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from structlearn.core.params import Parameters

Role = Literal["pose", "twist", "joint_states", "wrench", "tactile", "tool_to_board", "obstacles"]

MAX_FINGERS = 10
"""Tactile streams that our own files may have: two hands."""


def _one_or_many(value: object) -> object:
    """A lone topic in the parameter file is a list of one."""
    return (value,) if isinstance(value, str) else value


Topic = Annotated[str, Field(min_length=1)]
Topics = Annotated[tuple[Topic, ...], BeforeValidator(_one_or_many)]


class TransformPose(Parameters):
    """A pose of the frame `child` in `parent`: a chain of transforms as /tf and /tf_static have them."""

    parent: Topic
    child: Topic
    topic: Topic

    @property
    def topics(self) -> tuple[str, ...]:
        """Where transforms may be; those of the second are at rest."""
        return self.topic, f"{self.topic}_static"


class JointPose(Parameters):
    """A pose of the link `tip`, from joint states by the robot's kinematics, in the frame of its root."""

    urdf: str = Field(min_length=1)
    tip: Topic
    topic: Topic

    @property
    def topics(self) -> tuple[str, ...]:
        """Where joint states are."""
        return (self.topic,)


def _pose_form(value: object) -> str:
    """Which form of pose a value is meant to be, so that what is wrong with it is told of that form alone."""
    if isinstance(value, Mapping):
        return "joints" if "urdf" in value else "transforms"
    if isinstance(value, JointPose):
        return "joints"
    return "transforms" if isinstance(value, TransformPose) else "topic"


Pose = Annotated[
    Annotated[Topic, Tag("topic")]
    | Annotated[TransformPose, Tag("transforms")]
    | Annotated[JointPose, Tag("joints")],
    Discriminator(_pose_form),
]


class TopicMap(Parameters):
    """The topics of a demonstration in a robot's bag; each topic has one role."""

    must_exist: ClassVar[bool] = True
    """Whether a topic named here that a file does not have is an error; the pose always is."""

    # end-effector pose, the one signal that every demonstration has: its topic, or what it is computed from,
    # which may be joint states of `joint_states` too
    pose: Pose
    twist: Topic | None
    joint_states: Topics  # one topic usually has positions, velocities and torques, several may share them
    # names of the joints that are taken, in this order; None: those of whoever publishes the most
    joints: tuple[Topic, ...] | None = Field(min_length=1)
    wrench: Topic | None
    tactile: Topics  # one topic per sensor, in the order in which their channels are put side by side
    tool_to_board: Topic | None  # orientation of the tool relative to the board, e.g. from motion capture

    @model_validator(mode="after")
    def _each_once(self) -> "TopicMap":
        names = [topic for topic, _ in self.roles()]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ValueError(f"topic named more than once: {', '.join(repeated)}")
        if self.joints and len(set(self.joints)) < len(self.joints):
            raise ValueError(f"joint named more than once in: {', '.join(self.joints)}")
        return self

    @property
    def topics(self) -> list[str]:
        """Every topic that has to be read, once."""
        of_pose = () if isinstance(self.pose, str) else self.pose.topics
        return list(dict.fromkeys([*of_pose, *(topic for topic, _ in self.roles())]))

    def roles(self) -> list[tuple[str, Role]]:
        """Every topic that is a signal by itself with what it is read as, in a fixed order."""
        pairs: list[tuple[str | None, Role]] = [
            (self.pose if isinstance(self.pose, str) else None, "pose"),
            (self.twist, "twist"),
            *((topic, "joint_states") for topic in self.joint_states),
            (self.wrench, "wrench"),
            *((topic, "tactile") for topic in self.tactile),
            (self.tool_to_board, "tool_to_board"),
        ]
        return [(topic, role) for topic, role in pairs if topic is not None]


class SceneTopicMap(TopicMap):
    """Topics of a demonstration with solids at rest around the movement."""

    obstacles: Topic | None

    def roles(self) -> list[tuple[str, Role]]:
        """Every topic that is a signal by itself with what it is read as, in a fixed order."""
        return super().roles() + ([(self.obstacles, "obstacles")] if self.obstacles else [])


class OptionalTopicMap(SceneTopicMap):
    """Topics of which a file has those of the signals that were recorded."""

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
"""The topics of the files that this package writes. Joint signals have a topic each, since each may have a
clock of its own; a file has those of the topics that were recorded."""
