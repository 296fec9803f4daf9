"""The share of the variance of trials that lies between people."""

import numpy as np
import pandas as pd
import pytest

from dissertation.evidence.results import Results, joined_results
from dissertation.evidence.variance_shares import between_share, sums_of, trial_sums


@pytest.mark.parametrize("spread", [0.0, 0.5, 2.0])
def test_the_share_between_people_is_found_with_its_interval(spread):
    rng = np.random.default_rng(3)
    people, scenes, repeats = 12, 5, 4
    covered = []
    for _ in range(200):
        shape = (people, scenes, repeats)
        values = spread * rng.standard_normal((people, 1, 1)) + rng.standard_normal((1, scenes, 1)) * 3.0
        values = (values + rng.standard_normal(shape)).ravel()
        who, scene, _ = (axis.ravel() for axis in np.indices(shape))
        trials = pd.DataFrame({"person": who, "scene": scene, "clearance": values})
        rows = trial_sums("made_up", "clearance", trials, "person", ["scene"])
        table = joined_results(rows, {"person": int})
        found = between_share(sums_of(Results(table, "person"), "clearance"))
        truth = spread**2 / (spread**2 + 1.0)
        assert 0.0 <= found.low <= found.value <= found.high <= 1.0
        assert found.n == people
        covered.append(found.low <= truth <= found.high)
    assert np.mean(covered) > 0.91


def test_one_person_has_no_share():
    trials = pd.DataFrame({"person": [1, 1, 1], "pace": [1.0, 2.0, 4.0]})
    table = joined_results(trial_sums("made_up", "pace", trials, "person"), {"person": int})
    assert np.isnan(between_share(sums_of(Results(table, "person"), "pace")).value)


def test_the_share_is_unbiased_with_different_numbers_of_trials():
    rng = np.random.default_rng(5)
    person = np.repeat(np.arange(12), rng.integers(2, 30, 12))
    ratios = []
    for _ in range(300):
        pace = 0.5 * rng.standard_normal(12)[person] + rng.standard_normal(len(person))
        rows = trial_sums("made_up", "pace", pd.DataFrame({"person": person, "pace": pace}), "person")
        share = between_share(sums_of(Results(joined_results(rows, {"person": int}), "person"), "pace"))
        ratios.append(share.value / (1.0 - share.value))  # of the variances; cut off at 0
    assert np.mean(ratios) == pytest.approx(0.25, abs=0.02)
