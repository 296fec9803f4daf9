"""Sets of demonstrations: a folder of MCAP files, one file each.

Files are read and written one after the other: one of 10 000 messages takes 10 to 15 ms, less than processes
gain before there are hundreds.
"""

import re
from collections.abc import Sequence
from pathlib import Path

from structlearn.ground.errors import InputError
from structlearn.ground.params import NAME
from structlearn.recordings.checks import check_recording
from structlearn.recordings.clock import MAX_GAP_S, synchronise
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.mcap_file import read_recording, write_recording
from structlearn.recordings.recording import Recording
from structlearn.recordings.topics import OWN_TOPICS, TopicMap


def read_demonstrations(
    source: str | Path,
    topics: TopicMap = OWN_TOPICS,
    rate_hz: float | None = None,
    max_gap_s: float = MAX_GAP_S,
) -> list[Demonstration]:
    """Read demonstrations, each on a uniform clock (see `clock.synchronise`).

    Args:
        source: one .mcap file; a folder of .mcap files; a ROS 2 bag (folder with metadata.yaml and one .mcap
            file); or a folder of such bags. Hidden and other files are passed over.
        topics: which topic carries which signal.
        rate_hz: ticks per second of all demonstrations; None: each has the median rate of its pose stream.
        max_gap_s: longest hole in s that is bridged by interpolation.

    Returns:
        One demonstration per file, named after the file's stem, in natural order: 2 before 10.

    Raises:
        InputError: there is no such source or no .mcap file in it, a bag is split over several files, two
            files have the same stem, or a file fails `read_recording` or `synchronise`; the message names it.
    """
    return [_read(path, topics, rate_hz, max_gap_s) for path in mcap_files(Path(source))]


def read_recordings(source: str | Path, topics: TopicMap = OWN_TOPICS) -> list[Recording]:
    """Read recordings as they are, each stream with its own clock.

    Args:
        source: as in `read_demonstrations`.
        topics: which topic carries which signal.

    Returns:
        One recording per file, in natural order of their names.

    Raises:
        InputError: as `read_demonstrations`, but for the clock; or a recording fails `check_recording`.
    """
    return [_read_checked(path, topics) for path in mcap_files(Path(source))]


def write_recordings(recordings: Sequence[Recording], folder: str | Path) -> None:
    """Write recordings as folder/NAME.mcap; numbers as names are padded with zeros to equal length.

    Args:
        recordings: with different names.
        folder: made if missing. Publish it as a whole: `with publish(...) as folder: write_recordings(...)`.

    Raises:
        InputError: names repeat or are no file names, or a recording fails `write_recording`.
    """
    names = [recording.name for recording in recordings]
    digits = max((len(name) for name in names if name.isdecimal()), default=0)
    stems = [name.zfill(digits) if name.isdecimal() else name for name in names]
    _check_unique(stems, str(folder))
    for stem in stems:
        _check_name(stem, str(folder))
    Path(folder).mkdir(parents=True, exist_ok=True)
    for recording, stem in zip(recordings, stems, strict=True):
        write_recording(recording, Path(folder) / f"{stem}.mcap")


def _read(path: Path, topics: TopicMap, rate_hz: float | None, max_gap_s: float) -> Demonstration:
    recording = read_recording(path, topics)
    try:
        return synchronise(recording, rate_hz, max_gap_s)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _read_checked(path: Path, topics: TopicMap) -> Recording:
    recording = read_recording(path, topics)
    try:
        check_recording(recording)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return recording


def mcap_files(source: Path) -> list[Path]:
    """The .mcap files of a source in natural order; one in each bag."""
    if not source.exists():
        raise InputError(f"{source}: no such file or folder")
    if source.is_file():
        return [source]
    found: list[Path] = []
    for folder in [source, *(path.parent for path in source.glob("*/metadata.yaml"))]:
        files = [path for path in folder.glob("*.mcap") if not path.name.startswith(".")]
        if len(files) > 1 and (folder / "metadata.yaml").exists():
            raise InputError(
                f"{folder}: the bag is split into {len(files)} files; join them with `ros2 bag convert`"
            )
        found += files
    if not found:
        raise InputError(f"{source}: holds no .mcap file; other bags become one with `ros2 bag convert`")
    for path in found:
        _check_name(path.stem, str(path))
    _check_unique([path.stem for path in found], str(source))
    return sorted(found, key=lambda path: natural_order(path.stem))


def natural_order(name: str) -> list[str | int]:
    """Key that sorts runs of digits in a name as numbers; odd places are numbers, so keys compare."""
    return [int(part) if place % 2 else part for place, part in enumerate(re.split(r"(\d+)", name))]


def _check_name(name: str, where: str) -> None:
    if not re.fullmatch(NAME, name):
        raise InputError(
            f"{where}: '{name}' cannot be a name: it needs a letter or digit first, then such, spaces and "
            "_ . + - ( )"
        )


def _check_unique(names: Sequence[str], where: str) -> None:
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise InputError(f"{where}: several recordings have the name {', '.join(repeated)}")
