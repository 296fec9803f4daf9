"""Number tables in public text logs, read with every fault named by file and line."""

import hashlib
import math
from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np

from structlearn.ground.errors import InputError


def read_table(
    path: str | Path, columns: int, separator: str | None = None, header_lines: int = 0
) -> np.ndarray:
    """Read a table of numbers.

    Args:
        path: the text file.
        columns: numbers per line.
        separator: between numbers, None: white space; a line may end with one. Blank lines are skipped.
        header_lines: lines to skip at the start.

    Returns:
        (T, columns) float64.

    Raises:
        InputError: the file is missing, no text or has no rows; a line has another number of columns, or
            something that is not a finite number; the message names file and line (counted from 1).
    """
    path = Path(path)
    lines = _lines(path, columns, separator, header_lines)
    return np.array([_numbers(path, line, fields) for line, fields in lines])


def read_stamped_table(
    path: str | Path, columns: int, separator: str | None = None, header_lines: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Read a table of numbers whose first column is a time in s.

    Times are taken as decimal numbers: a float of Unix time in s is 240 ns coarse.

    Args:
        path: the text file.
        columns: numbers per line, the time included.
        separator: see `read_table`.
        header_lines: see `read_table`.

    Returns:
        stamps: (T,) int64 ns.   values: (T, columns - 1) float64.

    Raises:
        InputError: as `read_table`.
    """
    path = Path(path)
    lines = _lines(path, columns, separator, header_lines)
    stamps = np.array([_nanoseconds(path, line, fields[0]) for line, fields in lines], dtype=np.int64)
    return stamps, np.array([_numbers(path, line, fields[1:]) for line, fields in lines])


def uniform_stamps(count: int, rate_hz: float) -> np.ndarray:
    """(count,) int64 ns of a log without times, from 0 at a known rate."""
    return np.round(np.arange(count) * (1e9 / rate_hz)).astype(np.int64)


def source_provenance(
    repository: str, commit: str, licence: str, root: Path, files: Sequence[Path]
) -> dict[str, str]:
    """Provenance of a recording taken from published files.

    Args:
        repository: where the data set was published.
        commit: its state.
        licence: under which it was published.
        root: the data set's folder.
        files: the text files that the recording was made from.

    Returns:
        origin "recorded", the above, the files relative to the root and their SHA-256 in the same order.
    """
    return {
        "origin": "recorded",
        "source": repository,
        "commit": commit,
        "licence": licence,
        "files": " ".join(path.relative_to(root).as_posix() for path in files),
        "sha256": " ".join(hashlib.sha256(path.read_bytes()).hexdigest() for path in files),
    }


def _lines(path: Path, columns: int, separator: str | None, header_lines: int) -> list[tuple[int, list[str]]]:
    """Line number from 1 and fields of each row, as many as there should be."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file") from error
    rows = []
    for number, line in enumerate(text.split("\n"), start=1):
        if number <= header_lines or not line.strip():
            continue
        fields = line.split(separator)
        if separator is not None and not fields[-1].strip():
            fields.pop()  # the line ends with a separator
        if len(fields) != columns:
            raise InputError(f"{path}: line {number} has {len(fields)} columns, expected {columns}")
        rows.append((number, fields))
    if not rows:
        raise InputError(f"{path}: has no rows")
    return rows


def _numbers(path: Path, line: int, fields: list[str]) -> list[float]:
    try:
        values = [float(field) for field in fields]
    except ValueError as error:
        raise InputError(f"{path}: line {line}: not a number: {str(error).rpartition(': ')[2]}") from error
    if not all(map(math.isfinite, values)):
        bad = next(field for field, value in zip(fields, values, strict=True) if not math.isfinite(value))
        raise InputError(f"{path}: line {line}: not a finite number: {bad.strip()!r}")
    return values


def _nanoseconds(path: Path, line: int, field: str) -> int:
    try:
        nanoseconds = int(Decimal(field).scaleb(9).to_integral_value())
    except (ArithmeticError, ValueError) as error:  # not decimal, out of range, infinite; not a number
        raise InputError(f"{path}: line {line}: not a time in s: {field.strip()!r}") from error
    if abs(nanoseconds) >= 2**63:
        raise InputError(f"{path}: line {line}: time out of range: {field.strip()!r}")
    return nanoseconds
