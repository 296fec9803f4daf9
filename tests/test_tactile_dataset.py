"""Chains of actions between samples."""

import numpy as np
import pytest

from structlearn.ground import quaternion
from structlearn.ground.artefacts import write_tensors
from structlearn.ground.errors import InputError
from structlearn.tactile.touch_dataset import TEST, TRAIN, TouchDataset, chains, read_dataset, write_dataset

RATE_HZ = 100.0


def walk(lengths=(120, 100, 40), seed: int = 0) -> TouchDataset:
    """Contacts of these lengths, with random velocities and orientations."""
    rng = np.random.default_rng(seed)
    count = sum(lengths)
    contact = np.repeat(np.arange(len(lengths)), lengths)
    return TouchDataset(
        signals=rng.normal(size=(count, 19)).astype(np.float32),
        pressure=rng.normal(size=count).astype(np.float32),
        contact_point=rng.normal(size=(count, 3)).astype(np.float32),
        velocity=rng.normal(size=(count, 6)).astype(np.float32),
        orientation=quaternion.normalised(rng.normal(size=(count, 4))).astype(np.float32),
        contact=contact,
        pressed=np.full(count, True),
        trial=contact,
        time=np.concatenate([np.arange(length) / RATE_HZ for length in lengths]).astype(np.float32),
        motion=np.zeros(count, dtype=int),
        split=np.where(contact == 1, TEST, TRAIN),
        rate_hz=np.array(RATE_HZ),
    )


def test_chains_never_leave_their_contact():
    dataset = walk()
    found = chains(dataset, 2, (30, 31))
    assert len(found) == 2 * (120 + 100) - 2 * (60 + 62)
    assert (dataset.contact[found.rows] == dataset.contact[found.rows[:, :1]]).all()
    steps = np.diff(found.rows, axis=1)
    np.testing.assert_allclose(steps / RATE_HZ, np.repeat(found.time_step[:, None], 2, axis=1))


def test_chains_need_pressure_at_every_sample():
    dataset = walk()
    dataset.pressed[60] = False
    found = chains(dataset, 2, (20,))
    assert 60 not in found.rows
    assert len(found) == len(chains(walk(), 2, (20,))) - 3


def test_chains_of_a_split():
    dataset = walk()
    found = chains(dataset, 1, (31,), TEST)
    assert len(found) == 100 - 31
    assert (dataset.contact[found.rows] == 1).all()


def test_an_action_is_the_mean_velocity_in_the_frame_of_the_finger():
    """Eq. II.25 with the mean over the step, one chain by hand."""
    dataset = walk()
    found = chains(dataset, 2, (7,))
    place = 33
    for step in range(2):
        start, end = found.rows[place, step : step + 2]
        rotation = quaternion.matrix(dataset.orientation[start].astype(float))
        mean = dataset.velocity[start:end].mean(axis=0)
        np.testing.assert_allclose(found.actions[place, step, :3], rotation.T @ mean[:3], atol=1e-6)
        np.testing.assert_allclose(found.actions[place, step, 3:], rotation.T @ mean[3:], atol=1e-6)


def test_chains_longer_than_any_contact():
    assert len(chains(walk(), 10, (31,))) == 0
    with pytest.raises(ValueError, match="positive lengths"):
        chains(walk(), 0)


def test_files_give_back_the_dataset(tmp_path):
    dataset = walk()
    write_dataset(dataset, tmp_path / "touch.safetensors")
    back = read_dataset(tmp_path / "touch.safetensors")
    for name, values in vars(dataset).items():
        np.testing.assert_array_equal(getattr(back, name), values)
    write_tensors({"rows": np.zeros(3)}, tmp_path / "other.safetensors", "something else")
    with pytest.raises(InputError, match="holds no samples of touch"):
        read_dataset(tmp_path / "other.safetensors")
