"""Which topic of a bag carries which signal."""

from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from structlearn.ground.params import Parameters

Role = Literal["pose", "twist", "joint_states", "wrench", "tactile", "tool_to_board", "obstacles"]

MAX_FINGERS = 10
"""Tactile streams that our own files may have: two hands."""


def _one_or_many(value: object) -> object:
    """A lone topic in the parameter file is a list of one."""
    return (value,) if isinstance(value, str) else value


Topic = Annotated[str, Field(min_length=1)]
Topics = Annotated[tuple[Topic, ...], BeforeValidator(_one_or_many)]


class TopicMap(Parameters):
    """The topics of a demonstration in a robot's bag; each topic is named once.

    Attributes:
        pose: end-effector pose, the one signal that every demonstration has.
        twist: end-effector velocity.
        joint_states: joint positions, velocities and torques; one topic usually has all three, several topics
            may share them.
        wrench: force and torque at the wrist.
        tactile: one topic per tactile sensor, in the order in which their channels are put side by side.
        tool_to_board: orientation of the tool relative to the board, e.g. from motion capture.
    """

    must_exist: ClassVar[bool] = True
    """Whether a topic named here that a file does not have is an error; the pose always is."""

    pose: Topic
    twist: Topic | None
    joint_states: Topics
    wrench: Topic | None
    tactile: Topics
    tool_to_board: Topic | None

    @model_validator(mode="after")
    def _each_once(self) -> "TopicMap":
        names = [topic for topic, _ in self.roles()]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ValueError(f"topic named more than once: {', '.join(repeated)}")
        return self

    def roles(self) -> list[tuple[str, Role]]:
        """Every named topic with what it is read as, in a fixed order."""
        pairs: list[tuple[str | None, Role]] = [(self.pose, "pose"), (self.twist, "twist")]
        pairs += [(topic, "joint_states") for topic in self.joint_states]
        pairs += [(self.wrench, "wrench")]
        pairs += [(topic, "tactile") for topic in self.tactile]
        pairs += [(self.tool_to_board, "tool_to_board")]
        return [(topic, role) for topic, role in pairs if topic is not None]


class SceneTopicMap(TopicMap):
    """Topics of a demonstration in a scene of which something is known.

    Attributes:
        obstacles: solids at rest around the movement.
    """

    obstacles: Topic | None

    def roles(self) -> list[tuple[str, Role]]:
        """Every named topic with what it is read as, in a fixed order."""
        return super().roles() + ([(self.obstacles, "obstacles")] if self.obstacles else [])


class OptionalTopicMap(SceneTopicMap):
    """Topics of which a file has those of the signals that were recorded."""

    must_exist: ClassVar[bool] = False


OWN_TOPICS = OptionalTopicMap(
    pose="/pose",
    twist="/twist",
    joint_states=("/joint_states/positions", "/joint_states/velocities", "/joint_states/torques"),
    wrench="/wrench",
    tactile=tuple(f"/tactile/{finger}" for finger in range(MAX_FINGERS)),
    tool_to_board="/tool_to_board",
    obstacles="/obstacles",
)
"""The topics of the files that this package writes. Joint signals have a topic each, since each may have a
clock of its own; a file has those of the topics that were recorded."""
