"""What is chosen for latent spaces of recorded touch, and for those of a magnetic skin."""

from pathlib import Path

from pydantic import Field

from structlearn.ground.params import Parameters, read_parameters
from structlearn.tactile.latent_parameters import GeodesicParameters, LatentSpaceParameters, SensorDescription


class LatentTouchParameters(Parameters):
    """Latent spaces of recorded touch."""

    faulty: tuple[str, ...]
    folds: int = Field(ge=2)
    simulated_repeats: int = Field(ge=1)
    geodesics: GeodesicParameters
    spaces: LatentSpaceParameters


SENSORS = Path(__file__).with_name("sensors.yaml")


class SkinForceParameters(Parameters):
    """How forces are read."""

    longest_lag_s: float = Field(gt=0)
    pressed_n: float = Field(gt=0)
    penalties: tuple[float, ...] = Field(min_length=1)


class SkinServoParameters(Parameters):
    """Closed loops on the table of recorded presses."""

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


class SkinParameters(Parameters):
    """Parameters of the magnetic skin."""

    sensor: str
    tuned_on: tuple[str, ...]
    block_mm: float = Field(gt=0)
    folds: int = Field(ge=2)
    copies: int = Field(ge=1)
    degree: int = Field(ge=1)
    rival_samples: int = Field(ge=2)
    spaces: LatentSpaceParameters
    force: SkinForceParameters
    servo: SkinServoParameters

    def description(self) -> SensorDescription:
        """Of the sensor.

        Raises:
            InputError: there is none of this name, or it is not one.
        """
        return read_parameters(SENSORS, self.sensor, SensorDescription)
