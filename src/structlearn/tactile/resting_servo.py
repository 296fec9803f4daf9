"""Tactile servoing with what the forward model knows well: moves like the demonstrated ones, from rest.

The inverse models of the text ask the forward model for its value and its derivative at one action. It was
trained on demonstrated actions, so both are good on average over these and may be anything in between: a
person who sweeps steadily shows no slow moves, and hardly shows how pitch and yaw act. Hence here

    rest:           a finger at rest keeps its touch, zd(z, 0) = 0, whatever the model says of it
    likely actions: beta |a|^2 becomes beta |a / s|^2, with s the root mean squares of demonstrated actions
    spread:         d zd / d a is the slope of the model between the actions -h s and h s, one at a time
    approach:       a step is to go a part of the way to the target, so errors of the slope do no harm

The inverse models stay what they are: LL and NJ solve appendix A's problem, NG goes down the gradient.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from structlearn.tactile.forward_dynamics import (
    ACTION,
    AffineDynamics,
    ForwardDynamics,
    LocallyLinearDynamics,
    applied,
)
from structlearn.tactile.inverse_dynamics import LatentStep, receding_horizon_action
from structlearn.tactile.latent_models import LatentModels
from structlearn.tactile.latent_variants import NEGATIVE_GRADIENT
from structlearn.tactile.servo_controller import ServoParameters, TactileServo
from structlearn.tactile.touch_dataset import TRAIN, TouchDataset, chains
from structlearn.tactile.units import TouchUnits


@dataclass(frozen=True)
class Caution:
    """How far the forward model is trusted.

    Attributes:
        likely: s, (6,) m/s and rad/s, scales of likely actions; None: all alike, as in the text.
        spread: h, half the distance over which slopes are taken, in s; 0: derivatives at rest.
        approach: part of the way to the target that a step is to go.
    """

    likely: np.ndarray | None
    spread: float
    approach: float


def demonstrated_actions(dataset: TouchDataset) -> np.ndarray:
    """Root mean squares (6,) of the actions of the training split, m/s and rad/s, frame of the finger."""
    actions = chains(dataset, 1, split=TRAIN).actions.astype(float)
    return np.sqrt(np.square(actions).mean(axis=(0, 1)))


class RestingServo(TactileServo):
    """Controllers as `TactileServo`; they look at no step before, so their memory says nothing.

    Args:
        models: trained models.
        units: that they see touch in.
        structure: whether the latent space has structure.
        parameters: of the controller; NG takes the step along its gradient that is best for the slope.
        rate_hz: steps of prediction per second; actions may be asked for more often.
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
        caution: Caution,
    ) -> None:
        """See the class."""
        super().__init__(models, units, structure, parameters, rate_hz)
        self.caution = caution
        likely = np.ones(ACTION) if caution.likely is None else caution.likely / units.action_scale
        self._likely = torch.from_numpy(likely)[:, None]  # (6, 1)

    def _unbounded(self, step: LatentStep, target: Tensor) -> Tensor:
        chosen = self.parameters
        goal = step.latent + self.caution.approach * (target - step.latent)
        slope = action_slope(self._dynamics, step.latent, self._likely, self.caution.spread)
        slope = slope * self._likely.T[..., None]
        if chosen.inverse == NEGATIVE_GRADIENT:
            missing = (goal - step.latent) / step.time_step
            found = steepest_action(slope, missing, chosen.action_penalty / step.time_step**2)
        else:
            still = AffineDynamics(torch.zeros_like(slope[:, :, :3]), slope, torch.zeros_like(goal))
            found = receding_horizon_action(
                still, step.latent, goal, self._time_step, chosen.action_penalty, chosen.horizon
            )
        return found * self._likely


def action_slope(dynamics: ForwardDynamics, latent: Tensor, likely: Tensor, spread: float) -> Tensor:
    """By how much an action changes the rate of the latent state.

    Args:
        dynamics: the models.
        latent: (M, 3, B).
        likely: (6, 1) scales of likely actions.
        spread: half the distance over which slopes are taken, in these scales; 0: derivatives at rest.

    Returns:
        (M, 3, 6, B).
    """
    rest = latent.new_zeros(latent.shape[0], ACTION, latent.shape[-1])
    if isinstance(dynamics, LocallyLinearDynamics):
        return dynamics.affine(latent).action  # the same for all actions
    if spread == 0:
        return dynamics.jacobians(latent, rest)[1]
    slopes = []
    for component in range(ACTION):
        reach = spread * float(likely[component])
        action = rest.clone()
        action[:, component] = reach
        slopes.append((dynamics.rate(latent, action) - dynamics.rate(latent, -action)) / (2 * reach))
    return torch.stack(slopes, dim=2)


def steepest_action(slope: Tensor, missing: Tensor, ridge: Tensor) -> Tensor:
    """Along the gradient at rest, as far as |missing - slope a|^2 + ridge |a|^2 falls.

    Args:
        slope: (M, 3, 6, B).
        missing: (M, 3, B) wanted rate.
        ridge: (1,) or (M, 1, B) >= 0.

    Returns:
        (M, 6, B).
    """
    downhill = applied(slope.transpose(1, 2), missing)
    squared = downhill.square().sum(dim=1, keepdim=True)
    curvature = applied(slope, downhill).square().sum(dim=1, keepdim=True) + ridge * squared
    return downhill * squared / curvature.clamp(min=torch.finfo(slope.dtype).tiny)
