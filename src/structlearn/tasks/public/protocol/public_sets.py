"""Public recordings come in: one reader per layout, registered by name, and the form that later stages read.

Movements become runs on one clock (`runs.parquet`); slides keep their streams (`streams.parquet`).
"""

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from shutil import copyfile
from typing import Any, NamedTuple

import pandas as pd
from pydantic import Field, field_validator

from structlearn.avoidance.avoidance_dataset import AvoidanceDataset, to_table
from structlearn.core.artefacts import publish, write_metrics, write_table
from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.params import Parameters
from structlearn.readers import panda, slide, synchronise, ur10e
from structlearn.readers.bag_files import natural_order
from structlearn.readers.joint_log import write_log_table
from structlearn.readers.reaches_past_boxes import read_reaches_past_boxes
from structlearn.readers.recording import Recording
from structlearn.readers.runs import write_runs, write_streams
from structlearn.tasks.public.protocol.avoidance_samples import (
    avoidance_provenance,
    read_avoidance_samples,
)

SOURCE_VARIABLE = "RECORDED_DATA"
RUNS, STREAMS, LOGS = "runs.parquet", "streams.parquet", "logs.parquet"

LeftOut = dict[str, str]
"""Why files could not be read, by their names."""


class Reader(NamedTuple):
    """A layout: `read(folder, part, left_out)`, and `write(found, target, left_out)` into a folder."""

    read: Callable[[Path, Any, LeftOut], Any]
    write: Callable[[Any, Path, LeftOut], None]


def _write_movements(
    found: Sequence[Recording],
    target: Path,
    left_out: LeftOut,
    jumps: bool = False,
    forms: tuple[str, ...] = (RUNS,),
) -> None:
    """In natural order, numbers as names padded to equal length; what fails its checks is left out."""
    digits = max((len(one.name) for one in found if one.name.isdecimal()), default=0)
    named = {one.name.zfill(digits) if one.name.isdecimal() else one.name: one for one in found}
    runs, kept = [], []
    for name in sorted(named, key=natural_order):
        recording = Recording(name, named[name].streams, None, named[name].provenance, named[name].shapes)
        try:
            runs.append(synchronise(recording, refuse_jumps=not jumps))
        except InputError as error:
            left_out[name] = str(error)
        else:
            kept.append(recording)
    if runs and RUNS in forms:
        write_runs(runs, target / RUNS)
    if runs and STREAMS in forms:
        write_streams(kept, target / STREAMS)


def _movements(read: Callable[[Path, Any, LeftOut], Any], **options: Any) -> Reader:
    return Reader(read, lambda found, target, left_out: _write_movements(found, target, left_out, **options))


def _write_avoidance(
    found: tuple[AvoidanceDataset, Mapping[str, str]], target: Path, left_out: LeftOut
) -> None:
    samples, provenance = found
    write_table(to_table(samples), target / "samples.parquet")
    write_metrics(provenance, target / "provenance.json")


def _write_panda(logs: Sequence[Any], target: Path, left_out: LeftOut) -> None:
    if logs:
        write_log_table(sorted(logs, key=lambda log: natural_order(log.name)), target / LOGS)


def _write_ur10e(found: tuple[Sequence[Any], Path], target: Path, left_out: LeftOut) -> None:
    logs, urdf = found
    if logs:
        write_log_table(sorted(logs, key=lambda log: log.name), target / LOGS)
        copyfile(urdf, target / ur10e.URDF)


READERS = {
    "clmc_avoidance": Reader(
        lambda folder, _, out: (read_avoidance_samples(folder), avoidance_provenance(folder)),
        _write_avoidance,
    ),
    "biotac_slides": _movements(slide.read_slides, forms=(STREAMS,)),
    # the protocol names the reaches in which tracking jumped
    "reaches_past_boxes": _movements(lambda folder, _, out: read_reaches_past_boxes(folder, out), jumps=True),
    "panda": Reader(lambda folder, _, out: panda.read_trajectories(folder, out), _write_panda),
    "ur10e": Reader(
        lambda folder, _, out: (ur10e.read_logs(folder, out), ur10e.urdf_path(folder)), _write_ur10e
    ),
}
"""Layouts of public recordings by name."""


class SetParameters(Parameters):
    """A public set: its reader, its folder in the source, and which part of it."""

    reader: str
    folder: str = Field(min_length=1)
    part: str | int | None

    @field_validator("reader")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in READERS:
            raise ValueError(f"there is no reader '{name}' among {', '.join(READERS)}")
        return name


class PublicSourceParameters(Parameters):
    """Source of the public recordings, and the sets in it."""

    source: str = Field(min_length=1)
    sets: Mapping[str, SetParameters]

    @property
    def folder(self) -> Path:
        """The folder to import from."""
        return Path(os.environ.get(SOURCE_VARIABLE) or self.source)


def import_sets(parameters: PublicSourceParameters, target: Path) -> pd.DataFrame:
    """Read every set into a folder of its name; one that is not there gets an empty one.

    What cannot be read is left out and named on standard error: a file, or a set as a whole.

    Returns:
        `set`, `file` ("" for all of the set) and `reason` of what was left out.

    Raises:
        InputError: there is no such source, or nothing of it can be read.
    """
    source = parameters.folder
    if not source.is_dir():
        raise InputError(f"{source}: no such folder; name that of the recordings: make recorded DATA=FOLDER")
    found: dict[str, Any] = {}
    left_out = {name: LeftOut() for name in parameters.sets}
    for name, one in parameters.sets.items():
        try:
            read = READERS[one.reader].read(source / one.folder, one.part, left_out[name])
        except MissingInputError as missing:
            print(f"{name}: not recorded here: {missing}")
        except InputError as error:
            left_out[name][""] = str(error)
        else:
            found |= {name: read} if read else {}
    if found:
        for name, one in parameters.sets.items():
            with publish(target / name) as folder:
                folder.mkdir()
                if name in found:
                    READERS[one.reader].write(found[name], folder, left_out[name])
    rows = [
        (name, file, reason.replace(f"{source}/", ""))
        for name, its in left_out.items()
        for file, reason in its.items()
    ]
    for name, _, reason in rows:
        print(f"{name}: left out: {reason}", file=sys.stderr)
    if not found:
        raise InputError(f"{source}: holds none of the recordings, or none that can be read")
    return pd.DataFrame(rows, columns=["set", "file", "reason"])
