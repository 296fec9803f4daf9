import numpy as np
import pytest

from structlearn.ground.errors import InputError
from structlearn.segmentation.motion_runs import moving_interval


def bell(samples: int = 400, centre: float = 200, width: float = 40) -> np.ndarray:
    return np.exp(-0.5 * ((np.arange(samples) - centre) / width) ** 2)


def test_cut_lies_at_rest_below_the_threshold():
    speed = bell()
    s, e = moving_interval(speed, speed, threshold=0.2, bridge=0)
    assert speed[s] <= 0.2 * 0.2
    assert speed[e] <= 0.2 * 0.2
    assert s < 200 < e
    assert speed[s + 1] > 0.2 * 0.2  # no further than needed


def test_descent_stops_at_a_local_minimum():
    speed = bell(centre=200) + 0.8 * bell(centre=320, width=20)
    valley = 200 + int(np.argmin(speed[200:320]))
    _, e = moving_interval(speed, speed, threshold=speed[valley] + 0.05, bridge=0)
    assert e == valley


def test_hesitation_is_bridged_and_a_pause_is_not():
    speed = bell(centre=120, width=20) + bell(centre=240, width=20) * 1.1
    s, e = moving_interval(speed, speed, threshold=0.3, bridge=100)
    assert s < 120
    assert e > 240
    s, e = moving_interval(speed, speed, threshold=0.3, bridge=10)
    assert 120 < s < 240 < e  # the larger movement alone


def test_smoothing_does_not_widen_the_cut():
    sharp = ((np.arange(400) > 150) & (np.arange(400) < 250)).astype(float)
    smooth = np.convolve(sharp, np.ones(61) / 61, mode="same")
    assert moving_interval(smooth, sharp, threshold=0.1, bridge=0) == (150, 250)


def test_nothing_is_looked_for_before_the_first_sample():
    speed = 2 * bell(centre=80, width=15) + bell(centre=300, width=15)
    s, _ = moving_interval(speed, speed, threshold=0.2, bridge=0, first=150)
    assert s > 150


def test_no_motion_is_told():
    with pytest.raises(InputError, match=r"never exceeds 0\.5 m/s \(largest 0\.1 m/s\)"):
        moving_interval(0.1 * bell(), 0.1 * bell(), threshold=0.5, bridge=0)
