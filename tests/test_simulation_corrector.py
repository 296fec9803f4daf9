"""The person who corrects roll: late, in submovements, and only what looks wrong."""

import numpy as np
import pytest
from committed import committed

from structlearn.testbeds.scraping.world.corrector import CorrectorParameters, corrector, hold

DT = 1 / 300
SPREADS = ("reaction_spread_s", "refractory_spread_s", "gain_spread", "movement_spread_s")
WITHOUT = dict.fromkeys((*SPREADS, "bias_deg", "noise", "noise_mm"), 0.0)
TYPICAL = committed(CorrectorParameters, "testbed.corrector")
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


def minimum_jerk(s):
    s = np.clip(s, 0.0, 1.0)
    return 10 * s**3 - 15 * s**4 + 6 * s**5


@pytest.mark.parametrize("first", [0, 500])
def test_nothing_happens_before_the_reaction_time(first):
    torque = torques(np.full(600, 0.1), first=first)
    moving = np.flatnonzero(np.abs(torque) > 1e-9)
    assert moving[0] * DT == pytest.approx(PLAIN.reaction_s, abs=3 * DT)


def test_a_submovement_has_a_minimum_jerk_profile_of_the_gain():
    """The error goes away as soon as it is seen, so there is one submovement only."""
    error = np.radians(5.0)
    seen = np.where(np.arange(900) * DT <= PLAIN.reaction_s, error, 0.0)
    torque = torques(seen, PLAIN.model_copy(update={"damping_n_m_s_rad": 0.0, "refractory_s": 3.0}))
    onset = round(PLAIN.reaction_s / DT) * DT
    s = (np.arange(900) * DT - onset) / PLAIN.movement_s
    np.testing.assert_allclose(torque, PLAIN.gain * error * minimum_jerk(s), atol=1e-9)


@pytest.mark.parametrize(("gone_after", "share"), [(1, PLAIN.gain), (0, 0.0)])
def test_a_decision_is_about_what_was_to_be_seen_a_visual_delay_ago(gone_after, share):
    """An error that goes away within the delay is still corrected."""
    seen_tick = round(PLAIN.reaction_s / DT) - round(PLAIN.visual_delay_s / DT)
    error = np.where(np.arange(900) < seen_tick + gone_after, np.radians(5.0), 0.0)
    torque = torques(error, PLAIN.model_copy(update={"refractory_s": 3.0}))
    assert torque[-1] == pytest.approx(share * PLAIN.stiffness_n_m_rad * np.radians(5.0))


def test_damping_follows_the_rate_of_the_submovement():
    error = np.full(900, np.radians(5.0))
    once = {"refractory_s": 3.0}
    still = torques(error, PLAIN.model_copy(update=once | {"damping_n_m_s_rad": 0.0}))
    damped = torques(error, PLAIN.model_copy(update=once))
    rate = np.gradient(still / PLAIN.stiffness_n_m_rad, DT)
    np.testing.assert_allclose(damped - still, PLAIN.damping_n_m_s_rad * rate, atol=2e-4)


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
