"""Figures of a skin: the skin beside its map, errors of all models, paths on the plate, forces."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.palette import BLACK, BLUE, GREY, LIGHT_GREY, ORANGE
from structlearn.reporting.figure_style import Drawing, Raster, legend, map_panels, panel, styled
from structlearn.tasks.touch.skin_section import ARROW, SkinRuns, of_mean
from structlearn.tasks.touch.touch_names import NEW_RUN, SPACES, shown_map

BOUND_MM = 0.8
"""The aim of the claims."""

PATHS = 16
"""Paths that are drawn."""

STROKES_S = 120.0
"""Of the forces, so much is drawn."""


def skin_pictures(runs: SkinRuns) -> dict[str, Drawing | Sequence[Drawing]]:
    """All figures by name, as far as there are data for them."""
    drawn: dict[str, Drawing | Sequence[Drawing]] = {}
    if "errors" in runs.tables:
        drawn = {"skin_map": skin_map(runs), "skin_errors": errors_panel(runs)}
    if "paths" in runs.tables:
        drawn["skin_paths"] = paths_panel(runs)
    if "traces" in runs.tables:
        drawn["skin_force"] = force_panel(runs)
    return drawn


def skin_map(runs: SkinRuns) -> list[Raster]:
    """Where touches were, and where they lie in the map that was learned from another run or other blocks."""
    if "maps" not in runs.tables:
        maps = runs.tables["map"]
        extent = 0.1e3 * np.ptp(maps[["x_m", "y_m"]], axis=0).max()
        return map_panels(maps, ("Where touches were", "Where they lie in the map"), 4.4, extent)
    maps = shown_map(runs.tables["maps"], runs.tuned_on)
    learned, asked = (runs.numbers[maps[column].iloc[0]] for column in ("learned_from", "asked_about"))
    titles = f"The skin: where {asked} pressed it", f"Its map, learned from {learned}"
    return map_panels(maps, titles, 4.6, 2.5)


@styled
def errors_panel(runs: SkinRuns) -> list[Figure]:
    """Map error and place error of all models, on blocks held out and on other runs."""
    cases: dict[str, Callable[[str, str], pd.Series]] = {
        "blocks held out": runs.held_out,
        "other run": partial(runs.errors, NEW_RUN),
    }
    if "maps" not in runs.tables:
        del cases["other run"]
    figures, apart = [], len(SPACES) + 1
    for error, title, label in (
        ("map_nmse", "Distances on the map", "NMSE"),
        ("latent_mm", "Place of the press", "median error (mm)"),
    ):
        figure, axes = panel(title, ylabel=label, yscale="log" if error == "map_nmse" else "linear")
        for place, (model, look) in enumerate(SPACES.items()):
            for group, of in enumerate(cases.values()):
                found = of_mean(of(error, model))
                if np.isfinite(found.value):
                    ends = np.nan_to_num([[found.value - found.low], [found.high - found.value]])
                    name, at = None if group else look.name, group * apart + place
                    axes.bar(at, found.value, 0.8, color=look.colour, label=name)
                    axes.errorbar(at, found.value, ends, color=BLACK, capsize=2.0)
        axes.set_xticks([1.5 + group * apart for group in range(len(cases))], list(cases))
        axes.grid(visible=False, axis="x")
        if error == "latent_mm" and "maps" in runs.tables:
            axes.axhline(BOUND_MM, color=BLACK, linewidth=0.8, linestyle="--")
        figures.append(legend(figure))
    return figures


@styled
def paths_panel(runs: SkinRuns) -> list[Figure]:
    """Paths of the probe from press to press, one panel per run that was learned from."""
    numbers, figures = runs.numbers, []
    for (first, second), its in runs.tables["paths"].groupby(["learned_from", "asked_about"]):
        title = f"Servoing, {numbers[first]} {ARROW} {numbers[second]}"
        figure, axes = panel(title, 4.4, xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
        middle = 0.5e3 * (its[["x_m", "y_m"]].min() + its[["x_m", "y_m"]].max()).to_numpy()
        for _, way in its[its["trial"] < PATHS].groupby("trial"):
            path = 1e3 * way.sort_values("step")[["x_m", "y_m"]].to_numpy() - middle
            target = 1e3 * way[["target_x_m", "target_y_m"]].to_numpy()[0] - middle
            axes.plot(*np.array([path[0], target]).T, color=LIGHT_GREY, linewidth=0.9)
            axes.plot(*path.T, color=BLUE, linewidth=1.0)
            axes.plot(*path[0], "o", color=GREY, markersize=3.0)
            axes.plot(*target, "x", color=ORANGE, markersize=5.0)
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
