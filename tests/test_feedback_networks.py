"""What holds for every feedback network: those of table IV.5, and the one of `examples/`."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from committed import committed
from feedback_skills import random_skill
from feedback_toy import toy_dataset

from dissertation.scraping.protocol.feedback_models import NETWORKS
from structlearn.core.compilation import kernel
from structlearn.core.errors import InputError
from structlearn.feedback.coupling_dataset import leave_one_out
from structlearn.feedback.coupling_model import (
    Compiled,
    CouplingModel,
    named_model,
    read_networks,
    write_networks,
)
from structlearn.feedback.runtime import Controller
from structlearn.feedback.skill import Limits, Workspace
from structlearn.feedback.skill_file import read_skill, write_skill
from structlearn.feedback.trainers import TrainingParameters, named_trainer
from structlearn.primitives import canonical

QUICK = committed(TrainingParameters, "compare_models", steps=40, evaluate_every=20, batch_size=16)
DATA = toy_dataset()
JOBS = [(DATA, fold) for fold in leave_one_out(DATA, 1, seed=0)[:2]]
OWN = {"linear_feedback": ("linear_feedback", ())}


@pytest.fixture(scope="module", params=NETWORKS | OWN)
def trained(request, example_networks):
    module, hidden = (NETWORKS | OWN)[request.param]
    return named_trainer(module)(JOBS, QUICK, hidden)


def test_each_job_has_a_network_for_each_stopping(trained):
    for one in trained:
        assert set(one.models) == set(one.steps) == {"validation", "generalization"}
        for model in one.models.values():
            assert model.inputs == DATA.deviation.shape[1]
            assert model.validation_error() == ""
            assert np.ptp(model.coupling(DATA.deviation, DATA.phase, DATA.phase_velocity)) > 0.0


def test_a_stored_network_is_the_same_bit_for_bit(trained, tmp_path):
    network = trained[0].models["validation"]
    write_networks([("turn.ry", network), ("scrape.ry", network)], tmp_path / "n.safetensors")
    for found in read_networks(tmp_path / "n.safetensors").values():
        seen = DATA.deviation, DATA.phase, DATA.phase_velocity
        np.testing.assert_array_equal(found.coupling(*seen), network.coupling(*seen))
        assert named_model(type(network).__module__.rpartition(".")[2]) is type(network) is type(found)


def test_a_skill_holds_it(trained, tmp_path):
    """By the name of its module, without the code that trained it."""
    network = trained[0].models["validation"]
    skill = random_skill(np.random.default_rng(0), {"tilt": {"rx": network}})
    corners = np.full(3, -1.0), np.full(3, 1.0)
    write_skill(replace(skill, workspace=Workspace(*corners)), tmp_path / "s.safetensors", {})
    again = read_skill(tmp_path / "s.safetensors").networks["tilt"]["rx"]
    assert type(again) is type(network)
    for name, array in network.arrays().items():
        np.testing.assert_array_equal(again.arrays()[name], array)


@kernel
def remembered(sizes, values, row, deviations, memory):
    memory[0] = values[0] * memory[0] + deviations[0]
    return row[0] * memory[0]


@dataclass(frozen=True)
class Leaky(CouplingModel):
    """What was felt, fading: a network may remember."""

    share: np.ndarray
    kernel, inputs = remembered, 6

    def time_features(self, p, u):
        return u[:, None]

    def compiled(self):
        return Compiled(np.zeros(1, dtype=np.int64), self.share, memory=1)


def test_a_movement_begins_without_memories():
    seen = np.ones((2, 3, 6)), np.array([0.9, 0.8, 0.7]), np.full(3, -1.0)
    found = Leaky(np.array([0.5])).coupling(*seen)
    np.testing.assert_array_equal(found, 2 * [[-1.0, -1.5, -1.75]])
    assert_ticks_are_the_batch(Leaky(np.array([0.9])))


def test_a_tick_is_a_sample_of_the_batch(trained):
    assert_ticks_are_the_batch(trained[0].models["validation"])


def assert_ticks_are_the_batch(network):
    bounds = Limits(largest_coupling={"rx": 1e4}, fade_s=1e-9)
    skill = random_skill(np.random.default_rng(0), {"tilt": {"rx": network}}, limits=bounds)
    controller = Controller(skill, 200.0)
    controller.start(skill.primitives[0].position.start, skill.primitives[0].orientation.start)
    rng, felt, found = np.random.default_rng(1), [], []
    while controller.primitive < 2:
        controller.tick(50.0 * rng.normal(size=6))
        if controller.primitive == 1:
            felt.append(controller.deviation.copy())
            found.append(controller.coupling[0])
    tau = canonical.time_constant(skill.primitives[1].duration)
    expected = network.coupling(np.array(felt), *canonical.phase(np.arange(len(felt)) / 200.0, tau))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_a_weight_that_is_not_finite_is_told(trained):
    network = trained[0].models["validation"]
    name = next(name for name in ("output_weights", "input_mean", "weights") if hasattr(network, name))
    broken = replace(network, **{name: np.full_like(getattr(network, name), np.nan)})
    with pytest.raises(InputError, match="network of 'tilt' for rx holds a value that is not finite"):
        random_skill(np.random.default_rng(0), {"tilt": {"rx": broken}})


def test_arrays_that_do_not_fit_together_are_never_evaluated(trained, tmp_path):
    """Compiled code does not look at bounds."""
    network = trained[0].models["validation"]
    with pytest.raises(ValueError, match="takes 6 channels, got 5"):
        network.coupling(np.zeros((3, 5)), np.full(3, 0.5), np.full(3, -1.0))
    for name, values in network.arrays().items():
        broken = network.from_arrays(network.arrays() | {name: np.asarray(values)[None]})
        write_networks([("turn", broken)], tmp_path / "n.safetensors")
        with pytest.raises(InputError, match=r"n\.safetensors: the network of 'turn' has"):
            read_networks(tmp_path / "n.safetensors")


def test_an_unknown_network_is_told_with_those_that_are_known(example_networks):
    with pytest.raises(InputError, match=r"network 'os' among autoencoded, .*linear_feedback, .*"):
        named_trainer("os")
    with pytest.raises(InputError, match=r"read_results\.py: defines 0 feedback networks"):
        named_model("read_results")
    with pytest.raises(InputError, match=r"read_results\.py: has no function `train`"):
        named_trainer("read_results")
