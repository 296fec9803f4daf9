"""Two fingers that pinch a tool: what their electrodes count."""

import numpy as np
import pytest
from committed import committed
from hypothesis import given
from hypothesis import strategies as st

from dissertation.simulation import fingers as fingers_module
from dissertation.simulation.fingers import CHANNELS, FingerPair, PinchParameters
from structlearn.tactile.electrodes import ELECTRODES_MM

RATE_HZ = 100.0
STILL = {"noise_counts": 0.0, "slip_mm": 0.0, "grip_spread": 0.0}
ALIKE = {"gain_spread": 0.0, "width_spread": 0.0, "bulge_spread": 0.0, "offset_counts": 0.0}
ELASTIC = {"hysteresis": 0.0, "creep": (0.0, 0.0), "lag_s": 1e-6}
ABOVE, BELOW = ELECTRODES_MM[:, 0] > 0, ELECTRODES_MM[:, 0] < -6  # towards the tip, towards the palm


def pair(sensor: int = 1, trial: int = 2, **parameters) -> FingerPair:
    touch = committed(PinchParameters, "testbed.touch", **parameters)
    return FingerPair(touch, sensor, np.random.default_rng(trial), RATE_HZ)


def counts(fingers: FingerPair, force=None, torque=None, turn=None) -> np.ndarray:
    """Trace under the wrenches that are given, (T, 3) each; the others are zero."""
    given_ones = [values for values in (force, torque, turn) if values is not None]
    nothing = np.zeros_like(given_ones[0])
    return fingers.trace(*(nothing if values is None else values for values in (force, torque, turn)))


def along(axis: int, values: np.ndarray) -> np.ndarray:
    result = np.zeros((len(values), 3))
    result[:, axis] = values
    return result


def pressed(fingers: FingerPair, **wrench) -> np.ndarray:
    """Settled change of the counts, (2, 19), by a constant wrench that comes after half a second."""
    step = np.concatenate([np.zeros(50), np.ones(50)])[:, None]
    trace = counts(fingers, **{name: step * np.asarray(value) for name, value in wrench.items()})
    return (trace[-1] - trace[40]).reshape(2, 19)


def loop_width(force: np.ndarray, reading: np.ndarray) -> float:
    """Largest difference between the way up and the way down of the last cycle, over the range."""
    up = np.gradient(force) > 0
    grid = np.linspace(0.9 * force.min(), 0.9 * force.max(), 50)
    branches = []
    for branch in (up, ~up):
        order = np.argsort(force[branch])
        branches.append(np.interp(grid, force[branch][order], reading[branch][order]))
    return float(np.abs(branches[0] - branches[1]).max() / np.ptp(reading))


@pytest.fixture
def opposite(monkeypatch):
    """Pads that meet exactly."""
    monkeypatch.setattr(fingers_module, "HOME_MM", (-2.0, -2.0))
    monkeypatch.setattr(fingers_module, "HOME_ACROSS_MM", (0.0, 0.0))


@pytest.mark.usefixtures("opposite")
def test_a_pure_grip_touches_both_fingers_alike():
    fingers = pair(**STILL, **ALIKE)
    left, right = fingers.read(np.zeros(3), np.zeros(3), np.zeros(3)).reshape(2, 19)
    np.testing.assert_array_equal(left, right)
    assert left.min() < -100


def test_more_load_thins_the_fluid_under_the_contact():
    nearest = int(np.argmin(np.linalg.norm(ELECTRODES_MM - [-2.0, 0.0, -7.0], axis=1)))
    change = pressed(pair(**STILL), force=[1.0, 0.0, 0.0])
    assert change[0, nearest] < -10  # towards the left finger
    assert change[1, nearest] > 10  # the right one is relieved


def test_torque_about_scraping_moves_the_contacts_in_opposite_directions_along_the_fingers():
    change = pressed(pair(**STILL), torque=[0.0, 0.01, 0.0])
    assert change[0, BELOW].sum() < change[0, ABOVE].sum()  # left: towards the palm
    assert change[1, BELOW].sum() > change[1, ABOVE].sum()  # right: towards the tip


@pytest.mark.usefixtures("opposite")
def test_force_along_scraping_mirrors_on_pads_that_face_each_other():
    change = pressed(pair(**STILL, **ALIKE), force=[0.0, 0.5, 0.0])
    reflected = ELECTRODES_MM * [1, -1, 1]
    mirrored = [int(np.argmin(np.linalg.norm(reflected - one, axis=1))) for one in ELECTRODES_MM]
    np.testing.assert_array_equal(change[0], change[1, mirrored])
    assert np.abs(change[0] - change[1]).max() > 10


def test_a_step_lags():
    lag = pair(**STILL, hysteresis=0.0, creep=(0.0, 0.0), lag_s=0.1)
    step = along(0, np.concatenate([np.zeros(10), np.full(100, 0.5)]))
    reading = counts(lag, step)[:, 16]
    share = (reading - reading[0]) / (reading[-1] - reading[0])
    assert share[9] == 0
    assert share[10 + 9] == pytest.approx(1 - np.exp(-1), abs=0.02)  # after one time constant


def test_a_step_creeps_with_both_time_constants():
    """What is still to come after a step falls as the sum of both exponentials, where counts follow load."""
    linear = {**STILL, "saturation_1_n": 0.0, "hertz_mm_n": 0.0, "bulge": 0.0}
    force = along(0, np.where(np.arange(6001) > 0, 3.0, 0.0))
    elastic = counts(pair(**linear, **ELASTIC), force)[:, 16]
    creeping = {"hysteresis": 0.0, "creep": (0.2, 0.1), "creep_s": (0.5, 10.0), "lag_s": 1e-6}
    reading = counts(pair(**linear, **creeping), force)[:, 16]
    time = np.arange(1, 6001) / RATE_HZ
    to_come = (elastic[1:] - reading[1:]) / (elastic[-1] - elastic[0])
    expected = 0.2 * np.exp(-time / 0.5) + 0.1 * np.exp(-time / 10.0)
    np.testing.assert_allclose(to_come, expected, atol=0.006)


def test_hysteresis_does_not_depend_on_rate():
    widths = []
    for seconds in (2.0, 20.0):
        fingers = pair(**STILL, hysteresis=0.3, creep=(0.0, 0.0), lag_s=1e-6)
        time = np.arange(round(3 * seconds * RATE_HZ)) / RATE_HZ
        force = np.sin(2 * np.pi * time / seconds)
        last = slice(-round(seconds * RATE_HZ), None)
        widths.append(loop_width(force[last], counts(fingers, along(2, force))[last, 9]))
    assert min(widths) > 0.02
    assert widths[0] == pytest.approx(widths[1], abs=0.02)


def test_default_loops_are_as_wide_as_published_ones():
    """Silicone sensors in compression at 0.1 Hz: 3 to 4 % (Romano et al. 2024)."""
    time = np.arange(3000) / RATE_HZ
    force = np.sin(2 * np.pi * time / 10.0)
    reading = counts(pair(**STILL, lag_s=1e-6), along(0, force))[-1000:, 16]
    assert 0.02 < loop_width(force[-1000:], reading) < 0.07


def test_a_trace_is_what_one_reads_one_by_one():
    rng = np.random.default_rng(3)
    force, torque, turn = (
        scale * np.cumsum(rng.standard_normal((200, 3)), axis=0) for scale in (0.05, 2e-4, 1e-3)
    )
    single = pair()
    read = [single.read(*sample) for sample in zip(force, torque, turn, strict=True)]
    np.testing.assert_array_equal(pair().trace(force, torque, turn), read)


def test_counts_are_whole_and_repeat_with_their_seeds():
    """Two grasps of one sensor differ, but less than the same grasp of two sensors."""
    force = along(2, np.full(20, -0.5))
    first, again, other_grasp, other_sensor = (
        counts(pair(*seeds), force) for seeds in ((1, 2), (1, 2), (1, 3), (4, 2))
    )
    assert first.shape == (20, CHANNELS)
    np.testing.assert_array_equal(first, np.rint(first))
    np.testing.assert_array_equal(first, again)
    grasps, sensors = (np.abs((first - one).mean(axis=0)).mean() for one in (other_grasp, other_sensor))
    assert 0 < grasps < 0.3 * sensors


def test_noise_is_white_and_of_the_set_size():
    reading = counts(pair(noise_counts=3.0), np.zeros((4000, 3)))
    assert reading.std(axis=0).mean() == pytest.approx(np.hypot(3.0, 12**-0.5), rel=0.02)
    change = np.diff(reading, axis=0)
    assert change.std() == pytest.approx(np.sqrt(2) * np.hypot(3.0, 12**-0.5), rel=0.02)


@given(
    force=st.lists(st.floats(-20, 20), min_size=3, max_size=3),
    torque=st.lists(st.floats(-0.5, 0.5), min_size=3, max_size=3),
    turn=st.lists(st.floats(-1, 1), min_size=3, max_size=3),
)
def test_any_wrench_gives_counts_of_a_sensor(force, torque, turn):
    """Saturation bounds the counts: 1 / 0.35 N of pressure, times an electrode's gain and its neighbours'."""
    fingers = pair()
    for _ in range(3):
        reading = fingers.read(np.array(force), np.array(torque), np.array(turn))
    assert np.isfinite(reading).all()
    assert np.abs(reading).max() < 12000
