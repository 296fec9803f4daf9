"""Readings of any skin, with the places that were touched where these are known.

A table (CSV or Parquet) has a column per channel and, where known, the place in m: `x_m`, `y_m` and, if it
varies, `z_m`, the height of what touches; `time_s` is passed over. Recordings with a tactile signal have the
pose of what touches as place.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow

from structlearn.ground.errors import InputError
from structlearn.recordings.bag_files import natural_order
from structlearn.recordings.demonstration import Demonstration

PLACE, HEIGHT, TIME = ("x_m", "y_m"), "z_m", "time_s"
READERS = {".csv": pd.read_csv, ".parquet": partial(pd.read_parquet, page_checksum_verification=True)}


@dataclass(frozen=True)
class TouchLog:
    """One recording of a skin: counts (N, E) by channel, and the place (N, 3) m of what touches if known."""

    name: str
    channels: tuple[str, ...]
    counts: np.ndarray
    place: np.ndarray | None


def touch_of(demonstration: Demonstration) -> TouchLog:
    """Of a recording with a tactile signal; an InputError where it has none."""
    counts = demonstration.tactile
    if counts is None:
        raise InputError(f"{demonstration.name}: has no tactile signal; name its topic in the parameters")
    channels = tuple(str(channel + 1) for channel in range(counts.shape[1]))
    return TouchLog(demonstration.name, channels, counts, demonstration.position)


def touch_tables(source: Path) -> list[Path]:
    """The tables of a file or folder, in natural order; none where it has bags alone."""
    if not source.exists():
        raise InputError(f"{source}: no such file or folder")
    paths = source.iterdir() if source.is_dir() else [source]
    found = [
        path for path in paths if path.is_file() and path.suffix in READERS and not path.name.startswith(".")
    ]
    return sorted(found, key=lambda path: natural_order(path.stem))


def read_touch_table(path: Path, channels: Sequence[str] | None) -> TouchLog:
    """Read one table; channels None: all columns but place and time.

    Raises:
        InputError: it cannot be read, lacks a channel or has none, or holds something that is not a finite
            number; the message names file, row (from 0) and column.
    """
    try:
        table = READERS[path.suffix](path)
    except (OSError, ValueError, pyarrow.ArrowException) as error:
        raise InputError(f"{path}: not a readable table: {str(error).splitlines()[0]}") from error
    own = tuple(name for name in table.columns if name not in (*PLACE, HEIGHT, TIME))
    names = own if channels is None else tuple(channels)
    if missing := [name for name in names if name not in table.columns]:
        raise InputError(
            f"{path}: has no column {', '.join(missing)}; its columns are {', '.join(table.columns)}"
        )
    if not names or not len(table):
        raise InputError(f"{path}: has no channels or no rows")
    missing = [name for name in PLACE if name not in table.columns]
    if len(missing) == 1:
        raise InputError(f"{path}: has no column {missing[0]}, but the other one of the place")
    place = None
    if not missing:
        height = _numbers(path, table, [HEIGHT]) if HEIGHT in table.columns else np.zeros((len(table), 1))
        place = np.hstack([_numbers(path, table, PLACE), height])
    return TouchLog(path.stem, names, _numbers(path, table, names), place)


def _numbers(path: Path, table: pd.DataFrame, names: Sequence[str]) -> np.ndarray:
    """(N, C) of some columns."""
    values = table[list(names)].apply(pd.to_numeric, errors="coerce").to_numpy(float)
    if not np.isfinite(values).all():
        column, row = np.argwhere(~np.isfinite(values.T))[0]
        raise InputError(
            f"{path}: row {row}, column {names[column]}: is not a finite number: "
            f"{table[names[column]].iloc[row]}"
        )
    return np.ascontiguousarray(values)
