"""Public logs of a KUKA LWR4+ on exciting trajectories, and its URDF.

Files `data/KUKA/HW/measurements_{1,2}.npz` and `model/kuka_lwr4.urdf` of the repository kjyv/FloBaRoID, which
identifies robots. Torques are those of joint sensors.
"""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from structlearn.core.errors import InputError
from structlearn.core.reading import Budget, require_file
from structlearn.readers.joint_log import JointLog, signals_of
from structlearn.readers.text_log import PublicSet, read_each

SOURCE = PublicSet(
    "https://github.com/kjyv/FloBaRoID",
    "e6c077ea5c09bceb49840f49e83450bb5979029b",
    "LGPL-3.0",
)

JOINTS = tuple(f"lwr_{number}_joint" for number in range(7))
"""Names in the arm's URDF."""


def read_motion(
    folder: str | Path, entry: Any = None, left_out: dict[str, str] | None = None
) -> list[JointLog]:
    """All logs `measurements_*.npz` of a folder, or of folders there, about 200 Hz and uneven.

    Raises MissingInputError: there is no log. Raises InputError: a file is no archive of arrays, or an array
    is missing or of another shape.
    """
    folder = Path(folder)
    found = SOURCE.files(folder, "measurements_*.npz", "logs (measurements_1.npz, ...)")
    return read_each(partial(_read, folder), found, left_out)


def _read(folder: Path, path: Path) -> JointLog:
    names = signals_of(JointLog)
    try:
        require_file(path)
        budget = Budget(path)
        with np.load(path, allow_pickle=False) as arrays:
            for entry in arrays.zip.infolist():
                budget.take(entry.file_size)
            found = [arrays[name] for name in ("times", *names)]
            times, *signals = (its.astype(np.float64, casting="same_kind") for its in found)
    except InputError:
        raise
    except KeyError as missing:
        raise InputError(f"{path}: {missing.args[0]}") from missing
    except Exception as error:  # of zip files, headers and numbers of any kind
        raise InputError(f"{path}: cannot be read as arrays: {error}") from error
    if times.ndim != 1 or not np.isfinite(times).all() or np.abs(times).max(initial=0.0) > 9e9:
        raise InputError(f"{path}: times are no times in s")
    stamps = np.round(1e9 * times).astype(np.int64)
    name = "_".join(path.relative_to(folder).with_suffix("").parts)
    provenance = SOURCE.provenance(folder, [path])
    return JointLog(name, JOINTS, stamps, *signals, provenance=provenance)
