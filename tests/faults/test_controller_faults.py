"""The controller under faults for some ten thousand ticks; `make upsets` ticks on."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from faults.controller_faults import READINGS, faults, several, upset

SEEDS = (1, 2, 3, 5)


def test_whatever_comes_outputs_are_finite_bounds_hold_and_the_goal_is_reached():
    counts, broken = several(SEEDS)
    assert broken == []
    assert all(counts[reading, "ticks"] > 200 for reading in READINGS)
    for flag in ("REJECTED", "WAITING", "STALE", "SATURATED", "RATE_LIMITED"):
        assert sum(counts[reading, flag] for reading in READINGS) > 0, flag


@pytest.fixture(scope="module")
def run():
    return upset(3)  # a short one


def changed(run, name, value, place=200):
    values = getattr(run, name).astype(float)
    values[place] = value
    return replace(run, **{name: values})


def test_what_breaks_the_rule_is_told(run):
    assert list(faults(run)) == []
    far = 3.0 * run.largest
    signs = np.where(np.arange(len(run.coupling)) % 2, 0.9, -0.9)
    sudden = replace(run, coupling=signs[:, None] * run.largest)
    for broken, words in (
        (changed(run, "state", np.nan), "not finite"),
        (changed(run, "coupling", np.inf), "not finite"),
        (changed(run, "coupling", far), "coupling terms are"),
        (sudden, "change by"),
        (replace(run, state=1.1 * run.state), "unit quaternion"),
        (replace(run, missed=(1e-3, 0.0)), "the goal is missed"),
        (replace(run, moved=True), "has changed something"),
        (replace(run, reading=np.full_like(run.reading, READINGS.index("NaN"))), "is taken"),
    ):
        assert any(words in fault for fault in faults(broken)), words
    assert isinstance(run.calls, Counter)
