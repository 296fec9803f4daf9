"""Parameters of a simulated planar arm with known parts of the torque; whole logs are left out."""

from collections.abc import Mapping
from typing import Literal

from pydantic import Field, PositiveFloat

from structlearn.readers.source import SourceParameters
from structlearn.tasks.motion.parameters import Log

# Protocols: leave out the logs that the set's authors did, or as many at random
AUTHORS, RANDOM = "authors", "random"


class PartsParameters(SourceParameters):
    """Logs of the arm, and the models that are compared."""

    kind = __package__

    left_out: tuple[Log, ...] = Field(min_length=1)
    published: Mapping[str, PositiveFloat]
    seeds: int = Field(ge=2)
    splits: int = Field(ge=2)
    hidden: Mapping[Literal["mlp", "delan"], tuple[int, ...]]
    epochs: int = Field(ge=1)
    rate: float = Field(gt=0)
    batch: int = Field(ge=1)
    second_moment_decay: float = Field(gt=0, lt=1)
    iterations: int = Field(ge=1)


Entry = PartsParameters
