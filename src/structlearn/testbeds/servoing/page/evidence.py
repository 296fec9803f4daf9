"""What was found for each of the claims, by the names that `claims.yaml` uses."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from structlearn.reporting.claims import (
    UNKNOWN,
    Evidence,
    Found,
    by_case,
    clustered_share,
    difference,
    mean,
)
from structlearn.reporting.studies import Study
from structlearn.tactile.latent_variants import FORWARD_OF, NO_INVERSE
from structlearn.tactile.touch_dataset import SPLITS
from structlearn.testbeds.servoing.names import (
    DYNAMICS,
    OURS,
    SKIN_NAMES,
    STRUCTURE_NAMES,
    TEXT,
    dynamics_name,
)
from structlearn.testbeds.servoing.page.results import AS_IT_STANDS, ServoingResults
from structlearn.testbeds.servoing.protocol.controller_scores import ControllerScores
from structlearn.testbeds.servoing.protocol.model_scores import TEST_CHAIN, ModelScores
from structlearn.testbeds.servoing.protocol.servo_variants import Variant


def evidence(results: ServoingResults) -> dict[str, Found]:
    """What was found; closed loops are unknown where the demonstrations were recorded."""
    return _prediction(results.models) | _closed_loop(results) | _geometry(results) | _people(results)


def _prediction(models: ModelScores) -> dict[str, Found]:
    """Latent spaces, forward and inverse models: means, and paired differences over seeds."""
    cosines = models.cosines
    return {
        "reconstruction": by_case(
            mean, {split: (models.latents("reconstruction", True, split),) for split in SPLITS}
        ),
        "distances": by_case(mean, {split: (models.latents("distances", True, split),) for split in SPLITS}),
        "grows": {name: _smallest_rise(models, structure) for structure, name in STRUCTURE_NAMES.items()},
        "structure_predicts": _structured(models.forwards),
        "structure_predicts_pressure": _structured(models.forwards, column="pressure"),
        "loss_predicts": by_case(
            difference,
            {
                dynamics_name(forward, way): (
                    models.forwards(forward, way),
                    models.forwards(forward, NO_INVERSE),
                )
                for forward, way in DYNAMICS
                if way != NO_INVERSE
            },
        ),
        "nj_predicts": by_case(
            difference,
            {f"{name} minus NJ": (cosines(name), cosines("NJ")) for name in FORWARD_OF if name != "NJ"},
        ),
        "loss_directs": difference(cosines("NJ", with_loss=False), cosines("NJ")),
        "easier": by_case(
            difference, {name: (cosines(name), cosines(name, comparison="forward")) for name in FORWARD_OF}
        ),
    }


def _closed_loop(results: ServoingResults) -> dict[str, Found]:
    """Shares of targets, and differences in % of targets, paired over models."""
    trials = results.trials
    models = {name: replace(OURS, inverse=name) for name in FORWARD_OF}
    text_models = {name: replace(TEXT, inverse=name) for name in FORWARD_OF}
    return {
        "loss_needed": rate(trials, replace(TEXT, with_loss=False)) if _serves(trials) else UNKNOWN,
        "able": rate(trials, TEXT),
        "aimed": rate(trials, TEXT),
        "aimed_resting": rate(trials, OURS),
        "stays": rate(trials, OURS, "lost"),
        "structure_serves": _gains(trials, text_models, {"structure": False}),
        "structure_serves_resting": _gains(trials, models, {"structure": False}),
        "loss_serves": _gains(trials, models, {"with_loss": False}),
    }


def _geometry(results: ServoingResults) -> dict[str, Found]:
    found = {
        name: by_case(rate, {SKIN_NAMES[skin]: (its, variant) for skin, its in results.skins.items()})
        for name, variant in (("geometry", TEXT), ("geometry_resting", OURS), ("geometry_aimed", OURS))
    }
    return found if _serves(results.trials) else found | {"geometry": UNKNOWN}


def _people(results: ServoingResults) -> dict[str, Found]:
    """Shares of targets over other people with other sensors, each with models of its own."""
    return {
        "able_people": over_people(results.people, "servo_success_rate_published"),
        "aimed_people": over_people(results.people, "servo_success_rate"),
    }


def over_people(study: Study | None, key: str) -> Evidence:
    """Mean of a metric over the people of the study; unknown where it was not run."""
    return UNKNOWN if study is None else mean(study.values(AS_IT_STANDS, key))


def rate(trials: ControllerScores, variant: Variant, what: str = "success", comparisons: int = 1) -> Evidence:
    """Share of trials in which a controller reaches its target, or loses the contact; clustered by model."""
    counts = trials.counts(variant)
    return clustered_share(counts[what].to_numpy(), counts["trials"].to_numpy(), comparisons)


def _structured(values: Callable[..., np.ndarray], **column: str) -> Found:
    """Errors without structure minus with it, of all forward models."""
    return by_case(
        difference,
        {
            dynamics_name(*kind): (values(*kind, False, **column), values(*kind, True, **column))
            for kind in DYNAMICS
        },
    )


def _smallest_rise(models: ModelScores, structure: bool) -> Evidence:
    """Of forward NMSE from one step of prediction to the next, over all models: the one that says least."""
    lengths = [steps for steps in models.steps if steps <= TEST_CHAIN]
    cases = [(kind, before, after) for kind in DYNAMICS for before, after in pairwise(lengths)]
    rises = [
        difference(
            models.forwards(*kind, structure, after), models.forwards(*kind, structure, before), len(cases)
        )
        for kind, before, after in cases
    ]
    return min(rises, key=lambda rise: (rise.high > 0.0, rise.low))


def _serves(trials: ControllerScores) -> bool:
    """Whether the text's controller works on the skin that it learned from.

    Where it does not, its failing elsewhere, or without the inverse model's loss, says nothing of either.
    """
    return rate(trials, TEXT).low > 0.5


def _gains(trials: ControllerScores, models: Mapping[str, Variant], without: Mapping[str, bool]) -> Found:
    """What each controller gains by something that it would be `without`."""
    return _differences(trials, {name: (model, replace(model, **without)) for name, model in models.items()})


def _differences(trials: ControllerScores, pairs: Mapping[str, tuple[Variant, Variant]]) -> Found:
    return by_case(
        difference,
        {
            name: (trials.successes(first), trials.successes(second))
            for name, (first, second) in pairs.items()
        },
    )
