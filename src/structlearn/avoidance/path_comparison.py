"""Two ways through one scene: how far they are from each other, and whether they take the same gaps."""

from collections.abc import Sequence

import numpy as np


def nearest_path_distance(first: np.ndarray, second: np.ndarray) -> float:
    """Symmetric mean distance of two paths, whatever the times at which they are where they are.

    Args:
        first: (T, D) m.
        second: (S, D) m.

    Returns:
        m: mean distance of the points of one to the nearest of the other, averaged over both directions.
    """
    distances = np.linalg.norm(first[:, None] - second[None], axis=-1)
    return float(0.5 * (distances.min(axis=0).mean() + distances.min(axis=1).mean()))


def same_gaps(first: np.ndarray, second: np.ndarray, centres: Sequence[np.ndarray]) -> bool:
    """Whether two paths in a plane pass every obstacle on the same side.

    They do if the closed curve there along one and back along the other winds round none of the centres: then
    one can be moved into the other without crossing any.

    Args:
        first: (T, 2) m.
        second: (S, 2) m, from about the same start to about the same goal.
        centres: (O, 2) m.
    """
    loop = np.vstack([first, second[::-1], first[:1]])
    return not any(_winding(loop - centre) for centre in centres)


def _winding(loop: np.ndarray) -> int:
    """How often a closed curve (T, 2) winds round the origin."""
    angle = np.arctan2(loop[:, 1], loop[:, 0])
    turns = (np.diff(angle) + np.pi) % (2.0 * np.pi) - np.pi
    return round(float(turns.sum()) / (2.0 * np.pi))
