"""Geometry of the simulated scraping testbed, for modules that move, draw or evaluate it.

Frames of the hand have x along the pinch, y along the scraping direction and z along the fingers. The edge
frame, whose pose is recorded and commanded, is fixed to the hand at the tool's edge while the grasp is
unloaded: a correction rotates the hand about the edge instead of dragging the edge over the board.
"""

import numpy as np

from structlearn.core import quaternion
from structlearn.readers.demonstration import Demonstration

GRASP_M = 0.06  # from the hand to the grasp, the middle between the fingertips, along z
EDGE_M = 0.03  # from the grasp to the tool's edge, along z
EDGE_WIDTH_M = 0.011  # of the edge, along x
CONTACT_M = np.array([0.630, -0.030, 0.100])
"""Contact of edge and board, on the board's axis of tilt, base frame."""

FLAT_ORIENTATION = np.array([0.0, 0.0, 1.0, 0.0])
"""w, x, y, z of the edge frame when the tool lies flat on the board at 0 degrees: fingers down, half a turn
about base y."""

ROLL_AXIS = np.array([0.0, 1.0, 0.0])
"""The scraping direction, base frame: the board tilts about it and feedback models correct about it."""


def board_orientation(board_deg: float) -> np.ndarray:
    """Orientation (4,) of a board with this roll, base frame."""
    return quaternion.from_rotation_vector(np.radians(board_deg) * ROLL_AXIS)


def tool_orientation(run: Demonstration, board_deg: float) -> np.ndarray:
    """Orientation (T, 4) of the tool in a run on a board with this roll, base frame."""
    turned = quaternion.product(board_orientation(board_deg), run.signal("tool_to_board"))
    return quaternion.product(turned, FLAT_ORIENTATION)


def grasp_place(run: Demonstration) -> np.ndarray:
    """Position (T, 3) m of the grasp, the middle between the fingertips, base frame."""
    down = quaternion.rotate(run.signal("orientation"), np.array([0.0, 0.0, 1.0]))
    return run.position - EDGE_M * down


def hand_roll_deg(run: Demonstration, axis: np.ndarray = ROLL_AXIS) -> np.ndarray:
    """Roll of the hand about an axis (3,) of the base frame, (T,); 0: the tool is flat on a level board."""
    return np.degrees(quaternion.difference(run.signal("orientation"), FLAT_ORIENTATION) @ axis)


def tool_roll_deg(run: Demonstration, axis: np.ndarray = ROLL_AXIS) -> np.ndarray:
    """Roll of the tool relative to the board about an axis (3,), (T,); 0 if flat."""
    return np.degrees(quaternion.rotation_vector(run.signal("tool_to_board")) @ axis)
