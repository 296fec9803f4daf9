"""Artefacts: reading and writing of the files that stages exchange.

Every file is published (`structlearn.core.publication`): it is complete or absent. Writers are deterministic:
equal data give equal bytes. Tables and arrays carry checksums, so that damage is detected on reading.
pandas and Arrow load with the first table: a robot's computer has neither, and reads skills only.
"""

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import load_file, save

from structlearn.core.errors import InputError
from structlearn.core.publication import publish as publish
from structlearn.core.used_files import require_file

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow

Metrics = dict[str, float | int | str | bool | None]  # flat key figures


def write_table(frame: "pd.DataFrame", target: str | Path) -> None:
    """Publish a table as Parquet, without pandas' index and without versions in its metadata."""
    import pyarrow

    write_arrow(pyarrow.Table.from_pandas(frame, preserve_index=False).replace_schema_metadata(None), target)


def write_arrow(table: "pyarrow.Table", target: str | Path, **encoding: Any) -> None:
    """Publish an Arrow table as Parquet with page checksums; a digest covers its schema and metadata."""
    import pyarrow.parquet

    signed = table.replace_schema_metadata({**(table.schema.metadata or {}), HEADINGS: _headings(table)})
    with publish(target) as path:
        pyarrow.parquet.write_table(signed, path, compression="zstd", write_page_checksum=True, **encoding)


def read_table(path: str | Path, needed: Sequence[str] = ()) -> "pd.DataFrame":
    """Read a Parquet table.

    Raises InputError: the file is missing, truncated, of another kind or altered, or lacks a column that is
    `needed` (an intact file may be another table, or of an older version).
    """
    table = read_arrow(path)
    if missing := [name for name in needed if name not in table.column_names]:
        raise InputError(f"{path}: has no column {', '.join(missing)}: another table, or of another version")
    return table.to_pandas()


def read_arrow(path: str | Path) -> "pyarrow.Table":
    """Read an Arrow table of `write_arrow` or `write_table`. Raises InputError: it is damaged."""
    import pyarrow.parquet

    damaged = (pyarrow.ArrowException, OSError, UnicodeDecodeError)  # the last two: pages, names of columns
    with (
        _readable(path, "readable Parquet", *damaged, whole=False),
        pyarrow.parquet.ParquetFile(path, page_checksum_verification=True) as file,
    ):
        table, in_order = file.read(), _in_order(file.metadata)
    if not in_order or (table.schema.metadata or {}).get(HEADINGS) != _headings(table):
        raise InputError(f"{path}: damaged, or not written by this project: its columns are not as written")
    return table


def _in_order(metadata: "pyarrow.parquet.FileMetaData") -> bool:
    """Whether the footer lists the pages of all columns as they lie in the file: no checksum covers it."""
    columns, groups = range(metadata.num_columns), range(metadata.num_row_groups)
    chunks = [metadata.row_group(group).column(column) for group in groups for column in columns]
    starts = [chunk.data_page_offset for chunk in chunks]
    paths = [metadata.schema.column(column).path for column in columns] * len(groups)
    return starts == sorted(starts) and paths == [chunk.path_in_schema for chunk in chunks]


HEADINGS = b"columns sha256"


def _headings(table: "pyarrow.Table") -> bytes:
    """Digest of everything outside the pages' checksums: names and types of columns, rows, metadata."""
    schema = table.schema.remove_metadata()
    digest = hashlib.sha256(f"{schema.to_string()}\n{table.num_rows}".encode())
    for key, value in sorted((table.schema.metadata or {}).items()):
        if key not in (HEADINGS, b"ARROW:schema"):
            digest.update(key + b"\0" + value)
    return digest.hexdigest().encode()


def write_tensors(tensors: Mapping[str, np.ndarray], target: str | Path, description: str) -> None:
    """Publish named arrays as safetensors, with one metadata key, since several are not deterministic.

    The last line of the description is a digest of names, types, shapes, values and description.
    """
    ordered = {name: np.asarray(tensors[name], order="C") for name in sorted(tensors)}
    signed = f"{description}\n{DIGEST}{_digest(ordered, description)}"
    with publish(target) as path:
        path.write_bytes(save(ordered, metadata={"description": signed}))  # `save_file` limits permissions


def read_tensors(path: str | Path) -> dict[str, np.ndarray]:
    """Read named arrays from a safetensors file.

    Raises InputError: the file is missing, truncated, of another kind or damaged, or a value is NaN or
    infinite.
    """
    description, digest = _signed(path)
    kinds = (SafetensorError, KeyError, AttributeError, TypeError)  # the latter for types that numpy lacks
    with _readable(path, "readable safetensors", *kinds):
        tensors = load_file(path)
    if digest != _digest(tensors, description):
        raise InputError(f"{path}: damaged: its content is not what was written")
    for name, tensor in tensors.items():
        if not np.isfinite(tensor).all():
            raise InputError(f"{path}: {name} holds a value that is not finite")
    return tensors


def read_description(path: str | Path) -> str:
    """Description of a safetensors file; only `read_tensors` verifies its digest."""
    return _signed(path)[0]


@contextmanager
def holding(path: str | Path, kind: str) -> Iterator[None]:
    """Report in one line that an intact file does not have the expected content."""
    try:
        yield
    except InputError as error:
        if str(path) in str(error):
            raise
        raise InputError(f"{path}: {error}") from error
    except (LookupError, TypeError, ValueError, ArithmeticError, AttributeError, RecursionError) as error:
        raise InputError(f"{path}: holds no {kind} ({type(error).__name__}: {error})") from error


DIGEST = "sha256 "


def _signed(path: str | Path) -> tuple[str, str]:
    """Description and digest of a safetensors file."""
    with _readable(path, "readable safetensors", SafetensorError), safe_open(path, framework="np") as file:
        text = (file.metadata() or {}).get("description", "")
    description, _, last = text.rpartition("\n")
    if not last.startswith(DIGEST):
        raise InputError(f"{path}: not written by this project: it has no digest of its content")
    return description, last.removeprefix(DIGEST)


def _digest(tensors: Mapping[str, np.ndarray], description: str) -> str:
    """Digest of a file's tensors and description."""
    digest = hashlib.sha256(description.encode())
    for name in sorted(tensors):
        values = tensors[name]
        digest.update(f"\0{name}\0{values.dtype.str}\0{values.shape}\0".encode())
        digest.update(np.ascontiguousarray(values).data)
    return digest.hexdigest()


@contextmanager
def _readable(path: str | Path, kind: str, *faults: type[Exception], whole: bool = True) -> Iterator[None]:
    """Report in one line why a file of a kind cannot be read; `faults` are errors of its content."""
    try:
        require_file(path, whole)
        yield
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; run the stage that writes it") from error
    except InputError:
        raise
    except faults as error:
        raise InputError(f"{path}: not a {kind} file: {error}") from error
    except OSError as error:  # e.g. for a folder
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def write_metrics(metrics: Mapping[str, float | int | str | bool | None], target: str | Path) -> None:
    """Publish a flat JSON of metrics, floats with six digits. Raises ValueError: NaN or infinite."""
    rounded: dict[str, float | int | str | bool | None] = {}
    for key, value in metrics.items():
        if isinstance(value, float | np.floating):
            if not math.isfinite(value):
                raise ValueError(f"metric '{key}' is {value}")
            value = float(f"{float(value):.6g}")
        rounded[key] = int(value) if isinstance(value, np.integer) else value
    with publish(target) as path:
        path.write_text(json.dumps(rounded, indent=2) + "\n")


def read_metrics(path: str | Path) -> Metrics:
    """Read a flat JSON of metrics.

    Raises InputError: the file is missing or is not JSON with names and values.
    """
    with _readable(path, "JSON", ValueError, RecursionError):  # also for binary files and huge numbers
        metrics = json.loads(Path(path).read_text())
    if not isinstance(metrics, dict):
        raise InputError(f"{path}: not a JSON file of names and values")
    return metrics


def write_csv(frame: "pd.DataFrame", target: str | Path) -> None:
    """Publish a table as CSV for people: no index, six significant digits."""
    with publish(target) as path:
        frame.to_csv(path, index=False, float_format="%.6g", lineterminator="\n")


def read_csv(path: str | Path, **options: Any) -> "pd.DataFrame":
    """Read a CSV table with options of pandas' reader. Raises InputError: it is missing or no table."""
    import pandas as pd

    with _readable(path, "table", ValueError):  # no text, no columns, or rows of different lengths
        return pd.read_csv(path, **options)
