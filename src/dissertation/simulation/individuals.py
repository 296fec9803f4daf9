"""People, robots and sensors that differ: constants drawn once for each, about those of `params.yaml`.

A value in `params.yaml` is the population's median. `between` names the constants that differ between
individuals, by how much, and how that is known. A draw depends only on the individual's seed and the
constant's name, so a further constant that differs changes no other.
"""

from typing import Literal, TypeVar
from zlib import crc32

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from structlearn.core.params import Parameters

FARTHEST = 2.0  # std; draws beyond are clipped, so that nobody is impossible


class Spread(Parameters):
    """How a constant differs between individuals."""

    std: float = Field(gt=0)  # between individuals
    of: Literal["log", "value"]  # std of the constant's log, or of the constant in its own unit
    source: str  # of this number


class Individual(Parameters):
    """Constants of a person, robot or sensor."""

    between: dict[str, Spread]  # what differs between individuals; of several values, all by one factor

    @model_validator(mode="after")
    def _knows_what_differs(self) -> "Individual":
        if unknown := sorted(set(self.between) - set(type(self).model_fields)):
            raise ValueError(f"between: there is no constant {', '.join(unknown)}")
        for name in self.between:
            if not np.issubdtype(np.asarray(getattr(self, name)).dtype, np.number):
                raise ValueError(f"between: {name} is not a number")
        return self


IndividualType = TypeVar("IndividualType", bound=Individual)


def drawn(population: IndividualType, seed: int) -> IndividualType:
    """Constants of the individual with this seed, which is its `seed` too; `between` is empty.

    Raises pydantic.ValidationError: a drawn constant is out of its range, so that its spread is too large.
    """
    model, values = type(population), population.model_dump()
    for name, spread in population.between.items():
        values[name] = _drawn(values[name], spread, name, seed)
    own = {"seed": seed} if "seed" in model.model_fields else {}
    return model.model_validate(values | own | {"between": {}})


def differences(population: Individual) -> pd.DataFrame:
    """What differs between individuals: `parameter`, `median`, `lowest`, `highest` and `source`, a row each.

    Of several values that share a factor, the first.
    """
    rows = []
    for name, spread in population.between.items():
        median = float(np.ravel(getattr(population, name))[0])
        lowest, highest = (_changed(median, spread, sign * FARTHEST) for sign in (-1.0, 1.0))
        rows.append((name, median, float(lowest), float(highest), spread.source))
    return pd.DataFrame(rows, columns=["parameter", "median", "lowest", "highest", "source"])


def _drawn(median: float | tuple[float, ...], spread: Spread, name: str, seed: int) -> float | list[float]:
    score = np.random.default_rng([seed, crc32(name.encode())]).standard_normal()
    return _changed(median, spread, np.clip(score, -FARTHEST, FARTHEST)).tolist()


def _changed(median: float | tuple[float, ...], spread: Spread, score: float) -> np.ndarray:
    """Value(s) of an individual so many std above the median."""
    change = spread.std * score
    return np.multiply(median, np.exp(change)) if spread.of == "log" else np.add(median, change)
