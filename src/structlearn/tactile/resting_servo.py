"""Tactile servoing with what the forward model knows well, and with what is seen of the rest.

The inverse models of the text ask the forward model for its value and its derivative at one action. It was
trained on demonstrated actions, so both are good on average over these and may be anything in between: a
person who sweeps steadily shows no slow moves, and hardly shows how pitch and yaw act. Hence here

    rest:           a finger at rest keeps its touch, zd(z, 0) = 0, whatever the model says of it
    likely actions: beta |a|^2 becomes beta |u|^2, u = a / s, s the root mean squares of demonstrated actions
    spread:         S = d zd / d u is the slope of the model between the actions -h s and h s, one at a time
    correction:     S + E acts, where E is what the finger's own steps say that S is wrong by,
                    E <- E + kappa ((z_t - z_t-1) / dt - (S + E) u_t-1) u_t-1^T / (1 + |u_t-1|^2)

The last is the normalised least-mean-squares rule, or Broyden's update of a Jacobian, damped. It says nothing
at rest, u = 0, and never takes E further from the true error for kappa <= 2 and slopes that stay the same.
The inverse models stay what they are: LL and NJ solve appendix A's problem, NG goes down the gradient.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from structlearn.tactile.latent_dynamics import (
    AffineDynamics,
    ForwardDynamics,
    LatentStep,
    LocallyLinearDynamics,
    applied,
    receding_horizon_action,
)
from structlearn.tactile.latent_models import LatentModels
from structlearn.tactile.latent_parameters import LATENT, NEGATIVE_GRADIENT
from structlearn.tactile.servo_controller import ServoMemory, ServoParameters, TactileServo, as_states
from structlearn.tactile.touch_dataset import TouchUnits


@dataclass(frozen=True)
class Caution:
    """How far the forward model is trusted."""

    by_likelihood: bool  # whether actions are measured by how likely they are; else all alike, as in the text
    spread: float  # h, half the distance over which slopes are taken, in s; 0: derivatives at rest
    correction: float  # kappa; 0: the model is never corrected


@dataclass(frozen=True)
class RestingMemory:
    """What a finger remembers of its own steps."""

    before: ServoMemory  # the last step
    error: Tensor  # E, (S, 3, K, T), by which the model's slopes are wrong


class RestingServo(TactileServo):
    """Controllers as `TactileServo`, with a memory of their own.

    Args:
        models: trained models.
        units: that they see touch in.
        structure: whether the latent space has structure.
        parameters: of the controller; NG takes the step along its gradient that is best for the slope.
        rate_hz: steps of prediction per second.
        actions_per_step: actions may come oftener.
        caution: how far the forward model is trusted.

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
        actions_per_step: int,
        caution: Caution,
    ) -> None:
        """See the class."""
        super().__init__(models, units, structure, parameters, rate_hz, actions_per_step)
        self.caution = caution
        likely = units.likely_action / units.action_scale
        likely = likely if caution.by_likelihood else np.ones_like(likely)
        self._likely = torch.from_numpy(likely)[:, None]  # (K, 1)

    def start(self, latent: np.ndarray) -> RestingMemory:  # type: ignore[override]  # it takes its own memory
        """As `TactileServo.start`; nothing is known yet of the model's errors."""
        seeds, trials = latent.shape[:2]
        return RestingMemory(
            super().start(latent), torch.zeros(seeds, LATENT, len(self._likely), trials, dtype=torch.float64)
        )

    @torch.no_grad()
    def act(  # type: ignore[override]  # likewise
        self, latent: np.ndarray, target: np.ndarray, memory: RestingMemory
    ) -> tuple[np.ndarray, RestingMemory]:
        """As `TactileServo.act`."""
        step = self._step(latent, memory.before)
        slope = action_slope(self._dynamics, step.latent, self._likely, self.caution.spread)
        slope = slope * self._likely.T[..., None]
        error = corrected(memory.error, slope, step, self._likely, self.caution.correction)
        found = self._towards(as_states(target), step, slope + error)
        action, before = self._done(found * self._likely, latent, memory.before)
        return action, RestingMemory(before, error)

    def _towards(self, target: Tensor, step: LatentStep, slope: Tensor) -> Tensor:
        """Likely actions (M, K, B) that lead to a target."""
        chosen = self.parameters
        if chosen.inverse == NEGATIVE_GRADIENT:
            missing = (target - step.latent) / step.time_step
            return steepest_action(slope, missing, chosen.action_penalty / step.time_step**2)
        unmoved = slope.new_zeros(*slope.shape[:2], LATENT, slope.shape[-1])
        still = AffineDynamics(unmoved, slope, torch.zeros_like(target))
        return receding_horizon_action(
            still, step.latent, target, self._time_step, chosen.action_penalty, chosen.horizon
        )


def corrected(error: Tensor, slope: Tensor, step: LatentStep, likely: Tensor, rate: float) -> Tensor:
    """What the last step says that slopes are wrong by.

    `error` (M, 3, K, B) E before; `slope` (M, 3, K, B) S of the model, per likely action; `likely` (K, 1)
    scales of likely actions; `rate`: kappa. Returns (M, 3, K, B) E.
    """
    action = step.previous_action / likely
    seen = (step.latent - step.previous_latent) / step.time_step
    missed = (seen - applied(slope + error, action)) / (1.0 + action.square().sum(dim=1, keepdim=True))
    return error + rate * missed[:, :, None] * action[:, None]


def action_slope(dynamics: ForwardDynamics, latent: Tensor, likely: Tensor, spread: float) -> Tensor:
    """By how much an action changes the rate of the latent state.

    `latent` (M, 3, B); `likely` (K, 1) scales of likely actions; `spread`: half the distance over which
    slopes are taken, in these scales; 0: derivatives at rest. Returns (M, 3, K, B).
    """
    rest = latent.new_zeros(latent.shape[0], dynamics.actions, latent.shape[-1])
    if isinstance(dynamics, LocallyLinearDynamics):
        return dynamics.affine(latent).action  # the same for all actions
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
    """Along the gradient at rest, as far as |missing - slope a|^2 + ridge |a|^2 falls.

    `slope` (M, 3, K, B); `missing` (M, 3, B) wanted rate; `ridge` (1,) or (M, 1, B) >= 0. Returns (M, K, B).
    """
    downhill = applied(slope.transpose(1, 2), missing)
    squared = downhill.square().sum(dim=1, keepdim=True)
    curvature = applied(slope, downhill).square().sum(dim=1, keepdim=True) + ridge * squared
    return downhill * squared / curvature.clamp(min=torch.finfo(slope.dtype).tiny)
