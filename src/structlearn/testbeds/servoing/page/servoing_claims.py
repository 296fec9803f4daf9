"""The dissertation's statements on latent-space tactile servoing, beside what is found here."""

from collections.abc import Sequence
from itertools import pairwise

import pandas as pd

from structlearn.ground.metrics import verdict
from structlearn.reporting.claim_rows import HOLDS, Row
from structlearn.reporting.paired_gains import Pairs, gains
from structlearn.reporting.prose import with_interval
from structlearn.tactile.inverse_dynamics import JACOBIAN
from structlearn.tactile.latent_comparison import SPLITS
from structlearn.tactile.latent_evaluation import UNCHANGED
from structlearn.tactile.latent_models import FORWARD_OF, NO_INVERSE, STRUCTURES
from structlearn.testbeds.servoing.page.servoing_loop_claims import loop_claims
from structlearn.testbeds.servoing.page.servoing_published import TEST_CHAIN
from structlearn.testbeds.servoing.page.servoing_results import (
    TRAINED_DYNAMICS,
    ServoingResults,
    seed_interval,
)
from structlearn.testbeds.servoing.page.servoing_tables import BOUNDS, dynamics_kinds, dynamics_name

AIMED_DISTANCES_NMSE = 0.01
"""Map distances: what this project set out to stay below."""

AWAY = 1.0
"""Cosine distance from which on an action points away from the one that was done."""


def servoing_claims(results: ServoingResults) -> list[Row]:
    """Rows of the table of claims."""
    return [
        _below(results, "reconstruction", "The autoencoder's reconstruction NMSE is below", "II.4.2"),
        _below(results, "distances", "Map distances against geodesics have an NMSE below", "II.4.3"),
        _aimed(results),
        _grows(results),
        _structure(results),
        _structure_relative(results),
        _loss(results),
        _best(results),
        _loss_is_needed(results),
        _points_away(results),
        _easier(results),
        *([] if results.loop is None else loop_claims(results.loop, results.other_skins)),
    ]


def claims_frame(rows: Sequence[Row]) -> pd.DataFrame:
    """The table of claims."""
    return pd.DataFrame(rows, columns=["statement", "source", "found", "holds"])


def _below(results: ServoingResults, column: str, statement: str, source: str) -> Row:
    bound = BOUNDS[column]
    values = {split: results.latents(column, True, split) for split in SPLITS}
    each = [f"{split} {with_interval(*seed_interval(found), '.4f')}" for split, found in values.items()]
    worst = max(found.max() for found in values.values())
    return (
        f"{statement} {bound:g} in all splits",
        source,
        f"{', '.join(each)}; the worst seed and split {worst:.4f}",
        "yes" if worst < bound else "no",
    )


def _aimed(results: ServoingResults) -> Row:
    worst = max(results.latents("distances", True, split).max() for split in SPLITS)
    return (
        f"… and below {AIMED_DISTANCES_NMSE:g}",
        "this project",
        f"the worst seed and split {worst:.4f}",
        "yes" if worst < AIMED_DISTANCES_NMSE else "no",
    )


def _grows(results: ServoingResults) -> Row:
    lengths = [steps for steps in results.steps if steps <= TEST_CHAIN]
    rising, cases = 0, 0
    for kind, way in dynamics_kinds():
        if kind == UNCHANGED:
            continue
        for structure in STRUCTURES:
            errors = [results.forwards(kind, way, structure, steps) for steps in lengths]
            for before, after in pairwise(errors):
                mean, half = seed_interval(after - before)
                cases, rising = cases + 1, rising + bool(mean - half > 0)
    return (
        "Forward NMSE grows with the length of the chain",
        "Fig. II.4",
        f"from 1 to {TEST_CHAIN} steps it rises in {rising} of {cases} cases (models, latent spaces, steps) "
        "with a 95 % interval above 0",
        "yes" if rising == cases else "no",
    )


def _by_structure(results: ServoingResults, relative: bool) -> Pairs:
    values = results.relative_forwards if relative else results.forwards
    return {
        dynamics_name(kind, way): (values(kind, way, False), values(kind, way, True))
        for kind, way in dynamics_kinds()
        if kind != UNCHANGED
    }


def _structure(results: ServoingResults) -> Row:
    found, holds = gains(_by_structure(results, relative=False))
    return (
        "Structure in the latent space lowers forward NMSE in every case",
        "Fig. II.4",
        f"chain of {TEST_CHAIN}, without structure minus with it: {found}",
        holds,
    )


def _structure_relative(results: ServoingResults) -> Row:
    found, holds = gains(_by_structure(results, relative=True))
    return (
        "… relative to the prediction that nothing moves",
        "this project",
        f"the same difference of NMSE over that prediction's NMSE: {found}",
        holds,
    )


def _loss(results: ServoingResults) -> Row:
    pairs = {
        dynamics_name(forward, way): (
            results.forwards(forward, way, True),
            results.forwards(forward, NO_INVERSE, True),
        )
        for forward, way in TRAINED_DYNAMICS
    }
    found, holds = gains(pairs)
    return (
        "The inverse model's loss raises forward NMSE somewhat",
        "Fig. II.4",
        f"chain of {TEST_CHAIN}, with structure, with the loss minus without: {found}",
        holds,
    )


def _best(results: ServoingResults) -> Row:
    best = results.cosines(JACOBIAN)
    others = [name for name in FORWARD_OF if name != JACOBIAN]
    found, holds = gains({f"{name} minus NJ": (results.cosines(name), best) for name in others})
    return (
        "The network's Jacobian (NJ) is the best inverse model",
        "Fig. II.5",
        f"cosine distance {best.mean():.3f}; {found}",
        holds,
    )


def _loss_is_needed(results: ServoingResults) -> Row:
    found, holds = gains({"NJ": (results.cosines(JACOBIAN, with_loss=False), results.cosines(JACOBIAN))})
    return (
        "The inverse model's loss is essential for a good inverse model",
        "Fig. II.5",
        f"cosine distance without the loss minus with it: {found}",
        holds,
    )


def _points_away(results: ServoingResults) -> Row:
    values = {name: results.cosines(name, with_loss=False) for name in FORWARD_OF}
    each = [f"{name} {with_interval(*seed_interval(found), '.3f')}" for name, found in values.items()]
    mean, half = seed_interval(values[JACOBIAN] - AWAY)
    return (
        "Without that loss a model does not provide correct actions: they point the wrong way",
        "II.4.4",
        f"cosine distance {', '.join(each)}; 0 is the right direction, {AWAY:g} a right angle, 2 the "
        "opposite; yes means: NJ above 1",
        HOLDS[str(verdict(mean - half, mean + half))],
    )


def _easier(results: ServoingResults) -> Row:
    pairs = {
        name: (results.cosines(name), results.cosines(name, comparison="forward")) for name in FORWARD_OF
    }
    found, holds = gains(pairs)
    return (
        "What the forward model predicts is an easier target than what followed",
        "Fig. II.5",
        f"cosine distance to reach what followed minus what is predicted: {found}",
        holds,
    )
