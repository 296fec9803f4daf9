"""Figures of the magnetic skin: the skin beside its map, errors of all models, ways on the plate, forces."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from structlearn.palette import BLACK, BLUE, GREY, LIGHT_GREY, VERMILION
from structlearn.reporting.claims import Evidence
from structlearn.reporting.figure_style import Drawing, Raster, styled
from structlearn.reporting.panels import legend, map_panels, panel
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page.parts.skin_evidence import ARROW, SkinRuns
from structlearn.tasks.public.public_files import shown_map

BOUND_MM = 0.8
"""The aim of the claims."""

WAYS = 16
"""Ways that are drawn."""

STROKES_S = 120.0
"""Of the forces, so much is drawn."""


def skin_pictures(runs: SkinRuns) -> dict[str, Drawing | Sequence[Drawing]]:
    """All figures by name, as far as there are data for them."""
    drawn: dict[str, Drawing | Sequence[Drawing]] = {"skin_errors": errors_panel(runs)}
    if "maps" in runs.tables:
        drawn["skin_map"] = skin_map(runs)
    if "paths" in runs.tables:
        drawn["skin_ways"] = ways_panel(runs)
    if "traces" in runs.tables:
        drawn["skin_force"] = force_panel(runs)
    return drawn


def skin_map(runs: SkinRuns) -> list[Raster]:
    """Where presses were, and where they lie in the map that was learned from another run."""
    maps, numbers = shown_map(runs.tables["maps"], runs.tuned_on), runs.numbers
    first = maps.iloc[0]
    titles = (
        f"The skin: where {numbers[first['asked_about']]} pressed it",
        f"Its map, learned from {numbers[first['learned_from']]}",
    )
    return map_panels(maps, titles, 4.6, 2.5)


@styled
def errors_panel(runs: SkinRuns) -> list[Figure]:
    """Map error and place error of all models, on blocks held out and on other runs."""
    cases = {"blocks held out": runs.tested, "other run": runs.across}
    figures = []
    for error, title, label in (
        ("map_nmse", "Distances on the map", "NMSE"),
        ("latent_mm", "Place of the press", "median error (mm)"),
    ):
        figure, axes = panel(title, ylabel=label, yscale="log" if error == "map_nmse" else "linear")
        for place, (model, look) in enumerate(public_names.SKIN_MODELS.items()):
            for group, of in enumerate(cases.values()):
                _bar(
                    axes,
                    group * (len(public_names.SKIN_MODELS) + 1) + place,
                    of(error, model),
                    look,
                    group == 0,
                )
        axes.set_xticks([1.5, 1.5 + len(public_names.SKIN_MODELS) + 1], list(cases))
        axes.grid(visible=False, axis="x")
        if error == "latent_mm":
            axes.axhline(BOUND_MM, color=BLACK, linewidth=0.8, linestyle="--")
        figures.append(legend(figure))
    return figures


def _bar(axes: Axes, place: float, found: Evidence, look: public_names.Look, labelled: bool) -> None:
    if not np.isfinite(found.value):
        return
    ends = np.nan_to_num([[found.value - found.low], [found.high - found.value]])
    label = look.name if labelled else None
    axes.bar(place, found.value, 0.8, color=look.colour, label=label, yerr=ends, ecolor=BLACK, capsize=2.0)


@styled
def ways_panel(runs: SkinRuns) -> list[Figure]:
    """Ways of the probe from press to press, one panel per run that was learned from."""
    numbers, figures = runs.numbers, []
    for (first, second), its in runs.tables["paths"].groupby(["learned_from", "asked_about"]):
        title = f"Servoing, {numbers[first]} {ARROW} {numbers[second]}"
        figure, axes = panel(title, 4.4, xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
        middle = 0.5e3 * (its[["x_m", "y_m"]].min() + its[["x_m", "y_m"]].max()).to_numpy()
        for trial, way in its.groupby("trial"):
            if trial >= WAYS:
                break
            path = 1e3 * way.sort_values("step")[["x_m", "y_m"]].to_numpy() - middle
            target = 1e3 * way[["target_x_m", "target_y_m"]].to_numpy()[0] - middle
            axes.plot(*np.array([path[0], target]).T, color=LIGHT_GREY, linewidth=0.9)
            axes.plot(*path.T, color=BLUE, linewidth=1.0)
            axes.plot(*path[0], "o", color=GREY, markersize=3.0)
            axes.plot(*target, "x", color=VERMILION, markersize=5.0)
        figures.append(figure)
    return figures


@styled
def force_panel(runs: SkinRuns) -> list[Figure]:
    """Force of the scale, and read off the skin by what was learned from another run."""
    numbers, figures = runs.numbers, []
    for (first, second), its in runs.tables["traces"].groupby(["learned_from", "asked_about"]):
        its = its[its["time_s"] - its["time_s"].iloc[0] < STROKES_S].iloc[::2]
        title = f"{numbers[first].capitalize()} {ARROW} {numbers[second]}"
        figure, axes = panel(title, xlabel="time (s)", ylabel="force (N)")
        axes.plot(its["time_s"], its["force_n"], color=GREY, linewidth=2.4, label="scale")
        axes.plot(its["time_s"], its["read_n"], color=BLUE, linewidth=1.1, label="read off the skin")
        figures.append(legend(figure))
    return figures
