"""A picture of the simulated finger on the handle, for the page."""

from dataclasses import replace

import numpy as np

from structlearn.core import quaternion
from structlearn.simulation.still import Sheet, Solid, View, still
from structlearn.tactile.electrodes import Skin

SCALE = 10.0  # drawn so many times larger: the camera sees nothing that is nearer than 5 cm

SKIN, ELECTRODE, HANDLE = (0.45, 0.49, 0.55, 1.0), (0.9, 0.62, 0.0, 1.0), (0.8, 0.72, 0.6, 1.0)
"""Red, green, blue, opacity."""

ELECTRODE_M = 0.0006  # radius of the mark on the skin over an electrode
HANDLE_M = 0.04  # length of the handle that is drawn, without its round ends
ALONG_M = -0.006  # where along the finger it touches the handle
ACROSS = np.array([0.0, 0.0, 0.5 * np.pi])  # how the handle is turned from the finger

VIEW = View(target=(0.0, 0.0, 0.06), distance=0.66, yaw_deg=35.0, pitch_deg=-8.0)


def scene_still(skin: Skin, handle_radius: float) -> np.ndarray:
    """Draw a finger that lies across the handle, with its skin all round.

    `handle_radius`: m. Returns (H, W, 3) bytes.
    """
    touched = skin.surface(ALONG_M, 0.0)
    over = -touched - handle_radius * skin.normal(touched)  # origin of the finger in the frame of the handle
    half = np.array([0.5 * HANDLE_M, 0.0, 0.0])
    bar = replace(skin, core_low=-half, core_high=half, radius=handle_radius)
    marks = [
        Solid("sphere", (SCALE * ELECTRODE_M,), SCALE * (over + place), colour=ELECTRODE)
        for place in skin.project(skin.electrodes)
    ]
    sheets = [_all_round(skin, over, np.zeros(3), SKIN), _all_round(bar, np.zeros(3), ACROSS, HANDLE)]
    return still(VIEW, marks, sheets=sheets)


def _all_round(skin: Skin, position: np.ndarray, turned: np.ndarray, colour: tuple[float, ...]) -> Sheet:
    """The surface round the whole core, which is closed at both ends, turned by a rotation vector."""
    orientation = quaternion.from_rotation_vector(turned)
    turn = 0.5 * np.pi * skin.radius
    along, across = np.meshgrid(
        np.linspace(skin.core_low[0] - turn, skin.core_high[0] + turn, 121),
        np.linspace(2 * turn, -2 * turn, 91),
        indexing="ij",
    )
    points = skin.surface(along, across)
    normals = quaternion.rotate(orientation, skin.normal(points))
    return Sheet(SCALE * (position + quaternion.rotate(orientation, points)), normals, colour)
