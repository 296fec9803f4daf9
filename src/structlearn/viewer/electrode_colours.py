"""Colours of electrodes in recordings: how far off each one reads."""

import numpy as np

from structlearn.palette import ORANGE, SKY
from structlearn.viewer.rrd import blended

RESTING = "#565d66"
"""Colour of an electrode that reads as expected."""


def deviation_colours(deviation: np.ndarray, scale: float) -> np.ndarray:
    """Colours 0xRRGGBBAA of deviations, (...) -> (...): blue below the expected reading, orange above."""
    return blended(0.5 + 0.5 * deviation / scale, (SKY, RESTING, ORANGE))
