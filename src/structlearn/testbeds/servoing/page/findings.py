"""Findings on tactile servoing: what sentences and claims of the page name.

Claims and sentences are over people. For each the whole branch was run anew, demonstrations, sensor, models
and trials, by the study `servoing/people`: so people are independent, which seeds of one person's models are
not. A person's row `servo_success_rate` is one of `people_servo_success_rate`, which n counts. Rows of the
person of this run are what the study gathers; they decide nothing.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from structlearn.reporting.claims import UNKNOWN, Evidence, Found, clustered_share, difference
from structlearn.reporting.findings import Findings
from structlearn.tactile.latent_parameters import FORWARD_OF, JACOBIAN, LOCALLY_LINEAR, NO_INVERSE, STRUCTURES
from structlearn.tactile.touch_dataset import SPLITS
from structlearn.testbeds.servoing.names import (
    DYNAMICS,
    OURS,
    SKIN_NAMES,
    STRUCTURE_NAMES,
    TEXT,
    dynamics_name,
)
from structlearn.testbeds.servoing.page.results import PEOPLE_STUDY, TEST_CHAIN, ServoingResults
from structlearn.testbeds.servoing.protocol.servo_scores import ControllerScores
from structlearn.testbeds.servoing.protocol.servo_variants import AS_DATA, Variant, variants_of_other_skins

TEXT_LL = replace(TEXT, inverse=LOCALLY_LINEAR)
"""The published controller with the locally linear model, which the text did not try on a robot."""

RATE, FORWARD = "servo_success_rate", "forward_nmse"
SPACE_KEYS = {True: "struct", False: "nostruct"}  # latent spaces in the names of findings

HEADLINES_OF_ONE = {
    "reconstruction_nmse": ("test",),
    "mds_nmse": ("test",),
    FORWARD: ("chain3_struct",),
    "cosine_distance": ("nj", "nj_without_loss"),
    RATE: ("", "published", "nostruct", "sphere", "flat_pad"),
}
"""Where people were not studied with these parameters: by these one compares experiments."""

Numbers = Callable[[str], np.ndarray | None]
"""A person's row over people (P,), by its key; None where the study was not run, or kept no such number."""


def findings(results: ServoingResults) -> Findings:
    """All of the page."""
    find = Findings(f"models of person {results.chosen['toucher'].seed}")
    _of_person(find, results)
    if not results.people.count:
        find.mark(HEADLINES_OF_ONE)
    over_people(find.among("people", PEOPLE_STUDY), results)
    return find


def over_people(find: Findings, results: ServoingResults) -> None:
    """Rows on which claims and sentences rest; not tested where the study was not run."""
    _prediction(find, results.people.numbers)
    _closed_loop(find, results)


def rate(trials: ControllerScores, variant: Variant) -> Evidence:
    """Share of trials of one person in which a controller reaches its target; clustered by model."""
    counts = trials.counts(variant)
    found = clustered_share(counts["success"].to_numpy(), counts["trials"].to_numpy())
    return replace(found, people=None)  # these are trained models, so no sentence may call them people


def rate_case(variant: Variant, skin: str = "") -> str:
    """`ll_nostruct_published`; NJ, structure, the inverse model's loss and the resting form are not named."""
    words = (
        skin,
        "" if variant.inverse == JACOBIAN else variant.inverse.lower(),
        "" if variant.structure else SPACE_KEYS[False],
        "" if variant.with_loss else "without_loss",
        "as_data" if variant.change == AS_DATA else "",
        "published" if variant.form == TEXT.form else "",
    )
    return "_".join(filter(None, words))


def forward_case(
    forward: str, trained_with: str, structure: bool, steps: int = TEST_CHAIN, column: str = ""
) -> str:
    """`chain3_pressure_nl_nj_struct`; of a column of forward NMSE."""
    way = "" if trained_with == NO_INVERSE else trained_with.lower()
    words = (f"chain{steps}", column, forward.lower(), way, SPACE_KEYS[structure])
    return "_".join(filter(None, words))


def rated() -> list[Variant]:
    """Controllers whose share of targets is a finding."""
    every = product((TEXT, OURS), FORWARD_OF, STRUCTURES, (True, False))
    found = [
        replace(form, inverse=name, structure=space, with_loss=loss) for form, name, space, loss in every
    ]
    return found + [replace(form, change=AS_DATA) for form in (TEXT, OURS)]


def _of_person(find: Findings, results: ServoingResults) -> None:
    """Means over models, on test contacts, of spaces with structure where nothing else is said.

    `forward_nmse_chain3_struct` is of NL with NJ. Cosine distances ask for the latent state that followed,
    `*_predicted` for the predicted one, of each inverse model with the forward model trained with it.
    """
    models, loops = results.models, results.trials
    ours = loops.rate(OURS)
    find.exact("samples", len(results.dataset))
    find.exact("pairs", results.pairs)
    find.exact("contact_point_error_mm", results.contact_errors["error_mm"].median())
    find.exact("pressure_nmse_test", models.latents("pressure").mean())
    for name in ("trials", "reach_s", "path_ratio"):
        find.exact(f"servo_{name}", ours[name])
    for name, column in (("reconstruction_nmse", "reconstruction"), ("mds_nmse", "distances")):
        find.mean(name, {split: models.latents(column, split=split) for split in SPLITS})
    errors = {f"chain3_{SPACE_KEYS[space]}": models.forwards("NL", "NJ", space) for space in STRUCTURES}
    for column, space in product(("plane", "third", "pressure", "electrodes"), STRUCTURES):
        errors[f"chain3_{column}_{SPACE_KEYS[space]}"] = models.forwards("NL", "NJ", space, column=column)
    for kind, space in product(DYNAMICS, STRUCTURES):
        for steps in range(1, TEST_CHAIN + 1):
            errors[forward_case(*kind, space, steps)] = models.forwards(*kind, space, steps)
        pressure = models.forwards(*kind, space, column="pressure")
        errors[forward_case(*kind, space, column="pressure")] = pressure
    find.mean(FORWARD, errors)
    cosines = {name.lower(): models.cosines(name) for name in FORWARD_OF}
    cosines |= {
        f"{name.lower()}_predicted": models.cosines(name, comparison="forward") for name in FORWARD_OF
    }
    find.mean("cosine_distance", cosines | {"nj_without_loss": models.cosines("NJ", with_loss=False)})
    rates = {rate_case(one): rate(loops, one) for one in rated()}
    for skin, its in results.skins.items():
        rates |= {rate_case(one, skin): rate(its, one) for one in variants_of_other_skins()}
    find.add(RATE, rates)
    lost = {"": loops.counts(OURS), "published": loops.counts(TEXT)}
    find.counted(
        "servo_contacts_lost", {case: (its["lost"].sum(), its["trials"].sum()) for case, its in lost.items()}
    )


def _prediction(find: Findings, numbers: Numbers) -> None:
    """Latent spaces, forward and inverse models: means, and differences in pairs of one person."""

    def cosines(name: str, ending: str = "") -> np.ndarray | None:
        return numbers(f"cosine_distance_{name.lower()}{ending}")

    def forward(kind: tuple[str, str], structure: bool, steps: int = TEST_CHAIN, column: str = "") -> Any:
        return numbers(f"{FORWARD}_{forward_case(*kind, structure, steps, column)}")

    for name in ("reconstruction_nmse", "mds_nmse"):
        splits = {split: numbers(f"{name}_{split}") for split in SPLITS}
        find.mean(f"people_{name}", splits, headline=("test",))
    grows = {name: _smallest_rise(forward, structure) for structure, name in STRUCTURE_NAMES.items()}
    find.add("grows", grows)
    for name, column in (("structure_predicts", ""), ("structure_predicts_pressure", "pressure")):
        pairs = {
            dynamics_name(*kind): (forward(kind, False, column=column), forward(kind, True, column=column))
            for kind in DYNAMICS
        }
        find.difference(name, pairs)
    with_loss = {
        dynamics_name(model, way): (forward((model, way), True), forward((model, NO_INVERSE), True))
        for model, way in DYNAMICS
        if way != NO_INVERSE
    }
    find.difference("loss_predicts", with_loss)
    others = {f"{name} minus NJ": (cosines(name), cosines("NJ")) for name in FORWARD_OF if name != "NJ"}
    find.difference("nj_predicts", others)
    find.difference("loss_directs", cosines("NJ", "_without_loss"), cosines("NJ"))
    find.difference("easier", {name: (cosines(name), cosines(name, "_predicted")) for name in FORWARD_OF})
    parts = product(("", "plane_", "third_", "pressure_", "electrodes_"), SPACE_KEYS.values())
    for case in (f"chain3_{column}{space}" for column, space in parts):
        headline = case == "chain3_struct"
        find.mean(f"people_{FORWARD}_{case}", numbers(f"{FORWARD}_{case}"), headline=headline)
    for name in ("ll", "ng", "nj", "nj_without_loss"):
        find.mean(f"people_cosine_distance_{name}", numbers(f"cosine_distance_{name}"), headline="nj" in name)


def _closed_loop(find: Findings, results: ServoingResults) -> None:
    """Shares of targets, and differences in % of targets, in pairs of one person."""
    find.exact("people", results.people.count or float("nan"), headline=True)

    def rates(variant: Variant, skin: str = "") -> np.ndarray | None:
        return results.people.numbers("_".join(filter(None, (RATE, rate_case(variant, skin)))))

    def share(name: str, *given: object, skin: str = "", headline: bool = False) -> Found:
        return find.by(partial(_clustered, results.trials_per_person(skin)), name, *given, headline=headline)

    def gain(name: str, form: Variant, **without: Any) -> None:
        models = {inverse: replace(form, inverse=inverse) for inverse in FORWARD_OF}
        pairs = {inverse: (rates(one), rates(replace(one, **without))) for inverse, one in models.items()}
        find.rate_difference(name, pairs)

    shown = [(TEXT, ""), (TEXT_LL, ""), (OURS, ""), (replace(OURS, structure=False), "")]
    shown += [(variant, skin) for skin in results.skins for variant in (TEXT, OURS)]
    for variant, skin in shown:
        name = "_".join(filter(None, ("people", RATE, rate_case(variant, skin))))
        share(name, rates(variant, skin), skin=skin, headline=not skin or variant == OURS)
    trials = results.trials_per_person()
    for ending in ("", "_published"):
        lost = results.people.numbers(f"servo_contacts_lost{ending}")
        share(f"people_servo_contacts_lost{ending}", None if lost is None else lost / trials)
    for ending, variant in (("", TEXT), ("_ll", TEXT_LL), ("_aimed", OURS)):
        with_skins = {SKIN_NAMES[skin]: rates(variant, skin) for skin in results.skins}
        its = rates(variant)
        serves = variant == OURS or (its is not None and _clustered(trials, its).low > 0.5)
        # where a controller fails, its failing elsewhere or without the loss says nothing of either
        if variant != OURS:
            share(f"loss_needed{ending}", rates(replace(variant, with_loss=False)) if serves else None)
        if serves:
            share(f"geometry{ending}", with_skins, skin="other")
        else:
            find.unknown(f"geometry{ending}")
    gain("structure_serves", TEXT, structure=False)
    gain("structure_serves_resting", OURS, structure=False)
    gain("loss_serves", OURS, with_loss=False)


def _clustered(trials: int, rates: np.ndarray, comparisons: int = 1) -> Evidence:
    """A share over people of as many trials each, from their rates (P,)."""
    return clustered_share(np.rint(trials * rates), np.full(len(rates), trials), comparisons)


def _smallest_rise(forward: Callable[..., Any], structure: bool) -> Evidence:
    """Of forward NMSE from one step of prediction to the next, over all models: the one that says least."""
    cases = [(kind, steps) for kind in DYNAMICS for steps in range(1, TEST_CHAIN)]
    pairs = [(forward(kind, structure, n + 1), forward(kind, structure, n)) for kind, n in cases]
    if any(one is None for pair in pairs for one in pair):
        return UNKNOWN
    rises = [difference(*pair, comparisons=len(cases)) for pair in pairs]
    return min(rises, key=lambda rise: (rise.high > 0.0, rise.low))
