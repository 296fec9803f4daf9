"""Recordings of unseen spheres (IV.8.7), and of situations beyond it: moving spheres, pairs, moving goals."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import rerun as rr

from dissertation.obstacles.names import FREE, HIT, SITUATIONS, SOURCES, fitted_name
from dissertation.obstacles.protocol.avoidance_protocols import GOAL_CHANGE, MOVING, PAIR, Situations
from dissertation.obstacles.protocol.unrolled_reaches import (
    Group,
    Reach,
    SituationKey,
    groups_of,
    of_model,
    without_avoidance,
)
from dissertation.obstacles.recordings.demonstrated_avoidance import BARE, SOLID_OPACITY, arrow_vectors
from structlearn.avoidance.avoidance_dataset import baseline_axes
from structlearn.avoidance.learned_models import ENSEMBLE
from structlearn.palette import BLUE
from structlearn.primitives.position import PositionPrimitive
from structlearn.viewer import items, views
from structlearn.viewer.items import FLOOR_SQUARE_M, Item, entity, lines, rgba, series
from structlearn.viewer.recording import Recording
from structlearn.viewer.views import Panel

SPHERE, STEPS_PER_S = "sphere", 2.0  # time line with one step per sphere
SHOWN = 3  # reaches per situation, evenly spread over those that hit without avoidance

PALE = 0.5  # opacity of future paths

EXPLAINED = {
    MOVING: "A sphere crosses the reach and meets the hand if the hand does not avoid it.",
    PAIR: "Two spheres are next to the reach; the strongest coupling term in either direction applies.",
    GOAL_CHANGE: "A sphere is next to the reach, and the goal (the dark blue point) moves during the reach.",
}


def unseen(situation: Situations, groups: Sequence[Group], baseline: PositionPrimitive) -> Recording:
    """Reaches past unseen spheres, which are in the local frame of the baseline.

    The first tab shows all paths of each ensemble; the second one sphere at a time, with the paths of all
    ensembles and their closest distance to every sphere.
    """
    title, steps = "Obstacles: unseen spheres", {SPHERE: np.asarray(situation.numbers)}
    ensembles, bare = ensembles_of(groups), [without_avoidance(group) for group in groups]
    everything = np.concatenate([reach.position for its in ensembles.values() for reach in its])
    centres, spheres = in_base_frame(situation.obstacles[0].centre, baseline), situation.obstacles[0]
    colours = [(HIT if reach.hit else FREE).colour for reach in bare]
    size = {"centers": centres, "radii": spheres.radius, "fill_mode": "majorwireframe", "line_radii": -0.5}
    labels = [str(number) for number in situation.numbers]  # shown on hover
    around = [
        lines(entity(BARE.name), [bare[0].position], BARE.colour, -2.0),
        items.solid("spheres", rr.Ellipsoids3D, colours, 0.5, **size, labels=labels, show_labels=False),
        items.floor_axes("/axes", everything),
    ]
    cloud = (spheres.points[0] - spheres.centre[0]) @ baseline_axes(baseline).T
    one = [*sphere(entity("one", "sphere"), cloud, float(spheres.radius[0]), steps, centres, colours)]
    scenes, closest = [], [_closest(bare, steps)]
    for source, its in ensembles.items():
        positions, colour = [reach.position for reach in its], SOURCES[source].colour
        every = lines(entity("all", source), positions, colour, -0.7, opacity=0.7)
        scenes.append(views.scene(fitted_name(ENSEMBLE, source), [every, *around], everything))
        look = rr.LineStrips3D.from_fields(colors=rgba(colour), radii=-1.5)
        strips = rr.LineStrips3D.columns(strips=positions)
        one.append(Item(entity("one", "paths", source), [look], steps, strips))
        closest.append(_closest(its, steps))
    texts = []
    for number, group in zip(situation.numbers, groups, strict=True):
        rows = [
            f"| {SOURCES[one.learned_from].name} | {one.obstacle_distance:.2f} | {'hit' * one.hit} |"
            for one in [without_avoidance(group), *of_model(group, ENSEMBLE)]
        ]
        texts.append(f"## Sphere {number}\n\n{views.table('| path | closest (radii) | |', rows)}")
    stepped = rr.TextDocument.columns(text=texts, media_type=[rr.MediaType.MARKDOWN] * len(texts))
    beside = views.column(
        views.plot("closest approach (radii; below 0: hit)", closest),
        views.notes_view("this sphere", Item(entity("notes", SPHERE), (), steps, stepped)),
        shares=[1, 1],
    )
    notes = views.notes(
        f"# {title}\n\n{len(groups)} spheres lie close around the reach; none was demonstrated. One is there "
        f"at a time: step along the time line *{SPHERE}*. Outlines are all spheres, at their size. "
        "Everything is simulated: ensembles of networks, trained on a simulated person, are unrolled without "
        "a robot. "
        f"A square of the floor is {FLOOR_SQUARE_M:g} m wide.\n\n"
        f"{ensemble_legend(groups)}\n\n{hits_table(groups)}"
    )
    points = np.concatenate([centres, *(its[0].position for its in ensembles.values())])
    scene = views.scene("one sphere, all ensembles", [*one, *around], points)
    together = views.row(views.grid(*scenes), notes, shares=[4, 1], name="all paths")
    alone = views.row(scene, beside, shares=[4, 3], name="one by one")
    return Recording(title, views.tabs(together, alone), SPHERE, STEPS_PER_S)


def _closest(reaches: Sequence[Reach], steps: items.Times) -> Item:
    name, closest = reaches[0].learned_from, np.array([reach.obstacle_distance for reach in reaches])
    return series(entity("closest", name or BARE.name), steps, closest, *SOURCES[name])


def ensembles_of(groups: Sequence[Group]) -> dict[str, list[Reach]]:
    """Reaches of ensembles in all situations, by training source."""
    every = [reach for group in groups for reach in of_model(group, ENSEMBLE)]
    found = {source: [reach for reach in every if reach.learned_from == source] for source in SOURCES}
    return {source: its for source, its in found.items() if its}


def hits_table(groups: Sequence[Group]) -> str:
    """Number of hits of each ensemble and without avoidance, as a Markdown table."""
    counts = {BARE.name: sum(without_avoidance(group).hit for group in groups)}
    for source, its in ensembles_of(groups).items():
        counts[fitted_name(ENSEMBLE, source)] = sum(reach.hit for reach in its)
    rows = [f"| {name} | {count} |" for name, count in counts.items()]
    return views.table(f"| hits | of {len(groups)} |", rows) + "\n"


def ensemble_legend(groups: Sequence[Group]) -> str:
    """Colours of ensembles and spheres, as a Markdown legend."""
    ensembles = {fitted_name(ENSEMBLE, source): SOURCES[source].colour for source in ensembles_of(groups)}
    return views.legend(ensembles | {look.name: look.colour for look in (BARE, HIT, FREE)})


def changing(
    situations: Sequence[Situations], reaches: Mapping[SituationKey, Group], baseline: PositionPrimitive
) -> Recording:
    """Reaches past obstacles of kinds that are not in the training data, one tab per situation.

    A tab shows some reaches as scenes over time, with the distance to the nearest sphere below each.
    """
    title, tabs = "Obstacles: beyond the dissertation", []
    for situation in situations:
        protocol, groups = situation.protocol, groups_of(situation, reaches)
        cells = [_scene(situation, index, groups[index], baseline) for index in shown_reaches(groups)]
        hit = sum(without_avoidance(group).hit for group in groups)
        notes = views.notes(
            f"# {title}\n\n{EXPLAINED[protocol]} Play the time line. Everything is simulated: ensembles "
            "trained on a simulated person with one sphere, cube or cylinder at rest are unrolled without a "
            "robot. Arrows are the coupling term; pale lines are the paths to come. A square of the floor is "
            f"{FLOOR_SQUARE_M:g} m wide.\n\n{ensemble_legend(groups)}\n\nShown are {len(cells)} "
            f"reaches, evenly spread over the {hit} of {len(groups)} that hit without avoidance. Hits of all "
            f"reaches:\n\n{hits_table(groups)}",
            protocol,
        )
        shares = [4] * len(cells) + [3]
        tabs.append(views.row(*cells, notes, shares=shares, name=SITUATIONS[protocol]))
    return Recording(title, views.tabs(*tabs))


def shown_reaches(groups: Sequence[Group], count: int = SHOWN) -> list[int]:
    """Indices of at most `count` reaches, evenly spread over those that hit without avoidance."""
    hit = [index for index, group in enumerate(groups) if without_avoidance(group).hit]
    shown = min(count, len(hit))
    return [hit[(2 * place + 1) * len(hit) // (2 * shown)] for place in range(shown)]


def surface_distances(
    position: np.ndarray, centres: Sequence[np.ndarray], radii: Sequence[float]
) -> np.ndarray:
    """Distances (S, T) in m of a hand (T, 3) from the surfaces of S spheres with centres (T, 3) each."""
    apart = [np.linalg.norm(position - path, axis=1) for path in centres]
    return np.array(apart) - np.array(radii)[:, None]


def _scene(situation: Situations, index: int, group: Group, baseline: PositionPrimitive) -> Panel:
    """Each ensemble's reach in one situation, with the distances below it."""
    heading = f"{SITUATIONS[situation.protocol]} {situation.numbers[index]}"
    if situation.speed[index]:
        heading += f", {situation.speed[index]:g} m/s"
    scene, bare = entity(situation.protocol, heading), without_avoidance(group)
    centres = [
        in_base_frame(obstacle.centre[index] + obstacle.path(bare.time)[index], baseline)
        for obstacle in situation.obstacles
    ]
    radii = [float(obstacle.radius[index]) for obstacle in situation.obstacles]
    nearest = surface_distances(bare.position, centres, radii).min(axis=1)
    shown, distances, drawn = list[Item](), [], [bare, *of_model(group, ENSEMBLE)]
    for number, (obstacle, centre) in enumerate(zip(situation.obstacles, centres, strict=True)):
        cloud = (obstacle.points[index] - obstacle.centre[index]) @ baseline_axes(baseline).T
        # a hit between kept samples is assigned to the nearest sphere
        hit = bare.hit and nearest[number] <= max(0.0, nearest.min())
        colours = [(HIT if hit else FREE).colour] * len(bare.time)
        shown += sphere(f"{scene}/spheres/{number}", cloud, radii[number], bare.time, centre, colours)
    times, goals = [0.0], [baseline.goal]
    if situation.goal_change is not None:
        times.append(situation.goal_change.time)
        goals.append(np.reshape(situation.goal_change.goals, (-1, 3))[0])
    shown.append(items.moving_point(f"{scene}/goal", np.array(times), np.array(goals), BLUE, -5.0))
    for reach in drawn:
        label, colour = look = SOURCES[reach.learned_from]
        ahead, path = (entity(situation.protocol, heading, part, label) for part in ("ahead", "reaches"))
        shown.append(lines(ahead, [reach.position], colour, -1.0, opacity=PALE))
        shown.append(items.moving_frame(f"{path}/hand", reach.time, reach.position, colour))
        shown.append(items.trail(f"{path}/trail", reach.time, reach.position, colour, -1.5))
        thin = rr.Arrows3D.from_fields(colors=rgba(colour), radii=-1.5)
        arrows = rr.Arrows3D.columns(origins=reach.position, vectors=arrow_vectors(reach.coupling_in_base))
        shown.append(Item(f"{path}/coupling", [thin], reach.time, arrows))
        distance = 1e3 * surface_distances(reach.position, centres, radii).min(axis=0)
        curve = entity(situation.protocol, heading, "distance", label)
        distances.append(series(curve, reach.time, distance, *look))
    everything = np.concatenate([*(reach.position for reach in drawn), *centres])
    view = views.scene(heading, [*shown, items.floor_axes(f"{scene}/axes", everything)], everything)
    plot = views.plot("distance to the surface (mm)", distances, legend=False)
    return views.column(view, plot, shares=[3, 2])


def in_base_frame(points: np.ndarray, baseline: PositionPrimitive) -> np.ndarray:
    """Transform points (..., 3) m from the baseline's local frame to the base frame."""
    return baseline.start + points @ baseline_axes(baseline).T


def sphere(
    path: str,
    cloud: np.ndarray,
    radius: float,
    times: items.Times,
    centres: np.ndarray,
    colours: Sequence[str],
) -> Iterator[Item]:
    """A sphere with changing centre (T, 3) m and colour; `cloud` (P, 3) m is relative to the centre."""
    yield items.moving_frame(path, times, centres)
    solid = rr.Ellipsoids3D(half_sizes=[[radius] * 3], fill_mode="solid")
    pale = rr.Ellipsoids3D.columns(colors=rgba(colours, SOLID_OPACITY))
    yield Item(f"{path}/solid", [solid], times, pale)
    points = rr.Points3D(cloud, radii=-1.5)
    yield Item(f"{path}/cloud", [points], times, rr.Points3D.columns(colors=rgba(colours)))
