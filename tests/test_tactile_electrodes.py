"""Skins: surface coordinates, projection, electrodes."""

import numpy as np
import pytest
from committed import committed
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse.csgraph import shortest_path
from scipy.spatial import cKDTree

from structlearn.core.errors import InputError
from structlearn.tactile import geodesics as graph
from structlearn.tactile.electrodes import DEPTH, SKINS, biotac, flat_pad, skin_distance, sphere
from structlearn.tactile.geodesics import Geodesics, geodesics, graph_distances
from structlearn.tactile.latent_parameters import GeodesicParameters
from structlearn.tactile.touch_dataset import contact_points

UNIT = st.floats(0.0, 1.0)


def on_range(skin, share):
    low, high = np.transpose([skin.along, skin.across])
    return low + share * (high - low)


@given(st.sampled_from(sorted(SKINS)), UNIT, UNIT)
def test_coordinates_undo_the_surface(name, along, across):
    skin = SKINS[name]
    wanted = on_range(skin, 0.98 * (0.01 + np.array([along, across])) / 1.01)
    point = skin.surface(*wanted)
    found = skin.coordinates(point)
    assert skin.holds(point)
    np.testing.assert_allclose(skin.surface(*found), point, atol=1e-9)
    np.testing.assert_allclose(found, wanted, atol=1e-8)


@given(st.sampled_from(sorted(SKINS)), UNIT, UNIT, st.floats(-0.5, 3.0))
def test_projection_is_along_the_normal(name, along, across, height):
    """A point above or below the surface comes back to where it was lifted from."""
    skin = SKINS[name]
    point = skin.surface(*on_range(skin, np.array([along, across])))
    normal = skin.normal(point)
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    np.testing.assert_allclose(skin.project(point + height * skin.radius * normal), point, atol=1e-12)


@pytest.mark.parametrize("name", sorted(SKINS))
def test_electrodes_lie_under_the_skin_and_look_outwards(name):
    skin = SKINS[name]
    surface = skin.project(skin.electrodes)
    depth = np.linalg.norm(surface - skin.electrodes, axis=1)
    assert depth == pytest.approx(DEPTH, abs=6e-4)
    assert skin.holds(surface).all()
    np.testing.assert_allclose(np.linalg.norm(skin.normals, axis=1), 1.0)
    assert ((skin.normals * skin.normal(surface)).sum(axis=1) > 0.6).all()


def test_shortest_paths_are_helices_great_circles_and_straight_lines():
    skin = biotac()
    along, across = np.array([[-0.012, -0.004], [-0.006, 0.0]]), np.array([[-0.006, 0.005], [-0.002, -0.007]])
    found = skin_distance(*(skin.surface(*ends) for ends in zip(along, across, strict=True)), skin)
    np.testing.assert_allclose(found, np.hypot(np.diff(along, axis=0), np.diff(across, axis=0))[0], rtol=2e-3)
    skin = sphere()
    first, second = skin.surface([-0.008], [0.004]), skin.surface([0.005], [-0.007])
    angle = np.arccos((first * second).sum(axis=1) / skin.radius**2)
    np.testing.assert_allclose(skin_distance(first, second, skin), skin.radius * angle, rtol=2e-3)
    skin = flat_pad()
    found = skin_distance(skin.surface([-0.015], [-0.005]), skin.surface([-0.002], [0.006]), skin)
    assert found[0] == pytest.approx(np.hypot(0.013, 0.011), rel=1e-6)


def published(signal: np.ndarray) -> np.ndarray:
    """One sample in mm, by the published formula for the BioTac with its two cases."""
    weight = np.minimum(signal, 0) ** 2
    c = (weight[:, None] * 1e3 * biotac().electrodes).sum(axis=0) / weight.sum()
    if c[0] > 0:
        return 7 * c / np.linalg.norm(c)
    return np.array([c[0], *(7 * c[1:] / np.linalg.norm(c[1:]))])


def test_agrees_with_the_published_formula():
    signals = np.random.default_rng(0).normal(size=(200, 19)) * 50
    found = 1e3 * contact_points(signals, biotac())
    assert found[:, 0].min() < 0 < found[:, 0].max()
    np.testing.assert_allclose(found, [published(signal) for signal in signals], atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda signals: signals[:, :5], "has 19 electrodes"),
        (lambda signals: np.where(np.arange(19) == 4, np.nan, signals), "row 0, electrode 5: value is nan"),
        (lambda signals: signals * [[1], [-1]], "row 1: nothing touches"),
    ],
)
def test_what_cannot_be_estimated_is_named(change, message):
    with pytest.raises(InputError, match=message):
        contact_points(change(-np.ones((2, 19))), biotac())


def spread(count: int) -> np.ndarray:
    """Points of the BioTac's skin, without its tip."""
    skin = biotac()
    low, high = np.transpose([(skin.core_low[0], skin.core_high[0]), skin.across])
    return skin.surface(*np.random.default_rng(0).uniform(low, high, (count, 2)).T)


def test_graph_distances_are_those_of_the_library():
    points = spread(300)
    length, near = cKDTree(points).query(points, k=19)
    edges = np.full((300, 300), np.inf)
    np.put_along_axis(edges, near[:, 1:], length[:, 1:], axis=1)
    expected = shortest_path(np.minimum(edges, edges.T), method="D")
    np.testing.assert_allclose(graph_distances(points, 18, 0.0), expected, rtol=1e-6)


def test_the_same_place_may_be_touched_twice():
    points = spread(300)
    points[1] = points[0]
    found = graph_distances(points, 18, 0.0)
    assert found[0, 1] < 1e-8
    np.testing.assert_allclose(found[1], found[0], atol=1e-8)


def test_patches_are_bridged_by_their_shortest_edge():
    left = np.stack([np.linspace(0, 1e-3, 30), np.zeros(30), np.zeros(30)], axis=1)
    points = np.concatenate([left + np.array([shift, 0, 0]) for shift in (0, 3e-3, 6e-3)])
    found = graph_distances(points, 4, 2.1e-3)
    np.testing.assert_allclose(found, np.abs(points[:, None, 0] - points[:, 0]), atol=1e-7)
    with pytest.raises(InputError, match="3 patches, 2 mm apart"):
        graph_distances(points, 4, 1.9e-3)


def test_bins_are_random_disjoint_and_measured_alone(tmp_path):
    points = spread(450)
    parameters = committed(GeodesicParameters, "geodesics", bin_size=200, bridge_mm=10.0)
    found = geodesics(points, parameters)
    assert found.rows.shape == (2, 200)
    assert len(np.unique(found.rows)) == 400
    np.testing.assert_array_equal(found.distance[1], graph_distances(points[found.rows[1]], 18, 0.01))
    assert geodesics(points, parameters.model_copy(update={"bins": 1})).rows.shape == (1, 200)
    assert geodesics(points[:150], parameters).rows.shape == (1, 150)

    graph.write_geodesics(found, tmp_path / "g.safetensors")
    graph.write_geodesics(geodesics(points, parameters), tmp_path / "again.safetensors")
    assert (tmp_path / "g.safetensors").read_bytes() == (tmp_path / "again.safetensors").read_bytes()
    back = graph.read_geodesics(tmp_path / "g.safetensors")
    np.testing.assert_array_equal(back.rows, found.rows)
    np.testing.assert_allclose(back.distance, found.distance, atol=0.51e-6)
    np.testing.assert_array_equal(back.distance, back.distance.transpose(0, 2, 1))


def test_what_has_no_geodesics_is_named(tmp_path):
    points = spread(50)
    with pytest.raises(InputError, match="no 18 neighbours"):
        geodesics(points[:18], committed(GeodesicParameters, "geodesics"))
    points[3, 1] = np.nan
    with pytest.raises(InputError, match="contact point 3 is not finite"):
        geodesics(points, committed(GeodesicParameters, "geodesics"))
    long = Geodesics(np.array([[0, 1]]), np.array([[[0, 0.1], [0.1, 0]]], dtype=np.float32))
    with pytest.raises(ValueError, match="16 bits"):
        graph.write_geodesics(long, tmp_path / "g.safetensors")
