"""The section of the servoing page on fingers of another shape."""

import pandas as pd

from structlearn.reporting.page import Prose, Section, Table
from structlearn.reporting.prose import capitalised, counted, listing
from structlearn.tactile.latent_models import FORWARD_OF
from structlearn.testbeds.servoing.page import servoing_tables
from structlearn.testbeds.servoing.page.servoing_loop import ACTING, percent
from structlearn.testbeds.servoing.page.servoing_loop_figures import FORMS
from structlearn.testbeds.servoing.page.servoing_loop_sections import FORMATS, HEADINGS, NOTE, shown
from structlearn.testbeds.servoing.page.servoing_other_skins import OtherSkins, skin_name
from structlearn.testbeds.servoing.protocol.servo_trials import Variant

WHY = {
    "sphere": (
        " What is hard seems to be the range: the normal of the sphere turns by up to 60 degrees both ways, "
        "and what a velocity does turns with it. In trials outside the pipeline, half the range (5 mm and "
        "30 degrees to either side) gives 168 of 168 targets, and a forward NMSE of 0.19 instead of 0.42 at "
        "3 steps; twice the steps of training over the whole range give 144 of 168."
    )
}
"""What is known of why a skin is missed more often, by skin."""


def other_skins(skins: OtherSkins) -> Section:
    """What other skins learn, and how they servo; they are simulated, whoever demonstrated to the first."""
    chosen = [Variant(form, name) for form in FORMS for name in FORWARD_OF]
    learned = servoing_tables.other_skins(skins)
    loops = pd.concat(
        [shown(loop, chosen, []).assign(skin=skin_name(name)) for name, loop in skins.loops.items()],
        ignore_index=True,
    )
    errors = [name for name in learned if name in servoing_tables.LATENT_COLUMNS]
    parts = {
        name: [f"{row[f'{name}_linear']:.2f} | {row[f'{name}_angular']:.2f}" for _, row in learned.iterrows()]
        for name in FORWARD_OF
    }
    return Section(
        "Other skins",
        (
            Prose(_said(skins)),
            Table(
                learned.assign(skin=learned["skin"].map(skin_name), **parts)[["skin", *errors, *parts]],
                "With structure, on test contacts, means over seeds: NMSE of the latent space, and cosine "
                "distances of actions to reach what followed, linear | angular, each inverse model trained "
                "with its loss.",
                formats=dict.fromkeys(errors, ".4f"),
                headings=servoing_tables.LATENT_COLUMNS,
                source="tables/other_skins.csv",
            ),
            Prose(_reached(skins)),
            Table(
                loops[["skin", *loops.columns.drop("skin")]],
                f"Structure, forward models trained with the inverse model's loss. {NOTE}",
                formats=FORMATS,
                headings=HEADINGS,
                source="tables/other_skin_loops.csv",
            ),
        ),
        simulated=True,
    )


def _said(skins: OtherSkins) -> str:
    chosen = skins.parameters
    rigid = [skin_name(name) for name, skin in chosen.skins.items() if skin.across_deg == 0]
    told = (
        "The method does not assume a specific geometry of the sensor (II.1). So the same code goes the "
        "whole way once more, from demonstrations to closed loops, with other skins: "
        f"{listing(skin_name(name) for name in skins.loops)}. Less is trained: "
        f"{counted(chosen.seeds, 'seed')}, {chosen.steps} steps, {counted(chosen.bins, 'bin')} of geodesic "
        "distances; all else, the numbers of the controllers too, is as above."
    )
    if rigid:
        told += (
            f" The {listing(rigid)} slides over a knob and is not turned, so that angular actions show how a "
            "hand shakes and there is little to learn of them."
        )
    return told


def _reached(skins: OtherSkins) -> str:
    rows = {name: loop.rate(ACTING) for name, loop in skins.loops.items()}
    told = "Acting cautiously, NJ reaches " + listing(
        f"{percent(row)} of {row['trials']:.0f} targets with the {skin_name(name)}"
        for name, row in rows.items()
    )
    told += "."
    for name, loop in skins.loops.items():
        trials = loop.of(loop.trials, ACTING)
        missed = trials[~trials["success"]]
        if len(missed) < 0.05 * len(trials):
            continue
        near = int((missed["position_error_mm"] <= loop.parameters.tolerance.position_mm).sum())
        each = listing(f"{100 * share:.0f} %" for share in loop.successes(ACTING))
        told += (
            f" {capitalised(skin_name(name))}: {each} by seed; {near} of the {len(missed)} that miss end at "
            f"the right place with the wrong pressure.{WHY.get(name, '')}"
        )
    return told
