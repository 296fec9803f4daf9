"""Readings of any sensor, presses at known places, and servoing on a table of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from structlearn.core.errors import InputError
from structlearn.tactile.pressed_skin import (
    PressedSkin,
    TableRuns,
    drifted,
    plate_pairs,
    servo_on_table,
    skin_signals,
    walks,
)
from structlearn.tactile.touch_dataset import TEST, TRAIN


@pytest.fixture
def counts():
    return np.random.default_rng(0).normal(size=(30, 4)) * 100


def grid(size=8):
    x, y = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    return 1e-3 * np.column_stack([x.ravel(), y.ravel(), np.zeros(size**2)])


def test_a_gain_of_all_channels_changes_the_last_signal_alone(counts):
    signals, pressure = skin_signals(counts, "either", by_norm=True)
    stronger, more = skin_signals(3.0 * counts, "either", by_norm=True)
    np.testing.assert_allclose(np.linalg.norm(signals[:, :-1], axis=1), 1.0)
    np.testing.assert_allclose(stronger[:, :-1], signals[:, :-1])
    np.testing.assert_allclose(more - pressure, np.log(3.0))
    np.testing.assert_array_equal(signals[:, -1], pressure)
    counts[7] = 0.0
    with pytest.raises(InputError, match="row 7 is zero in all channels"):
        skin_signals(counts, "either", by_norm=True)


def test_pressure_follows_what_readings_do(counts):
    """Of a BioTac readings fall: p = -mean(s) (II.3.2)."""
    np.testing.assert_array_equal(skin_signals(counts, "falls", by_norm=False)[1], -counts.mean(axis=1))
    np.testing.assert_array_equal(skin_signals(counts, "rises", by_norm=False)[1], counts.mean(axis=1))
    signals, pressure = skin_signals(counts, "either", by_norm=False)
    np.testing.assert_array_equal(signals, counts)
    np.testing.assert_allclose(pressure**2, np.square(counts).sum(axis=1))


def test_copies_differ_by_a_gain(counts):
    found = drifted(counts, 0.5, 3, np.random.default_rng(0)).reshape(3, *counts.shape)
    np.testing.assert_array_equal(found[0], counts)
    gains = found[1:] / counts
    np.testing.assert_allclose(gains, gains[..., :1].repeat(4, axis=-1))
    assert 0.3 < np.log(gains[..., 0]).std() < 0.7


def test_pairs_know_their_distance_and_stay_in_their_split(counts):
    place, split = np.random.default_rng(1).normal(size=(30, 3)), np.where(np.arange(30) < 20, TRAIN, TEST)
    pairs = plate_pairs(PressedSkin(counts, counts[:, 0], split, place), TRAIN, 200, np.random.default_rng(2))
    assert (split[[pairs.first, pairs.second]] == TRAIN).all()
    expected = np.hypot(*(place[pairs.first] - place[pairs.second]).T[:2])
    np.testing.assert_allclose(pairs.distance, expected)


def test_walks_go_from_press_to_press():
    place = grid()
    split = np.where(place[:, 0] < 5.5e-3, TRAIN, TEST)
    skin = PressedSkin(np.zeros((64, 4)), np.zeros(64), split, place)
    found = walks(skin, 500, 2e-3, np.random.default_rng(0))
    assert found.actions.shape == (500, 3, 2)  # depth never changes, so it is no action
    np.testing.assert_allclose(found.actions, np.diff(place[found.rows], axis=1)[..., :2])
    assert (split[found.rows] == TRAIN).all()
    assert np.abs(found.actions).max() < 3e-3
    deeper = PressedSkin(skin.signals, skin.pressure, np.full(128, TRAIN), np.tile(place, (2, 1)))
    deeper.place[64:, 2] = 1e-3
    assert walks(deeper, 50, 2e-3, np.random.default_rng(0)).actions.shape == (50, 3, 3)


class Straight:
    """A servo that knows its place and goes straight, half the way a step; the third number is no place."""

    seeds, units = (0,), SimpleNamespace(action_scale=np.ones(2))

    def encode(self, signals):
        return signals

    def start(self, latent):
        return None

    def act(self, latent, target, memory):
        return 0.5 * (target - latent)[..., :2], memory


def test_a_servo_that_knows_its_place_arrives_on_the_straight_way():
    place = grid()
    table = PressedSkin(place.copy(), np.zeros(64), np.full(64, TEST), place)
    starts, targets = np.array([0, 9, 63]), np.array([63, 9, 7])
    done = servo_on_table(Straight(), table, starts, targets, 20, map_alone=True)
    assert done.path.shape == (21, 1, 3, 2)
    np.testing.assert_allclose(done.left()[-1], 0.0, atol=0.6e-3)  # the nearest press answers
    assert (done.arrival(1e-3)[0] >= 0).all()
    assert done.arrival(1e-3)[0, 1] == 0
    np.testing.assert_allclose(done.length_ratio(done.arrival(1e-3))[0, [0, 2]], 1.0)


def test_arrival_is_when_a_trial_stays():
    path = np.zeros((5, 1, 3, 2))
    path[:, 0, :, 0] = np.array([[3, 3, 0], [0, 2, 0], [3, 2, 0], [0, 1, 5], [0, 3, 5]])
    runs = TableRuns(path, np.zeros((3, 2)))
    np.testing.assert_array_equal(runs.arrival(0.5), [[3, -1, -1]])
    assert runs.length_ratio(runs.arrival(0.5))[0, 0] == pytest.approx(3.0)  # 9 m of way for 3 m
