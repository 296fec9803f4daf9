"""What figures show besides results: single reaches of this run, and the scene of the person shown."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd

from dissertation.obstacles.protocol.avoidance_protocols import (
    LIMITED,
    NO_MODEL,
    TRAINED,
    Situations,
    situations,
)
from dissertation.obstacles.protocol.unrolled_reaches import (
    Reach,
    SituationKey,
    of_model,
    reaches_by_situation,
)
from dissertation.obstacles.world.scenarios import Scenario
from structlearn.core.metrics import matching
from structlearn.core.params import Population
from structlearn.primitives.position import PositionPrimitive
from structlearn.readers.demonstration import Demonstration


@dataclass(frozen=True)
class Shown:
    """Reaches of this run."""

    scores: pd.DataFrame  # of every unroll, see `avoidance_protocols.evaluate`
    paths: pd.DataFrame  # shown person's unrolls with limits at the goal, see `avoidance_protocols.evaluate`
    demonstrated: pd.DataFrame  # of all people, see `avoidance_scores.demonstration_scores`
    baseline: PositionPrimitive  # reach without obstacle of the person shown
    scenarios: Sequence[Scenario]  # of the demonstrations, in order
    demonstrations: Mapping[str, Sequence[Demonstration]]  # shown person's in `setting`, by shape
    population: Population  # test people, and the person shown
    recorded_people: pd.DataFrame  # how they differ, see `claims.quoted_people`
    parameters: Mapping[str, Any]  # of the stages, keyed as in `params.yaml`

    @property
    def setting(self) -> int:
        """Setting that is shown."""
        return example_setting(self.scores, self.population.shown)

    @cached_property
    def situations(self) -> dict[str, Situations]:
        """Situations on the grid of spheres by protocol, for the person shown."""
        tested = self.parameters["obstacle_evaluation"]
        cloud_count = self.parameters["obstacle_dataset"].cloud_count
        every = situations(self.scenarios, self.baseline, tested, cloud_count)
        return {one.protocol: one for one in every if one.protocol != TRAINED}

    @cached_property
    def reaches(self) -> dict[SituationKey, list[Reach]]:
        """All unrolls with limits at the goal of the person shown."""
        own = matching(self.scores, person=self.population.shown)
        return reaches_by_situation(self.paths, own, self.baseline)

    def reach(self, situation: SituationKey, kind: str = NO_MODEL, learned_from: str = "") -> Reach:
        """One unroll of the person shown, with limits at the goal."""
        found = of_model(self.reaches[situation], kind)
        return next(reach for reach in found if reach.learned_from == learned_from)

    def rows(
        self,
        protocol: str,
        model: str = NO_MODEL,
        learned_from: str | Iterable[str] = "",
        person: int | None = None,
    ) -> pd.DataFrame:
        """Scores with limits at the goal of one protocol and model, of the test people or one person."""
        its = matching(self.scores, protocol=protocol, model=model, rules=LIMITED)
        its = its[its["person"].isin(self.population.test if person is None else [person])]
        sources = [learned_from] if isinstance(learned_from, str) else list(learned_from)
        return its[its["learned_from"].isin(sources)]


def example_setting(scores: pd.DataFrame, person: int) -> int:
    """Setting to which a person's reach without avoidance comes closest, averaged over shapes."""
    bare = matching(scores, protocol=TRAINED, person=person, model=NO_MODEL)
    return int(bare.groupby("scenario")["obstacle_distance"].mean().idxmin())
