import dataclasses
from functools import partial

import numpy as np
import pytest
import torch
from committed import committed
from feedback_skills import random_network
from feedback_toy import toy_dataset

from structlearn.core import artefacts
from structlearn.core.errors import InputError
from structlearn.core.metrics import nmse
from structlearn.feedback import coupling_model
from structlearn.feedback import supervised_training as supervised
from structlearn.feedback.coupling_dataset import leave_one_out
from structlearn.feedback.models.pmnn import coupling_term
from structlearn.feedback.trainers import TrainingParameters, train_final
from structlearn.feedback.training.pmnn import StackedPhaseModulatedNetworks
from structlearn.networks.torch_settings import Adam, RootMeanSquarePropagation, as_tensor, seeded
from structlearn.primitives import canonical, kernels

QUICK = committed(TrainingParameters, "compare_models", steps=60, evaluate_every=20, batch_size=16)


def stacked(data, parameters=QUICK, chosen=slice(None)):
    """Folds of a dataset as a stack trains on them."""
    folds = leave_one_out(data, parameters.chunk_samples, parameters.seed)[chosen]
    inputs, targets = [], []
    for fold in folds:
        mean, spread = supervised.standardisation(data.deviation, fold)
        inputs.append((data.deviation - mean) / spread)
        targets.append(data.target / supervised.target_scale(data.target, fold))
    return supervised.StackedData(
        as_tensor(np.stack(inputs)), as_tensor(data.modulation()), as_tensor(np.stack(targets)), folds
    )


def networks(models, dropout=0.5):
    network = StackedPhaseModulatedNetworks(models, 6, (20,), 25, dropout, seeded(0))
    return supervised.Stack(network.parameters(), network.forward)


def test_a_known_coupling_is_learnt_and_exported():
    data = toy_dataset(noise=0.02, offset=0.0)
    parameters = committed(
        TrainingParameters, "compare_models", steps=800, evaluate_every=200, dropout=0.1, learning_rate=3e-3
    )
    network = train_final("pmnn", data, parameters, (40,))
    phase = data.phase, data.phase_velocity
    assert nmse(network.coupling(data.deviation, *phase), data.target) < 0.1
    assert network.phase_weights.dtype == np.float64
    assert np.abs(network.coupling(data.deviation, data.phase, 0.0 * data.phase)).max() == 0.0
    # and where the phase velocity has almost faded, the correction is still held
    end = data.phase < 0.03
    assert nmse(network.coupling(data.deviation, *phase)[end], data.target[end]) < 0.1


def test_a_model_learns_the_same_alone_and_in_a_stack():
    data = toy_dataset()
    together, alone = networks(4, dropout=0.0), networks(1, dropout=0.0)
    supervised.restore(alone, [values[2:3] for values in together.weights])
    before = supervised.choosing_errors(alone, stacked(data, chosen=slice(2, 3)))
    supervised.train_weights(together, stacked(data), QUICK)
    supervised.train_weights(alone, stacked(data, chosen=slice(2, 3)), QUICK)
    found = supervised.choosing_errors(alone, stacked(data, chosen=slice(2, 3)))
    np.testing.assert_allclose(found[0], supervised.choosing_errors(together, stacked(data))[2], rtol=1e-3)
    assert np.abs(found - before).max() > 0.01  # it did learn something


class GradientAdam(Adam):
    """Steps on a loss, like the others."""

    def step(self, loss):
        super().step(torch.autograd.grad(loss, self.parameters))


@pytest.mark.parametrize(
    ("own", "of_torch", "tolerance"),
    [
        (
            partial(RootMeanSquarePropagation, decay=supervised.DECAY),
            partial(torch.optim.RMSprop, alpha=supervised.DECAY, eps=1e-8),
            {"atol": 1e-6, "rtol": 1e-4},
        ),
        (GradientAdam, partial(torch.optim.Adam, fused=True), {"atol": 0.0, "rtol": 0.0}),
    ],
)
def test_a_step_is_that_of_torch_on_every_tensor(own, of_torch, tolerance):
    ours, theirs = networks(2), networks(2)
    optimiser, reference = (
        own(ours.weights, rate=QUICK.learning_rate),
        of_torch(theirs.weights, lr=QUICK.learning_rate),
    )
    generator = torch.Generator().manual_seed(0)
    for _ in range(5):
        inputs = torch.randn(2, 30, 6, generator=generator)
        modulation = torch.randn(2, 30, 25, generator=generator)
        optimiser.step(ours.forward(inputs, modulation, True).square().mean())
        reference.zero_grad()
        theirs.forward(inputs, modulation, True).square().mean().backward()
        reference.step()
    for one, other in zip(ours.weights, theirs.weights, strict=True):
        torch.testing.assert_close(one, other, **tolerance)


def test_training_is_deterministic_and_leaves_the_number_of_threads():
    data = toy_dataset()
    threads = torch.get_num_threads()
    first, second = (train_final("pmnn", data, QUICK, (100,)) for _ in range(2))
    other = train_final("pmnn", data, QUICK.model_copy(update={"seed": 1}), (100,))
    np.testing.assert_array_equal(first.phase_weights, second.phase_weights)
    assert not np.array_equal(first.phase_weights, other.phase_weights)
    assert torch.get_num_threads() == threads


def test_every_model_ends_with_the_weights_that_validation_chose_and_keeps_the_others(monkeypatch):
    seen, evaluate = [], supervised.choosing_errors
    monkeypatch.setattr(
        supervised, "choosing_errors", lambda *its: [seen.append(evaluate(*its)), seen[-1]][1]
    )
    parameters = QUICK.model_copy(update={"steps": 390, "learning_rate": 0.05, "dropout": 0.0})
    data, network = stacked(toy_dataset()), networks(4, dropout=0.0)
    best = supervised.train_weights(network, data, parameters)
    done = np.array([*range(20, 390, 20), 390])  # evaluated to the last
    for place, part in enumerate(supervised.CHOOSING):
        weights, steps = best[part]
        errors = np.array(seen)[..., place]  # (E, M)
        assert len(set(steps)) > 1  # models differ, or the test shows nothing
        np.testing.assert_array_equal(steps, done[errors.argmin(axis=0)])
        if part == "generalization":
            supervised.restore(network, weights)
        np.testing.assert_array_equal(supervised.choosing_errors(network, data)[:, place], errors.min(axis=0))


def test_the_error_of_a_part_is_the_normalised_mean_squared_error():
    data, network = stacked(toy_dataset()), networks(4)
    everything = torch.arange(data.inputs.shape[1]).expand(4, -1)
    found, outputs = supervised.choosing_errors(network, data), supervised.predict(network, data, everything)
    for model, fold in enumerate(data.folds):
        for place, part in enumerate(supervised.CHOOSING):
            rows = getattr(fold, part)
            expected = nmse(outputs[model, rows], data.target[model, rows].numpy())
            assert found[model, place] == pytest.approx(float(expected), rel=1e-5)


def test_steps_that_diverged_are_never_chosen(monkeypatch):
    errors = iter(np.array([[[np.nan, 0.5]], [[0.5, 0.5]], [[0.5, 0.4]]]))  # at each evaluation, (M, 2)
    monkeypatch.setattr(supervised, "choosing_errors", lambda *_: next(errors))
    best = supervised.train_weights(networks(1), stacked(toy_dataset(), chosen=slice(1)), QUICK)
    assert [best[part][1] for part in supervised.CHOOSING] == [[40], [60]]


def test_training_goes_on_from_a_given_network():
    data = toy_dataset()
    initial = train_final("pmnn", data, QUICK, (100,))
    still = QUICK.model_copy(update={"learning_rate": 1e-12})
    found = train_final("pmnn", data, still, initial=initial)
    seen = data.deviation, data.phase, data.phase_velocity
    np.testing.assert_array_equal(found.input_mean, initial.input_mean)
    np.testing.assert_allclose(found.coupling(*seen), initial.coupling(*seen), atol=1e-3)


def test_all_channels_share_one_scale_and_its_unit_does_not_matter():
    """So that the noise of a channel that feels little is not made as large as what others feel."""
    data = toy_dataset()
    (fold, *_) = leave_one_out(data, 1, 0)
    mean, spread = supervised.standardisation(data.deviation, fold)
    scaled = ((data.deviation - mean) / spread)[fold.train]
    assert np.unique(spread).size == 1
    np.testing.assert_allclose([scaled.mean(), (scaled**2).sum(axis=1).mean()], [0.0, 6.0], atol=1e-9)
    again, finer = supervised.standardisation(1000.0 * data.deviation, fold)
    np.testing.assert_allclose((again, finer), (1000.0 * mean, 1000.0 * spread))
    grouped = supervised.standardisation(data.deviation * np.repeat([1.0, 1e-3], 3), fold, (3, 3))[1]
    np.testing.assert_allclose(grouped[:3] / grouped[3:], 1e3, rtol=0.5)  # another unit, another scale
    np.testing.assert_array_equal(
        supervised.standardisation(np.full((len(data.target), 2), 7.0), fold)[1], 1.0
    )


def test_bad_input_is_named():
    data = toy_dataset()
    with pytest.raises(InputError, match="the coupling target is constant"):
        train_final("pmnn", dataclasses.replace(data, target=0.0 * data.target), QUICK)


MODELS, CHANNELS, BATCH, KERNELS = 3, 4, 50, 25
TIMES = np.linspace(0.0, 1.0, BATCH)
PHASE = canonical.phase(TIMES, canonical.TAU_PER_DURATION)  # one movement
MODULATION = kernels.features(*PHASE, KERNELS)


def exported_stack(hidden=(10,)):
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
    network = exported_stack(hidden)
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
    whole, alone = exported_stack(), exported_stack(())  # no regular hidden layer: nothing is dropped
    assert torch.equal(alone.forward(*batch(), training=True), alone.forward(*batch()))
    assert not torch.equal(whole.forward(*batch(), training=True), whole.forward(*batch()))


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
def test_kernel_and_reference_are_the_equation_node_by_node(sizes, scale):
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
        sample = deviation[index], *(values[index[1]] for values in phase)
        np.testing.assert_allclose(coupling_term(network, *sample), expected, rtol=1e-11)
        one = network.coupling(deviation[index], phase[0][index[1]], phase[1][index[1]])
        assert one.shape == ()
        np.testing.assert_allclose(one, expected, rtol=1e-11)


@pytest.mark.parametrize("description", ["a network", "[1]", "{}", '{"coupling_models": {"turn": "pmnn"}}'])
def test_foreign_files_are_named(tmp_path, description):
    artefacts.write_tensors({"layer.weights": np.ones(3)}, tmp_path / "n.safetensors", description)
    with pytest.raises(InputError, match=r"n\.safetensors: holds no feedback networks"):
        coupling_model.read_networks(tmp_path / "n.safetensors")
