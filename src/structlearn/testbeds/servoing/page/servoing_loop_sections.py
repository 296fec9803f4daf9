"""The sections of the servoing page on closed loops."""

from dataclasses import replace

import pandas as pd

from structlearn.reporting.page import Prose, Section, Sizes, Table, beside
from structlearn.tactile.latent_models import FORWARD_OF
from structlearn.testbeds.servoing.page.servoing_loop import ACTING, TEXT, ServoLoop, ServoTrials, percent
from structlearn.testbeds.servoing.page.servoing_loop_figures import FORMS
from structlearn.testbeds.servoing.protocol.servo_trials import MOTIONS, QUICK_FILTER, RESTING, Variant

FEWEST = 10
"""Successes below which their medians are not shown."""

FORMATS = {"reach_s": ".1f", "path_ratio": ".2f", "position_error_mm": ".2f", "pressure_error": ".1f"}
HEADINGS = {
    "motions": "by motion (%)",
    "reach_s": "time (s)",
    "path_ratio": "path",
    "position_error_mm": "off (mm)",
    "pressure_error": "pressure (%)",
    "lifted": "in air",
    "off_skin": "off skin",
}
NOTE = (
    "Reached: share of trials with Wilson's 95 % interval. Time until the tolerances are kept, and path "
    f"over the shortest on the skin: medians of successes, of {FEWEST} or more. Off, pressure: median errors "
    "of all. In the air, off the skin: numbers of trials."
)
"""What the columns of `shown` are."""

MOTIONS_NOTE = f"By motion: {', '.join(MOTIONS)}."


def closed_loop(loop: ServoLoop, sizes: Sizes) -> Section:
    """Figure II.6."""
    main = [Variant(form, name) for form in FORMS for name in FORWARD_OF]
    return Section(
        "Closed loop",
        (
            Prose(_trials(loop)),
            Prose(_controllers(loop)),
            beside(
                "loop_success",
                sizes,
                f"Share of {loop.rate(ACTING)['trials']:.0f} targets that are reached, for every controller "
                "the same ones.",
                "Four panels of bars for three inverse models.",
            ),
            Prose(_success(loop)),
            Table(
                shown(loop, main),
                f"Structure, forward models trained with the inverse model's loss. {NOTE} {MOTIONS_NOTE}",
                formats=FORMATS,
                headings=HEADINGS,
                source="tables/loops.csv",
            ),
            beside(
                "loop_progress",
                sizes,
                "Left and middle: how trials come closer to their target; the middle also asks for the "
                "pressure. Right: success over the distance that is tolerated, at the same tolerance for "
                "pressure. Dotted: 1 mm.".replace("1 mm", f"{loop.parameters.tolerance.position_mm:g} mm"),
                "Three panels of curves for three inverse models in two forms.",
            ),
            beside(
                "loop_paths",
                sizes,
                "Left and middle: ways of the true contact over the flat skin from its start (dark grey) "
                "to the target (cross), the first trials of every seed; red: missed; light: electrodes. "
                "Right: length of the way over the shortest, successes of all trials; who ends "
                "within the tolerance may travel a little less.",
                "Two flat skins with paths, and a scatter plot of lengths.",
            ),
        ),
        simulated=True,
    )


def beyond(loop: ServoLoop) -> Section:
    """Longer horizons, and what the resting controller is made of."""
    steps = loop.parameters.horizon
    ahead = [
        Variant(form, name, horizon=horizon)
        for form in FORMS
        for name in ("LL", "NJ")
        for horizon in (1, steps)
    ]
    changed = [one for one in loop.variants if one.change]
    return Section(
        "Beyond: horizon, and what makes the difference",
        (
            Prose(_horizon(loop)),
            Table(
                shown(loop, ahead, ["horizon"]),
                f"One step against {steps} steps ahead. {NOTE}",
                formats=FORMATS,
                headings=HEADINGS,
            ),
            Prose(_changes(loop)),
            Table(
                shown(loop, [TEXT, ACTING, *changed], ["change"]),
                f"One thing changed at a time, in either form. {NOTE}",
                formats=FORMATS,
                headings=HEADINGS,
            ),
        ),
        simulated=True,
    )


def shown(loop: ServoTrials, variants: list[Variant], keys: list[str] | None = None) -> pd.DataFrame:
    """Rows of `ServoTrials.table` as a page shows them, shares in %; motions only without `keys`."""
    table = loop.table()
    rows = pd.concat([loop.of(table, variant) for variant in variants], ignore_index=True)
    shares = 100 * rows[[f"rate_{motion}" for motion in loop.motions]].to_numpy()
    rows = rows.assign(
        reached=[_unbroken(percent(row)) for _, row in rows.iterrows()],
        motions=[_unbroken(" | ".join(f"{share:.0f}" for share in its)) for its in shares],
        pressure_error=100 * rows["pressure_error"],
        **{name: rows[name].where(rows["successes"] >= FEWEST) for name in ("reach_s", "path_ratio")},
    )
    columns = ["form", "inverse", *(keys or []), "reached", *(["motions"] if keys is None else [])]
    measured = ["reach_s", "path_ratio", "position_error_mm", "pressure_error", "lifted", "off_skin"]
    return rows[[*columns, *measured]]


def _unbroken(text: str) -> str:
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def _trials(loop: ServoLoop) -> str:
    parameters, tolerance = loop.parameters, loop.parameters.tolerance
    row = loop.rate(ACTING)
    return (
        "A finger rests on the handle with a random place of its skin and a random load, and is to feel it "
        "at another random place and load; what that feels like is all that the controller is given. In "
        "thirds, the contact has to go across the finger (rotation), along it (translation), or both. "
        f"{row['trials']:.0f} targets: {parameters.trials} for each of {loop.seeds} trained models, "
        f"{parameters.duration_s:g} s each. A target is reached if over the last {tolerance.judged_s:g} s "
        f"the true contact is within {tolerance.position_mm:g} mm of it and the pressure within "
        f"{100 * tolerance.pressure:g} %. The dissertation shows eight photographs of a robot (figure II.6) "
        "and no numbers."
    )


def _controllers(loop: ServoLoop) -> str:
    published, resting = loop.parameters.published, loop.parameters.resting
    return (
        "Controllers come in two forms with the same trained models. As published: the inverse model of "
        f"the text, an action for {published.loop.samples_per_action} samples of the electrodes, readings "
        f"behind the causal form of the low-pass at {published.loop.cutoff_hz:g} Hz. Resting: the same "
        "inverse problems, but a finger at rest is taken to keep its touch; actions are measured by how "
        f"likely they were in the demonstrations; slopes are taken between actions of {resting.spread:g} "
        f"times that size, not at a point; each step goes {resting.approach:g} of the way; and the low-pass "
        f"is at {resting.loop.cutoff_hz:g} Hz, an action for {resting.loop.samples_per_action} samples."
    )


def _success(loop: ServoLoop) -> str:
    text, acting = loop.rate(TEXT), loop.rate(ACTING)
    bare = loop.rate(replace(ACTING, structure=False))
    others = "; ".join(
        f"{name} {percent(loop.rate(Variant(RESTING, name)))}"
        for name in FORWARD_OF
        if name != ACTING.inverse
    )
    told = f"As published, NJ reaches {percent(text)} of the targets"
    if text["lifted"]:
        told += (
            f"; in {text['lifted']:.0f} of {text['trials']:.0f} trials the finger is in the air at some time"
        )
    told += f". The resting controller reaches {percent(acting)} with NJ"
    if acting["successes"]:
        told += (
            f", in {acting['reach_s']:.1f} s in the median and on {acting['path_ratio']:.2f} times the "
            "shortest way"
        )
    told += f"; {others}. Without structure it reaches {percent(bare)} with NJ."
    if bare["high"] < acting["low"]:
        told += " So in closed loop structure helps as the dissertation says, whatever forward NMSE says."
    return told


def _horizon(loop: ServoLoop) -> str:
    steps = loop.parameters.horizon
    rates = {horizon: percent(loop.rate(replace(ACTING, horizon=horizon))) for horizon in (1, steps)}
    return (
        f"LL and NJ can look several steps ahead: all {steps} actions are chosen so that every step is near "
        f"the target, and the first is done. Resting, NJ reaches {rates[1]} with one step and "
        f"{rates[steps]} with {steps}."
    )


def _changes(loop: ServoLoop) -> str:
    own = {one.change: loop.rate(one)["rate"] for one in loop.variants if one.change and one.form == RESTING}
    worst = min(own, key=lambda change: own[change])
    quick = "; ".join(
        f"{name} {percent(loop.rate(Variant(TEXT.form, name, change=QUICK_FILTER)))}" for name in FORWARD_OF
    )
    return (
        "What does the resting form owe its success to? One thing at a time is put back as published. The "
        f"largest loss comes with “{worst}”: {100 * own[worst]:.1f} % are reached. The other way round, the "
        f"published controllers with the quicker filter alone reach: {quick}. The numbers of the resting "
        "form were settled outside the pipeline: about 120 configurations were tried on another 120 trials, "
        "with other contacts but the same six models and the same sensor. The published form had no such "
        "search, and how the resting one does with a sensor on which it was not settled, only the other "
        "skins below tell."
    )
