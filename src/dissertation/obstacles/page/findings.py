"""Findings of the obstacle testbed, over the people of the test population.

The dissertation's statements are tested on its own form: single networks with its rules (`AS_PUBLISHED`).
Ensembles with limits at the goal (`OURS`) are evidence for this project's claims. Differences and ratios are
paired by person. The study `obstacles/people` adds people to those of this run.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dissertation.evidence.results import Population, Register, Results
from dissertation.evidence.variance_shares import between_share, sums_of
from dissertation.obstacles.names import SITUATIONS
from dissertation.obstacles.protocol.avoidance_protocols import (
    LIMITED,
    NO_MODEL,
    PAIR,
    PUBLISHED,
    TRAINED,
    UNSEEN,
)
from dissertation.obstacles.protocol.results import DEMONSTRATED
from structlearn.avoidance.learned_models import (
    ALL,
    ENSEMBLE,
    HUMAN_INSPIRED,
    NETWORK,
    SETTING,
)
from structlearn.avoidance.shapes import SHAPES
from structlearn.core.params import read_values
from structlearn.reporting.evidence import (
    Evidence,
    clustered_share,
    exact,
    exact_count,
    geometric_mean,
    maximum,
    mean,
    rate_difference,
)
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import percent

AS_PUBLISHED, OURS, RAI = (NETWORK, PUBLISHED), (ENSEMBLE, LIMITED), (HUMAN_INSPIRED, PUBLISHED)
"""Kind of model and rules: as published, our variant, and the model of Rai et al."""

DIVERGED_M = 10.0  # farther from its goal than any arm reaches
BARE = (NO_MODEL, LIMITED)  # reaches without avoidance, which no rule changes
EVERY = (*SHAPES, ALL)
FEW_HITS = 1  # unseen spheres that a person's model may hit to count as good
PARTS = {"learned from": "train", "held out": "test"}
Form = tuple[str, str]
Sources = str | Sequence[str]  # what models learned from

register = Register()
finding = register.finding


@lru_cache
def read_published() -> Mapping[str, Any]:
    """Values printed in the dissertation, from `published.yaml`."""
    return read_values(Path(__file__).with_name("published.yaml"))


def findings(population: Population) -> Findings:
    """All findings of the page."""
    find = Findings("simulated people on whom nothing was tuned")
    register.evaluate(find, population)
    return find


def by_person(results: Results, quantity: str, form: Form, how: str = "sum", **keys: Any) -> pd.Series:
    """A quantity (P,) of a kind of model with its rules, reduced over each person's obstacles and models."""
    model, rules = form
    return results.rows(quantity, model=model, rules=rules, **keys).groupby("person")["value"].agg(how)


def counts(results: Results, protocol: str, form: Form = BARE, sources: Sources = "") -> pd.DataFrame:
    """Numbers of `hits` and `reaches` by person, and of hits without avoidance, `bare`, in `of` reaches."""
    its = partial(by_person, results, protocol=protocol)
    table = {name: its(name, form, learned_from=sources) for name in ("hits", "reaches")}
    return pd.DataFrame(table | {"bare": its("hits", BARE), "of": its("reaches", BARE)}).dropna().astype(int)


def rate(*where: Any) -> pd.Series:
    """Share of reaches that hit (P,), by person; arguments as of `counts`."""
    its = counts(*where)
    return its["hits"] / its["reaches"]


def share(its: pd.DataFrame, comparisons: int = 1) -> Evidence:
    """Share of reaches that hit, beside that without avoidance, from `counts`."""
    return _beside_none(clustered_share(its["hits"], its["reaches"], comparisons), its)


def number(its: pd.DataFrame, comparisons: int = 1) -> Evidence:
    """Number of reaches that hit, for the statement that none does: exact, whatever the number of cases."""
    return _beside_none(exact_count(its["hits"].sum(), its["reaches"].sum()), its)


def _beside_none(found: Evidence, its: pd.DataFrame) -> Evidence:
    bare = percent(its["bare"].sum(), its["of"].sum(), 1)
    return replace(found, remark=f"are hit; without avoidance {bare}")


def farthest_end(distances: pd.Series, comparisons: int = 1) -> Evidence:
    """Largest distance in m from a goal, exact, with a remark where the movement diverged."""
    found = maximum(distances)
    return replace(found, remark="the movement diverges") if found.value > DIVERGED_M else found


def pairs(first: pd.DataFrame, second: pd.DataFrame) -> pd.DataFrame:
    """Two tables of `counts` side by side, of the people that both have."""
    return first.merge(second, left_index=True, right_index=True, suffixes=("_first", "_second"))


def points(its: pd.DataFrame, comparisons: int = 1) -> Evidence:
    """Difference first minus second of shares in percentage points, from `pairs`."""
    both = [(its[f"hits_{one}"].to_numpy(), its[f"reaches_{one}"].to_numpy()) for one in ("first", "second")]
    return rate_difference(both[0], both[1], comparisons)


def fraction(which: pd.Series, comparisons: int = 1) -> Evidence:
    """Share of these people or scenarios for which something is true: exact."""
    count, n = int(which.sum()), len(which)
    return Evidence(count / n, count / n, count / n, n, count)


def of_settings(results: Results, axis: str, part: str) -> pd.DataFrame:
    """NMSE of models trained on one scenario: rows are scenarios with such models, columns models."""
    rows = results.rows("nmse", axis=axis, part=part, learned_from=SETTING)
    wide = rows.pivot_table("value", ["person", "obstacle", "setting"], "model")
    return wide.reindex(columns=[NETWORK, HUMAN_INSPIRED]).dropna()


def across(results: Results, kind: str, sources: Sources) -> pd.Series:
    """Held-out NMSE over y and z (P,), mean over shapes, by person."""
    rows = results.rows("nmse", axis="across", part="test", model=kind, learned_from=sources)
    return rows.groupby("person")["value"].mean()


def farthest(results: Results, form: Form, quantity: str = "goal_distance", **keys: Any) -> pd.Series:
    """Largest distance (P,) from the goal in m, by person."""
    return by_person(results, f"largest_{quantity}", form, "max", **keys)


@finding(exact, headline=True)
def people(results: Results) -> int:
    """People that the findings are about."""
    return int(results.table["person"].nunique())


@finding(between_share, unit="of the variance")
def between_people(results: Results) -> dict[str, pd.DataFrame]:
    """Share between people of the log of clearance and movement time past obstacles near the reach."""
    cases = {"clearance": "log_clearance_m", "pace": "log_movement_s"}
    return {case: sums_of(results, quantity) for case, quantity in cases.items()}


@finding(share)
def hits_by_preference(results: Results) -> dict[str, pd.DataFrame]:
    """Unseen spheres hit by networks per shape, of people who prefer their side less and more than most."""
    its = counts(results, UNSEEN, AS_PUBLISHED, SHAPES)
    preference = results.each("preference").reindex(its.index)
    less = preference < preference.median()
    return {"less": its[less], "more": its[~less]}


# --- per setting (IV.8.5) ----------------------------------------------------------------------------------


@finding(number, headline=True)
def hits_per_setting(results: Results) -> pd.DataFrame:
    """Obstacles hit by networks trained on their setting."""
    return counts(results, TRAINED, AS_PUBLISHED, SETTING)


@finding(points, unit="percentage points")
def rai_hits_more(results: Results) -> pd.DataFrame:
    """Rate of hits of the model of Rai et al. minus that of networks, per setting."""
    return pairs(*(counts(results, TRAINED, form, SETTING) for form in (RAI, AS_PUBLISHED)))


@finding(maximum, unit="m")
def converged(results: Results) -> dict[str, pd.Series]:
    """Distance from the goal with networks at the prescribed time."""
    where = {"per setting": (TRAINED, SETTING), "trained": (TRAINED, SHAPES), "unseen": (UNSEEN, SHAPES)}
    return {
        case: farthest(results, AS_PUBLISHED, protocol=protocol, learned_from=sources)
        for case, (protocol, sources) in where.items()
    }


@finding(farthest_end, unit="m")
def goal_of_rai(results: Results) -> pd.Series:
    """The same with the model of Rai et al. per setting."""
    return farthest(results, RAI, protocol=TRAINED, learned_from=SETTING)


def like_people(results: Results, quantity: str) -> pd.Series:
    """Mean of a quantity with networks per setting minus that of people in the same scenarios, by person."""
    form, people = (
        by_person(results, quantity, form, "mean", protocol=TRAINED, learned_from=SETTING)
        for form in (AS_PUBLISHED, (DEMONSTRATED, ""))
    )
    return form - people


@finding(mean, unit="radii")
def distances_like_people(results: Results) -> pd.Series:
    """Mean of the closest distances to obstacles."""
    return like_people(results, "mean_distance")


@finding(mean, unit="mm")
def goals_like_people(results: Results) -> pd.Series:
    """Mean distance from the goal."""
    return 1e3 * like_people(results, "mean_goal_distance")


def high(results: Results, axis: str) -> dict[str, tuple[int, int] | None]:
    """Number of scenarios in which the network's NMSE is above the largest published, and of all."""
    errors = {case: of_settings(results, axis, part)[NETWORK] for case, part in PARTS.items()}
    low = read_published()["largest_nmse"]
    return {case: (int((its > low).sum()), len(its)) if len(its) else None for case, its in errors.items()}


for name, axis in (("high_errors", "all"), ("high_dominant", "dominant")):
    finding(exact_count, name=name)(partial(high, axis=axis))


def times_network(results: Results, axis: str) -> dict[str, pd.Series]:
    """NMSE of the model of Rai et al. over the network's, geometric mean over scenarios, by person."""
    errors = {case: of_settings(results, axis, part) for case, part in PARTS.items()}
    ratios = {case: np.log(its[HUMAN_INSPIRED] / its[NETWORK]) for case, its in errors.items()}
    return {case: np.exp(its.groupby("person").mean()) for case, its in ratios.items()}


for name, axis in (("rai_fits_worse", "all"), ("rai_dominant", "dominant")):
    finding(geometric_mean, unit="times the NMSE of the network", name=name)(
        partial(times_network, axis=axis)
    )


@finding(exact)
def dominant_scenarios(results: Results) -> int:
    """Scenarios with a dominant axis of avoidance."""
    return len(of_settings(results, "dominant", "test"))


# --- across settings (IV.8.6) ------------------------------------------------------------------------------


@finding(geometric_mean, unit="NMSE")
def rai_across_settings(results: Results) -> pd.Series:
    """Held-out NMSE of the model of Rai et al. per shape."""
    return across(results, HUMAN_INSPIRED, SHAPES)


@finding(geometric_mean, unit="NMSE")
def error_per_shape(results: Results) -> dict[str, pd.Series]:
    """Held-out NMSE of networks per shape."""
    keys = {"model": NETWORK, "part": "test"}
    return {
        f"{shape}, {axis}": results.each("nmse", learned_from=shape, obstacle=shape, axis=axis, **keys)
        for shape, axis in product(SHAPES, "yz")
    }


@finding(number)
def single_hits_per_shape(results: Results) -> dict[str, pd.DataFrame]:
    """Trained obstacles hit by networks per shape."""
    return {shape: counts(results, TRAINED, AS_PUBLISHED, shape) for shape in SHAPES}


def of_all_shapes(results: Results, kind: str) -> pd.Series:
    """Held-out NMSE of a model of all shapes minus that of models per shape (P,)."""
    return across(results, kind, ALL) - across(results, kind, SHAPES)


for name, kind in (("single_of_all_shapes", NETWORK), ("ensemble_of_all_shapes", ENSEMBLE)):
    finding(mean, unit="higher NMSE", name=name)(partial(of_all_shapes, kind=kind))


@finding(points, unit="percentage points")
def hits_of_all_shapes(results: Results) -> pd.DataFrame:
    """Rate of trained obstacles hit by a network of all shapes minus that of networks per shape."""
    return pairs(*(counts(results, TRAINED, AS_PUBLISHED, sources) for sources in (ALL, SHAPES)))


@finding(mean, unit="percentage points")
def hits_of_pairs(results: Results) -> pd.Series:
    """Hits past two spheres minus hits past one, each over the hits without avoidance."""
    form = NETWORK, LIMITED
    pair, single = (rate(results, one, form, SHAPES) / rate(results, one) for one in (PAIR, UNSEEN))
    return 100.0 * (pair - single)


@finding(share)
def hits_per_shape(results: Results) -> dict[str, pd.DataFrame]:
    """Trained obstacles hit by ensembles."""
    return {source: counts(results, TRAINED, OURS, source) for source in EVERY}


# --- unseen spheres (IV.8.7), and situations that are not in the dissertation ------------------------------


@finding(share, headline=True)
def single_hits_unseen(results: Results) -> pd.DataFrame:
    """Unseen spheres hit by networks per shape, mean over shapes."""
    return counts(results, UNSEEN, AS_PUBLISHED, SHAPES)


@finding(points, unit="percentage points")
def unseen_against_none(results: Results) -> pd.DataFrame:
    """Rate of unseen spheres hit without avoidance minus that with networks per shape."""
    return pairs(counts(results, UNSEEN), counts(results, UNSEEN, AS_PUBLISHED, SHAPES))


@finding(share, headline=True)
def hits_unseen(results: Results) -> dict[str, pd.DataFrame]:
    """Unseen spheres hit by ensembles."""
    return {source: counts(results, UNSEEN, OURS, source) for source in EVERY}


@finding(fraction)
def people_within(results: Results) -> dict[str, pd.Series]:
    """People whose ensemble hits few unseen spheres."""
    return {source: counts(results, UNSEEN, OURS, source)["hits"] <= FEW_HITS for source in EVERY}


@finding(points, unit="percentage points")
def fewer_hits(results: Results) -> pd.DataFrame:
    """Rate of unseen spheres hit by networks per shape minus that of ensembles, with the published rules."""
    return pairs(*(counts(results, UNSEEN, (kind, PUBLISHED), SHAPES) for kind in (NETWORK, ENSEMBLE)))


@finding(number, headline=[UNSEEN])
def hits_without(results: Results) -> dict[str, pd.DataFrame]:
    """Hits without avoidance, by situation."""
    return {one: counts(results, one) for one in SITUATIONS}


@finding(mean, unit="m", headline=[ALL])
def detour_pair(results: Results) -> dict[str, pd.Series]:
    """Largest distance from the path without avoidance, mean over an ensemble's reaches past two spheres."""
    mean_detours = partial(by_person, results, "mean_detour", OURS, protocol=PAIR)
    return {source: mean_detours(learned_from=source) for source in EVERY}


@finding(maximum, unit="cm")
def goal_with_limits(results: Results) -> dict[str, pd.Series]:
    """Distance from the goal of all models with limits."""
    cases = {"prescribed time": "largest_goal_distance", "1.5 times it": "largest_late_goal_distance"}
    rows = {case: results.rows(quantity, rules=LIMITED) for case, quantity in cases.items()}
    return {case: 100 * its.groupby("person")["value"].max() for case, its in rows.items()}


@finding(maximum, unit="cm")
def excursions(results: Results) -> pd.Series:
    """Distance from the goal after the prescribed time with ensembles."""
    return 100 * farthest(results, OURS, "excursion")
