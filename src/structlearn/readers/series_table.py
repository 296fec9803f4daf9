"""Sets of time series in one Parquet file: a long table keyed by run, units in its schema.

What differs from run to run and is no series (provenance, shapes, names of joints) stands as JSON in the
schema's metadata, in the order of the runs. A run has the columns that it recorded; in those of other runs it
is null. The same set gives the same bytes, and a damaged file is an error (`core.artefacts`).
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow

from structlearn.core.artefacts import read_arrow, write_arrow
from structlearn.core.errors import InputError

RUN, UNIT, RUNS = "run", b"unit", b"runs"


@dataclass(frozen=True)
class Series:
    """The time series of one run."""

    name: str  # unique within its set
    columns: Mapping[str, np.ndarray]  # (T,) each, finite
    about: Mapping[str, Any] = field(default_factory=dict)  # what else is known of the run, as JSON has it

    def stacked(self, names: Sequence[str]) -> np.ndarray:
        """(T, D) of some columns, in C order."""
        return np.stack([self.columns[name] for name in names], axis=1)


def write_series(runs: Sequence[Series], units: Mapping[str, str], target: str | Path) -> None:
    """Publish a set of runs, maybe none, with different names as a Parquet file.

    Units are those of each column's name up to its first point (`position` of `position.x`), "" without one.
    """
    names = list(dict.fromkeys(name for run in runs for name in run.columns))
    lengths = [len(next(iter(run.columns.values()))) for run in runs]
    index = pyarrow.array(np.repeat(np.arange(len(runs), dtype=np.int32), lengths))
    keys = pyarrow.DictionaryArray.from_arrays(
        index, pyarrow.array([run.name for run in runs], pyarrow.string())
    )
    arrays, fields = [keys], [pyarrow.field(RUN, keys.type)]
    for name in names:
        parts = [pyarrow.array(run.columns[name]) if name in run.columns else None for run in runs]
        kind = next(part.type for part in parts if part is not None)
        filled = [
            part if part is not None else pyarrow.nulls(length, kind)
            for part, length in zip(parts, lengths, strict=True)
        ]
        arrays.append(pyarrow.concat_arrays(filled))
        fields.append(pyarrow.field(name, kind, metadata={UNIT: units[name.partition(".")[0]].encode()}))
    about = json.dumps({run.name: dict(run.about) for run in runs})
    schema = pyarrow.schema(fields, metadata={RUNS: about.encode()})
    table = pyarrow.Table.from_arrays(arrays, schema=schema)
    write_arrow(table, target, use_dictionary=[RUN], use_byte_stream_split=names)  # noise: 0.7 of the size


def read_series(path: str | Path) -> list[Series]:
    """Read a set of runs, in the order in which they were written.

    Raises:
        InputError: the file is missing, damaged, of another kind, or a run is not in one piece.
    """
    table = read_arrow(path)
    about = (table.schema.metadata or {}).get(RUNS)
    if about is None:
        raise InputError(f"{path}: holds no runs")
    known = json.loads(about)
    keys = table[RUN].combine_chunks()
    index = keys.indices.to_numpy()
    names = keys.dictionary.to_pylist()
    starts = np.searchsorted(index, np.arange(len(names) + 1))
    if names != list(known) or (np.diff(index) < 0).any():
        raise InputError(f"{path}: damaged: its rows are not those of its runs")
    columns = {name: table[name].combine_chunks() for name in table.column_names if name != RUN}
    runs = []
    for place, name in enumerate(names):
        start, count = int(starts[place]), int(starts[place + 1] - starts[place])
        mine = {key: column.slice(start, count) for key, column in columns.items()}
        arrays = {key: part.to_numpy() for key, part in mine.items() if not part.null_count}
        runs.append(Series(name, arrays, known[name]))
    return runs
