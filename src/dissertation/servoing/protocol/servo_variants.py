"""Controllers compared in closed loop, and the parameters of their trials."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, PositiveInt

from dissertation.servoing.world.servo_loop import LoopParameters
from dissertation.simulation.touch_demonstrator import ToucherParameters
from structlearn.core.params import Parameters
from structlearn.tactile.latent_parameters import (
    FORWARD_OF,
    JACOBIAN,
    LOCALLY_LINEAR,
    STRUCTURES,
    InverseModel,
)

PUBLISHED = "published"  # forms of the controllers
ADAPTIVE = "adaptive"

SPACES = {True: "structure", False: "no structure"}  # latent spaces

AS_DATA = "filter and rate of the data"
ALL_ALIKE, DERIVATIVE, UNCORRECTED = "all actions alike", "derivative at rest", "model never corrected"
CHANGES = (AS_DATA, ALL_ALIKE, DERIVATIVE, UNCORRECTED)
"""Ablations of the adaptive controller; the first also applies to the published controller."""


class ToleranceParameters(Parameters):
    """Tolerances within which a target counts as reached."""

    position_mm: float = Field(gt=0)
    pressure: float = Field(gt=0)
    judged_s: float = Field(gt=0)


class PublishedParameters(Parameters):
    """Published controllers; the action limit and the gain are in the networks' units."""

    action_penalty: float = Field(gt=0)
    gradient_gain: float = Field(gt=0)
    largest_action: float = Field(gt=0)


class AdaptiveParameters(Parameters):
    """Adaptive controllers, which correct their model (`tactile.servo_controller`)."""

    action_penalty: float = Field(gt=0)
    largest_action: float = Field(gt=0)
    spread: float = Field(gt=0)
    correction: float = Field(gt=0, lt=2)


class ServoTrialParameters(Parameters):
    """Closed-loop trials."""

    seed: int = Field(ge=0)
    trials: PositiveInt
    duration_s: float = Field(gt=0)
    load_share: tuple[Annotated[float, Field(ge=0)], Annotated[float, Field(le=1)]]
    tilt_deg: float = Field(ge=0)
    rest_s: float = Field(gt=0)
    follow_s: float = Field(gt=0)
    horizon: int = Field(ge=2)
    loop: LoopParameters
    loop_of_data: LoopParameters
    published: PublishedParameters
    resting: AdaptiveParameters
    tolerance: ToleranceParameters
    shown: PositiveInt


@dataclass(frozen=True)
class ServoVariant:
    """A controller under comparison."""

    form: str  # `PUBLISHED` or `ADAPTIVE`
    inverse: InverseModel
    structure: bool = True  # of its latent space
    with_loss: bool = True  # whether its forward model was trained with the inverse model's loss
    horizon: int = 1  # prediction steps
    change: str = ""  # ablation, one of `CHANGES`, or empty


def variants(horizon: int) -> list[ServoVariant]:
    """All controllers under comparison."""
    every = [
        ServoVariant(form, inverse, structure, with_loss)
        for form in (PUBLISHED, ADAPTIVE)
        for structure in STRUCTURES
        for with_loss in (True, False)
        for inverse in FORWARD_OF
    ]
    further = [ServoVariant(ADAPTIVE, inverse, horizon=horizon) for inverse in (LOCALLY_LINEAR, JACOBIAN)]
    slow = [ServoVariant(PUBLISHED, inverse, change=AS_DATA) for inverse in FORWARD_OF]
    without = [ServoVariant(ADAPTIVE, "NJ", change=change) for change in CHANGES]
    return every + further + slow + without


def variants_of_other_skins() -> list[ServoVariant]:
    """Controllers that are also compared with other skins."""
    return [ServoVariant(form, inverse) for form in (PUBLISHED, ADAPTIVE) for inverse in FORWARD_OF]


SkinName = Literal["biotac", "flat_pad", "sphere"]


class OtherSkin(Parameters):
    """Demonstrations on another skin, see `simulation.touch_demonstrator.ToucherParameters`."""

    along_mm: tuple[float, float]
    across_deg: float = Field(ge=0, le=80)
    handle_half_mm: float = Field(ge=0)


class OtherSkinsParameters(Parameters):
    """Other skins; all other settings are those of the first skin."""

    skins: Mapping[SkinName, OtherSkin]
    seeds: PositiveInt

    def person_with(self, skin: SkinName, person: ToucherParameters) -> ToucherParameters:
        """Parameters of a person who demonstrates on another skin."""
        return person.model_copy(update={"skin": skin} | self.skins[skin].model_dump())
