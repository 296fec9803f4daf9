"""Recordings of trained scenarios: demonstrations (IV.8.3), and the models beside them (IV.8.5, 8.6).

Everything is in the base frame. No robot is shown; the hand is a point, as in motion capture.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import rerun as rr
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
from structlearn.viewer import items, views
from structlearn.viewer.items import FLOOR_SQUARE_M, Item, entity, lines, moving_frame, series
from structlearn.viewer.recording import Recording
from structlearn.viewer.views import Panel

BARE = SOURCES[""]  # look of the reach without avoidance
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


def demonstrations(
    shown: Sequence[ShownScenario],
    unhindered: Sequence[Demonstration],
    baseline: PositionPrimitive,
    places: Sequence[tuple[Scenario, bool]],
) -> Recording:
    """Demonstrations past obstacles: a tab of the chosen scenarios, one of all settings, one of each.

    `places`: a scenario of each setting, and whether the reach without avoidance hits an obstacle there.
    """
    title, scenes, details = "Obstacles: demonstrations", [], []
    for one in shown:
        around, points = scenario_items(one)
        hands, curves = _signals(one, baseline)
        view = views.scene(one.scenario.name, [*around, *hands], points)
        scenes.append(view)
        details.append(views.row(view, curves, shares=[4, 3], name=one.scenario.name))
    # all obstacles by setting, and reaches without obstacle
    centres = [place.obstacle.centre for place, _ in places]
    colours = [(HIT if hit else FREE).colour for _, hit in places]
    labels = [f"{place.setting:02d}" for place, _ in places]
    paths = [one.position for one in unhindered]
    bare = lines(entity("unhindered", BARE.name), [baseline.unroll(0.01).position], BARE.colour, -2.0)
    points = np.concatenate([centres, *paths])
    every = [
        items.dots("places", centres, colours, 0.012, labels=labels),
        lines(entity("unhindered", "paths"), paths, DEMONSTRATIONS.colour, -1.5),
        *(bare, items.floor_axes("/axes", points)),
    ]
    meanings = {look.name: look.colour for look in (DEMONSTRATIONS, HIT, FREE)}
    meanings[f"{BARE.name}: a movement primitive learned from reaches without obstacle"] = BARE.colour
    origin = views.origin_label([*unhindered, *(one for group in shown for one in group.demonstrations)])
    notes = views.notes(
        f"# {title}\n\nReaches past obstacles{origin}: {len(places)} settings, each with several shapes. "
        f"{len(shown)} scenarios are chosen here, with {len(shown[0].demonstrations)} demonstrations each. "
        f"A square of the floor is {FLOOR_SQUARE_M:g} m wide. {len(unhindered)} reaches without obstacle are "
        "in the tab *all settings*, with the number of every setting. In "
        f"{sum(hit for _, hit in places)} settings the reach without avoidance hits an obstacle: it enters "
        "the virtual radius, as in the tables. Dots on an obstacle are the cloud that models see; a point is "
        "the hand.\n\n"
        f"{views.legend(meanings)}\n\nPlay the time line to see the hands move.\n"
    )
    chosen, settings = views.grid(*scenes, columns=3), views.scene("all settings", every, points)
    first = views.row(chosen, notes, shares=[4, 1], name="chosen scenarios")
    second = views.row(settings, notes, shares=[4, 1], name="all settings")
    return Recording(title, views.tabs(first, second, *details))


def _signals(one: ShownScenario, baseline: PositionPrimitive) -> tuple[list[Item], Panel]:
    """Demonstrated hands, and plots of signals of the demonstrations and of no avoidance."""
    name, bare = one.scenario.name, without_avoidance(one.reaches)
    people = [(run.name, run.time, run.position, DEMONSTRATIONS.colour) for run in one.demonstrations]
    hands = [
        moving_frame(entity(name, "hands", label), time, position, colour)
        for label, time, position, colour in people
    ]
    curves = defaultdict[str, list[Item]](list)
    for label, time, position, colour in [*people, (BARE.name, bare.time, bare.position, BARE.colour)]:
        local = 1e3 * to_local(position, baseline)
        values = {side: local[:, axis] for axis, side in SIDES.items()}
        values["distance"] = 1e3 * one.scenario.obstacle.signed_distance(position)
        for part, signal in values.items():
            curves[part].append(series(entity(name, part, label), time, signal, label, colour))
    headings = {"distance": "distance to the surface (mm)"}
    headings |= {side: f"hand {side} the straight line (mm)" for side in SIDES.values()}
    plots = views.plots({heading: curves[part] for part, heading in headings.items()}, legend=False)
    return hands, views.column(*plots)


def trained(shown: Sequence[ShownScenario]) -> Recording:
    """Unrolls in trained scenarios: one tab per scenario, one column per kind of model.

    A column shows paths with coupling terms beside the demonstrations, the distance to the obstacle, and
    coupling terms over time beside the demonstrated ones.
    """
    title = "Obstacles: trained scenarios"
    origin = views.origin_label([one for group in shown for one in group.demonstrations])
    tabs = []
    for one in shown:
        kinds = [kind for kind in KINDS if kind != NO_MODEL and of_model(one.reaches, kind)]
        shares, notes = [3] * len(kinds) + [4], views.notes(_notes(title, origin, one), one.scenario.name)
        tabs.append(views.row(*_models(one, kinds), notes, shares=shares, name=one.scenario.name))
    return Recording(title, views.tabs(*tabs))


def _models(one: ShownScenario, kinds: Sequence[str]) -> Iterator[Panel]:
    """Scene and plots of each kind of model, by training source."""
    name, (around, points) = one.scenario.name, scenario_items(one)
    demonstrated: dict[str, list[Item]] = {direction: [] for direction in DIRECTIONS.values()}
    for number, rows in one.targets.groupby("demonstration"):
        for axis, direction in DIRECTIONS.items():
            path = entity(name, "demonstrated terms", direction, str(number))
            time, term = (rows[key].to_numpy(float) for key in ("time_s", f"target_{'xyz'[axis]}"))
            demonstrated[direction].append(series(path, time, term, DEMONSTRATIONS.name, DIM))
    limit = ROOM * float(np.abs(one.targets[["target_y", "target_z"]].to_numpy()).max())
    for kind in kinds:
        paths, distances, terms = [*around], [], {key: [*its] for key, its in demonstrated.items()}
        for reach in of_model(one.reaches, kind):
            label, colour = look = SOURCES[reach.learned_from]
            path, some = entity(name, kind, label), slice(None, None, ARROW_EVERY)
            arrows = rr.Arrows3D(
                origins=reach.position[some],
                vectors=arrow_vectors(reach.coupling_in_base[some]),
                colors=items.rgba(colour, 0.8),
                radii=-0.8,
            )
            paths += items.travelled(path, reach.time, reach.position, colour, -1.5)
            paths.append(Item(f"{path}/coupling", [arrows]))
            distance = 1e3 * one.scenario.obstacle.signed_distance(reach.position)
            distances.append(series(entity(name, "distance", kind, label), reach.time, distance, *look))
            for axis, direction in DIRECTIONS.items():
                path = entity(name, "terms", kind, direction, label)
                terms[direction].append(series(path, reach.time, reach.coupling[:, axis], *look))
        limits = (-limit, limit)
        yield views.column(
            views.scene(KINDS[kind].name, paths, points),
            views.plot("distance to the surface (mm)", distances),
            *(views.plot(f"coupling {word} (m)", its, False, limits) for word, its in terms.items()),
            shares=[5, 2, 2, 2],
        )


def _notes(title: str, origin: str, one: ShownScenario) -> str:
    surface = one.scenario.obstacle.signed_distance
    rows = [
        f"| {fitted_name(reach.model, reach.learned_from)} | "
        f"{1e3 * surface(reach.position).min():.0f} | {1e3 * reach.goal_distance_m:.0f} |"
        for reach in one.reaches
    ]
    people = min(1e3 * surface(person.position).min() for person in one.demonstrations)
    looks = [DEMONSTRATIONS, *(SOURCES[reach.learned_from] for reach in one.reaches)]
    colours = views.legend({look.name: look.colour for look in looks})
    return (
        f"# {title}\n\nThe {one.scenario.shape} in setting {one.scenario.setting:02d}, and what models do "
        f"that learned from it{origin}: from this setting alone, from all {one.scenario.shape}s, or from all "
        f"shapes. The reaches are unrolled, without a robot.\n\n{colours}\n\nArrows are the coupling term "
        f"along the path; none is drawn longer than {LONGEST_ARROW_M:g} m. Dark grey in plots: demonstrated "
        f"coupling terms. A square of the floor is {FLOOR_SQUARE_M:g} m wide."
        "\n\n"
        + views.table(
            "| model | closest | goal off |",
            [*rows, f"| {DEMONSTRATIONS.name} | {people:.0f} | |"],
        )
        + "\n\nClosest: mm from the obstacle's surface, negative inside. Goal off: mm at the due time.\n"
    )


def _solid(path: str, body: Obstacle, colour: str) -> Item:
    """The solid of an obstacle at rest."""
    from scipy.spatial.transform import Rotation

    turned = Rotation.from_matrix(body.rotation).as_quat()  # x, y, z, w
    pose: dict[str, Any] = {"centers": [body.centre], "quaternions": [turned]}
    kinds = {"cylinder": rr.Cylinders3D, "cube": rr.Boxes3D, "sphere": rr.Ellipsoids3D}
    if body.shape == "cylinder":
        pose |= {"lengths": [2.0 * body.half_size[2]], "radii": [body.half_size[0]]}
    else:
        pose["half_sizes"] = [body.half_size]
    return items.solid(path, kinds[body.shape], colour, SOLID_OPACITY, **pose)


def arrow_vectors(coupling: np.ndarray) -> np.ndarray:
    """Arrows (N, 3) in m for coupling terms (N, 3) in m, at most `LONGEST_ARROW_M` long."""
    vectors = ARROW_SCALE * coupling
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors * np.minimum(1.0, LONGEST_ARROW_M / np.maximum(length, LONGEST_ARROW_M))


def scenario_items(one: ShownScenario) -> tuple[list[Item], np.ndarray]:
    """Obstacle, demonstrations and the reach without avoidance on a floor, and all points (N, 3) m."""
    name, bare = one.scenario.name, without_avoidance(one.reaches)
    demonstrated = [person.position for person in one.demonstrations]
    colour, path = (HIT if bare.hit else FREE).colour, entity(name, "obstacle")
    points = np.concatenate([one.cloud, bare.position, *demonstrated])
    return [
        _solid(f"{path}/solid", one.scenario.obstacle, colour),
        items.dots(f"{path}/cloud", one.cloud, colour, -1.5),
        lines(entity(name, "demonstrated"), demonstrated, DEMONSTRATIONS.colour, -1.5),
        *items.travelled(entity(name, BARE.name), bare.time, bare.position, BARE.colour, -2.0),
        items.floor_axes(entity(name, "axes"), points),
    ], points
