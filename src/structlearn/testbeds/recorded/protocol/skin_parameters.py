"""What is chosen for the magnetic skin: what is held out, how its map is learned, read and servoed in."""

from pathlib import Path

from pydantic import Field

from structlearn.ground.params import Parameters, read_parameters
from structlearn.tactile.latent_parameters import LatentSpaceParameters
from structlearn.tactile.sensor_description import SensorDescription

SENSORS = Path(__file__).with_name("sensors.yaml")


class SkinForceParameters(Parameters):
    """How forces are read.

    Attributes:
        longest_lag_s: s by which signals and scale may lag behind the commanded depth.
        pressed_n: N that a press reaches at least.
        penalties: of the ridge, of which one is chosen by leaving presses of the learned run out.
    """

    longest_lag_s: float = Field(gt=0)
    pressed_n: float = Field(gt=0)
    penalties: tuple[float, ...] = Field(min_length=1)


class SkinServoParameters(Parameters):
    """Closed loops on the table of recorded presses.

    Attributes:
        walks: chains of presses that the dynamics learn from.
        reach_mm: mm, of a step along each axis.
        trials: pairs of presses, from one to the other.
        steps: of each trial.
        tolerance_mm: mm from the target within which a trial ends that succeeds.
        gradient_gain: alpha of NG (eq. II.14).
        largest_action: root mean squares of the actions learned from.
        correction: of what a step missed, for the corrected controller (`tactile.resting_servo`).
        depth_mm: mm around the depth of a run that knows only one: deeper or higher presses are left out of
            the table on which what it learned is tried.
        seed: of walks, starts and targets.
    """

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
    """Parameters of the magnetic skin.

    Attributes:
        sensor: name of its description in `sensors.yaml`.
        tuned_on: runs on whose held-out blocks, and on reading which from others, constants were chosen.
        block_mm: mm, side of the blocks of places that are held out.
        folds: parts into which the blocks fall.
        copies: times that each press is learned from, with gains that drifted.
        degree: of the polynomial that reads place and depth off latent coordinates.
        rival_samples: presses that the Gaussian process knows at most.
        spaces: how the latent spaces are learned.
        force: how forces are read.
        servo: closed loops.
    """

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
