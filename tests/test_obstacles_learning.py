import numpy as np
import pytest
from committed import committed
from test_obstacles_models import toy_dataset

from structlearn.avoidance.learned_models import read_models, write_models
from structlearn.avoidance.network_training import NetworkParameters, held_out_rows
from structlearn.avoidance.shapes import obstacle
from structlearn.feedback.training_parameters import TrainingParameters
from structlearn.ground.errors import InputError
from structlearn.ground.metrics import nmse
from structlearn.testbeds.obstacles.protocol.avoidance_fits import learn
from structlearn.testbeds.obstacles.protocol.fit_parameters import AvoidanceTrainingParameters
from structlearn.testbeds.obstacles.world.scenarios import Scenario

SCENARIOS = [
    Scenario(number, obstacle(shape, np.zeros(3))) for shape in ("sphere", "cube") for number in (1, 2)
]
QUICK = committed(NetworkParameters, "obstacle_training.per_setting", hidden=(4,), training={"iterations": 4})
PARAMETERS = committed(
    AvoidanceTrainingParameters,
    "obstacle_training",
    per_setting=QUICK,
    per_shape=QUICK,
    all_shapes=QUICK.model_copy(update={"hidden": (5,)}),
    phase_modulated=committed(
        TrainingParameters, "compare_models", steps=40, evaluate_every=20, chunk_samples=5
    ),
    phase_modulated_hidden=(4,),
)


@pytest.fixture(scope="module")
def learned():
    return learn(toy_dataset(scenarios=4), SCENARIOS, PARAMETERS)


def test_every_source_has_its_models_and_errors(learned):
    models, errors = learned
    sources = {"setting", "sphere", "cube", "all"}
    assert set(models.networks) == sources
    assert set(models.human_inspired) == sources - {"all"}
    assert set(models.phase_modulated) == sources - {"setting"}
    assert len(models.networks["setting"]) == len(models.human_inspired["setting"]) == len(SCENARIOS)
    counts = errors[errors["part"] == "test"].groupby(["model", "learned_from"]).size()
    assert counts["network"].to_dict() == {"setting": 4, "sphere": 1, "cube": 1, "all": 2}
    assert counts["human_inspired"].to_dict() == {"setting": 4, "sphere": 1, "cube": 1}
    assert counts["phase_modulated"].to_dict() == {"sphere": 1, "cube": 1, "all": 2}


def test_errors_are_those_of_the_models_on_the_named_samples(learned):
    models, errors = learned
    dataset = toy_dataset(scenarios=4)
    test = held_out_rows(dataset, PARAMETERS.split)
    errors = errors[(errors["model"] == "network") & (errors["part"] == "test")]
    errors = errors.set_index(["learned_from", "obstacle", "scenario"])
    for key, places, network in (
        (("setting", "cube", 1), [2], models.networks["setting"].take([2])),
        (("sphere", "sphere", 0), [0, 1], models.networks["sphere"]),
        (("all", "cube", 0), [2, 3], models.networks["all"]),
    ):
        its = dataset.where(np.isin(dataset.scenario, places) & test)
        expected = nmse(network(its.features, its.phase, its.phase_velocity), its.target)
        found = errors.loc[key, ["nmse_x", "nmse_y", "nmse_z"]]
        np.testing.assert_allclose(found.to_numpy(float), expected)


def test_models_come_back_from_their_files(learned, tmp_path):
    models, _ = learned
    write_models(models, tmp_path)
    back = read_models(tmp_path)
    state = np.random.default_rng(0).normal(size=(1, 17)), np.array([0.5]), np.array([-3.0])
    for kind in ("networks", "human_inspired", "phase_modulated"):
        ours, theirs = getattr(models, kind), getattr(back, kind)
        assert set(ours) == set(theirs)
        for name in set(ours) - {"setting"}:
            np.testing.assert_allclose(ours[name](*state), theirs[name](*state), rtol=1e-9)


def test_samples_of_other_scenarios_are_refused():
    with pytest.raises(InputError, match="not those of 3 scenarios"):
        learn(toy_dataset(scenarios=4), SCENARIOS[:3], PARAMETERS)
