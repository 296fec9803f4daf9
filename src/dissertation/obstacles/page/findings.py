"""Findings of the obstacle testbed, over the people of the test population.

The dissertation's statements are tested on its own form: single networks with its rules (`AS_PUBLISHED`).
Ensembles with limits at the goal (`OURS`) are evidence for this project's claims. Rates are clustered by
person, errors are means over people, differences are paired by person. The study `obstacles/people` adds
people to those of this run: errors of their models, and sums and extremes over their reaches.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dissertation.evidence.studies import Study, extended
from dissertation.obstacles.names import KINDS, SITUATIONS
from dissertation.obstacles.protocol.avoidance_protocols import (
    GOAL_CHANGE,
    LIMITED,
    NO_MODEL,
    PAIR,
    PUBLISHED,
    TRAINED,
    UNSEEN,
    Situations,
    situations,
)
from dissertation.obstacles.protocol.unrolled_reaches import Reach, SituationKey, reaches_by_situation
from dissertation.obstacles.world.scenarios import Scenario
from structlearn.avoidance.learned_models import (
    ALL,
    ENSEMBLE,
    HUMAN_INSPIRED,
    NETWORK,
    PHASE_MODULATED,
    SETTING,
)
from structlearn.avoidance.shapes import SHAPES
from structlearn.core.metrics import matching
from structlearn.core.params import Population, read_values
from structlearn.primitives.position import PositionPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.reporting.evidence import Evidence
from structlearn.reporting.findings import Findings

AS_PUBLISHED, OURS = (NETWORK, PUBLISHED), (ENSEMBLE, LIMITED)
"""Kind of model and rules: as published, and our variant."""

PEOPLE_STUDY = "obstacles/people"  # further people, pooled in the verdicts
EVERY = (*SHAPES, ALL)
FEW_HITS = 1  # unseen spheres that a person's model may hit to count as good
PARTS = {"learned from": "train", "held out": "test"}
MODEL = ["protocol", "rules", "model", "learned_from"]
Sources = str | Iterable[str]  # what models learned from


@lru_cache
def read_published() -> Mapping[str, Any]:
    """Values printed in the dissertation, from `published.yaml`."""
    return read_values(Path(__file__).with_name("published.yaml"))


@dataclass(frozen=True)
class ObstacleResults:
    """Outputs of the testbed's stages, with selections from them."""

    scores: pd.DataFrame  # of every unroll, see `avoidance_protocols.evaluate_avoidance`
    # shown person's unrolls with limits at the goal, see `avoidance_protocols.evaluate_avoidance`
    paths: pd.DataFrame
    demonstration_scores: pd.DataFrame  # of all people, see `avoidance_scores.demonstration_scores`
    errors: pd.DataFrame  # of the models, see `avoidance_fits.learn_avoidance`
    baselines: Mapping[int, PositionPrimitive]  # reaches without obstacle, by person
    scenarios: Sequence[Scenario]  # of the demonstrations, in order
    demonstrations: Mapping[str, Sequence[Demonstration]]  # shown person's in `example_setting`, by shape
    population: Population  # test people, and the person shown
    parameters: Mapping[str, Any]  # of the stages, keyed as in `params.yaml`
    study: Study | None = None  # of further people; None if it was not run with these parameters

    @cached_property
    def people(self) -> list[int]:
        """Seeds of the test people, including the study's."""
        return self.by_person["person"].unique().tolist()

    @cached_property
    def by_person(self) -> pd.DataFrame:
        """`reaches_by_person` of the test people, including the study's."""
        scores = self.scores[self.scores["person"].isin(self.population.test)]
        own = reaches_by_person(scores, read_published()["per_setting"][NETWORK]["goal_max"])
        return extended(own, self.study, "by_person", "person")

    @property
    def baseline(self) -> PositionPrimitive:
        """Reach without obstacle of the person shown."""
        return self.baselines[self.population.shown]

    @cached_property
    def situations(self) -> dict[str, Situations]:
        """Situations on the grid of spheres by protocol, for the person shown."""
        tested = self.parameters["obstacle_evaluation"]
        cloud_count = self.parameters["obstacle_dataset"].cloud_count
        every = situations(self.scenarios, self.baseline, tested, cloud_count)
        return {one.protocol: one for one in every if one.protocol != TRAINED}

    @cached_property
    def demonstrated(self) -> pd.DataFrame:
        """Demonstration scores of the test people."""
        return self._of_people(self.demonstration_scores)

    def rows(
        self,
        protocol: str,
        model: str = NO_MODEL,
        learned_from: Sources = "",
        rules: str = LIMITED,
        obstacle: str | None = None,
        person: int | None = None,
    ) -> pd.DataFrame:
        """Scores of one protocol and model for people of this run, in table order."""
        its = _of_model(self.scores, protocol, model, learned_from, rules)
        its = its[its["person"].isin(self.people if person is None else [person])]
        return its if obstacle is None else its[its["obstacle"] == obstacle]

    def reached(
        self, protocol: str, model: str = NO_MODEL, learned_from: Sources = "", rules: str = LIMITED
    ) -> pd.DataFrame:
        """Rows of `by_person` of one protocol and model."""
        return _of_model(self.by_person, protocol, model, learned_from, rules)

    def hits(self, protocol: str, model: str = NO_MODEL, learned_from: Sources = "") -> int:
        """Number of hits over all people, with limits at the goal."""
        return int(self.reached(protocol, model, learned_from)["hits"].sum())

    def hits_by_person(
        self, protocol: str, form: tuple[str, str], learned_from: Sources
    ) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of hits (P,) and reaches (P,) by person, for a kind of model and its rules."""
        kind, rules = form
        by = self.reached(protocol, kind, learned_from, rules).groupby("person", sort=False)
        return by["hits"].sum().to_numpy(int), by["reaches"].sum().to_numpy(int)

    @cached_property
    def fits(self) -> pd.DataFrame:
        """`errors` with the study's rows, `nmse_across` and `nmse_worse` (mean and maximum of y and z)."""
        errors = extended(self.errors, self.study, "errors", "person")
        across = errors[["nmse_y", "nmse_z"]]
        return errors.assign(nmse_across=across.mean(axis=1), nmse_worse=across.max(axis=1))

    def fit(self, model: str, learned_from: str, obstacle: str, part: str = "test") -> pd.DataFrame:
        """Rows of `fits` of a model trained on several scenarios, one per person."""
        keys = {"model": model, "learned_from": learned_from, "obstacle": obstacle, "part": part}
        return matching(self._of_people(self.fits), **keys)

    def fit_by_person(self, model: str, all_shapes: bool = False) -> np.ndarray:
        """Held-out `nmse_across` (P,), mean over shapes, of models of one shape each or of all shapes."""
        rows = [self.fit(model, ALL if all_shapes else shape, shape)["nmse_across"] for shape in SHAPES]
        return np.mean(rows, axis=0)

    def setting_fits(self, column: str, part: str) -> pd.DataFrame:
        """NMSE of models trained on one scenario: rows are scenarios with such models, columns models."""
        fits = matching(self._of_people(self.fits), learned_from=SETTING, part=part)
        wide = fits.pivot_table(index=["person", "obstacle", "scenario"], columns="model", values=column)
        return wide.reindex(columns=[NETWORK, HUMAN_INSPIRED]).dropna()

    @cached_property
    def reaches(self) -> dict[SituationKey, list[Reach]]:
        """All unrolls with limits at the goal of the person shown."""
        own = self.scores[self.scores["person"] == self.population.shown]
        return reaches_by_situation(self.paths, own, self.baseline)

    @cached_property
    def contenders(self) -> list[tuple[str, str]]:
        """Kind and source of the models tested on the grid of spheres."""
        pairs = [(kind, source) for kind in KINDS for source in ("", *EVERY)]
        return [pair for pair in pairs if len(self.rows(UNSEEN, *pair))]

    def _of_people(self, table: pd.DataFrame) -> pd.DataFrame:
        return table[table["person"].isin(self.people)]


def _of_model(
    table: pd.DataFrame, protocol: str, model: str, learned_from: Sources, rules: str
) -> pd.DataFrame:
    """Rows of one protocol, kind of model, one or several sources, and rules."""
    its = matching(table, protocol=protocol, model=model, rules=rules)
    return its[its["learned_from"].isin([learned_from] if isinstance(learned_from, str) else learned_from)]


def reaches_by_person(scores: pd.DataFrame, farthest_m: float) -> pd.DataFrame:
    """Sums and extremes of `avoidance_protocols.evaluate_avoidance` over each person's reaches by model.

    Columns: `person`, `MODEL`; numbers of `reaches`, `hits` and reaches ending `far`, i.e. more than
    `farthest_m` from the goal; largest distances from the goal in m; means of `detour_m` and `restrained`.
    """
    by = scores.assign(far=scores["goal_distance_m"] > farthest_m).groupby(["person", *MODEL], sort=False)
    largest = by[["goal_distance_m", "late_goal_distance_m", "excursion_m"]].max()
    counts = by[["hit", "far"]].sum().rename(columns={"hit": "hits"}).astype(int)
    means = by[["detour_m", "restrained"]].mean()
    return pd.concat([by.size().rename("reaches"), counts, largest, means], axis=1).reset_index()


def example_setting(scores: pd.DataFrame, person: int) -> int:
    """Setting to which a person's reach without avoidance comes closest, averaged over shapes."""
    own = scores[(scores["protocol"] == TRAINED) & (scores["person"] == person)]
    bare = own[own["model"] == NO_MODEL]
    return int(bare.groupby("scenario")["obstacle_distance"].mean().idxmin())


def findings(results: ObstacleResults, published: Mapping[str, Any]) -> Findings:
    """All findings of the page.

    `hits_unseen_<source>_worst_person`: most unseen spheres hit by anyone's ensemble, by what it learned
    from; `..._share_of_people_within_1`: share of people whose ensemble hits at most one; `..._single_...`:
    the same for the published form. `hits_<protocol>_baseline` and `hits_all_shapes_<protocol>` are sums over
    people, without avoidance and with the ensemble of all shapes.
    """
    find = Findings(f"{len(results.people)} simulated people on whom nothing was tuned")
    find.exact("people", len(results.people), headline=True)
    find.exact("people_of_this_run", len(results.population.test))
    find.exact("scenarios", len(results.scenarios))
    find.exact("demonstrations", len(results.demonstrated))
    find.exact("networks_per_ensemble", results.parameters["obstacle_training"].ensemble.members)
    _fits(results, find, published["largest_nmse"])
    _hits(results, find)
    _goals(results, find)
    shown = find.among(f"person {results.population.shown}, on whom constants were tuned")
    keys = ["person", "part", "learned_from", "model"]
    worst = results.fits.groupby(keys)["nmse_worse"].max().loc[results.population.shown, "test", ALL]
    for name, kind in (("modulated", PHASE_MODULATED), ("not_modulated", NETWORK)):
        shown.exact(f"nmse_shown_{name}", worst[kind])
    return find


def _fits(results: ObstacleResults, find: Findings, largest_nmse: float) -> None:
    """Add errors of the coupling term."""
    own = results.setting_fits("nmse_dominant", "test")
    fits = results.fits[results.fits["person"].isin(results.people)]
    fits = matching(fits, part="test", learned_from=SETTING, model=NETWORK)
    find.exact("dominant_scenarios", len(own))
    find.exact("nmse_dominant", fits["nmse_dominant"].mean(), len(own))
    find.exact("nmse_without_dominant", fits.loc[fits["dominant"] == "", "nmse_across"].mean())
    find.exact("nmse_along_x", fits["nmse_x"].mean(), len(fits))
    for low_name, worse, column in (
        ("low_errors", "rai_fits_worse", "nmse"),
        ("low_dominant", "rai_dominant", "nmse_dominant"),
    ):
        errors = {words: results.setting_fits(column, part) for words, part in PARTS.items()}
        low = {words: (its[NETWORK] <= largest_nmse).groupby(level="person") for words, its in errors.items()}
        counts = {words: (by.sum().to_numpy(int), by.size().to_numpy(int)) for words, by in low.items()}
        find.clustered_share(low_name, counts)
        means = {words: its.groupby(level="person").mean() for words, its in errors.items()}
        find.difference(worse, {words: (its[HUMAN_INSPIRED], its[NETWORK]) for words, its in means.items()})
    find.mean("rai_across_settings", results.fit_by_person(HUMAN_INSPIRED))
    per_shape = {shape: results.fit(NETWORK, shape, shape) for shape in SHAPES}
    errors = {f"{shape}, {axis}": its[f"nmse_{axis}"] for shape, its in per_shape.items() for axis in "yz"}
    find.mean("error_per_shape", errors)
    for kind, word in ((NETWORK, "single"), (ENSEMBLE, "ensemble")):
        apart, together = (results.fit_by_person(kind, every) for every in (False, True))
        find.difference(f"{word}_of_all_shapes", together, apart)
        for source in EVERY:
            shapes = SHAPES if source == ALL else (source,)
            worst = [results.fit(kind, source, shape)["nmse_worse"].mean() for shape in shapes]
            find.exact(f"nmse_test_{'' if kind == NETWORK else 'ensemble_'}{source}", max(worst))


def _hits(results: ObstacleResults, find: Findings) -> None:
    """Add hits of obstacles, and detours."""
    hits, sizes = results.hits_by_person(TRAINED, AS_PUBLISHED, SETTING)
    find.exact("reaches_hit_per_setting", hits.sum(), headline=True)
    find.exact("networks_per_setting", sizes.sum())
    find.clustered_share("hits_per_setting", hits, sizes)
    rai = results.hits_by_person(TRAINED, (HUMAN_INSPIRED, PUBLISHED), SETTING)
    find.clustered_share("hits_of_rai", *rai)
    for form, word, sources in ((AS_PUBLISHED, "single_", SHAPES), (OURS, "", EVERY)):
        for protocol, name in ((TRAINED, "per_shape"), (UNSEEN, "unseen")):
            cases = {source: results.hits_by_person(protocol, form, source) for source in sources}
            find.clustered_share(f"{word}hits_{name}", cases)
    for protocol in SITUATIONS:
        count = results.reached(protocol)["reaches"].sum()
        find.exact(f"hits_{protocol}_baseline", results.hits(protocol), count, headline=protocol == UNSEEN)
        find.exact(f"hits_all_shapes_{protocol}", results.hits(protocol, ENSEMBLE, ALL), count)
        ours = results.reached(protocol, ENSEMBLE, ALL)  # the same number of reaches for each person
        name, detour = f"detour_{protocol}_all_mean_m", ours["detour_m"].mean()
        find.exact(name, detour, ours["reaches"].sum(), unit="m", headline=protocol == PAIR)
    within = {}
    for source in EVERY:
        for form, word in ((OURS, ""), (AS_PUBLISHED, "_single")):
            by_person, _ = results.hits_by_person(UNSEEN, form, source)
            people, few = len(by_person), int((by_person <= FEW_HITS).sum())
            stem, ours = f"hits_unseen_{source}{word}", form == OURS
            find.exact(f"{stem}_worst_person", by_person.max(), people, headline=ours)
            find.exact(f"{stem}_share_of_people_within_1", few / people, people, headline=ours)
            if ours:  # describes these people only, so it has no interval
                within[source] = Evidence(few / people, few / people, few / people, people, few)
    find.add("people_within", within)
    single, several = (
        results.hits_by_person(UNSEEN, (kind, PUBLISHED), SHAPES) for kind in (NETWORK, ENSEMBLE)
    )
    find.rate_difference("fewer_hits", single, several, unit="%")
    detours = {source: results.reached(PAIR, ENSEMBLE, source)["detour_m"] for source in EVERY}
    find.mean("detour_pair", detours, unit="m")


def _goals(results: ObstacleResults, find: Findings) -> None:
    """Add goal distances: at the prescribed time, at 1.5 times it (late), and in between (excursion)."""
    networks = results.reached(TRAINED, NETWORK, SETTING, PUBLISHED)
    find.clustered_share("goal_of_network", networks["far"].to_numpy(), networks["reaches"].to_numpy())
    rai = results.reached(TRAINED, HUMAN_INSPIRED, SETTING, PUBLISHED)
    find.exact("goal_of_rai", rai["goal_distance_m"].max(), rai["reaches"].sum(), unit="m")
    limited = results.by_person[results.by_person["rules"] == LIMITED]
    count = limited["reaches"].sum()
    for name in ("goal", "late_goal"):
        find.exact(f"{name}_distance_max_m", limited[f"{name}_distance_m"].max(), count, unit="m")
    goals = {"prescribed time": "goal_distance_m", "1.5 times it": "late_goal_distance_m"}
    found = {words: (100 * limited[column].max(), count) for words, column in goals.items()}
    find.exact("goal_with_limits", found, unit="cm")
    between = limited.groupby("model").agg({"excursion_m": "max", "reaches": "sum"})
    find.exact("excursions", 100 * between.loc[ENSEMBLE, "excursion_m"], between.loc[ENSEMBLE, "reaches"])
    for kind in (NETWORK, ENSEMBLE):
        find.exact(f"excursion_{kind}_max_m", *between.loc[kind], unit="m")
    short = results.reached(GOAL_CHANGE)
    left_mm = 1e3 * short["goal_distance_m"].max()
    find.exact("short_of_moved_goal_mm", left_mm, short["reaches"].sum(), unit="mm")
    per_setting = results.rows(TRAINED, NETWORK, SETTING)
    for name, its in (("networks", per_setting), ("people", results.demonstrated)):
        find.exact(f"distance_of_{name}_radii", its["obstacle_distance"].mean(), len(its))
        find.exact(f"clearance_of_{name}_mm", 1e3 * its["clearance_m"].min(), len(its), unit="mm")
