"""Tactile servoing at run time: the action that brings the wanted touch (II.3.5).

    servo = TactileServo(models, units, structure=True, parameters=ServoParameters(), rate_hz=100 / 31)
    target = servo.encode(wanted_signals)
    memory = servo.start(servo.encode(signals))
    while True:
        action, memory = servo.act(servo.encode(signals), target, memory)

All seeds of a stack act at once, each on trials of its own: arrays are (S, T, ...), seeds and trials. Numbers
go in and out as numpy arrays in SI units and counts; inside, everything is in double precision.
"""

from dataclasses import dataclass

import numpy as np
import torch
from pydantic import Field, PositiveInt
from torch import Tensor

from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.tactile.latent_dynamics import (
    LatentStep,
    affine_dynamics,
    inferred_action,
    receding_horizon_action,
)
from structlearn.tactile.latent_models import LatentModels
from structlearn.tactile.latent_parameters import (
    FORWARD_OF,
    NEGATIVE_GRADIENT,
    NO_INVERSE,
    STRUCTURES,
    InverseModel,
)
from structlearn.tactile.touch_dataset import TouchUnits


class ServoParameters(Parameters):
    """Which inverse model acts, and how far it may go."""

    inverse: InverseModel = "NJ"  # LL, NG or NJ (II.3.5)
    # take the forward model that was trained with the loss of this inverse model
    trained_with_inverse: bool = True
    action_penalty: float = Field(default=0.01, gt=0)  # beta (eq. II.12), in the networks' units
    gradient_gain: float = Field(default=10.0, gt=0)  # alpha of NG (eq. II.14), in the networks' units
    # bound of |a|, in root mean squares of the demonstrated actions; longer ones are shortened and keep their
    # direction
    largest_action: float = Field(default=3.0, gt=0)
    horizon: PositiveInt = 1  # steps ahead for LL and NJ; 1 is the dissertation


@dataclass(frozen=True)
class ServoMemory:
    """The step before, which NJ linearises about, in the networks' units.

    Actions may come oftener than steps are long, W per step. A step before still lasts dt, as those that the
    model learned from: z_t-1 is the latent state dt ago, a_t-1 the mean action since.
    """

    latent: np.ndarray  # (W, S, T, 3) when the last actions were chosen, oldest first
    action: np.ndarray  # (W, S, T, K) that were chosen then


class TactileServo:
    """Controllers of all seeds of a stack, for latent spaces with or without structure.

    Args:
        models: trained models.
        units: that they see touch in.
        structure: whether the latent space has structure.
        parameters: of the controller.
        rate_hz: steps of prediction per second; the models were trained for about 3.
        actions_per_step: W.

    Raises:
        InputError: NG has no longer horizon.
    """

    def __init__(
        self,
        models: LatentModels,
        units: TouchUnits,
        structure: bool,
        parameters: ServoParameters,
        rate_hz: float,
        actions_per_step: int = 1,
    ) -> None:
        """See the class."""
        if parameters.inverse == NEGATIVE_GRADIENT and parameters.horizon > 1:
            raise InputError("servo: the negative gradient looks one step ahead, its horizon must be 1")
        count = len(models.seeds)
        first = STRUCTURES.index(structure) * count
        chosen = slice(first, first + count)
        arrays = {name: values.double() for name, values in models.to_arrays().items()}
        models = LatentModels.from_arrays(models.seeds, arrays)
        way = parameters.inverse if parameters.trained_with_inverse else NO_INVERSE
        self.seeds, self.units, self.parameters = models.seeds, units, parameters
        self._encoder = models.autoencoders.encoder.part(chosen)
        self._decoder = models.autoencoders.decoder.part(chosen)
        self._dynamics = models.dynamics(FORWARD_OF[parameters.inverse], way).part(chosen)
        self._time_step = torch.tensor([1.0 / rate_hz], dtype=torch.float64)
        self._actions_per_step = actions_per_step

    def encode(self, signals: np.ndarray) -> np.ndarray:
        """Latent states (S, T, 3) of signals (S, T, E), counts less their offset, low-passed."""
        return _array(self._encoder.forward(as_states(self.units.signals(signals))))

    def decode(self, latent: np.ndarray) -> np.ndarray:
        """Signals (S, T, E) counts of latent states (S, T, 3)."""
        return (
            _array(self._decoder.forward(as_states(latent))) * self.units.signal_scale
            + self.units.signal_mean
        )

    def start(self, latent: np.ndarray) -> ServoMemory:
        """Memory at the start, after a rest: the latent states (S, T, 3) were the same, the action was 0."""
        lasting = np.repeat(latent[None], self._actions_per_step, axis=0)
        return ServoMemory(lasting, np.zeros((*lasting.shape[:-1], len(self.units.action_scale))))

    @torch.no_grad()
    def act(
        self, latent: np.ndarray, target: np.ndarray, memory: ServoMemory
    ) -> tuple[np.ndarray, ServoMemory]:
        """The next action.

        `latent` (S, T, 3) z_t; `target` (S, T, 3) z_T; `memory`: of the step before, W actions long. Returns:
        Actions (S, T, K), m/s and rad/s in the frame of the finger, and the memory for the next step.
        """
        return self._done(self._unbounded(self._step(latent, memory), as_states(target)), latent, memory)

    def _step(self, latent: np.ndarray, memory: ServoMemory) -> LatentStep:
        before, since = memory.latent[0], memory.action.mean(axis=0)
        return LatentStep(as_states(latent), as_states(before), as_states(since), self._time_step)

    def _done(self, found: Tensor, latent: np.ndarray, memory: ServoMemory) -> tuple[np.ndarray, ServoMemory]:
        """The action (M, K, B) that was found, shortened and in SI units, and the memory after it."""
        action = _array(found)
        length = np.linalg.norm(action, axis=-1, keepdims=True)
        bounded = action * np.minimum(1.0, self.parameters.largest_action / np.maximum(length, 1e-12))
        after = ServoMemory(
            np.concatenate([memory.latent[1:], latent[None]]),
            np.concatenate([memory.action[1:], bounded[None]]),
        )
        return bounded * self.units.action_scale, after

    def _unbounded(self, step: LatentStep, target: Tensor) -> Tensor:
        chosen = self.parameters
        if chosen.horizon > 1:
            dynamics = affine_dynamics(self._dynamics, step)
            return receding_horizon_action(
                dynamics, step.latent, target, self._time_step, chosen.action_penalty, chosen.horizon
            )
        found = inferred_action(chosen.inverse, self._dynamics, step, target, chosen.action_penalty)
        return chosen.gradient_gain * found if chosen.inverse == NEGATIVE_GRADIENT else found


def as_states(values: np.ndarray) -> Tensor:
    """(S, T, D) array -> (S, D, T) tensor."""
    return torch.from_numpy(np.asarray(values, dtype=np.float64)).transpose(1, 2)


def _array(values: Tensor) -> np.ndarray:
    """The inverse of `as_states`."""
    return values.transpose(1, 2).numpy()
