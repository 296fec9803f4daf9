"""Training, evaluation, files and runtime of latent spaces of touch, on a toy finger."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from committed import committed
from tactile_toy import toy_dataset, toy_geodesics

from structlearn.core import metrics
from structlearn.core.artefacts import write_tensors
from structlearn.core.errors import InputError
from structlearn.networks.torch_settings import seeded
from structlearn.tactile import latent_training
from structlearn.tactile.geodesics import Geodesics
from structlearn.tactile.latent_comparison import decoded_errors, direction_errors, learn_latent_spaces
from structlearn.tactile.latent_models import LatentModels, read_latent_models, write_latent_models
from structlearn.tactile.latent_parameters import (
    FORWARD_OF,
    JACOBIAN,
    NO_INVERSE,
    NONLINEAR,
    LatentParameters,
    LatentTrainingParameters,
)
from structlearn.tactile.servo_controller import ServoMemory, ServoParameters, TactileServo
from structlearn.tactile.touch_dataset import TEST, TRAIN, chains, touch_units

QUICK = committed(
    LatentTrainingParameters, "train_latent.training", steps=250, evaluate_every=125, batch_size=32
)
FEW = {"seeds": 2, "stacks": 1, "starts": 1, "pair_pool": 5000, "evaluation_pairs": 500, "longest_chain": 3}
SMALL = committed(LatentParameters, "train_latent", training=QUICK, **FEW)


@pytest.fixture(scope="module")
def touch():
    dataset = toy_dataset()
    return dataset, toy_geodesics(dataset)


@pytest.fixture(scope="module")
def touches(touch):
    dataset, geodesics = touch
    training = chains(dataset, latent_training.CHAIN_STEPS, split=TRAIN)
    units = touch_units(dataset, training, 0.01)
    pairs = latent_training.draw_pairs(dataset.split, geodesics, TRAIN, 5000, np.random.default_rng(0))
    return latent_training.latent_data(dataset, pairs, training, units)


@pytest.fixture(scope="module")
def comparison(touch):
    return learn_latent_spaces(*touch, SMALL)


def models(seeds=(0, 1), seed=0):
    return LatentModels.initial(seeds, 19, SMALL.networks, seeded(seed))


@pytest.mark.parametrize(
    ("part", "message"),
    [
        (TRAIN, "a chain of 3 steps needs a contact that stays pressed for 0.87 s; the train split has none"),
        (TEST, "a chain of 4 steps needs a contact that stays pressed for 1.24 s; the test split has none"),
    ],
)
def test_contacts_that_are_too_short_for_chains_are_refused(touch, part, message):
    dataset, geodesics = touch
    pressed = (dataset.split != part) | (dataset.time < 0.6)  # s, in every contact
    short = replace(dataset, pressed=pressed)
    with pytest.raises(InputError, match=message):
        learn_latent_spaces(short, geodesics, SMALL.model_copy(update={"longest_chain": 4}))


def test_pairs_share_bin_and_split(touch):
    dataset, geodesics = touch
    pairs = latent_training.draw_pairs(dataset.split, geodesics, TEST, 402, np.random.default_rng(0))
    assert len(pairs.first) == 402
    assert (dataset.split[[pairs.first, pairs.second]] == TEST).all()
    for first, second, distance in zip(pairs.first, pairs.second, pairs.distance, strict=True):
        place, row = np.argwhere(geodesics.rows == first)[0]
        column = np.flatnonzero(geodesics.rows[place] == second)[0]
        assert distance == geodesics.distance[place, row, column]


def test_what_cannot_be_learned_or_controlled_is_named(touch, comparison):
    dataset, geodesics = touch
    signals = dataset.signals.copy()
    signals[:, 4] = 7.0
    with pytest.raises(InputError, match="electrode 5 has the same value in all samples"):
        touch_units(replace(dataset, signals=signals), chains(dataset, 3, split=TRAIN), 0.01)
    with pytest.raises(InputError, match="its horizon must be 1"):
        TactileServo(comparison.models, comparison.units, True, ServoParameters(inverse="NG", horizon=2), 3.0)
    rows = np.flatnonzero(dataset.split == TRAIN)[:10][None]
    lacking = Geodesics(rows, geodesics.distance[:1, :10, :10])
    with pytest.raises(InputError, match="a bin has fewer than two samples of split 2"):
        latent_training.draw_pairs(dataset.split, lacking, TEST, 10, np.random.default_rng(0))


def test_the_dynamics_do_not_change_the_encoders(touches):
    stack = models()
    drawn = torch.zeros(2, 8, dtype=torch.long)
    means = stack.autoencoders.encoder.means[0].clone()
    loss = latent_training.dynamics_loss(stack, touches, drawn, QUICK)
    spaces, dynamics = stack.autoencoders.parameters(), stack.dynamics_parameters()
    found = torch.autograd.grad(loss, [*spaces, *dynamics], allow_unused=True)
    assert all(gradient is None for gradient in found[: len(spaces)])
    assert all(gradient is not None for gradient in found[len(spaces) :])
    assert torch.equal(means, stack.autoencoders.encoder.means[0])


def test_without_structure_map_and_pressure_are_free(touches):
    stack = models(seeds=(0,))
    drawn = torch.arange(8)[None]
    encoder = stack.autoencoders.encoder.weights[0]

    def gradient(**changes):
        weights = QUICK.weights.model_copy(update=changes)
        loss = latent_training.autoencoder_losses(
            stack, touches, drawn, QUICK.model_copy(update={"weights": weights})
        ).sum()
        return torch.autograd.grad(loss, encoder)[0]

    with_it, without_it = gradient() - gradient(distances=0.0, pressure=0.0)
    assert with_it.abs().max() > 1e-3
    assert without_it.abs().max() < 1e-6


def test_direction_loss_is_that_of_the_text():
    rng = np.random.default_rng(0)
    found, action = rng.normal(size=(2, 2, 6, 7))
    scaled = found / np.linalg.norm(found, axis=1, keepdims=True)
    wanted = np.square(scaled * np.linalg.norm(action, axis=1, keepdims=True) - action).sum(axis=1)
    loss = latent_training.direction_loss(torch.tensor(found), torch.tensor(action))
    assert loss.item() == pytest.approx(wanted.mean(axis=1).sum())
    assert latent_training.direction_loss(torch.tensor(3.0 * action), torch.tensor(action)).item() < 1e-9


def test_structure_gives_a_map_of_the_skin(comparison):
    test = comparison.tables["latent"].query("split == 'test'").groupby("structure").mean(numeric_only=True)
    assert test.loc[True, "distances"] < 0.15 < test.loc[False, "distances"]
    assert test.loc[True, "pressure"] < 0.1
    assert test["reconstruction"].max() < 0.35
    assert set(comparison.tables["latent"]["seed"]) == {0, 1}


def test_dynamics_beat_standing_still_and_their_loss_turns_the_inverse_right(comparison):
    table = comparison.tables["forward"]
    np.testing.assert_allclose(table["nmse"], (2 * table["plane"] + table["third"]) / 3, rtol=1e-5)
    forward = table.query("structure and steps == 1")
    error = forward.groupby(["forward", "trained_with"])["nmse"].mean()
    assert error[NONLINEAR, NO_INVERSE] < error["unchanged", NO_INVERSE]
    asked = comparison.tables["directions"].query("structure and comparison == 'encoder'")
    distance = asked.groupby(["inverse", "trained_with"])["distance"].mean()
    assert distance[JACOBIAN, JACOBIAN] < distance[JACOBIAN, NO_INVERSE]


def test_errors_are_normalised_as_everywhere(comparison, touch):
    dataset, _ = touch
    stack, units = comparison.models, comparison.units
    servo = TactileServo(stack, units, True, ServoParameters(), 3.0)
    rows = dataset.split == TEST
    signals = dataset.signals[rows]
    decoded = servo.decode(servo.encode(np.tile(signals, (2, 1, 1))))
    found = comparison.tables["latent"].query("structure and split == 'test'").set_index("seed")
    for seed in range(2):
        expected = metrics.nmse(decoded[seed], signals).mean()
        assert found.loc[seed, "reconstruction"] == pytest.approx(expected, rel=1e-3)


def test_the_better_start_is_trained(touches):
    """Per model, by its own loss; where the first draw is spoiled, the second is taken whole."""
    training = QUICK.model_copy(update={"steps": 5})
    alone, good = models((0, 1), seed=1), models((0, 1), seed=1)
    latent_training.best_start([alone], touches, training, 5)
    spoiled = models((0, 1), seed=2)
    kept = {name: values.clone() for name, values in spoiled.to_arrays().items()}
    with torch.no_grad():
        spoiled.autoencoders.decoder.weights[-1][1] *= 1e3  # of the second seed's structured model
    found = latent_training.best_start([spoiled, good], touches, training, 5)
    assert found is spoiled
    for name, values in found.to_arrays().items():
        if name.startswith(("encoder.", "decoder.")):
            torch.testing.assert_close(values[1], alone.to_arrays()[name][1])
        else:
            torch.testing.assert_close(values, kept[name])


def test_a_joined_stack_has_every_model(touches):
    stacks = [models((0, 1)), models((2,))]
    joined = LatentModels.joined(stacks)
    assert joined.seeds == (0, 1, 2)
    assert len(joined) == 6
    inputs = touches.signals[:10].T
    whole = joined.autoencoders.encoder.forward(inputs.expand(6, -1, -1))
    part = stacks[0].autoencoders.encoder.forward(inputs.expand(4, -1, -1))
    torch.testing.assert_close(whole[[0, 1, 3, 4]], part)  # structure first, then seeds
    latent, action = torch.randn(6, 3, 5), torch.randn(6, 6, 5)
    rate = joined.dynamics(NONLINEAR, JACOBIAN).rate(latent, action)
    own = stacks[1].dynamics(NONLINEAR, JACOBIAN).rate(latent[[2, 5]], action[[2, 5]])
    torch.testing.assert_close(rate[[2, 5]], own)


def test_files_keep_models_and_units(tmp_path, comparison):
    path = tmp_path / "models.safetensors"
    write_latent_models(comparison.models, comparison.units, path)
    stack, units = read_latent_models(path)
    assert stack.seeds == (0, 1)
    for name, values in comparison.models.to_arrays().items():
        assert torch.equal(stack.to_arrays()[name], values), name
    np.testing.assert_array_equal(units.action_scale, comparison.units.action_scale)
    write_tensors({"x": np.zeros(3)}, path, "something else")
    with pytest.raises(InputError, match="holds no latent spaces of touch"):
        read_latent_models(path)


@pytest.mark.parametrize("chosen", [{"inverse": "LL"}, {"inverse": "NG"}, {"inverse": "NJ"}, {"horizon": 4}])
def test_controllers_move_the_touch_towards_the_target_in_their_own_model(comparison, touch, chosen):
    dataset, _ = touch
    servo = TactileServo(comparison.models, comparison.units, True, ServoParameters(**chosen), 100 / 31)
    rng = np.random.default_rng(0)
    samples = dataset.signals[rng.permutation(np.flatnonzero(dataset.split == TEST))[:80]]
    start, target = (servo.encode(part) for part in samples.reshape(2, 2, 20, 19))
    action, memory = servo.act(start, target, servo.start(start))
    assert action.shape == (2, 20, 6)
    np.testing.assert_array_equal(memory.latent, start[None])
    bound = np.linalg.norm(action / comparison.units.action_scale, axis=-1)
    assert bound.max() <= ServoParameters().largest_action * (1 + 1e-9)
    np.testing.assert_allclose(memory.action[0], action / comparison.units.action_scale)
    inverse = ServoParameters(**chosen).inverse
    dynamics = comparison.models.dynamics(FORWARD_OF[inverse], inverse).part(slice(0, 2))
    latent, goal = (torch.tensor(values, dtype=torch.float32).mT for values in (start, target))
    done = torch.tensor(memory.action[0], dtype=torch.float32).mT
    left, idle = (
        (goal - latent - dynamics.rate(latent, which) * 0.31).norm(dim=1).mean()
        for which in (done, torch.zeros_like(done))
    )
    assert left < idle


def test_with_actions_oftener_than_steps_the_step_before_still_lasts_a_step(comparison, touch):
    """NJ with two actions per step chooses what it would with one whose action is the mean of both."""
    dataset, _ = touch
    often, once = (
        TactileServo(comparison.models, comparison.units, True, ServoParameters(), 100 / 31, count)
        for count in (2, 1)
    )
    latents = often.encode(dataset.signals[:160].reshape(2, 80, 19)).reshape(2, 4, 20, 3)
    first, between, now, target = latents.swapaxes(0, 1)
    memory = often.start(first)
    actions = []
    for latent in (first, between):
        action, memory = often.act(latent, target, memory)
        actions.append(action / comparison.units.action_scale)
    found, _ = often.act(now, target, memory)
    mean = ServoMemory(first[None], np.mean(actions, axis=0)[None])
    np.testing.assert_allclose(found, once.act(now, target, mean)[0], rtol=1e-9)


def test_predictions_are_held_against_the_touch_that_followed(comparison, touches, touch):
    """Of the prediction that nothing moves, electrodes and pressure follow from the first touch alone."""
    dataset, _ = touch
    servo = TactileServo(comparison.models, comparison.units, True, ServoParameters(), 3.0)
    rows = touches.chains[:200]
    chain = replace(touches, chains=rows, actions=touches.actions[:200], time_step=touches.time_step[:200])
    table = decoded_errors(comparison.models, chain, comparison.units)
    found = table.query("structure and seed == 1 and forward == 'unchanged' and steps == 2").iloc[0]
    first, then = (dataset.signals[rows[:, step]] for step in (0, 2))
    decoded = servo.decode(servo.encode(np.tile(first, (2, 1, 1))))[1]
    assert found["electrodes"] == pytest.approx(metrics.nmse(decoded, then).mean(), rel=1e-3)
    pressure = metrics.nmse(-decoded.mean(axis=1), -then.mean(axis=1))
    assert found["pressure"] == pytest.approx(float(pressure), rel=1e-3)


def test_directions_count_by_the_size_of_the_true_action(comparison, touches):
    """Chains whose true action is nothing do not count, however large the action before it was."""
    keep = torch.arange(200) % 2 == 0
    actions = touches.actions[:200].clone()
    actions[~keep, 1] = 0.0
    actions[~keep, 0] *= 50.0
    rows, time_step = touches.chains[:200], touches.time_step[:200]
    chain = replace(touches, chains=rows, actions=actions, time_step=time_step)
    alone = replace(touches, chains=rows[keep], actions=actions[keep], time_step=time_step[keep])
    found, expected = (direction_errors(comparison.models, one, 0.1) for one in (chain, alone))
    np.testing.assert_allclose(found.pop("distance"), expected.pop("distance"), rtol=1e-4, atol=1e-6)
    assert found.equals(expected)


def test_a_set_has_the_units_of_its_training_samples(touch):
    samples, geodesics = touch
    units = latent_training.own_units(samples, geodesics)
    rows = samples.split == TRAIN
    seen = units.signals(samples.signals[rows].astype(float))
    np.testing.assert_allclose(seen.mean(axis=0), 0.0, atol=1e-4)
    np.testing.assert_allclose(seen.std(axis=0), 1.0, atol=1e-4)
    distances = geodesics.distance.astype(float) / units.length
    assert np.mean(distances**2) == pytest.approx(1.0)
