"""What is chosen for touches of your own skin."""

from typing import Literal

from pydantic import Field

from structlearn.ground.params import Parameters
from structlearn.recordings.topics import TopicMap
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentSpaceParameters
from structlearn.tactile.sensor_description import SensorDescription


class TouchParameters(Parameters):
    """A latent space of your own skin.

    Attributes:
        source: folder of tables (`recordings.touch_log`), or of bags.
        topics: of bags: tactile sensors, and the pose of what touches.
        channels: columns of tables that are channels; None: all but place and time.
        places: where a touch is. `probe`: where the recording has what touches, on a flat skin. `channels`:
            in the middle of the channels that change, along the skin between touches.
        channels_mm: (x, y) of each channel on the skin; needed where `places` is `channels`.
        change: what pressure does to a reading: all fall, all rise, or each goes its own way.
        by_norm: whether readings are divided by their norm, whose logarithm then is a channel of its own.
        gain_spread: std of the logarithm of the gain that all channels share and that drifts.
        copies: times that each touch is learned from, from the second on with a gain that drifted.
        air_samples: the first so many of each recording are in the air and tell what reads zero; 0: zeroed.
        touched: pressure (mean change, or norm where channels go their own ways) from which on it touches.
        most_samples: evenly taken if there are more.
        block_mm: side of the blocks of places that are held out.
        folds: parts into which the blocks fall.
        geodesics: distances along the skin, where `places` is `channels`.
        spaces: how the latent spaces are learned.
    """

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
