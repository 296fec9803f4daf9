"""The world with nobody but the controller in it: repeats, rest, weight, contact, energy."""

import numpy as np
import pinocchio
import pytest
from committed import committed
from scraping_motions import FLAT, beside_contact

from dissertation.scraping.world import scraping_world
from dissertation.scraping.world.operational_space import Target, control, controlled, observe
from dissertation.scraping.world.scraping_robot import ARM_JOINTS, arm, joint_angles, urdf

ABOVE = beside_contact(0.05)
NOTHING = np.zeros(6)


PARAMETERS = committed(scraping_world.WorldParameters, "testbed.world")


class Engine:
    """A world, and the arm that holds the tool in it."""

    def __init__(self, world):
        self.world = world
        self.arm = controlled(arm(), world.q[:ARM_JOINTS].copy())

    def hold(self, position, rotation, ticks, force=NOTHING):
        """Hold a pose of the hand for some ticks."""
        target = Target(position, rotation, NOTHING, NOTHING)
        for _ in range(ticks):
            observe(self.arm, self.world.q, self.world.v)
            control(self.arm, target, 900.0, force)
            scraping_world.advance(self.world, self.arm.torques)
        observe(self.arm, self.world.q, self.world.v)
        return self.world

    @property
    def felt(self):
        """Wrench of the tool on the board, as the wrist feels it."""
        wrench = np.empty(6)
        scraping_world.tool_wrench(self.world.grasp_load, self.arm.rotation, self.world.tool_rotation, wrench)
        return wrench


def place(position=ABOVE, rotation=FLAT, roll=0.0, parameters=PARAMETERS, **factors):
    return Engine(scraping_world.placed(parameters, joint_angles(position, rotation), roll, **factors))


def test_a_run_starts_at_rest_where_it_is_placed_and_nothing_drifts_in_the_air():
    engine = place(roll=0.1)
    world, start = engine.world, engine.world.q.copy()
    np.testing.assert_allclose(world.tool_rotation, FLAT, atol=1e-9)
    sag = start[ARM_JOINTS + 2]
    assert 0 < sag < 5e-4  # the tool hangs in the grasp
    np.testing.assert_allclose(world.edge, ABOVE - [0, 0, sag], atol=1e-9)
    engine.hold(ABOVE, FLAT, 150)
    np.testing.assert_allclose(world.q, start, atol=2e-6)
    np.testing.assert_allclose(world.v, 0.0, atol=1e-6)
    np.testing.assert_array_equal(world.board_wrench, 0.0)


@pytest.mark.parametrize("tilt_deg", [(0, 0, 0), (20, 0, 0), (0, 25, 0), (0, -25, 0), (10, -10, 20)])
def test_the_wrist_feels_nothing_in_the_air_whatever_the_orientation(tilt_deg):
    rotation = pinocchio.exp3(np.radians(tilt_deg)) @ FLAT
    engine = place(rotation=rotation)
    engine.hold(ABOVE, rotation, 150)
    np.testing.assert_allclose(engine.felt[:3], 0.0, atol=4e-3)  # of 0.6 N of weight; the skin's own is 3 mN
    np.testing.assert_allclose(engine.felt[3:], 0.0, atol=1e-4)


@pytest.mark.parametrize("roll_deg", [0.0, 6.0, -10.0])
def test_the_wrist_feels_what_the_board_does(roll_deg):
    engine = place(beside_contact(0.001), roll=np.radians(roll_deg))
    world = engine.hold(beside_contact(-0.0005), FLAT, 400)
    assert world.board_wrench[2] > 0.3
    np.testing.assert_allclose(engine.felt[:3], -world.board_wrench[:3], atol=5e-3)
    np.testing.assert_allclose(engine.felt[3:], -world.board_wrench[3:], atol=2e-4)
    if roll_deg:  # the board turns the tool towards itself
        assert np.sign(world.board_wrench[4]) == np.sign(roll_deg)


def test_factors_of_a_run_scale_board_and_friction():
    forces = {}
    for stiffness in (1.0, 2.0):
        world = place(beside_contact(-0.0002), stiffness_factor=stiffness).world
        forces[stiffness] = world.board_wrench[2]
    assert forces[2.0] == pytest.approx(2 * forces[1.0])
    drags = {}
    for friction in (1.0, 2.0):
        engine = place(beside_contact(-0.0002), friction_factor=friction)
        world = engine.hold(beside_contact(-0.0002, 0.01), FLAT, 30)
        drags[friction] = world.board_wrench[1] / world.board_wrench[2]
    assert drags[1.0] == pytest.approx(-0.2, abs=0.01)
    assert drags[2.0] == pytest.approx(-0.4, abs=0.02)


def test_a_pushed_tool_stands_until_friction_is_overcome():
    """Neither creep nor slip below the Coulomb force: the hand moves 0.02 mm aside, the edge holds on."""
    engine = place(beside_contact(-0.0005))
    engine.hold(beside_contact(-0.0005), FLAT, 60)
    world = engine.hold(beside_contact(-0.0005, 2e-5), FLAT, 60)
    start, drag = world.edge.copy(), world.board_wrench[1]
    engine.hold(beside_contact(-0.0005, 2e-5), FLAT, 300)
    assert 0.005 < abs(drag) < 0.2 * world.board_wrench[2]
    assert world.board_wrench[1] == pytest.approx(drag, rel=0.02)
    assert abs(world.edge[1] - start[1]) < 1e-7


def test_a_falling_arm_keeps_its_energy():
    """Limp in the air without damping: kinetic, potential and spring energy together stay what they were."""
    model = pinocchio.buildModelFromXML(urdf())
    model.gravity.linear = np.array([0.0, 0.0, -scraping_world.GRAVITY])
    data, own = (
        model.createData(),
        committed(scraping_world.WorldParameters, "testbed.world", grasp_damping=0.0, substeps=20),
    )
    about_x, about_z, about_y = own.grasp_n_m_rad
    springs = np.array([own.grasp_n_m] * 3 + [about_z, about_x, about_y])
    engine = place(beside_contact(0.15), parameters=own)
    world = engine.world

    def energy():
        mechanical = pinocchio.computeMechanicalEnergy(model, data, world.q, world.v)
        return mechanical + 0.5 * springs @ world.q[ARM_JOINTS:] ** 2

    energies = [energy()]
    for _ in range(30):
        scraping_world.advance(world, np.zeros(ARM_JOINTS))
        energies.append(energy())
    kinetic = pinocchio.computeKineticEnergy(model, data, world.q, world.v)
    assert kinetic > 1.0  # J
    assert np.ptp(energies) < 0.01 * kinetic
