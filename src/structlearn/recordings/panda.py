"""Public log of a Franka Emika Panda on an exciting trajectory.

Files of the repository marcocognetti/FrankaEmikaPandaDynModel (C. Gaz et al., "Dynamic identification of the
Franka Emika Panda robot with retrieval of feasible parameters using penalty-based optimization", RA-L 2019).
Torques are those of the links, gravity included.
"""

from pathlib import Path

import numpy as np

from structlearn.ground.errors import InputError
from structlearn.recordings.joint_log import JointLog
from structlearn.recordings.text_log import read_stamped_table, read_table, source_provenance

REPOSITORY = "https://github.com/marcocognetti/FrankaEmikaPandaDynModel"
COMMIT = "24d85ce4e648e2e894c832bfeee9b16711eb1a1a"
LICENCE = "GPL-3.0"

JOINTS = tuple(f"panda_joint{number}" for number in range(1, 8))
"""Names in the arm's URDF."""

FILES = {"positions": "positions", "velocities": "velocity", "torques": "torques"}
"""Signals and the last word of their files' names."""


def read_exciting_trajectory(folder: str | Path) -> JointLog:
    """Read the 21 s of motion at about 1 kHz.

    The logger wrote positions in five or six significant digits and its times by hundredths of a millisecond;
    nothing is done about either here.

    Args:
        folder: holds exciting_traj_{positions,velocity,torques,time}.txt.

    Returns:
        The log, named `exciting_trajectory`.

    Raises:
        InputError: a file is missing, no table of numbers or not of the length that the times ask for.
    """
    folder = Path(folder)
    paths = {signal: folder / f"exciting_traj_{word}.txt" for signal, word in FILES.items()}
    times = folder / "exciting_traj_time.txt"
    stamps, _ = read_stamped_table(times, 1)
    signals = {}
    for signal, path in paths.items():
        values = read_table(path, 1)
        if values.size != len(stamps) * len(JOINTS):
            raise InputError(
                f"{path}: has {values.size} numbers, expected {len(JOINTS)} for each of the {len(stamps)} "
                f"times in {times.name}"
            )
        signals[signal] = values.reshape(len(stamps), len(JOINTS))
    provenance = source_provenance(REPOSITORY, COMMIT, LICENCE, folder, [times, *paths.values()])
    return JointLog("exciting_trajectory", JOINTS, np.asarray(stamps), **signals, provenance=provenance)
