"""Tactile servoing at run time: actions that bring about a target touch (II.3.5).

    servo = TactileServo(models, units, structure=True, parameters=ServoParameters(), rate_hz=100 / 31)
    target = servo.encode(wanted_signals)
    memory = servo.start(servo.encode(signals))
    while True:
        action, memory = servo.act(servo.encode(signals), target, memory)

All seeds of a stack act in parallel, each on its own trials: arrays are (S, T, ...), seeds and trials. Inputs
and outputs are numpy arrays in SI units and counts; internally everything is in double precision.

`TactileServo` is as published: inverse models use the value and the derivative of the forward model at one
action. The model was trained on demonstrated actions, so both are good on average over these but may be poor
elsewhere: a person who sweeps steadily shows no slow motion, and hardly shows the effects of pitch and yaw.
`AdaptiveServo` uses only what the forward model predicts well, and observations for the rest:

    rest:           a finger at rest keeps its touch, zd(z, 0) = 0, whatever the model predicts
    likely actions: beta |a|^2 becomes beta |u|^2, u = a / s, s the root mean squares of demonstrated actions
    spread:         S = d zd / d u is the slope of the model between the actions -h s and h s, one at a time
    correction:     S + E is used, with E the error of S as observed in the finger's own steps,
                    E <- E + kappa ((z_t - z_t-1) / dt - (S + E) u_t-1) u_t-1^T / (1 + |u_t-1|^2)

The last is the normalised least-mean-squares rule, a damped Broyden update of a Jacobian. It has no effect at
rest, u = 0, and for kappa <= 2 and constant slopes never increases the distance of E from the true error.
LL and NJ still solve the problem of appendix A, and NG still descends the gradient.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from pydantic import Field, PositiveInt
from torch import Tensor

from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.tactile.latent_dynamics import (
    AffineDynamics,
    ForwardDynamics,
    LatentStep,
    LocallyLinearDynamics,
    affine_dynamics,
    applied,
    inferred_action,
    receding_horizon_action,
)
from structlearn.tactile.latent_models import LatentModels
from structlearn.tactile.latent_parameters import (
    FORWARD_OF,
    LATENT,
    NEGATIVE_GRADIENT,
    NO_INVERSE,
    STRUCTURES,
    InverseModel,
)
from structlearn.tactile.touch_dataset import TouchUnits


class ServoParameters(Parameters):
    """Choice of the inverse model, and bounds on its actions."""

    inverse: InverseModel = "NJ"  # LL, NG or NJ (II.3.5)
    # use the forward model trained with the loss of this inverse model
    trained_with_inverse: bool = True
    action_penalty: float = Field(default=0.01, gt=0)  # beta (eq. II.12), in the networks' units
    gradient_gain: float = Field(default=10.0, gt=0)  # alpha of NG (eq. II.14), in the networks' units
    # bound of |a| in RMS of the demonstrated actions; longer actions are scaled down
    largest_action: float = Field(default=3.0, gt=0)
    horizon: PositiveInt = 1  # steps ahead for LL and NJ; 1 as in the dissertation


@dataclass(frozen=True)
class ServoMemory:
    """The previous step, which NJ linearises about, in network units.

    With W actions per step, a step still lasts dt, as in training: z_t-1 is the latent state dt ago, a_t-1
    the mean action since.
    """

    latent: np.ndarray  # (W, S, T, 3) at which the last actions were chosen, oldest first
    action: np.ndarray  # (W, S, T, K) these actions
    error: Tensor | None = None  # E, (S, 3, K, T), of the model's slopes; for `AdaptiveServo`


class TactileServo:
    """Controllers of all seeds of a stack, for latent spaces with or without structure.

    `units`: of the models; `rate_hz`: prediction steps per second, about 3 in training; `actions_per_step`:
    W. Raises InputError: NG does not support a horizon above 1.
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
        trained_with = parameters.inverse if parameters.trained_with_inverse else NO_INVERSE
        self.seeds, self.units, self.parameters = models.seeds, units, parameters
        self._encoder = models.autoencoders.encoder.part(chosen)
        self._decoder = models.autoencoders.decoder.part(chosen)
        self._dynamics = models.dynamics(FORWARD_OF[parameters.inverse], trained_with).part(chosen)
        self._time_step = torch.tensor([1.0 / rate_hz], dtype=torch.float64)
        self._actions_per_step = actions_per_step

    def encode(self, signals: np.ndarray) -> np.ndarray:
        """Latent states (S, T, 3) of signals (S, T, E), low-passed counts minus their offset."""
        return _array(self._encoder.forward(as_states(self.units.signals(signals))))

    def decode(self, latent: np.ndarray) -> np.ndarray:
        """Signals (S, T, E) in counts of latent states (S, T, 3)."""
        decoded = _array(self._decoder.forward(as_states(latent)))
        return decoded * self.units.signal_scale + self.units.signal_mean

    def start(self, latent: np.ndarray) -> ServoMemory:
        """Memory at the start, after a rest: equal latent states (S, T, 3) and zero actions so far."""
        lasting = np.repeat(latent[None], self._actions_per_step, axis=0)
        return ServoMemory(lasting, np.zeros((*lasting.shape[:-1], len(self.units.action_scale))))

    @torch.no_grad()
    def act(
        self, latent: np.ndarray, target: np.ndarray, memory: ServoMemory
    ) -> tuple[np.ndarray, ServoMemory]:
        """Actions (S, T, K) in m/s and rad/s, finger frame, and the memory for the next step.

        `latent` z_t, `target` z_T: (S, T, 3); `memory`: from the previous step.
        """
        chosen, step, goal = self.parameters, self._step(latent, memory), as_states(target)
        if chosen.horizon > 1:
            action = self._ahead(affine_dynamics(self._dynamics, step), step, goal)
        else:
            action = inferred_action(chosen.inverse, self._dynamics, step, goal, chosen.action_penalty)
            action = chosen.gradient_gain * action if chosen.inverse == NEGATIVE_GRADIENT else action
        return self._done(action, latent, memory)

    def _step(self, latent: np.ndarray, memory: ServoMemory) -> LatentStep:
        before, since = memory.latent[0], memory.action.mean(axis=0)
        return LatentStep(as_states(latent), as_states(before), as_states(since), self._time_step)

    def _done(
        self, chosen: Tensor, latent: np.ndarray, memory: ServoMemory
    ) -> tuple[np.ndarray, ServoMemory]:
        """A found action (M, K, B), bounded and in SI units, and the updated memory."""
        action = _array(chosen)
        length = np.linalg.norm(action, axis=-1, keepdims=True)
        bounded = action * np.minimum(1.0, self.parameters.largest_action / np.maximum(length, 1e-12))
        after = replace(
            memory,
            latent=np.concatenate([memory.latent[1:], latent[None]]),
            action=np.concatenate([memory.action[1:], bounded[None]]),
        )
        return bounded * self.units.action_scale, after

    def _ahead(self, dynamics: AffineDynamics, step: LatentStep, target: Tensor) -> Tensor:
        chosen = self.parameters
        return receding_horizon_action(
            dynamics, step.latent, target, self._time_step, chosen.action_penalty, chosen.horizon
        )


@dataclass(frozen=True)
class ModelTrust:
    """Degree of trust in the forward model."""

    by_likelihood: bool  # scale the penalty by the likelihood of actions; False: as published
    spread: float  # h, half the distance over which slopes are taken, in s; 0: derivatives at rest
    correction: float  # kappa; 0: the model is never corrected


class AdaptiveServo(TactileServo):
    """Controllers that correct their model online; NG takes the best step along the slope's gradient."""

    def __init__(
        self,
        models: LatentModels,
        units: TouchUnits,
        structure: bool,
        parameters: ServoParameters,
        rate_hz: float,
        actions_per_step: int,
        trust: ModelTrust,
    ) -> None:
        """See the class."""
        super().__init__(models, units, structure, parameters, rate_hz, actions_per_step)
        self.trust = trust
        likely = units.likely_action / units.action_scale
        likely = likely if trust.by_likelihood else np.ones_like(likely)
        self._likely = torch.from_numpy(likely)[:, None]  # (K, 1)

    def start(self, latent: np.ndarray) -> ServoMemory:
        """As `TactileServo.start`, with zero model error."""
        seeds, trials = latent.shape[:2]
        unknown = torch.zeros(seeds, LATENT, len(self._likely), trials, dtype=torch.float64)
        return replace(super().start(latent), error=unknown)

    @torch.no_grad()
    def act(
        self, latent: np.ndarray, target: np.ndarray, memory: ServoMemory
    ) -> tuple[np.ndarray, ServoMemory]:
        """As `TactileServo.act`."""
        assert memory.error is not None
        step = self._step(latent, memory)
        slope = action_slope(self._dynamics, step.latent, self._likely, self.trust.spread)
        slope = slope * self._likely.T[..., None]
        error = corrected(memory.error, slope, step, self._likely, self.trust.correction)
        action = self._towards(as_states(target), step, slope + error)
        return self._done(action * self._likely, latent, replace(memory, error=error))

    def _towards(self, target: Tensor, step: LatentStep, slope: Tensor) -> Tensor:
        """Scaled actions u (M, K, B) that lead to a target."""
        if self.parameters.inverse == NEGATIVE_GRADIENT:
            missing = (target - step.latent) / step.time_step
            return steepest_action(slope, missing, self.parameters.action_penalty / step.time_step**2)
        unmoved = slope.new_zeros(*slope.shape[:2], LATENT, slope.shape[-1])
        return self._ahead(AffineDynamics(unmoved, slope, torch.zeros_like(target)), step, target)


def corrected(error: Tensor, slope: Tensor, step: LatentStep, likely: Tensor, rate: float) -> Tensor:
    """Updated error E (M, 3, K, B) after the last step, from `error` and the model's `slope` S, both by u.

    `likely` (K, 1): scales s of likely actions; `rate`: kappa.
    """
    action = step.previous_action / likely
    seen = (step.latent - step.previous_latent) / step.time_step
    missed = (seen - applied(slope + error, action)) / (1.0 + action.square().sum(dim=1, keepdim=True))
    return error + rate * missed[:, :, None] * action[:, None]


def action_slope(dynamics: ForwardDynamics, latent: Tensor, likely: Tensor, spread: float) -> Tensor:
    """Slopes (M, 3, K, B) of the latent rate by scaled actions, at latent states (M, 3, B).

    `likely` (K, 1): scales s of likely actions; `spread`: h, half the distance over which slopes are taken,
    in these scales; 0: derivatives at rest.
    """
    rest = latent.new_zeros(latent.shape[0], dynamics.actions, latent.shape[-1])
    if isinstance(dynamics, LocallyLinearDynamics):
        return dynamics.affine(latent).action  # independent of the action
    if spread == 0:
        return dynamics.jacobians(latent, rest)[1]
    slopes = []
    for component in range(dynamics.actions):
        reach = spread * float(likely[component])
        action = rest.clone()
        action[:, component] = reach
        slopes.append((dynamics.rate(latent, action) - dynamics.rate(latent, -action)) / (2 * reach))
    return torch.stack(slopes, dim=2)


def steepest_action(slope: Tensor, missing: Tensor, ridge: Tensor) -> Tensor:
    """Minimum (M, K, B) of |missing - slope a|^2 + ridge |a|^2 along the gradient at rest.

    `slope` (M, 3, K, B); `missing` (M, 3, B) wanted rate; `ridge` (1,) or (M, 1, B) >= 0.
    """
    downhill = applied(slope.transpose(1, 2), missing)
    squared = downhill.square().sum(dim=1, keepdim=True)
    curvature = applied(slope, downhill).square().sum(dim=1, keepdim=True) + ridge * squared
    return downhill * squared / curvature.clamp(min=torch.finfo(slope.dtype).tiny)


def as_states(values: np.ndarray) -> Tensor:
    """(S, T, D) array -> (S, D, T) tensor."""
    return torch.from_numpy(np.asarray(values, dtype=np.float64)).transpose(1, 2)


def _array(values: Tensor) -> np.ndarray:
    """The inverse of `as_states`."""
    return values.transpose(1, 2).numpy()
