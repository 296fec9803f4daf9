"""Solids around a movement from a CSV beside its bag.

The first row names the columns: `name`, `form` (cube, sphere or cylinder), `x`, `y`, `z` (m, centre in the
base frame), `qw`, `qx`, `qy`, `qz` (orientation) and `sx`, `sy`, `sz` (m, full extent along the solid's own
axes, a cylinder standing along its z); each further row is a solid.
"""

import csv
from pathlib import Path

import numpy as np

from structlearn.ground import quaternion
from structlearn.ground.errors import InputError
from structlearn.recordings.checks import NORM_TOLERANCE
from structlearn.recordings.recording import FORMS, NamedShape

FILE = "obstacles.csv"
"""Of all recordings in its folder, or in the bag whose folder it is; `NAME.obstacles.csv` is of one only."""

COLUMNS = ("name", "form", "x", "y", "z", "qw", "qx", "qy", "qz", "sx", "sy", "sz")


def shape_file(path: Path, name: str) -> Path | None:
    """The table of shapes that is meant for a recording: the nearest one; None where there is none.

    Args:
        path: of the recording, or of the folder of a bag that is split.
        name: of the recording.
    """
    folders = [path.parent, path.parent.parent] if (path.parent / "metadata.yaml").exists() else [path.parent]
    if path.is_dir():
        folders.insert(0, path)
    places = [folder / file for folder in folders for file in (f"{name}.{FILE}", FILE)]
    return next((place for place in places if place.is_file()), None)


def read_shapes(path: Path) -> tuple[NamedShape, ...]:
    """Read a table of shapes.

    Raises:
        InputError: the file is no text, has other columns, or a line has a form that is not known, something
            that is no finite number, no unit quaternion, or no positive size; the message names the line.
    """
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            rows = list(csv.reader(file))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not a CSV file: {error}") from error
    names = [name.strip() for name in rows[0]] if rows else []
    if sorted(names) != sorted(COLUMNS):
        raise InputError(f"{path}: has the columns {', '.join(names) or 'none'}, needs {', '.join(COLUMNS)}")
    return tuple(
        _shape(f"{path}: line {line}", names, row) for line, row in enumerate(rows[1:], start=2) if row
    )


def _shape(where: str, names: list[str], row: list[str]) -> NamedShape:
    if len(row) != len(names):
        raise InputError(f"{where} has {len(row)} columns, expected {len(names)}")
    fields = dict(zip(names, (field.strip() for field in row), strict=True))
    form = next((one for one in FORMS if one == fields["form"]), None)
    if form is None:
        raise InputError(f"{where}: form is '{fields['form']}', not one of {', '.join(FORMS)}")
    try:
        values = np.array([float(fields[name]) for name in COLUMNS[2:]])
    except ValueError as error:
        raise InputError(f"{where}: not a number: {str(error).rpartition(': ')[2]}") from error
    position, orientation, size = np.split(values, (3, 7))
    if not (np.isfinite(values).all() and (size > 0).all()):
        raise InputError(f"{where}: a shape needs a finite pose and a positive size")
    norm = float(np.linalg.norm(orientation))
    if abs(norm - 1.0) > NORM_TOLERANCE:
        raise InputError(f"{where}: quaternion has norm {norm:.6g}, not 1")
    return NamedShape(fields["name"], form, position, quaternion.normalised(orientation), size)
