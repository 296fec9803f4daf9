"""Recording of the unseen spheres: a step of its time line is another sphere beside the reach (IV.8.7)."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.avoidance.avoidance_dataset import baseline_axes
from structlearn.avoidance.learned_models import ALL, NETWORK
from structlearn.palette import GREEN, ORANGE, PURPLE, SKY
from structlearn.primitives.position import PositionPrimitive
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import Situations
from structlearn.testbeds.obstacles.recordings.avoidance_scene import (
    BASELINE,
    FREE,
    HIT,
    send_paths,
    send_sphere,
)
from structlearn.testbeds.obstacles.recordings.shown_reaches import Reach, SituationKey, of_baseline, of_model
from structlearn.viewer.notes import colour_words, notes_path, notes_view, send_notes
from structlearn.viewer.rrd import entity, layout, plot, recording, rgba, scene_view, send_series

SPHERE = "sphere"
"""Time line on which each step is another sphere."""

STEPS_PER_S = 2.0

SHAPE_COLOURS = {"sphere": SKY, "cube": ORANGE, "cylinder": GREEN, ALL: PURPLE}
"""Of networks, by the obstacles that they learned from."""

COLOUR_WORDS = {
    "light blue": "network of all spheres",
    "orange": "network of all cubes",
    "green": "network of all cylinders",
    "pink": "network of all shapes",
    "white": "baseline, without coupling term",
    "vermilion": "sphere that the baseline hits",
    "grey": "sphere that it does not hit",
}


def write_unseen_avoidance(
    path: str | Path,
    situation: Situations,
    reaches: Mapping[SituationKey, Sequence[Reach]],
    baseline: PositionPrimitive,
    title: str,
) -> None:
    """Write reaches past unseen spheres as a recording.

    The first tab shows all paths of each network at once; the second one sphere at a time with the paths of
    all networks, and how close they get to every sphere.

    Args:
        path: of the .rrd file.
        situation: the spheres at rest.
        reaches: by situation, of the baseline and of networks.
        baseline: whose local frame the spheres are in.
        title: heading, different for every recording.
    """
    keys = situation_keys(situation)
    groups = [reaches[key] for key in keys]
    centres = in_base_frame(situation.obstacles[0].centre, baseline)
    with recording(path, title) as stream:
        stream.send_blueprint(_blueprint(groups, centres, title))
        send_notes(stream, _notes(title, groups))
        steps = [rr.TimeColumn(SPHERE, sequence=situation.numbers)]
        _send_spheres(stream, situation, centres, groups, baseline, steps)
        send_paths(stream, entity("baseline"), [of_baseline(groups[0]).position], BASELINE, width=2.0)
        _send_closest(stream, "baseline", [of_baseline(group) for group in groups], BASELINE, steps)
        for name, colour in SHAPE_COLOURS.items():
            its = [reach for group in groups for reach in _of_network(group, name)]
            if its:
                _send_network(stream, name, its, colour, steps)
        _send_tables(stream, keys, groups, steps)


def situation_keys(situation: Situations) -> list[SituationKey]:
    """Keys of the reaches of a situation, in their order."""
    return [
        SituationKey(situation.protocol, situation.obstacle, int(number), float(speed))
        for number, speed in zip(situation.numbers, situation.speed, strict=True)
    ]


def in_base_frame(points: np.ndarray, baseline: PositionPrimitive) -> np.ndarray:
    """Points (..., 3) m of the baseline's local frame in the base frame."""
    return baseline.start + points @ baseline_axes(baseline).T


def _of_network(group: Sequence[Reach], learned_from: str) -> list[Reach]:
    return [reach for reach in of_model(group, NETWORK) if reach.learned_from == learned_from]


def _networks(groups: Sequence[Sequence[Reach]]) -> list[str]:
    """What the networks learned from, in the order of their colours."""
    return [name for name in SHAPE_COLOURS if _of_network(groups[0], name)]


def _send_spheres(
    stream: rr.RecordingStream,
    situation: Situations,
    centres: np.ndarray,
    groups: Sequence[Sequence[Reach]],
    baseline: PositionPrimitive,
    steps: Sequence[rr.TimeColumn],
) -> None:
    """All centres as small balls, and the sphere of each step in its size."""
    colours = [HIT if of_baseline(group).hit else FREE for group in groups]
    labels = [str(number) for number in situation.numbers]
    balls = rr.Points3D(centres, colors=rgba(colours), radii=0.006, labels=labels, show_labels=False)
    stream.log("centres", balls, static=True)
    spheres = situation.obstacles[0]
    cloud = (spheres.points[0] - spheres.centre[0]) @ baseline_axes(baseline).T
    path, radius = entity("one", "sphere"), float(spheres.radius[0])
    send_sphere(stream, path, cloud, radius, steps, centres, colours)


def _send_network(
    stream: rr.RecordingStream,
    name: str,
    reaches: Sequence[Reach],
    colour: str,
    steps: Sequence[rr.TimeColumn],
) -> None:
    send_paths(stream, entity("all", name), [reach.position for reach in reaches], colour, 0.7, 0.7)
    path = entity("one", "paths", name)
    stream.log(path, rr.LineStrips3D.from_fields(colors=rgba([colour]), radii=-1.5), static=True)
    strips = rr.LineStrips3D.columns(strips=[reach.position for reach in reaches])
    stream.send_columns(path, steps, strips)
    _send_closest(stream, name, reaches, colour, steps)


def _send_closest(
    stream: rr.RecordingStream,
    name: str,
    reaches: Sequence[Reach],
    colour: str,
    steps: Sequence[rr.TimeColumn],
) -> None:
    closest = np.array([[reach.obstacle_distance] for reach in reaches])
    send_series(stream, entity("closest", name), steps, closest, [reaches[0].label], [colour])


def _send_tables(
    stream: rr.RecordingStream,
    keys: Sequence[SituationKey],
    groups: Sequence[Sequence[Reach]],
    steps: Sequence[rr.TimeColumn],
) -> None:
    texts = [_table(key, group) for key, group in zip(keys, groups, strict=True)]
    columns = rr.TextDocument.columns(text=texts, media_type=[rr.MediaType.MARKDOWN] * len(texts))
    stream.send_columns(notes_path("sphere"), steps, columns)


def _table(key: SituationKey, group: Sequence[Reach]) -> str:
    rows = [
        f"| {reach.label} | {reach.obstacle_distance:.2f} | {'hit' if reach.hit else ''} |"
        for reach in [of_baseline(group), *of_model(group, NETWORK)]
    ]
    return f"## Sphere {key.number}\n\n| path | closest (radii) | |\n|---|---|---|\n" + "\n".join(rows)


def _blueprint(groups: Sequence[Sequence[Reach]], centres: np.ndarray, title: str) -> rrb.Blueprint:
    points = np.concatenate([centres, *(reach.position for reach in of_model(groups[0], NETWORK))])
    one = scene_view(
        f"one sphere and all networks (simulated); step on the time line '{SPHERE}'",
        ["/one/**", "/baseline", "/centres"],
        points,
    )
    closest = plot("closest approach to each sphere (radii from its surface; below 0: hit)", ["/closest/**"])
    beside = rrb.Vertical(closest, notes_view("sphere", name="this sphere"), row_shares=[1, 1])
    stepped = rrb.Horizontal(one, beside, column_shares=[4, 3], name="one by one")
    everything = np.concatenate([reach.position for group in groups for reach in of_model(group, NETWORK)])
    scenes = [
        scene_view(
            f"network of {_of_network(groups[0], name)[0].label}: {len(groups)} paths (simulated)",
            [entity("all", name), "/baseline", "/centres"],
            everything,
        )
        for name in _networks(groups)
    ]
    together = rrb.Horizontal(
        rrb.Grid(*scenes, grid_columns=2), notes_view(), column_shares=[4, 1], name="all paths"
    )
    return layout(rrb.Tabs(together, stepped, active_tab=0), timeline=SPHERE, steps_per_s=STEPS_PER_S)


def _notes(title: str, groups: Sequence[Sequence[Reach]]) -> str:
    rows = [f"| baseline | {sum(of_baseline(group).hit for group in groups)} |"]
    for name in _networks(groups):
        its = [reach for group in groups for reach in _of_network(group, name)]
        rows.append(f"| {its[0].label} | {sum(reach.hit for reach in its)} |")
    return (
        f"# {title}\n\n{len(groups)} spheres close round the reach, which nobody has shown. One is there at "
        "a time; the balls are the centres of all. Everything is simulated: networks that learned from "
        f"simulated people are unrolled, without a robot.\n\n{colour_words(COLOUR_WORDS)}\n\n"
        f"| hits | of {len(groups)} |\n|---|---|\n" + "\n".join(rows) + "\n"
    )
