"""Local coordinate frames for spatial generalisation (dissertation IV.6.1)."""

from typing import Literal

import numpy as np

UP = np.array([0.0, 0.0, 1.0])  # opposite of gravity in the base frame

SIDE = np.array([0.0, 1.0, 0.0])
"""Anchor of the y axis for reaches along gravity, where "closest to up" is undefined."""

STEEP_COSINE = 0.9
"""|cos| of the angle to the vertical (about 25 degrees) beyond which a reach counts as steep."""

FrameKind = Literal["up", "side", "world", "none"]
"""Definition of a local frame; `none`: of coordinates that are no point's, such as joints, in their own
axes."""


def frame_kind(displacement: np.ndarray, shortest_reach: float) -> FrameKind:
    """Definition of the local frame for a reach of displacement (3,) m, goal minus start.

    The choice is made once, from the mean displacement of the demonstrations, and stored with the primitive:
    choosing again at every unroll could switch frames between two nearly equal reaches. Returns `world` for
    reaches below `shortest_reach` (m), `side` for steep ones, else `up`, the dissertation's definition.
    """
    length = float(np.linalg.norm(displacement))
    if length < shortest_reach:
        return "world"
    return "side" if abs(displacement @ UP) > STEEP_COSINE * length else "up"


def local_frame(
    start: np.ndarray, goal: np.ndarray, kind: FrameKind = "up", up: np.ndarray = UP, side: np.ndarray = SIDE
) -> np.ndarray:
    """Rotation matrix of the local frame: its columns are the local axes in the base frame.

    x points from start to goal. `up`: z is orthogonal to x and closest to up, y = z cross x (IV.6.1).
    `side`: y is orthogonal to x and closest to `side`, z = x cross y. `world`: the base frame itself; `none`:
    the coordinates (D,) of `start` themselves, as (D, D).
    `start`, `goal` (3,) m -> (3, 3) local to base, `base = frame @ local`. Raises ValueError: start and goal
    coincide, or the reach is parallel to the anchor.
    """
    if kind in ("world", "none"):
        return np.eye(np.shape(start)[-1])
    displacement = np.asarray(goal, dtype=float) - np.asarray(start, dtype=float)
    length = np.linalg.norm(displacement)
    if length == 0.0:
        raise ValueError("start and goal coincide: a local frame needs a direction")
    x = displacement / length
    anchor = up if kind == "up" else side
    upright = anchor - (anchor @ x) * x
    if np.linalg.norm(upright) < 1e-9:
        raise ValueError(f"the reach is parallel to the '{kind}' anchor: the local frame is undefined")
    upright = upright / np.linalg.norm(upright)
    if kind == "up":
        return np.column_stack([x, np.cross(upright, x), upright])
    return np.column_stack([x, upright, np.cross(x, upright)])
