import numpy as np
import pytest
import torch

from structlearn.feedback.stacked_networks import (
    StackedFeedForwardNetworks,
    StackedPhaseModulatedNetworks,
    kernel_scale,
)
from structlearn.primitives import kernels

MODELS, INPUTS, BATCH, KERNELS = 3, 4, 50, 25
MODULATION = kernels.unit_features(BATCH, KERNELS)  # one movement


def stack(hidden=(10,), models=MODELS, dropout=0.5, seed=0):
    generator = torch.Generator().manual_seed(seed)
    network = StackedPhaseModulatedNetworks(models, INPUTS, hidden, KERNELS, dropout, generator)
    with torch.no_grad():  # biases too, which start from zero
        for values in network.parameters():
            values += 0.3 * torch.randn(values.shape, generator=generator)
    return network


def batch(models=MODELS):
    inputs = torch.randn(models, BATCH, INPUTS, generator=torch.Generator().manual_seed(1))
    return inputs, torch.tensor(MODULATION, dtype=torch.float32).expand(models, -1, -1)


@pytest.mark.parametrize("hidden", [(), (10,), (6, 5)])
def test_an_exported_network_computes_what_its_stack_does(hidden):
    network = stack(hidden).eval()
    inputs, modulation = batch()
    outputs = network(inputs, modulation).detach().numpy()
    mean, scale = np.arange(4.0), np.array([0.5, 1.0, 2.0, 4.0])
    for index in range(MODELS):
        exported = network.to_network(index, mean, scale, output_scale=30.0)
        found = exported.coupling(inputs[index].numpy() * scale + mean, MODULATION)
        assert found.dtype == np.float64
        np.testing.assert_allclose(found, 30.0 * outputs[index], atol=30.0 * 1e-5)
        assert np.abs(found).max() > 1.0


def test_a_stack_starts_from_exported_networks():
    network = stack((6, 5)).eval()
    exported = [network.to_network(i, np.zeros(4), np.ones(4), 2.0 + i) for i in range(MODELS)]
    generator = torch.Generator().manual_seed(9)
    again = StackedPhaseModulatedNetworks.from_networks(exported, [2.0, 3.0, 4.0], 0.5, generator).eval()
    torch.testing.assert_close(again(*batch()), network(*batch()), atol=1e-6, rtol=0.0)


def test_every_model_has_its_own_weights():
    first, second, third = stack().phase_weights.detach()
    assert not torch.equal(first, second)
    assert not torch.equal(second, third)


def test_models_of_a_stack_do_not_touch_each_other():
    network, (inputs, modulation) = stack(), batch()
    network(inputs, modulation)[1].square().sum().backward()
    for values in network.parameters():
        assert values.grad[1].abs().max() > 0.0
        assert values.grad[[0, 2]].abs().max() == 0.0


def test_where_the_phase_rests_there_is_no_coupling():
    inputs, _ = batch()
    assert stack().eval()(inputs, torch.zeros(MODELS, BATCH, KERNELS)).abs().max() == 0.0


def test_dropout_keeps_the_mean_and_spares_the_phase_layer():
    inputs, modulation = batch()
    network = stack((200,))
    torch.testing.assert_close(
        torch.stack([network.hidden(inputs) for _ in range(400)]).mean(dim=0),
        network.eval().hidden(inputs),
        atol=0.25,
        rtol=0.0,
    )
    alone = stack(()).train()  # no regular hidden layer: nothing is dropped
    torch.testing.assert_close(alone(inputs, modulation), alone(inputs, modulation), atol=0.0, rtol=0.0)
    masked = (network.train().hidden(inputs) == 0.0).float().mean()
    assert abs(float(masked) - 0.5) < 0.02


def test_every_scaled_kernel_sees_a_phase_velocity_of_one_on_average():
    features = kernels.unit_features(3000, KERNELS)
    shares = features[1:-1] / features[1:-1].sum(axis=1, keepdims=True)  # u = 0 at the start
    means = features[1:-1].sum(axis=0) / shares.sum(axis=0)
    np.testing.assert_allclose(means * kernel_scale(KERNELS), -1.0, rtol=0.03)
    assert means.min() < -4.5  # in mid-movement
    assert means.max() > -0.2  # at the end: gradients were almost thirty times smaller


def test_feed_forward_network_is_the_equation():
    generator = torch.Generator().manual_seed(0)
    network = StackedFeedForwardNetworks(MODELS, INPUTS, (10, 5), 0.5, generator).eval()
    with torch.no_grad():
        network.output_biases += torch.tensor([1.0, 2.0, 3.0])[:, None, None]
    inputs, _ = batch()
    outputs = network(inputs)
    assert outputs.shape == (MODELS, BATCH)
    for index in range(MODELS):
        layer = inputs[index]
        for weights, biases in network.hidden.layers():
            layer = torch.tanh(layer @ weights[index] + biases[index])
        expected = layer @ network.output_weights[index] + network.output_biases[index]
        torch.testing.assert_close(outputs[index], expected[:, 0], atol=1e-6, rtol=1e-5)
    assert not torch.equal(network.train()(inputs), network(inputs))  # dropout draws anew
