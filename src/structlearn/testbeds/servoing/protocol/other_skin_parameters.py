"""Which other skins are demonstrated on, and how many models learn from it."""

from collections.abc import Mapping
from typing import Literal

from pydantic import Field, PositiveInt

from structlearn.ground.params import Parameters
from structlearn.simulation.touch_demonstrator import ToucherParameters

SkinName = Literal["biotac", "flat_pad", "sphere"]


class OtherSkin(Parameters):
    """What is demonstrated on a skin, see `simulation.touch_demonstrator.ToucherParameters`."""

    along_mm: tuple[float, float]
    across_deg: float = Field(ge=0, le=80)
    handle_half_mm: float = Field(ge=0)


class OtherSkinsParameters(Parameters):
    """Other skins; all else is as for the first one."""

    skins: Mapping[SkinName, OtherSkin]
    seeds: PositiveInt

    def person_with(self, skin: SkinName, person: ToucherParameters) -> ToucherParameters:
        """A person who demonstrates on another skin."""
        return person.model_copy(update={"skin": skin} | self.skins[skin].model_dump())
