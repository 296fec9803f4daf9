"""Evidence for each of the claims, by the names that `claims.yaml` uses.

All of it is over people: of each, the whole branch was run anew, demonstrations, sensor, models and trials.
So people are independent, which seeds of one person's models are not. The numbers are those of `metrics.json`
and `details.json` by the same keys, means over the models of a person, from the study `servoing/people`; what
the person of this run shows is in figures and tables and decides nothing.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from structlearn.reporting.claims import (
    UNKNOWN,
    Evidence,
    Found,
    by_case,
    clustered_share,
    difference,
    mean,
    quoted,
    rate_difference,
)
from structlearn.tactile.latent_parameters import FORWARD_OF, LOCALLY_LINEAR, NO_INVERSE, InverseModel
from structlearn.tactile.touch_dataset import SPLITS
from structlearn.testbeds.servoing.names import (
    DYNAMICS,
    OURS,
    SKIN_NAMES,
    STRUCTURE_NAMES,
    TEXT,
    dynamics_name,
)
from structlearn.testbeds.servoing.page.results import PEOPLE_STUDY, ServoingResults, forward_key, rate_key
from structlearn.testbeds.servoing.protocol.model_scores import TEST_CHAIN
from structlearn.testbeds.servoing.protocol.servo_scores import ControllerScores
from structlearn.testbeds.servoing.protocol.servo_variants import Variant

TEXT_LL = replace(TEXT, inverse=LOCALLY_LINEAR)
"""The published controller with the locally linear model, which the text did not try on a robot."""

Numbers = Callable[[str], np.ndarray | None]
"""A metric by person (P,), by its key; None where it is not known."""


def evidence(results: ServoingResults) -> dict[str, Found]:
    """What was found over people; unknown where they were not studied, or the study kept no such number."""
    found = _prediction(results.of_people)
    return quoted(found | _closed_loop(results) | _geometry(results), PEOPLE_STUDY)


def over_people(make: Callable[..., Evidence], *samples: np.ndarray | None, comparisons: int = 1) -> Evidence:
    """`make(*samples)` of numbers by person, (P,) each; unknown where one of these is not known."""
    return UNKNOWN if any(one is None for one in samples) else make(*samples, comparisons=comparisons)


def rate_of_people(
    results: ServoingResults, variant: Variant, skin: str = "", comparisons: int = 1
) -> Evidence:
    """Share of targets that a controller reaches over people, with the skin or another one."""
    return over_people(
        partial(_clustered, results.trials_per_person(skin)),
        results.of_people(rate_key(variant, skin)),
        comparisons=comparisons,
    )


def rate(trials: ControllerScores, variant: Variant) -> Evidence:
    """Share of trials of one person in which a controller reaches its target; clustered by model."""
    counts = trials.counts(variant)
    found = clustered_share(counts["success"].to_numpy(), counts["trials"].to_numpy())
    return replace(found, people=None)  # these are trained models, so no sentence may call them people


def _prediction(numbers: Numbers) -> dict[str, Found]:
    """Latent spaces, forward and inverse models: means, and differences in pairs of one person."""

    def means(key: str) -> Found:
        cases = {split: (numbers(f"{key}_{split}"),) for split in SPLITS}
        return by_case(partial(over_people, mean), cases)

    def cosines(name: str, ending: str = "") -> np.ndarray | None:
        return numbers(f"cosine_distance_{name.lower()}{ending}")

    return {
        "reconstruction": means("reconstruction_nmse"),
        "distances": means("mds_nmse"),
        "grows": {name: _smallest_rise(numbers, structure) for structure, name in STRUCTURE_NAMES.items()},
        "structure_predicts": _structured(numbers),
        "structure_predicts_pressure": _structured(numbers, column="pressure"),
        "loss_predicts": _differences(
            {
                dynamics_name(forward, way): (
                    numbers(forward_key(forward, way, structure=True)),
                    numbers(forward_key(forward, NO_INVERSE, structure=True)),
                )
                for forward, way in DYNAMICS
                if way != NO_INVERSE
            }
        ),
        "nj_predicts": _differences(
            {f"{name} minus NJ": (cosines(name), cosines("NJ")) for name in FORWARD_OF if name != "NJ"}
        ),
        "loss_directs": over_people(difference, cosines("NJ", "_without_loss"), cosines("NJ")),
        "easier": _differences({name: (cosines(name), cosines(name, "_predicted")) for name in FORWARD_OF}),
    }


def _closed_loop(results: ServoingResults) -> dict[str, Found]:
    """Shares of targets, and differences in % of targets, in pairs of one person."""
    models = {name: replace(OURS, inverse=name) for name in FORWARD_OF}
    text_models = {name: replace(TEXT, inverse=name) for name in FORWARD_OF}
    trials, lost = results.trials_per_person(), results.of_people("servo_contacts_lost")
    return {
        "loss_needed": _if_serves(results, TEXT, rate_of_people(results, replace(TEXT, with_loss=False))),
        "loss_needed_ll": _if_serves(
            results, TEXT_LL, rate_of_people(results, replace(TEXT_LL, with_loss=False))
        ),
        "able": rate_of_people(results, TEXT),
        "able_ll": rate_of_people(results, TEXT_LL),
        "aimed": rate_of_people(results, OURS),
        "stays": over_people(partial(_clustered, trials), None if lost is None else lost / trials),
        "structure_serves": _gains(results, text_models, {"structure": False}),
        "structure_serves_resting": _gains(results, models, {"structure": False}),
        "loss_serves": _gains(results, models, {"with_loss": False}),
    }


def _geometry(results: ServoingResults) -> dict[str, Found]:
    def with_others(variant: Variant) -> dict[str, Evidence]:
        cases = {SKIN_NAMES[skin]: (results, variant, skin) for skin in results.skins}
        return by_case(rate_of_people, cases)

    return {
        "geometry": _if_serves(results, TEXT, with_others(TEXT)),
        "geometry_ll": _if_serves(results, TEXT_LL, with_others(TEXT_LL)),
        "geometry_aimed": with_others(OURS),
    }


def _if_serves(results: ServoingResults, variant: Variant, found: Found) -> Found:
    """Evidence over people on a controller that works in its own training setting; else unknown.

    Where it does not, its failing elsewhere, or without the inverse model's loss, says nothing of either.
    """
    return found if rate_of_people(results, variant).low > 0.5 else UNKNOWN


def _clustered(trials: int, rates: np.ndarray, comparisons: int = 1) -> Evidence:
    """A share over people of as many trials each, from their rates (P,)."""
    return clustered_share(np.rint(trials * rates), np.full(len(rates), trials), comparisons)


def _structured(numbers: Numbers, column: str = "") -> Found:
    """Errors without structure minus with it, of all forward models."""
    return _differences(
        {
            dynamics_name(*kind): tuple(
                numbers(forward_key(*kind, structure, column=column)) for structure in (False, True)
            )
            for kind in DYNAMICS
        }
    )


def _smallest_rise(numbers: Numbers, structure: bool) -> Evidence:
    """Of forward NMSE from one step of prediction to the next, over all models: the one that says least."""
    cases = [(kind, steps, steps + 1) for kind in DYNAMICS for steps in range(1, TEST_CHAIN)]
    rises = [
        over_people(
            difference,
            numbers(forward_key(*kind, structure, after)),
            numbers(forward_key(*kind, structure, before)),
            comparisons=len(cases),
        )
        for kind, before, after in cases
    ]
    return UNKNOWN if UNKNOWN in rises else min(rises, key=lambda rise: (rise.high > 0.0, rise.low))


def _gains(
    results: ServoingResults, models: Mapping[InverseModel, Variant], without: Mapping[str, Any]
) -> Found:
    """What each controller gains by something that it would be `without`, in % of targets."""

    def rates(variant: Variant) -> np.ndarray | None:
        return results.of_people(rate_key(variant))

    return by_case(
        partial(over_people, rate_difference),
        {name: (rates(model), rates(replace(model, **without))) for name, model in models.items()},
    )


def _differences(pairs: Mapping[str, tuple[np.ndarray | None, ...]]) -> Found:
    """First minus second of each pair of numbers by person."""
    return by_case(partial(over_people, difference), pairs)
