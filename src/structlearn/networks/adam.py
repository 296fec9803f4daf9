"""Adam with a rate that may shrink, on variables that several models share."""

from collections.abc import Sequence

import torch
from pydantic import Field
from torch import Tensor

from structlearn.ground.params import Parameters


class AdamParameters(Parameters):
    """Parameters of the optimiser; the defaults are torch's.

    Attributes:
        rate: learning rate at the start.
        batch: samples per step.
        second_moment_decay: per step, of the running mean of squared gradients. Gradients of inertias fall by
            five powers of ten in a few hundred steps; 0.999 would go on dividing by the first ones.
        decay: factor by which the rate falls in 1000 steps.
        smallest: share of the rate at which it stays.
        mass_step: step of a mass's free parameter beside those of the others. A mass starts ten times as
            far spread as a first moment; with equal steps, those that suit masses shake the last joint, whose
            torque is a thousandth of the others', and those that suit the last joint leave masses behind.
    """

    rate: float = Field(gt=0)
    batch: int = Field(ge=1)
    second_moment_decay: float = Field(gt=0, lt=1)
    decay: float = Field(gt=0, le=1)
    smallest: float = Field(ge=0, le=1)
    mass_step: float = Field(gt=0)


class Adam:
    """Torch's Adam with the rate of `AdamParameters`.

    Args:
        variables: leaves that gradients are taken for.
        parameters: see there.
    """

    def __init__(self, variables: Sequence[Tensor], parameters: AdamParameters):
        self.variables = list(variables)
        self.parameters, self.steps = parameters, 0
        betas = (0.9, parameters.second_moment_decay)
        self.optimiser = torch.optim.Adam(self.variables, parameters.rate, betas, fused=True)

    def step(self, gradients: Sequence[Tensor | None]) -> None:
        """One step down the gradients of the variables; one without (a constant of a potential) stays."""
        share = max(self.parameters.decay ** (1e-3 * self.steps), self.parameters.smallest)
        self.optimiser.param_groups[0]["lr"] = self.parameters.rate * share
        for variable, gradient in zip(self.variables, gradients, strict=True):
            # the fused step takes a gradient's memory as if it were laid out like the variable's
            variable.grad = None if gradient is None else gradient.contiguous()
        self.optimiser.step()
        self.steps += 1
