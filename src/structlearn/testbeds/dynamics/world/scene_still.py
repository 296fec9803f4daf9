"""A still of the arm on its sines, for the page."""

import numpy as np

from structlearn.rigid_body.tree import KinematicTree
from structlearn.simulation.still import View, still
from structlearn.testbeds.dynamics.world.arm_motion import SineParameters, sine_path

VIEW = View(target=(0.0, 0.0, 0.6), distance=2.45, yaw_deg=50.0, pitch_deg=-16.0)

SHOWN_AT = (0.708, 0.146, 0.925)
"""Moments of the motion, as shares of it, at which all joints are bent."""

COLUMNS = slice(235, 785)
"""Pixels across that are kept of each: the arm, and little beside it."""


def arm_still(urdf: str, tree: KinematicTree, motion: SineParameters) -> np.ndarray:
    """(H, W, 3) bytes: the arm of a URDF in poses of its sine motion, beside each other."""
    path = sine_path(tree, motion).q
    poses = (path[int(share * len(path))] for share in SHOWN_AT)
    return np.hstack([still(VIEW, urdf=urdf, angles=pose)[:, COLUMNS] for pose in poses])
