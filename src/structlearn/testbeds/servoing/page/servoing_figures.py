"""Figures of the servoing testbed's latent spaces and models: figures II.3 to II.5."""

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from structlearn.ground.metrics import mean_interval
from structlearn.palette import BLACK, BLUE, GREEN, GREY, LIGHT_GREY, ORANGE, PURPLE, VERMILION
from structlearn.reporting.figures import canvas, styled
from structlearn.tactile.inverse_dynamics import JACOBIAN, LOCALLY_LINEAR, NEGATIVE_GRADIENT
from structlearn.tactile.latent_evaluation import UNCHANGED
from structlearn.tactile.latent_models import NO_INVERSE, STRUCTURES
from structlearn.testbeds.servoing.page.servoing_published import TEST_CHAIN
from structlearn.testbeds.servoing.page.servoing_results import (
    TRAINED_DYNAMICS,
    ServoingResults,
    seed_interval,
)
from structlearn.testbeds.servoing.page.servoing_tables import (
    BOUNDS,
    COMPARISONS,
    dynamics_name,
    structure_name,
)

STRUCTURE_COLOURS = {True: BLUE, False: ORANGE}
INVERSE_COLOURS = {LOCALLY_LINEAR: GREEN, NEGATIVE_GRADIENT: PURPLE, JACOBIAN: BLUE}
LATENT_COLOURS = {"reconstruction": BLUE, "distances": VERMILION, "pressure": GREEN}

MAP_SAMPLES = 12_000
"""Samples of the map that are drawn: more hide each other."""

FEWEST = 10
"""Samples in a square of `contact_bias` below which nothing is drawn."""


def electrode_colours(count: int) -> list[str]:
    """Colours of electrodes 1 to `count`; neighbours in number differ in lightness."""
    colours = mpl.colormaps["tab20"].colors
    return [mpl.colors.to_hex(colours[number % len(colours)]) for number in range(count)]


@styled
def map_figure(results: ServoingResults) -> Figure:
    """Figure II.3: the flat map beside the skin, every sample by its most active electrode."""
    figure = canvas(4.1)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    electrode = results.latent_map["electrode"].to_numpy()
    colours = np.array(electrode_colours(len(results.skin.electrodes)))
    kept = np.linspace(0, len(electrode) - 1, min(MAP_SAMPLES, len(electrode))).astype(int)
    for panel, points, title in (
        (panels[0], results.map_on_skin, "Latent map (x and y of z)"),
        (panels[1], results.places, "Contact points on the skin"),
    ):
        panel.scatter(*points[kept].T, s=2.5, c=colours[electrode[kept] - 1], linewidths=0, rasterized=True)
        for number in np.unique(electrode):
            middle = np.median(points[electrode == number], axis=0)
            panel.text(
                *middle,
                str(number),
                ha="center",
                va="center",
                fontsize=8,
                weight="bold",
                bbox={"boxstyle": "circle,pad=0.15", "facecolor": "white", "alpha": 0.8, "linewidth": 0},
            )
        panel.set(title=title, xlabel="along the finger (mm)", aspect="equal")
    panels[0].set_ylabel("across (mm)")
    return figure


@styled
def contact_figure(results: ServoingResults) -> Figure:
    """Error of the point of contact: over the skin, and how often which error occurs."""
    errors = results.contact_errors
    figure = canvas(3.3)
    place, share = figure.subplots(1, 2, width_ratios=(1.6, 1.0))
    bias = results.contact_bias
    drawn = bias[bias["samples"] >= FEWEST]
    arrows = place.quiver(
        drawn["square_along_mm"],
        drawn["square_across_mm"],
        drawn["along_mm"],
        drawn["across_mm"],
        drawn["error_mm"],
        angles="xy",
        scale_units="xy",
        scale=1.0,
        cmap="viridis_r",
        width=0.005,
    )
    electrodes = 1e3 * np.stack(
        results.skin.coordinates(results.skin.project(results.skin.electrodes)), axis=1
    )
    place.plot(*electrodes.T, "o", color=LIGHT_GREY, markersize=7, zorder=0)
    place.set(
        title="From the true to the estimated contact",
        xlabel="along the finger (mm)",
        ylabel="across (mm)",
        aspect="equal",
    )
    figure.colorbar(arrows, ax=place, label="mean error (mm)", shrink=0.9)
    ordered = np.sort(errors["error_mm"].to_numpy())
    level = np.linspace(0.0, 1.0, 201)
    share.plot(np.quantile(ordered, level), 100 * level, color=BLUE)
    share.axvline(1.0, color=VERMILION, linestyle="--", linewidth=1.1)
    share.set(title="Share of samples below", xlabel="error (mm)", ylabel="%", xlim=(0, None), ylim=(0, 100))
    return figure


@styled
def curve_figure(results: ServoingResults) -> Figure:
    """Errors on the test split while training, with intervals over seeds."""
    figure = canvas(3.2)
    spaces, models, actions = figure.subplots(1, 3)
    curve = results.curve[results.curve["structure"]]
    for name, colour in LATENT_COLOURS.items():
        _curve(spaces, curve[curve["quantity"] == name], colour, name)
        if name in BOUNDS:
            spaces.axhline(BOUNDS[name], color=colour, linestyle=":", linewidth=1.1)
    spaces.set(title="Latent space", ylabel="NMSE, test split", yscale="log", ylim=(None, 1.5))
    for (forward, way), colour in zip(
        [(LOCALLY_LINEAR, LOCALLY_LINEAR), ("NL", NEGATIVE_GRADIENT), ("NL", JACOBIAN)],
        INVERSE_COLOURS.values(),
        strict=True,
    ):
        _curve(
            models,
            curve[curve["quantity"] == f"forward {forward}-{way}"],
            colour,
            dynamics_name(forward, way),
        )
        _curve(actions, curve[curve["quantity"] == f"direction {way}-{way}"], colour, way)
    models.set(title=f"Forward, {TEST_CHAIN} steps", ylabel="NMSE", ylim=(0, None))
    actions.set(title="Inverse", ylabel="cosine distance", ylim=(0, None))
    for panel in (spaces, models, actions):
        panel.set(xlabel="steps of training", xlim=(0, None))
        panel.legend(loc="best")
    return figure


@styled
def forward_figure(results: ServoingResults) -> Figure:
    """Figure II.4: forward NMSE over the chain; below it, over the error that nothing moves."""
    figure = canvas(5.4)
    panels = figure.subplots(2, len(TRAINED_DYNAMICS), sharex=True, sharey="row")
    steps = np.array(results.steps)
    for column, (kind, way) in enumerate(TRAINED_DYNAMICS):
        for structure in STRUCTURES:
            colour = STRUCTURE_COLOURS[structure]
            for trained, line in ((way, "-"), (NO_INVERSE, "--")):
                for panel, values in zip(
                    panels[:, column], (results.forwards, results.relative_forwards), strict=True
                ):
                    found = [seed_interval(values(kind, trained, structure, length)) for length in steps]
                    _line(panel, steps, *np.array(found).T, colour, line)
            still = [results.forwards(UNCHANGED, NO_INVERSE, structure, length).mean() for length in steps]
            panels[0, column].plot(steps, still, color=colour, linestyle=":", linewidth=1.0)
        for panel in panels[:, column]:
            panel.axvline(TEST_CHAIN, color=GREY, linewidth=0.8, zorder=0)
            panel.set_xticks(steps)
        panels[0, column].set_title(dynamics_name(kind, way))
        panels[1, column].axhline(1.0, color=BLACK, linestyle=":", linewidth=1.0)
        panels[1, column].set_xlabel("steps of prediction")
    panels[0, 0].set_ylabel("NMSE")
    panels[0, 0].set_yscale("log")
    panels[1, 0].set_ylabel("NMSE over that of\nthe prediction that nothing moves")
    panels[1, 0].set_ylim(0, None)
    handles = [
        *(
            Patch(color=STRUCTURE_COLOURS[structure], label=structure_name(structure))
            for structure in STRUCTURES
        ),
        Line2D([], [], color=BLACK, label="with the inverse model's loss"),
        Line2D([], [], color=BLACK, linestyle="--", label="without"),
        Line2D([], [], color=BLACK, linestyle=":", linewidth=1.0, label="nothing moves"),
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), columnspacing=1.6)
    return figure


@styled
def directions_figure(results: ServoingResults) -> Figure:
    """Figure II.5: cosine distances per inverse model, with and without its loss; rows: latent spaces."""
    figure = canvas(5.0)
    panels = figure.subplots(len(STRUCTURES), len(COMPARISONS), sharex=True, sharey=True)
    names = list(INVERSE_COLOURS)
    for row, structure in enumerate(STRUCTURES):
        for panel, (comparison, words) in zip(panels[row], COMPARISONS.items(), strict=True):
            for place, name in enumerate(names):
                for shift, with_loss in ((-0.2, True), (0.2, False)):
                    values = results.cosines(name, with_loss, structure, comparison)
                    mean, half = seed_interval(values)
                    colour = INVERSE_COLOURS[name]
                    panel.bar(
                        place + shift, mean, 0.36, color=colour if with_loss else "white", edgecolor=colour
                    )
                    panel.errorbar(place + shift, mean, half, color=BLACK, linewidth=1.1, capsize=2)
            panel.grid(axis="x", visible=False)
            panel.set_xticks(range(len(names)), names)
            if row == 0:
                panel.set_title(words[0].upper() + words[1:], fontsize=8.5)
        panels[row, 0].set_ylabel(f"cosine distance\n({structure_name(structure)})")
    handles = [
        Patch(facecolor=GREY, edgecolor=GREY, label="trained with its loss"),
        Patch(facecolor="white", edgecolor=GREY, label="without"),
        Line2D([], [], color=BLACK, label="95 % interval over seeds"),
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), columnspacing=1.6)
    return figure


def _curve(panel: Axes, rows: pd.DataFrame, colour: str, label: str) -> None:
    found = rows.groupby("step")["value"].agg(lambda values: mean_interval(values.to_numpy()))
    mean, half = np.array(found.tolist()).T
    _line(panel, found.index.to_numpy(), mean, half, colour, "-", label)


def _line(
    panel: Axes,
    at: np.ndarray,
    mean: np.ndarray,
    half: np.ndarray,
    colour: str,
    line: str,
    label: str | None = None,
) -> None:
    """A line with the band of its 95 % interval."""
    panel.plot(at, mean, color=colour, linestyle=line, label=label)
    panel.fill_between(at, np.maximum(mean - half, 1e-4), mean + half, color=colour, alpha=0.15, linewidth=0)
