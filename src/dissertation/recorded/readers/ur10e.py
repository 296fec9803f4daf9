"""Public logs of a Universal Robots UR10e: joint motion and motor currents, without and with a load.

Files of the repository shamilmamedov/dynamic_calibration ("Practical Aspects of Model-Based Collision
Detection", Frontiers in Robotics and AI 2020). Times are those of the controller, about 100 Hz and uneven.
"""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers.foreign_tables import LeftOut, PublicSet, check_rising, read_each, read_stamped_table
from structlearn.readers.joint_log import DriveLog, signals_of
from structlearn.readers.source_files import check_names

SOURCE = PublicSet(
    "https://github.com/shamilmamedov/dynamic_calibration",
    "11af40e7deb758ec080a175fed8fcdd6c99aca29",
    "none stated: for tests and evaluation, not for redistribution",
)
JOINTS = tuple(  # as in the arm's URDF
    f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
)
SIGNALS = signals_of(DriveLog)  # in the order of the columns, one of each per joint
OLDER_COLUMNS = 19  # logs of 2019, with positions, velocities and currents only, which determine no gain


def read_motion(folder: Path, entry: Any = None, left_out: LeftOut = None) -> list[DriveLog]:
    """All logs `ur-NAME.csv` of a folder or its subfolders, except those of `OLDER_COLUMNS`.

    They have no header: time in s, then the columns of `SIGNALS`.
    """
    found = sorted(folder.rglob("ur-*.csv"), key=lambda path: path.stem)
    paths = [path for path in found if not _is_older(path)]
    if older := [path.name for path in found if path not in paths]:
        print(f"ur10e: left aside, without what the controller asked for: {', '.join(older)}")
    if not paths:
        raise MissingInputError(f"{folder}: holds no logs (ur-*.csv)")
    check_names([path.name for path in paths], str(folder))
    return read_each(partial(_read_log, folder), paths, left_out)


def _is_older(path: Path) -> bool:
    if not path.is_file():  # reading a pipe would block; the reader reports it
        return False
    with path.open("rb") as file:
        return file.readline(2**16).count(b",") == OLDER_COLUMNS - 1


def _read_log(folder: Path, path: Path) -> DriveLog:
    stamps, values = read_stamped_table(path, 1 + len(SIGNALS) * len(JOINTS), separator=",")
    check_rising(path, stamps)
    parts = [part.copy() for part in np.split(values, len(SIGNALS), axis=1)]
    provenance = SOURCE.provenance(folder, [path])
    try:
        return DriveLog(path.stem.removeprefix("ur-"), JOINTS, stamps, *parts, provenance=provenance)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
