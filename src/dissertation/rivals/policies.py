"""Policies cloned from demonstrations, without primitives: how they are trained, and how they act."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import torch
from pydantic import Field
from torch import Tensor, nn

from dissertation.rivals.imitation_data import Episode, Sensors
from dissertation.rivals.networks import ACTION, HEADS, KL_WEIGHT, ActionChunking, Feedforward, Recurrent
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.networks.torch_settings import Adam, as_tensor, one_thread

NETWORKS: dict[str, type[nn.Module]] = {
    "feedforward": Feedforward,
    "recurrent": Recurrent,
    "chunking": ActionChunking,
}
POSE_GROUPS, TASK_GROUPS = (3, 3), (3, 1)  # columns with one unit, and one scale


class RivalParameters(Parameters):
    """One rival. Fields: `params.yaml`, `rivals.methods`."""

    network: Literal["feedforward", "recurrent", "chunking"]
    width: int = Field(
        ge=4, le=1024
    )  # of hidden layers; of the transformer's tokens, a multiple of its heads
    layers: int = Field(ge=1, le=8)
    every: int = Field(ge=1, le=20)  # samples of 100 Hz from one decision to the next
    chunk: int = Field(ge=1, le=200)  # decisions ahead that are predicted at each
    action: Literal["absolute", "relative"]  # poses as they are, or less the pose seen
    sensors: Sensors
    noise: float = Field(ge=0, le=1)  # std added to standardised poses and readings in training
    steps: int = Field(ge=1)
    batch: int = Field(ge=1)  # samples, or runs of the recurrent network
    learning_rate: float = Field(gt=0)
    # weights exp(-ensemble i) of the predictions for one moment, i = 0 the oldest (Zhao et al., algorithm 2)
    ensemble: float = Field(ge=0)


@dataclass(frozen=True)
class Units:
    """Mean and scale of columns; one scale per group of columns with one unit."""

    mean: np.ndarray  # (D,)
    scale: np.ndarray  # (D,)

    @classmethod
    def of(cls, values: np.ndarray, groups: Sequence[int]) -> "Units":
        """Of samples (S, D); constant groups have scale 1."""
        parts = np.split(values.var(axis=0), np.cumsum(groups)[:-1])
        scales = [float(np.sqrt(part.mean())) for part in parts]
        return cls(values.mean(axis=0), np.repeat([one if one > 1e-9 else 1.0 for one in scales], groups))

    def standard(self, values: np.ndarray) -> Tensor:
        """Standardised values (..., D)."""
        return as_tensor((values - self.mean) / self.scale)


@dataclass
class Policy:
    """A trained rival; `start` before each run."""

    parameters: RivalParameters
    network: nn.Module
    state: Units  # of pose and task
    touch: Units
    action: Units
    memory: Tensor | None = field(default=None)  # of the recurrent network in this run

    def start(self) -> None:
        """Forget the last run."""
        self.memory = None
        self.network.eval()

    @torch.no_grad()
    def chunk(self, pose: np.ndarray, task: np.ndarray, touch: np.ndarray) -> np.ndarray:
        """Poses (H, 6) at the next decisions, from pose (6,), task (4,) and touch (E,)."""
        state = self.state.standard(np.concatenate([pose, task]))[None]
        readings = self.touch.standard(touch)[None]
        if isinstance(self.network, Recurrent):
            ahead, self.memory = self.network(state[None], readings[None], self.memory)
            ahead = ahead[0]
        elif isinstance(self.network, ActionChunking):
            ahead, _ = self.network(state, readings)
        else:
            ahead = self.network(state, readings)
        poses = ahead[0].numpy().astype(float) * self.action.scale + self.action.mean
        return poses + pose if self.parameters.action == "relative" else poses


class Ensemble:
    """Mean of all predictions for one moment, the oldest with most weight (Zhao et al. 2023, algorithm 2)."""

    def __init__(self, decay: float) -> None:
        """`decay`: m of the weights exp(-m i), i = 0 the oldest."""
        self.decay, self.chunks = decay, list[np.ndarray]()

    def update(self, chunk: np.ndarray) -> np.ndarray:
        """Pose (6,) for the next decision, from the newest chunk (H, 6) and those before."""
        self.chunks = [*self.chunks, chunk][-len(chunk) :]
        ages = range(len(self.chunks) - 1, -1, -1)
        predictions = np.stack([one[age] for one, age in zip(self.chunks, ages, strict=True)])
        weights = np.exp(-self.decay * np.arange(len(predictions)))
        return weights @ predictions / weights.sum()


def train(episodes: Sequence[Episode], parameters: RivalParameters, seed: int) -> Policy:
    """Clone demonstrations; every tilt counts alike, however many demonstrations it has.

    Squared errors, for the transformer absolute ones and the divergence of the style as published. Adam with
    a learning rate that falls to 0 over the second half. Same episodes, parameters and seed give the same
    weights. Raises InputError: no episodes, or runs shorter than one step.
    """
    own = parameters
    if not episodes or min(len(one.pose) for one in episodes) <= own.every:
        raise InputError("a rival needs demonstrations that are longer than the time between its decisions")
    if own.network == "chunking" and own.width % HEADS:
        raise InputError(f"the transformer's width {own.width} is not a multiple of {HEADS} heads")
    data = _Data.of(episodes, own)
    weights = _weights(episodes)
    rng = np.random.default_rng(seed)
    with one_thread(), torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        sizes = (len(data.state_units.mean), len(data.touch_units.mean))
        network = NETWORKS[own.network](sizes, own.width, own.layers, own.chunk)
        network.train()
        adam = Adam(list(network.parameters()), own.learning_rate)
        for step in range(own.steps):
            adam.rate = own.learning_rate * min(1.0, 2.0 * (1.0 - step / own.steps))
            chosen = rng.choice(len(episodes), own.batch, p=weights)
            loss = _loss(network, data, chosen, rng, own)
            adam.step(torch.autograd.grad(loss, adam.parameters, allow_unused=True))
    return Policy(own, network.eval(), data.state_units, data.touch_units, data.action_units)


@dataclass(frozen=True)
class _Data:
    """Standardised samples of all episodes, one after the other."""

    state: Tensor  # (S, 10) pose and task
    touch: Tensor  # (S, E)
    pose: Tensor  # (S, 6) over the scale of actions
    first: np.ndarray  # (N,) rows where episodes begin
    length: np.ndarray  # (N,) their numbers of samples
    state_units: Units
    touch_units: Units
    action_units: Units

    @classmethod
    def of(cls, episodes: Sequence[Episode], own: RivalParameters) -> "_Data":
        pose = np.concatenate([one.pose for one in episodes])
        state = np.hstack([pose, np.concatenate([one.task for one in episodes])])
        touch = np.concatenate([one.touch[own.sensors] for one in episodes])
        actions = np.concatenate([_actions(one.pose, own) for one in episodes])
        units = (
            Units.of(state, (*POSE_GROUPS, *TASK_GROUPS)),
            Units.of(touch, (touch.shape[1],)),
            Units.of(actions, POSE_GROUPS),
        )
        length = np.array([len(one.pose) for one in episodes])
        scaled = units[0].standard(state), units[1].standard(touch), as_tensor(pose / units[2].scale)
        return cls(*scaled, np.cumsum(length) - length, length, *units)


def _actions(pose: np.ndarray, own: RivalParameters) -> np.ndarray:
    """All actions (T H, 6) of an episode's poses (T, 6)."""
    rows = np.minimum(np.arange(len(pose))[:, None] + _steps_ahead(own), len(pose) - 1)
    return (pose[rows] - (pose[:, None] if own.action == "relative" else 0.0)).reshape(-1, ACTION)


def _steps_ahead(own: RivalParameters) -> np.ndarray:
    """Samples (H,) until the poses that are predicted."""
    return own.every * np.arange(1, own.chunk + 1)


def _weights(episodes: Sequence[Episode]) -> np.ndarray:
    """Probabilities (N,) of episodes, equal for every tilt."""
    tilts, places, counts = np.unique(
        [one.setting_deg for one in episodes], return_inverse=True, return_counts=True
    )
    return 1.0 / counts[places] / len(tilts)


def _loss(
    network: nn.Module, data: _Data, chosen: np.ndarray, rng: np.random.Generator, own: RivalParameters
) -> Tensor:
    """Loss on one sample of each chosen episode, or on all decisions of it; beyond its end the hand rests."""
    length = data.length[chosen]
    if isinstance(network, Recurrent):
        decisions = data.length.min() // own.every - 1
        rows = rng.integers(own.every, size=(own.batch, 1)) + own.every * np.arange(decisions)
        length = length[:, None]
    else:
        rows = rng.integers(length - 1)
    begin = data.first[chosen].reshape(length.shape)
    seen = torch.from_numpy(begin + rows)
    ahead = np.minimum(rows[..., None] + _steps_ahead(own), length[..., None] - 1)
    target = data.pose[torch.from_numpy(begin[..., None] + ahead)]
    if own.action == "relative":
        target = target - data.pose[seen].unsqueeze(-2)
    target = target - as_tensor(data.action_units.mean / data.action_units.scale)
    state, touch = data.state[seen], data.touch[seen]
    state[..., :ACTION] += own.noise * torch.randn_like(state[..., :ACTION])
    touch = touch + own.noise * torch.randn_like(touch)
    if isinstance(network, ActionChunking):
        found, divergence = network(state, touch, target)
        return (found - target).abs().mean() + KL_WEIGHT * divergence
    found = network(state, touch)
    return ((found[0] if isinstance(network, Recurrent) else found) - target).square().mean()
