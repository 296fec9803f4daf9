"""Executions for the evaluation of a model: in every setting, cut where they were commanded."""

from dataclasses import replace

import numpy as np
import pytest
from committed import committed
from scraping_motions import DURATIONS_S, NAMES, constant_network, scraping_skill

from structlearn.feedback.skill import Limits
from structlearn.recordings.source import ClockParameters
from structlearn.testbeds.scraping.protocol.evaluation_runs import executed_set
from structlearn.testbeds.scraping.protocol.execution_scores import EvaluationParameters
from structlearn.testbeds.scraping.world.testbed import TestbedParameters

EVALUATION = EvaluationParameters(settings_deg=(0.0, 8.8), runs=2)
LIMITS = Limits(largest_coupling={"ry": 50.0})
TESTBED = committed(TestbedParameters, "testbed")
CLOCK = committed(ClockParameters, "clock", rate_hz=300.0)


@pytest.fixture(scope="module")
def sets():
    pushing = {name: constant_network(-20.0) for name in NAMES[1:]}
    return {
        model: executed_set(
            model, replace(scraping_skill(networks), limits=LIMITS), EVALUATION, TESTBED, CLOCK
        )
        for model, networks in (("nominal", {}), ("pushing", pushing))
    }


def test_every_setting_has_its_runs_with_their_cuts(sets):
    for model, executed in sets.items():
        assert executed.model == model
        assert list(executed.runs) == [0.0, 8.8]
        for setting, runs in executed.runs.items():
            assert [run.name for run in runs] == ["01", "02"]
            assert all(f"roll {setting:g} " in run.provenance["setting"] for run in runs)
            assert list(executed.cuts[setting]) == list(NAMES)
            for name, duration in zip(NAMES, DURATIONS_S, strict=True):
                table = executed.cuts[setting][name]
                assert table.index.tolist() == ["01", "02"]
                np.testing.assert_allclose(table["end_s"] - table["start_s"], duration, atol=1.01 / 300)


def test_only_a_skill_with_networks_has_feedback(sets):
    words = {model: executed.runs[0.0][0].provenance["what"] for model, executed in sets.items()}
    assert words == {"nominal": "execution, nominal", "pushing": "execution, with feedback"}


def test_runs_of_equal_number_met_equal_conditions(sets):
    """Before the contact nothing differs between the sets, noise of all sensors included."""
    nominal, pushing = sets.values()
    for setting in EVALUATION.settings_deg:
        for one, other in zip(nominal.runs[setting], pushing.runs[setting], strict=True):
            air = slice(0, round(300 * (DURATIONS_S[0] - 0.05)))
            for signal in ("position", "wrench", "tactile", "tool_to_board"):
                np.testing.assert_array_equal(getattr(one, signal)[air], getattr(other, signal)[air])
            assert np.abs(one.orientation - other.orientation).max() > 1e-3
