"""Geodesic distances on a skin, from contact points alone (II.3.3, eq. II.3).

Nearest neighbours among the contact points are joined by straight edges, and the distance of two points is
the length of the shortest path over edges; nothing is assumed about the skin's shape. A matrix for all
samples would be too large, so they are split into random bins, each with its own matrix.

All pairs are needed and edges are short, so points are eliminated one by one along the skin. Eliminating a
point adds edges between its roughly one hundred neighbours ahead, as long as the path through it, and its row
of distances is the minimum over the neighbours' rows, each shifted by an edge. Dijkstra's algorithm takes
more than twice as long (`benchmarks/run.py --only geodesics`).
"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from structlearn.core.artefacts import read_tensors, write_tensors
from structlearn.core.compilation import numba
from structlearn.core.errors import InputError, MissingInputError
from structlearn.core.parallel import parallel_map
from structlearn.tactile.latent_parameters import GeodesicParameters

FILE_UNIT = 1e-6  # m per unit of a file: 16 bits hold 65 mm, in half the space of float32
SHORTEST_EDGE = 1e-9  # m, between coincident samples: zero means no edge in a sparse matrix


@dataclass(frozen=True)
class Geodesics:
    """Distances within P random bins of N' samples."""

    rows: np.ndarray  # (P, N') rows of the dataset
    distance: np.ndarray  # (P, N', N') float32 m, symmetric, zero on the diagonal


def geodesics(points: np.ndarray, parameters: GeodesicParameters) -> Geodesics:
    """Distances between contact points (N, 3) m, in random bins; too few points make one smaller bin.

    Raises InputError: a point is NaN or infinite. Raises MissingInputError: a bin has no more points than
    `neighbours`, or its patches are farther apart than `bridge_mm`.
    """
    if not np.isfinite(points).all():
        raise InputError(f"touch: contact point {np.argwhere(~np.isfinite(points))[0][0]} is not finite")
    size = min(parameters.bin_size, len(points))
    if size <= parameters.neighbours:
        raise MissingInputError(f"touch: {size} points in a bin have no {parameters.neighbours} neighbours")
    count = len(points) // size if parameters.bins is None else min(parameters.bins, len(points) // size)
    rows = np.random.default_rng(parameters.seed).permutation(len(points))[: count * size].reshape(count, -1)
    measure = partial(graph_distances, neighbours=parameters.neighbours, bridge=1e-3 * parameters.bridge_mm)
    distance = parallel_map(measure, list(points[rows].astype(float)), "geodesics")
    return Geodesics(rows, np.stack(distance))


def graph_distances(points: np.ndarray, neighbours: int, bridge: float) -> np.ndarray:
    """Lengths (N, N) float32 m of the shortest paths over edges between points (N, 3) m.

    An edge joins two points if either is among the `neighbours` nearest of the other. Unconnected patches are
    joined by their shortest edge; raises MissingInputError if it is longer than `bridge`, m.
    """
    length, near = cKDTree(points).query(points, k=neighbours + 1)
    source = np.repeat(np.arange(len(points)), neighbours)
    edges = (np.maximum(length[:, 1:].ravel(), SHORTEST_EDGE), (source, near[:, 1:].ravel()))
    graph = csr_matrix(edges, shape=(len(points), len(points)))
    graph = _bridged(graph.maximum(graph.T), points, bridge)
    _, axes = np.linalg.eigh(np.cov(points.T))
    order = np.argsort(points @ axes[:, -1], kind="stable")  # along the skin: each point has few ahead
    distance = np.full(graph.shape, np.inf)
    edge, place = graph.tocoo(), np.argsort(order, kind="stable")
    distance[place[edge.row], place[edge.col]] = edge.data
    np.fill_diagonal(distance, 0.0)
    _shorten(distance)
    return distance[np.ix_(place, place)].astype(np.float32)


def write_geodesics(geodesics: Geodesics, path: str | Path) -> None:
    """Publish upper triangles in whole micrometres. Raises ValueError: a distance does not fit."""
    upper = _upper(geodesics.rows.shape[1])
    packed = np.empty((len(geodesics.rows), upper.sum()), dtype=np.uint16)
    for place, matrix in enumerate(geodesics.distance):
        units = np.rint(matrix[upper] / FILE_UNIT)
        if units.max() > np.iinfo(np.uint16).max:
            raise ValueError(f"a geodesic of {matrix.max():g} m does not fit the file's 16 bits")
        packed[place] = units
    tensors = {"rows": geodesics.rows.astype(np.int32), "upper_um": packed}
    write_tensors(tensors, path, "geodesics of structlearn.tactile.geodesics: rows, upper triangles in um")


def read_geodesics(path: str | Path) -> Geodesics:
    """Read distances. Raises InputError: the file is missing, damaged or another file."""
    tensors = read_tensors(path)
    if set(tensors) != {"rows", "upper_um"}:
        raise InputError(f"{path}: holds no geodesics")
    rows = tensors["rows"].astype(np.int64)
    upper = _upper(rows.shape[1])
    distance = np.zeros((*rows.shape, rows.shape[1]), dtype=np.float32)
    for matrix, packed in zip(distance, tensors["upper_um"], strict=True):
        matrix[upper] = packed * np.float32(FILE_UNIT)
        matrix += matrix.T
    return Geodesics(rows, distance)


def _bridged(graph: csr_matrix, points: np.ndarray, bridge: float) -> csr_matrix:
    """The graph with its patches joined, starting with the one nearest to the first patch."""
    graph = graph.tolil()
    count, label = connected_components(graph, directed=False)
    while count > 1:
        inside = np.flatnonzero(label == label[0])
        outside = np.flatnonzero(label != label[0])
        gap, nearest = cKDTree(points[inside]).query(points[outside])
        place = int(np.argmin(gap))
        if gap[place] > bridge:
            raise MissingInputError(
                f"touch: contact points lie in {count} patches, {1e3 * gap[place]:.3g} mm apart and more; "
                f"record touches between them, or take more neighbours or a longer bridge"
            )
        here, there = outside[place], inside[nearest[place]]
        graph[here, there] = graph[there, here] = max(gap[place], SHORTEST_EDGE)
        count, label = connected_components(graph, directed=False)
    return graph.tocsr()


def _upper(size: int) -> np.ndarray:
    """Mask (size, size) above the diagonal; indices would take sixteen times the memory."""
    return np.triu(np.ones((size, size), dtype=bool), k=1)


@numba.njit(cache=True)
def _shorten(distance: np.ndarray) -> None:
    """Turn edge lengths (N, N), symmetric, inf without an edge, into lengths of shortest paths, in place."""
    count = len(distance)
    ahead, shortest = np.empty(count, dtype=np.int64), np.empty(count)
    for point in range(count):
        neighbours = _ahead(distance[point], point, ahead)
        for i in range(neighbours):
            edge, row = distance[point, ahead[i]], distance[ahead[i]]
            for j in range(neighbours):
                over = edge + distance[point, ahead[j]]
                row[ahead[j]] = min(row[ahead[j]], over)
    for point in range(count - 1, -1, -1):  # all distances between later points are known
        shortest[:] = np.inf
        for i in range(_ahead(distance[point], point, ahead)):
            edge, row = distance[point, ahead[i]], distance[ahead[i]]
            for other in range(point + 1, count):
                over = edge + row[other]
                shortest[other] = over if over < shortest[other] else shortest[other]
        for other in range(point + 1, count):
            distance[point, other] = distance[other, point] = shortest[other]


@numba.njit(cache=True)
def _ahead(edges: np.ndarray, point: int, places: np.ndarray) -> int:
    """Write the later points that a point has edges to (N,); return their number."""
    count = 0
    for other in range(point + 1, len(edges)):
        if edges[other] < np.inf:
            places[count] = other
            count += 1
    return count
