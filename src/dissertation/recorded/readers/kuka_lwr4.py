"""Public logs of a KUKA LWR4+ on exciting trajectories, and its URDF.

Files `data/KUKA/HW/measurements_{1,2}.npz` and `model/kuka_lwr4.urdf` of the repository kjyv/FloBaRoID, which
identifies robots. Torques are those of joint sensors.
"""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from structlearn.core.errors import InputError
from structlearn.readers.foreign_tables import LeftOut, PublicSet, read_arrays, read_each, stamps_of
from structlearn.readers.joint_log import JointLog, signals_of

SOURCE = PublicSet(
    "https://github.com/kjyv/FloBaRoID", "e6c077ea5c09bceb49840f49e83450bb5979029b", "LGPL-3.0"
)
JOINTS = tuple(f"lwr_{number}_joint" for number in range(7))  # as in the arm's URDF


def read_motion(folder: Path, entry: Any = None, left_out: LeftOut = None) -> list[JointLog]:
    """All logs `measurements_*.npz` of a folder, or of folders there, about 200 Hz and uneven.

    Only their first `entry.part` seconds, if given: the published motion repeats itself after 4 pi s.
    """
    found = SOURCE.files(folder, "measurements_*.npz", "logs (measurements_1.npz, ...)")
    logs = read_each(partial(_read, folder), found, left_out)
    return [_start(log, entry.part) for log in logs] if entry is not None and entry.part else logs


def _read(folder: Path, path: Path) -> JointLog:
    arrays = read_arrays(path)
    names = ("times", *signals_of(JointLog))
    if missing := [name for name in names if name not in arrays]:
        raise InputError(f"{path}: has no array {missing[0]}")
    times, *signals = (arrays[name] for name in names)
    name = "_".join(path.relative_to(folder).with_suffix("").parts)
    provenance = SOURCE.provenance(folder, [path])
    return JointLog(name, JOINTS, stamps_of(path, times), *signals, provenance=provenance)


def _start(log: JointLog, seconds: float) -> JointLog:
    kept = log.stamps <= log.stamps[0] + 1e9 * seconds
    signals = {name: getattr(log, name)[kept] for name in signals_of(JointLog)}
    return replace(log, stamps=log.stamps[kept], **signals)
