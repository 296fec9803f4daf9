"""Numbers of the obstacle testbed that follow from what its stages wrote, and its metrics."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd

from structlearn.avoidance.learned_models import ALL, NETWORK, SETTING
from structlearn.avoidance.shapes import SHAPES
from structlearn.ground.artefacts import Metrics
from structlearn.primitives.position import PositionPrimitive
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.obstacles.files import Evaluation
from structlearn.testbeds.obstacles.names import KINDS, SITUATIONS
from structlearn.testbeds.obstacles.protocol import path_scores
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import (
    LIMITED,
    NO_MODEL,
    PAIR,
    TRAINED,
    UNSEEN,
    Situations,
    situations,
)
from structlearn.testbeds.obstacles.protocol.unrolled_reaches import Reach, SituationKey, reaches_by_situation
from structlearn.testbeds.obstacles.world.scenarios import Scenario


@dataclass(frozen=True)
class ObstacleResults:
    """What the stages of the testbed wrote, and what follows from it.

    Attributes:
        found: scores and paths of the unrolls, scores of the demonstrations.
        errors: how well the models fit, see `avoidance_fits.learn`.
        baseline: the unhindered reach.
        scenarios: those of the demonstrations, in their order.
        shown: by shape, demonstrations of the setting `example_setting`.
        parameters: of the stages, by their keys in `params.yaml`.
    """

    found: Evaluation
    errors: pd.DataFrame
    baseline: PositionPrimitive
    scenarios: Sequence[Scenario]
    shown: Mapping[str, Sequence[Demonstration]]
    parameters: Mapping[str, Any]

    @property
    def simulated(self) -> bool:
        """Whether any of the shown demonstrations was simulated."""
        return any(one.simulated for its in self.shown.values() for one in its)

    @property
    def members(self) -> int:
        """How many networks' mean the network of a shape is; the dissertation's is a single one."""
        return self.parameters["obstacle_training"].per_shape.members

    @cached_property
    def situations(self) -> dict[str, Situations]:
        """Those on the grid of spheres by their protocol."""
        tested = self.parameters["obstacle_evaluation"]
        cloud_count = self.parameters["obstacle_dataset"].cloud_count
        every = situations(self.scenarios, self.baseline, tested, cloud_count)
        return {one.protocol: one for one in every if one.protocol != TRAINED}

    @cached_property
    def fits(self) -> pd.DataFrame:
        """`errors` with `nmse_across`, the mean of y and z, and `nmse_worse`, the larger of both.

        x is never acted upon: the post-processing takes it away.
        """
        across = self.errors[["nmse_y", "nmse_z"]]
        return self.errors.assign(nmse_across=across.mean(axis=1), nmse_worse=across.max(axis=1))

    def rows(
        self,
        protocol: str,
        model: str = NO_MODEL,
        learned_from: str | Iterable[str] = "",
        rules: str = LIMITED,
        obstacle: str | None = None,
    ) -> pd.DataFrame:
        """Scores of one protocol and model, in their order."""
        sources = [learned_from] if isinstance(learned_from, str) else list(learned_from)
        scores = self.found.scores
        mask = (scores["protocol"] == protocol) & (scores["rules"] == rules)
        mask &= (scores["model"] == model) & scores["learned_from"].isin(sources)
        return scores[mask if obstacle is None else mask & (scores["obstacle"] == obstacle)]

    def hits(self, protocol: str, model: str = NO_MODEL, learned_from: str | Iterable[str] = "") -> int:
        """Number of hits with limits at the goal."""
        return int(self.rows(protocol, model, learned_from)["hit"].sum())

    def fit(self, model: str, learned_from: str, obstacle: str, part: str = "test") -> pd.Series:
        """Row of `fits` of a model that learned several scenarios."""
        fits = self.fits
        mask = (fits["model"] == model) & (fits["learned_from"] == learned_from)
        return fits[mask & (fits["obstacle"] == obstacle) & (fits["part"] == part)].iloc[0]

    def setting_fits(self, column: str, part: str) -> pd.DataFrame:
        """NMSE of models that learned one scenario: one row per scenario that has it, a column per model."""
        fits = self.fits[(self.fits["learned_from"] == SETTING) & (self.fits["part"] == part)]
        return fits.pivot_table(index=["obstacle", "scenario"], columns="model", values=column).dropna()

    @cached_property
    def dominant_scenarios(self) -> int:
        """How many scenarios have a dominant axis of avoidance."""
        return len(self.setting_fits("nmse_dominant", "test"))

    @cached_property
    def limited(self) -> pd.DataFrame:
        """Scores of every unroll with limits at the goal."""
        return self.found.scores[self.found.scores["rules"] == LIMITED]

    @cached_property
    def reaches(self) -> dict[SituationKey, list[Reach]]:
        """Every unroll with limits at the goal."""
        return reaches_by_situation(self.found.paths, self.found.scores, self.baseline)

    @cached_property
    def excursions(self) -> pd.Series:
        """See `path_scores.excursions`; of the limits at the goal, which do not hold in between."""
        return path_scores.excursions(self.found.paths, self.baseline, self.situations)

    @cached_property
    def detours(self) -> pd.DataFrame:
        """See `path_scores.detours`."""
        return path_scores.detours(self.found.paths, self.baseline)

    @cached_property
    def contenders(self) -> list[tuple[str, str]]:
        """Kind of every model that meets the spheres of the grid, with what it learned from."""
        pairs = [(kind, source) for kind in KINDS for source in ("", *SHAPES, ALL)]
        return [pair for pair in pairs if len(self.rows(UNSEEN, *pair))]


def example_setting(scores: pd.DataFrame) -> int:
    """The setting that the reach without avoidance comes closest to, averaged over the shapes."""
    bare = scores[(scores["protocol"] == TRAINED) & (scores["model"] == NO_MODEL)]
    return int(bare.groupby("scenario")["obstacle_distance"].mean().idxmin())


def metrics(results: ObstacleResults) -> Metrics:
    """The flat metrics of the testbed.

    `hits_trained_<shape>` and `hits_unseen_<shape>` are of the network that learned from all settings with
    that shape, on these and on the unseen spheres; `nmse_test_<shape>` is its error on held-out
    demonstrations along the worse of y and z. `<...>_all` are of the network of all shapes. All hits and goal
    distances are those with limits at the goal; `goal_distance_max_m` and `late_goal_distance_max_m` are the
    largest of all such unrolls, of every model in every situation, at the prescribed time and at 1.5 times
    it. `excursion_max_m` is the largest distance from the goal of a network between these two times.
    `detour_<protocol>_all_mean_m` is how far the hand goes from where it would be without avoidance.
    """
    values: Metrics = {
        "simulated": results.simulated,
        "scenarios": len(results.scenarios),
        "demonstrations": len(results.found.people),
        "networks_per_shape": results.members,
        "hits_per_setting": results.hits(TRAINED, NETWORK, SETTING),
        "dominant_scenarios": results.dominant_scenarios,
        "goal_distance_max_m": results.limited["goal_distance_m"].max(),
        "late_goal_distance_max_m": results.limited["late_goal_distance_m"].max(),
        "excursion_max_m": results.excursions.xs(NETWORK, level=1).max(),
    }
    for protocol in SITUATIONS:
        values[f"hits_{protocol}_baseline"] = results.hits(protocol)
        for source in (*SHAPES, ALL) if protocol in (TRAINED, UNSEEN) else (ALL,):
            values[f"hits_{protocol}_{source}"] = results.hits(protocol, NETWORK, source)
    for protocol in (UNSEEN, PAIR):
        values[f"detour_{protocol}_all_mean_m"] = results.detours.loc[(protocol, NETWORK, ALL), "mean"]
    worst = {source: [results.fit(NETWORK, source, source)["nmse_worse"]] for source in SHAPES}
    worst[ALL] = [results.fit(NETWORK, ALL, shape)["nmse_worse"] for shape in SHAPES]
    return values | {f"nmse_test_{source}": max(errors) for source, errors in worst.items()}
