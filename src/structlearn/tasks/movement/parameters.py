"""Parameters of `movement` entries: recordings, cuts, primitives, corrections, and the skill's robot."""

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, PositiveFloat, field_validator, model_validator

from structlearn.core import quaternion
from structlearn.core.params import Name, Parameters
from structlearn.feedback.coupling_targets import CorrectionParameters
from structlearn.feedback.skill_file import SkillParameters
from structlearn.feedback.trainers import FeedbackNetworkParameters, TrainingParameters
from structlearn.primitives.fitting import FitParameters
from structlearn.primitives.position import FrameChoice
from structlearn.primitives.stiffness import StiffnessParameters
from structlearn.readers.source import ClockParameters, JointPose, Setting, SourceParameters, TopicMap
from structlearn.segmentation.parameters import BETWEEN, STROKES, SegmentParameters

PARTS = "parts"  # recordings are the primitives of one execution, each with its own name


class RestParameters(Parameters):
    """Simulated rests and noise, between which whole movements are to be found."""

    noise_mm: tuple[float, ...] = Field(min_length=1)
    seeds: int = Field(ge=1)


class TaskFeedbackParameters(CorrectionParameters, FeedbackNetworkParameters):
    """Executions and corrections, and the feedback learned from them."""

    executions: str = Field(min_length=1)
    corrections: str = Field(min_length=1)
    settings: tuple[Setting, ...] = Field(min_length=1)
    expected_hz: float = Field(gt=0)
    training: TrainingParameters
    parts: int = Field(ge=2)


class PhaseCorrectionParameters(Parameters):
    """Corrected runs of a single primitive, for learning coupling as a function of phase alone."""

    source: str = Field(min_length=1)
    part: str | None
    smoothing_hz: float = Field(gt=0)
    kernel_count: int = Field(ge=2, le=200)
    incomplete_m: float = Field(gt=0)
    splits: int = Field(ge=1)


# A common value for all joints, or one for each
Bound = PositiveFloat | Annotated[tuple[PositiveFloat, ...], Field(min_length=1)]


class Placement(Parameters):
    """Pose of a frame in another: its origin, and a unit quaternion w, x, y, z."""

    position_m: tuple[float, float, float]
    orientation: tuple[float, float, float, float]

    @field_validator("orientation")
    @classmethod
    def _is_a_turn(cls, orientation: tuple[float, ...]) -> tuple[float, ...]:
        if abs(np.linalg.norm(orientation) - 1.0) > 1e-3:
            raise ValueError("a quaternion w, x, y, z has norm 1")
        return orientation

    @property
    def turn(self) -> np.ndarray:
        """Orientation (4,), normalised."""
        return quaternion.normalised(np.array(self.orientation))


class RobotParameters(Parameters):
    """A robot, its base and tool relative to the demonstrations, and bounds that are not in its URDF."""

    urdf: str = Field(min_length=1)
    tip: str = Field(min_length=1)
    locked_joints: tuple[str, ...]
    base: Placement
    tool: Placement
    rest_configuration: tuple[float, ...] | None
    max_acceleration: Bound
    max_jerk: Bound
    least_singular_value: float = Field(gt=0)
    least_distance_m: float = Field(gt=0)


class TaskSegmentParameters(SegmentParameters):
    """Segmentation parameters of a task."""

    ends: Literal["onset", "crossing"]

    @property
    def at_onsets(self) -> bool:
        """Whether movements end at their extrapolated onsets."""
        return self.ends == "onset"


class TaskFitParameters(FitParameters):
    """Parameters of a task's primitives."""

    frame: FrameChoice

    @property
    def frame_choice(self) -> FrameChoice:
        """Frame in which positions are learned."""
        return self.frame


class MovementEntry(SourceParameters):
    """Movements of one task."""

    kind = "movement"

    topics: TopicMap | None  # of joints themselves, if they name no pose
    clock: ClockParameters | None
    presegmented: Name | None
    repeats: Annotated[int, Field(ge=1)] | Literal["auto"]
    segment: TaskSegmentParameters | None
    keep_flagged: bool
    rests: RestParameters | None
    fit: TaskFitParameters
    fold: int = Field(ge=1)
    turns: bool
    traces_hz: float | None = Field(gt=0)
    skill: SkillParameters
    stiffness: StiffnessParameters | None
    feedback: TaskFeedbackParameters | None
    corrections: PhaseCorrectionParameters | None
    robot: RobotParameters | None

    @model_validator(mode="before")
    @classmethod
    def _joints_have_no_frame(cls, values: Any) -> Any:
        match values:
            case {"topics": {"pose": None}, "fit": {"frame": "auto", **fit}}:
                return values | {"fit": fit | {"frame": "none"}}
        return values

    @model_validator(mode="after")
    def _joints_are_learned_alone(self) -> Self:
        if self.of_joints != (self.fit.frame == "none"):
            said = "joints have no frame but `none`" if self.of_joints else "a pose has a frame, not `none`"
            raise ValueError(f"fit.frame: {self.fit.frame}: {said}")
        parts = ("feedback", "corrections", "rests", "turns", "traces_hz", "stiffness")
        if self.of_joints and (named := [part for part in parts if getattr(self, part)]):
            raise ValueError(f"{', '.join(named)}: needs a pose, but topics name none, so joints are learned")
        for primitive in self.segment.primitives if self.of_joints and self.segment is not None else ():
            if primitive.axis not in ("xyz", STROKES, BETWEEN) or primitive.threshold_m_s is not None:
                raise ValueError(
                    f"segment: '{primitive.name}': all joints together show a primitive: its axis is "
                    f"{STROKES}, {BETWEEN} or not named, without threshold_m_s"
                )
        return self

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Self:
        if self.segment is None and (self.presegmented is None or self.rests is not None):
            raise ValueError("needs `segment`: the primitives that recordings are cut into")
        if self.presegmented is not None and self.repeats != 1:
            raise ValueError(
                "repeats are looked for only where recordings are cut, "
                f"not with `presegmented: {self.presegmented}`"
            )
        if self.presegmented in (None, PARTS) and (self.turns or self.corrections is not None):
            raise ValueError("turns and corrections need `presegmented`: the one primitive in all recordings")
        if self.presegmented != PARTS and self.traces_hz is not None:
            raise ValueError(f"traces_hz needs `presegmented: {PARTS}`, the primitives of one execution")
        if self.feedback is not None and self.segment is not None:
            known = [primitive.name for primitive in self.segment.primitives]
            for name in self.feedback.primitives:
                if name not in known:
                    raise ValueError(f"feedback: there is no primitive '{name}' among {', '.join(known)}")
            for sensor in self.feedback.sensors:
                if self.topics is not None and not getattr(self.topics, sensor):
                    raise ValueError(f"feedback.sensors: {sensor} is felt by no topic; name it in topics")
        return self

    @property
    def of_joints(self) -> bool:
        """Whether joints themselves are learned, in the unit in which they were recorded."""
        return self.topics is not None and self.topics.pose is None

    @property
    def skips_failures(self) -> bool:
        """Whether recordings that cannot be read or cut are left out."""
        return self.segment is not None and self.segment.skip_failures

    def sources(self) -> dict[str, tuple[str, ...]]:
        """All files and folders that are read, as written in the entry, by their role."""
        pose = None if self.topics is None else self.topics.pose
        computed = (pose.urdf,) if isinstance(pose, JointPose) else ()
        sources: dict[str, tuple[str, ...]] = {"demonstrations": (self.source, *computed), "robot": ()}
        if self.feedback is not None:
            sources |= {
                "executions": (self.feedback.executions,),
                "corrections": (self.feedback.corrections,),
            }
        if self.corrections is not None:
            sources["corrected"] = (self.corrections.source,)
        if self.robot is not None:
            sources["robot"] = (self.robot.urdf,)
        return sources


Entry = MovementEntry
