"""Artefacts: how stages publish and read files.

Every file or folder is written beside its place under a temporary name and moved in place when it is
complete, so a killed stage leaves nothing half-written. Writers are deterministic: the same data give the
same bytes.
"""

import json
import math
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet
from safetensors import SafetensorError, safe_open
from safetensors.numpy import load_file, save_file

from structlearn.ground.errors import InputError, MissingInputError

Metrics = dict[str, float | int | str | bool | None]
"""Flat key figures."""


@contextmanager
def publish(target: str | Path) -> Iterator[Path]:
    """Give a temporary path beside `target`; move what was written there in place on success.

    The caller writes a file at the path, or makes a folder of it. Nothing appears at `target` when the body
    raises, and what stood there before stays.

    Args:
        target: the final path; parent folders are made.

    Yields:
        The temporary path; it has the target's suffix, for writers that look at it.
    """
    target = Path(target)
    target.parent.mkdir(parents=True, exist_ok=True)
    workspace = target.parent / f".publish-{target.name}"
    replaced = workspace / "replaced"
    if replaced.exists() and not target.exists():  # killed between the two moves below
        replaced.rename(target)
    shutil.rmtree(workspace, ignore_errors=True)  # left by a killed run
    workspace.mkdir()
    try:
        temporary = workspace / target.name
        yield temporary
        if target.is_dir() and temporary.exists():  # nothing written: the old content stays
            target.rename(replaced)  # a folder cannot be replaced in one step
        os.replace(temporary, target)
    finally:
        shutil.rmtree(workspace, ignore_errors=True)


def filled(folder: str | Path, at_least: int = 1) -> Path:
    """A folder that a stage before wrote, which is empty where its data are missing.

    Args:
        folder: there it is.
        at_least: files that are needed.

    Returns:
        The folder.

    Raises:
        MissingInputError: it holds fewer.
        InputError: it does not exist.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; run the stage that writes it")
    count = len(list(folder.iterdir()))
    if count < at_least:
        raise MissingInputError(f"{folder} holds {count} files, {at_least} or more are needed")
    return folder


def write_table(frame: pd.DataFrame, target: str | Path) -> None:
    """Publish a table as Parquet, without pandas' index and without versions in its metadata."""
    table = pyarrow.Table.from_pandas(frame, preserve_index=False).replace_schema_metadata(None)
    with publish(target) as path:
        pyarrow.parquet.write_table(table, path, compression="zstd")


def read_table(path: str | Path) -> pd.DataFrame:
    """Read a Parquet table.

    Raises:
        InputError: the file is missing, truncated or of another kind.
    """
    try:
        return pyarrow.parquet.read_table(path).to_pandas()
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; run the stage that writes it") from error
    except (pyarrow.ArrowInvalid, OSError) as error:  # OSError: damaged pages
        raise InputError(f"{path}: not a readable Parquet file: {error}") from error


def write_tensors(tensors: Mapping[str, np.ndarray], target: str | Path, description: str) -> None:
    """Publish named arrays as safetensors; one metadata key only, since more are not deterministic."""
    ordered = {name: np.asarray(tensors[name], order="C") for name in sorted(tensors)}
    with publish(target) as path:
        save_file(ordered, path, metadata={"description": description})


def read_tensors(path: str | Path) -> dict[str, np.ndarray]:
    """Read named arrays from a safetensors file.

    Raises:
        InputError: the file is missing, truncated or of another kind, or a value is NaN or infinite.
    """
    with _readable_tensors(path):
        tensors = load_file(path)
    for name, tensor in tensors.items():
        if not np.isfinite(tensor).all():
            raise InputError(f"{path}: {name} holds a value that is not finite")
    return tensors


def read_description(path: str | Path) -> str:
    """The description in a safetensors file's metadata; empty if it has none. Raises as `read_tensors`."""
    with _readable_tensors(path), safe_open(path, framework="np") as file:
        return (file.metadata() or {}).get("description", "")


@contextmanager
def _readable_tensors(path: str | Path) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; run the stage that writes it") from error
    except SafetensorError as error:
        raise InputError(f"{path}: not a readable safetensors file: {error}") from error


def write_metrics(metrics: Metrics, target: str | Path) -> None:
    """Publish a flat JSON of metrics, floats rounded to six significant digits.

    Rounding keeps the file readable; the data it came from stay in the cached artefacts.

    Raises:
        ValueError: a number is NaN or infinite.
    """
    rounded = {key: _rounded(key, value) for key, value in metrics.items()}
    with publish(target) as path:
        path.write_text(json.dumps(rounded, indent=2) + "\n")


def _rounded(key: str, value: float | int | str | bool | None) -> float | int | str | bool | None:
    if isinstance(value, float | np.floating):
        if not math.isfinite(value):
            raise ValueError(f"metric '{key}' is {value}")
        return float(f"{float(value):.6g}")
    return int(value) if isinstance(value, np.integer) else value


def read_metrics(path: str | Path) -> Metrics:
    """Read a flat JSON of metrics.

    Raises:
        InputError: the file is missing or no JSON.
    """
    try:
        return json.loads(Path(path).read_text())
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; run the stage that writes it") from error
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a JSON file: {error}") from error


def write_csv(frame: pd.DataFrame, target: str | Path) -> None:
    """Publish a table as CSV for people: no index, six significant digits."""
    with publish(target) as path:
        frame.to_csv(path, index=False, float_format="%.6g", lineterminator="\n")
