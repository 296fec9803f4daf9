"""Readings of any skin, with the places that were touched where these are known.

A table (CSV or Parquet) has a column per channel and, where known, the place in m: `x_m`, `y_m` and, if it
varies, `z_m`, the height of what touches; with `force_n`, what a scale weighed (empty where it did not), and
`time_s`, forces can be learned. A table with a column `run` holds several recordings. Recordings with a
tactile signal have the pose of what touches as place.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.core.artefacts import read_csv
from structlearn.core.errors import InputError
from structlearn.readers.demonstration import Demonstration
from structlearn.readers.parquet_table import read_parquet
from structlearn.readers.runs import Series, read_series, write_series
from structlearn.readers.text_log import natural_order

PLACE, HEIGHT, TIME, FORCE, RUN = ("x_m", "y_m"), "z_m", "time_s", "force_n", "run"
UNITS = {TIME: "s", FORCE: "N"} | dict.fromkeys((*PLACE, HEIGHT), "m")
SUFFIXES = (".csv", ".parquet")


@dataclass(frozen=True)
class TouchLog:
    """One recording of a skin: counts (N, E) by channel, and what is known beside them.

    Place (N, 3) m of what touches, time (N,) s, and force (N,) N of a scale, NaN without a reading.
    """

    name: str
    channels: tuple[str, ...]
    counts: np.ndarray
    place: np.ndarray | None
    time: np.ndarray | None = None
    force: np.ndarray | None = None
    provenance: dict[str, str] = field(default_factory=dict)


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
        path for path in paths if path.is_file() and path.suffix in SUFFIXES and not path.name.startswith(".")
    ]
    return sorted(found, key=lambda path: natural_order(path.stem))


def write_touch_logs(logs: Sequence[TouchLog], target: str | Path) -> None:
    """Publish recordings with different names as one table, with their provenance."""
    series = []
    for log in logs:
        columns = {} if log.time is None else {TIME: log.time}
        if log.force is not None:
            columns[FORCE] = log.force
        if log.place is not None:
            columns |= dict(zip((*PLACE, HEIGHT), log.place.T, strict=True))
        columns |= dict(zip(log.channels, log.counts.T, strict=True))
        series.append(Series(log.name, columns, log.provenance))
    units = UNITS | {name: "counts" for log in logs for name in log.channels}
    write_series(series, units, target)


def read_touch_logs(path: str | Path) -> list[TouchLog]:
    """What `write_touch_logs` published."""
    logs = []
    for one in read_series(path):
        channels = tuple(name for name in one.columns if name not in UNITS)
        place = one.stacked((*PLACE, HEIGHT)) if HEIGHT in one.columns else None
        time, force = one.columns.get(TIME), one.columns.get(FORCE)
        logs.append(TouchLog(one.name, channels, one.stacked(channels), place, time, force, dict(one.about)))
    return logs


def read_touch_table(path: Path, channels: Sequence[str] | None) -> list[TouchLog]:
    """Read the recordings of one table; channels None: all columns but place, time, force and run.

    Raises InputError: it cannot be read, lacks a channel or has none, or holds something that is not a finite
    number; the message names file, row (from 0) and column.
    """
    table = read_csv(path) if path.suffix == ".csv" else read_parquet(path)
    own = tuple(name for name in table.columns if name not in (*PLACE, HEIGHT, TIME, FORCE, RUN))
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
    numbers = [*names, *(name for name in (*PLACE, HEIGHT, TIME) if name in table.columns)]
    _check_finite(path, table[numbers])
    if RUN not in table.columns:
        return [_log(path.stem, names, table)]
    return [_log(str(name), names, its) for name, its in table.groupby(RUN, observed=True)]


def _log(name: str, channels: tuple[str, ...], table: pd.DataFrame) -> TouchLog:
    place = None
    if PLACE[0] in table.columns:
        height = table if HEIGHT in table.columns else table.assign(**{HEIGHT: 0.0})
        place = height[[*PLACE, HEIGHT]].to_numpy(float)
    time, force = (table[key].to_numpy(float) if key in table.columns else None for key in (TIME, FORCE))
    return TouchLog(name, channels, table[list(channels)].to_numpy(float), place, time, force)


def _check_finite(path: Path, table: pd.DataFrame) -> None:
    for name in table:
        values = pd.to_numeric(table[name], errors="coerce").to_numpy(float)
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values)))
            raise InputError(
                f"{path}: row {row}, column {name}: is not a finite number: {table[name].iloc[row]}"
            )
