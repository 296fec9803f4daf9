"""Numbers of the obstacle testbed: what its stages wrote, its CSV tables and its metrics."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from structlearn.avoidance.avoidance_dataset import AvoidanceDataParameters
from structlearn.avoidance.learned_models import ALL, HUMAN_INSPIRED, NETWORK, PHASE_MODULATED, SETTING
from structlearn.avoidance.shapes import SHAPES
from structlearn.ground.artefacts import Metrics
from structlearn.ground.metrics import mean_interval
from structlearn.primitives.position import PositionPrimitive
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.obstacles.protocol import avoidance_protocols
from structlearn.testbeds.obstacles.protocol.avoidance_fits import AvoidanceTrainingParameters
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import (
    GOAL_CHANGE,
    LIMITED,
    MOVING,
    NO_MODEL,
    PAIR,
    TRAINED,
    UNSEEN,
    AvoidanceEvaluationParameters,
    Situations,
)
from structlearn.testbeds.obstacles.world.reaching_person import AvoiderParameters
from structlearn.testbeds.obstacles.world.scenarios import Scenario, SceneParameters

KINDS = (NETWORK, PHASE_MODULATED, HUMAN_INSPIRED)
"""Kinds of models in the order of tables."""

FITS = {"nmse": "all three axes", "nmse_across": "y and z", "nmse_dominant": "dominant axis"}
"""Columns of `ObstacleResults.fits` and over what they are averaged."""

PATH_KEYS = ("protocol", "model", "learned_from")


@dataclass(frozen=True)
class ObstacleResults:
    """What the stages of the testbed wrote, and what follows from it.

    Attributes:
        scores: of every unroll, see `obstacles.protocols.evaluate`.
        paths: their paths with limits on the goal, see there.
        people: scores of the demonstrations, see `obstacles.protocols.demonstration_scores`.
        errors: how well the models fit, see `obstacles.learning.learn`.
        baseline: the unhindered reach.
        scenarios: those of the demonstrations, in their order.
        shown: by shape, demonstrations of the setting `example_setting`.
        scene: where obstacles stand.
        person: who demonstrates.
        data: how demonstrations became samples.
        training: how models were trained.
        evaluation: how they were put to the test.
    """

    scores: pd.DataFrame
    paths: pd.DataFrame
    people: pd.DataFrame
    errors: pd.DataFrame
    baseline: PositionPrimitive
    scenarios: Sequence[Scenario]
    shown: Mapping[str, Sequence[Demonstration]]
    scene: SceneParameters
    person: AvoiderParameters
    data: AvoidanceDataParameters
    training: AvoidanceTrainingParameters
    evaluation: AvoidanceEvaluationParameters

    @cached_property
    def simulated(self) -> bool:
        """Whether any of the shown demonstrations was simulated."""
        return any(one.simulated for its in self.shown.values() for one in its)

    @cached_property
    def situations(self) -> dict[str, Situations]:
        """Those on the grid of spheres by their protocol."""
        every = avoidance_protocols.situations(
            self.scenarios, self.baseline, self.evaluation, self.data.cloud_count
        )
        return {one.protocol: one for one in every if one.protocol != TRAINED}

    @cached_property
    def example_setting(self) -> int:
        """See the function of that name."""
        return example_setting(self.scores)

    @cached_property
    def fits(self) -> pd.DataFrame:
        """`errors` with `nmse_across`, the mean of y and z, and `nmse_worse`, the larger of both.

        x is never acted upon: the post-processing takes it away.
        """
        across = self.errors[["nmse_y", "nmse_z"]]
        return self.errors.assign(nmse_across=across.mean(axis=1), nmse_worse=across.max(axis=1))

    @cached_property
    def per_setting_fits(self) -> pd.DataFrame:
        """Those of models that learned one scenario."""
        return self.fits[self.fits["learned_from"] == SETTING]

    @cached_property
    def dominant_scenarios(self) -> int:
        """How many scenarios have a dominant axis of avoidance."""
        rows = self.per_setting_fits
        rows = rows[(rows["model"] == NETWORK) & (rows["part"] == "test")]
        return int((rows["dominant"] != "").sum())

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
        scores = self.scores
        mask = (scores["protocol"] == protocol) & (scores["rules"] == rules)
        mask &= (scores["model"] == model) & scores["learned_from"].isin(sources)
        return scores[mask if obstacle is None else mask & (scores["obstacle"] == obstacle)]

    def hits(self, protocol: str, model: str = NO_MODEL, learned_from: str | Iterable[str] = "") -> int:
        """Number of hits with limits on the goal."""
        return int(self.rows(protocol, model, learned_from)["hit"].sum())

    def fit(self, model: str, learned_from: str, obstacle: str, part: str = "test") -> pd.Series:
        """Row of `fits` of a model that learned several scenarios."""
        fits = self.fits
        mask = (fits["model"] == model) & (fits["learned_from"] == learned_from)
        return fits[mask & (fits["obstacle"] == obstacle) & (fits["part"] == part)].iloc[0]

    def fit_gain(self, column: str, part: str) -> tuple[float, float]:
        """NMSE of Rai et al. minus that of the network, scenario by scenario.

        Returns:
            Its mean and half the width of its 95 % interval over scenarios.
        """
        rows = self.per_setting_fits[self.per_setting_fits["part"] == part]
        keys = ["obstacle", "scenario"]
        wide = rows.pivot_table(index=keys, columns="model", values=column).dropna()
        return mean_interval((wide[HUMAN_INSPIRED] - wide[NETWORK]).to_numpy())

    @cached_property
    def limited(self) -> pd.DataFrame:
        """Scores of every unroll whose deviation from the goal was limited."""
        return self.scores[self.scores["rules"] == LIMITED]

    @cached_property
    def excursions(self) -> pd.Series:
        """Largest distance in m from the goal after the prescribed time, by protocol, model and learned from.

        Of paths with limits: these hold at the prescribed time and once more later, not between.
        """
        after = self.paths[self.paths["time_s"] >= self.baseline.duration]
        away = np.empty(len(after))
        for protocol in after["protocol"].unique():
            change = self.situations[protocol].goal_change if protocol in self.situations else None
            goal = self.baseline.goal if change is None else np.reshape(change.goals, (-1, 3))[0]
            mask = (after["protocol"] == protocol).to_numpy()
            away[mask] = np.linalg.norm(after.loc[mask, ["x_m", "y_m", "z_m"]] - goal, axis=1)
        return pd.Series(away).groupby([after[key].to_numpy() for key in PATH_KEYS]).max()

    def excursion(self, protocol: str, model: str, learned_from: str | Iterable[str] = "") -> float:
        """The largest of `excursions` in m."""
        sources = [learned_from] if isinstance(learned_from, str) else list(learned_from)
        return float(self.excursions.loc[(protocol, model)].loc[sources].max())

    @cached_property
    def detours(self) -> pd.DataFrame:
        """How far avoidance takes the hand from where it would be without, m, until the prescribed time.

        Returns:
            `mean` and `max` over situations of the largest distance of each unroll with limits, indexed by
            protocol, model and learned from.
        """
        during = self.paths[self.paths["time_s"] <= self.baseline.duration]
        place = ["protocol", "obstacle", "scenario", "speed_m_s"]
        position = ["x_m", "y_m", "z_m"]
        bare = during["model"] == NO_MODEL
        without = during[bare].set_index([*place, "time_s"])[position]
        others = during[~bare]
        where = pd.MultiIndex.from_frame(others[[*place, "time_s"]])
        away = np.linalg.norm(others[position].to_numpy() - without.loc[where].to_numpy(), axis=1)
        keys = list(dict.fromkeys([*PATH_KEYS, *place]))
        largest = pd.Series(away).groupby([others[key].to_numpy() for key in keys]).max()
        return largest.groupby(level=[0, 1, 2]).agg(["mean", "max"])

    @cached_property
    def contenders(self) -> list[tuple[str, str]]:
        """Kind of every model that meets the spheres of the grid, with what it learned from."""
        unseen = self.limited[self.limited["protocol"] == UNSEEN]
        there = set(zip(unseen["model"], unseen["learned_from"], strict=True))
        pairs = [(NO_MODEL, ""), *((kind, source) for kind in KINDS for source in (*SHAPES, ALL))]
        return [pair for pair in pairs if pair in there]


def example_setting(scores: pd.DataFrame) -> int:
    """The setting that the reach without avoidance comes closest to, meant over the shapes."""
    bare = scores[(scores["protocol"] == TRAINED) & (scores["model"] == NO_MODEL)]
    return int(bare.groupby("scenario")["obstacle_distance"].mean().idxmin())


def metrics(results: ObstacleResults) -> Metrics:
    """The flat metrics of the testbed.

    `hits_trained_<shape>` and `hits_unseen_<shape>` are of the network that learned from all settings with
    that shape, on these and on the unseen spheres; `nmse_test_<shape>` is its error on held-out
    demonstrations along the worse of y and z. `<...>_all` are of the network of all shapes. All hits and goal
    distances are those with limits on the goal; `goal_distance_max_m` and `late_goal_distance_max_m` are the
    largest of all such unrolls, of every model in every situation, at the prescribed time and at 1.5 times
    it. `excursion_max_m` is the largest distance from the goal of a network between these two times.
    `detour_<protocol>_all_mean_m` is how far the hand goes from where it would be without avoidance.
    """
    values: Metrics = {
        "simulated": results.simulated,
        "scenarios": len(results.scenarios),
        "demonstrations": len(results.people),
        "hits_trained_baseline": results.hits(TRAINED),
        "hits_per_setting": results.hits(TRAINED, NETWORK, SETTING),
    }
    for shape in (*SHAPES, ALL):
        values[f"hits_trained_{shape}"] = results.hits(TRAINED, NETWORK, shape)
    values["hits_unseen_baseline"] = results.hits(UNSEEN)
    for shape in (*SHAPES, ALL):
        values[f"hits_unseen_{shape}"] = results.hits(UNSEEN, NETWORK, shape)
    for protocol in (MOVING, PAIR, GOAL_CHANGE):
        values[f"hits_{protocol}_baseline"] = results.hits(protocol)
        values[f"hits_{protocol}_all"] = results.hits(protocol, NETWORK, ALL)
    for shape in SHAPES:
        values[f"nmse_test_{shape}"] = results.fit(NETWORK, shape, shape)["nmse_worse"]
    values["nmse_test_all"] = max(results.fit(NETWORK, ALL, shape)["nmse_worse"] for shape in SHAPES)
    values["dominant_scenarios"] = results.dominant_scenarios
    for column in ("goal_distance", "late_goal_distance"):
        values[f"{column}_max_m"] = results.limited[f"{column}_m"].max()
    values["detour_unseen_all_mean_m"] = results.detours.loc[(UNSEEN, NETWORK, ALL), "mean"]
    values["detour_pair_all_mean_m"] = results.detours.loc[(PAIR, NETWORK, ALL), "mean"]
    values["excursion_max_m"] = results.excursions.xs(NETWORK, level=1).max()
    return values
