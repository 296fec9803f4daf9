"""The world with nobody but the controller in it: repeats, rest, weight, contact, energy."""

import numpy as np
import pinocchio
import pybullet
import pytest
from committed import committed
from scraping_motions import FLAT, beside_contact

from structlearn.testbeds.scraping.world.demonstrator import CONTACT_M
from structlearn.testbeds.scraping.world.operational_space import OperationalSpace
from structlearn.testbeds.scraping.world.scraping_robot import ARM_JOINTS, arm_model, joint_angles, urdf
from structlearn.testbeds.scraping.world.scraping_world import (
    GRAVITY,
    ScrapingWorld,
    WorldParameters,
    tool_wrench,
)
from structlearn.testbeds.scraping.world.testbed import TestbedParameters

ABOVE = beside_contact(0.05)
NOTHING = np.zeros(6)


@pytest.fixture(scope="module")
def world():
    with ScrapingWorld(committed(WorldParameters, "testbed.world")) as one:
        yield one


def hold(world, position, rotation, ticks, force=NOTHING):
    """Hold a pose of the hand for some ticks: the controller."""
    control = OperationalSpace(arm_model())
    control.hold_posture(world.q[:ARM_JOINTS].copy())
    for _ in range(ticks):
        control.observe(world.q[:ARM_JOINTS].copy(), world.v[:ARM_JOINTS].copy())
        world.step(control.torques(position, rotation, NOTHING, NOTHING, 900.0, force))
    control.observe(world.q[:ARM_JOINTS].copy(), world.v[:ARM_JOINTS].copy())
    return control


def place(world, position=ABOVE, rotation=FLAT, roll=0.0, **factors):
    world.place(joint_angles(position, rotation), roll, CONTACT_M, **factors)


def touching_states(world):
    """Every state of a short run that presses the tool on a tilted board."""
    place(world, beside_contact(0.001), roll=0.1)
    states = []
    for _ in range(10):
        hold(world, beside_contact(-0.001), FLAT, 6)
        states.append(np.concatenate([world.q, world.v, world.board_wrench, world.grasp_load, world.edge]))
    return np.array(states)


def test_the_same_torques_give_the_same_bits(world):
    first = touching_states(world)
    assert np.abs(first[:, 26:29]).max() > 0.1  # it does touch
    np.testing.assert_array_equal(touching_states(world), first)  # whatever happened before
    with ScrapingWorld(committed(WorldParameters, "testbed.world")) as other:
        np.testing.assert_array_equal(touching_states(other), first)


def test_nothing_drifts_in_the_air(world):
    place(world)
    start = world.q.copy()
    hold(world, ABOVE, FLAT, 150)
    np.testing.assert_allclose(world.q, start, atol=2e-6)
    np.testing.assert_allclose(world.v, 0.0, atol=1e-6)
    np.testing.assert_array_equal(world.board_wrench, 0.0)


def test_the_place_of_a_run_is_where_it_starts(world):
    place(world, roll=0.1)
    np.testing.assert_allclose(world.tool_rotation, FLAT, atol=1e-9)
    sag = world.q[ARM_JOINTS + 2]
    assert 0 < sag < 5e-4  # the tool hangs in the grasp
    np.testing.assert_allclose(world.edge, ABOVE - [0, 0, sag], atol=1e-9)


@pytest.mark.parametrize("tilt_deg", [(0, 0, 0), (20, 0, 0), (0, 25, 0), (0, -25, 0), (10, -10, 20)])
def test_the_wrist_feels_nothing_in_the_air_whatever_the_orientation(world, tilt_deg):
    rotation = pinocchio.exp3(np.radians(tilt_deg)) @ FLAT
    place(world, rotation=rotation)
    control = hold(world, ABOVE, rotation, 150)
    wrench = tool_wrench(world.grasp_load, control.rotation, world.tool_rotation)
    np.testing.assert_allclose(wrench[:3], 0.0, atol=4e-3)  # of 0.6 N of weight; the skin's own is 3 mN
    np.testing.assert_allclose(wrench[3:], 0.0, atol=1e-4)


@pytest.mark.parametrize("roll_deg", [0.0, 6.0, -10.0])
def test_the_wrist_feels_what_the_board_does(world, roll_deg):
    roll = np.radians(roll_deg)
    place(world, beside_contact(0.001), roll=roll)
    control = hold(world, beside_contact(-0.0005), FLAT, 400)
    wrench = tool_wrench(world.grasp_load, control.rotation, world.tool_rotation)
    assert world.board_wrench[2] > 0.3
    np.testing.assert_allclose(wrench[:3], -world.board_wrench[:3], atol=5e-3)
    np.testing.assert_allclose(wrench[3:], -world.board_wrench[3:], atol=2e-4)
    if roll_deg:  # the board turns the tool towards itself
        assert np.sign(world.board_wrench[4]) == np.sign(roll_deg)


def test_factors_of_a_run_scale_board_and_friction(world):
    forces = {}
    for stiffness in (1.0, 2.0):
        place(world, beside_contact(-0.0002), stiffness_factor=stiffness)
        forces[stiffness] = world.board_wrench[2]
    assert forces[2.0] == pytest.approx(2 * forces[1.0])
    drags = {}
    for friction in (1.0, 2.0):
        place(world, beside_contact(-0.0002), friction_factor=friction)
        hold(world, beside_contact(-0.0002, 0.01), FLAT, 30)
        drags[friction] = world.board_wrench[1] / world.board_wrench[2]
    assert drags[1.0] == pytest.approx(-0.2, abs=0.01)
    assert drags[2.0] == pytest.approx(-0.4, abs=0.02)


def test_a_standing_tool_does_not_chatter():
    """Friction as a function of speed, too steep for the physics step, flips its sign at every step."""
    testbed = committed(TestbedParameters, "testbed")
    with ScrapingWorld(testbed.world) as one:
        place(one, beside_contact(0.001), friction_factor=1.4)
        lowered = beside_contact(-0.001)
        hold(one, lowered, FLAT, 300)
        drags = []
        for _ in range(10):
            hold(one, lowered, FLAT, 1)
            drags.append(one.board_wrench[:2].copy())
    assert one.board_wrench[2] > 1.0
    assert np.ptp(drags, axis=0).max() < 0.01


def test_a_pushed_tool_stands_until_friction_is_overcome(world):
    """Neither creep nor slip below the Coulomb force: the hand moves 0.02 mm aside, the edge holds on."""
    place(world, beside_contact(-0.0005))
    hold(world, beside_contact(-0.0005), FLAT, 60)
    hold(world, beside_contact(-0.0005, 2e-5), FLAT, 60)
    start, drag = world.edge.copy(), world.board_wrench[1]
    hold(world, beside_contact(-0.0005, 2e-5), FLAT, 300)
    assert 0.005 < abs(drag) < 0.2 * world.board_wrench[2]
    assert world.board_wrench[1] == pytest.approx(drag, rel=0.02)
    assert abs(world.edge[1] - start[1]) < 1e-7


def test_a_falling_arm_keeps_its_energy():
    """Limp in the air without damping: kinetic, potential and spring energy together stay what they were."""
    model = pinocchio.buildModelFromXML(urdf())
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    data, own = (
        model.createData(),
        committed(WorldParameters, "testbed.world", grasp_damping=0.0, substeps=20),
    )
    about_x, about_z, about_y = own.grasp_n_m_rad
    springs = np.array([own.grasp_n_m] * 3 + [about_z, about_x, about_y])
    with ScrapingWorld(own) as world:

        def energy():
            mechanical = pinocchio.computeMechanicalEnergy(model, data, world.q, world.v)
            return mechanical + 0.5 * springs @ world.q[ARM_JOINTS:] ** 2

        place(world, beside_contact(0.15))
        energies = [energy()]
        for _ in range(30):
            world.step(np.zeros(ARM_JOINTS))
            energies.append(energy())
        kinetic = pinocchio.computeKineticEnergy(model, data, world.q, world.v)
    assert kinetic > 1.0  # J
    assert np.ptp(energies) < 0.01 * kinetic


def test_servers_are_closed():
    with ScrapingWorld(committed(WorldParameters, "testbed.world")) as one:
        client = one._client
        assert pybullet.isConnected(client)
    assert not pybullet.isConnected(client)
