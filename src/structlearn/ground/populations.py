"""Populations: the people, sensors, robots or scenes that a result is over, by their seeds.

Constants are chosen on some and judged on others; `params.yaml` names both, and no seed may be in both.
"""

from typing import Annotated

from pydantic import Field, NonNegativeInt, model_validator

from structlearn.ground.params import Parameters

Seeds = Annotated[list[NonNegativeInt], Field(min_length=1)]


class Population(Parameters):
    """Seeds of a testbed's population: constants were chosen on `tuning`, verdicts rest on `test`.

    The first of `tuning` is who recordings and first figures show.
    """

    tuning: Seeds
    test: Seeds

    @model_validator(mode="after")
    def _are_apart(self) -> "Population":
        for name in ("tuning", "test"):
            seeds = getattr(self, name)
            if len(set(seeds)) < len(seeds):
                raise ValueError(f"a seed of `{name}` stands twice: {seeds}")
        if shared := sorted(set(self.tuning) & set(self.test)):
            raise ValueError(f"seeds {shared} are in `tuning` and in `test`: nothing may be judged on them")
        return self

    @property
    def shown(self) -> int:
        """Seed of the one that recordings and first figures show."""
        return self.tuning[0]
