"""A latent map laid onto the skin: its loss knows distances only, so it may lie in any direction."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class MapLaying:
    """A turn, maybe with a mirror image, and a shift in the plane; distances stay."""

    centre: np.ndarray  # (2,) of the map
    turn: np.ndarray  # (2, 2) orthogonal
    place: np.ndarray  # (2,) where the centre comes to lie

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 2) of the map, laid down."""
        return (points - self.centre) @ self.turn + self.place


def map_laying(points: np.ndarray, places: np.ndarray) -> MapLaying:
    """The laying with the least squared distances (orthogonal Procrustes).

    `points` (N, 2) of the map, in the unit of the places; `places` (N, 2) where they should lie, e.g. surface
    coordinates.
    """
    centre, place = points.mean(axis=0), places.mean(axis=0)
    left, _, right = np.linalg.svd((points - centre).T @ (places - place))
    return MapLaying(centre, left @ right, place)
