"""Tables from users without ROS: poses, and solids around a movement; touches of a skin: `touch_log`.

The first row of a CSV names its columns; each further row is a sample. Columns of a table of poses are:

| columns | what | needed |
|---|---|---|
| `time_s` | s, from any origin after 0; first in a CSV | yes |
| `x`, `y`, `z` | m, end-effector in the base frame | or positions of joints |
| `qw`, `qx`, `qy`, `qz` | its orientation, unit quaternion | all or none |
| `fx`, `fy`, `fz`, `tx`, `ty`, `tz` | force in N, torque in N m | all or none |
| `position.NAME`, `velocity.NAME`, `effort.NAME` | rad, rad/s, N m of the joint NAME, or m, m/s, N | no |
| `output.NAME` | what else the robot commands, e.g. an opening; on `/output/NAME` | no |

Other columns are an error, since they may be misspelt. A table without quaternions gives recordings without
orientation. It is converted to a bag: ROS 2 messages on `TABLE_TOPICS`, which are the names for a topic map.

Solids around a movement are a CSV beside its bag, one per row, with the columns `name`, `form` (cube, sphere
or cylinder), `x`, `y`, `z` (m, centre in the base frame), `qw`, `qx`, `qy`, `qz` (orientation) and `sx`,
`sy`, `sz` (m, full extent along the solid's own axes, z the axis of a cylinder).
"""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers.clock import NORM_TOLERANCE
from structlearn.readers.demonstration import (
    FORMS,
    NamedShape,
    Stream,
)
from structlearn.readers.foreign_tables import (
    finite_numbers,
    read_parquet,
    read_rows,
    read_stamped_table,
    read_text,
)
from structlearn.readers.messages import FIELDS, LAST_STAMP, joint_messages, to_messages
from structlearn.readers.raw_messages import Bag, RawMessages
from structlearn.readers.source_files import METADATA, SHAPE_FILE

# Topics of a table of poses as a bag, as far as it has their columns
TABLE_TOPICS = {"pose": "/pose", "wrench": "/wrench", "joint_states": "/joint_states"}

TIME, POSITION = "time_s", ("x", "y", "z")
ORIENTATION = ("qw", "qx", "qy", "qz")
WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")
SIZE = ("sx", "sy", "sz")
PREFIXES = (*FIELDS.values(), "output")
_NAMES = (*POSITION, *ORIENTATION, *WRENCH, *(f"{prefix}.NAME" for prefix in PREFIXES))
UNDERSTOOD = f"columns may be {', '.join(_NAMES)}, comma-separated"
MOST_COLUMNS = 1000


def read_pose_table(path: Path) -> Bag:
    """Read a table of poses as a bag. Raises InputError naming file and row."""
    names, stamps, values = (_of_parquet if path.suffix == ".parquet" else _of_csv)(path)
    if (wrong := (stamps < 0) | (stamps > LAST_STAMP)).any():
        row = int(np.argmax(wrong))
        raise InputError(f"{path}: row {row}: {TIME} is {stamps[row] * 1e-9:.9g}, not between 0 and 2^31")
    columns = dict(zip(names, values.T, strict=True))
    for group in (ORIENTATION, WRENCH):
        missing = [name for name in group if name not in columns]
        if missing and len(missing) < len(group):
            raise InputError(f"{path}: has no column {', '.join(missing)}; {', '.join(group)} come together")

    def block(names: Iterable[str]) -> np.ndarray:
        return np.stack([columns[name] for name in names], axis=1)

    oriented, messages = ORIENTATION[0] in columns, dict[str, RawMessages]()
    if POSITION[0] in columns:
        turns = block(ORIENTATION) if oriented else np.tile([1.0, 0.0, 0.0, 0.0], (len(stamps), 1))
        pose = Stream("", "pose", stamps, np.hstack([block(POSITION), turns]))
        messages[TABLE_TOPICS["pose"]] = to_messages(str(path), pose)
    if WRENCH[0] in columns:
        wrench = Stream("", "wrench", stamps, block(WRENCH))
        messages[TABLE_TOPICS["wrench"]] = to_messages(str(path), wrench)
    for output in _joints(names, "output"):
        stream = Stream("", "outputs", stamps, block([f"output.{output}"]))
        messages[f"/output/{output}"] = to_messages(str(path), stream)
    fields = {}
    joints = list(dict.fromkeys(name for prefix in FIELDS.values() for name in _joints(names, prefix)))
    for kind, prefix in FIELDS.items():
        having = _joints(names, prefix)
        if having and (missing := [name for name in joints if name not in having]):
            raise InputError(f"{path}: has {prefix}.{having[0]}, but not {prefix}.{missing[0]}")
        if having:
            fields[kind] = block(f"{prefix}.{joint}" for joint in joints)
    if joints:
        messages[TABLE_TOPICS["joint_states"]] = joint_messages(str(path), joints, stamps, fields)
    provenance = {"origin": "recorded", "source": path.name}
    if not oriented:
        provenance["orientation"] = "not recorded"
    return Bag(
        {topic: [schema.name for schema in raw.schemas[:1] if schema] for topic, raw in messages.items()},
        messages,
        {"provenance": json.dumps(provenance, sort_keys=True), "true_segments": "null"},
    )


def _of_csv(path: Path) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names of the columns without the time, (T,) ns, and values (T, D)."""
    names = [name.strip() for name in read_text(path).partition("\n")[0].split(",")]
    if names[0] != TIME:
        raise InputError(f"{path}: the first column is '{names[0]}', not {TIME}; behind it {UNDERSTOOD}")
    _check_names(path, names[1:])
    return names[1:], *read_stamped_table(path, columns=len(names), separator=",", header_lines=1)


def _of_parquet(path: Path) -> tuple[list[str], np.ndarray, np.ndarray]:
    """As `_of_csv`; times are float64, which resolves Unix time in s to 240 ns."""
    table = read_parquet(path)
    if others := [str(name) for name in table if name not in table.select_dtypes("number")]:
        raise InputError(f"{path}: {', '.join(others)}: not numbers")
    if TIME not in table:
        raise InputError(f"{path}: has no column {TIME}; it has {', '.join(table)}")
    check_finite(path, table, "row {row}: {name} is {value}")
    time = table.pop(TIME).to_numpy(float)
    if np.abs(time).max(initial=0.0) >= 2**31:
        raise InputError(f"{path}: {TIME} goes to {np.abs(time).max():g} s, beyond 2^31")
    _check_names(path, list(table))
    if not len(time):
        raise InputError(f"{path}: has no rows")
    return list(table), np.round(time * 1e9).astype(np.int64), table.to_numpy(float)


def _joints(names: Sequence[str], of: str) -> list[str]:
    """Joints, or outputs, that have a certain field."""
    return [name.removeprefix(f"{of}.") for name in names if name.startswith(f"{of}.")]


def _check_names(path: Path, names: Sequence[str]) -> None:
    if len(names) > MOST_COLUMNS:
        raise InputError(f"{path}: has {len(names)} columns, more than {MOST_COLUMNS}")
    prefixes = tuple(f"{prefix}." for prefix in PREFIXES)
    for name in names:
        joint = name.startswith(prefixes) and not name.endswith(".")
        if name not in (*POSITION, *ORIENTATION, *WRENCH) and not joint:
            raise InputError(f"{path}: column '{name}' is not understood; {UNDERSTOOD}")
        if names.count(name) > 1:
            raise InputError(f"{path}: column '{name}' stands {names.count(name)} times")
    missing = [name for name in POSITION if name not in names]
    if missing and not (len(missing) == len(POSITION) and _joints(names, FIELDS["joint_positions"])):
        raise InputError(f"{path}: has no column {', '.join(missing)}")


def shape_file(path: Path, name: str) -> Path | None:
    """The nearest table of shapes that applies to a recording, or None."""
    folders = [path.parent, path.parent.parent] if (path.parent / METADATA).exists() else [path.parent]
    if path.is_dir():  # a split bag
        folders.insert(0, path)
    places = [folder / file for folder in folders for file in (f"{name}.{SHAPE_FILE}", SHAPE_FILE)]
    return next((place for place in places if place.is_file()), None)


def read_shapes(path: Path) -> tuple[NamedShape, ...]:
    """Read a table of shapes. Raises InputError naming file and line."""
    shapes = []
    columns = (*POSITION, *ORIENTATION, *SIZE)
    for where, row in read_rows(path, ("name", "form", *columns)):
        form = next((name for name in FORMS if name == row["form"]), None)
        if form is None:
            raise InputError(f"{where}: form is '{row['form']}', not one of {', '.join(FORMS)}")
        values = np.array(finite_numbers(where, [row[name] for name in columns]))
        position, orientation, size = np.split(values, (3, 7))
        if not (size > 0).all():
            raise InputError(f"{where}: a shape needs a positive size")
        norm = float(np.linalg.norm(orientation))
        if abs(norm - 1.0) > NORM_TOLERANCE:
            raise InputError(f"{where}: quaternion has norm {norm:.6g}, not 1")
        shapes.append(NamedShape(row["name"], form, position, quaternion.normalised(orientation), size))
    return tuple(shapes)


def check_finite(path: Path, table: pd.DataFrame, words: str) -> None:
    """Raise InputError at the first value that is not finite; `words` describe row, name and value."""
    for name in table:
        finite = np.isfinite(pd.to_numeric(table[name], errors="coerce").to_numpy(float))
        if not finite.all():
            row = int(np.argmin(finite))
            fault = words.format(row=row, name=name, value=table[name].iloc[row])
            raise InputError(f"{path}: {fault}")
