"""What a user says about the primitives in the demonstrations, and how they are to be cut."""

from itertools import pairwise
from typing import Literal

from pydantic import Field, model_validator

from structlearn.ground.params import Name, Parameters

AXES = {"x": [0], "y": [1], "z": [2], "xyz": [0, 1, 2]}
"""Columns of the position that show a primitive."""


class PrimitiveParameters(Parameters):
    """How one primitive is found.

    Attributes:
        name: of the primitive.
        axis: position signal that shows it, or `between`: what lies between its neighbours.
        threshold_m_s: speed along the axis above which it moves; needs none when between.
    """

    name: Name
    axis: Literal["x", "y", "z", "xyz", "between"]
    threshold_m_s: float | None = Field(gt=0)

    @model_validator(mode="after")
    def _threshold_where_needed(self) -> "PrimitiveParameters":
        if (self.axis == "between") != (self.threshold_m_s is None):
            raise ValueError("threshold_m_s is needed for an axis, and only there")
        return self


class SegmentParameters(Parameters):
    """Parameters of the segmentation.

    Attributes:
        primitives: in order of time.
        reference: name of the demonstration that is cut first; None: the first one.
        guess_cutoff_hz: low-pass of the speed that finds a movement.
        cut_cutoff_hz: low-pass of the speed that places its cut points.
        align_cutoff_hz: low-pass of positions and velocities for the alignment.
        bridge_s: a dip in speed up to this long is a hesitation, not an end.
        extension_s: delta, by which a segment is extended on both sides before the alignment.
        downsampling: g, every g-th sample is aligned (appendix C).
        near_zero: fraction of the largest speed below which a pair is dropped.
        decay: k of the weights exp(-k |v_ref - v_guess|).
        crossing_weight: weight of the crossings as correspondences, relative to all other pairs together.
        crossing_tolerance_s: distance from the alignment at which a crossing has half that weight.
        skip_failures: go on without demonstrations that cannot be cut; the report lists them.
    """

    primitives: tuple[PrimitiveParameters, ...] = Field(min_length=1)
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
