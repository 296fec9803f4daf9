"""Parameters of the segmentation: the primitives in a demonstration, and how they are cut."""

from itertools import pairwise
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field, model_validator

from structlearn.core.params import Name, Parameters

Axis = Literal["x", "y", "z", "xyz", "rot", "strokes"]
"""Signal that shows a primitive: position along an axis or in space (of joints, in all), or orientation
(`motion_runs.path`); strokes of a varying number show in space."""

AXES = {"x": [0], "y": [1], "z": [2]}  # columns of the position; all for the others

BETWEEN: Final = "between"
STROKES: Final = "strokes"


class BoundParameters(Parameters):
    """An event at which a primitive ends: a signal passes a value, rising (`above`) or falling (`below`).

    The signal is `force`, the magnitude of the wrist's force in N, `tactile`, the largest change of a
    sensor's counts since the start, or the name of a joint, e.g. of a gripper, in rad or m.
    """

    signal: str = Field(min_length=1)
    above: float | None = None
    below: float | None = None

    @model_validator(mode="after")
    def _one_value(self) -> "BoundParameters":
        if (self.above is None) == (self.below is None):
            raise ValueError("needs either `above` or `below`")
        return self

    def __str__(self) -> str:
        return f"above {self.above:g}" if self.below is None else f"below {self.below:g}"


class PrimitiveParameters(Parameters):
    """Description of one primitive."""

    name: Name
    axis: Literal[Axis, "between"] = "xyz"  # signal that shows it; `between`: between its neighbours
    # speed along the axis above which it moves; None: found from the data (`motion_runs.thresholds`). Always
    # None for orientations and for `between`.
    threshold_m_s: float | None = Field(None, gt=0)
    until: BoundParameters | None = None  # event that ends it; None: it ends with its motion

    @model_validator(mode="after")
    def _threshold_where_it_means_something(self) -> "PrimitiveParameters":
        if self.axis in (BETWEEN, "rot") and self.threshold_m_s is not None:
            raise ValueError(f"threshold_m_s must be null for the axis {self.axis}")
        if self.axis == BETWEEN and self.until is not None:
            raise ValueError("what lies between its neighbours ends where the next begins, not `until`")
        if self.axis == STROKES and self.until is not None:
            raise ValueError("strokes end with the last one, not `until`")
        return self

    @property
    def shown_by(self) -> Axis:
        """The axis that shows it. Raises ValueError: it lies between its neighbours."""
        if self.axis == BETWEEN:
            raise ValueError(f"'{self.name}' lies between its neighbours: no axis shows it")
        return self.axis


def _in_full(primitives: Any) -> Any:
    """Primitives given as a number or as names, expanded to mappings."""
    if isinstance(primitives, int) and not isinstance(primitives, bool):
        primitives = [f"move_{place + 1}" for place in range(min(primitives, MOST))]
    if isinstance(primitives, list | tuple):
        return tuple({"name": one} if isinstance(one, str) else one for one in primitives)
    return primitives


MOST = 100  # primitives of a task; a larger number suggests a mistake


class SegmentParameters(Parameters):
    """Parameters of the segmentation.

    Without a `reference`, it is the first demonstration or, if runs of motion are assigned
    (`assigns_runs`), the one most similar to the others.
    """

    primitives: Annotated[tuple[PrimitiveParameters, ...], BeforeValidator(_in_full)] = Field(
        min_length=1, max_length=MOST
    )
    reference: str | None
    guess_cutoff_hz: float = Field(gt=0)
    cut_cutoff_hz: float = Field(gt=0)
    align_cutoff_hz: float = Field(gt=0)
    bridge_s: float = Field(ge=0)
    extension_s: float = Field(gt=0)
    downsampling: int = Field(ge=1)
    near_zero: float = Field(ge=0, lt=1)
    decay: float = Field(ge=0)
    crossing_weight: float = Field(ge=0)
    crossing_tolerance_s: float = Field(gt=0)
    skip_failures: bool

    @model_validator(mode="after")
    def _between_has_neighbours(self) -> "SegmentParameters":
        names = [primitive.name for primitive in self.primitives]
        if len(set(names)) < len(names):
            raise ValueError("names of primitives must differ")
        between = [primitive.axis == "between" for primitive in self.primitives]
        if between[0] or between[-1] or any(a and b for a, b in pairwise(between)):
            raise ValueError("a primitive `between` needs a neighbour with an axis on either side")
        return self

    @property
    def at_onsets(self) -> bool:
        """Whether movements end at extrapolated onsets, instead of at crossings as published."""
        return False

    @property
    def assigns_runs(self) -> bool:
        """Whether primitives are found by the order of the runs of motion (`run_assignment`).

        Otherwise each has a different axis and a threshold, and is the largest movement along its axis after
        the previous one.
        """
        moving = [primitive for primitive in self.primitives if primitive.axis != BETWEEN]
        axes = {primitive.axis for primitive in moving}
        given = all(primitive.threshold_m_s and primitive.until is None for primitive in moving)
        return len(axes) < len(moving) or not given or STROKES in axes
