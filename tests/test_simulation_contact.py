"""The tool's edge on a plane of springs, beside closed forms and Pinocchio's kinematics."""

import numpy as np
import pinocchio
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scraping_motions import FLAT

from dissertation.scraping.world.demonstrator import CONTACT_M
from dissertation.scraping.world.scraping_robot import EDGE_M, HOME, joint_angles, urdf, whole
from dissertation.scraping.world.scraping_world import EDGE_POINTS, EDGE_WIDTH_M, POINTS, Board, press
from dissertation.simulation import compiled_chain
from structlearn.rigid_body.tree import robot_arrays

STIFFNESS, DAMPING, FRICTION = 2000.0, 2.0, 0.2
STICKING, STICKING_DAMPING, DT = 1500.0, 10.0, 1 / 900
JOINTS = 13

ARRAYS = robot_arrays(whole().tree, whole().inertias)
MODEL = pinocchio.buildModelFromXML(urdf())
PLACE = pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, EDGE_M]))
EDGE = MODEL.addFrame(pinocchio.Frame("tool_edge", MODEL.njoints - 1, PLACE, pinocchio.FrameType.OP_FRAME))


def touch(q, v, point, normal, damping=DAMPING, friction=FRICTION, steps=1):
    """Middle of the tool's edge, wrench of the board and joint torques after steps of dt."""
    work = compiled_chain.workspace(JOINTS)
    compiled_chain.kinematics(ARRAYS, q, work)
    outputs = np.empty(3), np.empty(6), np.empty(JOINTS)
    place = np.array(point, float), np.array(normal, float)
    board, stuck = (
        Board(*place, STIFFNESS, damping, friction, STICKING, STICKING_DAMPING),
        np.zeros((EDGE_POINTS, 3)),
    )
    for _ in range(steps):
        press(work, v, board, DT, stuck, *outputs)
    return outputs


def edge_of(q):
    """Pose of the tool's edge and its Jacobian by Pinocchio, base frame."""
    data, aligned = MODEL.createData(), pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
    jacobian = pinocchio.computeFrameJacobian(MODEL, data, q, EDGE, aligned)
    return data.oMf[EDGE].rotation, data.oMf[EDGE].translation, jacobian


def tilted(roll):
    return np.array([np.sin(roll), 0.0, np.cos(roll)])


@pytest.fixture(scope="module")
def flat():
    """Joint positions with the edge at the contact, along base x."""
    return np.concatenate([joint_angles(CONTACT_M, FLAT), np.zeros(6)])


def pressed(flat, depth, roll=0.0, velocity=None, **board):
    """Wrench on a flat edge whose middle is so deep in a board of some roll, and moves (6,)."""
    _, middle, jacobian = edge_of(flat)
    v = np.zeros(JOINTS) if velocity is None else np.linalg.pinv(jacobian) @ velocity
    normal = tilted(roll)
    return touch(flat, v, middle + depth * normal, normal, **board)[1]


def random_state(seed):
    rng = np.random.default_rng(seed)
    arm = HOME + rng.uniform(-0.3, 0.3, 7)
    grasp = np.concatenate([rng.uniform(-2e-3, 2e-3, 3), rng.uniform(-0.2, 0.2, 3)])
    velocity = np.concatenate([rng.normal(0.0, 0.1, 7), rng.normal(0.0, 0.01, 3), rng.normal(0.0, 0.3, 3)])
    normal = np.array([0.0, 0.0, 1.0]) + rng.uniform(-0.2, 0.2, 3)
    return rng, np.concatenate([arm, grasp]), velocity, normal / np.linalg.norm(normal)


@pytest.mark.parametrize("depth_mm", [-50.0, -1.0, -1e-6, 0.01, 0.5, 3.0])
def test_a_flat_edge_feels_stiffness_times_depth_and_nothing_in_the_air(flat, depth_mm):
    velocity = [0.0, 0.0, -0.1, 0.0, 0.0, 0.0] if depth_mm < 0.0 else None
    wrench = pressed(flat, 1e-3 * depth_mm, velocity=velocity)
    expected = [0, 0, STIFFNESS * 1e-3 * max(depth_mm, 0.0), 0, 0, 0]
    np.testing.assert_allclose(wrench, expected, atol=1e-9 if depth_mm > 0.0 else 0.0)


@pytest.mark.parametrize("roll_deg", [-4.0, 1.0, 4.0])
def test_a_tilted_board_turns_a_wholly_loaded_edge_towards_itself(flat, roll_deg):
    """Winkler foundation under a rigid strip: torque = k w^2 / 12 sin cos, whatever the load."""
    roll = np.radians(roll_deg)
    for depth in (0.5e-3, 1e-3):
        wrench = pressed(flat, depth, roll)
        force = STIFFNESS * depth * tilted(roll)
        torque = STIFFNESS * EDGE_WIDTH_M**2 / 12 * np.sin(roll) * np.cos(roll)
        np.testing.assert_allclose(wrench[:3], force, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(wrench[3:], [0.0, torque, 0.0], rtol=0.02, atol=1e-12)


@pytest.mark.parametrize("roll_deg", [-20.0, 10.0, 30.0])
def test_a_partly_loaded_edge_is_pushed_at_a_third_of_what_is_loaded(flat, roll_deg):
    """Triangular pressure over the loaded length L: F = k d L / (2 w), acting L / 3 from the deep end."""
    roll = np.radians(roll_deg)
    slope, half = np.abs(np.sin(roll)), 0.5 * EDGE_WIDTH_M
    depth = 0.2 * half * slope  # of the middle
    deepest = depth + half * slope
    loaded = deepest / slope
    force = STIFFNESS * deepest * loaded / (2 * EDGE_WIDTH_M)
    torque = np.sign(roll) * force * np.cos(roll) * (half - loaded / 3)
    wrench = pressed(flat, depth, roll)
    np.testing.assert_allclose(wrench[:3], force * tilted(roll), rtol=0.02, atol=1e-9)
    np.testing.assert_allclose(wrench[3:], [0.0, torque, 0.0], rtol=0.02, atol=1e-9)


@pytest.mark.parametrize("direction", [[1, 0, 0], [0, 1, 0], [0.6, -0.8, 0]])
def test_friction_pulls_back_and_saturates(flat, direction):
    """Stuck: a spring and a damper; sliding: friction times normal force, whatever the speed."""
    direction = np.array(direction)
    for speed in (1e-4, 1e-3, 1.0):
        slip = np.concatenate([speed * direction, np.zeros(3)])
        for steps in (1, 10, 1000):
            force = pressed(flat, 0.5e-3, velocity=slip, steps=steps)[:3]
            drag = min(STICKING * speed * DT * steps + STICKING_DAMPING * speed, FRICTION * 1.0)
            np.testing.assert_allclose(force, np.array([0, 0, 1.0]) - drag * direction, atol=1e-6)


def test_damping_pushes_on_approach_and_never_pulls(flat):
    down, up = ([0, 0, sign * 0.1, 0, 0, 0] for sign in (-1, 1))
    assert pressed(flat, 0.5e-3, velocity=down)[2] == pytest.approx(1.0 + 0.1 * DAMPING)
    assert pressed(flat, 0.5e-3, velocity=up)[2] == pytest.approx(1.0 - 0.1 * DAMPING)
    torn_off = [0, 0, 10.0, 0, 0, 0]
    np.testing.assert_array_equal(pressed(flat, 0.5e-3, velocity=torn_off), 0.0)


@given(seed=st.integers(0, 10**6))
def test_joint_torques_are_those_of_the_wrench(seed):
    """tau = J^T w, with the Jacobian by Pinocchio, at any posture, grasp and board."""
    rng, q, v, normal = random_state(seed)
    _, middle, jacobian = edge_of(q)
    edge, wrench, torques = touch(q, v, middle + rng.uniform(0, 3e-3) * normal, normal)
    np.testing.assert_allclose(edge, middle, atol=1e-12)
    assert wrench[:3] @ normal > 0
    np.testing.assert_allclose(torques, jacobian.T @ wrench, atol=1e-12)


@given(seed=st.integers(0, 10**6))
def test_only_what_the_springs_store_comes_back(seed):
    """Power of the contact = - d/dt of the energy in the springs, less what damping and friction take."""
    rng, q, v, normal = random_state(seed)
    point = edge_of(q)[1] + rng.uniform(0, 3e-3) * normal

    def energy(time):
        rotation, middle, _ = edge_of(pinocchio.integrate(MODEL, q, time * v))
        places = middle + POINTS[:, None] * rotation[:, 0]
        depth = np.maximum((point - places) @ normal, 0.0)
        return 0.5 * STIFFNESS * np.mean(depth**2)

    h = 1e-6
    given_back = -(energy(h) - energy(-h)) / (2 * h)
    elastic = touch(q, v, point, normal, damping=0.0, friction=0.0)[2] @ v
    assert elastic == pytest.approx(given_back, rel=1e-5, abs=1e-8)
    assert touch(q, v, point, normal)[2] @ v < elastic
