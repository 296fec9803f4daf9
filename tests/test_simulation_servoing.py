"""Closed loops of touch: kinematics against closed forms, an ideal controller, scores, variants."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from committed import committed, committed_finger
from hypothesis import given
from hypothesis import strategies as st

from dissertation.servoing.protocol import servo_scores
from dissertation.servoing.protocol.servo_trials import MOTIONS, draw, make_scene
from dissertation.servoing.protocol.servo_variants import (
    ServoTrialParameters,
    ToleranceParameters,
)
from dissertation.servoing.world.servo_loop import LoopParameters, LowPass, press_skin, servo
from dissertation.simulation.touch_demonstrator import ToucherParameters, covered
from structlearn.tactile.electrodes import SKINS

PERSON = committed(ToucherParameters, "toucher")
PARAMETERS = committed(ServoTrialParameters, "servo", rest_s=1.0)
SCENE = make_scene(PERSON, committed_finger(noise_counts=0.0), PARAMETERS)
LOOP = LoopParameters(cutoff_hz=20.0, samples_per_action=5)
RADIUS = SCENE.finger.skin.radius
TOLERANCE = committed(ToleranceParameters, "servo.tolerance")


class Steady:
    """Moves with one velocity, whatever it feels."""

    def __init__(self, velocity):
        self.velocity = np.array(velocity, dtype=float)

    def encode(self, signals):
        return signals[..., :3]

    def start(self, latent):
        return None

    def act(self, latent, target, memory):
        return np.broadcast_to(self.velocity, (*latent.shape[:-1], 6)), memory


def held(places, tilt=0.0):
    places = np.atleast_2d(np.array(places, dtype=float))
    return press_skin(places, np.full((len(places), 2), tilt), SCENE, np.random.default_rng(0))


def run(controller, start, target, seconds, loop=LOOP):
    return servo(controller, 1, start, target, SCENE, loop, seconds, np.random.default_rng(1))


def test_a_turn_about_x_rolls_the_contact_over_the_cylinder():
    """By radius times angle, at the same load; only the time to take up the speed is lost."""
    start = held([[-0.006, 0.001, 1.2], [-0.01, -0.002, 0.7]])
    found = run(Steady([0, 0, 0, 0.2, 0, 0]), start, start, 1.0)
    _, across = SCENE.finger.skin.coordinates(found.point)
    rolled = across[-1] - np.array([0.001, -0.002])
    np.testing.assert_allclose(np.abs(rolled), RADIUS * 0.2 * (1 - SCENE.follow_s), rtol=0.02)
    np.testing.assert_allclose(found.load, np.broadcast_to([1.2, 0.7], found.load.shape), rtol=1e-3)


@pytest.mark.parametrize(
    ("along", "velocity", "fault"),
    [(-0.006, [0, 0, 0.01, 0, 0, 0], "lifted"), (-0.013, [0.005, 0, 0, 0, 0, 0], "off_skin")],
)
def test_a_contact_that_is_lost_or_slides_over_the_end_is_counted(along, velocity, fault):
    start = held([along, 0.0, 1.0])
    found = run(Steady(velocity), start, start, 1.0)
    table = servo_scores.scored(found, start, start, SCENE, TOLERANCE).iloc[0]
    assert table[fault]
    assert not table["success"]
    assert (found.load[-1] == 0) == (fault == "lifted")
    assert np.isnan(table["reach_s"])


def test_scores_of_a_straight_approach():
    """An ideal controller rolls on at a constant speed and stops; times and paths are known."""
    start, target = held([-0.006, -0.003, 1.0]), held([-0.006, 0.003, 1.0])
    turned = run(Steady([0, 0, 0, 0.2, 0, 0]), start, target, 0.5)
    sign = np.sign(SCENE.finger.skin.coordinates(turned.point)[1][-1, 0] + 0.003)
    seconds = 0.006 / (RADIUS * 0.2) + SCENE.follow_s
    found = run(Steady([0, 0, 0, 0.2 * sign, 0, 0]), start, target, seconds)
    tolerance = TOLERANCE.model_copy(update={"judged_s": 0.05, "pressure": 0.5})  # electrodes differ by place
    table = servo_scores.scored(found, start, target, SCENE, tolerance).iloc[0]
    assert table["success"]
    assert table["geodesic_mm"] == pytest.approx(6.0, rel=1e-3)
    assert table["path_mm"] == pytest.approx(6.0, abs=0.2)
    assert table["reach_s"] == pytest.approx(seconds - 1e-3 / (RADIUS * 0.2), abs=0.1)
    course = servo_scores.servo_progress(found, target, SCENE, TOLERANCE)
    assert (np.diff(course["median_mm"]) < 0).all()
    assert course["within"].iloc[-1] == 1


def test_errors_of_pressure_and_load_are_relative_to_the_target():
    target = held([-0.006, 0.0, 1.0])
    found = run(Steady(np.zeros(6)), target, target, 0.5)
    judged = round(TOLERANCE.judged_s * SCENE.sample_hz)
    wanted, count = target.signals[-judged:].mean(axis=(0, 2)), found.signals.shape
    for factor in (0.5, 1.25, 2.0):
        signals = np.broadcast_to(factor * wanted[:, None], count)
        pressed = replace(
            found, signals=signals, load=factor * np.broadcast_to(target.contact.load, count[:2])
        )
        _, pressure = servo_scores.target_errors(pressed, target, judged)
        np.testing.assert_allclose(pressure, abs(factor - 1.0))
        scores = servo_scores.scored(pressed, target, target, SCENE, TOLERANCE).iloc[0]
        assert scores["pressure_error"] == pytest.approx(abs(factor - 1.0))
        assert scores["load_error"] == pytest.approx(abs(factor - 1.0))


def test_trials_of_one_model_are_those_of_another():
    """Trials do not depend on what else is in the batch."""
    places = [[-0.006, -0.003, 1.0], [0.001, 0.003, 1.5]]
    both = run(Steady([0.002, 0, 0, 0.1, 0, 0]), held(places), held(places), 0.3)
    one = run(Steady([0.002, 0, 0, 0.1, 0, 0]), held(places[1]), held(places[1]), 0.3)
    np.testing.assert_allclose(both.point[:, 1], one.point[:, 0], atol=1e-12)
    np.testing.assert_array_equal(both.signals[:, 1], one.signals[:, 0])


@given(st.lists(st.integers(1, 20), min_size=1, max_size=6))
def test_the_low_pass_is_the_same_in_any_pieces(sizes):
    signals = np.random.default_rng(0).normal(size=(sum(sizes), 2, 3))
    whole = LowPass(5.0, 100.0, (2, 3))(signals)
    low_pass = LowPass(5.0, 100.0, (2, 3))
    pieces = [low_pass(piece) for piece in np.split(signals, np.cumsum(sizes)[:-1])]
    np.testing.assert_allclose(np.concatenate(pieces), whole, atol=1e-12)


def test_drawn_trials_are_on_what_was_demonstrated():
    start, target, motion = draw(PERSON, PARAMETERS, 6, np.random.default_rng(0))
    (low, high), (left, right) = covered(PERSON, SKINS[PERSON.skin])
    for places in (start, target):
        assert (places >= [low, left, 0.8]).all()
        assert (places <= [high, right, 2.0]).all()
    moved = start != target
    np.testing.assert_array_equal(moved[:, 0], motion != MOTIONS.index("rotation"))
    np.testing.assert_array_equal(moved[:, 1], motion != MOTIONS.index("translation"))
    assert len(start) == 6 * PARAMETERS.trials


def test_rates_by_group_and_tolerance():
    trials = pd.DataFrame(
        {
            "form": ["a"] * 4 + ["b"] * 2,
            "success": [True, True, False, True, False, False],
            "position_error_mm": [0.1, 0.4, 3.0, 0.9, 2.0, 0.2],
            "pressure_error": [0.0, 0.05, 0.0, 0.1, 0.0, 0.5],
            "reach_s": [1.0, 2.0, np.nan, 3.0, np.nan, np.nan],
            "path_mm": [2.0, 3.0, 9.0, 4.0, 1.0, 1.0],
            "geodesic_mm": [2.0, 2.0, 2.0, 2.0, 1.0, 1.0],
            "lifted": [False, False, True, False, False, False],
            "off_skin": [False] * 6,
        }
    )
    table = servo_scores.success_rates(trials, ["form"])
    assert table["rate"].tolist() == [0.75, 0.0]
    assert table["reach_s"].iloc[0] == 2.0
    assert table["path_ratio"].iloc[0] == 1.5
    assert table["lifted"].tolist() == [1, 0]
    curve = servo_scores.success_by_tolerance(trials, ["form"], np.array([0.5, 2.5]), 0.1)
    assert curve.groupby("form", sort=False)["rate"].agg(list).tolist() == [[0.5, 0.75], [0.0, 0.5]]
