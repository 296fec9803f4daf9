"""Recordings of trained scenarios: demonstrations (IV.8.3), and the models beside them (IV.8.5, 8.6).

Everything is in the base frame. No robot is shown; the hand is a point, as in motion capture.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb
from pydantic import Field

from dissertation.obstacles.names import DEMONSTRATIONS, FREE, HIT, KINDS, SOURCES, fitted_name
from dissertation.obstacles.protocol.avoidance_protocols import NO_MODEL, TRAINED
from dissertation.obstacles.protocol.unrolled_reaches import Group, SituationKey, of_model, without_avoidance
from dissertation.obstacles.world.scenarios import Scenario
from structlearn.avoidance.avoidance_dataset import to_local
from structlearn.avoidance.shapes import Obstacle
from structlearn.core.errors import InputError
from structlearn.core.params import Parameters
from structlearn.primitives.position import PositionPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.viewer import rrd
from structlearn.viewer.rrd import FLOOR_SQUARE_M, Recording, below, entity, plot, rgba, scene_view

BARE = SOURCES[""]  # look of the reach without avoidance
PALE = 0.5  # opacity of the many demonstrations and of future paths
SOLID_OPACITY = 0.35  # of obstacles: the far side of the cloud stays visible
ARROW_SCALE, LONGEST_ARROW_M = 1.5e-3, 0.15  # m per m of coupling term; Rai et al. reach 100 times as much
ARROW_EVERY = 2  # samples of a path per arrow

SIDES = {1: "left of", 2: "above"}
"""Sides of the straight line from start to goal, by local axis."""

DIRECTIONS = {1: "to the left", 2: "upwards"}
"""Directions of coupling terms, by local axis; along the reach the term is always 0."""

DIM = "#555c64"  # demonstrated coupling terms, darker than demonstrations
ROOM = 1.5  # axis range for coupling terms relative to the demonstrated range


class ObstacleViewParameters(Parameters):
    """Contents of the recordings of demonstrations and models."""

    scenarios: tuple[str, ...] = Field(min_length=1)


@dataclass(frozen=True)
class ShownScenario:
    """A scenario with its demonstrations and the models' reaches."""

    scenario: Scenario
    cloud: np.ndarray  # (P, 3) m, base frame, the obstacle's points as the models see them
    demonstrations: Sequence[Demonstration]
    targets: pd.DataFrame  # samples of the demonstrations: `demonstration`, `time_s`, `target_x`, ...
    reaches: Group  # of the models, including the one without avoidance


def shown_scenarios(
    places: Sequence[Scenario],
    names: Sequence[str],
    demonstrated: Callable[[Scenario], Sequence[Demonstration]],
    samples: pd.DataFrame,
    reaches: Mapping[SituationKey, Group],
    cloud_count: int,
) -> list[ShownScenario]:
    """Demonstrations, samples and unrolls of the scenarios in `names`, in that order.

    Raises InputError: there is no scenario of a name.
    """
    known, shown = {place.name: number for number, place in enumerate(places)}, []
    for name in names:
        if name not in known:
            raise InputError(
                f"inspect_obstacles.scenarios: there is no '{name}'; names are '{places[0].name}' to "
                f"'{places[-1].name}'"
            )
        scenario = places[known[name]]
        cloud, its = scenario.obstacle.cloud(cloud_count), samples[samples["scenario"] == known[name]]
        unrolled = reaches[SituationKey(TRAINED, scenario.shape, scenario.setting)]
        shown.append(ShownScenario(scenario, cloud, demonstrated(scenario), its, unrolled))
    return shown


def write_avoidance_demonstrations(
    path: str | Path,
    shown: Sequence[ShownScenario],
    unhindered: Sequence[Demonstration],
    baseline: PositionPrimitive,
    places: Sequence[tuple[Scenario, bool]],
    title: str,
) -> None:
    """Record demonstrations past obstacles: a tab of the chosen scenarios, one of all settings, one of each.

    `places`: a scenario of each setting, and whether the reach without avoidance hits an obstacle there.
    """
    origin = rrd.origin_label([*unhindered, *(one for group in shown for one in group.demonstrations)])
    with rrd.recording(path, title) as to:
        to.notes(_notes(title, origin, shown, unhindered, places))
        everything = _send_settings(to, unhindered, baseline, places)
        floor = to.floor_axes("/axes", everything)
        settings = scene_view("all settings", ["/places", "/unhindered/**", "/axes"], everything, floor)
        scenes, details = [], []
        for one in shown:
            name, points = one.scenario.name, send_scenario(to, one)
            floor = to.floor_axes(entity(name, "axes"), points)
            parts = ("obstacle", "demonstrated", BARE.name, "hands", "axes")
            contents = [below(name, part) for part in parts]
            scenes.append(scene_view(name, contents, points, floor))
            curves = rrb.Vertical(*_send_signals(to, one, baseline))
            detail = scene_view(name, contents, points, floor)
            details.append(rrb.Horizontal(detail, curves, column_shares=[4, 3], name=name))
        views: dict[str, rrb.Container | rrb.View] = {
            "chosen scenarios": rrb.Grid(*scenes, grid_columns=3),
            "all settings": settings,
        }
        tabs = [
            rrb.Horizontal(view, rrd.notes_view(), column_shares=[4, 1], name=words)
            for words, view in views.items()
        ]
        to.show([*tabs, *details])


def _send_settings(
    to: Recording,
    unhindered: Sequence[Demonstration],
    baseline: PositionPrimitive,
    places: Sequence[tuple[Scenario, bool]],
) -> np.ndarray:
    """Log obstacles labelled by setting, and reaches without obstacle; return all points (N, 3) m."""
    centres = [place.obstacle.centre for place, _ in places]
    colours = rgba([(HIT if hit else FREE).colour for _, hit in places])
    labels = [f"{place.setting:02d}" for place, _ in places]
    to.dots("places", centres, colours, 0.012, labels=labels)
    paths = [one.position for one in unhindered]
    to.lines(entity("unhindered", "paths"), paths, DEMONSTRATIONS.colour, -1.0, opacity=PALE)
    bare = baseline.unroll(0.01).position
    to.lines(entity("unhindered", BARE.name), [bare], BARE.colour, -2.0)
    return np.concatenate([centres, *paths])


def _send_signals(to: Recording, one: ShownScenario, baseline: PositionPrimitive) -> list[rrb.TimeSeriesView]:
    """Log the demonstrated hands, and plot signals of the demonstrations and of no avoidance."""
    name, bare = one.scenario.name, without_avoidance(one.reaches)
    grey = DEMONSTRATIONS.colour
    people = [(person.name, person.time, person.position, grey) for person in one.demonstrations]
    for label, time, position, colour in people:
        to.moving_frame(entity(name, "hands", label), time, position, colour)
    for label, time, position, colour in [*people, (BARE.name, bare.time, bare.position, BARE.colour)]:
        local = 1e3 * to_local(position, baseline)
        curves = {"distance": 1e3 * one.scenario.obstacle.signed_distance(position)}
        curves |= {side: local[:, axis] for axis, side in SIDES.items()}
        for part, values in curves.items():
            to.series(entity(name, part, label), time, values, label, colour)
    words = {"distance": "distance to the surface (mm)"}
    words |= {side: f"hand {side} the straight line (mm)" for side in SIDES.values()}
    return [plot(heading, [below(name, part)], False) for part, heading in words.items()]


def _notes(
    title: str,
    origin: str,
    shown: Sequence[ShownScenario],
    unhindered: Sequence[Demonstration],
    places: Sequence[tuple[Scenario, bool]],
) -> str:
    colours = {look.name: look.colour for look in (DEMONSTRATIONS, HIT, FREE)}
    colours[f"{BARE.name}: a movement primitive learned from reaches without obstacle"] = BARE.colour
    return (
        f"# {title}\n\nReaches past obstacles{origin}: {len(places)} settings, each with several shapes. "
        f"{len(shown)} scenarios are chosen here, with {len(shown[0].demonstrations)} demonstrations each. "
        f"A square of the floor is {FLOOR_SQUARE_M:g} m wide. {len(unhindered)} reaches without obstacle are "
        "in the tab *all settings*, with the number of every setting. In "
        f"{sum(hit for _, hit in places)} settings the reach without avoidance hits an obstacle: it enters "
        "the virtual radius, as in the tables. Dots on an obstacle are the cloud that models see; a point is "
        "the hand.\n\n"
        f"{rrd.legend(colours)}\n\nPlay the time line to see the hands move.\n"
    )


def write_trained_avoidance(path: str | Path, shown: Sequence[ShownScenario], title: str) -> None:
    """Record unrolls in trained scenarios: one tab per scenario, one column per kind of model.

    A column shows paths with coupling terms beside the demonstrations, the distance to the obstacle, and
    coupling terms over time beside the demonstrated ones.
    """
    origin = rrd.origin_label([one for group in shown for one in group.demonstrations])
    with rrd.recording(path, title) as to:
        tabs = []
        for one in shown:
            name, points = one.scenario.name, send_scenario(to, one)
            for number, rows in one.targets.groupby("demonstration"):
                for axis, direction in DIRECTIONS.items():
                    curve = entity(name, "demonstrated terms", direction, str(number))
                    time, term = (rows[key].to_numpy(float) for key in ("time_s", f"target_{'xyz'[axis]}"))
                    to.series(curve, time, term, DEMONSTRATIONS.name, DIM)
            to.notes(_trained_notes(title, origin, one), name)
            floor = to.floor_axes(entity(name, "axes"), points)
            kinds = [kind for kind in KINDS if kind != NO_MODEL and of_model(one.reaches, kind)]
            columns = [_send_model(to, one, kind, points, floor) for kind in kinds]
            shares = [5] * len(columns) + [4]
            tabs.append(rrb.Horizontal(*columns, rrd.notes_view(name), column_shares=shares, name=name))
        to.show(tabs)


def _send_model(
    to: Recording, one: ShownScenario, kind: str, points: np.ndarray, floor: float
) -> rrb.Vertical:
    """Log paths and signals of a kind of model by training source; return its scene and plots."""
    name = one.scenario.name
    for reach in of_model(one.reaches, kind):
        label, colour = SOURCES[reach.learned_from]
        scene = entity(name, kind, label)
        to.lines(f"{scene}/path", [reach.position], colour, -1.5)
        arrows = rr.Arrows3D(
            origins=reach.position[::ARROW_EVERY],
            vectors=arrow_vectors(reach.coupling_in_base[::ARROW_EVERY]),
            colors=rgba(colour, 0.8),
            radii=-0.8,
        )
        to.still(f"{scene}/coupling", arrows)
        to.moving_frame(f"{scene}/hand", reach.time, reach.position, colour)
        distance = 1e3 * one.scenario.obstacle.signed_distance(reach.position)
        to.series(entity(name, "distance", kind, label), reach.time, distance, label, colour)
        for axis, direction in DIRECTIONS.items():
            curve = entity(name, "terms", kind, direction, label)
            to.series(curve, reach.time, reach.coupling[:, axis], label, colour)
    parts = ("obstacle", "demonstrated", BARE.name, "axes", kind)
    view = scene_view(KINDS[kind].name, [below(name, part) for part in parts], points, floor)
    nearness = plot("distance to the surface (mm)", [below(name, "distance", kind)])
    limit = ROOM * float(np.abs(one.targets[["target_y", "target_z"]].to_numpy()).max())
    terms = []
    for direction in DIRECTIONS.values():
        curves = (("demonstrated terms", direction), ("terms", kind, direction))
        contents = [below(name, *curve) for curve in curves]
        terms.append(plot(f"coupling {direction} (m)", contents, False, (-limit, limit)))
    return rrb.Vertical(view, nearness, *terms, row_shares=[5, 2, 2, 2])


def _trained_notes(title: str, origin: str, one: ShownScenario) -> str:
    surface = one.scenario.obstacle.signed_distance
    rows = [
        f"| {1e3 * surface(reach.position).min():.0f} | {1e3 * reach.goal_distance_m:.0f} | "
        f"{fitted_name(reach.model, reach.learned_from)} |"
        for reach in one.reaches
    ]
    people = min(1e3 * surface(person.position).min() for person in one.demonstrations)
    looks = [DEMONSTRATIONS, *(SOURCES[reach.learned_from] for reach in one.reaches)]
    colours = rrd.legend({look.name: look.colour for look in looks})
    return (
        f"# {title}\n\nThe {one.scenario.shape} in setting {one.scenario.setting:02d}, and what models do "
        f"that learned from it{origin}: from this setting alone, from all {one.scenario.shape}s, or from all "
        f"shapes. The reaches are unrolled, without a robot.\n\n{colours}\n\nArrows are the coupling term "
        f"along the path; none is drawn longer than {LONGEST_ARROW_M:g} m. Dark grey in plots: demonstrated "
        f"coupling terms. A square of the floor is {FLOOR_SQUARE_M:g} m wide."
        "\n\n| closest | goal off | model |\n|---|---|---|\n"
        + "\n".join([*rows, f"| {people:.0f} | | {DEMONSTRATIONS.name} |"])
        + "\n\nClosest: mm from the obstacle's surface, negative inside. Goal off: mm at the due time.\n"
    )


def _send_body(to: Recording, path: str, solid: Obstacle, colour: str) -> None:
    """Log the solid of an obstacle at rest."""
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_matrix(solid.rotation).as_quat()  # x, y, z, w
    pose: dict[str, Any] = {"centers": [solid.centre], "quaternions": [turned]}
    look = (colour, SOLID_OPACITY)
    if solid.shape == "cylinder":
        radius, _, half_height = solid.half_size
        to.solid(path, rr.Cylinders3D, *look, lengths=[2.0 * half_height], radii=[radius], **pose)
    else:
        kind = rr.Boxes3D if solid.shape == "cube" else rr.Ellipsoids3D
        to.solid(path, kind, *look, half_sizes=[solid.half_size], **pose)


def arrow_vectors(coupling: np.ndarray) -> np.ndarray:
    """Arrows (N, 3) in m for coupling terms (N, 3) in m, at most `LONGEST_ARROW_M` long."""
    vectors = ARROW_SCALE * coupling
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors * np.minimum(1.0, LONGEST_ARROW_M / np.maximum(length, LONGEST_ARROW_M))


def send_scenario(to: Recording, one: ShownScenario) -> np.ndarray:
    """Log an obstacle, demonstrations and the reach without avoidance; return all points (N, 3) m."""
    name, bare = one.scenario.name, without_avoidance(one.reaches)
    demonstrated = [person.position for person in one.demonstrations]
    colour, path = (HIT if bare.hit else FREE).colour, entity(name, "obstacle")
    _send_body(to, f"{path}/solid", one.scenario.obstacle, colour)
    to.dots(f"{path}/cloud", one.cloud, colour, -1.5)
    to.lines(entity(name, "demonstrated"), demonstrated, DEMONSTRATIONS.colour, -1.0, opacity=PALE)
    to.lines(entity(name, BARE.name, "path"), [bare.position], BARE.colour, -2.0)
    to.moving_frame(entity(name, BARE.name, "hand"), bare.time, bare.position, BARE.colour)
    return np.concatenate([one.cloud, bare.position, *demonstrated])
