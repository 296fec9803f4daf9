"""What carries over between sets of touches: made-up sets, and the recordings where they are at hand."""

from dataclasses import replace

import numpy as np
import pytest
from committed import committed_entry
from tactile_toy import toy_dataset, toy_geodesics

from dissertation.recorded.readers import clmc, slide
from dissertation.recorded.transfer import learning as touch_transfer
from dissertation.recorded.transfer.learning import (
    MAGNITUDES,
    PARTNERS,
    SIMULATED,
    SLIDES,
    UNSCREWING,
    TouchSet,
)
from structlearn.core.errors import InputError, MissingInputError
from structlearn.readers import synchronise
from structlearn.readers.demonstration import Demonstration
from structlearn.tactile.electrodes import biotac
from structlearn.tactile.touch_dataset import TEST, TRAIN
from structlearn.tasks.touch.touch_names import COMPONENTS, PLAIN, STRUCTURED

SKIN = biotac()
FEW = committed_entry(
    "biotac",
    spaces={"seeds": 1, "training": {"steps": 2, "batch_size": 8}, "pair_pool": 100, "evaluation_pairs": 50},
)


def touch_set(name, trials, seed=0, scale=1.0):
    samples = toy_dataset(contacts=trials, samples=130, seed=seed)
    signals = (scale * samples.signals).astype(np.float32)
    samples = replace(samples, signals=signals, pressure=-signals.mean(axis=1))
    return TouchSet(name, samples, toy_geodesics(samples, bins=1, size=200))


@pytest.fixture(scope="module")
def results():
    """Slides and their partner are the same touches in other counts, the other two sets are not."""
    sets = [
        touch_set(SLIDES, 4),
        touch_set(MAGNITUDES, 4, scale=0.25),
        touch_set(UNSCREWING, 3),
        touch_set(SIMULATED, 4, seed=3),
    ]
    return touch_transfer.learn_transfer(sets, FEW)


def demonstration(name, counts):
    time = np.arange(len(counts)) / 100
    angle = 0.1 * np.sin(time)
    zero = np.zeros_like(time)
    orientation = np.column_stack([np.cos(angle / 2), np.sin(angle / 2), zero, zero])
    position = np.column_stack([0.025 * time, zero, zero])
    return Demonstration(name, time, position, orientation, tactile=counts)


def test_counts_that_rise_are_pressure_and_every_trial_is_a_contact():
    counts = np.full((200, 19), -5.0)
    counts[:, 8] = 400.0
    samples = touch_transfer.held_touch([demonstration(name, counts) for name in "ab"], SKIN, 1.0)
    np.testing.assert_allclose(samples.signals, -np.tile(counts, (2, 1)), rtol=1e-4)
    np.testing.assert_allclose(samples.pressure, (400.0 - 18 * 5.0) / 19, rtol=1e-4)
    np.testing.assert_allclose(samples.contact_point[0], SKIN.project(SKIN.electrodes[8]), atol=1e-6)
    np.testing.assert_allclose(samples.velocity[50:150, 0], 0.025, rtol=1e-2)
    np.testing.assert_array_equal(samples.trial, np.repeat([0, 1], 200))
    np.testing.assert_array_equal(samples.contact, samples.trial)
    assert samples.rate_hz == pytest.approx(100.0)


def test_magnitudes_forget_the_direction_of_a_change():
    samples = toy_dataset(contacts=2, samples=50)
    flipped = replace(samples, signals=samples.signals * np.float32([-1, 1] * 9 + [-1]))
    found, other = (touch_transfer.magnitudes(one, SKIN) for one in (samples, flipped))
    np.testing.assert_array_equal(found.signals, other.signals)
    np.testing.assert_array_equal(found.contact_point, other.contact_point)
    assert (found.signals <= 0).all()
    np.testing.assert_allclose(found.pressure, np.abs(samples.signals).mean(axis=1), rtol=1e-6)


def test_every_recorded_trial_is_held_out_once():
    slides = touch_set(SLIDES, 5)
    parts = touch_transfer.held_out(slides)
    np.testing.assert_array_equal(np.concatenate(parts), np.arange(5))
    held_out = slides.without(parts[2])
    np.testing.assert_array_equal(held_out.split == TEST, held_out.trial == 2)
    assert (slides.without(()).split == TRAIN).all()
    assert [part.tolist() for part in touch_transfer.held_out(touch_set(SIMULATED, 5))] == [[0, 3]]
    samples = slides.without(())
    with pytest.raises(InputError, match="unscrewing: of a single trial none can be left out"):
        touch_transfer.held_out(TouchSet(UNSCREWING, replace(samples, trial=0 * samples.trial), None))


def test_all_is_asked_of_all_models(results):
    counts = results["errors"].groupby(["learned_from", "test_run", "model"])["part"].nunique()
    for model in (STRUCTURED, PLAIN, COMPONENTS):
        assert counts[SLIDES, SLIDES, model] == 4
        assert counts[UNSCREWING, UNSCREWING, model] == 3
        for name, partner in PARTNERS.items():
            assert counts[partner, partner, model] == counts[partner, name, model] == 1
    assert results["errors"]["reconstruction"].notna().all()
    assert results["sets"].set_index("set")["trials"].to_dict() == {
        SLIDES: 4,
        MAGNITUDES: 4,
        UNSCREWING: 3,
        SIMULATED: 4,
    }


def test_a_partner_in_other_counts_is_as_good_as_the_set_itself(results):
    errors = results["errors"][results["errors"]["model"] == COMPONENTS]
    by = errors.groupby(["learned_from", "test_run"])["reconstruction"].mean()
    assert by[MAGNITUDES, SLIDES] < 0.2
    assert by[MAGNITUDES, SLIDES] < by[SLIDES, SLIDES]  # trials that are new
    assert by[MAGNITUDES, SLIDES] < by[SIMULATED, UNSCREWING]


def sets_of(slides, logs, faulty=(), **changes):
    """Sets of recorded trials beside simulated touches, with distances on the skin."""
    few = FEW.geodesics.model_copy(update={"bin_size": 100, "bins": 1, "bridge_mm": 20.0} | changes)
    simulated = toy_dataset(contacts=4, samples=130)
    return touch_transfer.touch_sets({SLIDES: slides, UNSCREWING: logs}, simulated, SKIN, 1.0, faulty, few)


def wandering(*trials, samples=150):
    counts = 50.0 + 10.0 * np.random.default_rng(0).normal(size=(150, 19)).cumsum(axis=0) / 12
    return [demonstration(name, np.abs(counts[:samples])) for name in trials]


def test_a_faulty_trial_is_left_out_altogether():
    trials, faulty = wandering("mat9_1", "mat9_3", "mat15_1"), ("mat9_3",)
    sets = sets_of(trials, trials[::2], faulty)
    assert [one.name for one in sets] == ["slides", "simulated, magnitudes", "unscrewing", "simulated"]
    assert sets[0].trials == 2
    assert len(sets[0].samples) == 300
    assert [one.name for one in sets_of(trials[1:2], trials[::2], faulty)] == ["unscrewing", "simulated"]
    with pytest.raises(MissingInputError, match="no two slides or logs of unscrewing"):
        sets_of(trials[1:2], trials[:1], faulty)


def test_a_set_goes_on_without_the_other(capsys):
    """What is learned from slides needs no logs; a set too small for a map of the skin is left aside."""
    found = touch_transfer.learn_transfer([touch_set(SLIDES, 4), touch_set(MAGNITUDES, 4)], FEW)
    assert set(found["sets"]["set"]) == set(found["errors"]["learned_from"]) == {SLIDES, MAGNITUDES}
    sets = sets_of(wandering("a", "b"), wandering("a", "b", samples=20), neighbours=45)
    assert [one.name for one in sets] == ["slides", "simulated, magnitudes"]
    assert "unscrewing left aside: touch: 40 points in a bin" in capsys.readouterr().out


def test_recorded_unscrewing_knows_its_contact_point_and_rises_with_force(recorded_data):
    """The log holds a contact point and force of its own; its x axis is our y axis, turned round."""
    for one in slide.read_slides(recorded_data / "slide", 2):
        assert all((its.values >= 0).all() for its in one.streams if its.kind == "tactile")  # magnitudes
    path = sorted((recorded_data / "clmc" / "quat_dmp_unscrewing").glob("*.txt"))[0]
    log = np.loadtxt(path)
    force, own = np.linalg.norm(log[:, 70:73], axis=1), 1e-3 * log[:, 76:79]
    recording = clmc.read_unscrewing(recorded_data / "clmc")[0]
    samples = touch_transfer.held_touch([synchronise(recording)], SKIN, 100.0)
    assert np.corrcoef(samples.pressure, force)[0, 1] > 0.98
    wanted = SKIN.project(np.column_stack([own[:, 1], -own[:, 0], own[:, 2]]))
    distance = np.linalg.norm(samples.contact_point - wanted, axis=1)
    assert np.median(distance) < 0.5e-3
