"""Solids around a movement from a CSV beside its bag.

The first row names the columns: `name`, `form` (cube, sphere or cylinder), `x`, `y`, `z` (m, centre in the
base frame), `qw`, `qx`, `qy`, `qz` (orientation) and `sx`, `sy`, `sz` (m, full extent along the solid's own
axes, a cylinder standing along its z); each further row is a solid.
"""

from pathlib import Path

import numpy as np

from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers.checks import NORM_TOLERANCE
from structlearn.readers.recording import FORMS, NamedShape
from structlearn.readers.text_log import finite_numbers, read_rows

FILE = "obstacles.csv"
"""Of all recordings in its folder, or in the bag whose folder it is; `NAME.obstacles.csv` is of one only."""

NUMBERS = ("x", "y", "z", "qw", "qx", "qy", "qz", "sx", "sy", "sz")


def shape_file(path: Path, name: str) -> Path | None:
    """The nearest table of shapes that is meant for a recording; None where there is none."""
    folders = [path.parent, path.parent.parent] if (path.parent / "metadata.yaml").exists() else [path.parent]
    if path.is_dir():  # a bag that is split
        folders.insert(0, path)
    places = [folder / file for folder in folders for file in (f"{name}.{FILE}", FILE)]
    return next((place for place in places if place.is_file()), None)


def read_shapes(path: Path) -> tuple[NamedShape, ...]:
    """Read a table of shapes.

    Raises:
        InputError: the file is no text or lacks a column, or a line has a form that is not known, something
            that is no finite number, no unit quaternion, or no positive size; the message names the line.
    """
    shapes = []
    for where, row in read_rows(path, ("name", "form", *NUMBERS)):
        form = next((one for one in FORMS if one == row["form"]), None)
        if form is None:
            raise InputError(f"{where}: form is '{row['form']}', not one of {', '.join(FORMS)}")
        values = np.array(finite_numbers(where, [row[name] for name in NUMBERS]))
        position, orientation, size = np.split(values, (3, 7))
        if not (size > 0).all():
            raise InputError(f"{where}: a shape needs a positive size")
        norm = float(np.linalg.norm(orientation))
        if abs(norm - 1.0) > NORM_TOLERANCE:
            raise InputError(f"{where}: quaternion has norm {norm:.6g}, not 1")
        shapes.append(NamedShape(row["name"], form, position, quaternion.normalised(orientation), size))
    return tuple(shapes)
