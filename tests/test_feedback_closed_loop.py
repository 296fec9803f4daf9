import numpy as np
import pytest
from committed import committed
from feedback_runs import Y, cuts, execution
from feedback_skills import random_network

from structlearn.feedback.coupling_targets import SupervisionParameters
from structlearn.testbeds.scraping.protocol.execution_scores import (
    NOMINAL,
    ExecutedSet,
    execution_scores,
    nominal_orientation,
    scores,
)

PARAMETERS = committed(
    SupervisionParameters,
    "coupling_dataset",
    primitives=("turn", "scrape"),
    settings_deg=(5.0,),
    axes=("ry",),
    rate_hz=50.0,
)
MEAN = nominal_orientation([execution()])


@pytest.fixture(scope="module")
def sets():
    """Without feedback the tool is off by the setting, with it by a third of that."""
    network = random_network(np.random.default_rng(0))
    made = []
    for model, networks, share in ((NOMINAL, {}, 1.0), ("pointwise", {"turn": network}, 1 / 3)):
        rolls = {setting: -share * np.radians(setting) for setting in (5.0, 10.0)}
        runs = {
            setting: [execution(f"{n:02d}", roll=roll * (1 + 0.1 * n), seed=n) for n in (1, 2)]
            for setting, roll in rolls.items()
        }
        segments = {setting: cuts(group) for setting, group in runs.items()}
        made.append(ExecutedSet(model, networks, runs, segments))
    return made


def test_scores_of_all_sets_settings_runs_and_primitives_with_feedback(sets):
    table = scores(sets, MEAN, PARAMETERS)
    keys = table[["model", "setting_deg", "run", "primitive"]]
    assert len(keys.drop_duplicates()) == len(table) == 2 * 2 * 2 * 2
    assert set(table["primitive"]) == {"turn", "scrape"}  # the first one has no feedback
    part = table[(table["model"] == NOMINAL) & (table["setting_deg"] == 10.0)]
    runs = sets[0].runs[10.0]
    alone = execution_scores(runs, cuts(runs, ("turn", "scrape")), MEAN, Y)
    np.testing.assert_allclose(part["end_roll_deg"], alone["end_roll_deg"])
    np.testing.assert_allclose(part["cost_rad"], alone["cost_rad"])
