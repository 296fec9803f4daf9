import numpy as np
import pytest
from committed import committed
from scraping_motions import simulated

from dissertation.scraping.world.demonstrator import (
    FLAT_ORIENTATION,
    DemonstratorParameters,
    intended_movements,
)
from dissertation.simulation.hand_noise import hand_noise
from dissertation.simulation.individuals import drawn
from structlearn.core import quaternion


def pose_of(recording):
    (stream,) = (stream for stream in recording.streams if stream.kind == "pose")
    return (stream.stamps - stream.stamps[0]) * 1e-9, stream.values


@pytest.fixture(scope="module")
def noise_free():
    return simulated(noise_mm=0)


def test_true_cut_points_are_where_the_speed_passes_five_per_cent_of_its_peak(noise_free):
    for recording in noise_free:
        time, pose = pose_of(recording)
        for (start, end), axis in zip(recording.true_segments[[0, 2]], (2, 1), strict=True):
            speed = np.abs(np.gradient(pose[:, axis], time))
            peak = speed[(time > start) & (time < end)].max()
            assert peak > 0.03
            np.testing.assert_allclose(np.interp([start, end], time, speed) / peak, 0.05, atol=0.02)


def test_task_is_the_one_of_the_dissertation(noise_free):
    moves, turns = [], []
    for recording in noise_free:
        time, pose = pose_of(recording)
        cuts = np.searchsorted(time, recording.true_segments)
        moves.append(pose[cuts[:, 1], :3] - pose[cuts[:, 0], :3])
        turns.append(quaternion.angle_between(pose[cuts[:, 1], 3:], pose[cuts[:, 0], 3:]))
    moves, turns = np.array(moves), np.degrees(turns)
    assert np.abs(moves[:, 0, 2] + 0.087).max() < 0.012  # down 8.7 cm, start scatters by 3 mm
    assert np.abs(moves[:, 2, 1] - 0.064).max() < 0.006  # forward 6.4 cm
    assert np.linalg.norm(moves[:, 1], axis=1).max() < 0.006  # the turn hardly translates
    assert ((turns[:, 1] > 2) & (turns[:, 1] < 10)).all()
    assert turns[:, 1].mean() > 2 * turns[:, 0].mean()  # no correction before the contact
    last = np.array([pose_of(recording)[1][-1, 3:] for recording in noise_free])
    assert np.degrees(quaternion.angle_between(last, FLAT_ORIENTATION)).max() < 2


def test_durations_vary_between_trials_around_their_medians():
    person = committed(DemonstratorParameters, "simulate", count=200, hesitation_probability=0)
    movements = intended_movements(person, rate_hz=50.0)
    durations = np.array([np.diff(movement.segments, axis=1)[:, 0] for movement in movements])
    visible = np.median(durations, axis=0) / [1.7, 2.6 + 2 * 0.5, 2.6]  # the turn has a pause at either end
    assert (visible > 0.85).all()  # a minimum-jerk movement shows 88 % of its duration above 5 % of its peak
    assert (visible < 1.1).all()
    np.testing.assert_allclose(durations[:, 0].std() / durations[:, 0].mean(), 0.12, rtol=0.2)


def test_people_differ_in_pace_by_the_spread_of_their_durations():
    population = committed(DemonstratorParameters, "simulate", count=8, hesitation_probability=0)
    alike = [population.model_copy(update={"seed": seed}) for seed in range(60)]
    spreads = []
    for people in (alike, [drawn(population, one.seed) for one in alike]):
        descents = [[one.segments[0] for one in intended_movements(person, 50.0)] for person in people]
        spreads.append(np.log(np.diff(descents)[..., 0]).mean(axis=1).std())
    assert spreads[0] < 0.07  # submovements, and the mean over eight trials
    assert np.sqrt(spreads[1] ** 2 - spreads[0] ** 2) == pytest.approx(0.2, rel=0.25)


def test_time_is_warped_non_linearly(noise_free):
    """No two descents are stretched copies of each other: alignment has something to do."""
    fractions = np.linspace(0, 1, 101)
    descents = []
    for recording in noise_free:
        time, pose = pose_of(recording)
        start, end = recording.true_segments[0]
        z = np.interp(start + fractions * (end - start), time, pose[:, 2])
        descents.append((z - z[-1]) / (z[0] - z[-1]))
    assert np.std(descents, axis=0).max() > 0.03
    assert (np.diff(descents, axis=1) < 1e-6).all()  # yet the hand never turns back


@pytest.mark.parametrize(
    ("fewer", "more", "low", "high"),
    [
        ({"hesitation_probability": 0}, {"hesitation_probability": 1}, [0.03] * 3, [0.5] * 3),
        ({"pause_s": (0, 0)}, {"pause_s": (1, 2)}, [-1e-9, 2.0, -1e-9], [1e-9, 4.0, 1e-9]),  # both switches
    ],
)
def test_hesitation_and_pauses_cost_time(fewer, more, low, high):
    for short, long in zip(simulated(**fewer), simulated(**more), strict=True):
        gained = (np.diff(long.true_segments) - np.diff(short.true_segments))[:, 0]
        assert (gained >= low).all()
        assert (gained <= high).all()


def test_noise_level_scales_the_noise_and_nothing_else(noise_free):
    for clean, low, high in zip(noise_free, simulated(noise_mm=0.3), simulated(noise_mm=1.2), strict=True):
        np.testing.assert_array_equal(clean.true_segments, high.true_segments)
        reference = pose_of(clean)[1][:, :3]
        low_noise = pose_of(low)[1][:, :3] - reference
        np.testing.assert_allclose(pose_of(high)[1][:, :3] - reference, 4 * low_noise, atol=1e-12)
        np.testing.assert_allclose(1e3 * low_noise[:, :2].std(axis=0), 0.3, rtol=0.25)


def test_noise_is_band_limited(noise_free):
    noisy = simulated(noise_mm=1, count=1)[0]
    noise = pose_of(noisy)[1][:, 0] - pose_of(noise_free[0])[1][:, 0]
    power = np.abs(np.fft.rfft(noise * np.hanning(len(noise)))) ** 2
    frequency = np.fft.rfftfreq(len(noise), 1 / 300)
    assert power[frequency > 13].sum() < 1e-4 * power.sum()
    assert 0.03 < power[(frequency > 7.5) & (frequency < 12.5)].sum() / power.sum() < 0.3


def test_the_board_takes_noise_along_z_from_the_hand_while_it_carries_the_tool():
    velocity = np.random.default_rng(0).normal(size=(400, 3))
    contact = np.repeat([0.0, 0.5, 1.0, 0.0], 100)

    def noise(contact):
        return hand_noise(velocity, contact, 1.0, 100.0, np.random.default_rng(1))

    (air, turned), (held, also_turned) = noise(np.zeros(400)), noise(contact)
    np.testing.assert_allclose(held[:, 2], air[:, 2] * np.repeat([1.0, 0.65, 0.3, 1.0], 100))
    np.testing.assert_array_equal(held[:, :2], air[:, :2])
    np.testing.assert_array_equal(also_turned, turned)
