"""Evidence for the claims of `claims.yaml`.

The dissertation's statements are held against its own form: single networks, with its rules alone. What this
project makes of it, ensembles with limits at the goal, is evidence for this project's claims. All is over
people: rates are clustered by them, errors are their means, paired by person.
"""

import numpy as np
import pandas as pd

from structlearn.avoidance.learned_models import ALL, ENSEMBLE, HUMAN_INSPIRED, NETWORK, SETTING
from structlearn.avoidance.shapes import SHAPES
from structlearn.reporting.claims import (
    UNKNOWN,
    Evidence,
    Found,
    by_case,
    clustered_share,
    difference,
    exact,
    mean,
    rate_difference,
)
from structlearn.testbeds.obstacles.page.results import FEW_HITS, OURS, TEXT, ObstacleResults
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import PAIR, PUBLISHED, TRAINED, UNSEEN

PARTS = {"learned from": "train", "held out": "test"}


def evidence(results: ObstacleResults, largest_nmse: float, largest_goal_m: float) -> dict[str, Found]:
    """By the names that the claims use."""
    rai = (HUMAN_INSPIRED, PUBLISHED)
    goals_of_rai = results.rows(TRAINED, HUMAN_INSPIRED, SETTING, PUBLISHED)["goal_distance_m"]
    limited = results.limited
    between = limited.loc[limited["model"] == ENSEMBLE, "excursion_m"]
    goals = 100 * limited[["goal_distance_m", "late_goal_distance_m"]].max()
    across = {
        (kind, every): results.fit_by_person(kind, every)
        for kind in (NETWORK, ENSEMBLE)
        for every in (False, True)
    }
    rai_across = results.fit_by_person(HUMAN_INSPIRED)
    errors = {
        f"{shape}, {axis}": (results.fit(NETWORK, shape, shape)[f"nmse_{axis}"],)
        for shape in SHAPES
        for axis in "yz"
    }
    return {
        "hits_per_setting": clustered_share(*results.hits_by_person(TRAINED, TEXT, SETTING)),
        "hits_of_rai": clustered_share(*results.hits_by_person(TRAINED, rai, SETTING)),
        "goal_of_network": _missing(results, largest_goal_m),
        "goal_of_rai": exact(goals_of_rai.max(), len(goals_of_rai)),
        "low_errors": _low(results, "nmse", largest_nmse),
        "low_dominant": _low(results, "nmse_dominant", largest_nmse),
        "rai_fits_worse": _gain(results, "nmse"),
        "rai_dominant": _gain(results, "nmse_dominant"),
        "rai_across_settings": mean(rai_across),
        "error_per_shape": by_case(mean, errors),
        "single_hits_per_shape": _hits(results, TRAINED, TEXT, SHAPES),
        "single_hits_unseen": _hits(results, UNSEEN, TEXT, SHAPES),
        "single_of_all_shapes": difference(across[NETWORK, True], across[NETWORK, False]),
        "people_within": _people_within(results),
        "hits_per_shape": _hits(results, TRAINED, OURS, (*SHAPES, ALL)),
        "hits_unseen": _hits(results, UNSEEN, OURS, (*SHAPES, ALL)),
        "fewer_hits": _fewer_hits(results),
        "ensemble_of_all_shapes": difference(across[ENSEMBLE, True], across[ENSEMBLE, False]),
        "detour_pair": by_case(
            mean,
            {
                source: (results.rows(PAIR, ENSEMBLE, source).groupby("person")["detour_m"].mean(),)
                for source in (*SHAPES, ALL)
            },
        ),
        "goal_with_limits": {
            words: exact(goal, len(limited))
            for words, goal in zip(("prescribed time", "1.5 times it"), goals, strict=True)
        },
        "excursions": exact(100 * between.max(), len(between)),
    }


def _hits(
    results: ObstacleResults, protocol: str, form: tuple[str, str], sources: tuple[str, ...]
) -> dict[str, Evidence]:
    return by_case(
        clustered_share, {source: results.hits_by_person(protocol, form, source) for source in sources}
    )


def _people_within(results: ObstacleResults) -> dict[str, Evidence]:
    """How many of these people hit few of the unseen spheres: a statement about them, so without interval."""
    cases = {}
    for source in (*SHAPES, ALL):
        hits, _ = results.hits_by_person(UNSEEN, OURS, source)
        count = int((hits <= FEW_HITS).sum())
        share = count / len(hits)
        cases[source] = Evidence(share, share, share, len(hits), count)
    return cases


def _fewer_hits(results: ObstacleResults) -> Evidence:
    """Share of unseen spheres hit by single networks minus that of ensembles, with the same rules."""
    single, several = (
        np.divide(*results.hits_by_person(UNSEEN, (kind, PUBLISHED), SHAPES)) for kind in (NETWORK, ENSEMBLE)
    )
    return rate_difference(single, several)


def _missing(results: ObstacleResults, largest_m: float) -> Evidence:
    """Share of the reaches of networks per setting that end farther from the goal, at the prescribed time."""
    rows = results.rows(TRAINED, NETWORK, SETTING, PUBLISHED)
    far = (rows["goal_distance_m"] > largest_m).groupby(rows["person"])
    return clustered_share(far.sum().to_numpy(), far.size().to_numpy())


def _low(results: ObstacleResults, column: str, largest: float) -> dict[str, Evidence]:
    """Share of scenarios with an error of the network that is as low as published."""
    cases = {}
    for words, part in PARTS.items():
        errors = results.setting_fits(column, part)
        if errors.empty:
            return dict.fromkeys(PARTS, UNKNOWN)
        low = (errors[NETWORK] <= largest).groupby(level="person")
        cases[words] = (low.sum().to_numpy(), low.size().to_numpy())
    return by_case(clustered_share, cases)


def _gain(results: ObstacleResults, column: str) -> dict[str, Evidence]:
    """Error of Rai et al. minus that of the network, each the mean over a person's scenarios."""
    cases = {}
    for words, part in PARTS.items():
        errors: pd.DataFrame = results.setting_fits(column, part).groupby(level="person").mean()
        if errors.empty:
            return dict.fromkeys(PARTS, UNKNOWN)
        cases[words] = (errors[HUMAN_INSPIRED], errors[NETWORK])
    return by_case(difference, cases)
