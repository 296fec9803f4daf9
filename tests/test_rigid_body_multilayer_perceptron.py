import torch
from torch import nn

from structlearn.networks.torch_settings import seeded
from structlearn.rigid_body.multilayer_perceptron import StackedLayers, StackedPerceptrons


def test_a_stack_is_so_many_ordinary_networks():
    stack = StackedPerceptrons(2, (5, 3), [seeded(0), seeded(1)]).double()
    states = torch.randn(3, 2, 7, dtype=torch.float64, generator=seeded(2))
    torques = stack(*states)
    for model in range(2):
        layers = []
        for weights, biases in stack.network.layers():
            linear = nn.Linear(weights.shape[2], weights.shape[1], dtype=torch.float64)
            linear.weight.data, linear.bias.data = weights[model].detach(), biases[model, :, 0].detach()
            layers += [linear, nn.Tanh()]
        network = nn.Sequential(*layers[:-1])
        torch.testing.assert_close(
            torques[model], network(torch.cat(list(states)).mT).mT, rtol=1e-9, atol=1e-12
        )


def test_weights_start_within_one_over_the_root_of_the_inputs():
    layers = StackedLayers((16, 40, 3), [seeded(0)])
    for (weights, biases), inputs in zip(layers.layers(), (16, 40), strict=True):
        values = torch.cat([weights.flatten(), biases.flatten()]).detach()
        assert 0.9 / inputs**0.5 < values.abs().max() <= 1.0 / inputs**0.5


def test_a_standardised_network_that_gives_zero_predicts_the_mean():
    stack = StackedPerceptrons(2, (4,), [seeded(0)])
    states = torch.randn(3, 2, 50, generator=seeded(1)) * 3.0 + 2.0
    torque = torch.randn(2, 50, generator=seeded(2)) * torch.tensor([[100.0], [0.0]]) + 5.0
    stack.standardise(list(states), torque)
    with torch.no_grad():
        for values in stack.parameters():
            values.zero_()
    torch.testing.assert_close(stack(*states)[0], torque.mean(dim=1, keepdim=True).expand(2, 50))
    assert stack.output_scale[1] == 1.0  # a constant torque
