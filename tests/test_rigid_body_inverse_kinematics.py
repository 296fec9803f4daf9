"""Joints along a path: where they bring the tip, how they move, and what they do out of reach."""

import numpy as np
import pinocchio
import pytest
from rigid_body_arms import planar_arm
from rigid_body_robots import FINGERS
from rigid_body_robots import robot as robot_of

from dissertation.dynamics.world.operational_space import (
    VelocityControl,
    joint_reference,
    tool_motion,
)
from dissertation.simulation import compiled_chain
from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.core.signals import minimum_jerk
from structlearn.readers.urdf_file import urdf_path
from structlearn.rigid_body.arm_kinematics import (
    Follower,
    follow,
    link_distances,
    read_arm,
    read_collision_shapes,
    rest_for,
)
from structlearn.rigid_body.robot import configuration
from structlearn.rigid_body.tree import robot_arrays

DT = 0.005
BENT = np.array([0.2, -0.4, 0.1, -2.1, -0.1, 1.8, 0.7])  # rad, an easy configuration of the Panda


@pytest.fixture(scope="module")
def panda():
    return read_arm(urdf_path("franka_panda/panda.urdf"), "panda_grasptarget", FINGERS)


def planar(tmp_path, *lengths, **options):
    return arm_of(tmp_path, planar_arm(*lengths, **options))


def arm_of(tmp_path, text):
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    return read_arm(path, "tip")


def tip_poses(arm, joints):
    """Where joints (T, n) bring the tip, by Pinocchio."""
    data, frames = arm.model.createData(), []
    for row in joints:
        pinocchio.forwardKinematics(arm.model, data, configuration(arm.model, row))
        frames.append(pinocchio.SE3ToXYZQUAT(pinocchio.updateFramePlacement(arm.model, data, arm.tip)))
    return np.array(frames)[:, :3], quaternion.from_xyzw(np.array(frames)[:, 3:])


def there_and_back(arm, start, end, samples=201):
    """Poses of the tip while joints go from one configuration to another and back."""
    part = np.concatenate(
        [minimum_jerk(np.linspace(0, 1, samples)), minimum_jerk(np.linspace(1, 0, samples))[1:]]
    )
    return tip_poses(arm, start + part[:, None] * (end - start))


def test_a_planar_elbow_has_the_angles_of_the_law_of_cosines(tmp_path):
    arm = planar(tmp_path, 0.5, 0.4)
    points = np.stack([np.linspace(0.3, 0.7, 50), np.full(50, 0.2), np.zeros(50)], axis=1)
    path = follow(arm, points, None, DT, rest=np.array([0.5, 0.5]))
    squared = (points[:, :2] ** 2).sum(axis=1)
    elbow = np.arccos((squared - 0.5**2 - 0.4**2) / (2 * 0.5 * 0.4))
    shoulder = np.arctan2(0.2, points[:, 0]) - np.arctan2(0.4 * np.sin(elbow), 0.5 + 0.4 * np.cos(elbow))
    np.testing.assert_allclose(path.joints, np.stack([shoulder, elbow], axis=1), atol=1e-8)
    assert path.missed_m.max() < 1e-8
    area = np.abs(0.5 * 0.4 * np.sin(elbow))  # the determinant of the Jacobian, the product of both values
    values = np.linalg.svd(path.jacobian, compute_uv=False)
    np.testing.assert_allclose(values.prod(axis=1), area, rtol=1e-6)


@pytest.fixture(scope="module")
def bent_path(panda):
    """Poses of a reach there and back, and the joints that follow it."""
    poses = there_and_back(panda, BENT, BENT + np.array([0.5, 0.3, -0.4, 0.3, 0.4, -0.2, 0.3]))
    return poses, follow(panda, *poses, DT, BENT)


def test_a_redundant_arm_follows_smoothly_and_comes_back_to_where_it_was(bent_path):
    _, path = bent_path
    assert path.missed_m.max() < 1e-8
    assert path.missed_rad.max() < 1e-8
    steps = np.diff(path.joints, axis=0)
    assert np.abs(np.diff(steps, axis=0)).max() / DT**2 < 5.0  # rad/s^2: nothing jumps
    assert np.abs(steps[0]).max() / DT < 1e-3  # rad/s: free joints start at rest
    np.testing.assert_allclose(path.joints[0], BENT, atol=1e-8)
    np.testing.assert_allclose(path.joints[-1], BENT, atol=0.15)


def test_poses_one_by_one_are_a_path(panda):
    position, orientation = there_and_back(panda, BENT, BENT + 0.2, 20)
    follower = Follower(panda, BENT, DT)
    joints = [follower.start(position[0], orientation[0])]
    joints += [follower.step(*pose) for pose in zip(position[1:], orientation[1:], strict=True)]
    np.testing.assert_array_equal(joints, follow(panda, position, orientation, DT, BENT).joints)


def test_where_orientation_is_free_joints_stay_nearer_to_rest(panda, bent_path):
    (position, _), bound = bent_path
    free = follow(panda, position, None, DT, BENT)
    assert free.missed_m.max() < 1e-8
    assert np.abs(free.joints - BENT).max() < np.abs(bound.joints - BENT).max()


def test_a_pose_out_of_reach_is_missed_by_what_is_lacking_and_left_without_a_fling(tmp_path):
    arm = planar(tmp_path, 0.5, 0.4)
    away = 0.7 + 0.5 * np.sin(np.linspace(0, np.pi, 400)) ** 2
    points = np.stack([away, np.zeros(400), np.zeros(400)], axis=1)
    path = follow(arm, points, None, DT, rest=np.array([-0.6, 1.3]))
    beyond = away > 0.91
    np.testing.assert_allclose(path.missed_m[beyond], away[beyond] - 0.9, atol=5e-3)
    assert path.missed_m[away < 0.89].max() < 1e-8
    # the elbow closes with the root of the distance: 4 mm of a sample are 0.2 rad
    assert np.abs(np.diff(path.joints, axis=0)).max() < 0.3
    assert path.least_singular_value.min() < 0.05


def test_turns_of_an_endless_joint_are_counted(tmp_path):
    arm = planar(tmp_path, 0.5, kind="continuous")
    angle = np.linspace(0, 4 * np.pi, 800)
    points = 0.5 * np.stack([np.cos(angle), np.sin(angle), np.zeros(800)], axis=1)
    path = follow(arm, points, None, DT, rest=np.zeros(1))
    np.testing.assert_allclose(path.joints[:, 0], angle, atol=1e-7)
    assert arm.tree.upper[0] == np.inf


def test_a_rest_configuration_keeps_a_path_within_limits_and_away_from_singularities(panda):
    position, orientation = there_and_back(panda, BENT, BENT + 0.3, 5)
    rest = rest_for(panda, position, orientation, 0.1, seed=1)
    path = follow(panda, position, orientation, 0.1, rest)
    assert (path.joints > panda.tree.lower).all()
    assert (path.joints < panda.tree.upper).all()
    assert path.missed_m.max() < 1e-6
    assert path.least_singular_value.min() > 0.1
    np.testing.assert_allclose(path.joints[0], rest, atol=1e-8)
    np.testing.assert_array_equal(rest, rest_for(panda, position, orientation, 0.1, seed=1))


def test_what_cannot_be_is_said(tmp_path):
    arm = planar(tmp_path, 0.5, 0.4)
    with pytest.raises(
        InputError, match=r"no configuration .* takes the tip from \[1. 0. 0.\] m along the path"
    ):
        rest_for(arm, np.array([[1.0, 0.0, 0.0]]), None, DT, seed=1)
    with pytest.raises(InputError, match="there is no link 'hand'; there are base, link_0, link_1, tip"):
        read_arm(arm.source, "hand")


STRAIGHT = np.zeros(3)


def trough(path, width, height):
    """A mesh that is open above: a floor and two walls along x; its hull is a box."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-width, width) for z in (-height, height)]
    faces = [(1, 3, 7), (1, 7, 5), (1, 2, 6), (1, 6, 5), (3, 4, 8), (3, 8, 7)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    path.write_text("\n".join(lines) + "\n")


def test_spheres_are_as_far_apart_as_their_centres_less_their_radii(tmp_path):
    arm = arm_of(tmp_path, planar_arm(0.5, 0.4, 0.3, radius=0.05))
    shapes = read_collision_shapes(arm, (), STRAIGHT)
    assert shapes.pairs == ("base and link_1", "base and link_2", "base and tip")
    joints = np.random.default_rng(1).uniform(-1.5, 1.5, (20, 3))
    distances = dict(zip(shapes.pairs, link_distances(shapes, joints, near=0.0).T, strict=True))
    turned = joints.cumsum(axis=1)
    elbow = 0.5 * np.stack([np.cos(turned[:, 0]), np.sin(turned[:, 0])], axis=1)
    wrist = elbow + 0.4 * np.stack([np.cos(turned[:, 1]), np.sin(turned[:, 1])], axis=1)
    np.testing.assert_allclose(distances["base and link_2"], np.linalg.norm(wrist, axis=1) - 0.1, atol=1e-6)


def test_neighbours_are_no_pair(tmp_path):
    shapes = read_collision_shapes(arm_of(tmp_path, planar_arm(0.5, 0.4, 0.3)), (), STRAIGHT)
    assert "base and link_0" not in shapes.pairs
    assert "link_1 and link_2" not in shapes.pairs
    assert shapes.touching == ()
    assert shapes.bare == ("joint_0",)  # the first link has no shape


def test_what_touches_at_rest_is_named_and_not_watched(tmp_path):
    folded = np.array([0.0, 2.5, 2.0])  # the tip is 0.12 m from the base
    thin = arm_of(tmp_path, planar_arm(0.5, 0.4, 0.3, radius=0.02))
    assert link_distances(read_collision_shapes(thin, (), folded), folded[None], near=0.0).min() > 0.0
    thick = arm_of(tmp_path, planar_arm(0.5, 0.4, 0.3, radius=0.15))
    shapes = read_collision_shapes(thick, (), folded)
    assert shapes.touching == ("base and link_2", "base and tip")
    assert shapes.pairs == ("base and link_1",)


def test_a_hollow_link_is_not_filled(tmp_path):
    """Where convex hulls come too near, the meshes themselves are asked."""
    trough(tmp_path / "trough.obj", width=0.3, height=0.3)
    arm = arm_of(tmp_path, planar_arm(0.8, 0.8, radius=0.05, mesh="trough.obj"))
    shapes = read_collision_shapes(arm, (), np.array([0.0, 0.5]))
    inside = np.array([[0.0, np.pi]])  # folded back, the trough is around the base
    (hull,) = link_distances(shapes, inside, near=-np.inf)[0, [shapes.pairs.index("base and tip")]]
    (mesh,) = link_distances(shapes, inside, near=0.01)[0, [shapes.pairs.index("base and tip")]]
    assert hull < 0.0
    assert mesh == pytest.approx(0.3 - 0.05, abs=1e-6)


def test_shapes_that_cannot_be_read_are_told_of(tmp_path):
    arm = arm_of(tmp_path, planar_arm(0.5, 0.4, mesh="lost.stl"))
    with pytest.raises(InputError, match=r"arm.urdf: collision shapes cannot be read: .*lost.stl"):
        read_collision_shapes(arm, (), np.zeros(2))
    bare = arm_of(tmp_path, planar_arm(0.5, 0.4).replace("collision", "visual"))
    with pytest.raises(InputError, match="fewer than two links have collision shapes"):
        read_collision_shapes(bare, (), np.zeros(2))


TOOL = np.array([0.02, -0.03, 0.1])
GAIN = 6.0


@pytest.fixture(scope="module")
def robot():
    return robot_of("iiwa")


@pytest.fixture(scope="module")
def state():
    rng = np.random.default_rng(2)
    return np.array([0, 0.5, 0, -1.2, 0, 1, 0]) + rng.uniform(-1.0, 1.0, 7), rng.normal(size=7)


def pinocchio_tool(robot, q, qd, qdd):
    """Position, velocity and acceleration of the tool by Pinocchio."""
    model = robot.model.copy()
    frame = pinocchio.Frame("tool", 7, 0, pinocchio.SE3(np.eye(3), TOOL), pinocchio.FrameType.OP_FRAME)
    place = model.addFrame(frame)
    data = model.createData()
    pinocchio.forwardKinematics(model, data, q, qd, qdd)
    pinocchio.updateFramePlacements(model, data)
    aligned = pinocchio.LOCAL_WORLD_ALIGNED
    return (
        data.oMf[place].translation.copy(),
        pinocchio.getFrameVelocity(model, data, place, aligned).linear,
        pinocchio.getFrameClassicalAcceleration(model, data, place, aligned).linear,
    )


def reference(robot, posture, q, qd, wanted):
    """Joint velocity and acceleration by the law."""
    body, work = robot_arrays(robot.tree, robot.inertias), compiled_chain.workspace(7)
    compiled_chain.dynamics(body, q, qd, work)
    return joint_reference(VelocityControl(TOOL, posture, GAIN, 2.0), body, work, q, qd, *wanted)


def test_tool_moves_as_in_pinocchio(robot, state):
    q, qd = state
    position, velocity = tool_motion(robot.tree, TOOL, q[None], qd[None])
    expected = pinocchio_tool(robot, q, qd, np.zeros(7))
    np.testing.assert_allclose(position[0], expected[0], atol=1e-12)
    np.testing.assert_allclose(velocity[0], expected[1], atol=1e-12)


def test_tool_gets_the_velocity_and_acceleration_that_the_law_asks_for(robot, state):
    q, qd = state
    x, xd, _ = pinocchio_tool(robot, q, qd, np.zeros(7))
    error, slow, wanted = np.array([[0.01, 0.02, -0.01], [0.1, 0.0, -0.2], [1.0, -1.0, 0.5]])
    velocity, qdd = reference(robot, q + 0.3, q, qd, (x + error, xd + slow, wanted))
    reached = pinocchio_tool(robot, q, velocity, np.zeros(7))[1]
    np.testing.assert_allclose(reached, xd + slow + GAIN * error, atol=1e-4)  # but for the inverse's damping
    _, _, acceleration = pinocchio_tool(robot, q, qd, qdd)
    np.testing.assert_allclose(acceleration, wanted + GAIN * slow, atol=1e-3)


def test_posture_does_not_move_the_tool(robot, state):
    q, qd = state
    wanted = pinocchio_tool(robot, q, qd, np.zeros(7))
    here, there = (reference(robot, posture, q, qd, wanted)[0] for posture in (q, q + 0.5))
    assert np.abs(there - here).max() > 0.1
    moved = pinocchio_tool(robot, q, there - here, np.zeros(7))[1]
    assert np.abs(moved).max() < 1e-4  # the damping of the pseudo-inverse
