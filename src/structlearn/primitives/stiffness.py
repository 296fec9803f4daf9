"""Suggested stiffness over the course of a primitive: stiff where the demonstrations agree.

    k = clip(F / s, k_softest, k_stiffest)

s is the demonstrations' spread about the primitive, unrolled with the start, goal and duration of each, and F
the force at one spread from the path. Others take the inverse covariance of the demonstrations (Calinon,
Sardellitti, Caldwell 2010); with a force, units and bounds are those of a robot. The formula says nothing
about contact, stability or safety.
"""

from collections.abc import Sequence

import numpy as np
from pydantic import Field, model_validator

from structlearn.core import quaternion, signals
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.primitives.fitting import RhythmicSegment, Segment, unrolled
from structlearn.primitives.sequence import PosePrimitive

KNOTS = 50  # points of a profile from start to end
FEWEST = 3  # demonstrations from which a spread is estimated
FINEST = 1e-6  # m and rad; no recording resolves a smaller spread


class StiffnessParameters(Parameters):
    """Force at one spread from the path, and bounds. Fields: `params.yaml`."""

    force_n: float = Field(gt=0)
    softest_n_m: float = Field(gt=0)
    stiffest_n_m: float = Field(gt=0)
    torque_nm: float = Field(gt=0)
    softest_nm_rad: float = Field(gt=0)
    stiffest_nm_rad: float = Field(gt=0)

    @model_validator(mode="after")
    def _in_order(self) -> "StiffnessParameters":
        if self.softest_n_m > self.stiffest_n_m or self.softest_nm_rad > self.stiffest_nm_rad:
            raise ValueError("the softest is stiffer than the stiffest")
        return self


def spread(primitive: PosePrimitive, segments: Sequence[Segment]) -> np.ndarray:
    """Root mean square distance of demonstrations from the primitive, (KNOTS, 3) m or (KNOTS, 6) m, rad.

    Along and about the axes of the base, at equal parts of the duration. One of a rhythmic primitive is the
    same throughout, since its demonstrations make different numbers of cycles. Raises InputError: there are
    fewer than `FEWEST` demonstrations.
    """
    if len(segments) < FEWEST:
        raise InputError(
            f"'{primitive.name}' was learned from {len(segments)} demonstrations: a stiffness from their "
            f"spread needs {FEWEST}"
        )
    squares = []
    for segment in segments:
        (position, orientation), (path, turn) = segment, unrolled(primitive, segment)
        away = position.position - path.position
        if orientation is not None and turn is not None:
            away = np.hstack([away, quaternion.difference(orientation.orientation, turn.orientation)])
        squares.append(signals.time_normalised(away, KNOTS) ** 2)
    over_time = np.mean(squares, axis=0)
    if isinstance(segments[0], RhythmicSegment):
        over_time[:] = over_time.mean(axis=0)
    return np.sqrt(over_time)


def suggested(spreads: np.ndarray, parameters: StiffnessParameters) -> np.ndarray:
    """Stiffness from a `spread`, likewise (KNOTS, 3) N/m or (KNOTS, 6) N/m, N m/rad."""
    bounds = [(parameters.force_n, parameters.softest_n_m, parameters.stiffest_n_m)] * 3
    bounds += [(parameters.torque_nm, parameters.softest_nm_rad, parameters.stiffest_nm_rad)] * 3
    effort, softest, stiffest = np.array(bounds[: spreads.shape[1]]).T
    return np.clip(effort / np.maximum(spreads, FINEST), softest, stiffest)
