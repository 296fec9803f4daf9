"""A CSV or Parquet table of poses, for those who have no ROS.

The first row of a CSV names its columns; each further row is a sample. Columns are taken by their names:

| columns | what | needed |
|---|---|---|
| `time_s` | s, from any origin after 0; first in a CSV | yes |
| `x`, `y`, `z` | m, end-effector in the base frame | yes |
| `qw`, `qx`, `qy`, `qz` | its orientation, unit quaternion | all or none |
| `fx`, `fy`, `fz`, `tx`, `ty`, `tz` | force in N, torque in N m | all or none |
| `position.NAME`, `velocity.NAME`, `effort.NAME` | rad, rad/s, N m of the joint NAME, or m, m/s, N | no |

Another column is an error, since it may be one of these with a slip of the pen. A table without quaternions
gives recordings whose orientation was not recorded. It becomes what a bag is: ROS 2 messages on
`TABLE_TOPICS`, which are those to name in a topic map.

Solids around a movement stand in a CSV beside its bag, one a row. Its columns are `name`, `form` (cube,
sphere or cylinder), `x`, `y`, `z` (m, centre in the base frame), `qw`, `qx`, `qy`, `qz` (orientation) and
`sx`, `sy`, `sz` (m, full extent along the solid's own axes, a cylinder standing along its z).
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers.bag import Bag
from structlearn.readers.messages import FIELDS, LAST_STAMP, joint_messages, to_messages
from structlearn.readers.parquet_table import read_parquet
from structlearn.readers.recording import FORMS, NORM_TOLERANCE, NamedShape, Stream
from structlearn.readers.text_log import finite_numbers, read_rows, read_stamped_table, read_text

TABLE_TOPICS = {"pose": "/pose", "wrench": "/wrench", "joint_states": "/joint_states"}
"""Topics of a table as a bag, those of the columns that it has."""

TIME, POSITION = "time_s", ("x", "y", "z")
ORIENTATION = ("qw", "qx", "qy", "qz")
MOST_COLUMNS = 1000
WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")

SHAPE_FILE = "obstacles.csv"
"""Of all recordings in its folder, or in the bag whose folder it is; `NAME.obstacles.csv` is of one only."""

SHAPE_NUMBERS = ("x", "y", "z", "qw", "qx", "qy", "qz", "sx", "sy", "sz")


def read_pose_table(path: Path) -> Bag:
    """Read a table.

    Raises InputError: the file is missing, or is no CSV or Parquet file; a column is missing, unknown or
    stands twice, joints have not the same fields, or a value is no finite number or time.
    """
    names, stamps, values = (_of_parquet if path.suffix == ".parquet" else _of_csv)(path)
    if (stamps < 0).any() or (stamps > LAST_STAMP).any():
        row = int(np.argmax((stamps < 0) | (stamps > LAST_STAMP)))
        raise InputError(f"{path}: row {row}: {TIME} is {stamps[row] * 1e-9:.9g}, not between 0 and 2^31")
    joints = _joints(path, names)
    columns = dict(zip(names, values.T, strict=True))
    for group in (ORIENTATION, WRENCH):
        missing = [name for name in group if name not in columns]
        if missing and len(missing) < len(group):
            raise InputError(f"{path}: has no column {', '.join(missing)}; {', '.join(group)} come together")
    oriented = ORIENTATION[0] in columns
    pose = np.zeros((len(stamps), 7))
    pose[:, 3] = 1.0
    pose[:, : 7 if oriented else 3] = _block(columns, POSITION + (ORIENTATION if oriented else ()))
    messages = {TABLE_TOPICS["pose"]: to_messages(str(path), Stream("", "pose", stamps, pose))}
    if WRENCH[0] in columns:
        wrench = Stream("", "wrench", stamps, _block(columns, WRENCH))
        messages[TABLE_TOPICS["wrench"]] = to_messages(str(path), wrench)
    if joints:
        fields = {
            kind: _block(columns, (f"{field}.{joint}" for joint in joints))
            for kind, field in FIELDS.items()
            if f"{field}.{joints[0]}" in columns
        }
        messages[TABLE_TOPICS["joint_states"]] = joint_messages(str(path), joints, stamps, fields)
    provenance = {"origin": "recorded", "source": path.name}
    if not oriented:
        provenance["orientation"] = "not recorded"
    return Bag(
        topics={topic: [one.name for one in its.schemas if one] for topic, its in messages.items()},
        metadata={"provenance": json.dumps(provenance, sort_keys=True), "true_segments": "null"},
        messages=messages,
    )


def _of_csv(path: Path) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names of the columns but for the time, (T,) ns, and (T, D) values."""
    names = [name.strip() for name in read_text(path).partition("\n")[0].split(",")]
    if names[0] != TIME:
        raise InputError(f"{path}: the first column is '{names[0]}', not {TIME}; behind it {_understood()}")
    _check_names(path, names[1:])
    return names[1:], *read_stamped_table(path, columns=len(names), separator=",", header_lines=1)


def _of_parquet(path: Path) -> tuple[list[str], np.ndarray, np.ndarray]:
    """As `_of_csv`; times are float64, which is 240 ns coarse in s of Unix time."""
    table = read_parquet(path)
    if others := [str(name) for name in table if name not in table.select_dtypes("number")]:
        raise InputError(f"{path}: {', '.join(others)}: not numbers")
    columns = {name: table[name].to_numpy(float) for name in table}
    if TIME not in columns:
        raise InputError(f"{path}: has no column {TIME}; it has {', '.join(columns)}")
    for name, column in columns.items():
        if not np.isfinite(column).all():
            row = int(np.argmax(~np.isfinite(column)))
            raise InputError(f"{path}: row {row}: {name} is {column[row]}")
    time = columns.pop(TIME)
    if np.abs(time).max(initial=0.0) >= 2**31:
        raise InputError(f"{path}: {TIME} goes to {np.abs(time).max():g} s, beyond 2^31")
    _check_names(path, list(columns))
    if not len(time):
        raise InputError(f"{path}: has no rows")
    return list(columns), np.round(time * 1e9).astype(np.int64), np.stack(list(columns.values()), axis=1)


def _check_names(path: Path, names: Sequence[str]) -> None:
    if len(names) > MOST_COLUMNS:
        raise InputError(f"{path}: has {len(names)} columns, more than {MOST_COLUMNS}")
    prefixes = tuple(f"{field}." for field in FIELDS.values())
    for name in names:
        joint = name.startswith(prefixes) and not name.endswith(".")
        if name not in (*POSITION, *ORIENTATION, *WRENCH) and not joint:
            raise InputError(f"{path}: column '{name}' is not understood; {_understood()}")
        if names.count(name) > 1:
            raise InputError(f"{path}: column '{name}' stands {names.count(name)} times")
    missing = [name for name in POSITION if name not in names]
    if missing:
        raise InputError(f"{path}: has no column {', '.join(missing)}")


def _understood() -> str:
    joints = (f"{field}.NAME" for field in FIELDS.values())
    return f"columns may be {', '.join((*POSITION, *ORIENTATION, *WRENCH, *joints))}, comma-separated"


def _joints(path: Path, names: Sequence[str]) -> list[str]:
    """Joints in the order of their first columns; every field is there for all of them or for none."""
    of_field = {
        field: [name.removeprefix(f"{field}.") for name in names if name.startswith(f"{field}.")]
        for field in FIELDS.values()
    }
    joints = list(dict.fromkeys(name for its in of_field.values() for name in its))
    for field, its in of_field.items():
        missing = [name for name in joints if name not in its]
        if its and missing:
            raise InputError(f"{path}: has {field}.{its[0]}, but not {field}.{missing[0]}")
    return joints


def _block(columns: Mapping[str, np.ndarray], names: Iterable[str]) -> np.ndarray:
    """(T, D) of some columns."""
    return np.stack([columns[name] for name in names], axis=1)


def shape_file(path: Path, name: str) -> Path | None:
    """The nearest table of shapes that is meant for a recording; None where there is none."""
    folders = [path.parent, path.parent.parent] if (path.parent / "metadata.yaml").exists() else [path.parent]
    if path.is_dir():  # a bag that is split
        folders.insert(0, path)
    places = [folder / file for folder in folders for file in (f"{name}.{SHAPE_FILE}", SHAPE_FILE)]
    return next((place for place in places if place.is_file()), None)


def read_shapes(path: Path) -> tuple[NamedShape, ...]:
    """Read a table of shapes.

    Raises InputError: the file is no text or lacks a column, or a line has a form that is not known,
    something that is no finite number, no unit quaternion, or no positive size; the message names the line.
    """
    shapes = []
    for where, row in read_rows(path, ("name", "form", *SHAPE_NUMBERS)):
        form = next((one for one in FORMS if one == row["form"]), None)
        if form is None:
            raise InputError(f"{where}: form is '{row['form']}', not one of {', '.join(FORMS)}")
        values = np.array(finite_numbers(where, [row[name] for name in SHAPE_NUMBERS]))
        position, orientation, size = np.split(values, (3, 7))
        if not (size > 0).all():
            raise InputError(f"{where}: a shape needs a positive size")
        norm = float(np.linalg.norm(orientation))
        if abs(norm - 1.0) > NORM_TOLERANCE:
            raise InputError(f"{where}: quaternion has norm {norm:.6g}, not 1")
        shapes.append(NamedShape(row["name"], form, position, quaternion.normalised(orientation), size))
    return tuple(shapes)
