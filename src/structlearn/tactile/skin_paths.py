"""Shortest paths on a skin whose shape is known: what a servoed contact could have travelled."""

import numpy as np

from structlearn.tactile.electrodes import Skin

SEGMENTS = 16
"""Of a path; over a quarter of a circle, chords are 0.04 % too short."""

ROUNDS = 300
"""Of shortening; the longest wave of a path of 16 segments falls to 1/e in 50."""


def skin_distance(first: np.ndarray, second: np.ndarray, skin: Skin) -> np.ndarray:
    """Length of the shortest path on a skin between points of it.

    A path of points is pulled taut: every point moves to the middle of its neighbours and back to the skin.

    Args:
        first: (B, 3) m, on the skin.
        second: (B, 3) m, on the skin.
        skin: convex, as all skins here are.

    Returns:
        (B,) m.
    """
    part = np.linspace(0.0, 1.0, SEGMENTS + 1)[:, None, None]
    path = skin.project((1 - part) * first + part * second)  # (SEGMENTS + 1, B, 3)
    for _ in range(ROUNDS):
        path[1:-1] = skin.project(0.5 * (path[:-2] + path[2:]))
    return path_length(path)


def path_length(path: np.ndarray) -> np.ndarray:
    """Length (...) of paths (N, ..., 3) along their first axis."""
    return np.linalg.norm(np.diff(path, axis=0), axis=-1).sum(axis=0)
