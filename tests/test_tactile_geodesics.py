"""Geodesics from points alone, against closed forms."""

import numpy as np
import pytest
from committed import committed
from scipy.sparse.csgraph import shortest_path
from scipy.spatial import cKDTree

from structlearn.ground.errors import InputError
from structlearn.tactile.electrodes import SKINS
from structlearn.tactile.geodesics import (
    Geodesics,
    geodesics,
    graph_distances,
    read_geodesics,
    write_geodesics,
)
from structlearn.tactile.latent_parameters import GeodesicParameters


def spread(name: str, count: int = 900, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Surface coordinates (count, 2) and points of a skin, without the tip of the BioTac, the pad's rim."""
    skin = SKINS[name]
    low, high = np.array(skin.core_low[:2]), np.array(skin.core_high[:2])
    if name != "flat_pad":
        low[1], high[1] = skin.across
    if name == "sphere":
        low[0], high[0] = skin.along
    coordinates = np.random.default_rng(seed).uniform(low, high, (count, 2))
    return coordinates, skin.surface(*coordinates.T)


@pytest.mark.parametrize("name", sorted(SKINS))
def test_graph_distances_approach_the_closed_form(name):
    """Plane and unrolled cylinder: straight lines; sphere: great circles. Graphs go round a little."""
    coordinates, points = spread(name)
    found = graph_distances(points, 18, 0.0)
    if name == "sphere":
        radius = SKINS[name].radius
        true = radius * np.arccos(np.clip(points @ points.T / radius**2, -1, 1))
    else:
        true = np.linalg.norm(coordinates[:, None] - coordinates, axis=2)
    far = true > 2e-3
    ratio = found[far] / true[far]
    assert np.median(ratio) < 1.04
    assert np.quantile(ratio, 0.99) < 1.12
    assert ratio.min() > 0.98  # chords cut through, paths do not


@pytest.mark.parametrize("name", sorted(SKINS))
def test_graph_distances_are_those_of_the_library(name):
    _, points = spread(name, 300)
    length, near = cKDTree(points).query(points, k=19)
    edges = np.full((300, 300), np.inf)
    np.put_along_axis(edges, near[:, 1:], length[:, 1:], axis=1)
    expected = shortest_path(np.minimum(edges, edges.T), method="D")
    np.testing.assert_allclose(graph_distances(points, 18, 0.0), expected, rtol=1e-6)


def test_distances_are_a_metric():
    _, points = spread("biotac", 300)
    points[1] = points[0]  # the same place twice
    found = graph_distances(points, 18, 0.0).astype(float)
    np.testing.assert_array_equal(found, found.T)
    assert found[0, 1] < 1e-8
    assert (np.diag(found) == 0).all()
    for through in range(0, 300, 30):
        assert (found <= found[:, [through]] + found[[through]] + 1e-8).all()


def test_patches_are_bridged_by_their_shortest_edge():
    left = np.stack([np.linspace(0, 1e-3, 30), np.zeros(30), np.zeros(30)], axis=1)
    points = np.concatenate([left + np.array([shift, 0, 0]) for shift in (0, 3e-3, 6e-3)])
    found = graph_distances(points, 4, 2.1e-3)
    np.testing.assert_allclose(found, np.abs(points[:, None, 0] - points[:, 0]), atol=1e-7)
    with pytest.raises(InputError, match="3 patches, 2 mm apart"):
        graph_distances(points, 4, 1.9e-3)


def test_bins_are_random_disjoint_and_measured_alone(tmp_path):
    _, points = spread("biotac", 450)
    parameters = committed(GeodesicParameters, "geodesics", bin_size=200, bridge_mm=10.0)
    found = geodesics(points, parameters)
    assert found.rows.shape == (2, 200)
    assert len(np.unique(found.rows)) == 400
    np.testing.assert_array_equal(found.distance[1], graph_distances(points[found.rows[1]], 18, 0.01))
    assert geodesics(points, parameters.model_copy(update={"bins": 1})).rows.shape == (1, 200)
    assert geodesics(points[:150], parameters).rows.shape == (1, 150)

    write_geodesics(found, tmp_path / "g.safetensors")
    write_geodesics(geodesics(points, parameters), tmp_path / "again.safetensors")
    assert (tmp_path / "g.safetensors").read_bytes() == (tmp_path / "again.safetensors").read_bytes()
    back = read_geodesics(tmp_path / "g.safetensors")
    np.testing.assert_array_equal(back.rows, found.rows)
    np.testing.assert_allclose(back.distance, found.distance, atol=0.51e-6)
    np.testing.assert_array_equal(back.distance, back.distance.transpose(0, 2, 1))


def test_what_has_no_geodesics_is_named(tmp_path):
    _, points = spread("biotac", 50)
    with pytest.raises(InputError, match="no 18 neighbours"):
        geodesics(points[:18], committed(GeodesicParameters, "geodesics"))
    points[3, 1] = np.nan
    with pytest.raises(InputError, match="contact point 3 is not finite"):
        geodesics(points, committed(GeodesicParameters, "geodesics"))
    long = Geodesics(np.array([[0, 1]]), np.array([[[0, 0.1], [0.1, 0]]], dtype=np.float32))
    with pytest.raises(ValueError, match="16 bits"):
        write_geodesics(long, tmp_path / "g.safetensors")
