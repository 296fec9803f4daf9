"""A setting in closed form, in which policies and networks are executed at once."""

from dataclasses import dataclass, field

import numpy as np

from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.policy_search.refinement import Rollout
from structlearn.primitives import canonical, kernels

TICKS, CHANNELS, KERNELS = 60, 3, 6
TIME = np.linspace(0.0, 1.0, TICKS)
PHASE = canonical.phase(TIME, canonical.TAU_PER_DURATION)
FEATURES = kernels.features(*PHASE, KERNELS)
LEARNED, NEW = (0.0, 5.0), 10.0


def wanted(setting):
    """Coupling term that corrects a setting; not linear in it, so what was learned does not reach to NEW."""
    return FEATURES @ np.full(KERNELS, -0.5 * setting * (1.0 + 0.1 * setting))


def felt(setting, rng):
    """Deviations that grow with the setting."""
    waves = np.sin(np.outer(TIME, [2.0, 3.0, 5.0]) + 1.0)
    return setting * (1.0 + waves) + 0.2 * rng.standard_normal((TICKS, CHANNELS))


def dataset(deviation, target, setting, demonstration=0):
    same = np.ones(len(target))
    return CouplingDataset(
        deviation, *PHASE, target, setting * same, (demonstration * same).astype(int), TIME
    )


@dataclass
class MadeUp:
    """The cost is how far the coupling term is from the wanted one; remembers what it was asked for.

    Attributes:
        failing: seeds whose rollouts fail.
        calls: (network, seed) of every rollout.
    """

    failing: object = lambda seed: False
    calls: list = field(default_factory=list)
    rate_hz: float = TICKS - 1.0

    def rollouts(self, networks, seeds):
        self.calls += zip(networks, seeds, strict=True)
        return [self.rollout(network, seed) for network, seed in zip(networks, seeds, strict=True)]

    def rollout(self, network, seed):
        if self.failing(seed):
            return Rollout(np.array([np.nan]), None, f"ValueError: {seed} diverged")
        deviation = felt(NEW, np.random.default_rng(seed))
        coupling = network.coupling(deviation[:, : network.inputs], *PHASE)
        return Rollout(np.abs(coupling - wanted(NEW)), dataset(deviation, coupling, NEW))
