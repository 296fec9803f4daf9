"""Sources of recordings: parameters of a source, its topics and stamps, and its files.

| file | what |
|---|---|
| `.mcap` | ROS 2 bag, also `.mcap.zstd` (compressed as a whole) |
| `.db3` | ROS 2 bag of the older storage, also `.db3.zstd`; needs the extra `bags` |
| `.bag` | ROS 1 bag; needs the extra `bags` |
| `.csv`, `.parquet` | table of poses (see `user_tables`); only in folders without bags |

A bag may be a folder with `metadata.yaml`, split over several files. A setting in which people corrected is
named by a label, or by a number in its shortest form: `5`, `5.0` and 5 are all "5"; `tilt_left` is a label.
The recordings of each setting are in a folder with its label as name.
"""

import math
import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path, PurePath
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import BeforeValidator, Discriminator, Field, PlainSerializer, Tag, model_validator

from structlearn.core.errors import InputError
from structlearn.core.params import NAME, Name, Parameters, home_path, read_values
from structlearn.readers.foreign_tables import natural_order

# Parameters of a source


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

# Topics

Role = Literal["pose", "twist", "joint_states", "wrench", "tactile", "tool_to_board", "obstacles"]
Topic = Annotated[str, Field(min_length=1)]
Topics = Annotated[
    tuple[Topic, ...],
    BeforeValidator(lambda value: (value,) if isinstance(value, str) else value),  # a single topic as a list
]

JointNames = Annotated[
    tuple[tuple[str, str], ...],
    BeforeValidator(lambda value: tuple(value.items()) if isinstance(value, Mapping) else value),
    PlainSerializer(dict),
]
"""Mapping from recorded joint names to those of the URDF, where they differ."""

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

    # end-effector pose, the one signal that every demonstration has: its topic, or how it is computed, maybe
    # from joint states that are also in `joint_states`
    pose: Pose
    twist: Topic | None
    joint_states: Topics  # usually one topic with positions, velocities and torques; several may share them
    # names of the joints to read, in this order; None: those of the publisher with the most joints
    joints: tuple[Topic, ...] | None = Field(min_length=1)
    wrench: Topic | None
    tactile: Topics  # one topic per sensor, in the order in which channels are concatenated
    tool_to_board: Topic | None  # orientation of the tool relative to the board, e.g. from motion capture

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
        of_pose = () if isinstance(self.pose, str) else self.pose.topics
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
        ]
        return [(topic, role) for topic, role in pairs if topic is not None]


class SceneTopicMap(TopicMap):
    """Topics of a demonstration with solids at rest around the movement."""

    obstacles: Topic | None

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

# Files

COMPRESSED = ".zstd"  # suffix of a file that is compressed as a whole
METADATA = "metadata.yaml"  # makes a folder a ROS 2 bag

Format = Literal["mcap", "db3", "bag", "table"]
SUFFIXES: dict[str, Format] = {
    ".mcap": "mcap",
    ".db3": "db3",
    ".bag": "bag",
    ".csv": "table",
    ".parquet": "table",
}
SUFFIXES |= {f".mcap{COMPRESSED}": "mcap", f".db3{COMPRESSED}": "db3"}

SHAPE_FILE = "obstacles.csv"
"""Shapes for all recordings in its folder, or for its bag folder; `NAME.obstacles.csv`: for one recording."""


class RecordingFile(NamedTuple):
    """Files of one recording."""

    name: str  # of the recording: the file's stem, or the name of the folder of a split bag
    format: Format
    paths: tuple[Path, ...]  # the file; for a split bag its files in order

    @property
    def path(self) -> Path:
        """Path for messages: the file, or the folder of a split bag."""
        return self.paths[0] if len(self.paths) == 1 else self.paths[0].parent


def recording_files(source: str | Path) -> list[RecordingFile]:
    """Every recording of a source, in natural order of their names: 2 before 10.

    A source is one file; a folder of files; a ROS 2 bag (folder with metadata.yaml); or a folder of such
    bags. `~` is the home folder. Hidden and other files are ignored, and tables if there are bags.

    Raises:
        InputError: the source is missing or empty, a file of a bag is missing, a bag has files of several
            kinds, or a name is not valid or repeats.
    """
    source = home_path(source)
    if not source.exists():
        raise InputError(f"{source}: no such file or folder")
    if not source.is_dir():
        return [as_recording_file(source)]
    folders = [source, *sorted(path.parent for path in source.glob(f"*/{METADATA}"))]
    found = [file for folder in folders for file in _bags(folder)] or _files(source, ("table",))
    if not found:
        raise InputError(f"{source}: holds no bag (.mcap, .db3, .bag) and no table (.csv, .parquet)")
    check_names([file.name for file in found], str(source))
    return sorted(found, key=lambda file: natural_order(file.name))


def as_recording_file(path: str | Path | RecordingFile) -> RecordingFile:
    """A single file, MCAP unless its suffix says otherwise; `~` is the home folder."""
    if isinstance(path, RecordingFile):
        return path
    path = home_path(path)
    suffix = _suffix(path)
    return RecordingFile(path.name.removesuffix(suffix) or path.name, SUFFIXES.get(suffix, "mcap"), (path,))


def check_names(names: Sequence[str], where: str) -> None:
    """Raise InputError if names repeat, or one is not valid for a recording."""
    for name in names:
        if not re.fullmatch(NAME, name):
            raise InputError(
                f"{where}: '{name}' cannot be a name: it needs a letter or digit first, then such, spaces "
                "and _ . + - ( )"
            )
    if repeated := sorted(name for name, count in Counter(names).items() if count > 1):
        raise InputError(f"{where}: several recordings have the name {', '.join(repeated)}")


def _suffix(path: Path) -> str:
    """Suffix of a file including that of its format, e.g. `.mcap.zstd`."""
    return "".join(path.suffixes[-2:]) if path.suffix == COMPRESSED else path.suffix


def _files(folder: Path, formats: Collection[str]) -> list[RecordingFile]:
    """Files of some formats in natural order, except tables of shapes."""
    paths = sorted(folder.iterdir(), key=lambda path: natural_order(path.name))
    return [
        as_recording_file(path)
        for path in paths
        if SUFFIXES.get(_suffix(path)) in formats and not path.name.startswith(".")
        if not path.name.endswith(SHAPE_FILE)
    ]


def _bags(folder: Path) -> list[RecordingFile]:
    """Bags in a folder: one per file, or a single one if the folder is a split bag."""
    files = _files(folder, ("mcap", "db3", "bag"))
    if not (folder / METADATA).exists():
        return files
    content = read_values(folder / METADATA)
    information = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    listed = information.get("relative_file_paths") if isinstance(information, dict) else None
    present = {path.name.removesuffix(COMPRESSED) for file in files for path in file.paths}
    for name in [PurePath(str(name)).name for name in listed] if isinstance(listed, list) else []:
        if name.removesuffix(COMPRESSED) not in present:
            raise InputError(f"{folder}: the bag's file {name}, which {METADATA} names, is missing")
    if len(files) < 2:
        return files
    formats = sorted({file.format for file in files})
    if len(formats) > 1:
        raise InputError(f"{folder}: the bag has files of several kinds: {', '.join(formats)}")
    return [RecordingFile(folder.name, formats[0], tuple(file.paths[0] for file in files))]
