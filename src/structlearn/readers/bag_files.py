"""The files of a source, whatever their format, and each of them opened as a `Bag`.

| file | what |
|---|---|
| `.mcap` | ROS 2 bag, also `.mcap.zstd` (a file compressed as a whole) |
| `.db3` | ROS 2 bag of the older storage, also `.db3.zstd`; needs the extra `bags` |
| `.bag` | ROS 1 bag; needs the extra `bags` |
| `.csv`, `.parquet` | table of poses (see `pose_table`); only where a folder has no bags |

A bag may be a folder with `metadata.yaml`, split over several files. Messages that were compressed one by one
are unpacked. Bags other than MCAP are read by the library `rosbags`, an extra of this package: messages of
ROS 1 become those of ROS 2, the same numbers in CDR, headers without their counter.
"""

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePath
from typing import Any, Literal

from mcap.records import Schema
from mcap.well_known import SchemaEncoding

from structlearn.core.errors import InputError
from structlearn.core.params import NAME, home_path, read_values
from structlearn.core.reading import PER_MESSAGE, Budget, require_file
from structlearn.readers.bag import (
    COMPRESSED,
    Bag,
    Row,
    in_time_order,
    joined,
    read_bag,
    unpacked_chunk,
    unpacked_file,
    unpacked_message,
)
from structlearn.readers.pose_table import SHAPE_FILE, read_pose_table
from structlearn.readers.text_log import natural_order

Format = Literal["mcap", "db3", "bag", "table"]

SUFFIXES: dict[str, Format] = {
    ".mcap": "mcap",
    f".mcap{COMPRESSED}": "mcap",
    ".db3": "db3",
    f".db3{COMPRESSED}": "db3",
    ".bag": "bag",
    ".csv": "table",
    ".parquet": "table",
}

HEADER = "std_msgs/msg/Header"

LARGEST_OF_ROS1 = 2**27
"""Bytes of a chunk when it is unpacked; recorders begin a new one after less than one million."""


def read_db3(path: Path, topics: Collection[str]) -> Bag:
    """Read a .db3 file; files older than ROS 2 Iron lack definitions, those of the library stand in.

    Raises InputError: `rosbags` is not installed, or the file is missing or damaged; the message names it.
    """
    with _library_named(path), unpacked_file(path, budget := Budget(path)) as plain:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        latest = get_typestore(Stores.LATEST)
        with AnyReader([plain], default_typestore=latest) as reader:
            return _bag(
                reader,
                topics,
                (reader.typestore, latest),
                lambda raw, kind: unpacked_message(raw, budget),
                budget,
            )


def read_ros1_bag(path: Path, topics: Collection[str]) -> Bag:
    """Read a .bag file of ROS 1; raises as `read_db3`."""
    with _library_named(path):
        from rosbags.rosbag1 import Reader
        from rosbags.rosbag1.reader import decompressors
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        with Reader(path) as reader:
            types: dict[str, Any] = {}
            for connection in reader.connections:
                types |= get_types_from_msg(connection.msgdef.data, connection.msgtype)
            if HEADER in types:  # with the counter, messages could not be turned into those of ROS 2
                types[HEADER] = get_typestore(Stores.LATEST).fielddefs[HEADER]
            store = get_typestore(Stores.EMPTY)
            store.register(types)
            budget, known = Budget(path), {its: name for name, its in decompressors.items()}

            def unpacked(compression: str, data: bytes) -> bytes:  # again where chunks overlap in time
                content = unpacked_chunk(compression, data, LARGEST_OF_ROS1)
                if len(content) > LARGEST_OF_ROS1:
                    raise InputError(f"{path}: a chunk of more than {LARGEST_OF_ROS1} bytes")
                budget.take(len(content))
                return content

            for place, chunk in reader.chunks.items():
                of_its = partial(unpacked, known[chunk.decompressor])
                reader.chunks[place] = chunk._replace(decompressor=of_its)
            return _bag(reader, topics, (store,), store.ros1_to_cdr, budget)


@contextmanager
def _library_named(path: Path) -> Iterator[None]:
    """Turn whatever the library raises into an InputError that names the file; only its calls go inside."""
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "rosbags":
            raise
        raise InputError(
            f"{path}: bags of this kind are read by `rosbags`, which is not installed: `make own` installs "
            "it, or `pip install structlearn[bags]`; or `ros2 bag convert` turns the bag into MCAP"
        ) from error
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:
        raise InputError(f"{path}: damaged bag: {type(error).__name__}: {error}") from error


def _bag(reader: Any, topics: Collection[str], stores: Collection[Any], to_cdr: Any, budget: Budget) -> Bag:
    """Content of an open reader; `stores` know the types, `to_cdr` turns content and type into CDR."""
    present: dict[str, dict[str, None]] = {}  # in their order
    for connection in reader.connections:
        present.setdefault(connection.topic, {})[connection.msgtype] = None
    wanted = [connection for connection in reader.connections if connection.topic in topics]
    schemas = {name: _schema(name, stores) for name in dict.fromkeys(one.msgtype for one in wanted)}
    rows: dict[str, list[Row]] = {}
    for connection, log_time, raw in reader.messages(connections=wanted) if wanted else ():
        budget.take(PER_MESSAGE)
        row = (log_time, schemas[connection.msgtype], bytes(to_cdr(raw, connection.msgtype)))
        rows.setdefault(connection.topic, []).append(row)
    types = {topic: list(its) for topic, its in present.items()}
    return Bag(types, None, {topic: in_time_order(its) for topic, its in rows.items()})


def _schema(name: str, stores: Collection[Any]) -> Schema:
    store = next((store for store in stores if name in store.fielddefs), None)
    if store is None:
        raise LookupError(f"the type {name} is not defined")
    text, _ = store.generate_msgdef(name, ros_version=2)
    return Schema(id=0, name=name, encoding=SchemaEncoding.ROS2, data=text.encode())


READERS: dict[Format, Callable[[Path, Collection[str]], Bag]] = {
    "mcap": read_bag,
    "db3": read_db3,
    "bag": read_ros1_bag,
}

METADATA = "metadata.yaml"
"""What makes a folder a ROS 2 bag."""


@dataclass(frozen=True)
class RecordingFile:
    """One recording as it lies on the disk."""

    name: str  # of the recording: the file's stem, or where a bag is split the name of its folder
    format: Format  # how it is stored
    paths: tuple[Path, ...]  # the file; where a bag is split, its files in their order

    @property
    def path(self) -> Path:
        """What stands for it in messages: the file, or the folder of a bag that is split."""
        return self.paths[0] if len(self.paths) == 1 else self.paths[0].parent


def recording_files(source: str | Path) -> list[RecordingFile]:
    """Every recording of a source, in natural order of their names: 2 before 10.

    A source is one file; a folder of files; a ROS 2 bag (folder with metadata.yaml); or a folder of such
    bags. `~` is the home folder. Hidden and other files are passed over, and tables where there are bags.
    Raises InputError: there is no such source or nothing in it, a file of a bag is missing, a bag has files
    of several kinds, or two recordings have one name or one that can be no name; the message names it.
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


def as_recording_file(path: Path) -> RecordingFile:
    """A lone file; one whose name does not say what it is has to be MCAP. `~` is the home folder."""
    path = home_path(path)
    suffix = _suffix(path)
    return RecordingFile(path.name.removesuffix(suffix) or path.name, SUFFIXES.get(suffix, "mcap"), (path,))


def open_bag(file: RecordingFile, topics: Collection[str]) -> Bag:
    """Topics with their types, and messages (ROS 2, CDR) of those that are wanted, of a file of any format.

    Raises InputError: the file cannot be read, is damaged, or needs the extra `bags`, which is not installed.
    """
    for path in file.paths:
        if path.exists():
            require_file(path, whole=False)
    if file.format == "table":
        return read_pose_table(file.paths[0])
    return joined([READERS[file.format](path, topics) for path in file.paths])


def check_names(names: Sequence[str], where: str) -> None:
    """Refuse names that several recordings have, and what can be no name of one."""
    for name in names:
        if not re.fullmatch(NAME, name):
            raise InputError(
                f"{where}: '{name}' cannot be a name: it needs a letter or digit first, then such, spaces "
                "and _ . + - ( )"
            )
    repeated = sorted(name for name, count in Counter(names).items() if count > 1)
    if repeated:
        raise InputError(f"{where}: several recordings have the name {', '.join(repeated)}")


def _suffix(path: Path) -> str:
    """The end of a file's name that says what it is."""
    return "".join(path.suffixes[-2:]) if path.suffix == COMPRESSED else path.suffix


def _files(folder: Path, formats: Collection[str]) -> list[RecordingFile]:
    """Files of some formats in natural order; tables of shapes are no recordings."""
    paths = [
        path
        for path in folder.iterdir()
        if SUFFIXES.get(_suffix(path)) in formats
        and not path.name.startswith(".")
        and not path.name.endswith(SHAPE_FILE)
    ]
    return [as_recording_file(path) for path in sorted(paths, key=lambda path: natural_order(path.name))]


def _bags(folder: Path) -> list[RecordingFile]:
    """Bags in a folder: its files one by one, unless it is a bag that is split over them."""
    files = _files(folder, READERS)
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
