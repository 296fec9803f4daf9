"""Distances of links: of spheres in closed form, of hollow meshes, and of what is not watched."""

import numpy as np
import pytest
from rigid_body_arms import planar_arm

from structlearn.core.errors import InputError
from structlearn.rigid_body.inverse_kinematics import read_arm
from structlearn.rigid_body.self_collision import link_distances, read_shapes

STRAIGHT = np.zeros(3)


def arm_of(tmp_path, text):
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    return read_arm(path, "tip")


def trough(path, width, height):
    """A mesh that is open above: a floor and two walls along x; its hull is a box."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-width, width) for z in (-height, height)]
    faces = [(1, 3, 7), (1, 7, 5), (1, 2, 6), (1, 6, 5), (3, 4, 8), (3, 8, 7)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join(lines) + "\n")


def test_spheres_are_as_far_apart_as_their_centres_less_their_radii(tmp_path):
    arm = arm_of(tmp_path, planar_arm(0.5, 0.4, 0.3, radius=0.05))
    shapes = read_shapes(arm, (), STRAIGHT)
    assert shapes.pairs == ("base and link_1", "base and link_2", "base and tip")
    joints = np.random.default_rng(1).uniform(-1.5, 1.5, (20, 3))
    distances = dict(zip(shapes.pairs, link_distances(shapes, joints, near=0.0).T, strict=True))
    turned = joints.cumsum(axis=1)
    elbow = 0.5 * np.stack([np.cos(turned[:, 0]), np.sin(turned[:, 0])], axis=1)
    wrist = elbow + 0.4 * np.stack([np.cos(turned[:, 1]), np.sin(turned[:, 1])], axis=1)
    np.testing.assert_allclose(distances["base and link_2"], np.linalg.norm(wrist, axis=1) - 0.1, atol=1e-6)


def test_neighbours_are_no_pair(tmp_path):
    shapes = read_shapes(arm_of(tmp_path, planar_arm(0.5, 0.4, 0.3)), (), STRAIGHT)
    assert "base and link_0" not in shapes.pairs
    assert "link_1 and link_2" not in shapes.pairs
    assert shapes.touching == ()
    assert shapes.bare == ("joint_0",)  # the first link has no shape


def test_what_touches_at_rest_is_named_and_not_watched(tmp_path):
    folded = np.array([0.0, 2.5, 2.0])  # the tip is 0.12 m from the base
    thin = arm_of(tmp_path, planar_arm(0.5, 0.4, 0.3, radius=0.02))
    assert link_distances(read_shapes(thin, (), folded), folded[None], near=0.0).min() > 0.0
    thick = arm_of(tmp_path, planar_arm(0.5, 0.4, 0.3, radius=0.15))
    shapes = read_shapes(thick, (), folded)
    assert shapes.touching == ("base and link_2", "base and tip")
    assert shapes.pairs == ("base and link_1",)


def test_a_hollow_link_is_not_filled(tmp_path):
    """Where convex hulls come too near, the meshes themselves are asked."""
    trough(tmp_path / "trough.obj", width=0.3, height=0.3)
    arm = arm_of(tmp_path, planar_arm(0.8, 0.8, radius=0.05, mesh="trough.obj"))
    shapes = read_shapes(arm, (), np.array([0.0, 0.5]))
    inside = np.array([[0.0, np.pi]])  # folded back, the trough is around the base
    (hull,) = link_distances(shapes, inside, near=-np.inf)[0, [shapes.pairs.index("base and tip")]]
    (mesh,) = link_distances(shapes, inside, near=0.01)[0, [shapes.pairs.index("base and tip")]]
    assert hull < 0.0
    assert mesh == pytest.approx(0.3 - 0.05, abs=1e-6)


def test_shapes_that_cannot_be_read_are_told_of(tmp_path):
    arm = arm_of(tmp_path, planar_arm(0.5, 0.4, mesh="lost.stl"))
    with pytest.raises(InputError, match=r"arm.urdf: collision shapes cannot be read: .*lost.stl"):
        read_shapes(arm, (), np.zeros(2))
    bare = arm_of(tmp_path, planar_arm(0.5, 0.4).replace("collision", "visual"))
    with pytest.raises(InputError, match="fewer than two links have collision shapes"):
        read_shapes(bare, (), np.zeros(2))
