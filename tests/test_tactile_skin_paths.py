"""Shortest paths on skins against closed forms."""

import numpy as np
import pytest

from structlearn.tactile.electrodes import biotac, flat_pad, skin_distance, sphere


def test_on_a_cylinder_it_is_a_helix():
    skin = biotac()
    along, across = np.array([[-0.012, -0.004], [-0.006, 0.0]]), np.array([[-0.006, 0.005], [-0.002, -0.007]])
    found = skin_distance(*(skin.surface(*ends) for ends in zip(along, across, strict=True)), skin)
    np.testing.assert_allclose(found, np.hypot(np.diff(along, axis=0), np.diff(across, axis=0))[0], rtol=2e-3)


def test_on_a_sphere_it_is_a_great_circle():
    skin = sphere()
    first, second = skin.surface(np.array([-0.008]), np.array([0.004])), skin.surface([0.005], [-0.007])
    angle = np.arccos((first * second).sum(axis=1) / skin.radius**2)
    np.testing.assert_allclose(skin_distance(first, second, skin), skin.radius * angle, rtol=2e-3)


def test_on_a_plane_it_is_straight():
    skin = flat_pad()
    first, second = skin.surface([-0.015], [-0.005]), skin.surface([-0.002], [0.006])
    assert skin_distance(first, second, skin)[0] == pytest.approx(np.hypot(0.013, 0.011), rel=1e-6)
