"""A simulated arm of two joints that writes characters, published with deep Lagrangian networks.

`characters.npz` contains the arrays of `data/character_data.pickle` of the repository
milutter/deep_lagrangian_networks (M. Lutter, C. Ritter, J. Peters, "Deep Lagrangian Networks", ICLR 2019) as
`CHARACTER/ARRAY`. The arm's lengths and masses are not stated.
"""

from pathlib import Path
from typing import Any

from structlearn.core.errors import InputError
from structlearn.readers.foreign_tables import LeftOut, PublicSet, read_arrays, stamps_of
from structlearn.readers.joint_log import PartedLog, signals_of

SOURCE = PublicSet("https://github.com/milutter/deep_lagrangian_networks", "not stated", "MIT")
ARRAYS = {  # array of each signal
    "positions": "qp",
    "velocities": "qv",
    "torques": "tau",
    "accelerations": "qa",
    "inertial": "m",
    "coriolis": "c",
    "gravity": "g",
}


def read_parts(folder: Path, entry: Any = None, left_out: LeftOut = None) -> list[PartedLog]:
    """One log per character, 25 Hz, in alphabetical order."""
    path, *_ = SOURCE.files(folder, "characters.npz", "characters.npz")
    arrays = read_arrays(path)
    provenance = SOURCE.provenance(folder, [path]) | {"origin": "simulated"}
    names = [ARRAYS[signal] for signal in signals_of(PartedLog)]
    logs = []
    for character in sorted({name.partition("/")[0] for name in arrays}):
        if missing := [name for name in ("t", *names) if f"{character}/{name}" not in arrays]:
            raise InputError(f"{path}: has no array {character}/{missing[0]}")
        times, *signals = (arrays[f"{character}/{name}"] for name in ("t", *names))
        joints = tuple(f"joint_{number}" for number in range(1, signals[0].shape[-1] + 1))
        stamps = stamps_of(path, times)
        logs.append(PartedLog(character, joints, stamps, *signals, provenance=provenance))
    return logs
