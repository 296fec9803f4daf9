"""Bounds on feedback, one per axis, which hold whatever the sensor and the network do."""

from collections.abc import Mapping, Sequence

import numpy as np
from pydantic import Field, PositiveFloat

from structlearn.feedback.axes import AXES, Axis, turns
from structlearn.ground.errors import InputError
from structlearn.ground.params import Parameters
from structlearn.primitives.transformation import ALPHA, BETA

TARGET_MARGIN = 1.5
"""A coupling term may be this much larger than any that was demonstrated."""

LARGEST_TURN, LARGEST_SHIFT = 40.0, ALPHA * BETA * 0.03
"""rad and m; held for long, they turn by 15 degrees and shift by 3 cm: where nothing else is said."""


def _cautious() -> dict[Axis, float]:
    return {axis: LARGEST_TURN if turns(axis) else LARGEST_SHIFT for axis in AXES}


class FadingParameters(Parameters):
    """How soon feedback fades, and when it has to. Fields: `params.yaml`, `write_skill`.

    `fade_s` bounds |dc/dt| within a primitive. Where the next one begins c is 0 at once, and the evolving
    goal takes up what it was (eq. IV.14): acceleration, the robot's own measure, goes on as it was.
    """

    fade_s: float = Field(gt=0)
    stale_after_s: float = Field(gt=0)
    offset_within_s: float = Field(gt=0)


class Limits(FadingParameters):
    """Bounds on feedback, cautious ones where nothing else is said."""

    # by axis, bound of |c|, m or rad (see `axes`); held for long, c shifts or turns by c / (ALPHA BETA).
    # `largest_coupling` derives it from demonstrated coupling terms.
    largest_coupling: dict[Axis, PositiveFloat] = Field(default_factory=_cautious)
    fade_s: float = Field(default=0.05, gt=0)
    stale_after_s: float = Field(default=0.05, gt=0)
    offset_within_s: float = Field(default=0.1, gt=0)

    def of(self, axes: Sequence[Axis], dt: float) -> np.ndarray:
        """Largest coupling terms, and their largest changes in a tick of dt s: (2, D).

        Raises InputError: an axis has no bound.
        """
        for axis in axes:
            if axis not in self.largest_coupling:
                raise InputError(f"the limits say no largest coupling term for {axis}")
        largest = np.array([self.largest_coupling[axis] for axis in axes], dtype=float)
        return np.stack([largest, largest * dt / self.fade_s])


def largest_coupling(targets: Sequence[np.ndarray]) -> float:
    """A bound of the coupling term of one axis: the largest demonstrated one, and `TARGET_MARGIN`."""
    return TARGET_MARGIN * max(float(np.abs(target).max()) for target in targets)


def demonstrated_limits(targets: Mapping[Axis, Sequence[np.ndarray]], fading: FadingParameters) -> Limits:
    """Limits from the coupling terms that were demonstrated on each axis; an axis without any has none."""
    largest = {axis: largest_coupling(its) for axis, its in targets.items() if its}
    return Limits(largest_coupling=largest, **fading.model_dump(include=set(FadingParameters.model_fields)))
