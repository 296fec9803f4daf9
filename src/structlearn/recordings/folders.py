"""Sets of demonstrations: one recording after the other from a source of any format (`bag_files`)."""

from collections.abc import Sequence
from pathlib import Path

from structlearn.ground.errors import InputError
from structlearn.recordings.bag_files import check_name, check_unique, recording_files
from structlearn.recordings.bag_recording import read_recording, write_recording
from structlearn.recordings.checks import check_recording
from structlearn.recordings.clock import MAX_GAP_S, synchronise
from structlearn.recordings.demonstration import Demonstration
from structlearn.recordings.recording import Recording
from structlearn.recordings.stamps import AS_WRITTEN, StampPolicy
from structlearn.recordings.topics import OWN_TOPICS, TopicMap


def read_demonstrations(
    source: str | Path,
    topics: TopicMap = OWN_TOPICS,
    rate_hz: float | None = None,
    max_gap_s: float = MAX_GAP_S,
    stamps: StampPolicy = AS_WRITTEN,
) -> list[Demonstration]:
    """Read demonstrations, each on a uniform clock (`clock.synchronise`), in natural order of their names.

    Args:
        source: see `bag_files.recording_files`.
        topics: which topic carries which signal.
        rate_hz: ticks per second of all demonstrations; None: each has the median rate of its pose stream.
        max_gap_s: longest hole in s that is bridged by interpolation.
        stamps: how stamps are taken.

    Raises:
        InputError: the source fails `bag_files.recording_files`, or a recording `read_recording` or
            `synchronise`; the message names it.
    """
    found = []
    for file in recording_files(source):
        recording = read_recording(file, topics, stamps)
        try:
            found.append(synchronise(recording, rate_hz, max_gap_s))
        except InputError as error:
            raise InputError(f"{file.path}: {error}") from error
    return found


def read_recordings(
    source: str | Path, topics: TopicMap = OWN_TOPICS, stamps: StampPolicy = AS_WRITTEN
) -> list[Recording]:
    """Read recordings as they are, each stream with its own clock; arguments as of `read_demonstrations`.

    Raises:
        InputError: as `read_demonstrations`, but for the clock; or a recording fails `check_recording`.
    """
    found = []
    for file in recording_files(source):
        found.append(read_recording(file, topics, stamps))
        try:
            check_recording(found[-1])
        except InputError as error:
            raise InputError(f"{file.path}: {error}") from error
    return found


def write_recordings(recordings: Sequence[Recording], folder: str | Path) -> None:
    """Write recordings as folder/NAME.mcap; numbers as names are padded with zeros to equal length.

    The folder is made if missing. Publish it as a whole.

    Raises:
        InputError: names repeat or are no file names, or a recording fails `write_recording`.
    """
    names = [recording.name for recording in recordings]
    digits = max((len(name) for name in names if name.isdecimal()), default=0)
    stems = [name.zfill(digits) if name.isdecimal() else name for name in names]
    check_unique(stems, str(folder))
    for stem in stems:
        check_name(stem, str(folder))
    Path(folder).mkdir(parents=True, exist_ok=True)
    for recording, stem in zip(recordings, stems, strict=True):
        write_recording(recording, Path(folder) / f"{stem}.mcap")
