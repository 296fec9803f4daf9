"""Files of a source, the first step of reading.

| file | what |
|---|---|
| `.mcap` | ROS 2 bag, also `.mcap.zstd` (compressed as a whole) |
| `.db3` | ROS 2 bag of the older storage, also `.db3.zstd`; needs the extra `bags` |
| `.bag` | ROS 1 bag; needs the extra `bags` |
| `.csv`, `.parquet` | table of poses (see `user_tables`); only in folders without bags |

A bag may be a folder with `metadata.yaml`, split over several files.
"""

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any, Literal, NamedTuple

from structlearn.core.errors import InputError
from structlearn.core.params import NAME, home_path, read_values
from structlearn.readers.foreign_tables import natural_order

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
    files = [file for folder in folders for file in _bags(folder)] or _files(source, ("table",))
    if not files:
        raise InputError(f"{source}: holds no bag (.mcap, .db3, .bag) and no table (.csv, .parquet)")
    check_names([file.name for file in files], str(source))
    return sorted(files, key=lambda file: natural_order(file.name))


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
    listed = _listed_files(_description(folder))
    present = {path.name.removesuffix(COMPRESSED): path.name for file in files for path in file.paths}
    for name in listed:
        if name.removesuffix(COMPRESSED) not in present:
            raise InputError(f"{folder}: the bag's file {name}, which {METADATA} names, is missing")
    known = {name.removesuffix(COMPRESSED) for name in listed}
    if listed and (others := [name for plain, name in present.items() if plain not in known]):
        raise InputError(f"{folder}: {METADATA} does not list {', '.join(others)}, which belongs elsewhere")
    if len(files) < 2:
        return files
    formats = sorted({file.format for file in files})
    if len(formats) > 1:
        raise InputError(f"{folder}: the bag has files of several kinds: {', '.join(formats)}")
    return [RecordingFile(folder.name, formats[0], tuple(file.paths[0] for file in files))]


def listed_counts(file: RecordingFile) -> dict[str, int]:
    """Number of messages per topic by the description of a bag, if the files are all of the bag's."""
    folder = file.paths[0].parent
    if not (folder / METADATA).is_file():
        return {}
    description = _description(folder)
    listed = [name.removesuffix(COMPRESSED) for name in _listed_files(description)]
    if sorted(listed) != sorted(path.name.removesuffix(COMPRESSED) for path in file.paths):
        return {}
    counts = {}
    topics = description.get("topics_with_message_count")
    for topic in topics if isinstance(topics, list) else ():
        about = topic.get("topic_metadata") if isinstance(topic, dict) else None
        if isinstance(about, dict) and isinstance(count := topic.get("message_count"), int):
            counts[str(about.get("name"))] = count
    return counts


def _description(folder: Path) -> Mapping[str, Any]:
    """Description of a ROS 2 bag, empty where it has another form."""
    content = read_values(folder / METADATA)
    information = content.get("rosbag2_bagfile_information") if isinstance(content, Mapping) else None
    return information if isinstance(information, Mapping) else {}


def _listed_files(description: Mapping[str, Any]) -> list[str]:
    """Names of a bag's files by its description."""
    paths = description.get("relative_file_paths")
    return [PurePath(str(path)).name for path in paths] if isinstance(paths, list) else []
