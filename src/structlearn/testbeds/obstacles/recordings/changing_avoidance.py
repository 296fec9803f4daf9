"""Recording of what the dissertation left out: spheres that move, two at once, a goal that moves."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.avoidance.avoidance_dataset import baseline_axes
from structlearn.avoidance.learned_models import ENSEMBLE
from structlearn.palette import BLUE
from structlearn.primitives.position import PositionPrimitive
from structlearn.testbeds.obstacles.names import FREE, HIT, SITUATIONS, SOURCES
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import GOAL_CHANGE, MOVING, PAIR, Situations
from structlearn.testbeds.obstacles.protocol.unrolled_reaches import (
    Group,
    SituationKey,
    groups_of,
    of_model,
    without_avoidance,
)
from structlearn.testbeds.obstacles.recordings.avoidance_scene import (
    PALE,
    in_base_frame,
    send_paths,
    send_sphere,
    send_trail,
)
from structlearn.testbeds.obstacles.recordings.unseen_avoidance import ensemble_legend, hits_table
from structlearn.viewer.notes import notes_view, send_notes
from structlearn.viewer.rrd import entity, layout, plot, recording, rgba, scene_view, send_curve, time_column

SHOWN = 3
"""Reaches per situation, evenly spread over those in which the reach without avoidance hits."""

EXPLAINED = {
    MOVING: "A sphere crosses the reach and is there just when the unhindered hand would be.",
    PAIR: "Two spheres stand beside the reach; along each axis the strongest push either way acts.",
    GOAL_CHANGE: "A sphere stands beside the reach, and the goal (the dark blue point) moves on the way.",
}


def write_changing_avoidance(
    path: str | Path,
    situations: Sequence[Situations],
    reaches: Mapping[SituationKey, Group],
    baseline: PositionPrimitive,
    title: str,
) -> None:
    """Write reaches past obstacles that the models never met in training as a recording.

    Each situation has a tab with some of its reaches as scenes over time, and the distance to the nearest
    sphere below each. `baseline`: whose local frame the spheres are in.
    """
    with recording(path, title) as stream:
        tabs = []
        for situation in situations:
            protocol, groups = situation.protocol, groups_of(situation, reaches)
            send_notes(stream, _notes(title, protocol, groups), protocol)
            cells = [
                _send_scene(stream, situation, index, groups[index], baseline)
                for index in shown_reaches(groups)
            ]
            shares = [4] * len(cells) + [3]
            views: list[rrb.Container | rrb.View] = [*cells, notes_view(protocol)]
            tabs.append(rrb.Horizontal(*views, column_shares=shares, name=SITUATIONS[protocol]))
        stream.send_blueprint(layout(rrb.Tabs(*tabs, active_tab=0)))


def shown_reaches(groups: Sequence[Group], count: int = SHOWN) -> list[int]:
    """Indices of at most `count` of the reaches, evenly spread over those that hit without avoidance."""
    hit = [index for index, group in enumerate(groups) if without_avoidance(group).hit]
    shown = min(count, len(hit))
    return [hit[(2 * place + 1) * len(hit) // (2 * shown)] for place in range(shown)]


def sphere_paths(
    situation: Situations, index: int, times: np.ndarray, baseline: PositionPrimitive
) -> list[np.ndarray]:
    """Centres (T, 3) m of each sphere of a reach at times (T,) in s, base frame."""
    return [
        in_base_frame(obstacle.centre[index] + obstacle.path(times)[index], baseline)
        for obstacle in situation.obstacles
    ]


def surface_distances(
    position: np.ndarray, centres: Sequence[np.ndarray], radii: Sequence[float]
) -> np.ndarray:
    """Distances (S, T) in m of a hand (T, 3) from the surfaces of S spheres with centres (T, 3) each."""
    apart = [np.linalg.norm(position - path, axis=1) for path in centres]
    return np.array(apart) - np.array(radii)[:, None]


def _send_scene(
    stream: rr.RecordingStream,
    situation: Situations,
    index: int,
    group: Group,
    baseline: PositionPrimitive,
) -> rrb.Vertical:
    """Log one reach past its spheres by every ensemble; a scene and the distances below it."""
    heading = f"{SITUATIONS[situation.protocol]} {situation.numbers[index]}"
    if situation.speed[index]:
        heading += f", {situation.speed[index]:g} m/s"
    parts = (situation.protocol, heading)
    scene, bare = entity(*parts), without_avoidance(group)
    centres = sphere_paths(situation, index, bare.time, baseline)
    radii = [float(obstacle.radius[index]) for obstacle in situation.obstacles]
    nearest = surface_distances(bare.position, centres, radii).min(axis=1)
    for number, (obstacle, path) in enumerate(zip(situation.obstacles, centres, strict=True)):
        cloud = (obstacle.points[index] - obstacle.centre[index]) @ baseline_axes(baseline).T
        # a hit between the samples that are kept is one of the nearest sphere
        hit = bare.hit and nearest[number] <= max(0.0, nearest.min())
        colours = [(HIT if hit else FREE).colour] * len(bare.time)
        sphere = f"{scene}/spheres/{number}"
        send_sphere(stream, sphere, cloud, radii[number], [time_column(bare.time)], path, colours)
    _send_goal(stream, f"{scene}/goal", situation, baseline)
    drawn = [bare, *of_model(group, ENSEMBLE)]
    for reach in drawn:
        label, colour = SOURCES[reach.learned_from].name, SOURCES[reach.learned_from].colour
        send_paths(stream, entity(*parts, "ahead", label), [reach.position], colour, PALE)
        send_trail(stream, entity(*parts, "reaches", label), reach, colour)
        distance = 1e3 * surface_distances(reach.position, centres, radii).min(axis=0)
        send_curve(stream, entity(*parts, "distance", label), reach.time, distance, label, colour)
    points = np.concatenate([*(reach.position for reach in drawn), *centres])
    contents = [f"{scene}/{part}/**" for part in ("spheres", "reaches", "ahead", "goal")]
    distances = plot("distance to the nearest surface (mm)", [f"{scene}/distance/**"], legend=False)
    view = scene_view(f"{heading} (simulated)", contents, points)
    return rrb.Vertical(view, distances, row_shares=[3, 2])


def _send_goal(
    stream: rr.RecordingStream, path: str, situation: Situations, baseline: PositionPrimitive
) -> None:
    change = situation.goal_change
    times, goals = [0.0], [baseline.goal]
    if change is not None:
        times, goals = [0.0, change.time], [baseline.goal, np.reshape(change.goals, (-1, 3))[0]]
    stream.log(path, rr.Points3D.from_fields(colors=rgba([BLUE]), radii=-5.0), static=True)
    stream.send_columns(path, [time_column(np.array(times))], rr.Points3D.columns(positions=goals))


def _notes(title: str, protocol: str, groups: Sequence[Group]) -> str:
    return (
        f"# {title}\n\n{EXPLAINED[protocol]} Play the time line. Everything is simulated: ensembles that "
        "learned from a simulated person with one sphere, cube or cylinder at rest are unrolled, without a "
        "robot. Arrows are the coupling term; pale lines are the paths to come.\n\n"
        f"{ensemble_legend(groups)}\n\nShown are {len(shown_reaches(groups))} of {len(groups)} reaches; "
        f"without avoidance each of them hits.\n\n{hits_table(groups)}"
    )
