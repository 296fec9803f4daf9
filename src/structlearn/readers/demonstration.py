"""Recordings (one clock per stream), demonstrations (all signals on one clock), and tables of both.

One stage per source reads what was recorded, checks it and puts it on one clock (`clock.synchronise`); all
other stages read its runs, a set of demonstrations or executions. If a protocol needs streams on their own
clocks, the stage writes those.

All are sets of time series in one Parquet file: a long table keyed by run, with units in its schema. Fields
of runs that are not series (provenance, shapes, names of joints) are JSON in the file's metadata, in the
order of the runs. Columns that a run did not record are null. Equal sets give equal bytes, and a damaged file
raises an error (`core.artefacts`). Runs are written as they come, and a reader may ask for some signals only:
a set may be larger than memory.
"""

import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import pyarrow

from structlearn.core.artefacts import open_arrow, write_groups
from structlearn.core.errors import InputError

if TYPE_CHECKING:
    from pyarrow.parquet import ParquetFile

Kind = Literal[
    "pose",
    "twist",
    "joint_positions",
    "joint_velocities",
    "joint_torques",
    "wrench",
    "tactile",
    "tool_to_board",
    "outputs",
    "digital",
]

FIELDS: Mapping[Kind, str] = {
    "joint_positions": "position",
    "joint_velocities": "velocity",
    "joint_torques": "effort",
}
"""Field of a joint state for each kind of joint signal."""

JOINT_KINDS: tuple[Kind, ...] = tuple(FIELDS)

Form = Literal["cube", "sphere", "cylinder"]
FORMS: tuple[Form, ...] = get_args(Form)
"""Forms of shapes; a cuboid is a cube with unequal sides, as in ROS."""

SIGNAL_UNITS = {
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
    "outputs": "",
    "digital": "",
}
"""Sampled signals; quaternions are w, x, y, z and have no unit, a wrench is force, then torque. Outputs have
the units in which they were recorded."""

POSE = ("position", "orientation")
"""Signals of a movement; many protocols read no others."""

OUTPUTS = ("outputs", "digital")

PARTS: Mapping[str, Sequence[str]] = {
    **dict.fromkeys(("position", "velocity", "angular_velocity"), "xyz"),
    **dict.fromkeys(("orientation", "tool_to_board"), "wxyz"),
    "wrench": ("fx", "fy", "fz", "tx", "ty", "tz"),
}
"""Column names of a signal; outputs have their own, those of joints and electrodes are numbered from 0."""

RUN, UNIT, RUNS = "run", b"unit", b"runs"

GROUP_ROWS = 2**15
"""Least rows of a row group: half a minute at 1 kHz; short runs share one."""


@dataclass(frozen=True)
class NamedShape:
    """A solid at rest beside the movement: an obstacle, or a target."""

    name: str
    form: Form  # the axis of a cylinder is the z axis of its frame
    position: np.ndarray  # (3,) m, its centre in the base frame
    orientation: np.ndarray  # (4,) unit quaternion w, x, y, z, shape to base frame
    size: np.ndarray  # (3,) m, full extents along the axes of its frame


@dataclass(frozen=True)
class Stream:
    """Samples of one source on its own, possibly irregular, clock."""

    topic: str  # topic of the source, for messages
    # meaning of the columns. pose: x, y, z in m, then quaternion w, x, y, z (scalar first). twist: linear
    # m/s, then angular rad/s in the base frame. joint_*: rad, rad/s, N m. wrench: force N, then torque N m.
    # tactile: sensor counts. tool_to_board: quaternion w, x, y, z of the tool relative to the board.
    # outputs: as recorded. digital: as recorded, and valid until the next sample
    kind: Kind
    stamps: np.ndarray  # (T,) int64 ns, as recorded
    values: np.ndarray  # (T, D) float64
    joints: tuple[str, ...] = ()  # (D,) names of the joints of a joint signal, if known, or of outputs
    frame: str = ""  # frame_id of the messages, if known

    def of_joints(self, names: Collection[str]) -> "Stream":
        """Columns of some joints, in the stream's own order."""
        columns = [place for place, name in enumerate(self.joints) if name in names]
        if len(columns) == len(self.joints):
            return self
        joints = tuple(self.joints[column] for column in columns)
        return replace(self, values=self.values.take(columns, axis=1), joints=joints)


@dataclass(frozen=True)
class Recording:
    """Streams of one demonstration before synchronisation."""

    name: str  # unique within its set
    # at most one of each kind, except outputs, tactile (one stream per finger) and joint signals (a robot and
    # its hand may have separate clocks)
    streams: tuple[Stream, ...]
    # (P, 2) start and end of each primitive in s since the first stamp of the pose; simulated only
    true_segments: np.ndarray | None = None
    # what is known of the origin, string to string; `origin` is `simulated` or `recorded`
    provenance: Mapping[str, str] = field(default_factory=dict)
    shapes: tuple[NamedShape, ...] = ()  # solids around the movement, if recorded

    @property
    def leading(self) -> Stream:
        """Stream of the movement: the pose or, without one, the first positions of joints.

        Raises InputError: there is neither.
        """
        for kind in ("pose", "joint_positions"):
            for stream in self.streams:
                if stream.kind == kind:
                    return stream
        raise InputError(f"{self.name}: has no pose stream")

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, from the first kind of joint signal that names them; else empty."""
        return next((names for kind in JOINT_KINDS if (names := self.joints_of(kind))), ())

    def joints_of(self, kind: Kind) -> tuple[str, ...]:
        """Concatenated joint names of all streams of one kind."""
        return tuple(name for stream in self.streams if stream.kind == kind for name in stream.joints)


@dataclass(frozen=True)
class Demonstration:
    """Signals of one demonstration (or execution) on one uniform clock.

    Simulated data, a robot's recordings and a user's bags are treated alike from here on.
    """

    name: str  # unique within its set; used in error messages and tables
    time: np.ndarray  # (T,) s, starts at 0, uniform step
    # (T, 3) m, end-effector in the base frame; if the joints themselves move (`of_joints`), (T, J) of these
    position: np.ndarray
    # (T, 4) unit quaternion w, x, y, z, sign-continuous; None if not recorded
    orientation: np.ndarray | None = None
    # (T, 3) m/s, if recorded; otherwise derived from the position when needed
    velocity: np.ndarray | None = None
    angular_velocity: np.ndarray | None = None  # (T, 3) rad/s in the base frame, if recorded
    joint_positions: np.ndarray | None = None  # (T, J) rad, if recorded
    joint_velocities: np.ndarray | None = None  # (T, J) rad/s, if recorded
    joint_torques: np.ndarray | None = None  # (T, J) N m, if recorded
    wrench: np.ndarray | None = None  # (T, 6) force in N, torque in N m, if recorded
    tactile: np.ndarray | None = None  # (T, E) sensor counts, if recorded
    # (T, 4) orientation of the tool relative to the board, sign-continuous, if recorded
    tool_to_board: np.ndarray | None = None
    outputs: np.ndarray | None = None  # (T, C) what the robot commands beside its pose, e.g. an opening
    digital: np.ndarray | None = None  # (T, B) likewise, on or off
    joint_names: tuple[str, ...] = ()  # (J,) in the order of the columns, if known
    output_names: tuple[str, ...] = ()  # (C,)
    digital_names: tuple[str, ...] = ()  # (B,)
    of_joints: bool = False  # whether no pose was recorded, and the position is `joint_positions`
    true_segments: np.ndarray | None = None  # (P, 2) start and end of each primitive in s, if simulated
    # what is known of the origin (simulated or recorded, seed, source, licence)
    provenance: Mapping[str, str] = field(default_factory=dict)
    shapes: tuple[NamedShape, ...] = ()  # solids at rest around the movement, if recorded

    def __post_init__(self) -> None:
        length = len(self.time)
        if length < 2:
            raise InputError(f"{self.name}: needs at least two samples, has {length}")
        for signal in SIGNAL_UNITS:
            values = getattr(self, signal)
            if values is not None and len(values) != length:
                raise InputError(f"{self.name}: {signal} has {len(values)} samples, the clock has {length}")

    @property
    def dt(self) -> float:
        """Sampling interval in s."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    def signal(self, name: str) -> np.ndarray:
        """One of `SIGNAL_UNITS`. Raises InputError: it was not recorded."""
        values = getattr(self, name)
        if values is None:
            raise InputError(f"{self.name}: has no {name}")
        return values

    @property
    def simulated(self) -> bool:
        """Whether the data come from a simulation."""
        return self.provenance.get("origin") == "simulated"


def joint_names(run: Demonstration) -> tuple[str, ...]:
    """Names of the joints that are the movement, or their numbers; () of a pose."""
    if not run.of_joints:
        return ()
    return run.joint_names or tuple(f"joint_{place + 1}" for place in range(run.position.shape[1]))


@dataclass(frozen=True)
class Series:
    """Time series of one run."""

    name: str  # unique within its set
    columns: Mapping[str, np.ndarray]  # (T,) each, finite
    about: Mapping[str, Any] = field(default_factory=dict)  # other fields of the run, JSON-serialisable

    def stacked(self, names: Sequence[str]) -> np.ndarray:
        """Selected columns (T, D), C-contiguous."""
        return np.stack([self.columns[name] for name in names], axis=1)


def columns_of(signal: str, values: np.ndarray, parts: Iterable[Any]) -> dict[str, np.ndarray]:
    """Columns SIGNAL.PART of a signal (T, D), with the given names of its parts."""
    return {f"{signal}.{part}": column for part, column in zip(parts, values.T, strict=True)}


def write_series(runs: Iterable[Series], units: Mapping[str, str], target: str | Path) -> None:
    """Publish a set of runs, maybe empty, as they come: at least `GROUP_ROWS` at a time are in memory.

    Units by column, or by its name up to the first point.
    """
    about = {}

    def tables() -> Iterator[pyarrow.Table]:
        waiting: list[Series] = []
        rows = 0
        for run in runs:
            about[run.name] = dict(run.about)
            waiting.append(run)
            rows += _length(run)
            if rows >= GROUP_ROWS:
                yield _table(waiting, units)
                waiting, rows = [], 0
            del run  # before the next one is made
        if waiting or not about:
            yield _table(waiting, units)

    write_groups(tables(), target, lambda: {RUNS: json.dumps(about).encode()})


def _table(runs: Sequence[Series], units: Mapping[str, str]) -> pyarrow.Table:
    """Runs below each other, keyed by name."""
    lengths = [_length(run) for run in runs]
    index = pyarrow.array(np.repeat(np.arange(len(runs), dtype=np.int32), lengths))
    keys = pyarrow.DictionaryArray.from_arrays(
        index, pyarrow.array([run.name for run in runs], pyarrow.string())
    )
    arrays, fields = [keys], [pyarrow.field(RUN, keys.type)]
    for name in dict.fromkeys(name for run in runs for name in run.columns):
        kind = next(pyarrow.array(run.columns[name][:0]).type for run in runs if name in run.columns)
        parts = [
            pyarrow.array(run.columns[name]) if name in run.columns else pyarrow.nulls(length, kind)
            for run, length in zip(runs, lengths, strict=True)
        ]
        arrays.append(pyarrow.chunked_array(parts))
        unit = units[name if name in units else name.partition(".")[0]]
        fields.append(pyarrow.field(name, kind, metadata={UNIT: unit.encode()}))
    return pyarrow.Table.from_arrays(arrays, schema=pyarrow.schema(fields))


def _length(run: Series) -> int:
    return len(next(iter(run.columns.values())))


def read_series(path: str | Path) -> list[Series]:
    """Read a set of runs in order. Raises InputError: missing, damaged or another file."""
    return list(each_series(path))


def each_series(path: str | Path, signals: Collection[str] | None = None) -> Iterator[Series]:
    """As `read_series`, run by run; with `signals`, only columns of these names up to the first point."""
    with open_arrow(path) as file:
        known, rows, names = _about(path, file), 0, file.schema_arrow.names
        if signals is not None:
            names = [name for name in names if name.partition(".")[0] in {RUN, *signals}]
        damage = InputError(f"{path}: damaged: its rows are not those of its runs")
        expected = iter(known)
        for name, parts in groupby(_slices(file, names), key=itemgetter(0)):
            table = pyarrow.concat_tables([part for _, part in parts])
            rows += len(table)
            if next(expected, None) != name:
                raise damage
            columns = {key: table[key].combine_chunks() for key in table.column_names if key != RUN}
            arrays = {key: column.to_numpy() for key, column in columns.items() if not column.null_count}
            yield Series(name, arrays, known[name])
        if next(expected, None) is not None or rows != file.metadata.num_rows:
            raise damage


def _slices(file: "ParquetFile", names: Sequence[str]) -> Iterator[tuple[str, pyarrow.Table]]:
    """Names of runs with their rows; a run may go on in the next slice."""
    for group in range(file.num_row_groups):
        table = file.read_row_group(group, names)
        keys = table[RUN].combine_chunks()
        starts = np.flatnonzero(np.diff(keys.indices.to_numpy(), prepend=-1)).tolist()
        for start, end in zip(starts, [*starts[1:], len(table)], strict=False):
            yield keys[start].as_py(), table.slice(start, end - start)


def read_about(path: str | Path) -> dict[str, dict[str, Any]]:
    """What is known of each run of a set besides its series; reads the file's metadata only."""
    with open_arrow(path) as file:
        return _about(path, file)


def _about(path: str | Path, file: "ParquetFile") -> dict[str, dict[str, Any]]:
    about = file.metadata.metadata.get(RUNS)
    if about is None:
        raise InputError(f"{path}: holds no runs")
    return json.loads(about)


def write_runs(runs: Iterable[Demonstration], target: str | Path) -> None:
    """Publish a set of runs as a Parquet table with a column per component, e.g. `position.x` in m."""
    write_series(map(_series, runs), {"time": "s", **SIGNAL_UNITS}, target)


def _series(run: Demonstration) -> Series:
    columns = {"time": run.time}
    parts = {**PARTS, "outputs": run.output_names, "digital": run.digital_names}
    for signal in SIGNAL_UNITS:
        values = getattr(run, signal)
        if values is not None and not (signal == "position" and run.of_joints):
            columns |= columns_of(signal, values, parts.get(signal, range(values.shape[1])))
    shapes = [{key: np.asarray(value).tolist() for key, value in vars(shape).items()} for shape in run.shapes]
    about = {
        "provenance": dict(run.provenance),
        "joint_names": list(run.joint_names),
        "true_segments": None if run.true_segments is None else run.true_segments.tolist(),
        "shapes": shapes,
    }
    return Series(run.name, columns, about)


def read_runs(path: str | Path, signals: Collection[str] | None = None) -> list[Demonstration]:
    """Read a set of runs, in the order in which they were written.

    With `signals`, some of `SIGNAL_UNITS`, all others except the position are None, and take no memory.
    """
    return list(each_run(path, signals))


def each_run(path: str | Path, signals: Collection[str] | None = None) -> Iterator[Demonstration]:
    """As `read_runs`, run by run."""
    if signals is None:
        return map(_run, each_series(path))
    with open_arrow(path) as file:
        of_joints = not any(name.startswith("position.") for name in file.schema_arrow.names)
    wanted = {"time", "joint_positions" if of_joints else "position", *signals}
    return map(_run, each_series(path, wanted))


def _run(series: Series) -> Demonstration:
    signals: dict[str, Any] = {}
    for signal in SIGNAL_UNITS:
        if names := [name for name in series.columns if name.partition(".")[0] == signal]:
            signals[signal] = series.stacked(names)
            if signal in OUTPUTS:
                called = tuple(name.partition(".")[2] for name in names)
                signals["output_names" if signal == "outputs" else "digital_names"] = called
    if "position" not in signals:
        signals |= {"position": signals["joint_positions"], "of_joints": True}
    about = series.about
    if (segments := about["true_segments"]) is not None:
        signals["true_segments"] = np.array(segments, dtype=float).reshape(-1, 2)
    signals["shapes"] = tuple(
        NamedShape(
            shape["name"],
            shape["form"],
            *(np.array(shape[key]) for key in ("position", "orientation", "size")),
        )
        for shape in about["shapes"]
    )
    signals |= {"provenance": about["provenance"], "joint_names": tuple(about["joint_names"])}
    return Demonstration(series.name, series.columns["time"], **signals)


def write_streams(recordings: Iterable[Recording], target: str | Path) -> None:
    """Publish the streams of recordings, one series each, stamps in ns; without shapes and joint names."""

    def series() -> Iterator[Series]:
        for recording in recordings:
            for place, stream in enumerate(recording.streams):
                columns = columns_of("value", stream.values, range(stream.values.shape[1]))
                about = {"recording": recording.name, "topic": stream.topic, "kind": stream.kind}
                known = about | {"provenance": dict(recording.provenance)}
                yield Series(f"{recording.name} {place}", {"stamp": stream.stamps} | columns, known)

    write_series(series(), {"stamp": "ns", "value": "as `recording.Stream` has it"}, target)


def read_streams(path: str | Path) -> list[Recording]:
    """Read the file of `write_streams`."""
    streams: dict[str, list[Stream]] = {}
    provenance = {}
    for run in each_series(path):
        about = run.about
        values = run.stacked([name for name in run.columns if name != "stamp"])
        stream = Stream(about["topic"], about["kind"], run.columns["stamp"], values)
        streams.setdefault(about["recording"], []).append(stream)
        provenance[about["recording"]] = about["provenance"]
    return [Recording(name, tuple(parts), provenance=provenance[name]) for name, parts in streams.items()]
