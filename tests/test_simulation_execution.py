"""Runs in the world: the force is held, the torque tells the tilt, a person gets the tool flat."""

import numpy as np
import pytest
from committed import committed
from conftest import minimum_jerk
from scraping_motions import (
    FLAT,
    beside_contact,
    conditions,
    constant_network,
    press_motion,
    roll_deg,
    scraping_skill,
)

from dissertation.scraping.world.corrector import CorrectorParameters, corrector, hold
from dissertation.scraping.world.demonstrator import (
    DemonstratorParameters,
    intended_movements,
    orientation_of,
)
from dissertation.scraping.world.execution import FINGER_TICKS, ControlParameters, execute
from dissertation.scraping.world.scraping_world import WorldParameters
from dissertation.scraping.world.testbed import GuidanceParameters, guided_motion, pressure
from dissertation.simulation.fingers import FingerPair, PinchParameters
from structlearn.core import quaternion
from structlearn.feedback.runtime import Controller
from structlearn.primitives.sequence import default_start

DT = 1 / 300
SILENT = committed(ControlParameters, "testbed.control", force_noise_n=0.0, torque_noise_n_m=0.0)


NO_NOISE = dict.fromkeys(("bias_deg", "reaction_spread_s", "noise_mm", "gain_spread", "noise"), 0.0)
TYPICAL = committed(CorrectorParameters, "testbed.corrector")
EXACT = TYPICAL.model_copy(update=NO_NOISE)
WORLD = committed(WorldParameters, "testbed.world")
UPRIGHT = orientation_of(np.zeros(3))


def two_fingers():
    return FingerPair(committed(PinchParameters, "testbed.touch"), 1, np.random.default_rng(2), 100.0)


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


@pytest.mark.parametrize(("force", "factor"), [(1.0, 0.7), (1.0, 1.4), (2.0, 1.0)])
def test_force_is_held_with_a_noisy_wrist_on_a_soft_or_hard_board(force, factor):
    control = committed(ControlParameters, "testbed.control", force_n=force)
    log = press(10.0, control=control, board_stiffness_factor=factor)
    assert -log.wrench[300:, 2].mean() == pytest.approx(force, rel=0.05)


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
    back = quaternion.conjugate(log.orientation)
    force = quaternion.rotate(back, -log.wrench[:, :3] + np.array([0.0, 0.0, -0.06 * 9.81]))
    feel = np.hstack([force, np.zeros((300, 3)), turn])[log.count_ticks]
    again = two_fingers().trace(feel[:, :3], feel[:, 3:6], feel[:, 6:])
    moved, expected = (counts[-10:].mean(axis=0) - counts[:2].mean(axis=0) for counts in (log.counts, again))
    assert np.corrcoef(moved, expected)[0, 1] > 0.9


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


GUIDANCE = committed(GuidanceParameters, "testbed.guidance")


@pytest.fixture(scope="module")
def movement():
    quick = {"durations_s": (0.8, 1.0, 0.8), "rest_s": (0.1, 0.1), "pause_s": (0.1, 0.1)}
    (one,) = intended_movements(
        committed(DemonstratorParameters, "simulate", count=1, seed=0, hesitation_probability=0.0, **quick)
    )
    return one


@pytest.fixture(scope="module")
def guided(movement):
    ticks = len(movement.time)
    run = conditions(
        0.0,
        ticks,
        stiffness=(2 * np.pi * GUIDANCE.frequency_hz) ** 2,
        force=np.full(ticks, GUIDANCE.force_n),
        force_gains=(0.0, GUIDANCE.force_i_m_n_s),
    )
    first = orientation_of(movement.tilt[:1] + movement.tilt_noise[:1])[0]
    start = (movement.edge[0] + movement.edge_noise[0], quaternion.rotate(first, np.eye(3)).T)
    control = committed(ControlParameters, "testbed.control")
    motion, rng = guided_motion(movement), np.random.default_rng(3)
    return execute(WORLD, motion, start, ticks, run, control, two_fingers(), rng)


def test_the_arm_follows_the_intended_path(movement, guided):
    """Sideways within a few mm, and no further into the board than the pressure asks for."""
    off = guided.position - movement.edge
    assert np.linalg.norm(off[:, :2], axis=1).max() < 3e-3
    in_the_air = movement.time < movement.segments[0, 1] - 0.1
    assert np.abs(off[in_the_air, 2]).max() < 3e-3
    turned = quaternion.angle_between(guided.orientation, orientation_of(movement.tilt))
    assert np.degrees(turned).max() < 3.0


def test_the_pressure_settles_where_it_is_meant_to(movement, guided):
    down = -guided.wrench[:, 2]
    assert np.abs(down[movement.time < movement.segments[0, 1] - 0.2]).max() < 0.15
    assert down[movement.time > movement.segments[0, 1] + 1.2].mean() == pytest.approx(1.0, abs=0.1)


def test_people_reproduce_a_pressure_poorly_and_hold_it_better():
    own = committed(GuidanceParameters, "testbed.guidance", force_n=2.0)
    trials = np.array([pressure(own, 3000, DT, np.random.default_rng(seed)) for seed in range(60)])
    levels = np.log(trials.mean(axis=1) / 2.0)
    assert levels.mean() == pytest.approx(0.0, abs=3 * own.force_spread / 60**0.5)
    assert levels.std() == pytest.approx(own.force_spread, rel=0.3)
    within = trials.std(axis=1) / trials.mean(axis=1)
    assert within.mean() == pytest.approx(own.force_cv, rel=0.15)
    lag = round(own.force_fluctuation_s / DT)
    centred = trials - trials.mean(axis=1, keepdims=True)
    correlation = np.mean(centred[:, lag:] * centred[:, :-lag]) / np.mean(centred**2)
    assert correlation == pytest.approx(np.exp(-1), abs=0.08)


SPREADS = ("reaction_spread_s", "refractory_spread_s", "gain_spread", "movement_spread_s")
WITHOUT = dict.fromkeys((*SPREADS, "bias_deg", "noise", "noise_mm"), 0.0)
PLAIN = TYPICAL.model_copy(update=WITHOUT)
STILL = (0.0, 0.0)


def torques(errors, parameters=PLAIN, seed=0, first=0, nominal=STILL, hand=STILL):
    """Torque per tick for errors (T,) in rad, of a hand that does not give way."""
    person = corrector(parameters, first + len(errors), DT, np.random.default_rng(seed))
    return np.array([hold(person, first + k, error, nominal, hand) for k, error in enumerate(errors)])


def corrected(board, parameters=PLAIN, seed=0, seconds=5.0):
    """Roll (T,) in rad of a hand that goes where the person wants it, on a board of some roll."""
    ticks = round(seconds / DT)
    person = corrector(parameters, ticks, DT, np.random.default_rng(seed))
    roll, path = 0.0, np.empty(ticks)
    for k in range(ticks):
        path[k] = roll
        # with the hand at 0 the torque is stiffness times target plus damping times rate: solve for both
        torque = hold(person, k, board - roll, STILL, STILL)
        roll = (torque + parameters.damping_n_m_s_rad * roll / DT) / (
            parameters.stiffness_n_m_rad + parameters.damping_n_m_s_rad / DT
        )
    return path


@pytest.mark.parametrize("first", [0, 500])
def test_nothing_happens_before_the_reaction_time(first):
    torque = torques(np.full(600, 0.1), first=first)
    moving = np.flatnonzero(np.abs(torque) > 1e-9)
    assert moving[0] * DT == pytest.approx(PLAIN.reaction_s, abs=3 * DT)


def test_a_submovement_has_a_minimum_jerk_profile_of_the_gain():
    """The error goes away as soon as it is seen, so there is one submovement only; damping adds its rate."""
    error = np.radians(5.0)
    seen = np.where(np.arange(900) * DT <= PLAIN.reaction_s, error, 0.0)
    once = PLAIN.model_copy(update={"refractory_s": 3.0})
    undamped = torques(seen, once.model_copy(update={"damping_s": 0.0}))
    onset = round(PLAIN.reaction_s / DT) * DT
    wanted = PLAIN.gain * error * minimum_jerk((np.arange(900) * DT - onset) / PLAIN.movement_s)
    np.testing.assert_allclose(undamped, PLAIN.stiffness_n_m_rad * wanted, atol=1e-9)
    damping = PLAIN.damping_n_m_s_rad * np.gradient(wanted, DT)
    np.testing.assert_allclose(torques(seen, once) - undamped, damping, atol=2e-4)


@pytest.mark.parametrize(("gone_after", "share"), [(1, PLAIN.gain), (0, 0.0)])
def test_a_decision_is_about_what_was_to_be_seen_a_visual_delay_ago(gone_after, share):
    """An error that goes away within the delay is still corrected."""
    seen_tick = round(PLAIN.reaction_s / DT) - round(PLAIN.visual_delay_s / DT)
    error = np.where(np.arange(900) < seen_tick + gone_after, np.radians(5.0), 0.0)
    torque = torques(error, PLAIN.model_copy(update={"refractory_s": 3.0}))
    assert torque[-1] == pytest.approx(share * PLAIN.stiffness_n_m_rad * np.radians(5.0))


def test_the_hand_is_held_by_stiffness_and_damping():
    free = torques(np.full(500, 0.1))
    np.testing.assert_allclose(free - torques(np.full(500, 0.1), hand=(0.02, 0.0)), 0.02, atol=1e-12)
    np.testing.assert_allclose(free - torques(np.full(500, 0.1), hand=(0.0, 0.3)), 0.03, atol=1e-12)


@pytest.mark.parametrize("share", [-0.99, 0.5, 0.99])
def test_an_error_below_the_threshold_is_let_be(share):
    error = share * np.radians(PLAIN.threshold_deg)
    np.testing.assert_array_equal(torques(np.full(1500, error)), 0.0)


@pytest.mark.parametrize("roll_deg", [-8.0, 3.0, 10.0])
def test_a_seen_error_is_reduced_by_the_gain_until_it_looks_flat(roll_deg):
    board = np.radians(roll_deg)
    path = corrected(board)
    sparing = PLAIN.model_copy(update={"refractory_s": 1.0})
    once = corrected(board, sparing, seconds=PLAIN.reaction_s + PLAIN.movement_s)
    assert once[-1] / board == pytest.approx(PLAIN.gain, abs=0.02)
    assert abs(board - path[-1]) <= np.radians(PLAIN.threshold_deg)
    assert (np.diff(path) * np.sign(board) > -1e-9).all()  # what is under way is not done twice


def test_what_the_robot_will_do_itself_is_not_corrected():
    """The error of a tool that the nominal movement has yet to turn counts without that turn."""
    still_to_come, own = np.radians(3.0), np.radians(4.0)
    with_turn = torques(
        np.full(900, still_to_come + own), nominal=(-still_to_come, 0.0), hand=(-still_to_come, 0.0)
    )
    np.testing.assert_allclose(with_turn, torques(np.full(900, own)), atol=1e-12)


def test_overlapping_submovements_do_not_overshoot():
    """The visual delay is longer than the pause: without looking at what is under way it would."""
    hasty = PLAIN.model_copy(update={"refractory_s": 0.05, "visual_delay_s": 0.3, "gain": 1.0})
    board = np.radians(6.0)
    assert corrected(board, hasty).max() < 1.02 * board


def test_what_looks_flat_differs_between_trials_as_it_should():
    own = TYPICAL.model_copy(update={"noise_mm": 0.0, "threshold_deg": 0.01})
    ends = [np.degrees(corrected(np.radians(5.0), own, seed)[-1]) for seed in range(40)]
    assert np.mean(ends) == pytest.approx(5.0, abs=0.25)
    assert np.std(ends) == pytest.approx(own.bias_deg, rel=0.35)


def test_reaction_times_vary_but_nobody_is_faster_than_a_tenth_of_a_second():
    own = PLAIN.model_copy(update={"reaction_s": 0.2, "reaction_spread_s": 0.1})
    onsets = [np.flatnonzero(torques(np.full(300, 0.1), own, seed))[0] * DT for seed in range(30)]
    assert min(onsets) >= 0.1 - 1e-9
    assert np.std(onsets) > 0.04


@pytest.mark.parametrize("first", [0, 700])
def test_the_hand_does_not_jump_when_it_takes_hold(first):
    """The noise of the hand counts from where it is at the first call."""
    trembling = TYPICAL.model_copy(update={"bias_deg": 0.0, "noise_mm": 0.3})
    torque = torques(np.zeros(300), trembling, first=first)
    assert torque[0] == 0.0
    assert abs(torque[1]) < 1e-3
    assert np.abs(torque).max() > 1e-3  # later it trembles
