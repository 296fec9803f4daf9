"""Sections on what was recorded, on the primitives and on their sequence."""

import pandas as pd

from structlearn.primitives.orientation import QuaternionPrimitive
from structlearn.reporting.page import Block, Prose, Section, Sizes, Table, beside
from structlearn.reporting.prose import capitalised, counted, listing
from structlearn.testbeds.scraping.page.scraping_results import ScrapingResults


def recorded(results: ScrapingResults, sizes: Sizes) -> Section:
    """What the demonstrations are, and which could not be cut."""
    example = results.example
    signals = ["position"]
    signals += ["orientation"] if example.orientation is not None else []
    signals += ["force and torque"] if example.wrench is not None else []
    if example.tactile is not None:
        signals.append(counted(example.tactile.shape[1], "tactile channel"))
    durations = [demonstration.time[-1] for demonstration in results.demonstrations]
    blocks: list[Block] = [
        Prose(
            f"{capitalised(counted(len(results.demonstrations), 'demonstration'))} of "
            f"{min(durations):.1f} to {max(durations):.1f} s, on one clock of {1 / example.dt:.0f} Hz, with "
            f"{listing(signals)}. The primitives are {listing(results.segmentation.primitives)}."
        )
    ]
    left_out = results.segmentation.left_out
    if len(left_out):
        blocks += [
            Prose(
                f"{capitalised(counted(len(left_out), 'demonstration'))} could not be cut and was left out:"
                if len(left_out) == 1
                else f"{len(left_out)} demonstrations could not be cut and were left out:"
            ),
            Table(left_out, source="tables/demonstrations_left_out.csv"),
        ]
    blocks.append(
        beside(
            "demonstrations",
            sizes,
            "Position per axis and speed of all demonstrations. The reference is the one that is cut by its "
            "zero-velocity crossings alone; all others are aligned with it.",
            "Four panels over time: x, y and z position and speed of every demonstration.",
        )
    )
    truth = (
        " Dotted: the true cut points, which only a simulation knows."
        if example.true_segments is not None
        else ""
    )
    touch = (
        " Touch: the channels that change most, relative to their first reading."
        if example.tactile is not None
        else ""
    )
    blocks.append(
        beside(
            "one_demonstration",
            sizes,
            f"Demonstration {example.name} in detail, with the cut points found.{truth}{touch}",
            f"Signals of demonstration {example.name} over time, shaded by primitive.",
        )
    )
    return Section("What was recorded", tuple(blocks), results.simulated)


def primitives(results: ScrapingResults, sizes: Sizes) -> Section:
    """How well the primitives reproduce the demonstrations, and what drives them."""
    fit = results.fit
    chosen = results.fit_parameters.regression
    blocks: list[Block] = [
        Prose(
            f"Each primitive has {results.fit_parameters.kernel_count} kernels per axis and is learned from "
            f"all segments at once (IV.5.4), here by {chosen} regression. Position is learned in the local "
            "frame of the reach (IV.6.1), orientation as a quaternion (eq. IV.2)."
            if results.has_orientation
            else f"Each primitive has {results.fit_parameters.kernel_count} kernels per axis and is learned "
            f"from all segments at once (IV.5.4), here by {chosen} regression, in the local frame of the "
            "reach (IV.6.1). No orientation was recorded."
        ),
        beside(
            "position_fit",
            sizes,
            "Segments of all demonstrations relative to their own goal, and the primitive unrolled from the "
            "mean start to the mean goal.",
            "Position over normalised time, one row per primitive, one column per axis.",
        ),
    ]
    if results.has_orientation:
        blocks.append(
            beside(
                "orientation_fit",
                sizes,
                "The same for the orientation, as rotation vector from the goal in the base frame.",
                "Rotation vector over normalised time, one row per primitive, one column per axis.",
            )
        )
    blocks.append(Prose(_reproduction(fit[fit["regression"] == chosen])))
    shown = fit.assign(left_out=fit["left_out"].map({False: "all", True: "all but the one compared"}))[
        ["primitive", "regression", "left_out", *[c for c in fit.columns if c.endswith(("_mm", "_deg"))]]
    ]
    blocks.append(
        Table(
            shown,
            "Distance of the demonstrations from the primitive, unrolled with their start, goal and "
            "duration: mean over the demonstrations of the mean distance, largest distance, largest distance "
            "at the end.",
            formats={"mean_mm": ".2f", "max_mm": ".1f", "end_mm": ".3f"}
            | {"mean_deg": ".2f", "max_deg": ".1f", "end_deg": ".2f"},
            headings={"left_out": "learned from"}
            | {f"{what}_mm": f"{what} (mm)" for what in ("mean", "max", "end")}
            | {f"{what}_deg": f"{what} (°)" for what in ("mean", "max", "end")},
            strong=frozenset(
                place for place, regression in enumerate(shown["regression"]) if regression == chosen
            ),
            source="tables/reproduction.csv",
        )
    )
    turning = any(isinstance(primitive.orientation, QuaternionPrimitive) for primitive in results.primitives)
    blocks.append(
        beside(
            "forcing",
            sizes,
            "Forcing terms (eq. IV.6) in the local frame, whose x axis points along the reach"
            + (", and of the orientation in the base frame" if turning else "")
            + ". They fade with the phase velocity u, so the goal is reached whatever the weights.",
            "Forcing terms of every primitive over normalised time, and the canonical system.",
        )
    )
    return Section("The primitives", tuple(blocks), results.simulated)


def sequence(results: ScrapingResults, sizes: Sizes) -> Section:
    """The primitives executed one after another."""
    jumps = listing(f"{100 * jump:.2g} % ({name})" for name, jump in results.acceleration_jumps.items())
    text = (
        "The primitives are unrolled one after another. Each starts in the state in which the one before it "
        "ended; its initial goal absorbs the difference (eq. IV.12 to IV.14). Within the sample of a switch "
        f"the acceleration changes by at most {jumps} of its maximum."
        if results.acceleration_jumps
        else "A single primitive: nothing has to be joined."
    )
    return Section(
        "The sequence",
        (
            Prose(text),
            beside(
                "sequence",
                sizes,
                "Left: from the mean start to the mean goals. Right: in a new situation, with another "
                "start, other goals and durations (parameters `generalise`). Vertical lines: switches.",
                "Position, speed and acceleration of both sequences over time.",
            ),
            beside(
                "sequence_space",
                sizes,
                "The same two sequences in space.",
                "Both sequences in three dimensions and from above, coloured by primitive.",
            ),
        ),
        results.simulated,
    )


def _reproduction(fit: pd.DataFrame) -> str:
    """One sentence on how well primitives reproduce what they did and did not learn from."""
    parts = []
    for left_out, words in ((False, "learned from"), (True, "left out")):
        rows = fit[fit["left_out"] == left_out]
        if len(rows):
            each = listing(f"{row.mean_mm:.1f} mm ({row.primitive})" for row in rows.itertuples())
            parts.append(f"Mean distance from demonstrations that were {words}: {each}.")
    ends = f"Ends are met within {fit['end_mm'].max():.2f} mm"
    return " ".join([*parts, f"{ends} and {fit['end_deg'].max():.2f}°." if "end_deg" in fit else f"{ends}."])
