"""Public logs of a Franka Emika Panda on exciting trajectories.

Files of the repository marcocognetti/FrankaEmikaPandaDynModel (C. Gaz et al., "Dynamic identification of the
Franka Emika Panda robot with retrieval of feasible parameters using penalty-based optimization", RA-L 2019).
Torques are link-side, including gravity.
"""

from functools import partial
from pathlib import Path
from typing import Any

from structlearn.core.errors import InputError
from structlearn.readers.foreign_tables import (
    LeftOut,
    PublicSet,
    read_each,
    read_stamped_table,
    read_text_table,
)
from structlearn.readers.joint_log import JointLog

SOURCE = PublicSet(
    "https://github.com/marcocognetti/FrankaEmikaPandaDynModel",
    "24d85ce4e648e2e894c832bfeee9b16711eb1a1a",
    "GPL-3.0",
)
JOINTS = tuple(f"panda_joint{number}" for number in range(1, 8))  # as in the arm's URDF
SIGNALS = {
    "positions": "positions",
    "velocities": "velocity",
    "torques": "torques",
}  # last word of their file names


def read_motion(folder: Path, entry: Any = None, left_out: LeftOut = None) -> list[JointLog]:
    """All motions NAME_{positions,velocity,torques,time}.txt of a folder or of its subfolders.

    The repository's motion, `exciting_traj`, has 21 s at about 1 kHz; positions have five or six significant
    digits. Names of folders are prefixed to those of their motions.
    """
    found = SOURCE.files(folder, "*_positions.txt", "motion (exciting_traj_positions.txt, ...)")
    return read_each(partial(_read, folder), found, left_out)


def _read(folder: Path, positions: Path) -> JointLog:
    name = positions.name.removesuffix("_positions.txt")
    paths = {signal: positions.with_name(f"{name}_{word}.txt") for signal, word in SIGNALS.items()}
    times = positions.with_name(f"{name}_time.txt")
    stamps, _ = read_stamped_table(times, 1)
    signals = {}
    for signal, path in paths.items():
        values = read_text_table(path, 1)
        if values.size != len(stamps) * len(JOINTS):
            raise InputError(
                f"{path}: has {values.size} numbers, expected {len(JOINTS)} for each of the {len(stamps)} "
                f"times in {times.name}"
            )
        signals[signal] = values.reshape(len(stamps), len(JOINTS))
    provenance = SOURCE.provenance(folder, [times, *paths.values()])
    whole_name = "_".join([*times.parent.relative_to(folder).parts, name])
    return JointLog(whole_name, JOINTS, stamps, **signals, provenance=provenance)
