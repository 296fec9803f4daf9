"""The files of a source, whatever their format, and each of them opened as a `Bag`.

| file | what |
|---|---|
| `.mcap` | ROS 2 bag, also `.mcap.zstd` (a file compressed as a whole) |
| `.db3` | ROS 2 bag of the older storage, also `.db3.zstd`; needs the extra `bags` |
| `.bag` | ROS 1 bag; needs the extra `bags` |
| `.csv`, `.parquet` | table of poses (see `pose_table`); only where a folder has no bags |

A bag may be a folder with `metadata.yaml`, split over several files. Messages that were compressed one by one
are unpacked.
"""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from structlearn.recordings.bag_reader import Bag

Format = Literal["mcap", "db3", "bag", "table"]


@dataclass(frozen=True)
class RecordingFile:
    """One recording as it lies on the disk.

    Attributes:
        name: of the recording: the file's stem, or where a bag is split the name of its folder.
        format: how it is stored.
        paths: the file; where a bag is split, its files in their order.
    """

    name: str
    format: Format
    paths: tuple[Path, ...]


def recording_files(source: str | Path) -> list[RecordingFile]:
    """Every recording of a source, in natural order of their names: 2 before 10.

    Args:
        source: one file; a folder of files; a ROS 2 bag (folder with metadata.yaml); or a folder of such
            bags. `~` is the home folder. Hidden files and other ones are passed over, and tables where there
            are bags.

    Raises:
        InputError: there is no such source or nothing in it, a file of a split bag is missing, or two
            recordings have one name; the message names it.
    """
    raise NotImplementedError


def open_bag(file: RecordingFile, topics: Collection[str]) -> Bag:
    """Topics, their types, and messages of the topics that are wanted, of a file of any format.

    Messages are ROS 2 messages (CDR) with their definitions, whatever the file holds. A table has the topics
    of `pose_table.TABLE_TOPICS`.

    Raises:
        InputError: the file cannot be read, is damaged, or needs the extra `bags`, which is not installed.
    """
    raise NotImplementedError
