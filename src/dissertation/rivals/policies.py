"""Policies cloned from demonstrations, without primitives: how they are trained, and what they predict."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from pydantic import Field
from torch import Tensor, nn

from dissertation.rivals.imitation_data import Episode
from dissertation.rivals.networks import HEADS, KL_WEIGHT, ActionChunking, Feedforward
from structlearn.core.params import Parameters
from structlearn.feedback.skill import TARGET_MARGIN
from structlearn.networks.torch_settings import Adam, as_tensor, one_thread

NETWORKS: dict[str, type[Feedforward] | type[ActionChunking]] = {
    "feedforward": Feedforward,
    "chunking": ActionChunking,
}
SPEED_MARGIN = TARGET_MARGIN  # as a coupling term's bound exceeds demonstrated ones
SPEED_SAMPLES = 5  # over which demonstrated speeds are means


class RivalParameters(Parameters):
    """One rival. Fields: `params.yaml`, `rival_methods`."""

    network: Literal["feedforward", "chunking"]
    width: int = Field(ge=HEADS, le=1024, multiple_of=HEADS)  # of hidden layers or tokens
    layers: int = Field(ge=1, le=8)
    every: int = Field(ge=1, le=20)  # samples of 100 Hz from one decision to the next
    chunk: int = Field(ge=1, le=200)  # decisions ahead that are predicted at each
    noise: float = Field(ge=0, le=1)  # std added to standardised poses and readings in training
    steps: int = Field(ge=1)
    batch: int = Field(ge=1)  # samples
    learning_rate: float = Field(gt=0)


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


@dataclass(frozen=True)
class Policy:
    """A trained rival."""

    parameters: RivalParameters
    network: nn.Module
    pose: Units
    task: Units
    touch: Units
    fastest: tuple[float, ...]  # m, and rad if it turns, per sample that its reference may move

    @torch.no_grad()
    def chunk(self, pose: np.ndarray, task: np.ndarray, touch: np.ndarray) -> np.ndarray:
        """Poses (H, ..., A) at the next decisions, from pose (..., A), task (..., 4) and touch (..., E)."""
        state = torch.cat([self.pose.standard(pose), self.task.standard(task)], dim=-1)
        ahead, _ = self.network(torch.atleast_2d(state), torch.atleast_2d(self.touch.standard(touch)))
        poses = ahead.numpy().astype(float) * self.pose.scale + self.pose.mean
        return np.moveaxis(poses.reshape(*state.shape[:-1], *poses.shape[1:]), -2, 0)


def train(episodes: Sequence[Episode], parameters: RivalParameters, seed: int) -> Policy:
    """Clone demonstrations; every setting counts alike, however many demonstrations it has.

    Squared errors, for the transformer absolute ones and the divergence of the style as published. Adam with
    a learning rate that falls to 0 over the second half. Same episodes, parameters and seed give the same
    weights.
    """
    own = parameters
    settings, *signals = zip(*episodes, strict=True)
    poses, tasks, touches = map(np.concatenate, signals)
    units = Units.of(poses, triples(poses)), Units.of(tasks, (3, 1)), Units.of(touches, (touches.shape[1],))
    parts = zip(units, (poses, tasks, touches), strict=True)
    pose, task, touch = (its.standard(part) for its, part in parts)
    lengths = [len(one.pose) for one in episodes]
    last = np.repeat(np.cumsum(lengths), lengths)[:, None] - 1  # (S, 1) of a sample's episode: the hand rests
    ahead = np.arange(len(last))[:, None] + own.every * np.arange(1, own.chunk + 1)
    later = torch.from_numpy(np.minimum(ahead, last))  # (S, H)
    _, places, counts = np.unique(np.repeat(settings, lengths), return_inverse=True, return_counts=True)
    chances = 1.0 / counts[places] / len(counts)
    drawn = np.random.default_rng(seed).choice(len(last), (own.steps, own.batch), p=chances)
    with one_thread(), torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        sizes = pose.shape[1] + task.shape[1], touch.shape[1]
        action = poses.shape[1]
        network = NETWORKS[own.network](sizes, action, own.width, own.layers, own.chunk).train()
        adam = Adam(list(network.parameters()), own.learning_rate)
        for step, rows in enumerate(torch.from_numpy(drawn)):
            adam.rate = own.learning_rate * min(1.0, 2.0 * (1.0 - step / own.steps))
            seen = pose[rows] + own.noise * torch.randn(own.batch, action)
            felt = touch[rows] + own.noise * torch.randn(own.batch, sizes[1])
            target = pose[later[rows]]
            found, divergence = network(torch.cat([seen, task[rows]], dim=1), felt, target)
            loss = network.error(found, target) + KL_WEIGHT * divergence
            adam.step(torch.autograd.grad(loss, adam.parameters, allow_unused=True))
    return Policy(own, network.eval(), *units, fastest(episodes))


def triples(poses: np.ndarray) -> tuple[int, ...]:
    """Sizes of the parts of poses (..., A): a position, and a rotation vector if the hand turns."""
    return (3,) * (poses.shape[-1] // 3)


def fastest(episodes: Sequence[Episode]) -> tuple[float, ...]:
    """Bounds in m, and rad if the hand turns, per sample: `SPEED_MARGIN` times the largest demonstrated."""
    steps = np.concatenate([np.diff(one.pose[::SPEED_SAMPLES], axis=0) for one in episodes]) / SPEED_SAMPLES
    parts = np.hsplit(steps, len(triples(steps)))
    return tuple(float(SPEED_MARGIN * np.linalg.norm(part, axis=1).max()) for part in parts)


class Ensemble:
    """Mean of all predictions for one moment, the oldest with most weight (Zhao et al. 2023, algorithm 2)."""

    def __init__(self, decay: float = 0.01) -> None:
        """`decay`: m of the weights exp(-m i), i = 0 the oldest; as published unless given."""
        self.decay, self.chunks = decay, list[np.ndarray]()

    def update(self, chunk: np.ndarray) -> np.ndarray:
        """Pose (..., A) for the next decision, from the newest chunk (H, ..., A) and those before."""
        self.chunks = [*self.chunks, chunk][-len(chunk) :]
        ages = range(len(self.chunks) - 1, -1, -1)
        predictions = np.stack([one[age] for one, age in zip(self.chunks, ages, strict=True)])
        weights = np.exp(-self.decay * np.arange(len(predictions)))
        mean = weights @ predictions.reshape(len(weights), -1) / weights.sum()
        return mean.reshape(chunk.shape[1:])
