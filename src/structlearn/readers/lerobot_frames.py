"""Frames of a LeRobotDataset, held against what the set says of itself.

| version | a file of frames | list of episodes |
|---|---|---|
| v3.0 | `data/chunk-000/file-000.parquet`, of many episodes | `meta/episodes/chunk-000/file-000.parquet` |
| v2.0, v2.1 | `data/chunk-000/episode_000000.parquet`, of one | `meta/episodes.jsonl` |

Sets that are downloaded in part, edited or merged contradict themselves, and their frames would be read as
movements that nobody made. The list of episodes may be absent; what it does not say is not checked.
"""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers.foreign_tables import natural_order, read_parquet, read_text

INFO, LIST, LINES = "meta/info.json", "meta/episodes", "meta/episodes.jsonl"
# Default place of an episode's frames by major version; `data_path` in the description may differ
PLACES = {
    "v2": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
    "v3": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
}
CHUNK = 1000  # episodes in a folder of v2.x, unless the description says otherwise
EPISODE, FRAME, TIME, FILE = "episode_index", "frame_index", "timestamp", "file of frames"
CHUNK_INDEX, FILE_INDEX = "data/chunk_index", "data/file_index"
FROM, TO = "dataset_from_index", "dataset_to_index"

LISTING = re.compile(r"/chunk-\d+/file-\d+\.parquet$")  # and no copies
NOT_WHOLE = "is no whole number"
MOST_NAMED = 1000  # of missing episodes

# A timestamp may be off by half a frame, and the whole episode by 1 %: 30 frames a second are often 29.97
SHARE_OF_FRAME, SHARE_OF_EPISODE = 0.5, 0.01


def is_dataset(folder: Path) -> bool:
    """Whether a folder describes itself as a LeRobotDataset."""
    return (folder / INFO).is_file()


def read_info(folder: Path) -> Mapping[str, Any]:
    """`meta/info.json`. Raises InputError: absent, not a description, or of another version."""
    path = folder / INFO
    if not path.exists():
        raise MissingInputError(f"{path}: no such file, so this is no LeRobotDataset")
    try:
        info = json.loads(read_text(path))
        version, _ = str(info["codebase_version"]), dict(info["features"])
        if not (1e-3 < float(info["fps"]) < 1e6 and 0 < int(info["total_episodes"]) < 1e9):
            raise ValueError("fps and total_episodes must be positive, and less than 1e6 and 1e9")
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise InputError(f"{path}: not the description of a LeRobotDataset: {error!r}") from error
    if version[:2] not in PLACES:
        raise InputError(f"{path}: is of version {version}, not v2.x or v3.x; lerobot converts it")
    return info


def read_frames(
    folder: Path, info: Mapping[str, Any], features: Sequence[str], left_out: dict[str, str]
) -> pd.DataFrame:
    """Some features of all frames, by episode and frame, with `FILE`, the name of their file.

    `left_out`: gets the files that the set does not name, e.g. copies, by name.

    Raises InputError: files, episodes or frames are missing, not in their place or there twice.
    """
    listed = _listed_episodes(folder, info)
    numbered, parts = [EPISODE, FRAME], []
    for name, numbers in _files(folder, info, listed, left_out).items():
        frames = read_parquet(folder / name, [*numbered, *features], [TIME])
        if not all(pd.api.types.is_integer_dtype(frames[column]) for column in numbered):
            raise InputError(f"{folder / name}: {' or '.join(numbered)} has something that {NOT_WHOLE}")
        if astray := [number for number in sorted(frames[EPISODE].unique()) if number not in numbers]:
            whole = f"the set has {info['total_episodes']} episodes, from 0 on"
            known = whole if isinstance(numbers, range) else f"the set has {_ranges(numbers)} there"
            raise InputError(f"{folder / name}: holds {_ranges(astray)}, but {known}")
        parts.append(frames.assign(**{FILE: name}))
    frames = pd.concat(parts, ignore_index=True).sort_values(numbered, kind="stable")
    if (twice := frames.duplicated(numbered)).any():
        row = int(np.argmax(twice))
        first, second = frames[FILE].iloc[row - 1], frames[FILE].iloc[row]
        where = f"both in {first} and in {second}" if first != second else f"there twice in {first}"
        episode, frame = frames[numbered].iloc[row]
        raise InputError(f"{folder}: episode {episode}: frame {frame} is {where}")
    total, count = int(info["total_episodes"]), frames[EPISODE].nunique()
    if count < total:
        present = set(frames[EPISODE])
        missing = list(islice((number for number in range(total) if number not in present), MOST_NAMED))
        whole = f" of {info['total_frames']} frames" if "total_frames" in info else ""
        raise InputError(
            f"{folder}: says {total} episodes{whole}, has {count} of {len(frames)}: {_ranges(missing)} "
            f"{'are' if missing[1:] else 'is'} missing"
        )
    if listed is not None:
        frames["length"] = frames[EPISODE].map(listed["length"])
    return frames


def check_episode(where: str, frames: pd.DataFrame, fps: float) -> None:
    """Raise InputError unless an episode's frames are complete, and their times those of `fps`."""
    count, where = len(frames), f"{where}: {frames[FILE].iloc[0]}"
    numbers = frames[FRAME].to_numpy()
    if (apart := np.flatnonzero(np.diff(numbers, prepend=-1) != 1)).size:
        row = int(apart[0])
        follows = f"frame {numbers[row - 1]} is followed by" if row else "begins with frame"
        raise InputError(f"{where}: {follows} {numbers[row]}")
    if "length" in frames and (length := int(frames["length"].iloc[0])) != count:
        raise InputError(f"{where}: has {count} frames, but the set's list of episodes says {length}")
    if TIME not in frames or count < 2:
        return
    times = frames[TIME].to_numpy(float)
    if not np.isfinite(times).all():
        raise InputError(f"{where}: frame {int(np.argmin(np.isfinite(times)))} has the timestamp nan")
    steps, step = np.diff(times), 1.0 / fps
    off = np.abs(steps - step) > SHARE_OF_FRAME * step
    mean, tolerance = float(np.mean(steps)), max(SHARE_OF_FRAME / (count - 1), SHARE_OF_EPISODE) * step
    median_off = abs(np.median(steps) - step) > SHARE_OF_EPISODE * step
    if off.any() and not (median_off and abs(mean - step) > tolerance):
        row = int(np.argmax(off))
        raise InputError(
            f"{where}: frame {row + 1} comes {steps[row]:.4g} s after frame {row}, but fps is {fps:g}"
        )
    if abs(mean - step) > tolerance:
        raise InputError(
            f"{where}: timestamps are {mean:.4g} s apart, but fps is {fps:g}, which means {step:.4g} s"
        )


def check_total(folder: Path, info: Mapping[str, Any], count: int) -> None:
    """Raise InputError unless the set has as many frames as it says, which no list of episodes confirmed."""
    if (total := info.get("total_frames", count)) != count:
        raise InputError(
            f"{folder}: says {info['total_episodes']} episodes of {total} frames, has {count} frames"
        )


def _listed_episodes(folder: Path, info: Mapping[str, Any]) -> pd.DataFrame | None:
    """Length and, in v3.0, place of each episode by its number; None: the set does not list them."""
    wanted, optional = [EPISODE, "length"], [CHUNK_INDEX, FILE_INDEX, FROM, TO]
    files = [path for path in (folder / LIST).glob("*/*.parquet") if LISTING.search(path.as_posix())]
    if files:
        name, table = LIST, pd.concat([read_parquet(file, wanted, optional) for file in sorted(files)])
    elif (folder / LINES).is_file():
        name, table = LINES, pd.DataFrame(_lines(folder / LINES, wanted), columns=wanted)
    else:
        return None
    where, total = folder / name, int(info["total_episodes"])
    if not all(pd.api.types.is_integer_dtype(table[column]) for column in wanted):
        raise InputError(f"{where}: {' or '.join(wanted)} has something that {NOT_WHOLE}")
    table = table.set_index(EPISODE).sort_index(kind="stable")
    if len(table) != total or (table.index != np.arange(total)).any():
        listed = _ranges(table.index.tolist())
        raise InputError(f"{where}: lists {listed}, but {INFO} says {total} episodes")
    if {FROM, TO} <= set(table) and (wrong := table[TO] - table[FROM] != table["length"]).any():
        number = int(table.index[int(np.argmax(wrong))])
        row = table.loc[number]
        raise InputError(
            f"{where}: episode {number} has length {int(row['length'])}, but its frames go from "
            f"{int(row[FROM])} to {int(row[TO])}"
        )
    if (frames := info.get("total_frames")) not in (None, int(table["length"].sum())):
        raise InputError(
            f"{where}: lists {int(table['length'].sum())} frames, but {INFO} says total_frames {frames}"
        )
    return table


def _lines(path: Path, keys: Sequence[str]) -> Iterator[list[Any]]:
    """Values of some keys of each line of a file of JSON objects."""
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        if line.strip():
            try:
                values = json.loads(line)
                yield [values[key] for key in keys]
            except (ValueError, LookupError, TypeError, RecursionError) as error:
                raise InputError(f"{path}: line {number}: no object with {', '.join(keys)}") from error


def _files(
    folder: Path, info: Mapping[str, Any], listed: pd.DataFrame | None, left_out: dict[str, str]
) -> dict[str, Sequence[int]]:
    """Names of the files of frames, each with the episodes that may be in it."""
    paths = [path.relative_to(folder).as_posix() for path in (folder / "data").rglob("*.parquet")]
    present = sorted(paths, key=natural_order)
    if not present:
        raise InputError(f"{folder}/data: holds no file of frames")
    version, total = str(info["codebase_version"]), int(info["total_episodes"])
    template = str(info.get("data_path") or PLACES[version[:2]])
    try:
        placed = list(_places(template, info, listed, len(present)))
    except (LookupError, ValueError, AttributeError) as error:
        raise InputError(
            f"{folder / INFO}: data_path '{template}': not a place of frames: {error!r}"
        ) from error
    if placed:
        expected: dict[str, list[int]] = {}
        for number, name in placed:
            expected.setdefault(name, []).append(number)
        if lost := [name for name in expected if name not in present]:
            others = [name for name in present if name not in expected]
            instead = f", but {others[0]}, which the set does not name" if others else ""
            episodes = _ranges(expected[lost[0]])
            raise InputError(
                f"{folder}: is of version {version}, with {episodes} in {lost[0]}: there is no "
                f"such file{instead}{'; others are missing too' if lost[1:] else ''}"
            )
        files: dict[str, Sequence[int]] = dict(expected)
    else:
        pattern = re.sub(r"\\\{[^}]*\}", r"\\d+", re.escape(template))
        files = {name: range(total) for name in present if re.fullmatch(pattern, name)}
    if not files:
        raise InputError(f"{folder}: has {present[0]}, but frames should be in files like {template}")
    for name in present:
        if name not in files:
            left_out[name] = f"{folder / name}: is none of the set's files of frames, and left out"
    return files


def _places(
    template: str, info: Mapping[str, Any], listed: pd.DataFrame | None, files: int
) -> Iterator[tuple[int, str]]:
    """Number and file of each episode, if the set says so.

    `files`: how many there are; with more episodes, one of the first is lost.
    """
    if "{episode_index" in template:
        total, chunk = int(info["total_episodes"]), int(info.get("chunks_size", CHUNK))
        for number in range(min(total, files + 1)):
            numbers = {"episode_chunk": number // chunk, "episode_index": number, "total_episodes": total}
            yield number, template.format(**numbers)
    elif listed is not None and {CHUNK_INDEX, FILE_INDEX} <= set(listed):
        for number, chunk, file in listed[[CHUNK_INDEX, FILE_INDEX]].itertuples():
            yield number, template.format(chunk_index=int(chunk), file_index=int(file))


def _ranges(numbers: Sequence[int]) -> str:
    """Episodes in words: episodes 0 to 3, 7."""
    parts: list[list[int]] = []
    for number in numbers:
        if parts and number == parts[-1][-1] + 1:
            parts[-1].append(number)
        else:
            parts.append([number])
    words = [f"{part[0]} to {part[-1]}" if part[1:] else f"{part[0]}" for part in parts]
    more = f" and {len(words) - 4} more" if words[4:] else ""
    return f"episode{'s' if len(numbers) > 1 else ''} {', '.join(words[:4])}{more}"
