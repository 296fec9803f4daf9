"""Training of phase-modulated networks, beside the same network as a plain module of torch.

Both take the same steps: initial weights, batches and RMSProp are the same, and nothing is dropped out, since
the masks would differ. Ours trains all folds as one stack; the module is trained once for each.
"""

from functools import partial

import numpy as np
import torch
from primitive_inputs import NETWORK, SEED
from timing import Case, Contender
from torch import Tensor, nn

from structlearn.feedback.coupling_dataset import CouplingDataset, Fold, leave_one_out, stream
from structlearn.feedback.supervised_training import DECAY, standardisation, target_scale
from structlearn.feedback.trainers import TrainingParameters
from structlearn.feedback.training import pmnn
from structlearn.networks.torch_settings import SMALLEST_ROOT, seeded
from structlearn.primitives import canonical

INPUTS, HIDDEN, KERNELS, _ = NETWORK
DEMONSTRATIONS, SAMPLES = 10, 200
SINGLE = 1e-2  # of single precision, after the steps
PARAMETERS = TrainingParameters(
    steps=400, batch_size=64, learning_rate=1e-3, dropout=0.0, evaluate_every=200, chunk_samples=1, seed=SEED
)


def training(folds: int) -> Case:
    """Predictions of the last network are compared."""
    dataset = _dataset()
    jobs = [(dataset, fold) for fold in leave_one_out(dataset, 1, SEED)[:folds]]

    def ours() -> np.ndarray:
        network = pmnn.train(jobs, PARAMETERS, (HIDDEN,))[-1].models["validation"]
        return network.coupling(dataset.deviation, dataset.phase, dataset.phase_velocity)

    def plain() -> np.ndarray:
        stack = pmnn.StackedPhaseModulatedNetworks(folds, INPUTS, (HIDDEN,), KERNELS, 0.0, seeded(SEED))
        return [train_module(_initial(stack, place), *job) for place, job in enumerate(jobs)][-1]

    expected = ours()

    def error(found: np.ndarray) -> float:
        return float(np.abs(found - expected).max() / np.ptp(expected))

    return Case(
        work=f"PMNN training, {folds} fold{'s' if folds > 1 else ''}, {PARAMETERS.steps} steps",
        ours=Contender(ours, error),
        peers={"torch.nn.Module, torch.optim": lambda: Contender(plain, error)},
        tolerance=SINGLE,
        note=f"the module is of this benchmark, there is no public one; batches of {PARAMETERS.batch_size}, "
        "the validation part is evaluated twice, and the best weights are kept",
    )


class Module(nn.Module):
    """The network as its equations read (eq. IV.27-IV.30)."""

    def __init__(self) -> None:
        super().__init__()
        self.hidden, self.phase = nn.Linear(INPUTS, HIDDEN), nn.Linear(HIDDEN, KERNELS)
        self.output = nn.Linear(KERNELS, 1, bias=False)
        self.register_buffer("scale", torch.tensor(pmnn.kernel_scale(KERNELS), dtype=torch.float32))

    def forward(self, deviation: Tensor, modulation: Tensor) -> Tensor:
        """Coupling terms (B,) of standardised deviations (B, D) and phase features (B, N)."""
        return self.output(modulation * self.scale * self.phase(torch.tanh(self.hidden(deviation))))[:, 0]


def train_module(module: Module, dataset: CouplingDataset, fold: Fold) -> np.ndarray:
    """Coupling terms (S,) by a module that is trained on a fold."""
    torch.set_num_threads(1)
    mean, deviation = standardisation(dataset.deviation, fold)
    scale = target_scale(dataset.target, fold)
    single = partial(torch.tensor, dtype=torch.float32)
    inputs, modulation = single((dataset.deviation - mean) / deviation), single(dataset.modulation(KERNELS))
    target = single(dataset.target / scale)
    optimiser = torch.optim.RMSprop(module.parameters(), PARAMETERS.learning_rate, DECAY, SMALLEST_ROOT)
    rng = np.random.default_rng([SEED, stream(fold.number), 1])
    best, smallest = module.state_dict(), np.inf
    for _ in range(PARAMETERS.steps // PARAMETERS.evaluate_every):
        count = PARAMETERS.evaluate_every * PARAMETERS.batch_size
        order = np.concatenate([rng.permutation(fold.train) for _ in range(-(-count // len(fold.train)))])
        for rows in torch.from_numpy(order[:count]).split(PARAMETERS.batch_size):
            optimiser.zero_grad()
            loss = nn.functional.mse_loss(module(inputs[rows], modulation[rows]), target[rows])
            loss.backward()
            optimiser.step()
        with torch.no_grad():
            found = module(inputs[fold.validation], modulation[fold.validation])
            error = float((found - target[fold.validation]).square().mean())
        if error < smallest:
            smallest, best = error, {name: values.clone() for name, values in module.state_dict().items()}
    module.load_state_dict(best)
    with torch.no_grad():
        return scale * module(inputs, modulation).double().numpy()


def _initial(stack: pmnn.StackedPhaseModulatedNetworks, place: int) -> Module:
    """A module with the weights of one network of ours."""
    module = Module()
    with torch.no_grad():
        for layer, weights, biases in zip(
            (module.hidden, module.phase), stack.layers.weights, stack.layers.biases, strict=True
        ):
            layer.weight.copy_(weights[place].T)
            layer.bias.copy_(biases[place, 0])
        module.output.weight.copy_(stack.output_weights[place].T)
    return module


def _dataset() -> CouplingDataset:
    """Corrections that follow the deviations of a few channels, at 200 Hz for a second."""
    rng = np.random.default_rng(SEED)
    times = np.linspace(0.0, 1.0, SAMPLES)
    p, u = canonical.phase(times, canonical.TAU_PER_DURATION)
    bend = np.sin(2.0 * np.pi * times)[:, None] * rng.normal(0.0, 30.0, (DEMONSTRATIONS, 1, INPUTS))
    deviation = (bend + rng.normal(0.0, 3.0, bend.shape)).reshape(-1, INPUTS)
    target = np.tanh(deviation[:, 0] / 30.0) * np.tile(-u, DEMONSTRATIONS)
    return CouplingDataset(
        deviation=deviation,
        phase=np.tile(p, DEMONSTRATIONS),
        phase_velocity=np.tile(u, DEMONSTRATIONS),
        target=target,
        setting=np.zeros(len(target)),
        demonstration=np.repeat(np.arange(DEMONSTRATIONS), SAMPLES),
        time=np.tile(times, DEMONSTRATIONS),
    )


CASES = (partial(training, 1), partial(training, DEMONSTRATIONS))
