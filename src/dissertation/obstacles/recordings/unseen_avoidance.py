"""Recordings of unseen spheres (IV.8.7), and of situations beyond it: moving spheres, pairs, moving goals."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.components import FillMode

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
from dissertation.obstacles.recordings.demonstrated_avoidance import BARE, PALE, SOLID_OPACITY, arrow_vectors
from structlearn.avoidance.avoidance_dataset import baseline_axes
from structlearn.avoidance.learned_models import ENSEMBLE
from structlearn.palette import BLUE
from structlearn.primitives.position import PositionPrimitive
from structlearn.viewer import rrd
from structlearn.viewer.rrd import FLOOR_SQUARE_M, Recording, entity, plot, rgba, scene_view

SPHERE, STEPS_PER_S = "sphere", 2.0  # time line with one step per sphere
SHOWN = 3  # reaches per situation, evenly spread over those that hit without avoidance

EXPLAINED = {
    MOVING: "A sphere crosses the reach and meets the hand if the hand does not avoid it.",
    PAIR: "Two spheres are next to the reach; the strongest coupling term in either direction applies.",
    GOAL_CHANGE: "A sphere is next to the reach, and the goal (the dark blue point) moves during the reach.",
}


def write_unseen_avoidance(
    path: str | Path, situation: Situations, groups: Sequence[Group], baseline: PositionPrimitive, title: str
) -> None:
    """Record reaches past unseen spheres, which are in the local frame of the baseline.

    The first tab shows all paths of each ensemble; the second one sphere at a time, with the paths of all
    ensembles and their closest distance to every sphere.
    """
    centres = in_base_frame(situation.obstacles[0].centre, baseline)
    ensembles = ensembles_of(groups)
    with rrd.recording(path, title) as to:
        to.notes(_notes(title, groups))
        steps = rr.TimeColumn(SPHERE, sequence=situation.numbers)
        _send_spheres(to, situation, centres, groups, baseline, steps)
        bare = [without_avoidance(group) for group in groups]
        to.lines(entity(BARE.name), [bare[0].position], BARE.colour, -2.0)
        _send_closest(to, bare, steps)
        for source, its in ensembles.items():
            positions, colour = [reach.position for reach in its], SOURCES[source].colour
            to.lines(entity("all", source), positions, colour, -0.7, opacity=0.7)
            one = entity("one", "paths", source)
            to.still(one, rr.LineStrips3D.from_fields(colors=rgba(colour), radii=-1.5))
            to.over(one, steps, rr.LineStrips3D.columns(strips=positions))
            _send_closest(to, its, steps)
        texts = []
        for number, group in zip(situation.numbers, groups, strict=True):
            rows = [
                f"| {SOURCES[one.learned_from].name} | {one.obstacle_distance:.2f} | {'hit' * one.hit} |"
                for one in [without_avoidance(group), *of_model(group, ENSEMBLE)]
            ]
            texts.append(f"## Sphere {number}\n\n{rrd.table('| path | closest (radii) | |', rows)}")
        columns = rr.TextDocument.columns(text=texts, media_type=[rr.MediaType.MARKDOWN] * len(texts))
        to.over(entity("notes", SPHERE), steps, columns)
        everything = np.concatenate([reach.position for its in ensembles.values() for reach in its])
        floor = to.floor_axes("/axes", everything)
        to.show(_blueprint(ensembles, centres, everything, floor), SPHERE, STEPS_PER_S)


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
    return rrd.table(f"| hits | of {len(groups)} |", rows) + "\n"


def ensemble_legend(groups: Sequence[Group]) -> str:
    """Colours of ensembles and spheres, as a Markdown legend."""
    ensembles = {fitted_name(ENSEMBLE, source): SOURCES[source].colour for source in ensembles_of(groups)}
    return rrd.legend(ensembles | {look.name: look.colour for look in (BARE, HIT, FREE)})


def _send_spheres(
    to: Recording,
    situation: Situations,
    centres: np.ndarray,
    groups: Sequence[Group],
    baseline: PositionPrimitive,
    steps: rr.TimeColumn,
) -> None:
    """Log all centres as small balls, and each step's sphere in full size."""
    colours = [(HIT if without_avoidance(group).hit else FREE).colour for group in groups]
    labels = [str(number) for number in situation.numbers]
    to.dots("centres", centres, colours, 0.006, labels=labels, show_labels=False)
    spheres = situation.obstacles[0]
    cloud = (spheres.points[0] - spheres.centre[0]) @ baseline_axes(baseline).T
    path, radius = entity("one", "sphere"), float(spheres.radius[0])
    send_sphere(to, path, cloud, radius, steps, centres, colours)


def _send_closest(to: Recording, reaches: Group, steps: rr.TimeColumn) -> None:
    look, name = SOURCES[reaches[0].learned_from], reaches[0].learned_from or BARE.name
    closest = np.array([[reach.obstacle_distance] for reach in reaches])
    to.series(entity("closest", name), steps, closest, [look.name], [look.colour])


def _blueprint(
    ensembles: dict[str, list[Reach]], centres: np.ndarray, everything: np.ndarray, floor: float
) -> list[rrb.Horizontal]:
    points = np.concatenate([centres, *(its[0].position for its in ensembles.values())])
    around = [entity(BARE.name), "/centres", "/axes"]
    one = scene_view("one sphere, all ensembles", ["/one/**", *around], points, floor)
    closest = plot("closest approach (radii; below 0: hit)", ["/closest/**"])
    beside = rrb.Vertical(closest, rrd.notes_view(SPHERE, name="this sphere"), row_shares=[1, 1])
    stepped = rrb.Horizontal(one, beside, column_shares=[4, 3], name="one by one")
    scenes = [
        scene_view(fitted_name(ENSEMBLE, source), [entity("all", source), *around], everything, floor)
        for source in ensembles
    ]
    together = rrb.Horizontal(
        rrb.Grid(*scenes, grid_columns=2), rrd.notes_view(), column_shares=[4, 1], name="all paths"
    )
    return [together, stepped]


def _notes(title: str, groups: Sequence[Group]) -> str:
    return (
        f"# {title}\n\n{len(groups)} spheres lie close around the reach; none was demonstrated. One is there "
        f"at a time: step along the time line *{SPHERE}*. Balls are the centres of all. Everything is "
        "simulated: ensembles of networks, trained on a simulated person, are unrolled without a robot. "
        f"A square of the floor is {FLOOR_SQUARE_M:g} m wide.\n\n"
        f"{ensemble_legend(groups)}\n\n{hits_table(groups)}"
    )


def write_changing_avoidance(
    path: str | Path,
    situations: Sequence[Situations],
    reaches: Mapping[SituationKey, Group],
    baseline: PositionPrimitive,
    title: str,
) -> None:
    """Record reaches past obstacles of kinds that are not in the training data, one tab per situation.

    A tab shows some reaches as scenes over time, with the distance to the nearest sphere below each.
    """
    with rrd.recording(path, title) as to:
        tabs = []
        for situation in situations:
            protocol, groups = situation.protocol, groups_of(situation, reaches)
            to.notes(_changing_notes(title, protocol, groups), protocol)
            cells = [
                _send_scene(to, situation, index, groups[index], baseline) for index in shown_reaches(groups)
            ]
            shares, name = [4] * len(cells) + [3], SITUATIONS[protocol]
            tabs.append(rrb.Horizontal(*cells, rrd.notes_view(protocol), column_shares=shares, name=name))
        to.show(tabs)


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


def _send_scene(
    to: Recording, situation: Situations, index: int, group: Group, baseline: PositionPrimitive
) -> rrb.Vertical:
    """Log each ensemble's reach in one situation; return a scene with the distances below it."""
    heading = f"{SITUATIONS[situation.protocol]} {situation.numbers[index]}"
    if situation.speed[index]:
        heading += f", {situation.speed[index]:g} m/s"
    parts = (situation.protocol, heading)
    scene, bare = entity(*parts), without_avoidance(group)
    centres = [
        in_base_frame(obstacle.centre[index] + obstacle.path(bare.time)[index], baseline)
        for obstacle in situation.obstacles
    ]
    radii = [float(obstacle.radius[index]) for obstacle in situation.obstacles]
    nearest = surface_distances(bare.position, centres, radii).min(axis=1)
    for number, (obstacle, path) in enumerate(zip(situation.obstacles, centres, strict=True)):
        cloud = (obstacle.points[index] - obstacle.centre[index]) @ baseline_axes(baseline).T
        # a hit between kept samples is assigned to the nearest sphere
        hit = bare.hit and nearest[number] <= max(0.0, nearest.min())
        colours = [(HIT if hit else FREE).colour] * len(bare.time)
        sphere = f"{scene}/spheres/{number}"
        send_sphere(to, sphere, cloud, radii[number], bare.time, path, colours)
    times, goals = [0.0], [baseline.goal]
    if situation.goal_change is not None:
        times.append(situation.goal_change.time)
        goals.append(np.reshape(situation.goal_change.goals, (-1, 3))[0])
    to.still(f"{scene}/goal", rr.Points3D.from_fields(colors=rgba(BLUE), radii=-5.0))
    points = rr.Points3D.columns(positions=goals)
    to.over(f"{scene}/goal", np.array(times), points)
    drawn = [bare, *of_model(group, ENSEMBLE)]
    for reach in drawn:
        label, colour = SOURCES[reach.learned_from]
        to.lines(entity(*parts, "ahead", label), [reach.position], colour, -1.0, opacity=PALE)
        send_trail(to, entity(*parts, "reaches", label), reach, colour)
        distance = 1e3 * surface_distances(reach.position, centres, radii).min(axis=0)
        to.series(entity(*parts, "distance", label), reach.time, distance, label, colour)
    everything = np.concatenate([*(reach.position for reach in drawn), *centres])
    floor = to.floor_axes(f"{scene}/axes", everything)
    contents = [f"{scene}/{part}/**" for part in ("spheres", "reaches", "ahead", "goal", "axes")]
    distances = plot("distance to the surface (mm)", [f"{scene}/distance/**"], legend=False)
    view = scene_view(heading, contents, everything, floor)
    return rrb.Vertical(view, distances, row_shares=[3, 2])


def _changing_notes(title: str, protocol: str, groups: Sequence[Group]) -> str:
    hit = sum(without_avoidance(group).hit for group in groups)
    return (
        f"# {title}\n\n{EXPLAINED[protocol]} Play the time line. Everything is simulated: ensembles "
        "trained on a simulated person with one sphere, cube or cylinder at rest are unrolled without a "
        "robot. Arrows are the coupling term; pale lines are the paths to come. A square of the floor is "
        f"{FLOOR_SQUARE_M:g} m wide.\n\n{ensemble_legend(groups)}\n\nShown are {len(shown_reaches(groups))} "
        f"reaches, evenly spread over the {hit} of {len(groups)} that hit without avoidance. Hits of all "
        f"reaches:\n\n{hits_table(groups)}"
    )


def in_base_frame(points: np.ndarray, baseline: PositionPrimitive) -> np.ndarray:
    """Transform points (..., 3) m from the baseline's local frame to the base frame."""
    return baseline.start + points @ baseline_axes(baseline).T


def send_sphere(
    to: Recording,
    path: str,
    cloud: np.ndarray,
    radius: float,
    times: rrd.Times,
    centres: np.ndarray,
    colours: Sequence[str],
) -> None:
    """Log a sphere with changing centre (T, 3) m and colour; `cloud` (P, 3) m is relative to the centre."""
    to.still(f"{path}/solid", rr.Ellipsoids3D(half_sizes=[[radius] * 3], fill_mode=FillMode.Solid))
    to.still(f"{path}/cloud", rr.Points3D(cloud, radii=-1.5))
    pale = rr.Ellipsoids3D.columns(colors=rgba(colours, SOLID_OPACITY))
    to.over(path, times, rr.Transform3D.columns(translation=centres))
    to.over(f"{path}/solid", times, pale)
    to.over(f"{path}/cloud", times, rr.Points3D.columns(colors=rgba(colours)))


def send_trail(to: Recording, path: str, reach: Reach, colour: str) -> None:
    """Log a reach over time: the hand with its coupling term, and the path travelled."""
    to.moving_frame(f"{path}/hand", reach.time, reach.position, colour)
    to.trail(f"{path}/trail", reach.time, reach.position, colour, -1.5)
    to.still(f"{path}/coupling", rr.Arrows3D.from_fields(colors=rgba(colour), radii=-1.5))
    arrows = rr.Arrows3D.columns(origins=reach.position, vectors=arrow_vectors(reach.coupling_in_base))
    to.over(f"{path}/coupling", reach.time, arrows)
