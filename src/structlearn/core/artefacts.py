"""Artefacts: reading and writing of the files that stages exchange.

Every file is published (`structlearn.core.publication`): it is complete or absent. Writers are deterministic:
equal data give equal bytes. Tables and arrays carry checksums, so that damage is detected on reading.
pandas and Arrow load with the first table: a robot's computer has neither, and reads skills only.
"""

import base64
import hashlib
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
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


def write_arrow(table: "pyarrow.Table", target: str | Path) -> None:
    """Publish an Arrow table as Parquet with page checksums; a digest covers its schema and metadata."""
    import pyarrow.parquet

    metadata = table.schema.metadata or {}
    signed = table.replace_schema_metadata(
        {**metadata, HEADINGS: _headings(table.schema, table.num_rows, metadata)}
    )
    with publish(target) as path:
        pyarrow.parquet.write_table(signed, path, compression="zstd", write_page_checksum=True)


def write_groups(
    tables: Iterable["pyarrow.Table"], target: str | Path, metadata: Callable[[], Mapping[bytes, bytes]]
) -> None:
    """Publish tables of numbers below each other, each as a row group: one at a time is in memory.

    Columns are those of all tables in order of first appearance, null where a table lacks one. Keys are of a
    dictionary type. `metadata` is called after the last table. Checksums are those of `write_arrow`.
    """
    import pyarrow

    with publish(target) as path:
        schema, writer, rows = pyarrow.schema([]), None, 0
        try:
            for table in tables:
                wide = _widened(table, schema)
                if writer is None or wide.schema != schema:
                    schema, writer = wide.schema, _rewritten(writer, path, wide.schema)
                writer.write_table(wide)
                rows += len(wide)
                del table, wide  # before the next one is made
            assert writer is not None  # there is a table
            its = dict(metadata())
            its[HEADINGS] = _headings(schema, rows, its)
            whole = base64.b64encode(schema.with_metadata(its).serialize().to_pybytes())
            writer.add_key_value_metadata({**its, b"ARROW:schema": whole})  # as `write_table` would have it
        finally:
            if writer is not None:
                writer.close()


def _widened(table: "pyarrow.Table", schema: "pyarrow.Schema") -> "pyarrow.Table":
    """Table with the columns of a schema first, null where it lacks one."""
    import pyarrow

    return pyarrow.concat_tables([schema.empty_table(), table], promote_options="default")


def _rewritten(
    before: "pyarrow.parquet.ParquetWriter | None", path: Path, schema: "pyarrow.Schema"
) -> "pyarrow.parquet.ParquetWriter":
    """Writer of more columns, with what was written so far."""
    import pyarrow
    import pyarrow.parquet

    narrow = path.with_name("narrow.parquet")
    if before is not None:
        before.close()
        path.rename(narrow)
    keys = [field.name for field in schema if pyarrow.types.is_dictionary(field.type)]
    numbers = [name for name in schema.names if name not in keys]
    writer = pyarrow.parquet.ParquetWriter(
        path,
        schema,
        compression="zstd",
        write_page_checksum=True,
        use_dictionary=keys,
        use_byte_stream_split=numbers,  # saves 30 % on noisy data
    )
    if before is not None:
        with pyarrow.parquet.ParquetFile(narrow) as file:
            for group in range(file.num_row_groups):
                writer.write_table(_widened(file.read_row_group(group), schema))
        narrow.unlink()
    return writer


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
    with open_arrow(path) as file:
        table = file.read()
        if len(table) != file.metadata.num_rows:
            raise InputError(f"{path}: damaged: has {len(table)} rows of {file.metadata.num_rows}")
    return table


@contextmanager
def open_arrow(path: str | Path) -> Iterator["pyarrow.parquet.ParquetFile"]:
    """Open a Parquet file of this project, to read some columns, row groups, or its metadata.

    Only reading calls belong in the body. Raises InputError: it is damaged; damage to pages shows when they
    are read.
    """
    import pyarrow.parquet

    damaged = (pyarrow.ArrowException, OSError, UnicodeDecodeError)  # the last two: pages, names of columns
    with (
        _readable(path, "readable Parquet", *damaged, whole=False),
        pyarrow.parquet.ParquetFile(path, page_checksum_verification=True) as file,
    ):
        metadata = file.metadata.metadata or {}
        digest = _headings(file.schema_arrow, file.metadata.num_rows, metadata)
        signed = metadata.get(HEADINGS) == digest
        if not (signed and _in_order(file.metadata)):
            raise InputError(
                f"{path}: damaged, or not written by this project: its columns are not as written"
            )
        yield file


def _in_order(metadata: "pyarrow.parquet.FileMetaData") -> bool:
    """Whether the footer lists the pages of all columns as they lie in the file: no checksum covers it."""
    columns, groups = range(metadata.num_columns), map(metadata.row_group, range(metadata.num_row_groups))
    chunks = [group.column(column) for group in groups for column in columns]
    starts = [chunk.data_page_offset for chunk in chunks]
    paths = [metadata.schema.column(column).path for column in columns] * metadata.num_row_groups
    return starts == sorted(starts) and paths == [chunk.path_in_schema for chunk in chunks]


HEADINGS = b"columns sha256"


def _headings(schema: "pyarrow.Schema", rows: int, metadata: Mapping[bytes, bytes]) -> bytes:
    """Digest of everything outside the pages' checksums: names and types of columns, rows, metadata."""
    digest = hashlib.sha256(f"{schema.remove_metadata().to_string()}\n{rows}".encode())
    for key, value in sorted(metadata.items()):
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
