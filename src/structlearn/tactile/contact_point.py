"""Point of contact on a skin, estimated from its electrodes (Lin et al. 2013, II.3.3)."""

import numpy as np

from structlearn.ground.errors import InputError
from structlearn.tactile.electrodes import Skin


def contact_points(signals: np.ndarray, skin: Skin) -> np.ndarray:
    """Centroid of the electrodes by their squared negative changes, projected to the skin.

    Only electrodes whose counts fell take part: there the fluid is thinned; where it bulges counts rise.

    Args:
        signals: (N, E) counts less their offset.
        skin: with the E electrodes.

    Returns:
        (N, 3) m, frame of the finger.

    Raises:
        InputError: the number of channels is not that of the electrodes, a value is NaN or infinite, or no
            electrode of a row fell, so that nothing touches; the message names the row, from 0.
    """
    if signals.ndim != 2 or signals.shape[1] != len(skin.electrodes):
        raise InputError(
            f"touch: signals have shape {signals.shape}, the skin '{skin.name}' has "
            f"{len(skin.electrodes)} electrodes"
        )
    if not np.isfinite(signals).all():
        row, column = np.argwhere(~np.isfinite(signals))[0]
        raise InputError(f"touch: row {row}, electrode {column + 1}: value is {signals[row, column]}")
    weight = np.minimum(signals, 0.0) ** 2
    total = weight.sum(axis=1)
    if not (total > 0).all():
        raise InputError(f"touch: row {np.argmin(total > 0)}: nothing touches, no electrode's counts fell")
    return skin.project(weight @ skin.electrodes / total[:, None])
