import numpy as np
import pytest
from committed import committed
from test_obstacles_models import toy_dataset

from structlearn.avoidance.network_training import NetworkParameters, held_out_rows
from structlearn.avoidance.shapes import obstacle
from structlearn.core.metrics import nmse
from structlearn.feedback.coupling_model import TrainingParameters
from structlearn.testbeds.obstacles.protocol.avoidance_fits import AvoidanceTrainingParameters, learn
from structlearn.testbeds.obstacles.world.scenarios import Scenario, own_scenarios

SCENARIOS = [
    Scenario(number, obstacle(shape, np.zeros(3))) for shape in ("sphere", "cube") for number in (1, 2)
]
CHANGES = {"hidden": (4,), "training": {"iterations": 4}}
QUICK = committed(NetworkParameters, "obstacle_training.per_setting", **CHANGES)
PARAMETERS = committed(
    AvoidanceTrainingParameters,
    "obstacle_training",
    per_setting=QUICK,
    across_settings=QUICK,
    ensemble=CHANGES | {"members": 2, "demonstrations": 6},
    phase_modulated=committed(
        TrainingParameters, "compare_models", steps=40, evaluate_every=20, chunk_samples=5
    ),
    phase_modulated_hidden=(4,),
)
PEOPLE = (7, 3)


@pytest.fixture(scope="module")
def datasets():
    return {person: toy_dataset(scenarios=4, seed=person) for person in PEOPLE}


@pytest.fixture(scope="module")
def learned(datasets):
    return learn(datasets, SCENARIOS, PARAMETERS, modulated=7)


def test_settings_are_dealt_out_with_all_their_shapes():
    own = own_scenarios(SCENARIOS, PEOPLE)
    assert {person: its.tolist() for person, its in own.items()} == {7: [0, 2], 3: [1, 3]}
    assert own_scenarios(SCENARIOS, [5, 6, 7])[7].tolist() == []


def test_errors_are_those_of_the_models_on_the_named_samples(learned, datasets):
    models, errors = learned
    errors = errors[errors["part"] == "test"]
    errors = errors.set_index(["person", "model", "learned_from", "obstacle", "scenario"])
    for key, places, network in (
        ((7, "network", "setting", "cube", 1), [2], models[7]["network"]["setting"].take([1])),
        ((3, "network", "setting", "sphere", 2), [1], models[3]["network"]["setting"].take([0])),
        ((3, "network", "sphere", "sphere", 0), [0, 1], models[3]["network"]["sphere"]),
        ((7, "ensemble", "all", "cube", 0), [2, 3], models[7]["ensemble"]["all"]),
    ):
        dataset = datasets[key[0]]
        its = dataset.where(np.isin(dataset.scenario, places) & held_out_rows(dataset, PARAMETERS.split))
        expected = nmse(network(its.features, its.phase, its.phase_velocity), its.target)
        found = errors.loc[key, ["nmse_x", "nmse_y", "nmse_z"]]
        np.testing.assert_allclose(found.to_numpy(float), expected)
