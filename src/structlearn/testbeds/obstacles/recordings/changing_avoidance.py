"""Recording of what the dissertation left out: spheres that move, two at once, a goal that changes."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.avoidance.avoidance_dataset import baseline_axes
from structlearn.avoidance.learned_models import NETWORK
from structlearn.palette import BLUE
from structlearn.primitives.position import PositionPrimitive
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import GOAL_CHANGE, MOVING, PAIR, Situations
from structlearn.testbeds.obstacles.recordings.avoidance_scene import (
    BASELINE,
    FREE,
    HIT,
    send_paths,
    send_sphere,
    send_trail,
)
from structlearn.testbeds.obstacles.recordings.shown_reaches import Reach, SituationKey, of_baseline, of_model
from structlearn.testbeds.obstacles.recordings.unseen_avoidance import (
    COLOUR_WORDS,
    SHAPE_COLOURS,
    in_base_frame,
    situation_keys,
)
from structlearn.viewer.notes import colour_words, notes_view, send_notes
from structlearn.viewer.rrd import (
    entity,
    layout,
    plot,
    recording,
    rgba,
    scene_view,
    send_curve,
    time_column,
)

SHOWN = 3
"""Reaches per situation, evenly spread over those in which the baseline hits."""

PALE = 0.3
"""Opacity of the paths before they come about."""

NAMES = {MOVING: "moving sphere", PAIR: "two spheres", GOAL_CHANGE: "goal change"}

EXPLAINED = {
    MOVING: "A sphere crosses the reach and is there just when the unhindered hand would be.",
    PAIR: "Two spheres stand beside the reach; the coupling terms of both are added.",
    GOAL_CHANGE: "A sphere stands beside the reach, and the goal (the dark blue point) moves on the way.",
}


def write_changing_avoidance(
    path: str | Path,
    situations: Sequence[Situations],
    reaches: Mapping[SituationKey, Sequence[Reach]],
    baseline: PositionPrimitive,
    title: str,
) -> None:
    """Write reaches past obstacles that the models never met in training as a recording.

    Each situation has a tab with some of its reaches as scenes over time, and the distance to the nearest
    sphere below each.

    Args:
        path: of the .rrd file.
        situations: of spheres.
        reaches: by situation, of the baseline and of networks.
        baseline: whose local frame the spheres are in.
        title: heading, different for every recording.
    """
    with recording(path, title) as stream:
        tabs = [_tab(situation, reaches, baseline) for situation in situations]
        stream.send_blueprint(layout(rrb.Tabs(*tabs, active_tab=0)))
        for situation in situations:
            groups = [reaches[key] for key in situation_keys(situation)]
            send_notes(stream, _notes(title, situation, groups), situation.protocol)
            for index in shown_reaches(groups):
                _send_scene(stream, situation, index, groups[index], baseline)


def shown_reaches(groups: Sequence[Sequence[Reach]], count: int = SHOWN) -> list[int]:
    """Indices of at most `count` of the reaches, evenly spread over those in which the baseline hits."""
    hit = [index for index, group in enumerate(groups) if of_baseline(group).hit]
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
    group: Sequence[Reach],
    baseline: PositionPrimitive,
) -> None:
    parts = _parts(situation, index)
    scene, unhindered = entity(*parts), of_baseline(group)
    times = unhindered.time
    centres = sphere_paths(situation, index, times, baseline)
    radii = [float(obstacle.radius[index]) for obstacle in situation.obstacles]
    nearest = surface_distances(unhindered.position, centres, radii).min(axis=1)
    for number, (obstacle, path) in enumerate(zip(situation.obstacles, centres, strict=True)):
        cloud = (obstacle.points[index] - obstacle.centre[index]) @ baseline_axes(baseline).T
        # a hit between the samples that are kept is one of the nearest sphere
        hit = unhindered.hit and nearest[number] <= max(0.0, nearest.min())
        sphere, colours = f"{scene}/spheres/{number}", [HIT if hit else FREE] * len(times)
        send_sphere(stream, sphere, cloud, radii[number], [time_column(times)], path, colours)
    _send_goal(stream, f"{scene}/goal", situation, baseline)
    for reach in _drawn(group):
        colour = SHAPE_COLOURS.get(reach.learned_from, BASELINE)
        send_paths(stream, entity(*parts, "ahead", reach.label), [reach.position], colour, PALE)
        send_trail(stream, entity(*parts, "reaches", reach.label), reach, colour)
        distance = 1e3 * surface_distances(reach.position, centres, radii).min(axis=0)
        curve = entity(*parts, "distance", reach.label)
        send_curve(stream, curve, reach.time, distance, reach.label, colour)


def _send_goal(
    stream: rr.RecordingStream, path: str, situation: Situations, baseline: PositionPrimitive
) -> None:
    change = situation.goal_change
    times, goals = [0.0], [baseline.goal]
    if change is not None:
        times, goals = [0.0, change.time], [baseline.goal, np.reshape(change.goals, (-1, 3))[0]]
    stream.log(path, rr.Points3D.from_fields(colors=rgba([BLUE]), radii=-5.0), static=True)
    stream.send_columns(path, [time_column(np.array(times))], rr.Points3D.columns(positions=goals))


def _drawn(group: Sequence[Reach]) -> list[Reach]:
    return [of_baseline(group), *of_model(group, NETWORK)]


def _parts(situation: Situations, index: int) -> tuple[str, ...]:
    return (situation.protocol, _heading(situation, index))


def _heading(situation: Situations, index: int) -> str:
    heading = f"{NAMES[situation.protocol]} {situation.numbers[index]}"
    speed = situation.speed[index]
    return f"{heading}, {speed:g} m/s" if speed else heading


def _tab(
    situation: Situations, reaches: Mapping[SituationKey, Sequence[Reach]], baseline: PositionPrimitive
) -> rrb.Horizontal:
    groups = [reaches[key] for key in situation_keys(situation)]
    cells = []
    for index in shown_reaches(groups):
        scene, group = entity(*_parts(situation, index)), groups[index]
        times = of_baseline(group).time
        spheres = sphere_paths(situation, index, times, baseline)
        points = np.concatenate([*(reach.position for reach in _drawn(group)), *spheres])
        contents = [f"{scene}/{part}/**" for part in ("spheres", "reaches", "ahead", "goal")]
        heading = f"{_heading(situation, index)} (simulated)"
        distance = plot("distance to the nearest surface (mm)", [f"{scene}/distance/**"], legend=False)
        cells.append(rrb.Vertical(scene_view(heading, contents, points), distance, row_shares=[3, 2]))
    return rrb.Horizontal(
        *cells,
        notes_view(situation.protocol),
        column_shares=[4] * len(cells) + [3],
        name=NAMES[situation.protocol],
    )


def _notes(title: str, situation: Situations, groups: Sequence[Sequence[Reach]]) -> str:
    sources = list(dict.fromkeys(reach.label for group in groups for reach in _drawn(group)))
    rows = []
    for label in sources:
        its = [reach for group in groups for reach in _drawn(group) if reach.label == label]
        rows.append(f"| {label} | {sum(reach.hit for reach in its)} |")
    return (
        f"# {title}\n\n{EXPLAINED[situation.protocol]} Play the time line. Everything is simulated: networks "
        "that learned from simulated people with one sphere, cube or cylinder at rest are unrolled, without "
        "a robot. Arrows are the coupling term; pale lines are the paths to come.\n\n"
        f"{colour_words(COLOUR_WORDS)}\n\nShown are {len(shown_reaches(groups))} of {len(groups)} reaches; "
        f"the baseline hits in each of them.\n\n| hits | of {len(groups)} |\n|---|---|\n"
        + "\n".join(rows)
        + "\n"
    )
