"""Quality of demonstrations: closed forms, invariances, and an outlier that is found."""

import numpy as np
import pandas as pd
import pytest
from conftest import minimum_jerk
from hypothesis import given
from hypothesis import strategies as st

from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.quality import log_dimensionless_jerk, quality, spectral_arc_length

DT = 1 / 500


def reach(duration=1.0, size=0.3):
    way = minimum_jerk(np.arange(0.0, duration + DT / 2, DT) / duration)
    return size * way[:, None] * np.array([0.6, 0.0, 0.8])


def speed(position):
    return np.linalg.norm(np.gradient(position, DT, axis=0), axis=1)


@given(st.floats(0.5, 4.0), st.floats(0.05, 1.0))
def test_the_jerk_of_a_minimum_jerk_reach_is_known_whatever_its_size_and_duration(duration, size):
    assert log_dimensionless_jerk(reach(duration, size), DT) == pytest.approx(
        -np.log(720 / 1.875**2), abs=0.08
    )


def test_smoothness_does_not_depend_on_size_and_duration_and_falls_with_submovements():
    smooth = spectral_arc_length(speed(reach()), DT)
    assert spectral_arc_length(speed(reach(2.0, 0.1)), DT) == pytest.approx(smooth, abs=0.02)
    assert smooth == pytest.approx(-1.41, abs=0.05)  # of a minimum-jerk reach, Balasubramanian et al. 2015
    halting = np.vstack([reach(0.5, 0.15), reach(0.5, 0.15) + reach(0.5, 0.15)[-1]])
    assert spectral_arc_length(speed(halting), DT) < smooth - 0.2


def demonstration(name, position):
    return Demonstration(name, DT * np.arange(len(position)), position)


def test_a_demonstration_that_differs_from_the_others_is_named():
    rng = np.random.default_rng(0)
    ways = [reach(1.0 + 0.02 * rng.normal(), 0.3 + 0.004 * rng.normal()) for _ in range(8)]
    detour = reach() + 0.2 * np.sin(np.pi * np.linspace(0, 1, len(reach())))[:, None] * [0.0, 1.0, 0.0]
    runs = [demonstration(f"{n}", way) for n, way in enumerate([*ways, detour])]
    cuts = pd.DataFrame(
        {"start_s": 0.0, "end_s": [run.time[-1] for run in runs]}, index=[run.name for run in runs]
    )
    found = quality(runs, {"reach": cuts}, 10.0).set_index("demonstration")
    assert "distance_mm" in found.loc["8", "outlier"]
    assert found["distance_mm"].idxmax() == "8"
    assert sorted(found["rank"]) == list(range(1, 10))
    better = found["smoothness"].rank(ascending=False) + found["jerk"].rank(ascending=False)
    better += found["idle_share"].rank() + found["distance_mm"].rank()
    assert better[found["rank"].sort_values().index].is_monotonic_increasing
    assert (found["outlier"].drop("8") == "").sum() >= 7


def test_idle_time_counts_within_the_movement():
    resting = np.vstack([reach(1.0), np.tile(reach(1.0)[-1], (500, 1)), reach(1.0) + reach(1.0)[-1]])
    run = demonstration("1", resting)
    cuts = pd.DataFrame({"start_s": [0.0], "end_s": [run.time[-1]]}, index=["1"])
    found = quality([run], {"reach": cuts}, 20.0)
    assert found["idle_share"].iloc[0] == pytest.approx(1 / 3 + 2 / 3 * 0.18, abs=0.06)
