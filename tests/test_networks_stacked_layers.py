import pytest
import torch
from torch import nn

from structlearn.networks.stacked_layers import Dropout, RowLayers, StackedLayers, tanh_of_half
from structlearn.networks.torch_settings import seeded

SIZES = (4, 7, 5, 2)
KINDS = pytest.mark.parametrize(
    ("kind", "normalised"), [(StackedLayers, True), (StackedLayers, False), (RowLayers, False)]
)


def stack(kind=StackedLayers, models=3, normalised=False):
    layers = kind.initial(models, SIZES, seeded(0), normalised)
    for values in (*layers.scales, *layers.biases):
        values.data.uniform_(0.5, 1.5, generator=seeded(1))
    return layers


def samples(layers, count=50):
    inputs = torch.randn(layers.models, SIZES[0], count, generator=seeded(2))
    return inputs.mT if layers.rows else inputs


def reference(layers, model):
    """One network of a stack as torch's own modules, a sample a row."""
    modules = []
    for place, (weights, biases) in enumerate(layers.layers_of(model)):
        last, normalised = place == len(layers.weights) - 1, len(layers.scales) > 0
        linear = nn.Linear(*weights.shape[::-1], bias=last or not normalised)
        linear.weight.data = torch.tensor(weights, dtype=torch.float32)
        shift = torch.tensor(biases, dtype=torch.float32)
        modules.append(linear)
        if linear.bias is not None:
            linear.bias.data = shift
        else:
            modules.append(nn.BatchNorm1d(len(biases)))
            modules[-1].weight.data, modules[-1].bias.data = layers.scales[place][model].detach(), shift
        if not last:
            modules.append(nn.Tanh())
    return nn.Sequential(*modules)


@KINDS
def test_a_stack_is_many_of_torchs_networks_in_training_and_after_it(kind, normalised):
    layers = stack(kind, normalised=normalised)
    inputs = samples(layers)
    theirs = [reference(layers, model) for model in range(3)]
    for training in (True, True, False):
        ours = layers.forward(inputs, training)
        for model, network in enumerate(theirs):
            expected = network.train(training)(inputs[model] if layers.rows else inputs[model].T)
            torch.testing.assert_close(
                ours[model], expected if layers.rows else expected.T, atol=1e-5, rtol=1e-4
            )


@KINDS
def test_gradients_of_models_do_not_mix(kind, normalised):
    layers = stack(kind, normalised=normalised)
    outputs = layers.forward(samples(layers), training=True, dropout=Dropout(0.5, seeded(3)))
    found = torch.autograd.grad(outputs[1].square().sum(), layers.parameters())
    for gradient in found:
        assert not gradient[[0, 2]].any()
    assert found[0][1].any()


def test_part_shares_parameters_and_statistics():
    layers = stack(normalised=True)
    part, inputs = layers.part(slice(1, 2)), samples(layers)
    part.forward(inputs[1:2] + 5.0, training=True)
    torch.testing.assert_close(layers.forward(inputs)[1:2], part.forward(inputs[1:2]))
    assert layers.means[0][1].any()
    assert not layers.means[0][0].any()


@KINDS
def test_arrays_hold_everything(kind, normalised):
    layers = stack(kind, normalised=normalised)
    inputs = samples(layers)
    layers.forward(inputs, training=True)
    arrays = {"other.weights.0": inputs} | layers.to_arrays("own.")
    assert torch.equal(kind.from_arrays(arrays, "own.").forward(inputs), layers.forward(inputs))
    with pytest.raises(KeyError, match=r"foreign\.weights"):
        kind.from_arrays(arrays, "foreign.")


@pytest.mark.parametrize("kind", [StackedLayers, RowLayers])
def test_a_network_takes_over_the_layers_of_another(kind):
    layers, other = stack(kind), kind.uniform(SIZES, [seeded(5), seeded(6)]) if not kind.rows else stack(kind)
    layers.set_layers_of(2, other.layers_of(0))
    inputs = samples(layers)
    torch.testing.assert_close(layers.forward(inputs)[2], other.forward(inputs[[2, 2, 2][: other.models]])[0])


def test_uniform_weights_start_within_one_over_the_root_of_the_inputs_and_alone_as_in_a_stack():
    layers = StackedLayers.uniform((16, 40, 3), [seeded(0), seeded(1)])
    for weights, biases, inputs in zip(layers.weights, layers.biases, (16, 40), strict=True):
        values = torch.cat([weights.flatten(), biases.flatten()]).detach()
        assert 0.9 / inputs**0.5 < values.abs().max() <= 1.0 / inputs**0.5
    alone = StackedLayers.uniform((16, 40, 3), [seeded(1)])
    assert torch.equal(alone.weights[1][0], layers.weights[1][1])
    assert not torch.equal(layers.weights[1][0], layers.weights[1][1])


def test_dropout_keeps_the_mean_and_is_for_training_alone():
    layers = RowLayers.initial(2, (4, 200, 1), seeded(0))
    inputs, dropout = torch.randn(2, 50, 4, generator=seeded(1)), Dropout(0.5, seeded(2))
    (expected,) = layers.activations(inputs, dropout=dropout)
    found = torch.stack([layers.activations(inputs, True, dropout)[0] for _ in range(400)])
    torch.testing.assert_close(found.mean(dim=0), expected, atol=0.25, rtol=0.0)
    assert torch.equal(layers.activations(inputs)[0], expected)
    dropped = found[0] == 0.0
    assert torch.equal(dropped[0], dropped[1])  # one mask for all models
    assert abs(float(dropped.float().mean()) - 0.5) < 0.02


def test_tanh_is_tanh():
    values = torch.linspace(-20, 20, 401)
    torch.testing.assert_close(tanh_of_half(2.0 * values), torch.tanh(values), atol=3e-7, rtol=0)
