"""Figures of paths past obstacles: from the side and from above, in the local frame of the reach, in mm."""

from collections.abc import Iterable

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from scipy.spatial import ConvexHull

from structlearn.avoidance.avoidance_dataset import to_local
from structlearn.avoidance.clouds import CloudBatch
from structlearn.avoidance.learned_models import ALL, HUMAN_INSPIRED, NETWORK
from structlearn.palette import BLACK, BLUE, DEMONSTRATION_COLOUR, LIGHT_GREY, ORANGE
from structlearn.reporting.figures import WIDTH, canvas, styled
from structlearn.testbeds.obstacles.page.obstacle_results import ObstacleResults
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import (
    GOAL_CHANGE,
    MOVING,
    NO_MODEL,
    PAIR,
    TRAINED,
    UNSEEN,
)
from structlearn.testbeds.obstacles.world.scenarios import UNSEEN_RADIUS_M

VIEWS = {"from the side": 2, "from above": 1}
"""Local axis that is shown over x, by the name of the view."""

HEIGHT = 4.6
"""Inches, before rows get the height that lets a millimetre be the same on both axes."""

OUTLINE_POINTS = 800
OBSTACLE_FACE, OBSTACLE_EDGE = "#f3d9c4", "#c9803f"

LOOKS = {
    NO_MODEL: {"color": BLACK, "linestyle": "--", "linewidth": 1.3, "label": "no avoidance"},
    HUMAN_INSPIRED: {"color": ORANGE, "linewidth": 1.8, "label": "Rai et al."},
    NETWORK: {"color": BLUE, "linewidth": 2.0, "label": "network"},
}
"""How the path of a model is drawn."""

MARGIN_IN = 1.0
"""Inches for labels, legend and title beside the panels."""

MOMENTS = 5
"""Places at which a moving obstacle is drawn."""


@styled
def example_figure(results: ObstacleResults) -> Figure:
    """Paths past the nearest obstacle in every shape: demonstrations, no avoidance, models of the shape."""
    setting = results.example_setting
    scenarios = [scenario for scenario in results.scenarios if scenario.setting == setting]
    figure = canvas(HEIGHT)
    panels = figure.subplots(len(VIEWS), len(scenarios), sharex=True, sharey="row", squeeze=False)
    for row, (view, axis) in enumerate(VIEWS.items()):
        for panel, scenario in zip(panels[row], scenarios, strict=True):
            cloud = to_local(scenario.obstacle.cloud(OUTLINE_POINTS), results.baseline)
            hull = ConvexHull(1e3 * cloud[:, [0, axis]])
            panel.add_patch(
                Polygon(hull.points[hull.vertices], facecolor=OBSTACLE_FACE, edgecolor=OBSTACLE_EDGE)
            )
            for number, one in enumerate(results.shown[scenario.shape]):
                path = 1e3 * to_local(one.position, results.baseline)
                label = "demonstrations" if number == 0 else None
                look = {"color": DEMONSTRATION_COLOUR, "linewidth": 0.7, "label": label}
                panel.plot(path[:, 0], path[:, axis], **look)
            for model in LOOKS:
                source = "" if model == NO_MODEL else scenario.shape
                path = _paths(results, TRAINED, model, source, scenario.shape).loc[(setting, 0.0)]
                _draw_path(panel, path, axis, model, results.baseline.duration)
            if row == 0:
                panel.set_title(f"{scenario.shape.capitalize()}")
        panels[row, 0].set_ylabel(f"{view}\nlocal {'xyz'[axis]} (mm)")
    for panel in panels[-1]:
        panel.set_xlabel("local x (mm)")
    _legend(figure, panels[0, 0])
    _to_scale(figure, panels)
    return figure


@styled
def unseen_figure(results: ObstacleResults, learned_from: str) -> Figure:
    """The grid of unseen spheres, and the path of a network past each of them."""
    figure = canvas(HEIGHT)
    panels = figure.subplots(1, len(VIEWS), sharex=True, sharey=True, squeeze=False)
    spheres = results.situations[UNSEEN].obstacles[0]
    bare = _paths(results, UNSEEN, NO_MODEL, "").loc[(1, 0.0)]
    avoiding = _paths(results, UNSEEN, NETWORK, learned_from)
    for panel, (view, axis) in zip(panels[0], VIEWS.items(), strict=True):
        for centre in np.unique(spheres.centre[:, [0, axis]].round(6), axis=0):
            _disc(panel, centre, facecolor="none", edgecolor=OBSTACLE_EDGE, linewidth=0.7)
        for number, (_, path) in enumerate(avoiding.groupby(level="scenario", sort=False)):
            label = "network, past each sphere" if number == 0 else None
            look = {"color": BLUE, "linewidth": 0.7, "alpha": 0.7, "label": label}
            panel.plot(path["x"], path["xyz"[axis]], **look)
        panel.plot(bare["x"], bare["xyz"[axis]], **LOOKS[NO_MODEL])
        title = view.capitalize()
        panel.set(title=title, xlabel="local x (mm)", ylabel=f"local {'xyz'[axis]} (mm)")
    _legend(figure, panels[0, 0])
    _to_scale(figure, panels)
    return figure


@styled
def beyond_figure(results: ObstacleResults) -> Figure:
    """A moving sphere, two spheres and a goal that moves: the network of all shapes beside no avoidance."""
    titles = {MOVING: "Moving sphere", PAIR: "Two spheres", GOAL_CHANGE: "Moving goal"}
    figure = canvas(HEIGHT)
    panels = figure.subplots(len(VIEWS), len(titles), sharex=True, sharey="row")
    for column, (protocol, title) in enumerate(titles.items()):
        number, speed = worst(results, protocol)
        situation = results.situations[protocol]
        place = int(np.flatnonzero((situation.numbers == number) & (situation.speed == speed))[0])
        courses = {
            model: _paths(results, protocol, model, source).loc[(number, speed)]
            for model, source in ((NO_MODEL, ""), (NETWORK, ALL))
        }
        for panel, axis in zip(panels[:, column], VIEWS.values(), strict=True):
            for obstacle in situation.obstacles:
                _draw_sphere(panel, obstacle, place, axis, results.baseline.duration)
            for model, path in courses.items():
                _draw_path(panel, path, axis, model, results.baseline.duration)
            if protocol == MOVING:
                _moments(panel, courses[NETWORK], axis, results.baseline.duration)
            _draw_goals(panel, results, protocol, axis)
        panels[0, column].set_title(f"{title}, {speed:g} m/s" if speed else title)
        panels[-1, column].set_xlabel("local x (mm)")
    for row, (view, axis) in enumerate(VIEWS.items()):
        panels[row, 0].set_ylabel(f"{view}\nlocal {'xyz'[axis]} (mm)")
    _legend(figure, panels[0, 0])
    _to_scale(figure, panels)
    return figure


def worst(results: ObstacleResults, protocol: str) -> tuple[int, float]:
    """Number and speed of the situation in which the reach without avoidance comes closest, fastest first.

    Of those whose obstacles all lie between start and goal.
    """
    situation = results.situations[protocol]
    length = np.linalg.norm(results.baseline.goal - results.baseline.start)
    along = np.stack([obstacle.centre[:, 0] for obstacle in situation.obstacles])
    between = ((along > 0.0) & (along < length)).all(axis=0)
    chosen = between & (situation.speed == situation.speed[between].max(initial=0.0))
    bare = results.rows(protocol)[chosen if between.any() else np.ones_like(between)]
    row = bare.loc[bare["obstacle_distance"].idxmin()]
    return int(row["scenario"]), float(row["speed_m_s"])


def _paths(
    results: ObstacleResults, protocol: str, model: str, learned_from: str, obstacle: str | None = None
) -> pd.DataFrame:
    """Local `x`, `y`, `z` in mm and `time_s`, indexed by `scenario` and `speed_m_s`."""
    paths = results.paths
    mask = (paths["protocol"] == protocol) & (paths["model"] == model)
    mask &= paths["learned_from"] == learned_from
    its = paths[mask if obstacle is None else mask & (paths["obstacle"] == obstacle)]
    local = 1e3 * to_local(its[["x_m", "y_m", "z_m"]].to_numpy(), results.baseline)
    keys = [its["scenario"].to_numpy(), its["speed_m_s"].to_numpy()]
    table = pd.DataFrame(
        local, columns=list("xyz"), index=pd.MultiIndex.from_arrays(keys, names=["scenario", "speed_m_s"])
    )
    return table.assign(time_s=its["time_s"].to_numpy())


def _draw_path(panel: Axes, path: pd.DataFrame, axis: int, model: str, duration: float) -> None:
    """A path until the prescribed time, and as a thin line what comes after it."""
    look, after = LOOKS[model], path["time_s"] >= duration
    panel.plot(path["x"][~after], path["xyz"[axis]][~after], **look)
    panel.plot(path["x"][after], path["xyz"[axis]][after], color=look["color"], linewidth=0.8, alpha=0.6)


def _draw_sphere(panel: Axes, obstacle: CloudBatch, place: int, axis: int, duration: float) -> None:
    """A sphere at rest, or where a moving one is while the movement lasts, the later the darker."""
    times = [0.0] if obstacle.motion is None else np.linspace(0.0, duration, MOMENTS)
    for number, time in enumerate(times, start=1):
        centre = obstacle.centre[place] + obstacle.displacement(float(time))[place]
        look = {"facecolor": OBSTACLE_FACE, "edgecolor": OBSTACLE_EDGE, "alpha": number / len(times)}
        _disc(panel, centre[[0, axis]], **look)


def _moments(panel: Axes, path: pd.DataFrame, axis: int, duration: float) -> None:
    """Dots where the hand is when the moving obstacle is where it is drawn."""
    for number, time in enumerate(np.linspace(0.0, duration, MOMENTS), start=1):
        at = path.iloc[int((path["time_s"] - time).abs().argmin())]
        panel.plot(at["x"], at["xyz"[axis]], "o", color=BLUE, markersize=4, alpha=number / MOMENTS)


def _draw_goals(panel: Axes, results: ObstacleResults, protocol: str, axis: int) -> None:
    change = results.situations[protocol].goal_change
    if change is None:
        return
    goals: Iterable[tuple[np.ndarray, str]] = (
        (to_local(results.baseline.goal, results.baseline), LIGHT_GREY),
        (to_local(np.reshape(change.goals, (-1, 3))[0], results.baseline), BLACK),
    )
    for goal, colour in goals:
        panel.plot(*1e3 * goal[[0, axis]], "x", color=colour, markersize=7, markeredgewidth=2, zorder=4)


def _disc(panel: Axes, centre: np.ndarray, **look: object) -> None:
    panel.add_patch(Circle(tuple(1e3 * centre), 1e3 * UNSEEN_RADIUS_M, **look))


def _to_scale(figure: Figure, panels: np.ndarray) -> None:
    """Give rows and figure the heights at which a millimetre is the same on both axes of all panels."""
    extents = [np.ptp(row[0].get_ylim()) for row in panels]
    panels[0, 0].get_gridspec().set_height_ratios(extents)
    across = (WIDTH - MARGIN_IN) / panels.shape[1]
    own = sum(extents) / np.ptp(panels[0, 0].get_xlim()) * across
    figure.set_size_inches(WIDTH, own + MARGIN_IN + 0.25 * len(extents))
    for panel in panels.flat:
        panel.set_aspect("equal")


def _legend(figure: Figure, panel: Axes) -> None:
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=len(labels), columnspacing=1.6)
