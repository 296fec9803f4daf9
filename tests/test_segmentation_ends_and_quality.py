"""Movement ends extrapolated from rest: exact on minimum jerk, and never beyond other motion."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from structlearn.core.signals import minimum_jerk
from structlearn.readers.demonstration import Demonstration
from structlearn.segmentation.crossings import movement_ends
from structlearn.segmentation.quality import log_dimensionless_jerk, quality, spectral_arc_length

DT = 0.005
WAY = np.array([0.3, -0.1, 0.2])


def between_rests(before_s: float, duration_s: float, after_s: float) -> tuple[np.ndarray, int, int]:
    """Path (T, 3) of a minimum-jerk movement between two rests, its first and its last sample."""
    rests = [round(s / DT) for s in (before_s, after_s)]
    moving = minimum_jerk(np.linspace(0.0, 1.0, round(duration_s / DT) + 1))
    share = np.concatenate([np.zeros(rests[0]), moving, np.ones(rests[1])])
    return share[:, None] * WAY, rests[0], rests[0] + len(moving) - 1


@given(st.floats(0.2, 1.5), st.floats(0.4, 6.0), st.floats(0.2, 1.5))
def test_minimum_jerk_is_found_to_a_sample(before_s, duration_s, after_s):
    path, start, end = between_rests(before_s, duration_s, after_s)
    inside = round(0.03 * (end - start))  # a speed threshold is passed inside
    found = movement_ends(path, DT, (start + inside, end - inside), (0, len(path) - 1))
    assert np.abs(np.subtract(found, (start, end))).max() <= 1


def test_a_reversed_movement_has_reversed_ends():
    rng = np.random.default_rng(1)
    path, start, end = between_rests(0.7, 2.0, 0.5)
    path += 1e-4 * rng.standard_normal(path.shape).cumsum(axis=0) * 0.1
    last = len(path) - 1
    forth = movement_ends(path, DT, (start + 20, end - 30), (0, last))
    back = movement_ends(path[::-1], DT, (last - end + 30, last - start - 20), (0, last))
    assert (last - back[1], last - back[0]) == forth


def test_slow_movements_of_a_swaying_hand_are_cut_closer_than_at_the_crossing():
    rng = np.random.default_rng(2)
    errors, inside = [], []
    for _ in range(40):
        path, start, end = between_rests(*rng.uniform([0.5, 3.0, 0.5], [1.0, 5.0, 1.0]))
        phase = rng.uniform(0, 2 * np.pi, 3)
        time = DT * np.arange(len(path))[:, None]
        path = path + 1e-3 * np.sin(2 * np.pi * rng.uniform(0.5, 2.0, 3) * time + phase)
        speed = np.linalg.norm(np.gradient(path, DT, axis=0), axis=1)
        moving = np.flatnonzero(speed > 0.25 * speed.max())
        crossing = int(moving[0]), int(moving[-1])
        found = movement_ends(path, DT, crossing, (0, len(path) - 1))
        errors.append(np.abs(np.subtract(found, (start, end))).mean() * DT)
        inside.append(np.abs(np.subtract(crossing, (start, end))).mean() * DT)
    assert np.mean(errors) < 0.5 * np.mean(inside)


@pytest.mark.parametrize("bound", [95, 110])
def test_no_end_passes_other_motion(bound):
    path, start, end = between_rests(0.5, 2.0, 0.5)
    found = movement_ends(path, DT, (start + 40, end - 40), (bound, len(path) - 1))
    assert found[0] >= bound


def test_a_movement_that_turns_back_keeps_its_crossing():
    path, start, _ = between_rests(0.5, 2.0, 0.5)
    there_and_back = np.concatenate([path, path[::-1]])
    crossing = (start + 10, len(there_and_back) - 1 - start - 10)
    assert movement_ends(there_and_back, DT, crossing, (0, len(there_and_back) - 1)) == crossing


STEP = 1 / 500


def reach(duration=1.0, size=0.3):
    way = minimum_jerk(np.linspace(0.0, 1.0, round(duration / STEP) + 1))
    return size * way[:, None] * np.array([0.6, 0.0, 0.8])


def speed(position):
    return np.linalg.norm(np.gradient(position, STEP, axis=0), axis=1)


@given(st.floats(0.5, 4.0), st.floats(0.05, 1.0))
def test_the_jerk_of_a_minimum_jerk_reach_is_known_whatever_its_size_and_duration(duration, size):
    assert log_dimensionless_jerk(reach(duration, size), STEP) == pytest.approx(
        -np.log(720 / 1.875**2), abs=0.08
    )


def test_smoothness_does_not_depend_on_size_and_duration_and_falls_with_submovements():
    smooth = spectral_arc_length(speed(reach()), STEP)
    assert spectral_arc_length(speed(reach(2.0, 0.1)), STEP) == pytest.approx(smooth, abs=0.02)
    assert smooth == pytest.approx(-1.41, abs=0.05)  # of a minimum-jerk reach, Balasubramanian et al. 2015
    halting = np.vstack([reach(0.5, 0.15), reach(0.5, 0.15) + reach(0.5, 0.15)[-1]])
    assert spectral_arc_length(speed(halting), STEP) < smooth - 0.2


def demonstration(name, position):
    return Demonstration(name, STEP * np.arange(len(position)), position)


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
