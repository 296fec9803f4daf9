"""Chains of actions between samples."""

from dataclasses import replace

import numpy as np
import pytest
from committed import committed
from tactile_toy import toy_dataset

from structlearn.core import quaternion
from structlearn.core.artefacts import write_tensors
from structlearn.core.errors import InputError
from structlearn.readers.demonstration import Demonstration
from structlearn.tactile import touch_dataset
from structlearn.tactile.electrodes import biotac

RATE_HZ = 100.0


def walk(lengths=(120, 100, 40)) -> touch_dataset.TouchDataset:
    """Contacts of these lengths, with random orientations; the second is for tests."""
    samples, rng = toy_dataset(contacts=len(lengths), samples=max(lengths)), np.random.default_rng(0)
    kept = np.concatenate([np.flatnonzero(samples.contact == n)[:length] for n, length in enumerate(lengths)])
    columns = {name: values[kept] for name, values in vars(samples).items() if np.ndim(values)}
    turned = quaternion.normalised(rng.normal(size=(len(kept), 4))).astype(np.float32)
    split = np.where(columns["contact"] == 1, touch_dataset.TEST, touch_dataset.TRAIN)
    return replace(samples, **columns | {"orientation": turned, "split": split})


def test_chains_never_leave_their_contact_nor_their_split():
    dataset = walk()
    found = touch_dataset.chains(dataset, 2, (30, 31))
    assert len(found) == 2 * (120 + 100) - 2 * (60 + 62)
    assert (dataset.contact[found.rows] == dataset.contact[found.rows[:, :1]]).all()
    steps = np.diff(found.rows, axis=1)
    np.testing.assert_allclose(steps / RATE_HZ, np.repeat(found.time_step[:, None], 2, axis=1))
    tested = touch_dataset.chains(dataset, 1, (31,), touch_dataset.TEST)
    assert (len(tested), set(dataset.contact[tested.rows].ravel())) == (100 - 31, {1})


def test_chains_need_pressure_at_every_sample():
    dataset = walk()
    dataset.pressed[60] = False
    found = touch_dataset.chains(dataset, 2, (20,))
    assert 60 not in found.rows
    assert len(found) == len(touch_dataset.chains(walk(), 2, (20,))) - 3


def test_an_action_is_the_mean_velocity_in_the_frame_of_the_finger():
    """Eq. II.25 with the mean over the step, one chain by hand."""
    dataset = walk()
    found = touch_dataset.chains(dataset, 2, (7,))
    place = 33
    for step in range(2):
        start, end = found.rows[place, step : step + 2]
        rotation = quaternion.matrix(dataset.orientation[start].astype(float))
        mean = dataset.velocity[start:end].mean(axis=0)
        np.testing.assert_allclose(found.actions[place, step, :3], rotation.T @ mean[:3], atol=1e-6)
        np.testing.assert_allclose(found.actions[place, step, 3:], rotation.T @ mean[3:], atol=1e-6)


def test_files_give_back_the_dataset(tmp_path):
    dataset = walk()
    touch_dataset.write_dataset(dataset, tmp_path / "touch.safetensors")
    back = touch_dataset.read_dataset(tmp_path / "touch.safetensors")
    for name, values in vars(dataset).items():
        np.testing.assert_array_equal(getattr(back, name), values)
    write_tensors({"rows": np.zeros(3)}, tmp_path / "other.safetensors", "something else")
    with pytest.raises(InputError, match="holds no samples of touch"):
        touch_dataset.read_dataset(tmp_path / "other.safetensors")


PARAMETERS = committed(touch_dataset.TouchDataParameters, "touch_dataset")
OFFSET = np.linspace(-40, 40, 19)


def pressed_twice(name: str = "one", **changes) -> Demonstration:
    """Electrode 18 falls by 2000 counts from 2 to 6 s and from 8 to 12 s; the finger glides at 0.01 m/s."""
    time = np.arange(1400) / RATE_HZ
    counts = np.tile(OFFSET, (len(time), 1))
    counts[:, 17] -= 2000.0 * (((time > 2) & (time < 6)) | ((time > 8) & (time < 12)))
    turn = quaternion.from_rotation_vector(np.outer(0.2 * time, [1.0, 0.0, 0.0]))
    fields = {"time": time, "position": np.outer(0.01 * time, [1.0, 0.0, 0.0]), "orientation": turn}
    fields |= {"tactile": counts, "provenance": {"motion": "rotation"}}
    return Demonstration(name, **fields | changes)


def test_contacts_are_found_with_their_velocities_and_offsets():
    dataset = touch_dataset.prepare([pressed_twice(), pressed_twice("two")], biotac(), PARAMETERS)
    assert dataset.contact.max() == 3
    assert np.bincount(dataset.contact) == pytest.approx(400, abs=60)
    middle = (dataset.time > 3.5) & (dataset.time < 4.5)
    expected = np.zeros(19)
    expected[17] = -2000.0
    np.testing.assert_allclose(dataset.signals[middle], np.tile(expected, (middle.sum(), 1)), atol=25)
    np.testing.assert_allclose(dataset.pressure, -dataset.signals.mean(axis=1), atol=1e-3)
    np.testing.assert_allclose(
        dataset.velocity[middle], np.tile([0.01, 0, 0, 0.2, 0, 0], (middle.sum(), 1)), atol=1e-4
    )
    np.testing.assert_allclose(dataset.contact_point[middle], [[-9.8e-3, 0, -7e-3]] * middle.sum(), atol=1e-4)
    assert (dataset.motion == touch_dataset.ROTATION).all()
    assert set(dataset.split) == set(touch_dataset.SPLITS.values())
    assert not dataset.pressed.all()
    assert (dataset.pressure[dataset.pressed] >= PARAMETERS.pressed_counts).all()
    for contact in range(4):
        assert len(np.unique(dataset.split[dataset.contact == contact])) == 1


def test_splits_have_their_shares_and_spread_over_motions():
    motions = np.repeat([0, 1], [42, 112])
    split = touch_dataset.splits(motions, PARAMETERS)
    assert np.bincount(split).tolist() == [154 - 24, 12, 12]
    for number in (touch_dataset.VALIDATION, touch_dataset.TEST):
        assert 2 <= (motions[split == number] == 0).sum() <= 5
    assert sorted(touch_dataset.splits(np.zeros(3), PARAMETERS)) == list(touch_dataset.SPLITS.values())
    np.testing.assert_array_equal(split, touch_dataset.splits(motions, PARAMETERS))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tactile": None}, "one: has no tactile signal"),
        ({"orientation": None}, "one: has no orientation"),
        ({"tactile": np.zeros((1400, 18))}, "has 18 tactile channels, the skin 'biotac' 19"),
        ({"tactile": np.zeros((1400, 19))}, "one: nothing touches for 1 s"),
        ({"tactile": np.where(np.arange(19) == 2, np.nan, np.zeros((1400, 19)))}, "row 0, electrode 3"),
        ({"time": np.arange(1400) / 300}, "300 samples per s, not 100"),
        ({}, "need three contacts, the recordings have 2"),
    ],
)
def test_readers_that_cannot_be_used_are_named(changes, message):
    with pytest.raises(InputError, match=message):
        touch_dataset.prepare([pressed_twice(**changes)], biotac(), PARAMETERS)
