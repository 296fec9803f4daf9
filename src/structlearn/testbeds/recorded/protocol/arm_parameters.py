"""What is chosen for models of recorded arms: the Panda's dynamics, and the UR10e and its load."""

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, NonNegativeInt, PositiveFloat

from structlearn.ground.params import Parameters


class RecordedDynamicsParameters(Parameters):
    """Parameters of identification from the recorded motion."""

    urdf: str
    locked_joints: tuple[str, ...]
    rate_hz: float = Field(gt=0)
    cutoff_hz: float = Field(gt=0)
    train_share: float = Field(gt=0, lt=1)
    iterations: int = Field(ge=1)
    seeds: int = Field(ge=1)
    epochs: int = Field(ge=1)


Log = Annotated[str, Field(min_length=1)]


class BlockParameters(Parameters):
    """Parameters of intervals."""

    block_s: float = Field(gt=0)
    draws: int = Field(ge=100)
    seed: NonNegativeInt


class NetworkChoiceParameters(Parameters):
    """Parameters of choosing the networks, all kinds alike."""

    train_share: float = Field(gt=0, lt=1)
    hidden: tuple[tuple[int, ...], ...] = Field(min_length=1)
    rates: tuple[PositiveFloat, ...] = Field(min_length=1)
    epochs: tuple[int, ...] = Field(min_length=1)
    batch: int = Field(ge=1)
    choice_seeds: int = Field(ge=1)
    seeds: int = Field(ge=1)


class CarriedLoadParameters(Parameters):
    """Parameters of following the load while it is carried."""

    structure: Literal["spd", "tri", "cov"]
    batch: int = Field(ge=1)
    memory_s: float = Field(gt=0)
    iterations: int = Field(ge=1)
    settled_s: float = Field(gt=0)


class RecordedUr10eParameters(Parameters):
    """Parameters of the recorded UR10e."""

    rest: Log | None
    train: Log
    test: Log
    load_pairs: tuple[tuple[Log, Log], ...]
    load_kg: float = Field(gt=0)
    assumed_gains: Mapping[int, int]
    quoted_gains: tuple[PositiveFloat, ...]
    rate_hz: float = Field(gt=0)
    cutoff_hz: float = Field(gt=0)
    rest_rad_s: float = Field(gt=0)
    rest_s: float = Field(gt=0)
    delays_s: tuple[float, float]
    delay_step_s: float = Field(gt=0)
    intervals: BlockParameters
    iterations: int = Field(ge=1)
    networks: NetworkChoiceParameters
    carried: CarriedLoadParameters
    body_draws: int = Field(ge=3)

    @property
    def block(self) -> int:
        """Samples of a block."""
        return round(self.intervals.block_s * self.rate_hz)
