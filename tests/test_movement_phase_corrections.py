"""Corrections learned over phase: on reaches that are made up, and on the recorded ones where they are."""

from dataclasses import replace

import numpy as np
import pytest
from committed import committed

from structlearn.core.errors import MissingInputError
from structlearn.core.signals import minimum_jerk
from structlearn.primitives import kernels
from structlearn.primitives.position import fit_position
from structlearn.primitives.trajectory import differentiated
from structlearn.primitives.vector import fit_vector
from structlearn.readers.demonstration import Demonstration
from structlearn.tasks.movement.parameters import PhaseCorrectionParameters
from structlearn.tasks.movement.phase_corrections import (
    SAMPLES,
    adapted_path,
    complete,
    completeness,
    learn_corrections,
    phase_coupling,
    phase_networks,
    runs_with_coupling,
    typical_paths,
)

HEIGHTS_M = (0.18, 0.2, 0.22, 0.19, 0.21, 0.2)
START, GOAL = np.array([0.67, -0.19, 0.14]), np.array([0.40, 0.20, 0.17])
PARAMETERS = committed(
    PhaseCorrectionParameters,
    "defaults.movement.corrections",
    source="clmc",
    smoothing_hz=20.0,
    splits=3,
)


def arc(name, height, duration=0.8, dt=0.002, shift=0.0):
    """A reach over an arc, from rest to rest."""
    time = dt * np.arange(round(duration / dt) + 1)
    s = (time / time[-1])[:, None]
    lift = 64 * height * s**3 * (1 - s) ** 3 * np.array([0.0, 0.0, 1.0])
    return Demonstration(name, time, START + shift + (GOAL - START) * minimum_jerk(s) + lift)


@pytest.fixture(scope="module")
def nominal():
    paths = [differentiated(arc("1", 0.05, duration).position, 0.002, 20.0) for duration in (0.6, 0.8)]
    return fit_position(paths)


def higher(heights, nominal):
    """Corrected reaches of different heights and durations, each from another start."""
    demonstrations = [
        arc(str(place), height, 0.6 + 0.05 * place, shift=0.01 * place)
        for place, height in enumerate(heights)
    ]
    return runs_with_coupling(demonstrations, nominal, 20.0)


@pytest.fixture(scope="module")
def corrected(nominal):
    return higher(HEIGHTS_M, nominal)


@pytest.fixture(scope="module")
def learned(corrected, nominal):
    """Networks of all, and results of the splits."""
    return learn_corrections(corrected, nominal.local, PARAMETERS)


def test_equal_corrections_are_reproduced(nominal):
    _, results = learn_corrections(higher([0.2] * 6, nominal), nominal.local, PARAMETERS)
    distances = results["distances"]
    assert distances["nominal_mm"].min() > 50.0
    assert distances["coupling_mm"].max() < 1.0
    assert distances["spread_mm"].max() < 0.5
    upwards = results["scores"].query("axis == 'z'")
    assert upwards["nmse"].max() < 1e-2


def test_every_split_learns_from_as_many_as_asked_and_reproduces_all_others(corrected, learned):
    _, results = learned
    assert results["distances"].groupby("split").size().tolist() == [2, 2, 2]
    assert set(results["distances"]["learned_from"]) == {4}
    left_out = results["distances"].groupby("split")["run"].apply(tuple)
    assert len(set(left_out)) > 1
    first = set(left_out[0])
    assert set(results["paths"]["run"]) == first
    targets = [reach.target for reach in corrected if reach.name not in first]
    again = phase_coupling(phase_networks(targets), SAMPLES)
    np.testing.assert_allclose(results["targets"]["learned"], again.T.ravel())


def test_distances_are_those_of_the_unrolled_paths(nominal, learned):
    """By the base frame, and without any table."""
    networks, results = learned
    row = results["distances"].iloc[0]
    place = int(row["run"])
    demonstration = arc(row["run"], HEIGHTS_M[place], 0.6 + 0.05 * place)
    path = differentiated(demonstration.position, 0.002, 20.0)
    terms = phase_coupling(networks, len(path.time))
    for column, coupling in (("nominal_mm", None), ("coupling_mm", lambda k, x, xd: terms[k])):
        ends = path.position[0], path.position[-1]
        unrolled = nominal.unroll(path.dt, *ends, path.duration, coupling=coupling)
        away = 1e3 * np.linalg.norm(unrolled.position - path.position, axis=1)
        assert row[column] == pytest.approx(away.mean(), rel=0.01)
    profile = results["profile"][["nominal_mm", "coupling_mm", "spread_mm"]].mean()
    by_split = results["distances"].groupby("split")[list(profile.index)].mean().mean()
    np.testing.assert_allclose(profile, by_split)


def test_some_are_learned_from_and_some_are_left_out_however_few_there_are(nominal):
    _, results = learn_corrections(higher([0.2, 0.21], nominal), nominal.local, PARAMETERS)
    assert set(results["distances"]["learned_from"]) == {1}
    with pytest.raises(MissingInputError, match="1 complete corrected runs; at least two"):
        learn_corrections(higher([0.2], nominal), nominal.local, PARAMETERS)


def test_known_coupling_over_phase_is_found_again():
    weights = np.random.default_rng(3).normal(size=(25, 3))
    weights[0] = 0.0  # hidden by the vanishing phase velocity
    networks = phase_networks([kernels.unit_features(samples) @ weights for samples in (300, 470)])
    terms = phase_coupling(networks, 400)
    np.testing.assert_allclose(terms, kernels.unit_features(400) @ weights, atol=1e-4)
    assert not terms[0].any()


def test_nominal_and_coupling_weights_are_those_of_a_primitive_of_the_corrected_runs(nominal):
    """Both are linear in the same features, so the sum is what would be learned from scratch."""
    corrected = higher([0.18, 0.2, 0.22], nominal)
    networks = phase_networks([reach.target for reach in corrected])
    afresh = fit_vector([reach.path for reach in corrected])
    summed = nominal.local.weights + np.column_stack([network.phase_biases for _, network in networks])
    np.testing.assert_allclose(summed[1:], afresh.weights[1:], atol=1e-3 * np.abs(afresh.weights).max())


def test_typical_paths_go_from_the_mean_start_to_the_mean_goal_in_the_mean_time(nominal):
    demonstrations = [arc("1", 0.2, 0.6), arc("2", 0.2, 0.8, shift=0.02)]
    networks = phase_networks([one.target for one in runs_with_coupling(demonstrations, nominal, 20.0)])
    paths = typical_paths(nominal, demonstrations, networks)
    for path in paths.values():
        np.testing.assert_allclose(path.position[0], START + 0.01, atol=1e-9)
        np.testing.assert_allclose(path.position[-1], GOAL + 0.01, atol=2e-3)
        assert path.duration == pytest.approx(0.7)
    height = {name: path.position[:, 2].max() for name, path in paths.items()}
    assert height["coupling"] - height["nominal"] == pytest.approx(0.15, abs=0.01)


def test_incomplete_reaches_are_those_whose_ends_are_off_the_nominal_ones(nominal):
    demonstrations = [arc("1", 0.2), arc("2", 0.2, shift=0.05), arc("3", 0.2, shift=0.06), arc("4", 0.2)]
    cut_short = demonstrations[-1]
    half = len(cut_short.time) // 2
    demonstrations[-1] = replace(cut_short, time=cut_short.time[:half], position=cut_short.position[:half])
    ends = completeness(demonstrations, nominal, 0.1)
    assert [one.name for one in complete(demonstrations, ends)] == ["1", "2"]  # 0.05 m along three axes
    np.testing.assert_allclose(ends["start_off_mm"][:3], [0, 50 * 3**0.5, 60 * 3**0.5], atol=0.01)
    assert ends["start_off_mm"][3] < 0.01 < 100 < ends["goal_off_mm"][3]


def test_coupling_ends_at_the_goal_of_the_run(nominal):
    higher_and_farther = arc("1", 0.2)
    position = START + 1.2 * (higher_and_farther.position - START)
    (reach,) = runs_with_coupling([replace(higher_and_farther, position=position)], nominal, 20.0)
    path = adapted_path(nominal.local, reach.path, phase_networks([reach.target]))
    assert np.abs(path.position[-1] - reach.path.position[-1]).max() < 1e-3
    assert path.position[:, 2].max() == pytest.approx(reach.path.position[:, 2].max(), abs=2e-3)
