"""The box that a skill was demonstrated in: starts and goals outside it are none that it has learned."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from structlearn.ground.errors import InputError


@dataclass(frozen=True)
class Workspace:
    """A box along the axes of the base frame.

    Attributes:
        low: (3,) m.
        high: (3,) m.

    Raises:
        InputError: the corners are no finite points, or the wrong way round.
    """

    low: np.ndarray
    high: np.ndarray

    def __post_init__(self) -> None:
        corners = np.array([self.low, self.high], dtype=float)
        if corners.shape != (2, 3) or not np.isfinite(corners).all() or not (corners[0] < corners[1]).all():
            raise InputError(f"a workspace needs a low and a high corner, has {self.low} and {self.high}")

    def require(self, point: np.ndarray, what: str) -> None:
        """Refuse a point (3,) that is outside.

        Raises:
            InputError: it is; the message names every such axis, and by how much.
        """
        beyond = np.maximum(self.low - point, point - self.high)
        faults = [
            f"{axis} = {value:.4g} m is {excess:.3g} m {'below' if value < low else 'above'} "
            f"[{low:.4g}, {high:.4g}]"
            for axis, value, excess, low, high in zip("xyz", point, beyond, self.low, self.high, strict=True)
            if excess > 0.0
        ]
        if faults:
            raise InputError(f"{what} is outside the workspace of the skill: {'; '.join(faults)}")


def demonstrated_workspace(paths: Iterable[np.ndarray], margin_m: float) -> Workspace:
    """The smallest box around demonstrated paths, and a margin.

    Args:
        paths: (T, 3) m each, from start to end.
        margin_m: added on every side.
    """
    points = np.concatenate(list(paths))
    return Workspace(points.min(axis=0) - margin_m, points.max(axis=0) + margin_m)
