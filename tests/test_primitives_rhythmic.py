"""Rhythmic primitives reproduce closed forms; number, amplitude and frequency change at run time."""

from dataclasses import replace

import numpy as np
import pytest

from structlearn.core import quaternion, signals
from structlearn.primitives import canonical, rhythmic
from structlearn.primitives.orientation import fit_rhythmic_quaternion
from structlearn.primitives.rhythmic import Rhythm
from structlearn.primitives.trajectory import OrientationTrajectory, Trajectory
from structlearn.primitives.vector import VectorPrimitive, fit_rhythmic

DT = 0.005
SWING, BASE = np.array([0.12, 0.02, 0.0]), np.array([0.5, 0.1, 0.2])
PERIODS, RHYTHMS, AMPLITUDES = (
    [1.6, 1.8, 2.0],
    [Rhythm(0.0, 1.5), Rhythm(0.0, 2.0), Rhythm(0.5, 2.5)],
    [0.9, 1, 1.1],
)


def trajectory(position: np.ndarray) -> Trajectory:
    velocity = signals.derivative(position, DT)
    return Trajectory(DT * np.arange(len(position)), position, velocity, signals.derivative(velocity, DT))


def cycles(period: float, rhythm: Rhythm) -> np.ndarray:
    return rhythm.first + np.arange(round(period * rhythm.cycles / DT) + 1) * DT / period


def sine(at: np.ndarray) -> np.ndarray:
    return -np.cos(2 * np.pi * at)


def strokes(at: np.ndarray) -> np.ndarray:
    """Minimum-jerk strokes to and fro, each from rest to rest."""
    number = np.floor(2 * at + 1e-9)
    done = signals.minimum_jerk(2 * at - number)
    return 2.0 * np.where(number % 2 == 0, done, 1.0 - done) - 1.0


def path(form, period: float, rhythm: Rhythm, amplitude: float = 1.0) -> Trajectory:
    return trajectory(BASE + amplitude * SWING * form(cycles(period, rhythm))[:, None])


def learned(form) -> VectorPrimitive:
    return fit_rhythmic(list(map(path, [form] * 3, PERIODS, RHYTHMS, AMPLITUDES)), RHYTHMS)


def distance_mm(found: Trajectory, expected: Trajectory) -> float:
    return 1e3 * float(np.linalg.norm(found.position - expected.position, axis=1).max())


@pytest.mark.parametrize(("form", "bound_mm"), [(sine, 1.5), (strokes, 0.7)])  # a sine does not end at rest
def test_demonstrations_with_different_numbers_of_strokes_are_one_primitive(form, bound_mm):
    primitive = learned(form)
    assert primitive.rhythm == Rhythm(0.0, 2.0)  # of the median demonstration
    assert primitive.duration == pytest.approx(2 * 1.8)
    np.testing.assert_allclose(primitive.start, BASE - SWING, atol=3e-4)
    np.testing.assert_allclose(primitive.goal, BASE - SWING, atol=3e-4)
    for period, rhythm, amplitude in zip(PERIODS, RHYTHMS, AMPLITUDES, strict=True):
        shown = path(form, period, rhythm, amplitude)
        own = replace(primitive, weights=amplitude * primitive.weights, rhythm=rhythm)
        state = shown.velocity[0], shown.acceleration[0]
        again = own.unroll(DT, shown.position[0], shown.position[-1], shown.duration, *state)
        assert distance_mm(again, shown) < bound_mm  # of strokes of 240 mm


@pytest.mark.parametrize(
    ("number", "amplitude", "faster"), [(1.0, 0.5, 1.0), (1.5, 1.0, 2.0), (6.0, 1.2, 0.7)]
)
def test_number_amplitude_and_frequency_change_at_run_time(number, amplitude, faster):
    primitive = learned(strokes).repeated(number, amplitude)
    expected = path(strokes, 1.8 / faster, Rhythm(0.0, number), amplitude)
    np.testing.assert_allclose(
        primitive.goal - primitive.start, expected.position[-1] - expected.position[0], atol=4e-4
    )
    again = primitive.unroll(DT, None, None, expected.duration, 0.0, 0.0)
    moved = replace(expected, position=expected.position + again.position[-1] - expected.position[-1])
    assert distance_mm(again, moved) < 1.0
    assert np.linalg.norm(again.position[-1] - primitive.goal) < 3e-4


def test_starting_and_stopping_are_smooth_in_acceleration():
    """From rest into a sine that would start with its largest acceleration, and beyond the end of strokes."""
    primitive = learned(sine)
    period = primitive.duration / 2.0
    begun = primitive.unroll(DT, velocity=0.0, acceleration=0.0)
    np.testing.assert_allclose(begun.acceleration[0], 0.0, atol=1e-12)
    largest, started = np.abs(begun.acceleration).max(), begun.acceleration[: round(period / DT)]
    assert np.abs(np.diff(started, axis=0)).max() < 0.12 * largest  # of a jump by all of it
    steady = BASE + SWING * sine(cycles(period, Rhythm(0.0, 2.0)))[:, None]
    late = slice(len(steady) // 4, None)  # half a cycle later the transient is over
    assert np.linalg.norm(begun.position[late] - steady[late], axis=1).max() < 2e-3
    ended = learned(strokes).unroll(DT, until=2.0 * primitive.duration)
    after = ended.time > primitive.duration
    assert np.linalg.norm(ended.position[after] - ended.position[-1], axis=1).max() < 1e-3
    jumps = np.abs(np.diff(ended.acceleration, axis=0)).max(axis=1)
    assert jumps[after[1:]].max() < 0.02 * np.abs(ended.acceleration).max()


def test_a_drifting_baseline_is_followed_and_continues():
    """Strokes that move sideways, as a table is wiped: the drift per cycle stays."""
    sideways, period = np.array([0.0, 0.0, 0.03]), 1.8  # m per cycle
    shown = [path(strokes, period, rhythm) for rhythm in RHYTHMS]
    for number, (own, rhythm) in enumerate(zip(shown, RHYTHMS, strict=True)):
        drifted = own.position + np.linspace(0.0, rhythm.cycles, len(own.time))[:, None] * sideways
        shown[number] = trajectory(drifted)
    primitive = fit_rhythmic(shown, RHYTHMS).repeated(4.0)
    np.testing.assert_allclose(primitive.goal - primitive.start, 4.0 * sideways, atol=2e-3)
    again = primitive.unroll(DT)
    middle = again.position[len(again.time) // 2] - again.position[0]
    np.testing.assert_allclose(middle, 2.0 * sideways, atol=6e-3)


def test_orientations_stay_on_the_sphere_and_follow():
    axis = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
    base = quaternion.normalised(np.array([0.1, 0.9, 0.3, -0.2]))
    shown = []
    for period, rhythm in zip(PERIODS, RHYTHMS, strict=True):
        angle = 0.6 * strokes(cycles(period, rhythm))
        turned = quaternion.product(quaternion.from_rotation_vector(angle[:, None] * axis), base)
        rate = signals.derivative(angle, DT)[:, None] * axis
        time = DT * np.arange(len(angle))
        shown.append(OrientationTrajectory(time, turned, rate, signals.derivative(rate, DT)))
    primitive = fit_rhythmic_quaternion(shown, RHYTHMS)
    for own, rhythm in zip(shown, RHYTHMS, strict=True):
        again = replace(primitive, rhythm=rhythm).unroll(
            DT, own.orientation[0], own.orientation[-1], own.duration, 0.0, 0.0
        )
        np.testing.assert_allclose(np.linalg.norm(again.orientation, axis=1), 1.0, atol=1e-12)
        assert np.degrees(quaternion.angle_between(again.orientation, own.orientation)).max() < 0.5
    odd = primitive.repeated(2.5)
    angle = quaternion.difference(odd.goal, odd.start) @ axis
    assert angle == pytest.approx(1.2, abs=0.01)


@pytest.mark.parametrize("form", [sine, strokes])
def test_a_movement_may_stop_where_no_demonstration_did(form):
    """Demonstrations of 2 and 3 cycles end where they began; 2.5 cycles end on the other side."""
    rhythms = [Rhythm(0.0, 2.0), Rhythm(0.0, 3.0)]
    primitive = fit_rhythmic([path(form, 1.8, rhythm) for rhythm in rhythms], rhythms).repeated(2.5)
    np.testing.assert_allclose(primitive.goal - primitive.start, 2 * SWING, atol=0.015)
    again = primitive.unroll(DT)
    steady = path(form, 1.8, Rhythm(0.0, 2.5)).position
    assert np.linalg.norm(again.position - steady, axis=1).mean() < 5e-3


def test_steps_are_exact_at_any_rate():
    primitive = learned(strokes)
    fine, coarse = (primitive.unroll(dt) for dt in (0.001, 0.02))
    assert np.abs(fine.position[::20] - coarse.position).max() < 1e-4


def test_phase_of_feedback_is_that_of_the_cycle():
    p, u = rhythmic.phase(np.array([0.0, 0.25, 1.25, 2.0, 3.0]), Rhythm(0.5, 2.0))
    expected, rate = canonical.phase(np.array([0.5, 0.75, 0.75, 0.5, 0.5]), canonical.TAU_PER_DURATION)
    np.testing.assert_allclose(p, expected)
    np.testing.assert_allclose(u[:3], rate[:3])
    assert not u[3:].any()


@pytest.mark.parametrize(("number", "amplitude"), [(0.0, 1.0), (1.0, 0.0), (float("nan"), 1.0)])
def test_impossible_numbers_are_refused(number, amplitude):
    with pytest.raises(ValueError, match="must be positive, are"):
        learned(sine).repeated(number, amplitude)
