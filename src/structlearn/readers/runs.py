"""Runs: a set of demonstrations or executions on one clock, as every stage behind the reading has them.

One stage per source reads what was recorded, checks it and puts it on the clock (`clock.synchronise`); all
others read its runs from here. Where a protocol needs streams on clocks of their own, the stage writes those.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from structlearn.readers.demonstration import SIGNALS, Demonstration
from structlearn.readers.recording import NamedShape, Recording, Stream
from structlearn.readers.series_table import Series, read_series, write_series

UNITS = {
    "time": "s",
    "position": "m",
    "orientation": "",
    "velocity": "m/s",
    "angular_velocity": "rad/s",
    "joint_positions": "rad",
    "joint_velocities": "rad/s",
    "joint_torques": "N m",
    "wrench": "N, N m",
    "tactile": "counts",
    "tool_to_board": "",
}
"""SI units of the signals; quaternions w, x, y, z have none, a wrench is force, then torque."""

PARTS = {
    "position": "xyz",
    "orientation": "wxyz",
    "velocity": "xyz",
    "angular_velocity": "xyz",
    "wrench": ("fx", "fy", "fz", "tx", "ty", "tz"),
    "tool_to_board": "wxyz",
}
"""Names of a signal's columns; those of joints and electrodes are numbered from 0."""


def write_runs(runs: Sequence[Demonstration], target: str | Path) -> None:
    """Publish a set of runs as a Parquet table, a column per component, e.g. `position.x` in m."""
    write_series([_series(run) for run in runs], UNITS, target)


def read_runs(path: str | Path) -> list[Demonstration]:
    """Read a set of runs, in the order in which they were written.

    Raises:
        InputError: the file is missing, damaged or holds something else.
    """
    return [_demonstration(run) for run in read_series(path)]


def write_streams(recordings: Sequence[Recording], target: str | Path) -> None:
    """Publish recordings whose streams keep their own clocks: a series per stream, stamps in ns.

    Shapes, names of joints and true segments are not kept.
    """
    series = [
        Series(
            f"{one.name} {place}",
            {"stamp": stream.stamps} | {f"value.{n}": column for n, column in enumerate(stream.values.T)},
            {
                "recording": one.name,
                "topic": stream.topic,
                "kind": stream.kind,
                "provenance": dict(one.provenance),
            },
        )
        for one in recordings
        for place, stream in enumerate(one.streams)
    ]
    write_series(series, {"stamp": "ns", "value": "as `recording.Stream` has it"}, target)


def read_streams(path: str | Path) -> list[Recording]:
    """Read what `write_streams` wrote.

    Raises:
        InputError: the file is missing, damaged or holds something else.
    """
    streams: dict[str, list[Stream]] = {}
    provenance = {}
    for one in read_series(path):
        about = one.about
        values = one.stacked([name for name in one.columns if name != "stamp"])
        stream = Stream(about["topic"], about["kind"], one.columns["stamp"], values)
        streams.setdefault(about["recording"], []).append(stream)
        provenance[about["recording"]] = about["provenance"]
    return [Recording(name, tuple(its), provenance=provenance[name]) for name, its in streams.items()]


def _series(run: Demonstration) -> Series:
    columns = {"time": run.time}
    for signal in SIGNALS:
        values = getattr(run, signal)
        if values is not None:
            names = PARTS.get(signal, range(values.shape[1]))
            columns |= {f"{signal}.{name}": values[:, place] for place, name in enumerate(names)}
    about = {
        "provenance": dict(run.provenance),
        "joint_names": list(run.joint_names),
        "true_segments": None if run.true_segments is None else run.true_segments.tolist(),
        "shapes": [
            {
                "name": shape.name,
                "form": shape.form,
                "position": np.asarray(shape.position).tolist(),
                "orientation": np.asarray(shape.orientation).tolist(),
                "size": np.asarray(shape.size).tolist(),
            }
            for shape in run.shapes
        ],
    }
    return Series(run.name, columns, about)


def _demonstration(run: Series) -> Demonstration:
    signals = {}
    for signal in SIGNALS:
        if names := [name for name in run.columns if name.partition(".")[0] == signal]:
            signals[signal] = run.stacked(names)
    segments = run.about["true_segments"]
    return Demonstration(
        name=run.name,
        time=run.columns["time"],
        true_segments=None if segments is None else np.array(segments, dtype=float).reshape(-1, 2),
        provenance=run.about["provenance"],
        joint_names=tuple(run.about["joint_names"]),
        shapes=tuple(
            NamedShape(
                shape["name"],
                shape["form"],
                *(np.array(shape[key]) for key in ("position", "orientation", "size")),
            )
            for shape in run.about["shapes"]
        ),
        **signals,
    )
