from itertools import pairwise

import numpy as np
import pytest

from structlearn.avoidance import avoidance_network
from structlearn.core import artefacts
from structlearn.core.errors import InputError

SIZES = (4, 3)


def random_networks(count=3, inputs="features", seed=0):
    columns = avoidance_network.seen_columns(inputs)
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


@pytest.mark.parametrize("inputs", avoidance_network.INPUTS)
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
    rng = np.random.default_rng(0)
    inputs = [rng.normal(size=(20, 17)), rng.normal(size=(30, 17))]
    inputs[0][:, 4] = 7.0  # constant: no range to divide by
    targets = [rng.normal(size=(20, 3)), 5.0 + rng.normal(size=(30, 3))]
    layers = [np.zeros((18, 2)), np.zeros((3, 3))]
    stack = avoidance_network.scaled_networks([layers, layers], inputs, targets, range(17))
    assert len(stack) == 2
    np.testing.assert_allclose(stack.input_low[1], inputs[1].min(axis=0))
    assert (stack.input_high > stack.input_low).all()
    found = stack.take([1])(inputs[1], np.zeros(30), np.zeros(30))
    np.testing.assert_allclose(found, np.broadcast_to(targets[1].mean(axis=0), (30, 3)))


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
