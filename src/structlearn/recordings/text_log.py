"""Number tables in public text logs, read with every fault named by file and line."""

import hashlib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from typing import TypeVar

import numpy as np

from structlearn.ground.errors import InputError

T = TypeVar("T")


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
    return _numbers(path, _lines(path, separator, header_lines), columns, separator)


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
    lines = _lines(path, separator, header_lines)
    stamps = [_nanoseconds(path, number, line.split(separator, 1)[0]) for number, line in lines.items()]
    values = np.ascontiguousarray(_numbers(path, lines, columns, separator)[:, 1:])
    return np.array(stamps, dtype=np.int64), values


def read_each(read: Callable[[Path], T], paths: Iterable[Path], left_out: dict[str, str] | None) -> list[T]:
    """Read files one by one; with a dict for the reasons, those that cannot be read are left out."""
    found = []
    for path in paths:
        try:
            found.append(read(path))
        except InputError as error:
            if left_out is None:
                raise
            left_out[f"{path.parent.name}/{path.name}"] = str(error)
    return found


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


def _lines(path: Path, separator: str | None, header_lines: int) -> dict[int, str]:
    """Lines that are not blank, by their number from 1, without a separator at their end."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file") from error
    stripped = map(str.strip, text.split("\n")[header_lines:])
    lines = {number: line for number, line in enumerate(stripped, start=header_lines + 1) if line}
    if not lines:
        raise InputError(f"{path}: has no rows")
    return {n: line.removesuffix(separator) for n, line in lines.items()} if separator else lines


def _numbers(path: Path, lines: Mapping[int, str], columns: int, separator: str | None) -> np.ndarray:
    """(T, columns) float64 of the lines."""
    try:
        table = np.loadtxt(list(lines.values()), delimiter=separator, comments=None, ndmin=2)
        if table.shape == (len(lines), columns) and np.isfinite(table).all():
            return table
    except ValueError:  # tells no line of the file; what is wrong is found line by line
        pass
    return np.array([_row(path, number, line.split(separator), columns) for number, line in lines.items()])


def _row(path: Path, number: int, fields: list[str], columns: int) -> list[float]:
    if len(fields) != columns:
        raise InputError(f"{path}: line {number} has {len(fields)} columns, expected {columns}")
    try:
        values = [float(field) for field in fields]
    except ValueError as error:
        fault = str(error).rpartition(": ")[2]
        raise InputError(f"{path}: line {number}: not a number: {fault}") from error
    if not all(map(math.isfinite, values)):
        bad = next(field for field, value in zip(fields, values, strict=True) if not math.isfinite(value))
        raise InputError(f"{path}: line {number}: not a finite number: {bad.strip()!r}")
    return values


def _nanoseconds(path: Path, line: int, field: str) -> int:
    try:
        nanoseconds = int(Decimal(field).scaleb(9).to_integral_value())
    except (ArithmeticError, ValueError) as error:  # not decimal, out of range, infinite; not a number
        raise InputError(f"{path}: line {line}: not a time in s: {field.strip()!r}") from error
    if abs(nanoseconds) >= 2**63:
        raise InputError(f"{path}: line {line}: time out of range: {field.strip()!r}")
    return nanoseconds


def check_rising(path: Path, stamps: np.ndarray) -> None:
    """Raise unless each line comes after the one before it.

    Args:
        path: of the table, for the message.
        stamps: (T,) of its lines.

    Raises:
        InputError: file and line, from 1, are named.
    """
    steps = np.diff(stamps)
    if (steps <= 0).any():
        raise InputError(
            f"{path}: line {int(np.argmax(steps <= 0)) + 2} does not come after the one before it"
        )
