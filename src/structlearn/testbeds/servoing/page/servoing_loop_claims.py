"""Statements on closed loops: the dissertation's, and what this project set out to reach."""

from dataclasses import replace

from structlearn.reporting.claim_rows import Row
from structlearn.reporting.paired_gains import gains
from structlearn.tactile.latent_models import FORWARD_OF
from structlearn.testbeds.servoing.page.servoing_loop import ACTING, TEXT, ServoLoop, percent
from structlearn.testbeds.servoing.page.servoing_other_skins import OtherSkins, skin_name
from structlearn.testbeds.servoing.protocol.servo_trials import Variant

AIMED = 0.95
"""Share of targets that this project set out to reach."""


def loop_claims(loop: ServoLoop, skins: OtherSkins) -> list[Row]:
    """Rows of the table of claims."""
    return [
        _reaches(loop),
        *_aimed(loop),
        _stays(loop),
        _structure(loop),
        _loss(loop),
        _best(loop),
        _horizon(loop),
        _geometry(skins),
    ]


def _decided(low: float, high: float, bound: float) -> str:
    return "yes" if low > bound else "no" if high < bound else "undecided"


def _reaches(loop: ServoLoop) -> Row:
    row = loop.rate(TEXT)
    return (
        "The non-linear model and NJ produce the motions that bring a contact to its target",
        "Fig. II.6",
        f"the controller as published: {percent(row)} of {row['trials']:.0f} targets; "
        f"{row['lifted']:.0f} times the finger came off; yes means: more than half",
        _decided(row["low"], row["high"], 0.5),
    )


def _aimed(loop: ServoLoop) -> list[Row]:
    rows = []
    for words, variant in (("as published", TEXT), ("the resting controller", ACTING)):
        row = loop.rate(variant)
        rows.append(
            (
                f"{100 * AIMED:.0f} % of random targets are reached with NJ within "
                f"{loop.parameters.tolerance.position_mm:g} mm and "
                f"{100 * loop.parameters.tolerance.pressure:.0f} % pressure: {words}",
                "this project",
                f"{percent(row)} of {row['trials']:.0f} targets",
                _decided(row["low"], row["high"], AIMED),
            )
        )
    return rows


def _stays(loop: ServoLoop) -> Row:
    row = loop.rate(ACTING)
    return (
        "… and the contact is never lost and never leaves the skin: the resting controller",
        "this project",
        f"finger in the air in {row['lifted']:.0f}, contact beyond the ends of the skin in "
        f"{row['off_skin']:.0f} of {row['trials']:.0f} trials",
        "yes" if row["lifted"] + row["off_skin"] == 0 else "no",
    )


def _structure(loop: ServoLoop) -> Row:
    pairs = {
        name: tuple(
            100 * loop.successes(replace(ACTING, inverse=name, structure=structure))
            for structure in (True, False)
        )
        for name in FORWARD_OF
    }
    found, holds = gains(pairs, ".1f")
    return (
        "Structure in the latent space is critical to success",
        "II.5",
        f"resting controllers, % of targets with structure minus without: {found}",
        holds,
    )


def _loss(loop: ServoLoop) -> Row:
    pairs = {
        name: tuple(
            100 * loop.successes(replace(ACTING, inverse=name, with_loss=with_loss))
            for with_loss in (True, False)
        )
        for name in FORWARD_OF
    }
    found, holds = gains(pairs, ".1f")
    return (
        "The inverse model's loss is essential, in closed loop",
        "II.4.5",
        f"resting controllers, % of targets with the loss minus without: {found}",
        holds,
    )


def _best(loop: ServoLoop) -> Row:
    best = 100 * loop.successes(ACTING)
    pairs = {
        f"NJ minus {name}": (best, 100 * loop.successes(replace(ACTING, inverse=name)))
        for name in FORWARD_OF
        if name != ACTING.inverse
    }
    found, holds = gains(pairs, ".1f")
    return "NJ is the best inverse model, in closed loop", "II.4.5", f"% of targets, {found}", holds


def _horizon(loop: ServoLoop) -> Row:
    steps = loop.parameters.horizon
    pairs = {
        name: tuple(
            100 * loop.successes(Variant(ACTING.form, name, horizon=horizon)) for horizon in (steps, 1)
        )
        for name in ("LL", "NJ")
    }
    found, holds = gains(pairs, ".1f")
    return (
        f"Looking {steps} steps ahead reaches more targets than one step",
        "this project",
        f"resting controllers, difference in % of targets: {found}",
        holds,
    )


def _geometry(skins: OtherSkins) -> Row:
    rows = {name: trials.rate(ACTING) for name, trials in skins.loops.items()}
    each = "; ".join(f"{skin_name(name)} {percent(row)} of {row['trials']:.0f}" for name, row in rows.items())
    verdicts = {_decided(row["low"], row["high"], 0.5) for row in rows.values()}
    return (
        "The method does not assume a geometry of the skin",
        "II.1",
        f"targets reached with other skins, resting controller with NJ: {each}; yes means: more than half "
        "with every one",
        verdicts.pop() if len(verdicts) == 1 else "no" if "no" in verdicts else "undecided",
    )
