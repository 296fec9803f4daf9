"""Findings of the obstacle testbed, over the people of the test population.

The dissertation's statements are tested on its own form: single networks with its rules (`AS_PUBLISHED`).
Ensembles with limits at the goal (`OURS`) are evidence for this project's claims. Differences and ratios are
paired by person. The study `obstacles/people` adds people to those of this run.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dissertation.evidence.results import Population, Register, Results
from dissertation.obstacles.names import SITUATIONS
from dissertation.obstacles.protocol.avoidance_protocols import (
    GOAL_CHANGE,
    LIMITED,
    MOVING,
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
    PHASE_MODULATED,
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
    largest,
    mean,
    rate_difference,
    smallest,
)
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import percent

AS_PUBLISHED, OURS, RAI = (NETWORK, PUBLISHED), (ENSEMBLE, LIMITED), (HUMAN_INSPIRED, PUBLISHED)
"""Kind of model and rules: as published, our variant, and the model of Rai et al."""

BARE = (NO_MODEL, LIMITED)  # reaches without avoidance, which no rule changes
EVERY = (*SHAPES, ALL)
FEW_HITS = 1  # unseen spheres that a person's model may hit to count as good
PARTS = {"learned from": "train", "held out": "test"}
CHANGED = (MOVING, PAIR, GOAL_CHANGE)  # situations that are not in the dissertation
Form = tuple[str, str]
Sources = str | Iterable[str]  # what models learned from

register = Register()
finding = register.finding


@lru_cache
def read_published() -> Mapping[str, Any]:
    """Values printed in the dissertation, from `published.yaml`."""
    return read_values(Path(__file__).with_name("published.yaml"))


def findings(population: Population, shown: int) -> Findings:
    """All findings of the page; `shown`: the person on whom constants were tuned."""
    people = int(population.results.table["person"].nunique())
    find = Findings(f"{people} simulated people on whom nothing was tuned")
    find.exact("people", people, headline=True)
    register.evaluate(find, population)
    one = find.among(f"person {shown}, on whom constants were tuned")
    of_shown = replace(population.one, population=[shown])
    for name, kind in (("modulated", PHASE_MODULATED), ("not_modulated", NETWORK)):
        one.exact(f"nmse_shown_{name}", across(of_shown, kind, ALL).mean())
    return find


def by_person(results: Results, quantity: str, form: Form, how: str = "sum", **keys: object) -> pd.Series:
    """A quantity (P,) of a kind of model with its rules, reduced over each person's obstacles and models."""
    model, rules = form
    rows = results.rows(quantity, model=model, rules=rules, **keys)
    return rows.groupby("person")["value"].agg(how)


def counts(results: Results, protocol: str, form: Form, sources: Sources) -> tuple[pd.Series, pd.Series]:
    """Hits (P,) and reaches (P,) by person."""
    keys: dict[str, Any] = {"protocol": protocol}
    keys["learned_from"] = sources if isinstance(sources, str) else list(sources)
    return by_person(results, "hits", form, **keys), by_person(results, "reaches", form, **keys)


def rate(results: Results, protocol: str, form: Form = BARE, sources: Sources = "") -> pd.Series:
    """Share of reaches that hit (P,), by person; of several sources, their mean."""
    hits, reaches = counts(results, protocol, form, sources)
    return hits / reaches


def beside_none(results: Results, protocol: str, form: Form, sources: Sources) -> tuple[pd.Series, ...]:
    """`counts` of a model, and those without avoidance."""
    return *counts(results, protocol, form, sources), *counts(results, protocol, BARE, "")


def share(hits: Any, reaches: Any, bare: Any, of: Any, comparisons: int = 1) -> Evidence:
    """Share of reaches that hit, beside that without avoidance; arguments as of `beside_none`."""
    return _beside(clustered_share(hits, reaches, comparisons), bare, of)


def number(hits: Any, reaches: Any, bare: Any, of: Any, comparisons: int = 1) -> Evidence:
    """Number of reaches that hit, for the statement that none does: exact, whatever the number of cases."""
    return _beside(exact_count(int(hits.sum()), int(reaches.sum())), bare, of)


def _beside(found: Evidence, bare: Any, of: Any) -> Evidence:
    return replace(found, remark=f"hit; {percent(int(bare.sum()), int(of.sum()), 1)} without avoidance")


def of_settings(results: Results, axis: str, part: str) -> pd.DataFrame:
    """NMSE of models trained on one scenario: rows are scenarios with such models, columns models."""
    rows = results.rows("nmse", axis=axis, part=part, learned_from=SETTING)
    wide = rows.pivot_table("value", ["person", "obstacle", "setting"], "model")
    return wide.reindex(columns=[NETWORK, HUMAN_INSPIRED]).dropna()


def across(results: Results, kind: str, sources: Sources) -> pd.Series:
    """Held-out NMSE over y and z (P,), mean over shapes, by person."""
    sources = sources if isinstance(sources, str) else list(sources)
    rows = results.rows("nmse", axis="across", part="test", model=kind, learned_from=sources)
    return rows.groupby("person")["value"].mean()


# --- per setting (IV.8.5) ---------------------------------------------------------------------------------


@finding(number, headline=True)
def hits_per_setting(results: Results) -> Any:
    """Obstacles hit by networks trained on their setting."""
    return beside_none(results, TRAINED, AS_PUBLISHED, SETTING)


@finding(rate_difference, unit="%")
def rai_hits_more(results: Results) -> Any:
    """Rate of hits of the model of Rai et al. minus that of networks, per setting."""
    rates = (rate(results, TRAINED, form, SETTING) for form in (RAI, AS_PUBLISHED))
    return next(rates).align(next(rates), join="inner")


@finding(largest, unit="m")
def converged(results: Results) -> Any:
    """Largest distance from the goal with networks at the prescribed time."""
    cases: dict[str, tuple[str, Sources]] = {
        "per setting": (TRAINED, SETTING),
        "trained": (TRAINED, SHAPES),
        "unseen": (UNSEEN, SHAPES),
    }
    return {
        case: farthest(results, AS_PUBLISHED, protocol=protocol, learned_from=sources)
        for case, (protocol, sources) in cases.items()
    }


@finding(largest, unit="m")
def goal_of_rai(results: Results) -> Any:
    """The same with the model of Rai et al. per setting."""
    return farthest(results, RAI, protocol=TRAINED, learned_from=SETTING)


def farthest(results: Results, form: Form, quantity: str = "goal_distance", **keys: object) -> pd.Series:
    """Largest distance (P,) from the goal in m, by person."""
    return by_person(results, f"largest_{quantity}", form, "max", **keys)


def like_people(results: Results, quantity: str, how: str = "mean") -> pd.DataFrame:
    """A quantity of networks per setting (`model`) and of people in the same scenarios, by person."""
    keys = {"protocol": TRAINED, "learned_from": SETTING}
    its = {"model": AS_PUBLISHED, "people": (DEMONSTRATED, "")}
    return pd.DataFrame(
        {name: by_person(results, quantity, form, how, **keys) for name, form in its.items()}
    ).dropna()


@finding(mean, unit="radii")
def distances_like_people(results: Results) -> Any:
    """Mean closest distance to obstacles with networks per setting minus people's."""
    its = like_people(results, "mean_distance")
    return its["model"] - its["people"]


@finding(mean, unit="mm")
def goals_like_people(results: Results) -> Any:
    """Mean distance from the goal with networks per setting minus people's."""
    its = like_people(results, "mean_goal_distance")
    return 1e3 * (its["model"] - its["people"])


def above(results: Results, axis: str, bound: float) -> dict[str, Any]:
    """Number of scenarios in which the network's NMSE is above a bound, and of all."""
    errors = {words: of_settings(results, axis, part)[NETWORK] for words, part in PARTS.items()}
    return {
        words: (int((its > bound).sum()), len(its)) if len(its) else None for words, its in errors.items()
    }


@finding(exact_count)
def high_errors(results: Results) -> Any:
    """Scenarios in which the NMSE over all axes is above the largest published."""
    return above(results, "all", read_published()["largest_nmse"])


@finding(exact_count)
def high_dominant(results: Results) -> Any:
    """Scenarios in which the NMSE over the dominant axis is above the largest published."""
    return above(results, "dominant", read_published()["largest_nmse"])


def times_network(results: Results, axis: str) -> dict[str, pd.Series]:
    """NMSE of the model of Rai et al. over the network's, geometric mean over scenarios, by person."""
    errors = {words: of_settings(results, axis, part) for words, part in PARTS.items()}
    return {
        words: np.exp(np.log(its[HUMAN_INSPIRED] / its[NETWORK]).groupby("person").mean())
        for words, its in errors.items()
    }


@finding(geometric_mean, unit="times the NMSE of the network")
def rai_fits_worse(results: Results) -> Any:
    """`times_network` over all axes."""
    return times_network(results, "all")


@finding(geometric_mean, unit="times the NMSE of the network")
def rai_dominant(results: Results) -> Any:
    """`times_network` over the dominant axis."""
    return times_network(results, "dominant")


@finding(exact)
def dominant_scenarios(results: Results) -> Any:
    """Number of scenarios with a dominant axis of avoidance."""
    return len(of_settings(results, "dominant", "test"))


@finding(exact)
def typical_nmse(results: Results) -> Any:
    """Median held-out NMSE of networks per setting."""
    every, dominant, along_x = (
        of_settings(results, one, "test")[NETWORK] for one in ("across", "dominant", "x")
    )
    cases = {"dominant": dominant, "not_dominant": every.drop(dominant.index), "along_x": along_x}
    return {case: its.median() if len(its) else None for case, its in cases.items()}


# --- across settings (IV.8.6) -----------------------------------------------------------------------------


@finding(geometric_mean)
def rai_across_settings(results: Results) -> Any:
    """Held-out NMSE of the model of Rai et al. per shape."""
    return across(results, HUMAN_INSPIRED, SHAPES)


@finding(geometric_mean)
def error_per_shape(results: Results) -> Any:
    """Held-out NMSE of networks per shape along y and z."""
    keys = {"model": NETWORK, "part": "test"}
    return {
        f"{shape}, {axis}": results.each("nmse", learned_from=shape, obstacle=shape, axis=axis, **keys)
        for shape in SHAPES
        for axis in "yz"
    }


@finding(number)
def single_hits_per_shape(results: Results) -> Any:
    """Trained obstacles hit by networks per shape."""
    return {shape: beside_none(results, TRAINED, AS_PUBLISHED, shape) for shape in SHAPES}


@finding(mean, unit="higher NMSE")
def single_of_all_shapes(results: Results) -> Any:
    """Held-out NMSE of a network of all shapes minus that of networks per shape."""
    return across(results, NETWORK, ALL) - across(results, NETWORK, SHAPES)


@finding(rate_difference, unit="%")
def hits_of_all_shapes(results: Results) -> Any:
    """Rate of trained obstacles hit by a network of all shapes minus that of networks per shape."""
    together, apart = (rate(results, TRAINED, AS_PUBLISHED, sources) for sources in (ALL, SHAPES))
    return together.align(apart, join="inner")


@finding(rate_difference, unit="%")
def hits_of_pairs(results: Results) -> Any:
    """Hits past two spheres minus hits past one, each over the hits without avoidance."""
    pair, one = (
        rate(results, protocol, (NETWORK, LIMITED), SHAPES) / rate(results, protocol)
        for protocol in (PAIR, UNSEEN)
    )
    return pair.align(one, join="inner")


@finding(mean, unit="higher NMSE")
def ensemble_of_all_shapes(results: Results) -> Any:
    """`single_of_all_shapes` of ensembles."""
    return across(results, ENSEMBLE, ALL) - across(results, ENSEMBLE, SHAPES)


@finding(geometric_mean)
def nmse_across(results: Results) -> Any:
    """Held-out NMSE over y and z of networks per shape and of all shapes."""
    return {"shape": across(results, NETWORK, SHAPES), "all": across(results, NETWORK, ALL)}


@finding(share)
def hits_per_shape(results: Results) -> Any:
    """Trained obstacles hit by ensembles."""
    return {source: beside_none(results, TRAINED, OURS, source) for source in EVERY}


# --- unseen spheres (IV.8.7) ------------------------------------------------------------------------------


@finding(share)
def single_hits_unseen(results: Results) -> Any:
    """Unseen spheres hit by networks per shape, mean over shapes."""
    return beside_none(results, UNSEEN, AS_PUBLISHED, SHAPES)


@finding(rate_difference, unit="%")
def unseen_against_none(results: Results) -> Any:
    """Rate of unseen spheres hit without avoidance minus that with networks per shape."""
    return rate(results, UNSEEN).align(rate(results, UNSEEN, AS_PUBLISHED, SHAPES), join="inner")


@finding(share)
def hits_unseen(results: Results) -> Any:
    """Unseen spheres hit by ensembles."""
    return {source: beside_none(results, UNSEEN, OURS, source) for source in EVERY}


@finding(rate_difference, unit="%")
def fewer_hits(results: Results) -> Any:
    """Rate of unseen spheres hit by single networks minus that of ensembles, with the published rules."""
    single, several = (rate(results, UNSEEN, (kind, PUBLISHED), SHAPES) for kind in (NETWORK, ENSEMBLE))
    return single.align(several, join="inner")


@finding(largest, headline=True)
def hits_unseen_worst_person(results: Results) -> Any:
    """Most unseen spheres hit by anyone's ensemble."""
    return {source: counts(results, UNSEEN, OURS, source)[0] for source in EVERY}


@finding(largest)
def single_hits_unseen_worst_person(results: Results) -> Any:
    """Most unseen spheres hit by anyone's network."""
    return {source: counts(results, UNSEEN, AS_PUBLISHED, source)[0] for source in EVERY}


def fraction(count: int, n: int, comparisons: int = 1) -> Evidence:
    """Share of these people, which is exact."""
    return Evidence(count / n, count / n, count / n, n, count)


@finding(fraction)
def people_within(results: Results) -> Any:
    """People whose ensemble hits few unseen spheres."""
    hits = {source: counts(results, UNSEEN, OURS, source)[0] for source in EVERY}
    return {
        source: (int((its <= FEW_HITS).sum()), len(its)) if len(its) else None for source, its in hits.items()
    }


# --- all situations ---------------------------------------------------------------------------------------


@finding(exact)
def reaches(results: Results) -> Any:
    """Reaches of each model, by situation."""
    return {one: counts(results, one, BARE, "")[1].sum() for one in SITUATIONS}


@finding(exact, headline=[UNSEEN])
def hits_without(results: Results) -> Any:
    """Hits without avoidance, by situation."""
    return {one: counts(results, one, BARE, "")[0].sum() for one in SITUATIONS}


def most_hits_of(results: Results, *kinds: str) -> dict[str, Any]:
    """Largest number of hits of a model of these kinds, over all people, by situation."""
    every = {one: results.rows("hits", protocol=one, rules=LIMITED, model=kinds) for one in CHANGED}
    return {
        one: rows.groupby(["model", "learned_from"])["value"].sum().max() if len(rows) else None
        for one, rows in every.items()
    }


@finding(exact)
def most_hits(results: Results) -> Any:
    """`most_hits_of` networks and ensembles."""
    return most_hits_of(results, NETWORK, ENSEMBLE)


@finding(exact)
def most_hits_of_rai(results: Results) -> Any:
    """`most_hits_of` the model of Rai et al."""
    return most_hits_of(results, HUMAN_INSPIRED)


def detours(results: Results, protocol: str) -> dict[str, pd.Series]:
    """Mean over an ensemble's reaches of the largest distance from the path without avoidance, by person."""
    its = {"protocol": protocol}
    return {one: by_person(results, "mean_detour", OURS, "mean", learned_from=one, **its) for one in EVERY}


@finding(mean, unit="m", headline=[ALL])
def detour_pair(results: Results) -> Any:
    """`detours` past two spheres."""
    return detours(results, PAIR)


@finding(mean, unit="m")
def detour_unseen(results: Results) -> Any:
    """`detours` past one sphere."""
    return detours(results, UNSEEN)


@finding(largest, unit="cm")
def goal_with_limits(results: Results) -> Any:
    """Largest distance from the goal of all models with limits."""
    quantities = {"prescribed time": "goal_distance", "1.5 times it": "late_goal_distance"}
    rows = {case: results.rows(f"largest_{one}", rules=LIMITED) for case, one in quantities.items()}
    return {case: 100 * its.groupby("person")["value"].max() for case, its in rows.items()}


@finding(largest, unit="cm")
def excursions(results: Results) -> Any:
    """Largest distance from the goal after the prescribed time with ensembles."""
    return 100 * farthest(results, OURS, "excursion")


@finding(largest, unit="m")
def excursion(results: Results) -> Any:
    """The same with networks and ensembles, for sentences."""
    return {kind: farthest(results, (kind, LIMITED), "excursion") for kind in (NETWORK, ENSEMBLE)}


@finding(largest, unit="m")
def late_network(results: Results) -> Any:
    """Largest distance from the goal with networks at 1.5 times the prescribed time."""
    return farthest(results, AS_PUBLISHED, "late_goal_distance")


@finding(largest, unit="mm")
def short_of_moved_goal(results: Results) -> Any:
    """Largest distance from a goal that moved, without avoidance."""
    return 1e3 * farthest(results, BARE, protocol=GOAL_CHANGE)


@finding(mean, unit="radii")
def distance(results: Results) -> Any:
    """Mean closest distance to obstacles of networks per setting and of people."""
    return dict(like_people(results, "mean_distance"))


@finding(smallest, unit="mm")
def clearance(results: Results) -> Any:
    """Smallest distance from surfaces of networks per setting and of people."""
    return dict(1e3 * like_people(results, "least_clearance", "min"))
