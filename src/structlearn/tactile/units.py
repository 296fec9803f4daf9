"""Units in which the networks see touch, so that one loss, penalty or weight compares with another.

The dissertation trains on raw counts and evens the losses out by weights (II.4.1.3). Here signals and
pressure are standardised, map distances are divided by a length, and actions by one scale per kind of
velocity: within linear and within angular velocity, directions stay what they are.
"""

from dataclasses import dataclass

import numpy as np

from structlearn.ground.errors import InputError
from structlearn.tactile.touch_dataset import TRAIN, Chains, TouchSamples

LINEAR = 3
"""The first so many components of an action are linear velocity, the others angular."""


@dataclass(frozen=True)
class TouchUnits:
    """Offsets and scales; a quantity in the networks' units is (quantity - offset) / scale."""

    signal_mean: np.ndarray  # (E,) counts
    signal_scale: np.ndarray  # (E,) counts
    pressure_mean: np.ndarray  # () counts
    pressure_scale: np.ndarray  # () counts
    length: np.ndarray  # () m on the skin per unit of the map
    action_scale: np.ndarray  # (K,) m/s up to three times, rad/s for the others; actions have no offset
    # (K,) root mean squares of the demonstrated actions, m/s and rad/s by component
    likely_action: np.ndarray

    def signals(self, counts: np.ndarray) -> np.ndarray:
        """Standardised signals (..., E) of counts less their offset."""
        return (counts - self.signal_mean) / self.signal_scale

    def pressure(self, counts: np.ndarray) -> np.ndarray:
        """Standardised pressure (...) of counts."""
        return (counts - self.pressure_mean) / self.pressure_scale


def touch_units(dataset: TouchSamples, chains: Chains, length_m: float) -> TouchUnits:
    """Units from the training samples.

    `dataset`: samples of touch; `chains`: of the training split; their actions give the scales and the likely
    actions; `length_m`: m on the skin per unit of the map.

    Raises:
        InputError: there is no training sample or chain, or an electrode, the pressure or the velocity
            never changes.
    """
    rows = dataset.split == TRAIN
    if not rows.any() or not len(chains):
        raise InputError("touch: no sample or no chain to train on")
    signals, pressure = dataset.signals[rows].astype(float), dataset.pressure[rows].astype(float)
    squared = np.square(chains.actions, dtype=float).mean(axis=(0, 1))
    linear, angular = squared[:LINEAR], squared[LINEAR:]
    kinds = np.sqrt([kind.mean() for kind in (linear, angular) if len(kind)])
    scale = signals.std(axis=0)
    if not scale.all():
        raise InputError(f"touch: electrode {int(np.argmin(scale)) + 1} has the same value in all samples")
    if not pressure.std() > 0 or not kinds.all():
        raise InputError("touch: the pressure or the velocity is the same in all samples")
    return TouchUnits(
        signal_mean=signals.mean(axis=0),
        signal_scale=scale,
        pressure_mean=pressure.mean(),
        pressure_scale=pressure.std(),
        length=np.array(length_m),
        action_scale=np.repeat(kinds, [len(kind) for kind in (linear, angular) if len(kind)]),
        likely_action=np.sqrt(squared),
    )
