"""Skins: surface coordinates, projection, electrodes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from structlearn.tactile.electrodes import DEPTH, SKINS, biotac, flat_pad

UNIT = st.floats(0.0, 1.0)


@given(st.sampled_from(sorted(SKINS)), UNIT, UNIT)
def test_coordinates_undo_the_surface(name, along, across):
    skin = SKINS[name]
    wanted = [
        low + 0.98 * (0.01 + share) / 1.01 * (high - low)
        for share, (low, high) in ((along, skin.along), (across, skin.across))
    ]
    point = skin.surface(*np.array(wanted))
    found = skin.coordinates(point)
    assert skin.holds(point)
    np.testing.assert_allclose(skin.surface(*found), point, atol=1e-9)
    np.testing.assert_allclose(found, wanted, atol=1e-8)


@given(st.sampled_from(sorted(SKINS)), UNIT, UNIT, st.floats(-0.5, 3.0))
def test_projection_is_along_the_normal(name, along, across, height):
    """A point above or below the surface comes back to where it was lifted from."""
    skin = SKINS[name]
    ranges = (skin.along, skin.across)
    point = skin.surface(
        *(low + share * (high - low) for share, (low, high) in zip((along, across), ranges, strict=True))
    )
    normal = skin.normal(point)
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    np.testing.assert_allclose(skin.project(point + height * skin.radius * normal), point, atol=1e-12)


def test_biotac_is_half_a_cylinder_with_a_quarter_sphere():
    skin = biotac()
    points = np.array([[-0.005, 0.001, -0.002], [0.003, 0.001, -0.002]])
    on_skin = skin.project(points)
    cylinder = 0.007 * points[0, 1:] / np.linalg.norm(points[0, 1:])
    np.testing.assert_allclose(on_skin[0], [-0.005, *cylinder])
    np.testing.assert_allclose(on_skin[1], 0.007 * points[1] / np.linalg.norm(points[1]))


@pytest.mark.parametrize("name", sorted(SKINS))
def test_electrodes_lie_under_the_skin_and_look_outwards(name):
    skin = SKINS[name]
    surface = skin.project(skin.electrodes)
    depth = np.linalg.norm(surface - skin.electrodes, axis=1)
    assert depth == pytest.approx(DEPTH, abs=6e-4)
    assert skin.holds(surface).all()
    np.testing.assert_allclose(np.linalg.norm(skin.normals, axis=1), 1.0)
    assert ((skin.normals * skin.normal(surface)).sum(axis=1) > 0.6).all()


def test_biotac_mirrors():
    electrodes = {tuple(one) for one in biotac().electrodes.round(9)}
    assert {(x, -y if y else 0.0, z) for x, y, z in electrodes} == electrodes


def test_the_pad_is_flat_where_its_electrodes_are():
    surface = flat_pad().project(flat_pad().electrodes)
    np.testing.assert_allclose(surface[:, 2], surface[0, 2])
