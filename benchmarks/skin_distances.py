"""Geodesic distances between contact points on a skin, beside scipy's shortest paths on the same graph.

The points are of a fingertip, a cylinder under a half sphere. Both sides begin with them: neighbours, edges,
then the shortest paths of all pairs.
"""

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import shortest_path
from scipy.spatial import cKDTree
from timing import Case, Contender

from structlearn.tactile.geodesics import graph_distances

SEED = 3
POINTS, NEIGHBOURS = 2310, 18  # of a bin, and of each point, as in params.yaml
RADIUS_M, LENGTH_M = 0.008, 0.02
BRIDGE_M = 0.003
SAME = 1e-6  # of the longest; ours are in single precision


def fingertip() -> Case:
    """All distances of a bin of points."""
    points = _fingertip(POINTS)
    expected = _by_scipy(points)
    if not np.isfinite(expected).all():
        raise ValueError("the points lie in patches, which scipy's paths do not bridge")

    def error(found: np.ndarray) -> float:
        return float(np.abs(found - expected).max() / expected.max())

    return Case(
        work=f"geodesics, {POINTS}^2 distances on a skin",
        ours=Contender(lambda: graph_distances(points, NEIGHBOURS, BRIDGE_M), error),
        peers={"scipy shortest_path": lambda: Contender(lambda: _by_scipy(points), error)},
        tolerance=SAME,
        note=f"with the edges to {NEIGHBOURS} neighbours; scipy by Dijkstra, its choice for such a graph, "
        "whose edges are given both ways",
    )


def _fingertip(count: int) -> np.ndarray:
    """Points (N, 3) m, about as dense everywhere."""
    rng = np.random.default_rng(SEED)
    angle, height = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(-LENGTH_M, RADIUS_M, count)
    radius = np.sqrt(
        RADIUS_M**2 - np.maximum(height, 0.0) ** 2
    )  # equal heights have equal areas (Archimedes)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])


def _by_scipy(points: np.ndarray) -> np.ndarray:
    length, near = cKDTree(points).query(points, k=NEIGHBOURS + 1)
    source = np.repeat(np.arange(len(points)), NEIGHBOURS)
    graph = csr_matrix((length[:, 1:].ravel(), (source, near[:, 1:].ravel())), shape=2 * (len(points),))
    return shortest_path(graph.maximum(graph.T), method="D")  # symmetric: faster than directed=False


CASES = (fingertip,)
