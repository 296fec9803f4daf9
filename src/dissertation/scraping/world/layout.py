"""Layout of the simulated scraping testbed, shared by simulation, scores and drawings.

Frames of the hand have x along the pinch, y along the scraping direction and z along the fingers. The edge
frame, whose pose is recorded and commanded, is fixed to the hand at the place of the tool's edge in an
unloaded grasp: a correction turns the hand about the edge instead of dragging the edge over the board.
"""

import numpy as np

from structlearn.core import quaternion
from structlearn.readers.demonstration import Demonstration

GRASP_M = 0.06  # from the hand to the grasp, midway between the finger tips, along z
EDGE_M = 0.03  # from the grasp to the tool's edge, along z
EDGE_WIDTH_M = 0.011  # of the edge, along x
CONTACT_M = np.array([0.630, -0.030, 0.100])
"""Contact point of edge and board in the base frame, on the board's tilt axis."""

FLAT_ORIENTATION = np.array([0.0, 0.0, 1.0, 0.0])
"""Orientation (w, x, y, z) of the edge frame with the tool flat on a level board: fingers down, half a turn
about base y."""

ROLL_AXIS = np.array([0.0, 1.0, 0.0])
"""Scraping direction in the base frame: axis of the board's tilt and of the feedback's corrections."""


def board_orientation(board_deg: float) -> np.ndarray:
    """Orientation (4,) of a board with this roll, base frame."""
    return quaternion.from_rotation_vector(np.radians(board_deg) * ROLL_AXIS)


def tool_orientation(run: Demonstration, board_deg: float) -> np.ndarray:
    """Orientation (T, 4) of the tool in a run on a board with this roll, base frame."""
    turned = quaternion.product(board_orientation(board_deg), run.signal("tool_to_board"))
    return quaternion.product(turned, FLAT_ORIENTATION)


def grasp_place(run: Demonstration) -> np.ndarray:
    """Grasp position (T, 3) m, midway between the finger tips, base frame."""
    down = quaternion.rotate(run.signal("orientation"), np.array([0.0, 0.0, 1.0]))
    return run.position - EDGE_M * down


def hand_roll_deg(run: Demonstration, axis: np.ndarray = ROLL_AXIS) -> np.ndarray:
    """Roll (T,) of the hand about an axis (3,) of the base frame; 0: the tool is flat on a level board."""
    return np.degrees(quaternion.difference(run.signal("orientation"), FLAT_ORIENTATION) @ axis)


def tool_roll_deg(run: Demonstration, axis: np.ndarray = ROLL_AXIS) -> np.ndarray:
    """Roll (T,) of the tool relative to the board about an axis (3,); 0: flat."""
    return np.degrees(quaternion.rotation_vector(run.signal("tool_to_board")) @ axis)
