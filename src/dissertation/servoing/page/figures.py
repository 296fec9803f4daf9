"""Figures of the servoing page (figures II.3 to II.6), one panel at a time."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.typing import LineStyleType

from dissertation.servoing import names
from dissertation.servoing.page.findings import TEST_CHAIN
from dissertation.servoing.page.shown import Shown
from dissertation.servoing.protocol.results import STRUCTURED, controller_keys
from dissertation.servoing.protocol.servo_scores import KEYS, rows_of, success_by_tolerance
from dissertation.servoing.protocol.servo_variants import ADAPTIVE, SPACES, ServoVariant
from dissertation.simulation.still import Sheet, Solid, View, still
from structlearn.core import quaternion
from structlearn.palette import BAD, BLACK, BLUE, GREY, LIGHT_GREY
from structlearn.reporting.evidence import Evidence, clustered_share, geometric_mean, mean
from structlearn.reporting.figure_style import PANEL_WIDTH, Drawing, Raster, canvas, styled
from structlearn.tactile.electrodes import Skin
from structlearn.tactile.latent_parameters import NO_INVERSE, InverseModel

MAP_SAMPLES = 12_000  # samples drawn in the latent map; more would overlap
FEWEST = 10  # samples that a square of skin needs before its mean error is drawn
TOLERANCES_MM = np.linspace(0.25, 4.0, 16)  # tolerances at which success is evaluated

DASHES: Mapping[str, LineStyleType] = {form: "-" if form == ADAPTIVE else "--" for form in names.FORM_NAMES}

SCALE = 10.0  # enlargement of the still: the camera's near plane is 5 cm
SKIN, ELECTRODE, HANDLE = (0.45, 0.49, 0.55, 1.0), (0.9, 0.62, 0.0, 1.0), (0.8, 0.72, 0.6, 1.0)  # rgba
ELECTRODE_M = 0.0006  # radius of the mark over an electrode
HANDLE_M = 0.04  # drawn length of the handle, without its round ends
ALONG_M = -0.006  # contact with the handle, along the finger
ACROSS = np.array([0.0, 0.0, 0.5 * np.pi])  # rotation vector from the finger to the handle
VIEW = View(target=(0.0, 0.0, 0.06), distance=0.66, yaw_deg=35.0, pitch_deg=-8.0)


@styled
def drawings(shown: Shown, published: Mapping[str, float]) -> dict[str, Drawing | Sequence[Drawing]]:
    """All figures, keyed by name; `published`: bounds of errors."""
    others = [kind for kind in names.DYNAMICS[:-1] if kind[1] != NO_INVERSE]
    return {
        "map": _maps(shown),
        "curve": _training(shown, published),
        "forward": _forward(shown, names.DYNAMICS[-1]),
        "forward_others": [panel for kind in others for panel in _forward(shown, kind)],
        "directions": [_directions(shown, space) for space in SPACES.values()],
        "contact": _contacts(shown),
        "scene": [_scene_still(shown), _approach(shown)],
        "loop_success": [_success(shown, form) for form in names.FORM_NAMES],
        "loop_paths": [_ways(shown, variant) for variant in (names.AS_PUBLISHED, names.OURS)],
        "loop_progress": _progress(shown),
    }


def _panel(title: str, x: str, y: str, height: float = 2.9) -> tuple[Figure, Axes]:
    figure = canvas(height, PANEL_WIDTH)
    axes = figure.subplots()
    axes.set(title=title, xlabel=x, ylabel=y)
    return figure, axes


def _patches(colours: Mapping[Any, str]) -> list[Artist]:
    return [Patch(color=colour, label=name) for name, colour in colours.items()]


def _lines(labels: Mapping[LineStyleType, str]) -> list[Artist]:
    return [Line2D([], [], color=BLACK, linestyle=line, label=label) for line, label in labels.items()]


def _scene_still(shown: Shown) -> np.ndarray:
    """Still image (H, W, 3) of the finger lying across the handle."""
    skin, radius = shown.skin, 1e-3 * shown.chosen["toucher"].handle_radius_mm
    touched = skin.surface(ALONG_M, 0.0)
    over = -touched - radius * skin.normal(touched)  # origin of the finger in the frame of the handle
    half = np.array([0.5 * HANDLE_M, 0.0, 0.0])
    bar = replace(skin, core_low=-half, core_high=half, radius=radius)
    marks = [
        Solid("sphere", (SCALE * ELECTRODE_M,), SCALE * (over + place), colour=ELECTRODE)
        for place in skin.project(skin.electrodes)
    ]
    sheets = [_all_round(skin, over, np.zeros(3), SKIN), _all_round(bar, np.zeros(3), ACROSS, HANDLE)]
    return still(VIEW, marks, sheets=sheets)


def _all_round(skin: Skin, position: np.ndarray, turned: np.ndarray, colour: tuple[float, ...]) -> Sheet:
    """Closed surface round the whole core, rotated by the rotation vector `turned`."""
    orientation = quaternion.from_rotation_vector(turned)
    turn = 0.5 * np.pi * skin.radius
    along, across = np.meshgrid(
        np.linspace(skin.core_low[0] - turn, skin.core_high[0] + turn, 121),
        np.linspace(2 * turn, -2 * turn, 91),
        indexing="ij",
    )
    points = skin.surface(along, across)
    normals = quaternion.rotate(orientation, skin.normal(points))
    return Sheet(SCALE * (position + quaternion.rotate(orientation, points)), normals, colour)


def _approach(shown: Shown) -> Figure:
    """Distance from the target over time for the dissertation's controller and ours."""
    figure, axes = _panel("From the target, with NJ", "time (s)", "distance (mm)")
    for variant in (names.OURS, names.AS_PUBLISHED):
        rows, colour = rows_of(shown.loops["progress"], variant), names.FORM_COLOURS[variant.form]
        axes.plot(rows["time_s"], rows["median_mm"], color=colour, label=names.FORM_NAMES[variant.form])
        axes.fill_between(rows["time_s"], rows["median_mm"], rows["upper_mm"], color=colour, alpha=0.15, lw=0)
    bound = shown.chosen["servo"].tolerance.position_mm
    axes.axhline(bound, color=BLACK, linestyle=":", linewidth=1.1, label="tolerated")
    axes.set(xlim=(0, None), ylim=(0, None))
    axes.legend()
    return figure


def _maps(shown: Shown) -> list[Raster]:
    """Figure II.3: latent map beside the skin, samples coloured by their most active electrode."""
    electrode = shown.models["latent_map"]["electrode"].to_numpy()
    colours = np.array(names.electrode_colours(len(shown.skin.electrodes)))
    kept = np.linspace(0, len(electrode) - 1, min(MAP_SAMPLES, len(electrode))).astype(int)
    panels = []
    for points, title in (
        (shown.map_on_skin, "Latent map (x and y of z)"),
        (shown.places, "Contact points on the skin"),
    ):
        figure, axes = _panel(title, "along the finger (mm)", "across (mm)", 3.4)
        axes.scatter(points[kept, 0], points[kept, 1], s=2.5, c=colours[electrode[kept] - 1], linewidths=0)
        box = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "alpha": 0.8, "linewidth": 0}
        for number in np.unique(electrode):
            x, y = np.median(points[electrode == number], axis=0)
            axes.text(x, y, str(number), ha="center", va="center", fontsize=8, weight="bold", bbox=box)
        axes.set_aspect("equal")
        panels.append(Raster(figure))
    return panels


def _contacts(shown: Shown) -> list[Figure]:
    """Errors of the estimated contact point across the skin, and their cumulative distribution."""
    errors = shown.contact_errors
    bias = shown.contact_bias[shown.contact_bias["samples"] >= FEWEST]
    left, place = _panel("From the true to the estimated contact", "along the finger (mm)", "across (mm)")
    parts = [bias[name] for name in ("square_along_mm", "square_across_mm", "along_mm", "across_mm")]
    scale: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.006}
    arrows = place.quiver(*parts, bias["error_mm"], cmap="viridis_r", **scale)
    _electrodes(place, shown.skin)
    left.colorbar(arrows, ax=place, label="mean error (mm)", shrink=0.9)
    right, share = _panel("Share of samples below an error", "error (mm)", "%")
    level = np.linspace(0.0, 1.0, 201)
    share.plot(np.quantile(errors["error_mm"], level), 100 * level, color=BLUE)
    share.axvline(1.0, color=BLACK, linestyle="--", linewidth=1.1)
    share.set(xlim=(0, None), ylim=(0, 100))
    return [left, right]


def _electrodes(axes: Axes, skin: Skin) -> None:
    """Mark the electrodes on the flat skin."""
    places = 1e3 * np.stack(skin.coordinates(skin.project(skin.electrodes)))
    axes.plot(*places, "o", color=LIGHT_GREY, markersize=7, zorder=0)
    axes.set_aspect("equal")


def _training(shown: Shown, published: Mapping[str, float]) -> list[Figure]:
    """Test errors during training, with intervals over seeds."""
    curves = shown.curves
    first, spaces = _panel("Latent space", "steps of training", "NMSE, test split")
    for name, colour in names.LATENT_COLOURS.items():
        _line(spaces, curves.loc[name], colour, label=names.LATENT_NAMES[name])
        if f"{name}_nmse" in published:
            spaces.axhline(published[f"{name}_nmse"], color=colour, linestyle=":", linewidth=1.1)
    spaces.set(yscale="log", ylim=(None, 5.0))
    second, forward = _panel(f"Forward, {TEST_CHAIN} steps", "steps of training", "NMSE, test split")
    third, inverse = _panel("Inverse", "steps of training", "cosine distance, test split")
    for model, loss in names.DYNAMICS:
        if loss != NO_INVERSE:
            errors, colour = curves.loc[f"forward {model}-{loss}"], names.INVERSE_COLOURS[loss]
            _line(forward, errors, colour, label=names.dynamics_name(model, loss))
            _line(inverse, curves.loc[f"direction {loss}-{loss}"], colour, mean, label=loss)
    for axes in (forward, inverse):
        axes.set_ylim(0, None)
    for axes in (spaces, forward, inverse):
        axes.set_xlim(0, None)
        axes.legend()
    return [first, second, third]


def _line(
    axes: Axes,
    values: pd.DataFrame,
    colour: str,
    average: Callable[[np.ndarray], Evidence] = geometric_mean,
    **look: Any,
) -> None:
    """Average over seeds (columns) at each index (rows), with its 95 % confidence band."""
    found = [average(seeds) for seeds in values.to_numpy()]
    axes.plot(values.index, [one.value for one in found], color=colour, **look)
    ends = [one.low for one in found], [one.high for one in found]
    axes.fill_between(values.index, *ends, color=colour, alpha=0.15, linewidth=0)


def _forward(shown: Shown, kind: tuple[str, str]) -> list[Figure]:
    """Figure II.4 for one model: NMSE over the chain, absolute and relative to "nothing moves"."""
    errors = shown.predictions
    panels = []
    for values, label in ((errors, "NMSE"), (shown.relative, "NMSE over “nothing moves”")):
        title = f"{names.dynamics_name(*kind)}, {label.removeprefix('NMSE ')}"
        figure, axes = _panel(title, "steps of prediction", label)
        for space, colour in names.SPACE_COLOURS.items():
            for loss, line in ((kind[1], "-"), (NO_INVERSE, "--")):
                _line(axes, values.loc[space, kind[0], loss], colour, linestyle=line)
            _line(axes, values.loc[(space, *names.STILL)], colour, linestyle=":", linewidth=1.0)
        axes.set_xticks(errors.index.unique("steps"))
        panels.append(figure)
    lines: Mapping[LineStyleType, str] = {"-": "with the loss", "--": "without it", ":": "nothing moves"}
    handles = _patches(names.SPACE_COLOURS) + _lines(lines)
    nmse, over = (panel.axes[0] for panel in panels)
    nmse.set(yscale="log", ylim=(0.008, 2.0))
    nmse.legend(handles=handles, ncols=2, loc="lower right")
    over.set_ylim(0, None)
    return panels


def _bars(
    title: str,
    label: str,
    top: float,
    groups: Mapping[str, Callable[[InverseModel, str], Evidence]],
    legend: bool,
) -> Figure:
    """Bars of inverse models with intervals, by loss trained with; hollow if trained without."""
    figure, axes = _panel(title, "", label)
    for group, found in enumerate(groups.values()):
        for place, (name, colour) in enumerate(names.INVERSE_COLOURS.items()):
            for shift, loss in ((-0.2, name), (0.2, NO_INVERSE)):
                at, one = 4 * group + place + shift, found(name, loss)
                axes.bar(
                    at, one.value, 0.36, color="white" if loss == NO_INVERSE else colour, edgecolor=colour
                )
                axes.plot([at, at], [one.low, one.high], color=BLACK, linewidth=1.1)
    axes.set_xticks([4.0 * group + 1.0 for group in range(len(groups))], list(groups))
    axes.grid(axis="x", visible=False)
    if legend:
        hollow = Patch(facecolor="white", edgecolor=GREY, label="without its loss")
        axes.legend(handles=[*_patches(names.INVERSE_COLOURS), hollow])
    axes.set_ylim(0, top)
    return figure


def _directions(shown: Shown, space: str) -> Figure:
    """Figure II.5: cosine distance of each inverse model, trained with and without its loss."""

    def distance(target: str, name: InverseModel, loss: str) -> Evidence:
        return mean(shown.directions.loc[space, name, loss, target].to_numpy())

    groups = {name: partial(distance, target) for target, name in names.TARGET_NAMES.items()}
    return _bars(space.capitalize(), "cosine distance", 1.3, groups, legend=space == STRUCTURED)


def _success(shown: Shown, form: str) -> Figure:
    """Success rate of the controllers of one form."""

    def share(structure: bool, name: InverseModel, loss: str) -> Evidence:
        variant = ServoVariant(form, name, structure, loss == name)
        its = shown.reached.loc[tuple(controller_keys(variant).values())]
        found = clustered_share(*its.to_numpy().T)
        return replace(found, value=100 * found.value, low=100 * found.low, high=100 * found.high)

    groups = {name: partial(share, structure) for structure, name in SPACES.items()}
    title = names.FORM_NAMES[form].capitalize()
    return _bars(title, "% of targets reached", 101, groups, legend=form == names.AS_PUBLISHED.form)


def _ways(shown: Shown, variant: ServoVariant) -> Figure:
    """True contact paths on the flat skin, from start (dot) to target (cross, orange if missed)."""
    title = names.FORM_NAMES[variant.form].capitalize()
    figure, axes = _panel(title, "along the finger (mm)", "across (mm)", 3.3)
    skin = shown.skin
    trials = rows_of(shown.loops["trials"], variant).set_index(["seed", "trial"])
    for key, path in rows_of(shown.loops["paths"], variant).groupby(["seed", "trial"]):
        row, touching = trials.loc[key], path[path["load_n"] > 0]
        path = 1e3 * np.stack(skin.coordinates(touching[["x_m", "y_m", "z_m"]].to_numpy(float)))
        axes.plot(*path, color=names.FORM_COLOURS[variant.form], linewidth=1.0)
        target = BLACK if row["success"] else BAD
        for name, mark, colour in (("start", "o", GREY), ("target", "x", target)):
            place = skin.coordinates(row[[f"{name}_{axis}_m" for axis in "xyz"]].to_numpy(float))
            axes.plot(*(1e3 * np.array(place)), mark, color=colour, markersize=5)
    _electrodes(axes, skin)
    low, high = 1e3 * np.array([skin.along, skin.across]).T
    axes.set(xlim=(low[0] - 1, high[0] + 1), ylim=(low[1] - 1, high[1] + 1))
    return figure


def _progress(shown: Shown) -> list[Figure]:
    """Distance and share within tolerance over time, success by tolerance, and path lengths."""
    loops, bound = shown.loops, shown.chosen["servo"].tolerance
    one, distance = _panel("Distance, median", "time (s)", "mm")
    two, within = _panel("Within both tolerances", "time (s)", "% of trials")
    three, tolerance = _panel("Success over the tolerance", "distance tolerated (mm)", "% of trials")
    rates = success_by_tolerance(loops["trials"], KEYS, TOLERANCES_MM, bound.pressure)
    for form, line in DASHES.items():
        for name, colour in names.INVERSE_COLOURS.items():
            rows, shares = (rows_of(table, ServoVariant(form, name)) for table in (loops["progress"], rates))
            distance.plot(rows["time_s"], rows["median_mm"], color=colour, linestyle=line)
            within.plot(rows["time_s"], 100 * rows["within"], color=colour, linestyle=line)
            tolerance.plot(shares["tolerance_mm"], 100 * shares["rate"], color=colour, linestyle=line)
    distance.axhline(bound.position_mm, color=BLACK, linestyle=":", linewidth=1.1)
    tolerance.axvline(bound.position_mm, color=BLACK, linestyle=":", linewidth=1.1)
    for axes, top in ((distance, None), (within, 101), (tolerance, 101)):
        axes.set(xlim=(0, None), ylim=(0, top))
    distance.legend(
        handles=_patches(names.INVERSE_COLOURS)
        + _lines({line: names.FORM_NAMES[form] for form, line in DASHES.items()})
    )
    title = "Path length of successes, adaptive controller"
    four, length = _panel(title, "shortest on the skin (mm)", "travelled (mm)")
    reached = rows_of(loops["trials"], names.OURS).query("success")
    longest = 1.05 * reached["path_mm"].max() if len(reached) else 1.0
    length.plot([0, longest], [0, longest], color=GREY, linewidth=0.9)
    length.plot(reached["geodesic_mm"], reached["path_mm"], "o", color=BLUE, ms=3, mew=0, alpha=0.4)
    length.set(xlim=(0, None), ylim=(0, longest))
    return [one, two, three, four]
