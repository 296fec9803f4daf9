"""The robot that the rows of dynamics are about, its states, and how results are compared."""

from pathlib import Path

import numpy as np
import pybullet_data

from structlearn.rigid_body.robot import Robot, read_urdf

IIWA = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"
SEED = 7
SAMPLES = 6000


def iiwa(samples: int = SAMPLES) -> tuple[Robot, tuple[np.ndarray, ...]]:
    """The robot, and positions, velocities and accelerations (samples, n) of its joints."""
    robot = read_urdf(IIWA)
    motion = np.random.default_rng(SEED).normal(size=(3, samples, len(robot.tree.names)))
    return robot, tuple(motion)


def relative_error(found: np.ndarray, expected: np.ndarray) -> float:
    """Largest deviation, relative to the largest value expected."""
    return float(np.abs(found - expected).max() / np.abs(expected).max())
