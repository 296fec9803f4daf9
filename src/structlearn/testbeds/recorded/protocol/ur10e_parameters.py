"""What is chosen for the recorded UR10e and its load."""

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, NonNegativeInt, PositiveFloat

from structlearn.ground.params import Parameters

Log = Annotated[str, Field(min_length=1)]


class BlockParameters(Parameters):
    """Parameters of intervals.

    Attributes:
        block_s: of a motion, longer than errors remember.
        draws: of blocks.
        seed: of the draws.
    """

    block_s: float = Field(gt=0)
    draws: int = Field(ge=100)
    seed: NonNegativeInt


class NetworkChoiceParameters(Parameters):
    """Parameters of choosing the networks, all kinds alike.

    Attributes:
        train_share: first part of the training motion, learned from while choosing; the rest decides.
        hidden: nodes of the hidden layers, to choose from.
        rates: of Adam, to choose from.
        epochs: to choose from.
        batch: samples per step.
        choice_seeds: networks of each kind while choosing.
        seeds: networks of each kind in the end.
    """

    train_share: float = Field(gt=0, lt=1)
    hidden: tuple[tuple[int, ...], ...] = Field(min_length=1)
    rates: tuple[PositiveFloat, ...] = Field(min_length=1)
    epochs: tuple[int, ...] = Field(min_length=1)
    batch: int = Field(ge=1)
    choice_seeds: int = Field(ge=1)
    seeds: int = Field(ge=1)


class CarriedLoadParameters(Parameters):
    """Parameters of following the load while it is carried.

    Attributes:
        structure: of the links.
        batch: samples between two fits.
        memory_s: after this time a sample's weight has fallen to a half.
        iterations: of L-BFGS per fit.
        settled_s: after the load was taken up, from when on errors count.
    """

    structure: Literal["spd", "tri", "cov"]
    batch: int = Field(ge=1)
    memory_s: float = Field(gt=0)
    iterations: int = Field(ge=1)
    settled_s: float = Field(gt=0)


class RecordedUr10eParameters(Parameters):
    """Parameters of the recorded UR10e.

    Attributes:
        rest: log in which the arm stands still; gains come from it. None: from the motion learned from.
        train: log that models learn from, without load.
        test: the log that they are asked about; all others without load are asked about too.
        load_pairs: logs of the same motion without and with the load. Where logs are missing, others take
            their place: see `ur10e_logs.logs_that_are_there`.
        load_kg: what the load weighs.
        assumed_gains: number of a joint that shows no gain at rest, and of the one whose gain stands in.
        quoted_gains: N m/A, published beside the logs.
        rate_hz: of the clock.
        cutoff_hz: of the low-pass on all signals.
        rest_rad_s: the arm rests where no joint is faster.
        rest_s: rests from this length on end a motion.
        delays_s: first and last delay that is tried.
        delay_step_s: between them.
        intervals: see there.
        iterations: of L-BFGS for a structure.
        networks: see there.
        carried: see there.
        body_draws: fits for the intervals of inertias.
    """

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
