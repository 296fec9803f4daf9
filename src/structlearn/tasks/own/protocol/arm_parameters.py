"""What an entry says of the robot that a skill is checked on."""

from typing import Annotated

import numpy as np
from pydantic import Field, PositiveFloat, field_validator

from structlearn.core import quaternion
from structlearn.core.params import Parameters

Bound = PositiveFloat | Annotated[tuple[PositiveFloat, ...], Field(min_length=1)]
"""One for all joints, or one for each."""


class Placement(Parameters):
    """Where a frame stands in another: its origin, and a unit quaternion w, x, y, z."""

    position_m: tuple[float, float, float]
    orientation: tuple[float, float, float, float]

    @field_validator("orientation")
    @classmethod
    def _is_a_turn(cls, orientation: tuple[float, ...]) -> tuple[float, ...]:
        if abs(np.linalg.norm(orientation) - 1.0) > 1e-3:
            raise ValueError("a quaternion w, x, y, z has norm 1")
        return orientation

    @property
    def turn(self) -> np.ndarray:
        """(4,) its orientation, with norm 1 to the last digit."""
        return quaternion.normalised(np.array(self.orientation))


class RobotParameters(Parameters):
    """A robot, how it stands to what was demonstrated, and what it may be asked for.

    Limits of position and velocity are those of the URDF, which knows none of the others. Fields:
    `stages/tasks/params.yaml`, `robot`.
    """

    urdf: str = Field(min_length=1)
    tip: str = Field(min_length=1)
    locked_joints: tuple[str, ...]
    base: Placement
    tool: Placement
    rest_configuration: tuple[float, ...] | None
    max_acceleration: Bound
    max_jerk: Bound
    least_singular_value: float = Field(gt=0)
    least_distance_m: float = Field(gt=0)
