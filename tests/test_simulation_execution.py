"""Runs in the world: the force is held, the torque tells the tilt, a person gets the tool flat."""

from dataclasses import fields

import numpy as np
import pytest
from committed import committed
from scraping_motions import FLAT, Press, beside_contact, conditions, roll_deg

from structlearn.ground import quaternion
from structlearn.simulation.fingers import FingerPair, TouchParameters
from structlearn.testbeds.scraping.world.corrector import Corrector, CorrectorParameters
from structlearn.testbeds.scraping.world.execution import (
    FINGER_TICKS,
    ControlParameters,
    RunLog,
    execute,
    roll_of,
)
from structlearn.testbeds.scraping.world.scraping_world import ScrapingWorld, WorldParameters

DT = 1 / 300
SILENT = committed(ControlParameters, "testbed.control", force_noise_n=0.0, torque_noise_n_m=0.0)


@pytest.fixture(scope="module")
def world():
    with ScrapingWorld(committed(WorldParameters, "testbed.world")) as one:
        yield one


def press(world, roll=0.0, ticks=600, control=SILENT, corrector=None, motion=None, **changes):
    start = (beside_contact(2e-4), FLAT)
    fingers = FingerPair(committed(TouchParameters, "testbed.touch"), 1, np.random.default_rng(2), 100.0)
    return execute(
        world,
        motion or Press(),
        start,
        ticks,
        conditions(roll, ticks, control, **changes),
        control,
        fingers,
        np.random.default_rng(3),
        corrector,
    )


@pytest.fixture(scope="module")
def pressed(world):
    """Two seconds of force control by roll in degrees."""
    return {roll: press(world, roll) for roll in (0.0, 5.0, 10.0)}


@pytest.mark.parametrize("roll", [0.0, 5.0, 10.0])
def test_force_control_holds_one_newton(pressed, roll):
    down = -pressed[roll].wrench[300:, 2]
    assert down.mean() == pytest.approx(1.0, abs=0.05)
    assert np.abs(down[-150:] - 1.0).max() < 0.05


@pytest.mark.parametrize(("force", "factor"), [(1.0, 0.7), (1.0, 1.4), (2.0, 1.0)])
def test_force_is_held_with_a_noisy_wrist_on_a_soft_or_hard_board(world, force, factor):
    control = committed(ControlParameters, "testbed.control", force_n=force)
    log = press(world, 10.0, control=control, board_stiffness_factor=factor)
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


def test_identical_runs_are_identical_to_the_last_bit(world, pressed):
    again = press(world, 5.0)
    with ScrapingWorld(committed(WorldParameters, "testbed.world")) as other:
        elsewhere = press(other, 5.0)
    for field in fields(RunLog):
        first = getattr(pressed[5.0], field.name)
        np.testing.assert_array_equal(getattr(again, field.name), first)
        np.testing.assert_array_equal(getattr(elsewhere, field.name), first)


def test_the_wrist_has_the_noise_that_it_is_given(world, pressed):
    rough = committed(ControlParameters, "testbed.control", force_noise_n=0.02, torque_noise_n_m=2e-4)
    noise = press(world, control=rough, ticks=300).wrench - pressed[0.0].wrench[:300]
    noise = noise[:60]  # before the loop has passed it on
    np.testing.assert_allclose(noise[:, :3].std(), 0.02, rtol=0.3)
    np.testing.assert_allclose(noise[:, 3:].std(), 2e-4, rtol=0.5)


def test_fingers_are_read_at_a_third_of_the_control_rate(pressed):
    log = pressed[0.0]
    np.testing.assert_array_equal(log.count_ticks, np.arange(0, 600, FINGER_TICKS))
    assert log.counts.shape == (200, 38)
    np.testing.assert_array_equal(log.counts, np.rint(log.counts))


class Fingers:
    """Remembers what it is read with: forces, torques and turns of the tool, hand frame."""

    def __init__(self):
        self.felt = []

    def read(self, force, torque, turn):
        self.felt.append(np.concatenate([force, torque, turn]))
        return np.zeros(38)


def test_fingers_feel_the_turn_of_the_tool_in_the_hand(world):
    """A tool dragged over the tilted board turns about several axes of the grasp."""

    class Drag(Press):
        velocity = np.array([0.02, -0.03, 0.0])

        def tick(self, counts):
            self.position = self.position + DT * self.velocity

    fingers = Fingers()
    start = (beside_contact(2e-4), FLAT)
    run = conditions(10.0, 300, force=np.full(300, 3.0))
    log = execute(world, Drag(), start, 300, run, SILENT, fingers, np.random.default_rng(3))
    felt = np.array(fingers.felt)
    board = quaternion.from_rotation_vector(np.radians([0.0, 10.0, 0.0]))
    tool = quaternion.product(quaternion.product(board, log.tool_to_board), Press.orientation)
    turn = quaternion.rotation_vector(quaternion.product(quaternion.conjugate(log.orientation), tool))
    largest = np.abs(turn).max(axis=0)
    assert largest[1] > 0.005
    assert largest[0] > 0.005
    np.testing.assert_allclose(felt[:, 6:], turn[log.count_ticks], atol=0.05 * largest.max())
    pushed = np.einsum("tji,tj->ti", quaternion_matrices(log.orientation), -log.wrench[:, :3])
    np.testing.assert_allclose(felt[30:, :3].mean(axis=0)[2], pushed[90:, 2].mean() + 0.6, atol=0.2)


def quaternion_matrices(q):
    """Rotation matrices (T, 3, 3)."""
    return np.stack([quaternion.rotate(q, axis) for axis in np.eye(3)], axis=2)


def test_the_motion_gets_each_reading_once(world):
    class Listening(Press):
        def __init__(self):
            self.heard = []

        def tick(self, counts):
            self.heard.append(None if counts is None else counts.copy())

    motion = Listening()
    log = press(world, ticks=31, motion=motion)
    assert [k for k, counts in enumerate(motion.heard) if counts is not None] == log.count_ticks.tolist()
    np.testing.assert_array_equal([counts for counts in motion.heard if counts is not None], log.counts)


def test_before_the_contact_force_is_not_controlled(world):
    class InTheAir(Press):
        primitive = 0
        position = beside_contact(0.02)

    log = press(world, motion=InTheAir(), ticks=150)
    np.testing.assert_allclose(log.position[-1], InTheAir.position, atol=1e-5)
    assert np.abs(log.wrench[-30:, :3]).max() < 0.01
    assert (log.primitive == 0).all()


NO_NOISE = dict.fromkeys(("bias_deg", "reaction_spread_s", "noise_mm", "gain_spread", "noise"), 0.0)
EXACT = committed(CorrectorParameters, "testbed.corrector", **NO_NOISE)


@pytest.mark.parametrize("roll", [-5.0, 10.0])
def test_a_person_turns_the_tool_flat(world, roll):
    """Within what still looks flat, whichever way the board is tilted; the force is held all the while."""
    ticks = 1200
    corrector = Corrector(EXACT, ticks, DT, np.random.default_rng(4))
    log = press(world, roll, ticks, corrector=corrector)
    lacking = roll_deg(log.tool_to_board)
    assert lacking[60] == pytest.approx(-roll, abs=1.0)
    assert np.abs(lacking[-100:]).max() < EXACT.threshold_deg + 0.1
    hand = roll_deg(quaternion.product(log.orientation, quaternion.conjugate(Press.orientation)))
    assert hand[-1] == pytest.approx(roll, abs=EXACT.threshold_deg + 1.0)
    assert -log.wrench[-300:, 2].mean() == pytest.approx(1.0, abs=0.05)


def test_what_looks_flat_to_a_person_is_where_the_tool_ends(world):
    """The mean over trials is flat within the standard error of the bias and half the threshold."""
    ends = []
    for trial in range(6):
        person = committed(CorrectorParameters, "testbed.corrector")
        corrector = Corrector(person, 1000, DT, np.random.default_rng(trial))
        ends.append(roll_deg(press(world, 5.0, 1000, corrector=corrector).tool_to_board)[-100:].mean())
    assert np.abs(ends).max() < 3 * person.bias_deg + person.threshold_deg + 0.3
    assert np.ptp(ends) > 0.1


def test_roll_of_a_tool_that_points_down():
    for roll in np.radians([-40.0, 0.0, 7.0]):
        about_y = np.array([[np.cos(roll), 0, np.sin(roll)], [0, 1, 0], [-np.sin(roll), 0, np.cos(roll)]])
        assert roll_of(about_y @ FLAT) == pytest.approx(roll, abs=1e-12)
