"""What was found for each of the claims, by the names that `claims.yaml` uses."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from structlearn.reporting.claims import UNKNOWN, Evidence, Found, counted, difference, exact, share
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
from structlearn.testbeds.servoing.page.results import ServoingResults
from structlearn.testbeds.servoing.protocol.controller_scores import ControllerScores
from structlearn.testbeds.servoing.protocol.model_scores import TEST_CHAIN, ModelScores
from structlearn.testbeds.servoing.protocol.servo_variants import Variant


def evidence(results: ServoingResults) -> dict[str, Found]:
    """What was found; closed loops are unknown where the demonstrations were recorded."""
    return _prediction(results.models) | _closed_loop(results) | _geometry(results)


def _prediction(models: ModelScores) -> dict[str, Found]:
    """Latent spaces, forward and inverse models: largest values, and paired differences over seeds."""
    distances = {split: _largest(models, "distances", split) for split in SPLITS}
    cosines = models.cosines
    return {
        "reconstruction": {split: _largest(models, "reconstruction", split) for split in SPLITS},
        "distances": distances,
        "distances_aimed": distances,
        "grows": {name: _smallest_rise(models, structure) for structure, name in STRUCTURE_NAMES.items()},
        "structure_predicts": _structured(models.forwards),
        "structure_predicts_relative": _structured(models.relative_forwards),
        "loss_predicts": {
            dynamics_name(forward, way): difference(
                models.forwards(forward, way, True), models.forwards(forward, NO_INVERSE, True)
            )
            for forward, way in DYNAMICS
            if way != NO_INVERSE
        },
        "nj_predicts": {
            f"{name} minus NJ": difference(cosines(name), cosines("NJ"))
            for name in FORWARD_OF
            if name != "NJ"
        },
        "loss_directs": difference(cosines("NJ", with_loss=False), cosines("NJ")),
        "easier": {
            name: difference(cosines(name), cosines(name, comparison="forward")) for name in FORWARD_OF
        },
    }


def _closed_loop(results: ServoingResults) -> dict[str, Found]:
    """Shares of targets, and differences in % of targets, paired over seeds."""
    trials, horizon = results.trials, results.chosen["servo"].horizon
    models = {name: replace(OURS, inverse=name) for name in FORWARD_OF}
    text_models = {name: replace(TEXT, inverse=name) for name in FORWARD_OF}
    return {
        "loss_needed": _reached(trials, replace(TEXT, with_loss=False)) if _serves(trials) else UNKNOWN,
        "loss_needed_resting": _reached(trials, replace(OURS, with_loss=False)),
        "able": _reached(trials, TEXT),
        "aimed": _reached(trials, TEXT),
        "aimed_resting": _reached(trials, OURS),
        "stays": UNKNOWN if trials is None else counted(trials.lost(OURS), int(trials.rate(OURS)["trials"])),
        "structure_serves": _gains(trials, text_models, {"structure": False}),
        "structure_serves_resting": _gains(trials, models, {"structure": False}),
        "loss_serves": _gains(trials, models, {"with_loss": False}),
        "nj_serves": _differences(
            trials, {f"NJ minus {name}": (OURS, model) for name, model in models.items() if name != "NJ"}
        ),
        "horizon": _differences(
            trials, {name: (replace(models[name], horizon=horizon), models[name]) for name in ("LL", "NJ")}
        ),
    }


def _geometry(results: ServoingResults) -> dict[str, Found]:
    found = {
        name: {SKIN_NAMES[skin]: _reached(trials, variant) for skin, trials in results.skins.items()}
        for name, variant in (("geometry", TEXT), ("geometry_resting", OURS))
    }
    return found if _serves(results.trials) else found | {"geometry": UNKNOWN}


def _largest(models: ModelScores, column: str, split: str) -> Evidence:
    values = models.latents(column, True, split)
    return exact(values.max(), len(values))


def _structured(values: Callable[..., np.ndarray]) -> dict[str, Evidence]:
    """Errors without structure minus with it, of all forward models."""
    return {dynamics_name(*kind): difference(values(*kind, False), values(*kind, True)) for kind in DYNAMICS}


def _smallest_rise(models: ModelScores, structure: bool) -> Evidence:
    """Of forward NMSE from one step of prediction to the next, over all models: the one that says least."""
    lengths = [steps for steps in models.steps if steps <= TEST_CHAIN]
    rises = [
        difference(models.forwards(*kind, structure, after), models.forwards(*kind, structure, before))
        for kind in DYNAMICS
        for before, after in pairwise(lengths)
    ]
    return min(rises, key=lambda rise: (rise.high > 0.0, rise.low))


def _serves(trials: ControllerScores | None) -> bool:
    """Whether the text's controller works on the skin that it learned from.

    Where it does not, its failing elsewhere, or without the inverse model's loss, says nothing of either.
    """
    return _reached(trials, TEXT).low > 0.5


def _reached(trials: ControllerScores | None, variant: Variant) -> Evidence:
    if trials is None:
        return UNKNOWN
    row = trials.rate(variant)
    return share(int(row["successes"]), int(row["trials"]))


def _gains(
    trials: ControllerScores | None, models: Mapping[str, Variant], without: Mapping[str, bool]
) -> Found:
    """What each controller gains by something that it would be `without`."""
    return _differences(trials, {name: (model, replace(model, **without)) for name, model in models.items()})


def _differences(trials: ControllerScores | None, pairs: Mapping[str, tuple[Variant, Variant]]) -> Found:
    if trials is None:
        return UNKNOWN
    return {
        name: difference(trials.successes(first), trials.successes(second))
        for name, (first, second) in pairs.items()
    }
