"""Figures of the obstacle page: paths, errors (figure IV.10), and distances to obstacles.

Paths are seen from the side and from above, in the local frame of the reach, in mm.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from dissertation.evidence.results import Results
from dissertation.obstacles.names import (
    DEMONSTRATIONS,
    FREE,
    HIT,
    KINDS,
    SOURCES,
    fitted_name,
)
from dissertation.obstacles.page.findings import AS_PUBLISHED, BARE, FEW_HITS, OURS, counts, of_settings
from dissertation.obstacles.page.shown import Shown
from dissertation.obstacles.protocol.avoidance_protocols import NO_MODEL, TRAINED, UNSEEN
from dissertation.obstacles.protocol.unrolled_reaches import Reach, SituationKey
from dissertation.obstacles.world.scenarios import UNSEEN_RADIUS_M
from dissertation.simulation.still import Solid, View, still
from structlearn.avoidance.avoidance_dataset import baseline_axes, to_local
from structlearn.avoidance.learned_models import ALL, ENSEMBLE, HUMAN_INSPIRED, NETWORK, SETTING
from structlearn.avoidance.shapes import HALF_SIZE_M, SHAPES, Obstacle, obstacle
from structlearn.palette import BLACK, BLUE, LIGHT_BLUE, LIGHT_GREY
from structlearn.reporting.figure_style import PANEL_WIDTH, Drawing, Raster, canvas, styled
from structlearn.reporting.prose import capitalised, rounded

FITS = {"all": "all three axes", "across": "y and z", "dominant": "dominant axis"}
"""Axes of errors of models trained on one scenario."""

VIEWS = {"from the side": 2, "from above": 1}  # local axis shown over x, by name of the view

PARTS = {"train": ("learned from", LIGHT_BLUE), "test": ("held out", BLUE)}
"""Label and colour of errors on training and test demonstrations."""

BINS = np.linspace(0.0, 1.2, 13)  # of NMSE; larger values count in the last bin


BALL = UNSEEN_RADIUS_M / HALF_SIZE_M["sphere"][0] * obstacle("sphere", np.zeros(3)).cloud(100)
"""Cloud (P, 3) m of an unseen sphere, relative to its centre."""

LANE_M = 0.42  # between neighbouring reaches in the still
HAND_M, BEAD_M = 0.022, 0.006  # radii of the hand and of the beads of a path
SPACING_M = 0.018  # approximate distance between beads
SHOWN_ROWS = slice(90, 530)  # pixel rows kept of the still: the others only show table

OBSTACLE_RGBA, HAND_RGBA = (0.84, 0.37, 0.0, 1.0), (0.30, 0.33, 0.36, 1.0)
DEMONSTRATED_RGBA, BARE_RGBA = (0.44, 0.47, 0.50, 1.0), (0.11, 0.12, 0.14, 1.0)
TABLE_RGBA = (0.93, 0.92, 0.90, 1.0)

DASHED: Mapping[str, Any] = {"linestyle": "--", "linewidth": 1.2}
THIN: Mapping[str, Any] = {"linewidth": 0.7}
WIDE: Mapping[str, Any] = {"linewidth": 1.9}


class Curve(NamedTuple):
    """A path (T, 3) in m in the local frame, or points if its style has a marker."""

    points: np.ndarray
    colour: str
    style: Mapping[str, Any]
    label: str | None = None


class Outline(NamedTuple):
    """Silhouette of a cloud (P, 3) in m in the local frame."""

    cloud: np.ndarray
    colour: str
    opacity: float = 1.0
    filled: bool = True


def figures(results: Results, shown: Shown, largest_nmse: float) -> dict[str, Drawing | Sequence[Drawing]]:
    """All figures of the page, keyed by name; `largest_nmse` is the published value."""
    kinds = (NETWORK, HUMAN_INSPIRED)
    contenders: list[tuple[str, str, Sequence[str]]] = [
        (NO_MODEL, "", [""]),
        *((kind, "per setting", [SETTING]) for kind in (HUMAN_INSPIRED, NETWORK)),
        (ENSEMBLE, "per shape", SHAPES),
    ]
    return {
        "still": [simulated_scene(shown), hits_panel(results, len(shown.situations[UNSEEN].numbers))],
        "example": _to_scale([_example_panel(shown, shape) for shape in SHAPES]),
        "fit": [fit_panel(results, kind, axis, largest_nmse) for axis in FITS for kind in kinds],
        "people": [Raster(people_panel(shown, *contender)) for contender in contenders],
        "unseen": _to_scale([_unseen_panel(shown, source) for source in (*SHAPES, ALL)]),
    }


def simulated_scene(shown: Shown) -> np.ndarray:
    """Still image (H, W, 3) of reaches past each shape, demonstrated and without avoidance, side by side."""
    places = [place for place in shown.scenarios if place.setting == shown.setting]
    along, across, _ = baseline_axes(shown.baseline).T
    middle = 0.5 * (shown.baseline.start + shown.baseline.goal)
    floor = min(one.obstacle.centre[2] - one.obstacle.half_size[2] for one in places)
    solids = [Solid("box", (1.5, 1.2, 0.01), (middle[0], middle[1], floor - 0.011), colour=TABLE_RGBA)]
    for number, scenario in enumerate(places):
        shift = (0.5 * (len(places) - 1) - number) * LANE_M * across
        solids.append(_solid(scenario.obstacle, shift))
        demonstrated = shown.demonstrations[scenario.shape][0].position
        bare = shown.reach(SituationKey(TRAINED, scenario.shape, shown.setting)).position
        for path, colour in ((bare, BARE_RGBA), (demonstrated, DEMONSTRATED_RGBA)):
            solids += [Solid("sphere", (BEAD_M,), bead + shift, colour=colour) for bead in _beads(path)]
        over = demonstrated[np.abs((demonstrated - scenario.obstacle.centre) @ along).argmin()]
        solids.append(Solid("sphere", (HAND_M,), over + shift, colour=HAND_RGBA))
    view = View(target=(*middle[:2], floor + 0.09), distance=1.95, yaw_deg=14.0, pitch_deg=-22.0)
    return still(view, solids)[SHOWN_ROWS]


def _beads(path: np.ndarray) -> np.ndarray:
    """Points (N, 3) at equal distances along a path (T, 3)."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    places = np.linspace(0.0, length[-1], max(2, round(length[-1] / SPACING_M)))
    return np.stack([np.interp(places, length, values) for values in path.T], axis=1)


def _solid(obstacle: Obstacle, shift: np.ndarray) -> Solid:
    from scipy.spatial.transform import Rotation

    half = obstacle.half_size
    kind, size = {
        "sphere": ("sphere", half[:1]),
        "cube": ("box", half),
        "cylinder": ("cylinder", np.array([half[0], 2.0 * half[2]])),
    }[obstacle.shape]
    turn = Rotation.from_matrix(obstacle.rotation).as_quat(scalar_first=True)
    return Solid(kind, size, obstacle.centre + shift, turn, OBSTACLE_RGBA)


def _example_panel(shown: Shown, shape: str) -> Figure:
    """Paths past one obstacle: demonstrations, no avoidance, models trained on all settings of the shape."""
    (solid,) = (one.obstacle for one in shown.scenarios if (one.shape, one.setting) == (shape, shown.setting))
    paths = [to_local(one.position, shown.baseline) for one in shown.demonstrations[shape]]
    curves = [Curve(path, DEMONSTRATIONS.colour, THIN) for path in paths[1:]]
    curves.append(Curve(paths[0], DEMONSTRATIONS.colour, THIN, DEMONSTRATIONS.name))
    for kind in (NO_MODEL, HUMAN_INSPIRED, NETWORK, ENSEMBLE):
        source = "" if kind == NO_MODEL else shape
        reach = shown.reach(SituationKey(TRAINED, shape, shown.setting), kind, source)
        curves += _curves(shown, reach, KINDS[kind].colour, KINDS[kind].name)
    cloud = to_local(solid.cloud(800), shown.baseline)
    return two_views(shape.capitalize(), [Outline(cloud, HIT.colour)], curves)


def _unseen_panel(shown: Shown, source: str) -> Figure:
    """The grid of unseen spheres, with an ensemble's path past each."""
    centres = shown.situations[UNSEEN].obstacles[0].centre
    hit = shown.rows(UNSEEN, person=shown.population.shown)["hit"]
    outlines = [
        Outline(centre + BALL, (HIT if its else FREE).colour, 0.5, filled=False)
        for its, centre in sorted(zip(hit, centres.tolist(), strict=True))
    ]
    keys = [SituationKey(UNSEEN, "sphere", number) for number in range(1, len(hit) + 1)]
    # every second sample suffices for small pictures
    paths = [to_local(shown.reach(key, ENSEMBLE, source).position[::2], shown.baseline) for key in keys]
    curves = [Curve(path, SOURCES[source].colour, THIN) for path in paths]
    curves += _curves(shown, shown.reach(keys[0]), BLACK, KINDS[NO_MODEL].name)
    return two_views(capitalised(fitted_name(ENSEMBLE, source)), outlines, curves)


def _panel(height: float) -> tuple[Figure, Axes]:
    figure = canvas(height, PANEL_WIDTH)
    return figure, figure.subplots()


@styled
def two_views(title: str, outlines: Iterable[Outline], curves: Sequence[Curve]) -> Figure:
    """Panel with a side view above a top view."""
    from scipy.spatial import ConvexHull

    figure = canvas(4.0, PANEL_WIDTH)
    panels = figure.subplots(len(VIEWS), 1, sharex=True)
    for panel, (view, axis) in zip(panels, VIEWS.items(), strict=True):
        for one in outlines:
            hull = ConvexHull(1e3 * one.cloud[:, [0, axis]])
            corners = hull.points[hull.vertices]
            face = (one.colour, 0.2 * one.opacity) if one.filled else "none"
            panel.add_patch(Polygon(corners, fc=face, ec=(one.colour, one.opacity), lw=0.8))
        for curve in curves:
            x, across = 1e3 * curve.points[:, [0, axis]].T
            panel.plot(x, across, color=curve.colour, label=curve.label, **curve.style)
        panel.set(ylabel=f"{view}\nlocal {'xyz'[axis]} (mm)", aspect="equal")
    panels[0].set_title(title)
    panels[-1].set_xlabel("local x (mm)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower left", ncols=4, columnspacing=1.2)
    return figure


@styled
def fit_panel(results: Results, kind: str, axis: str, largest_nmse: float) -> Figure:
    """Figure IV.10: histogram over scenarios of the error of models trained on one scenario."""
    figure, panel = _panel(2.2)
    for place, (part, (label, colour)) in enumerate(PARTS.items()):
        errors = of_settings(results, axis, part)[kind]
        counts, _ = np.histogram(errors.clip(upper=BINS[-1] - 1e-9), BINS)
        panel.bar(BINS[:-1] + 0.008 + 0.042 * place, counts, 0.042, align="edge", color=colour, label=label)
    panel.axvline(largest_nmse, color=BLACK, label=f"published: up to {largest_nmse:g}", **DASHED)
    panel.grid(axis="x", visible=False)
    panel.set_xticks(BINS[1::2])
    panel.set(title=f"{capitalised(KINDS[kind].name)}, {FITS[axis]}", ylabel="scenarios")
    panel.set(xlim=(BINS[0], BINS[-1]), xlabel=f"NMSE; the last bar: {BINS[-2]:.1f} and above")
    figure.legend(loc="outside lower left", ncols=3, columnspacing=1.2)
    return figure


@styled
def people_panel(shown: Shown, kind: str, words: str, sources: Sequence[str]) -> Figure:
    """Closest distance of each unroll against that of the demonstrating person, one dot per scenario."""
    keys = ["person", "obstacle", "scenario"]
    its = shown.demonstrated[shown.demonstrated["person"].isin(shown.population.test)]
    people = its.groupby(keys)["obstacle_distance"].mean()
    top = 1.05 * float(people.max())
    figure, panel = _panel(2.8)
    panel.plot([-1, top], [-1, top], color=LIGHT_GREY, linewidth=0.9)
    panel.axhline(0.0, color=HIT.colour, **DASHED)
    scored = shown.rows(TRAINED, kind, sources).set_index(keys)
    for shape, marker in zip(SHAPES, "os^", strict=True):
        its = scored.loc[scored.index.get_level_values("obstacle") == shape, "obstacle_distance"]
        look: dict[str, Any] = {"markersize": 3, "markeredgewidth": 0, "alpha": 0.5}
        panel.plot(people.loc[its.index], its, marker, label=shape, color=KINDS[kind].colour, **look)
    panel.set(xlim=(-1, top), ylim=(-1, top))
    # linear below two radii, where most points are
    panel.set_xscale("symlog", linthresh=2.0, linscale=1.0)
    panel.set_yscale("symlog", linthresh=2.0, linscale=1.0)
    for axis in (panel.xaxis, panel.yaxis):
        axis.set_ticks([-1, 0, 1, 2, 5, 10], [rounded(tick, "g") for tick in (-1, 0, 1, 2, 5, 10)])
    panel.minorticks_off()
    title = capitalised(", ".join(filter(None, (KINDS[kind].name, words))))
    panel.set(title=title, xlabel="people (radii)", ylabel="closest distance (radii)")
    panel.legend(loc="lower right")
    return figure


@styled
def hits_panel(results: Results, of: int) -> Figure:
    """Number of unseen spheres hit, of so many, one dot per person, by form and source."""
    figure, panel = _panel(2.8)
    sources = (*SHAPES, ALL)
    for place, (form, words) in enumerate(((AS_PUBLISHED, ", as published"), (OURS, ", ours"), (BARE, ""))):
        for row, source in enumerate(sources):
            hits = counts(results, UNSEEN, form, "" if form == BARE else source)["hits"]
            # spread by person from top to bottom, so that equal counts do not overlap
            height = row + 0.28 * (place - 1) + np.linspace(-0.11, 0.11, len(hits))
            label = f"{KINDS[form[0]].name}{words}" if row == 0 else None
            panel.plot(hits, height, "o", markersize=3, color=KINDS[form[0]].colour, label=label)
    panel.axvline(FEW_HITS + 0.5, color=HIT.colour, **DASHED)
    panel.grid(axis="y", visible=False)
    panel.set(title="Hits by person", xlabel=f"unseen spheres hit, of {of}")
    panel.set(ylim=(len(sources) - 0.5, -0.5))
    panel.set_yticks(range(len(sources)), [SOURCES[source].name for source in sources])
    figure.legend(loc="outside lower left", ncols=2, columnspacing=1.2)
    return figure


def _to_scale(figures: Sequence[Figure]) -> list[Figure]:
    """Give all `two_views` common limits, and the height at which all axes have the same scale."""
    rows = list(zip(*(figure.axes for figure in figures), strict=True))
    x = np.array([panel.get_xlim() for row in rows for panel in row])
    ranges = [np.array([panel.get_ylim() for panel in row]) for row in rows]
    limits = [(its[:, 0].min(), its[:, 1].max()) for its in ranges]
    extents = [high - low for low, high in limits]
    for figure in figures:
        for panel, its in zip(figure.axes, limits, strict=True):
            panel.set(xlim=(x[:, 0].min(), x[:, 1].max()), ylim=its)
        grid = figure.axes[0].get_gridspec()
        grid.set_height_ratios(extents)  # type: ignore[union-attr]  # never None for axes of `subplots`
        figure.set_figheight((PANEL_WIDTH - 0.9) * sum(extents) / np.ptp(x) + 1.15)
    return list(figures)


def _curves(shown: Shown, reach: Reach, colour: str, name: str) -> list[Curve]:
    """Path up to the prescribed time, and the rest as a thin line."""
    points, after = to_local(reach.position, shown.baseline), reach.time >= shown.baseline.duration
    style = DASHED if reach.model == NO_MODEL else WIDE
    return [Curve(points[~after], colour, style, name), Curve(points[after], colour, THIN)]
