"""Numbers of the obstacle testbed that follow from what its stages wrote, and its metrics.

Everything is over the people of the test population, if a person is not named.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from structlearn.avoidance.learned_models import ALL, ENSEMBLE, NETWORK, SETTING
from structlearn.avoidance.shapes import SHAPES
from structlearn.core.artefacts import Metrics
from structlearn.core.params import Population
from structlearn.primitives.position import PositionPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.testbeds.obstacles.files import Evaluation
from structlearn.testbeds.obstacles.names import KINDS, SITUATIONS
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import (
    LIMITED,
    NO_MODEL,
    PAIR,
    PUBLISHED,
    TRAINED,
    UNSEEN,
    Situations,
    situations,
)
from structlearn.testbeds.obstacles.protocol.unrolled_reaches import Reach, SituationKey, reaches_by_situation
from structlearn.testbeds.obstacles.world.scenarios import Scenario

TEXT, OURS = (NETWORK, PUBLISHED), (ENSEMBLE, LIMITED)
"""Kind of model and rules of what avoids: as the text has it, and as this project does."""

FEW_HITS = 1  # of the unseen spheres, that a person's model may hit to be good


@dataclass(frozen=True)
class ObstacleResults:
    """Outputs of the stages of the testbed, and what follows from it."""

    found: Evaluation  # scores and paths of the unrolls, scores of the demonstrations
    errors: pd.DataFrame  # how well the models fit, see `avoidance_fits.learn`
    baselines: Mapping[int, PositionPrimitive]  # the unhindered reaches, by person
    scenarios: Sequence[Scenario]  # those of the demonstrations, in their order
    # by shape, of the setting `example_setting`, of the person that is shown
    demonstrations: Mapping[str, Sequence[Demonstration]]
    population: Population  # whose models are judged, and who is shown
    parameters: Mapping[str, Any]  # of the stages, by their keys in `params.yaml`

    @property
    def simulated(self) -> bool:
        """Whether any of the shown demonstrations was simulated."""
        return any(one.simulated for its in self.demonstrations.values() for one in its)

    @property
    def people(self) -> list[int]:
        """Seeds of those whose models are judged."""
        return list(self.population.test)

    @property
    def baseline(self) -> PositionPrimitive:
        """The unhindered reach of the person that is shown."""
        return self.baselines[self.population.shown]

    @cached_property
    def situations(self) -> dict[str, Situations]:
        """Those on the grid of spheres by their protocol, of the person that is shown."""
        tested = self.parameters["obstacle_evaluation"]
        cloud_count = self.parameters["obstacle_dataset"].cloud_count
        every = situations(self.scenarios, self.baseline, tested, cloud_count)
        return {one.protocol: one for one in every if one.protocol != TRAINED}

    @cached_property
    def demonstrated(self) -> pd.DataFrame:
        """Scores of the demonstrations."""
        return self._of_people(self.found.people)

    @cached_property
    def limited(self) -> pd.DataFrame:
        """Scores of every unroll with limits at the goal."""
        scores = self._of_people(self.found.scores)
        return scores[scores["rules"] == LIMITED]

    def rows(
        self,
        protocol: str,
        model: str = NO_MODEL,
        learned_from: str | Iterable[str] = "",
        rules: str = LIMITED,
        obstacle: str | None = None,
        person: int | None = None,
    ) -> pd.DataFrame:
        """Scores of one protocol and model, in their order."""
        sources = [learned_from] if isinstance(learned_from, str) else list(learned_from)
        keys = [(protocol, rules, model, source) for source in sources]
        none = self.found.scores.iloc[:0]
        found = pd.concat([self._by_model.get(key, none) for key in keys]).sort_index(kind="stable")
        mask = found["person"].isin(self.people if person is None else [person])
        return found[mask if obstacle is None else mask & (found["obstacle"] == obstacle)]

    def shown_rows(self, protocol: str) -> pd.DataFrame:
        """The same without avoidance, of the person that is shown."""
        return self.rows(protocol, person=self.population.shown)

    def hits(self, protocol: str, model: str = NO_MODEL, learned_from: str | Iterable[str] = "") -> int:
        """Number of hits with limits at the goal, of all people together."""
        return int(self.rows(protocol, model, learned_from)["hit"].sum())

    def hits_by_person(
        self, protocol: str, form: tuple[str, str], learned_from: str | Iterable[str]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Hits (P,) of each person with anything to show, and of how many reaches (P,).

        `form`: `TEXT`, `OURS`, or another kind of model and its rules.
        """
        kind, rules = form
        hits = self.rows(protocol, kind, learned_from, rules).groupby("person", sort=False)["hit"]
        return hits.sum().to_numpy(int), hits.size().to_numpy(int)

    @cached_property
    def fits(self) -> pd.DataFrame:
        """`errors` with `nmse_across`, the mean of y and z, and `nmse_worse`, the larger of both.

        x is never acted upon: the post-processing takes it away. Those of the person that is shown are among
        them.
        """
        across = self.errors[["nmse_y", "nmse_z"]]
        return self.errors.assign(nmse_across=across.mean(axis=1), nmse_worse=across.max(axis=1))

    def fit(self, model: str, learned_from: str, obstacle: str, part: str = "test") -> pd.DataFrame:
        """Rows of `fits` of a model that learned several scenarios, one per person, in their order."""
        fits = self._of_people(self.fits)
        mask = (fits["model"] == model) & (fits["learned_from"] == learned_from)
        return fits[mask & (fits["obstacle"] == obstacle) & (fits["part"] == part)]

    def fit_by_person(self, model: str, all_shapes: bool = False) -> np.ndarray:
        """Held-out `nmse_across` (P,), mean over shapes, of models of a shape each or of one of all."""
        rows = [self.fit(model, ALL if all_shapes else shape, shape)["nmse_across"] for shape in SHAPES]
        return np.mean(rows, axis=0)

    def shown_error(self, model: str) -> float:
        """Held-out error along the worse of y and z of a model of all shapes of the person that is shown."""
        fits = self.fits[(self.fits["person"] == self.population.shown) & (self.fits["part"] == "test")]
        return float(fits[(fits["model"] == model) & (fits["learned_from"] == ALL)]["nmse_worse"].max())

    def setting_fits(self, column: str, part: str) -> pd.DataFrame:
        """NMSE of models that learned one scenario: one row per scenario that has it, a column per model."""
        fits = self._of_people(self.fits)
        fits = fits[(fits["learned_from"] == SETTING) & (fits["part"] == part)]
        return fits.pivot_table(
            index=["person", "obstacle", "scenario"], columns="model", values=column
        ).dropna()

    @cached_property
    def dominant_scenarios(self) -> int:
        """How many scenarios, of those with a model of their own, have a dominant axis of avoidance."""
        return len(self.setting_fits("nmse_dominant", "test"))

    @cached_property
    def reaches(self) -> dict[SituationKey, list[Reach]]:
        """Every unroll with limits at the goal of the person that is shown."""
        scores = self.found.scores
        own = scores[scores["person"] == self.population.shown]
        return reaches_by_situation(self.found.paths, own, self.baseline)

    @cached_property
    def contenders(self) -> list[tuple[str, str]]:
        """Kind of every model that meets the spheres of the grid, with what it learned from."""
        pairs = [(kind, source) for kind in KINDS for source in ("", *SHAPES, ALL)]
        return [pair for pair in pairs if len(self.rows(UNSEEN, *pair))]

    @cached_property
    def _by_model(self) -> dict[tuple[str, ...], pd.DataFrame]:
        """Scores of everybody by protocol, rules, model and what it learned from."""
        groups = self.found.scores.groupby(["protocol", "rules", "model", "learned_from"], sort=False)
        return dict(iter(groups))

    def _of_people(self, table: pd.DataFrame) -> pd.DataFrame:
        return table[table["person"].isin(self.people)]


def example_setting(scores: pd.DataFrame, person: int) -> int:
    """The setting that a person's reach comes closest to without avoidance, averaged over the shapes."""
    own = scores[(scores["protocol"] == TRAINED) & (scores["person"] == person)]
    bare = own[own["model"] == NO_MODEL]
    return int(bare.groupby("scenario")["obstacle_distance"].mean().idxmin())


def metrics(results: ObstacleResults) -> Metrics:
    """The flat metrics of the testbed; all are over the people of the test population.

    `hits_unseen_<source>_worst_person` is the largest number of unseen spheres that anyone's model hits, and
    `..._share_of_people_within_1` the share of those who hit at most one: of this project's ensembles with
    limits at the goal, by the shape of the obstacles that they learned from, or `all`. `..._single_...` are
    those of the published form. `hits_<protocol>_baseline`, `_all` are sums over people without avoidance and
    with the ensemble of all shapes. `nmse_test_<source>` is the text's network's error on held-out
    demonstrations along the worse of y and z, the mean over people, `nmse_test_ensemble_<source>` likewise.
    Goal distances are the largest of all unrolls with limits at the goal, of every model in every situation,
    at the prescribed time and at 1.5 times it; `excursion_max_m` is the largest of networks and ensembles
    after the prescribed time. `detour_<protocol>_all_mean_m` is how far the hand goes from where it would be
    without avoidance.
    """
    limited = results.limited
    learned = limited[limited["model"].isin([NETWORK, ENSEMBLE])]
    own = results.rows(TRAINED, NETWORK, SETTING, PUBLISHED)
    values: Metrics = {
        "simulated": results.simulated,
        "people": len(results.people),
        "scenarios": len(results.scenarios),
        "demonstrations": len(results.demonstrated),
        "networks_per_ensemble": results.parameters["obstacle_training"].ensemble.members,
        "hits_per_setting": int(own["hit"].sum()),
        "networks_per_setting": len(own),
        "dominant_scenarios": results.dominant_scenarios,
        "goal_distance_max_m": limited["goal_distance_m"].max(),
        "late_goal_distance_max_m": limited["late_goal_distance_m"].max(),
        "excursion_max_m": learned["excursion_m"].max(),
    }
    for protocol in SITUATIONS:
        values[f"hits_{protocol}_baseline"] = results.hits(protocol)
        values[f"hits_{protocol}_all"] = results.hits(protocol, ENSEMBLE, ALL)
        values[f"detour_{protocol}_all_mean_m"] = results.rows(protocol, ENSEMBLE, ALL)["detour_m"].mean()
    for source in (*SHAPES, ALL):
        for form, word in ((OURS, ""), (TEXT, "_single")):
            hits, _ = results.hits_by_person(UNSEEN, form, source)
            values[f"hits_unseen_{source}{word}_worst_person"] = int(hits.max())
            values[f"hits_unseen_{source}{word}_share_of_people_within_1"] = float(np.mean(hits <= FEW_HITS))
        values[f"detour_{PAIR}_{source}_mean_m"] = results.rows(PAIR, ENSEMBLE, source)["detour_m"].mean()
        for kind, word in ((NETWORK, ""), (ENSEMBLE, "ensemble_")):
            worst = [
                results.fit(kind, source, shape)["nmse_worse"].mean()
                for shape in (SHAPES if source == ALL else (source,))
            ]
            values[f"nmse_test_{word}{source}"] = max(worst)
    return values
