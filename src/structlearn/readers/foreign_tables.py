"""Third-party tables and arrays: text (faults named by file and line, from 1), Parquet, .npz."""

import csv
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import TypeVar

import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet

from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.used_files import LARGEST, Budget, digest, require_file

T = TypeVar("T")
LeftOut = dict[str, str] | None
"""Reasons why files are left out, by name; None if none may be left out."""

OF_ITS_NOTES = (ValueError, TypeError, LookupError, AttributeError)
"""Errors of pandas if a Parquet file's type metadata are damaged, which no checksum covers."""


@dataclass(frozen=True)
class PublicSet:
    """Repository, commit and licence of a published set of recordings."""

    repository: str
    commit: str
    licence: str

    def files(self, folder: Path, pattern: str, kind: str) -> list[Path]:
        """Files below a folder in natural order of their paths. Raises MissingInputError: there are none."""
        paths = sorted(folder.rglob(pattern), key=lambda path: natural_order(path.as_posix()))
        if not paths:
            raise MissingInputError(f"{folder}: holds no {kind}")
        return paths

    def provenance(self, root: Path, files: Sequence[Path]) -> dict[str, str]:
        """Provenance: origin "recorded", the set, and the files of a recording with their SHA-256."""
        return {
            "origin": "recorded",
            "source": self.repository,
            "commit": self.commit,
            "licence": self.licence,
            "files": " ".join(path.relative_to(root).as_posix() for path in files),
            "sha256": " ".join(digest(path) for path in files),
        }


def natural_order(name: str) -> list[str | int]:
    """Sort key that compares runs of digits as numbers."""
    return [int(part) if place % 2 else part for place, part in enumerate(re.split(r"(\d+)", name))]


def read_each(read: Callable[[Path], T], paths: Iterable[Path], left_out: LeftOut) -> list[T]:
    """Read files one by one; unreadable ones are left out if there is a dict for the reasons."""
    return list(each_readable(read, paths, left_out))


def each_readable(read: Callable[[Path], T], paths: Iterable[Path], left_out: LeftOut) -> Iterator[T]:
    """As `read_each`, of which one at a time is in memory."""
    for path in paths:
        try:
            content = read(path)
        except InputError as error:
            if left_out is None:
                raise
            left_out[f"{path.parent.name}/{path.name}"] = str(error)
        else:
            yield content
            del content  # before the next one is read


def read_text(path: Path) -> str:
    """Contents of a text file, without a byte-order mark."""
    try:
        require_file(path)
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file") from error


def read_text_table(
    path: str | Path, columns: int, separator: str | None = None, header_lines: int = 0
) -> np.ndarray:
    """(T, columns) float64 of a text file; separator None: whitespace. Blank lines are skipped."""
    return _numbers(path, _lines(path, separator, header_lines), columns, separator)


def read_stamped_table(
    path: str | Path, columns: int, separator: str | None = None, header_lines: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """A table with times in s in the first column: (T,) int64 ns, and (T, columns - 1) float64.

    Times are parsed as decimal numbers, since float64 resolves Unix time in s to 240 ns only. Otherwise as
    `read_text_table`.
    """
    lines = _lines(path, separator, header_lines)
    stamps = [
        _nanoseconds(f"{path}: line {line}", text.split(separator, 1)[0]) for line, text in lines.items()
    ]
    values = np.ascontiguousarray(_numbers(path, lines, columns, separator)[:, 1:])
    return np.array(stamps, dtype=np.int64), values


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """All arrays of an .npz archive, in double precision."""
    try:
        require_file(path)
        budget = Budget(path)
        with np.load(path, allow_pickle=False) as arrays:
            for entry in arrays.zip.infolist():
                budget.take(entry.file_size)
            return {name: arrays[name].astype(np.float64, casting="same_kind") for name in arrays.files}
    except InputError:
        raise
    except Exception as error:  # any error of zip files, headers and numbers
        raise InputError(f"{path}: cannot be read as arrays: {error}") from error


def read_parquet(
    path: Path, needed: Sequence[str] | None = None, optional: Sequence[str] = ()
) -> pd.DataFrame:
    """Columns of a Parquet table, default: all; strings become categories, which take less memory.

    `optional`: further columns, which the table may lack.
    """
    try:
        require_file(path, whole=False)
        schema = pyarrow.parquet.read_schema(path)
        names = list(schema.names if needed is None else needed)
        if missing := [name for name in names if name not in schema.names]:
            raise InputError(f"{path}: has no column {', '.join(missing)}; it has {', '.join(schema.names)}")
        if len(set(schema.names)) < len(schema.names):
            raise InputError(f"{path}: a column is defined twice among {', '.join(schema.names)}")
        words = [column.name for column in schema if column.type in (pyarrow.string(), pyarrow.binary())]
        with pyarrow.parquet.ParquetFile(
            path, page_checksum_verification=True, read_dictionary=words
        ) as file:
            about = file.metadata
            parts = [about.row_group(number) for number in range(about.num_row_groups)]
            counts = [part.column(place).num_values for part in parts for place in range(about.num_columns)]
            if 8 * max(sum(counts), about.num_rows * about.num_columns) > LARGEST:
                raise InputError(
                    f"{path}: has {about.num_rows} rows of {about.num_columns} columns, too many"
                )
            names += [name for name in optional if name in schema.names and name not in names]
            return file.read(columns=names).to_pandas()
    except InputError:
        raise
    except (pyarrow.ArrowException, OSError, *OF_ITS_NOTES) as error:
        raise InputError(f"{path}: not a Parquet file that can be read: {error}") from error


def read_rows(path: Path, columns: Sequence[str]) -> list[tuple[str, dict[str, str]]]:
    """Rows of a CSV file with a header, as strings, each with its file and line."""
    try:
        header, *rows = list(csv.reader(read_text(path).splitlines(keepends=True))) or [[]]
    except csv.Error as error:
        raise InputError(f"{path}: not a CSV file: {error}") from error
    header = [name.strip() for name in header]
    if missing := [name for name in columns if name not in header]:
        raise InputError(f"{path}: has no column {', '.join(missing)}")
    rows_read = []
    for line, row in enumerate(rows, start=2):
        where = f"{path}: line {line}"
        if row and len(row) != len(header):
            raise InputError(f"{where} has {len(row)} columns, expected {len(header)}")
        if row:
            rows_read.append((where, dict(zip(header, map(str.strip, row), strict=True))))
    return rows_read


def finite_numbers(where: str, words: Sequence[str]) -> list[float]:
    """Numbers of a line. Raises InputError: one is not a number or not finite."""
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise InputError(f"{where}: not a number: {str(error).rpartition(': ')[2]}") from error
    for word, value in zip(words, values, strict=True):
        if not np.isfinite(value):
            raise InputError(f"{where}: not a finite number: {word.strip()!r}")
    return values


def stamps_of(path: Path, seconds: np.ndarray) -> np.ndarray:
    """(T,) int64 ns of times in s. Raises InputError: these are not times."""
    if seconds.ndim != 1 or not np.isfinite(seconds).all() or np.abs(seconds).max(initial=0.0) > 9e9:
        raise InputError(f"{path}: times are no times in s")
    return np.round(1e9 * seconds).astype(np.int64)


def uniform_stamps(count: int, rate_hz: float) -> np.ndarray:
    """(count,) int64 ns for a log without times, from 0 at a known rate."""
    return np.round(np.arange(count) * (1e9 / rate_hz)).astype(np.int64)


def check_rising(path: Path, stamps: np.ndarray) -> None:
    """Raise InputError unless each line's stamp (T,) is later than the one before."""
    if (late := np.diff(stamps) <= 0).any():
        raise InputError(f"{path}: line {int(np.argmax(late)) + 2} does not come after the one before it")


def _lines(path: str | Path, separator: str | None, header_lines: int) -> dict[int, str]:
    """Lines that are not blank, by number from 1, without a trailing separator."""
    stripped = map(str.strip, read_text(Path(path)).split("\n")[header_lines:])
    lines = {number: line for number, line in enumerate(stripped, start=header_lines + 1) if line}
    if not lines:
        raise InputError(f"{path}: has no rows")
    return {n: line.removesuffix(separator) for n, line in lines.items()} if separator else lines


def _numbers(path: str | Path, lines: Mapping[int, str], columns: int, separator: str | None) -> np.ndarray:
    """(T, columns) float64 from lines."""
    try:
        table = np.loadtxt(list(lines.values()), delimiter=separator, comments=None, ndmin=2)
        if table.shape == (len(lines), columns) and np.isfinite(table).all():
            return table
    except ValueError:  # does not name the line, which is searched for below
        pass
    rows = []
    for line, text in lines.items():
        words = text.split(separator)
        if len(words) != columns:
            raise InputError(f"{path}: line {line} has {len(words)} columns, expected {columns}")
        rows.append(finite_numbers(f"{path}: line {line}", words))
    return np.array(rows)


def _nanoseconds(where: str, word: str) -> int:
    try:
        nanoseconds = int(Decimal(word).scaleb(9).to_integral_value())
    except (ArithmeticError, ValueError) as error:  # not decimal, out of range, infinite; not a number
        raise InputError(f"{where}: not a time in s: {word.strip()!r}") from error
    if abs(nanoseconds) >= 2**63:
        raise InputError(f"{where}: time out of range: {word.strip()!r}")
    return nanoseconds
