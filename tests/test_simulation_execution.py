"""Runs in the world: the force is held, the torque tells the tilt, a person gets the tool flat."""

import numpy as np
import pytest
from committed import committed
from scraping_motions import (
    FLAT,
    beside_contact,
    conditions,
    constant_network,
    press_motion,
    roll_deg,
    scraping_skill,
)

from structlearn.feedback.runtime import Controller
from structlearn.ground import quaternion
from structlearn.primitives.sequence import default_start
from structlearn.simulation.fingers import FingerPair, TouchParameters
from structlearn.testbeds.scraping.world.corrector import CorrectorParameters, corrector
from structlearn.testbeds.scraping.world.demonstrator import orientation_of
from structlearn.testbeds.scraping.world.execution import (
    FINGER_TICKS,
    ControlParameters,
    execute,
    roll_of,
)
from structlearn.testbeds.scraping.world.scraping_world import WorldParameters

DT = 1 / 300
SILENT = committed(ControlParameters, "testbed.control", force_noise_n=0.0, torque_noise_n_m=0.0)


NO_NOISE = dict.fromkeys(("bias_deg", "reaction_spread_s", "noise_mm", "gain_spread", "noise"), 0.0)
TYPICAL = committed(CorrectorParameters, "testbed.corrector")
EXACT = TYPICAL.model_copy(update=NO_NOISE)
WORLD = committed(WorldParameters, "testbed.world")
UPRIGHT = orientation_of(np.zeros(3))


def two_fingers():
    return FingerPair(committed(TouchParameters, "testbed.touch"), 1, np.random.default_rng(2), 100.0)


def press(roll=0.0, ticks=600, control=SILENT, person=None, motion=None, **changes):
    return execute(
        WORLD,
        press_motion(ticks) if motion is None else motion,
        (beside_contact(2e-4), FLAT),
        ticks,
        conditions(roll, ticks, control, **changes),
        control,
        two_fingers(),
        np.random.default_rng(3),
        person,
    )


@pytest.fixture(scope="module")
def pressed():
    """Two seconds of force control by roll in degrees."""
    return {roll: press(roll) for roll in (0.0, 5.0, 10.0)}


@pytest.mark.parametrize("roll", [0.0, 5.0, 10.0])
def test_force_control_holds_one_newton(pressed, roll):
    down = -pressed[roll].wrench[300:, 2]
    assert down.mean() == pytest.approx(1.0, abs=0.05)
    assert np.abs(down[-150:] - 1.0).max() < 0.05


@pytest.mark.parametrize(("force", "factor"), [(1.0, 0.7), (1.0, 1.4), (2.0, 1.0)])
def test_force_is_held_with_a_noisy_wrist_on_a_soft_or_hard_board(force, factor):
    control = committed(ControlParameters, "testbed.control", force_n=force)
    log = press(10.0, control=control, board_stiffness_factor=factor)
    assert -log.wrench[300:, 2].mean() == pytest.approx(force, rel=0.05)


def test_the_roll_torque_tells_the_tilt(pressed):
    torques = [-log.wrench[-150:, 4].mean() for log in pressed.values()]  # of the board on the tool
    assert torques[0] == pytest.approx(0.0, abs=2e-4)
    assert torques[0] + 5e-4 < torques[1] < torques[2] - 5e-4


def test_the_tool_is_seen_relative_to_the_board(pressed):
    """A tool that stays upright is off a board of roll r by -r."""
    for roll, log in pressed.items():
        seen = roll_deg(log.tool_to_board)
        assert seen[0] == pytest.approx(-roll, abs=0.01)
        np.testing.assert_allclose(np.linalg.norm(log.tool_to_board, axis=1), 1.0)
        assert (np.sum(log.tool_to_board[1:] * log.tool_to_board[:-1], axis=1) > 0).all()


def test_the_wrist_has_the_noise_that_it_is_given(pressed):
    rough = committed(ControlParameters, "testbed.control", force_noise_n=0.02, torque_noise_n_m=2e-4)
    noise = press(control=rough, ticks=300).wrench - pressed[0.0].wrench[:300]
    noise = noise[:60]  # before the loop has passed it on
    np.testing.assert_allclose(noise[:, :3].std(), 0.02, rtol=0.3)
    np.testing.assert_allclose(noise[:, 3:].std(), 2e-4, rtol=0.5)


def test_fingers_feel_the_turn_of_the_tool_in_the_hand():
    """A tool dragged over the tilted board turns about several axes of the grasp; fingers feel that."""
    way = DT * np.arange(300)[:, None] * np.array([0.02, -0.03, 0.0])
    motion = press_motion(300, position=beside_contact() + way)
    log = press(10.0, 300, motion=motion, force=np.full(300, 3.0))
    board = quaternion.from_rotation_vector(np.radians([0.0, 10.0, 0.0]))
    tool = quaternion.product(quaternion.product(board, log.tool_to_board), UPRIGHT)
    turn = quaternion.rotation_vector(quaternion.product(quaternion.conjugate(log.orientation), tool))
    largest = np.abs(turn).max(axis=0)
    assert largest[1] > 0.005
    assert largest[0] > 0.005
    pushed = np.einsum("tji,tj->ti", quaternion_matrices(log.orientation), -log.wrench[:, :3])
    force = pushed + quaternion_matrices(log.orientation)[:, 2] * -0.06 * 9.81
    feel = np.hstack([force, np.zeros((300, 3)), turn])[log.count_ticks]
    again = two_fingers().trace(feel[:, :3], feel[:, 3:6], feel[:, 6:])
    moved, expected = (counts[-10:].mean(axis=0) - counts[:2].mean(axis=0) for counts in (log.counts, again))
    assert np.corrcoef(moved, expected)[0, 1] > 0.9


def quaternion_matrices(q):
    """Rotation matrices (T, 3, 3)."""
    return np.stack([quaternion.rotate(q, axis) for axis in np.eye(3)], axis=2)


def test_the_controller_gets_each_reading_once():
    """Ticked by hand with the readings that the log has, it leads in the same way."""
    skill = scraping_skill({name: constant_network(-20.0) for name in ("turn", "scrape")})
    start = default_start(skill.primitives)
    leading, again = Controller(skill, 300.0), Controller(skill, 300.0)
    for controller in (leading, again):
        controller.start(start.position, start.orientation)
    pose = (start.position, quaternion.matrix(start.orientation))
    log = execute(
        WORLD, leading, pose, 500, conditions(5.0, 500), SILENT, two_fingers(), np.random.default_rng(3)
    )
    for k in range(500):
        again.tick(log.counts[k // FINGER_TICKS] if k % FINGER_TICKS == 0 else None)
        assert again.primitive == log.primitive[k]
    np.testing.assert_array_equal(again.orientation, leading.orientation)
    np.testing.assert_array_equal(again.deviation, leading.deviation)
    assert np.abs(leading.coupling) > 1.0


def test_before_the_contact_force_is_not_controlled():
    above = np.tile(beside_contact(0.02), (150, 1))
    motion = press_motion(150, primitive=np.zeros(150, dtype=np.int64), position=above)
    log = press(motion=motion, ticks=150)
    np.testing.assert_allclose(log.position[-1], above[0], atol=1e-5)
    assert np.abs(log.wrench[-30:, :3]).max() < 0.01
    assert (log.primitive == 0).all()


@pytest.mark.parametrize("roll", [-5.0, 10.0])
def test_a_person_turns_the_tool_flat(roll):
    """Within what still looks flat, whichever way the board is tilted; the force is held all the while."""
    ticks = 1200
    log = press(roll, ticks, person=corrector(EXACT, ticks, DT, np.random.default_rng(4)))
    lacking = roll_deg(log.tool_to_board)
    assert lacking[60] == pytest.approx(-roll, abs=1.0)
    assert np.abs(lacking[-100:]).max() < EXACT.threshold_deg + 0.1
    hand = roll_deg(quaternion.product(log.orientation, quaternion.conjugate(UPRIGHT)))
    assert hand[-1] == pytest.approx(roll, abs=EXACT.threshold_deg + 1.0)
    assert -log.wrench[-300:, 2].mean() == pytest.approx(1.0, abs=0.05)


def test_roll_of_a_tool_that_points_down():
    for roll in np.radians([-40.0, 0.0, 7.0]):
        about_y = np.array([[np.cos(roll), 0, np.sin(roll)], [0, 1, 0], [-np.sin(roll), 0, np.cos(roll)]])
        assert roll_of(about_y @ FLAT) == pytest.approx(roll, abs=1e-12)
