"""Figures of closed loops: success by controller, time and tolerance, and the ways that contacts take."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from structlearn.palette import BLACK, GREY, LIGHT_GREY, VERMILION
from structlearn.reporting.figures import canvas, styled
from structlearn.tactile.electrodes import Skin
from structlearn.tactile.latent_models import STRUCTURES
from structlearn.testbeds.servoing.page.servoing_figures import INVERSE_COLOURS
from structlearn.testbeds.servoing.page.servoing_loop import ACTING, TEXT, ServoLoop
from structlearn.testbeds.servoing.page.servoing_tables import structure_name
from structlearn.testbeds.servoing.protocol.servo_trials import PUBLISHED, RESTING, Variant

FORMS = {PUBLISHED: "as published", RESTING: "resting"}
"""Forms of controllers by their names."""

LINES = {PUBLISHED: "--", RESTING: "-"}


def pictures(loop: ServoLoop, skin: Skin) -> dict[str, Figure]:
    """All figures of closed loops by name."""
    return {
        "loop_success": success_figure(loop),
        "loop_progress": progress_figure(loop),
        "loop_paths": paths_figure(loop, skin),
    }


@styled
def success_figure(loop: ServoLoop) -> Figure:
    """Share of targets reached: a panel per form and latent space, as figure II.5."""
    figure = canvas(2.9)
    panels = figure.subplots(1, len(FORMS) * len(STRUCTURES), sharey=True)
    cases = [(form, structure) for form in FORMS for structure in STRUCTURES]
    for panel, (form, structure) in zip(panels, cases, strict=True):
        for place, (name, colour) in enumerate(INVERSE_COLOURS.items()):
            for shift, with_loss in ((-0.2, True), (0.2, False)):
                row = loop.rate(Variant(form, name, structure, with_loss))
                panel.bar(
                    place + shift,
                    100 * row["rate"],
                    0.36,
                    color=colour if with_loss else "white",
                    edgecolor=colour,
                )
                ends = 100 * row[["low", "high"]].to_numpy(float)
                panel.plot([place + shift] * 2, ends, color=BLACK, linewidth=1.1)
        panel.set_title(f"{FORMS[form].capitalize()}, {structure_name(structure)}", fontsize=8.5)
        panel.set_xticks(range(len(INVERSE_COLOURS)), list(INVERSE_COLOURS))
        panel.grid(axis="x", visible=False)
    panels[0].set(ylabel="% of targets reached", ylim=(0, 100))
    handles = [
        Patch(facecolor=GREY, edgecolor=GREY, label="forward model trained with the inverse model's loss"),
        Patch(facecolor="white", edgecolor=GREY, label="without"),
        Line2D([], [], color=BLACK, label="95 % interval (Wilson)"),
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), columnspacing=1.6)
    return figure


@styled
def progress_figure(loop: ServoLoop) -> Figure:
    """Distance over time, share within both tolerances over time, and success over the tolerance."""
    figure = canvas(3.2)
    distance, within, tolerance = figure.subplots(1, 3)
    for form, line in LINES.items():
        for name, colour in INVERSE_COLOURS.items():
            variant = Variant(form, name)
            rows = loop.of(loop.progress, variant)
            distance.plot(rows["time_s"], rows["median_mm"], color=colour, linestyle=line)
            within.plot(rows["time_s"], 100 * rows["within"], color=colour, linestyle=line)
            shares = loop.of(loop.by_tolerance, variant)
            tolerance.plot(shares["tolerance_mm"], 100 * shares["rate"], color=colour, linestyle=line)
    bound = loop.parameters.tolerance
    distance.axhline(bound.position_mm, color=VERMILION, linestyle=":", linewidth=1.1)
    distance.set(title="Distance, median", xlabel="time (s)", ylabel="mm", ylim=(0, None))
    within.set(title="Within both tolerances", xlabel="time (s)", ylabel="% of trials", ylim=(0, 100))
    tolerance.axvline(bound.position_mm, color=VERMILION, linestyle=":", linewidth=1.1)
    tolerance.set(title="Success over the tolerance", xlabel="distance tolerated (mm)", ylim=(0, 100))
    for panel in (distance, within, tolerance):
        panel.set_xlim(0, None)
    handles = [Line2D([], [], color=colour, label=name) for name, colour in INVERSE_COLOURS.items()]
    handles += [
        Line2D([], [], color=BLACK, linestyle=LINES[form], label=words) for form, words in FORMS.items()
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), columnspacing=1.6)
    return figure


@styled
def paths_figure(loop: ServoLoop, skin: Skin) -> Figure:
    """Ways of true contacts over the flat skin, and their length beside the shortest."""
    figure = canvas(3.6)
    *flat, length = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 0.9))
    for panel, variant in zip(flat, (TEXT, ACTING), strict=True):
        _ways(panel, loop, variant, skin)
        panel.set_title(f"NJ, {FORMS[variant.form]}")
    flat[0].set_ylabel("across (mm)")
    flat[1].sharex(flat[0])
    flat[1].sharey(flat[0])
    reached = loop.of(loop.trials, ACTING)
    reached = reached[reached["success"]]
    top = 1.05 * max(reached["path_mm"].max(), 1.0) if len(reached) else 1.0
    length.plot([0, top], [0, top], color=GREY, linewidth=0.9)
    length.plot(
        reached["geodesic_mm"],
        reached["path_mm"],
        "o",
        color=INVERSE_COLOURS[ACTING.inverse],
        markersize=3,
        markeredgewidth=0,
        alpha=0.4,
    )
    length.set(
        title="Length of successes, resting", xlabel="shortest on the skin (mm)", ylabel="travelled (mm)"
    )
    length.set(xlim=(0, None), ylim=(0, top))
    return figure


def _ways(panel: Axes, loop: ServoLoop, variant: Variant, skin: Skin) -> None:
    """Ways of shown trials from start (grey) to target (cross)."""
    trials = loop.of(loop.trials, variant).set_index(["seed", "trial"])
    for key, path in loop.of(loop.paths, variant).groupby(["seed", "trial"]):
        row = trials.loc[key]
        start, target = (
            1e3 * np.array(skin.coordinates(row[[f"{name}_{axis}_m" for axis in "xyz"]].to_numpy(float)))
            for name in ("start", "target")
        )
        touching = path[path["load_n"] > 0]
        way = 1e3 * np.stack(skin.coordinates(touching[["x_m", "y_m", "z_m"]].to_numpy(float)))
        colour = INVERSE_COLOURS[variant.inverse] if row["success"] else VERMILION
        panel.plot(*way, color=colour, linewidth=1.0, alpha=0.8)
        panel.plot(*start, "o", color=GREY, markersize=4, markeredgewidth=0)
        panel.plot(*target, "x", color=BLACK, markersize=5)
    electrodes = 1e3 * np.stack(skin.coordinates(skin.project(skin.electrodes)))
    panel.plot(*electrodes, "o", color=LIGHT_GREY, markersize=6, zorder=0)
    panel.set(xlabel="along the finger (mm)", aspect="equal")
