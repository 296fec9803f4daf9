"""What is chosen for touches of your own skin."""

from typing import Literal

from pydantic import Field

from structlearn.ground.params import Parameters
from structlearn.recordings.topics import TopicMap
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentSpaceParameters, SensorDescription


class TouchParameters(Parameters):
    """A latent space of your own skin. Fields: `stages/own/params.yaml`, `touch`."""

    source: str = Field(min_length=1)
    topics: TopicMap
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
    block_mm: float = Field(gt=0)
    folds: int = Field(ge=2)
    geodesics: GeodesicParameters
    spaces: LatentSpaceParameters

    def sensor(self, channels: tuple[str, ...]) -> SensorDescription:
        """The sensor that has these channels."""
        return SensorDescription(
            channels=channels,
            places_mm=self.channels_mm,
            change=self.change,
            by_norm=self.by_norm,
            gain_spread=self.gain_spread,
        )
