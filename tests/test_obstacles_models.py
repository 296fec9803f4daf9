"""Networks and the human-inspired rival, and what people's reaches teach them: splits, fits, errors."""

from itertools import pairwise

import numpy as np
import pytest
from committed import committed
from sklearn.linear_model import ARDRegression

from dissertation.obstacles.protocol.avoidance_fits import AvoidanceTrainingParameters, learn_avoidance
from dissertation.obstacles.world.scenarios import Scenario, own_scenarios
from structlearn.avoidance import avoidance_network, learned_models, network_training, rai_2014
from structlearn.avoidance.avoidance_dataset import AvoidanceDataset
from structlearn.avoidance.features import obstacle_features
from structlearn.avoidance.network_training import (
    AvoidanceNetworkParameters,
    EnsembleParameters,
    SplitParameters,
)
from structlearn.avoidance.shapes import obstacle
from structlearn.core import artefacts
from structlearn.core.errors import InputError
from structlearn.core.metrics import nmse
from structlearn.feedback.coupling_model import write_networks
from structlearn.feedback.trainers import TrainingParameters
from structlearn.primitives import canonical

SIZES = (4, 3)


def random_networks(count=3, inputs="features", seed=0):
    columns = network_training.seen_columns(inputs)
    rng = np.random.default_rng(seed)
    widths = (len(columns), *SIZES, 3)
    low = rng.normal(size=(count, len(columns)))
    middle = rng.normal(size=(count, 3))
    return avoidance_network.AvoidanceNetworks(
        columns=np.array(columns),
        input_low=low,
        input_high=low + rng.uniform(0.5, 2.0, low.shape),
        layers=tuple(rng.normal(size=(count, before + 1, after)) for before, after in pairwise(widths)),
        output_mean=middle,
        output_scale=rng.uniform(0.5, 2.0, (count, 3)),
        output_low=middle - 1e9,
        output_high=middle + 1e9,
    )


def states(count, seed=1):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, 17)), rng.uniform(0.0, 1.0, count), rng.uniform(-4.6, 0.0, count)


def by_hand(networks, index, features, p, u):
    """The module's equations for one sample, node by node."""
    seen = np.append(features, [p, u])[networks.columns]
    low, high = networks.input_low[index], networks.input_high[index]
    values = [2.0 * (s - a) / (b - a) - 1.0 for s, a, b in zip(seen, low, high, strict=True)]
    for place, layer in enumerate(networks.layers):
        weights, biases = layer[index][:-1], layer[index][-1]
        values = [
            sum(v * w for v, w in zip(values, weights[:, node], strict=True)) + biases[node]
            for node in range(len(biases))
        ]
        if place < len(networks.layers) - 1:
            values = [max(0.0, value) for value in values]
    return networks.output_mean[index] + networks.output_scale[index] * np.array(values)


@pytest.mark.parametrize("inputs", network_training.COLUMNS)
def test_network_of_each_sample_node_by_node(inputs):
    networks, (features, p, u) = random_networks(inputs=inputs), states(3)
    found = networks(features, p, u)
    for b in range(3):
        np.testing.assert_allclose(found[b], by_hand(networks, b, features[b], p[b], u[b]))


def test_one_network_serves_all_samples_and_many_must_match():
    networks, (features, p, u) = random_networks(), states(5)
    alone, each = networks.take([1]), networks.take([1] * 5)
    np.testing.assert_allclose(alone(features, p, u), each(features, p, u), rtol=1e-12, atol=1e-12)
    with pytest.raises(ValueError, match="5 samples for 3 networks"):
        networks(features, p, u)


def test_mean_of_networks_is_one_network():
    members = [[layer[index] for layer in random_networks(seed=5).layers] for index in range(3)]
    inputs = np.random.default_rng(0).normal(size=(7, 17))
    mean = np.mean([avoidance_network.forward(layers, inputs) for layers in members], axis=0)
    found = avoidance_network.forward(avoidance_network.averaged(members), inputs)
    np.testing.assert_allclose(found, mean, atol=1e-12)


def test_scaling_takes_training_data_to_the_unit_range():
    first, second = toy_dataset(scenarios=1), toy_dataset(scenarios=1, seed=1)
    first.features[:, 4] = 7.0  # constant: no range to divide by
    layers = [np.zeros((18, 2)), np.zeros((3, 3))]
    stack = network_training.stacked([layers, layers], [first, second], chosen(inputs="features"))
    assert len(stack) == 2
    np.testing.assert_allclose(stack.input_low[1], second.features.min(axis=0))
    assert (stack.input_high > stack.input_low).all()
    found = stack.take([1])(second.features, second.phase, second.phase_velocity)
    np.testing.assert_allclose(found, np.broadcast_to(second.target.mean(axis=0), found.shape))


def test_files_hold_the_networks_and_others_are_refused(tmp_path):
    stacks = {"sphere": random_networks(1), "cube": random_networks(2, "phase", seed=3)}
    path = tmp_path / "networks.safetensors"
    avoidance_network.write_avoidance_networks(stacks, path)
    found = avoidance_network.read_avoidance_networks(path)
    for name, stack in stacks.items():
        its = states(len(stack))
        np.testing.assert_array_equal(found[name](*its), stack(*its))
    artefacts.write_tensors({"a": np.zeros(2)}, path, "{}")
    with pytest.raises(InputError, match="holds no avoidance networks"):
        avoidance_network.read_avoidance_networks(path)
    stacks["sphere"].layers[0][0, 0, 0] = np.nan
    avoidance_network.write_avoidance_networks(stacks, path)
    with pytest.raises(InputError, match=r"sphere\.layers\.0 holds a value that is not finite"):
        avoidance_network.read_avoidance_networks(path)


GRID = len(rai_2014.BETA_PER_RAD) * len(rai_2014.DECAY_PER_M)


def seen(to, velocity):
    """Features of a tiny obstacle in direction `to`, seen from the origin at tau 1."""
    to = np.asarray(to, dtype=float)
    cloud = to + 1e-9 * np.eye(3)
    return obstacle_features(np.zeros(3), np.asarray(velocity, dtype=float), 1.0, cloud, to)


def random_states(count, seed=0):
    rng = np.random.default_rng(seed)
    to = rng.normal(size=(count, 3))
    cloud = to[:, None] + 0.05 * rng.normal(size=(count, 6, 3))
    return obstacle_features(np.zeros((count, 3)), rng.normal(size=(count, 3)), 1.0, cloud, to)


def test_effect_is_the_equation():
    found = rai_2014.steering_features(seen([1.0, 1.0, 0.0], [2.0, 0.0, 0.0]))
    angle, distance = np.pi / 4, np.sqrt(2.0)
    beta, decay = rai_2014.BETA_PER_RAD[1], rai_2014.DECAY_PER_M[3]
    place = len(rai_2014.DECAY_PER_M) + 3
    size = 2.0 * angle * np.exp(-beta * angle) * np.exp(-decay * distance)
    np.testing.assert_allclose(found[:, place], [0.0, -size, 0.0], atol=1e-12)  # away from y > 0
    np.testing.assert_allclose(found[:, GRID + place], [0.0, -size, 0.0], atol=1e-6)


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
def test_no_effect_at_rest_or_straight_ahead(velocity):
    found = rai_2014.steering_features(seen([1.0, 0.0, 0.0], velocity))
    np.testing.assert_allclose(found, 0.0, atol=1e-8)


def test_known_weights_are_found_and_others_pruned():
    states = random_states(600)
    weights = np.zeros((1, 3, 2 * GRID))
    weights[0, 1, 7], weights[0, 2, GRID + 11] = 40.0, -25.0
    truth = rai_2014.HumanInspiredModels(weights)
    target = truth(states, np.zeros(600), np.zeros(600))
    found = rai_2014.fit_human_inspired(states, target)
    again = random_states(100, seed=1)
    zero = np.zeros(100)
    np.testing.assert_allclose(found(again, zero, zero), truth(again, zero, zero), atol=0.05)
    assert found.weights[0, 0].tolist() == [0.0] * (2 * GRID)  # nothing along x: no weight along x
    assert np.count_nonzero(found.weights[0]) < 60


@pytest.mark.parametrize("count", [40, 500])
def test_the_regression_is_that_of_the_library(count):
    rng = np.random.default_rng(count)
    inputs = rng.normal(size=(count, 50)) @ rng.normal(size=(50, 50))  # correlated, as effects are
    target = inputs[:, :3].sum(axis=1) + rng.normal(size=count)
    expected = ARDRegression(max_iter=rai_2014.ITERATIONS, fit_intercept=False).fit(inputs, target)
    found = rai_2014.pruning_regression(inputs, target)
    np.testing.assert_allclose(found, expected.coef_, atol=1e-8 * np.abs(expected.coef_).max())
    assert (found == 0.0).any()


def test_model_of_each_sample():
    rng = np.random.default_rng(0)
    stack = rai_2014.HumanInspiredModels(rng.normal(size=(4, 3, 2 * GRID)))
    states, zero = random_states(4), np.zeros(4)
    found = stack(states, zero, zero)
    for index in range(4):
        alone = stack.take([index])(states, zero, zero)
        np.testing.assert_allclose(found[index], alone[index])
    with pytest.raises(ValueError, match="3 samples for 4 models"):
        stack(states[:3], zero[:3], zero[:3])


def test_files_hold_the_models(tmp_path):
    rng, path = np.random.default_rng(0), tmp_path / "models.safetensors"
    stacks = {
        name: rai_2014.HumanInspiredModels(rng.normal(size=(2, 3, 2 * GRID))) for name in ("cube", "all")
    }
    rai_2014.write_human_inspired(stacks, path)
    found = rai_2014.read_human_inspired(path)
    for name, stack in stacks.items():
        np.testing.assert_array_equal(found[name].weights, stack.weights)
    artefacts.write_tensors({"a": np.zeros(2)}, path, "{}")
    with pytest.raises(InputError, match="holds no human-inspired models"):
        rai_2014.read_human_inspired(path)


QUICK = {"iterations": 6}
SPLIT = committed(SplitParameters, "obstacle_training.split", test_share=0.2)


def chosen(**changes):
    return committed(AvoidanceNetworkParameters, "obstacle_training.per_setting", **changes)


def by_scenario(dataset):
    """The samples of each scenario, in the order of their numbers."""
    return [dataset.where(dataset.scenario == scenario) for scenario in np.unique(dataset.scenario)]


def toy_dataset(scenarios=2, demonstrations=5, samples=25, noise=0.05, size=(0.0, 2.0, 0.2), seed=0):
    """Coupling of the features, fading with the phase; `size` is that of the common course per axis."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 1.0, samples)
    p, u = canonical.phase(time, canonical.TAU_PER_DURATION)
    count = scenarios * demonstrations
    features = rng.uniform(-1.0, 1.0, (count, samples, 17))
    target = np.array(size) * (np.sin(2.0 * np.pi * time) * np.abs(u))[:, None]
    target = target + 0.3 * features[..., :3] * u[:, None] + noise * rng.normal(size=(count, samples, 3))
    number = np.arange(count).repeat(samples)
    return AvoidanceDataset(
        features=features.reshape(-1, 17),
        target=target.reshape(-1, 3),
        phase=np.tile(p, count),
        phase_velocity=np.tile(u, count),
        scenario=number // demonstrations,
        demonstration=number % demonstrations,
        time=np.tile(time, count),
    )


def test_a_fifth_of_the_demonstrations_of_every_scenario_tests():
    dataset = toy_dataset(scenarios=3, demonstrations=10)
    mask = network_training.held_out_rows(dataset, SPLIT)
    found = []
    for one, its in zip(by_scenario(dataset), np.split(mask, 3), strict=True):
        tested = {int(number) for number in np.unique(one.demonstration[its])}
        assert len(tested) == 2
        assert not tested & set(one.demonstration[~its].tolist())  # no demonstration is on both sides
        found.append(tested)
    assert len({tuple(sorted(one)) for one in found}) > 1  # scenarios draw on their own
    alone = network_training.held_out_rows(by_scenario(dataset)[1], SPLIT)
    np.testing.assert_array_equal(alone, np.split(mask, 3)[1])
    assert not np.array_equal(
        mask, network_training.held_out_rows(dataset, SplitParameters(test_share=0.2, seed=1))
    )


@pytest.mark.parametrize("rule", ["validation", "evidence"])
def test_a_network_learns_the_same_alone_and_among_others(rule):
    sets = by_scenario(toy_dataset())
    parameters = chosen(hidden=(6, 4), training={"rule": rule} | QUICK)
    stack = network_training.fit_networks(sets, parameters, "test")
    again = network_training.fit_networks(sets[:1], parameters, "test")
    for layer, alone in zip(stack.layers, again.layers, strict=True):
        np.testing.assert_array_equal(layer[0], alone[0])
    assert not np.array_equal(stack.layers[0][0], stack.layers[0][1])


def ensemble(**changes):
    return committed(EnsembleParameters, "obstacle_training.ensemble", **changes)


def test_a_member_sees_whole_demonstrations_from_elsewhere_across_the_reach():
    dataset = toy_dataset(scenarios=2, demonstrations=10)
    seen = network_training.member_samples(dataset, ensemble(demonstrations=8, displaced_m=0.1), (0, 1))
    assert len(seen) == 8 * 25
    keys = {tuple(key) for key in np.stack([seen.scenario, seen.demonstration, seen.time], axis=1)}
    rows = [key in keys for key in zip(dataset.scenario, dataset.demonstration, dataset.time, strict=True)]
    np.testing.assert_array_equal(seen.target, dataset.target[rows])  # what was done stays
    off = dataset.features[rows] - seen.features
    assert off[:, 1:3].std() == pytest.approx(0.1, rel=0.15)
    np.testing.assert_allclose(off[:, 6], off[:, 1])  # the closest point is off as the centre is
    np.testing.assert_allclose(off[:, [0, 3, 4, 5, 12]], 0.0, atol=1e-12)  # nothing along the reach
    assert off[:, 13:15].std() == pytest.approx(ensemble().displaced_velocity_m, rel=0.15)
    other = network_training.member_samples(dataset, ensemble(demonstrations=8, displaced_m=0.1), (0, 2))
    assert not np.array_equal(seen.features, other.features)


def test_errors_tell_fit_from_generalisation_and_the_phase_helps():
    dataset = toy_dataset(scenarios=1, demonstrations=15)
    mask = network_training.held_out_rows(dataset, SPLIT)
    errors = {}
    for inputs in ("features", "phase"):
        parameters = chosen(hidden=(10, 6), inputs=inputs, training={"iterations": 20})
        stack = network_training.fit_networks([dataset.where(~mask)], parameters, "test")
        errors[inputs] = network_training.fit_errors(dataset, mask, stack)
    for train, test in errors.values():
        assert (train["part"], test["part"]) == ("train", "test")
        assert train["nmse"] == pytest.approx(np.mean([train[f"nmse_{axis}"] for axis in "xyz"]))
        assert train["nmse"] < test["nmse"]
        assert test["dominant"] == "y"
        assert test["nmse_dominant"] == test["nmse_y"]
    seen, blind = errors["phase"][1], errors["features"][1]
    assert seen["nmse_y"] < 0.1 < blind["nmse_y"]


@pytest.mark.parametrize(
    ("size", "noise", "axis"),
    [
        ((0.0, 2.0, 0.2), 0.05, "y"),
        ((0.0, 0.2, 2.0), 0.05, "z"),
        ((5.0, 2.0, 1.8), 0.05, None),  # along both
        ((5.0, 0.0, 0.0), 0.05, None),  # along the reach only
        ((0.0, 2.0, 0.2), 4.0, "y"),  # above what single demonstrations differ by; rms of the mean is 3.9
        ((0.0, 2.0, 0.2), 6.0, None),
    ],
)
def test_dominant_axis(size, noise, axis):
    dataset = toy_dataset(scenarios=1, demonstrations=5 if noise < 1.0 else 40, size=size, noise=noise)
    assert network_training.dominant_axis(dataset) == axis


def test_demonstrations_that_validate_do_not_train(monkeypatch):
    dataset = toy_dataset(scenarios=2, demonstrations=5)
    seen = []

    def train(layers, samples, training, validation=None):
        seen.extend([samples, validation])
        return ()

    monkeypatch.setattr(network_training.lm, "levenberg_marquardt", train)
    parameters = chosen(training={"rule": "validation"} | QUICK)
    network_training.train_member(dataset, parameters, (0, 0))
    trains, validates = ({row.tobytes() for row in its.inputs} for its in seen)
    assert not trains & validates
    assert len(trains | validates) == len(dataset)
    assert len(validates) == 2 * 25  # 15 % of ten demonstrations, whole ones


def test_phase_modulated_avoidance_rests_with_the_phase(tmp_path):
    dataset = toy_dataset(demonstrations=8)
    parameters = committed(TrainingParameters, "compare_models", steps=800, dropout=0.0, evaluate_every=200)
    model = learned_models.train_phase_modulated(dataset, parameters, hidden=(20,))
    found = model(dataset.features, dataset.phase, dataset.phase_velocity)
    assert found.shape == dataset.target.shape
    assert np.mean((found - dataset.target)[:, 1] ** 2) < 0.1 * dataset.target[:, 1].var()
    at_rest = model(dataset.features, np.ones(len(dataset)), np.zeros(len(dataset)))
    np.testing.assert_array_equal(at_rest, 0.0)
    learned_models.write_phase_modulated({"sphere": model, "all": model}, tmp_path / "models.safetensors")
    back = learned_models.read_phase_modulated(tmp_path / "models.safetensors")
    assert list(back) == ["all", "sphere"]
    states = dataset.features, dataset.phase, dataset.phase_velocity
    np.testing.assert_allclose(back["sphere"](*states), found, rtol=1e-9)
    write_networks([("sphere.x", model.networks[0])], tmp_path / "part.safetensors")
    with pytest.raises(InputError, match="one network for each of x, y and z"):
        learned_models.read_phase_modulated(tmp_path / "part.safetensors")


SCENARIOS = [
    Scenario(number, obstacle(shape, np.zeros(3))) for shape in ("sphere", "cube") for number in (1, 2)
]
CHANGES = {"hidden": (4,), "training": {"iterations": 4}}
SMALL = committed(AvoidanceNetworkParameters, "obstacle_training.per_setting", **CHANGES)
PARAMETERS = committed(
    AvoidanceTrainingParameters,
    "obstacle_training",
    per_setting=SMALL,
    across_settings=SMALL,
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
    return learn_avoidance(datasets, SCENARIOS, PARAMETERS, modulated=7)


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
        its = dataset.where(
            np.isin(dataset.scenario, places) & network_training.held_out_rows(dataset, PARAMETERS.split)
        )
        expected = nmse(network(its.features, its.phase, its.phase_velocity), its.target)
        found = errors.loc[key, ["nmse_x", "nmse_y", "nmse_z"]]
        np.testing.assert_allclose(found.to_numpy(float), expected)
