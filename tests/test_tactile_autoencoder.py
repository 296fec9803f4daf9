import numpy as np
import pytest
import torch

from structlearn.networks.small_networks import StackedLayers, tanh
from structlearn.tactile.autoencoder import StackedAutoencoders, latent_losses


def layers(models, sizes=(4, 7, 5, 2), normalised=True, seed=0):
    return StackedLayers.initial(models, sizes, torch.Generator().manual_seed(seed), normalised)


def reference(stack, model):
    """One network of a stack as torch's own modules, samples first."""
    modules = []
    for place, (weights, biases) in enumerate(zip(stack.weights, stack.biases, strict=True)):
        last = place == len(stack.weights) - 1
        linear = torch.nn.Linear(weights.shape[2], weights.shape[1], bias=last)
        linear.weight.data = weights[model].detach().clone()
        modules.append(linear)
        if last:
            linear.bias.data = biases[model, :, 0].detach().clone()
        else:
            norm = torch.nn.BatchNorm1d(weights.shape[1])
            norm.weight.data = stack.scales[place][model].detach().clone()
            norm.bias.data = biases[model, :, 0].detach().clone()
            modules += [norm, torch.nn.Tanh()]
    return torch.nn.Sequential(*modules)


def test_a_stack_is_many_of_torchs_networks_in_training_and_after_it():
    stack = layers(3)
    for values in (*stack.scales, *stack.biases):
        values.data.uniform_(0.5, 1.5, generator=torch.Generator().manual_seed(1))
    inputs = torch.randn(3, 4, 50, generator=torch.Generator().manual_seed(2))
    theirs = [reference(stack, model) for model in range(3)]
    for training in (True, True, False):
        ours = stack.forward(inputs, training)
        for model, network in enumerate(theirs):
            expected = network.train(training)(inputs[model].T).T
            torch.testing.assert_close(ours[model], expected, atol=1e-5, rtol=1e-4)


def test_gradients_of_models_do_not_mix():
    stack = layers(3)
    outputs = stack.forward(torch.randn(3, 4, 20), training=True)
    found = torch.autograd.grad(outputs[1].square().sum(), stack.parameters())
    for gradient in found:
        assert not gradient[0].any()
        assert not gradient[2].any()
    assert found[0][1].any()


def test_part_shares_parameters_and_statistics():
    stack = layers(3)
    part = stack.part(slice(1, 2))
    inputs = torch.randn(3, 4, 20)
    part.forward(inputs[1:2] + 5.0, training=True)
    torch.testing.assert_close(stack.forward(inputs)[1:2], part.forward(inputs[1:2]))
    assert stack.means[0][1].any()
    assert not stack.means[0][0].any()


@pytest.mark.parametrize("normalised", [True, False])
def test_arrays_hold_everything(normalised):
    stack = layers(2, normalised=normalised)
    inputs = torch.randn(2, 4, 20)
    stack.forward(inputs, training=True)
    again = StackedLayers.from_arrays(stack.to_arrays())
    assert torch.equal(again.forward(inputs), stack.forward(inputs))


def test_tanh_is_tanh():
    values = torch.linspace(-20, 20, 401)
    torch.testing.assert_close(tanh(values), torch.tanh(values), atol=3e-7, rtol=0)


def test_losses_are_those_of_the_text():
    stack = StackedAutoencoders.initial(2, 6, (5, 4), torch.Generator().manual_seed(0))
    rng = np.random.default_rng(0)
    signals, pressure, geodesic = rng.normal(size=(2, 6, 8)), rng.normal(size=(2, 8)), rng.random((2, 4))
    losses = latent_losses(
        stack, *(torch.tensor(values, dtype=torch.float32) for values in (signals, pressure, geodesic))
    )
    inputs = torch.tensor(signals, dtype=torch.float32)
    latent = stack.encoder.forward(inputs, training=True).detach()
    decoded = stack.decoder.forward(latent, training=True).detach().numpy()
    latent = latent.numpy()
    for model in range(2):
        apart = [np.hypot(*(latent[model, :2, i] - latent[model, :2, i + 4])) for i in range(4)]
        assert losses.distances[model].item() == pytest.approx(
            np.mean((np.array(apart) - geodesic[model]) ** 2), rel=1e-4
        )
        assert losses.pressure[model].item() == pytest.approx(
            np.mean((latent[model, 2] - pressure[model]) ** 2), rel=1e-4
        )
        assert losses.reconstruction[model].item() == pytest.approx(
            np.mean((decoded[model] - signals[model]) ** 2), rel=1e-4
        )


def test_two_samples_at_one_point_have_a_gradient():
    stack = StackedAutoencoders.initial(1, 6, (5,), torch.Generator().manual_seed(0))
    same = torch.randn(1, 6, 4).repeat(1, 1, 2)
    losses = latent_losses(stack, same, torch.zeros(1, 8), torch.ones(1, 4))
    found = torch.autograd.grad(losses.distances.sum(), stack.encoder.weights)
    assert all(gradient.isfinite().all() for gradient in found)
