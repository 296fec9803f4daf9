"""Statistics of touch on traces whose answer is known, and of traces out of recordings."""

from functools import lru_cache

import numpy as np
import pytest

from dissertation.recorded.transfer import finger_statistics
from dissertation.recorded.transfer.finger_statistics import compared, finger_traces
from structlearn.core.errors import InputError
from structlearn.readers.demonstration import Recording, Stream

RATE_HZ = 100.0
NOTHING = np.zeros((100, 2))


def execution(seed: int, gain: float = 1.0) -> np.ndarray:
    """Counts (1000, 19): contact at 3 s moves electrode e by 190 / e, then all swing together by 5 %."""
    rng = np.random.default_rng(seed)
    time = np.arange(1000) / RATE_HZ
    course = np.clip((time - 2.0) / 0.5, 0.0, 1.0) + 0.05 * np.sin(2 * np.pi * time) * (time > 3.0)
    change = gain * 190.0 / np.arange(1, 20)
    return np.rint(
        30 * rng.standard_normal(19) + course[:, None] * change + 0.6 * rng.standard_normal((1000, 19))
    )


def recording(name: str, counts: list[np.ndarray], rate_hz: float, segments=None) -> Recording:
    stamps = np.round(np.arange(len(counts[0])) / rate_hz * 1e9).astype(np.int64)
    streams = [Stream(f"/finger/{place}", "tactile", stamps, its) for place, its in enumerate(counts)]
    return Recording(name, tuple(streams), segments, {"origin": "simulated"})


def test_contact_changes_means_and_a_spike_is_no_range():
    counts = np.vstack([np.full((50, 2), 7.0), np.full((50, 2), [10.0, -3.0])])
    np.testing.assert_array_equal(finger_statistics.contact_change(counts, 100), [3.0, -10.0])
    counts = np.tile(np.linspace(0, 100, 1001)[:, None], 2)
    counts[500, 1] = 3000.0
    np.testing.assert_allclose(finger_statistics.movement_range(counts), [99.0, 99.0], atol=0.6)


def test_noise_is_found_under_motion():
    rng = np.random.default_rng(0)
    time = np.arange(20_000) / RATE_HZ
    motion = 200 * np.sin(2 * np.pi * 0.3 * time)
    counts = motion[:, None] + rng.standard_normal((len(time), 3)) * [0.5, 1.0, 2.0]
    counts[5000:5200] += 300 * rng.standard_normal((200, 3))  # a knock
    np.testing.assert_allclose(finger_statistics.noise(counts), [0.5, 1.0, 2.0], rtol=0.05)


def test_spectrum_integrates_to_the_variance():
    rng = np.random.default_rng(0)
    time = np.arange(30_000) / RATE_HZ
    counts = np.column_stack([4 * np.sin(2 * np.pi * 12.5 * time), 3 * rng.standard_normal(len(time))])
    frequency, density = finger_statistics.spectrum(counts)
    np.testing.assert_allclose(density.sum(axis=0) * frequency[1], [8.0, 9.0], rtol=0.03)
    assert frequency[density[:, 0].argmax()] == pytest.approx(12.5, abs=0.2)


@pytest.mark.parametrize(
    ("statistic", "message"),
    [
        (lambda: finger_statistics.contact_change(NOTHING, 15), "contact at sample 15 and means of 10"),
        (lambda: finger_statistics.noise(NOTHING[:20]), "too short to measure noise"),
        (lambda: finger_statistics.spectrum(NOTHING), r"of 1 s has no window of 2\.56 s"),
    ],
)
def test_traces_that_are_too_short(statistic, message):
    with pytest.raises(InputError, match=message):
        statistic()


def test_components_of_a_known_mixture():
    rng = np.random.default_rng(0)
    sources = rng.standard_normal((5000, 3)) * [10.0, 3.0, 0.1]
    basis = np.linalg.qr(rng.standard_normal((19, 19)))[0][:3]
    assert finger_statistics.pca_dimensions(sources @ basis, 0.99) == 2
    assert finger_statistics.pca_dimensions(sources @ basis, 0.9) == 1
    assert finger_statistics.pca_dimensions(sources @ basis, 0.99999) == 3


def test_held_values_are_thinned_and_primitives_joined():
    """A log at 300 Hz that holds every value for three rows is the sensor's own trace at 100 Hz."""
    own = execution(1)
    held = np.repeat(own, 3, axis=0)
    parts = [recording("a", [held[:900], held[:900]], 300.0), recording("b", [held[900:], held[900:]], 300.0)]
    left, right = finger_traces(parts)
    np.testing.assert_array_equal(left.counts, own)
    assert left.contact == right.contact == 350
    assert len(left.moving) == 650


def test_one_stream_of_both_fingers_is_split():
    counts = np.hstack([execution(1), execution(2)])
    segments = np.array([[0.0, 3.0], [3.0, 9.0]])
    left, right = finger_traces([recording("run", [counts], RATE_HZ, segments)])
    np.testing.assert_array_equal(right.counts, execution(2))
    assert left.contact == right.contact == 350


@pytest.mark.parametrize(
    ("counts", "rate_hz", "message"),
    [
        ([], 100.0, "run: has no electrodes"),
        ([np.zeros((50, 18))], 100.0, "run: has 18 electrodes"),
        ([np.zeros((50, 19))], 30.0, "run: touch comes at 30 Hz, not at 100"),
    ],
)
def test_readers_without_fingers(counts, rate_hz, message):
    empty = Recording("run", (), None, {})
    with pytest.raises(InputError, match=message):
        finger_traces([recording("run", counts, rate_hz) if counts else empty])


@lru_cache
def fingers(gain: float):
    """The comparison of a recorded execution and three simulated ones that are `gain` times as strong."""
    segments = np.array([[0.0, 2.5], [2.5, 9.0]])

    def runs(seeds, strength):
        both = ([execution(10 * seed + place, strength) for place in range(2)] for seed in seeds)
        return [recording(f"{seed}", its, RATE_HZ, segments) for seed, its in zip(seeds, both, strict=True)]

    return compared(runs([0], 1.0), runs([0, 1, 2], gain))


def test_the_comparison_finds_the_same_in_the_same():
    found = fingers(1.0).set_index(["quantity", "case"])
    assert found["ratio"].between(0.5, 2.0).all()
    assert found.loc[("contact", "strongest electrode (counts)"), "recorded"] == pytest.approx(190, abs=2)
    assert found.loc[("contact", "electrodes beyond 100 counts"), "simulated"] == 1
    noise = found.loc[("noise", "median electrode (counts)"), "simulated"]
    assert noise == pytest.approx(np.hypot(0.6, 12**-0.5), rel=0.1)
    slow = found.loc[("spectrum", "0.4 to 2 Hz (counts)"), "recorded"]
    assert slow == pytest.approx(9.5 / np.sqrt(2), rel=0.1)
    assert (found["recorded_low"] <= found["recorded"]).all()


def test_the_comparison_finds_a_factor():
    ratio = fingers(3.0).set_index(["quantity", "case"])["ratio"]
    assert ratio["contact", "strongest electrode (counts)"] == pytest.approx(3.0, rel=0.05)
    assert ratio["range", "strongest electrode (counts)"] > 2.0
    assert ratio["spectrum", "0.4 to 2 Hz (counts)"] > 2.0
    assert ratio["noise", "median electrode (counts)"] == pytest.approx(1.0, abs=0.1)
