"""A task of your own: what its entry in `stages/own/params.yaml` says, and what the defaults add to it.

    defaults:          every constant once
      clock: {rate_hz: 200.0, max_gap_s: 0.2}
    tasks:
      pick:            what differs, merged over the defaults key by key
        source: ~/demonstrations
        topics: {pose: /end_effector/pose}

A task has the parts that its entry names (`PARTS`); the others are null, whatever their defaults are.
"""

import hashlib
import sys
from pathlib import Path
from typing import Any, Self

import yaml
from pydantic import Field, model_validator

from structlearn.avoidance.scene_people import ScenePeopleParameters
from structlearn.core.artefacts import publish
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters, checked, local_path, merged, read_values
from structlearn.core.stage import run
from structlearn.feedback.coupling_model import NetworkParameters, TrainingParameters
from structlearn.feedback.coupling_targets import CorrectionParameters
from structlearn.feedback.skill_file import SkillParameters
from structlearn.primitives.fitting import FitParameters
from structlearn.primitives.sequence import GeneraliseParameters
from structlearn.readers.clock import ClockParameters
from structlearn.readers.settings import Setting
from structlearn.readers.stamps import StampPolicy
from structlearn.readers.topics import JointPose, SceneTopicMap, TopicMap
from structlearn.segmentation.parameters import SegmentParameters
from structlearn.tasks.motion.motion_parameters import MotionParameters
from structlearn.tasks.own.protocol.arm_parameters import RobotParameters
from structlearn.tasks.task_files import NAME_RULE, is_name
from structlearn.tasks.touch.touch_parameters import TouchParameters

PARAMETER_FILE = Path("stages/own/params.yaml")

PARTS = ("feedback", "robot", "motion", "touch", "obstacles")
"""Keys of what a task may have or not, besides demonstrations."""

OF_DEMONSTRATIONS = ("topics", "segment", "fit", "generalise", "skill")
"""Keys that a task without demonstrations does not have either."""


class OwnFeedbackParameters(CorrectionParameters, NetworkParameters):
    """Executions and corrections, and the feedback learned from them. Fields: `stages/own/params.yaml`."""

    executions: str = Field(min_length=1)
    corrections: str = Field(min_length=1)
    settings: tuple[Setting, ...] = Field(min_length=1)
    expected_hz: float = Field(gt=0)
    training: TrainingParameters
    parts: int = Field(ge=2)


class ObstacleParameters(ScenePeopleParameters):
    """Reaches past obstacles. Fields: `stages/own/params.yaml`, `obstacles`."""

    source: str = Field(min_length=1)
    topics: SceneTopicMap


class TaskParameters(Parameters):
    """One task, its defaults merged in. Fields: `stages/own/params.yaml`, `defaults`."""

    source: str | None = Field(min_length=1)
    topics: TopicMap | None
    stamps: StampPolicy
    clock: ClockParameters
    segment: SegmentParameters | None
    fit: FitParameters | None
    generalise: GeneraliseParameters | None
    skill: SkillParameters | None
    feedback: OwnFeedbackParameters | None
    robot: RobotParameters | None
    motion: MotionParameters | None
    touch: TouchParameters | None
    obstacles: ObstacleParameters | None

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Self:
        if self.source is None:
            for part in ("feedback", "robot"):
                if getattr(self, part) is not None:
                    raise ValueError(f"{part} needs demonstrations: name their source")
            if self.motion is None and self.touch is None and self.obstacles is None:
                raise ValueError(
                    "names no recordings: a source of demonstrations, motion, touch or obstacles"
                )
        if self.feedback is not None and self.segment is not None:
            known = [primitive.name for primitive in self.segment.primitives]
            for name in self.feedback.primitives:
                if name not in known:
                    raise ValueError(f"feedback: there is no primitive '{name}' among {', '.join(known)}")
            for sensor in self.feedback.sensors:
                if not getattr(self.topics, sensor):
                    raise ValueError(f"feedback.sensors: {sensor} is felt by no topic; name it in topics")
        return self

    def sources(self) -> dict[str, tuple[str, ...]]:
        """Files and folders that the task comes from, as they are written, by what they are for."""
        found: dict[str, tuple[str, ...]] = dict.fromkeys(SOURCES, ())
        if self.source is not None and self.topics is not None:
            computed = (self.topics.pose.urdf,) if isinstance(self.topics.pose, JointPose) else ()
            found["demonstrations"] = (self.source, *computed)
        if self.feedback is not None:
            found |= {"executions": (self.feedback.executions,), "corrections": (self.feedback.corrections,)}
        if self.robot is not None:
            found["robot"] = (self.robot.urdf,)
        if self.motion is not None:
            found["motion"] = (self.motion.source, self.motion.urdf)
        if self.touch is not None:
            found["touch"] = (self.touch.source,)
        if self.obstacles is not None:
            found["obstacles"] = (self.obstacles.source,)
        return found


SOURCES = ("demonstrations", "executions", "corrections", "robot", "motion", "touch", "obstacles")
"""What files may be for."""


def read_task(name: str, path: Path = PARAMETER_FILE) -> TaskParameters:
    """The parameters of one task.

    Raises:
        InputError: the file is not readable, has no such task, or a value is missing, unknown or out of
            range; the message names file and key.
    """
    values = read_values(path)
    tasks = values.get("tasks") if isinstance(values, dict) else None
    tasks = {str(key): entry for key, entry in tasks.items()} if isinstance(tasks, dict) else {}
    where = f"tasks.{name}"
    if not isinstance(tasks.get(name), dict):
        raise InputError(f"{path}: {where}: there is no such task among {', '.join(tasks) or 'none'}")
    if not is_name(name):
        raise InputError(f"{path}: {where}: {NAME_RULE}")
    return checked(_with_defaults(values.get("defaults") or {}, tasks[name]), TaskParameters, path, where)


def _with_defaults(defaults: dict[str, Any], entry: dict[str, Any]) -> dict[str, Any]:
    """An entry merged over the defaults; parts that it does not name are null."""
    values = merged(defaults, entry)
    absent = [part for part in PARTS if entry.get(part) is None]
    absent += OF_DEMONSTRATIONS if values.get("source") is None else ()
    return values | dict.fromkeys(absent)


def read_checked(path: Path) -> TaskParameters:
    """What `write_task` published."""
    values = read_values(path)
    if isinstance(values, dict):
        values = {key: value for key, value in values.items() if key != "files"}
    return checked(values, TaskParameters, path, "task")


def source_digests(task: TaskParameters) -> dict[str, dict[str, str]]:
    """`file_digests` of all files and folders that the task comes from, by what they are for."""
    return {
        name: {file: digest for path in paths for file, digest in file_digests(path).items()}
        for name, paths in task.sources().items()
    }


def write_task(task: TaskParameters, files: dict[str, dict[str, str]], path: Path) -> None:
    """Publish a task's parameters with the digests that its sources had before they were read.

    Raises:
        InputError: a source has changed since.
    """
    if (now := source_digests(task)) != files:
        changed = {
            name
            for kind in files
            for name, digest in {**files[kind], **now[kind]}.items()
            if files[kind].get(name) != now[kind].get(name)
        }
        raise InputError(f"{', '.join(sorted(changed))}: changed while it was read; run it again")
    content = task.model_dump(mode="json") | {"files": files}
    with publish(path) as target:
        target.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


def file_digests(source: str) -> dict[str, str]:
    """SHA-256 of a file, or of all files below a folder but hidden ones, by their path as it is written.

    Raises:
        InputError: there is no such file or folder.
    """
    path = local_path(source)
    if path.suffix == ".urdf":
        from structlearn.simulation.arm import urdf_path

        path = urdf_path(str(path))
    if not path.exists():
        raise InputError(f"{source}: no such file or folder")
    if path.is_file():
        return {source: _digest(path)}
    found = {file: file.relative_to(path) for file in sorted(path.rglob("*")) if file.is_file()}
    return {
        f"{source}/{name.as_posix()}": _digest(file)
        for file, name in found.items()
        if not any(part.startswith(".") for part in name.parts)
    }


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _check() -> None:
    read_task(sys.argv[1])


if __name__ == "__main__":  # before DVC, which knows no more of an entry than that there is none
    run(_check)
