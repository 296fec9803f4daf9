"""Where things are on the simulated scraping testbed, for all who move, draw or judge them.

Frames of the hand have x along the pinch, y along the scraping direction and z along the fingers. The edge
frame, whose pose is recorded and commanded, is fixed to the hand where the tool's edge is while the grasp is
unloaded: a correction turns the hand about the edge instead of dragging the edge over the board.
"""

import numpy as np

GRASP_M = 0.06  # From the hand to the grasp, the middle between the finger tips, along z
EDGE_M = 0.03  # From the grasp to the tool's edge, along z
EDGE_WIDTH_M = 0.011  # Of the edge, along x
CONTACT_M = np.array([0.630, -0.030, 0.100])
"""Where the edge meets the board, on the board's axis of tilt, base frame."""

FLAT_ORIENTATION = np.array([0.0, 0.0, 1.0, 0.0])
"""w, x, y, z of the edge frame when the tool lies flat on the board at 0 degrees: fingers down, half a turn
about base y."""

ROLL_AXIS = np.array([0.0, 1.0, 0.0])
"""The scraping direction, base frame: the board tilts about it and feedback models correct about it."""
