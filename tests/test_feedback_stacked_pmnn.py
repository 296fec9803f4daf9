import numpy as np
import pytest
import torch
from feedback_skills import random_network

from structlearn.core import artefacts
from structlearn.core.errors import InputError
from structlearn.feedback import coupling_model
from structlearn.feedback.stacked_pmnn import StackedPhaseModulatedNetworks, kernel_scale
from structlearn.primitives import canonical, kernels

MODELS, CHANNELS, BATCH, KERNELS = 3, 4, 50, 25
TIMES = np.linspace(0.0, 1.0, BATCH)
PHASE = canonical.phase(TIMES, canonical.TAU_PER_DURATION)  # one movement
MODULATION = kernels.features(*PHASE, KERNELS)


def stack(hidden=(10,)):
    generator = torch.Generator().manual_seed(0)
    network = StackedPhaseModulatedNetworks(MODELS, CHANNELS, hidden, KERNELS, 0.5, generator)
    with torch.no_grad():  # biases too, which start from zero
        for values in network.parameters():
            values += 0.3 * torch.randn(values.shape, generator=generator)
    return network


def batch():
    inputs = torch.randn(MODELS, BATCH, CHANNELS, generator=torch.Generator().manual_seed(1))
    return inputs, torch.tensor(MODULATION, dtype=torch.float32).expand(MODELS, -1, -1)


@pytest.mark.parametrize("hidden", [(), (10,), (6, 5)])
def test_an_exported_network_computes_what_its_stack_does_and_starts_another(hidden):
    network = stack(hidden)
    inputs, modulation = batch()
    outputs = network.forward(inputs, modulation).detach().numpy()
    mean, scale = np.arange(4.0), np.array([0.5, 1.0, 2.0, 4.0])
    for index in range(MODELS):
        exported = network.to_network(index, mean, scale, output_scale=30.0)
        found = exported.coupling(inputs[index].numpy() * scale + mean, *PHASE)
        assert found.dtype == np.float64
        np.testing.assert_allclose(found, 30.0 * outputs[index], atol=30.0 * 1e-5)
        assert np.abs(found).max() > 1.0
    exported = [network.to_network(i, mean, scale, 2.0 + i) for i in range(MODELS)]
    again = StackedPhaseModulatedNetworks.from_networks(
        exported, [2.0, 3.0, 4.0], 0.5, torch.Generator().manual_seed(9)
    )
    torch.testing.assert_close(again.forward(*batch()), network.forward(*batch()), atol=1e-6, rtol=0.0)


def test_the_phase_layer_is_spared_from_dropout():
    whole, alone = stack(), stack(())  # no regular hidden layer: nothing is dropped
    assert torch.equal(alone.forward(*batch(), training=True), alone.forward(*batch()))
    assert not torch.equal(whole.forward(*batch(), training=True), whole.forward(*batch()))


def test_every_scaled_kernel_sees_a_phase_velocity_of_one_on_average():
    features = kernels.unit_features(3000, KERNELS)
    shares = features[1:-1] / features[1:-1].sum(axis=1, keepdims=True)  # u = 0 at the start
    means = features[1:-1].sum(axis=0) / shares.sum(axis=0)
    np.testing.assert_allclose(means * kernel_scale(KERNELS), -1.0, rtol=0.03)
    assert means.min() < -4.5  # in mid-movement
    assert means.max() > -0.2  # at the end: gradients were almost thirty times smaller


INPUTS, FEW_KERNELS = 4, 5


def by_hand(network, deviation, modulation):
    """Equations IV.27-IV.30 for one sample, node by node."""
    layer = [(x - m) / s for x, m, s in zip(deviation, network.input_mean, network.input_scale, strict=True)]
    for weights, biases in network.hidden:
        rows = zip(weights, biases, strict=True)
        layer = [np.tanh(sum(w * h for w, h in zip(row, layer, strict=True)) + bias) for row, bias in rows]
    coupling = 0.0
    for kernel in range(FEW_KERNELS):
        unit = sum(w * h for w, h in zip(network.phase_weights[kernel], layer, strict=True))
        unit += network.phase_biases[kernel]
        coupling += network.output_weights[kernel] * modulation[kernel] * unit
    return coupling


@pytest.mark.parametrize("sizes", [(), (7,), (6, 3), (100,)])
@pytest.mark.parametrize("scale", [1.0, 1e6])
def test_coupling_is_the_equation_node_by_node(sizes, scale):
    """Also where layers saturate."""
    rng = np.random.default_rng(1)
    network = random_network(rng, INPUTS, sizes, FEW_KERNELS)
    deviation = scale * 10.0 * rng.normal(size=(2, 3, INPUTS))
    phase = canonical.phase(np.array([0.2, 0.5, 0.9]), 2.0)
    found = network.coupling(deviation, *phase)
    modulation = kernels.features(*phase, FEW_KERNELS)
    assert found.shape == (2, 3)
    for index in np.ndindex(2, 3):
        expected = by_hand(network, deviation[index], modulation[index[1]])
        np.testing.assert_allclose(found[index], expected, rtol=1e-11)
        one = network.coupling(deviation[index], phase[0][index[1]], phase[1][index[1]])
        assert one.shape == ()
        np.testing.assert_allclose(one, expected, rtol=1e-11)


@pytest.mark.parametrize("description", ["a network", "[1]", "{}", '{"coupling_models": {"turn": "pmnn"}}'])
def test_foreign_files_are_named(tmp_path, description):
    artefacts.write_tensors({"layer.weights": np.ones(3)}, tmp_path / "n.safetensors", description)
    with pytest.raises(InputError, match=r"n\.safetensors: holds no feedback networks"):
        coupling_model.read_networks(tmp_path / "n.safetensors")
