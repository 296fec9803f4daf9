"""Parameters of learning from touch. Fields: `defaults.touch` in `tasks/stages/params.yaml`."""

from typing import Literal

from pydantic import Field, PositiveFloat

from structlearn.core.params import Parameters
from structlearn.readers.source import ClockParameters, SourceParameters, TopicMap
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentSpaceParameters

DEGREE = 3  # of the polynomial from latent coordinates to place and depth: bends, but no waves


class ForceParameters(Parameters):
    """Forces estimated from a skin, learned from presses on a scale."""

    longest_lag_s: float = Field(gt=0)
    pressed_n: float = Field(gt=0)
    penalties: tuple[PositiveFloat, ...] = Field(min_length=1)


class PublishedErrors(Parameters):
    """Errors published for the end of each run, after training on its start, and epochs of their network."""

    first_share: float = Field(gt=0, lt=1)
    place_mm: float = Field(gt=0)
    force_n: float = Field(gt=0)
    shear_n: float = Field(gt=0)
    epochs: int = Field(ge=1)


class PressServoParameters(Parameters):
    """Closed loops on the table of another recording's presses."""

    walks: int = Field(ge=1)
    reach_mm: float = Field(gt=0)
    trials: int = Field(ge=1)
    steps: int = Field(ge=1)
    tolerance_mm: float = Field(gt=0)
    gradient_gain: float = Field(gt=0)
    largest_action: float = Field(gt=0)
    correction: float = Field(ge=0, le=2)
    depth_mm: float = Field(gt=0)
    seed: int = Field(ge=0)


class SurfaceParameters(Parameters):
    """Expected traces of a finger that slides over surfaces, and deviations from them."""

    rate_hz: float = Field(gt=0)
    max_gap_s: float = Field(gt=0)
    material: str
    left_out: tuple[str, ...]
    strong_counts: float = Field(gt=0)
    smoothing_hz: float = Field(gt=0)


class TouchParameters(SourceParameters):
    """Touches of a skin at known places; with `surfaces`, slides of a finger."""

    kind = "touch"

    topics: TopicMap | None
    clock: ClockParameters
    channels: tuple[str, ...] | None = Field(min_length=1)
    places: Literal["probe", "channels"]
    channels_mm: tuple[tuple[float, float], ...] | None
    change: Literal["falls", "rises", "either"]
    by_norm: bool
    gain_spread: float = Field(ge=0)
    copies: int = Field(ge=1)
    air_samples: int = Field(ge=0)
    touched: float = Field(ge=0)
    most_samples: int = Field(ge=100)
    apart: bool
    tuned_on: tuple[str, ...]
    block_mm: float = Field(gt=0)
    folds: int = Field(ge=2)
    rival_samples: int = Field(ge=2)
    geodesics: GeodesicParameters
    spaces: LatentSpaceParameters
    force: ForceParameters | None
    published: PublishedErrors | None
    servo: PressServoParameters | None
    surfaces: SurfaceParameters | None


Entry = TouchParameters
