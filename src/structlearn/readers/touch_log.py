"""Touch logs: channels of a skin, with place, force and time where they are known.

A table of touches (CSV or Parquet) has a column per channel and, if known, the place in m: `x_m`, `y_m` and,
if it varies, `z_m`, the height of the probe; with `force_n`, the reading of a scale (empty without one), and
`time_s`, forces can be learned. A table with a column `run` holds several recordings. For recordings with a
tactile signal, the place is the recorded pose.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from structlearn.core.artefacts import read_csv
from structlearn.core.errors import InputError
from structlearn.readers.demonstration import Demonstration, Series, each_series, write_series
from structlearn.readers.foreign_tables import natural_order, read_parquet
from structlearn.readers.user_tables import TIME, check_finite

PLACE, FORCE, RECORDING = ("x_m", "y_m", "z_m"), "force_n", "run"
TOUCH_UNITS = {TIME: "s", FORCE: "N"} | dict.fromkeys(PLACE, "m")
"""Units of the columns that a table of touches may have besides channels."""


@dataclass(frozen=True)
class TouchLog:
    """One recording of a skin: counts (N, E) per channel, and what else is known.

    Place (N, 3) m of the probe, time (N,) s, and force (N,) N on a scale, NaN without a reading.
    """

    name: str
    channels: tuple[str, ...]
    counts: np.ndarray
    place: np.ndarray | None
    time: np.ndarray | None = None
    force: np.ndarray | None = None
    provenance: dict[str, str] = field(default_factory=dict)


def touch_of(demonstration: Demonstration) -> TouchLog:
    """Touches of a recording with a tactile signal. Raises InputError: it has none."""
    counts = demonstration.tactile
    if counts is None:
        raise InputError(f"{demonstration.name}: has no tactile signal; name its topic in the parameters")
    channels = tuple(str(channel + 1) for channel in range(counts.shape[1]))
    return TouchLog(demonstration.name, channels, counts, demonstration.position)


def touch_tables(source: Path) -> list[Path]:
    """Tables of a file or folder, in natural order; empty if there are only bags."""
    if not source.exists():
        raise InputError(f"{source}: no such file or folder")
    paths = [path for path in (source.iterdir() if source.is_dir() else [source]) if path.is_file()]
    tables = [path for path in paths if path.suffix in (".csv", ".parquet") and not path.name.startswith(".")]
    return sorted(tables, key=lambda path: natural_order(path.stem))


def write_touch_logs(logs: Iterable[TouchLog], target: str | Path) -> None:
    """Publish recordings with unique names as one table, with their provenance."""
    units = dict(TOUCH_UNITS)

    def series() -> Iterator[Series]:
        for log in logs:
            known: Mapping[str, np.ndarray | None] = {TIME: log.time, FORCE: log.force}
            columns = {name: values for name, values in known.items() if values is not None}
            if log.place is not None:
                columns |= dict(zip(PLACE, log.place.T, strict=True))
            columns |= dict(zip(log.channels, log.counts.T, strict=True))
            units.update(dict.fromkeys(log.channels, "counts"))
            yield Series(log.name, columns, log.provenance)

    write_series(series(), units, target)


def read_touch_logs(path: str | Path) -> list[TouchLog]:
    """Read the table of `write_touch_logs`."""
    logs = []
    for run in each_series(path):
        channels = tuple(name for name in run.columns if name not in TOUCH_UNITS)
        place = run.stacked(PLACE) if PLACE[-1] in run.columns else None
        time, force = run.columns.get(TIME), run.columns.get(FORCE)
        logs.append(TouchLog(run.name, channels, run.stacked(channels), place, time, force, dict(run.about)))
    return logs


def read_touch_table(path: Path, channels: Sequence[str] | None) -> list[TouchLog]:
    """Read recordings from a table of touches; channels None: all columns but place, time, force and run.

    Raises InputError naming file, row (from 0) and column.
    """
    table = read_csv(path) if path.suffix == ".csv" else read_parquet(path)
    own = tuple(name for name in table.columns if name not in (*TOUCH_UNITS, RECORDING))
    names = own if channels is None else tuple(channels)
    if missing := [name for name in names if name not in table.columns]:
        raise InputError(
            f"{path}: has no column {', '.join(missing)}; its columns are {', '.join(table.columns)}"
        )
    if not names or not len(table):
        raise InputError(f"{path}: has no channels or no rows")
    missing = [name for name in PLACE[:2] if name not in table.columns]
    if len(missing) == 1:
        raise InputError(f"{path}: has no column {missing[0]}, but the other one of the place")
    numbers = [*names, *(name for name in (*PLACE, TIME) if name in table.columns)]
    check_finite(path, table[numbers], "row {row}, column {name}: is not a finite number: {value}")
    if not missing and PLACE[2] not in table.columns:
        table[PLACE[2]] = 0.0
    logs = []
    several = RECORDING in table.columns
    for name, rows in table.groupby(RECORDING, observed=True) if several else [(path.stem, table)]:
        place = None if missing else rows[list(PLACE)].to_numpy(float)
        time, force = (rows[key].to_numpy(float) if key in rows.columns else None for key in (TIME, FORCE))
        logs.append(TouchLog(str(name), names, rows[list(names)].to_numpy(float), place, time, force))
    return logs
