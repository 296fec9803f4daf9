"""Recording of the unseen spheres: a step of its time line is another sphere beside the reach (IV.8.7)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.avoidance.avoidance_dataset import baseline_axes
from structlearn.avoidance.learned_models import ENSEMBLE
from structlearn.primitives.position import PositionPrimitive
from structlearn.testbeds.obstacles.names import FREE, HIT, SOURCES, model_name
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import Situations
from structlearn.testbeds.obstacles.protocol.unrolled_reaches import (
    Group,
    Reach,
    of_model,
    without_avoidance,
)
from structlearn.testbeds.obstacles.recordings.avoidance_scene import (
    BARE,
    in_base_frame,
    obstacle_colour,
    send_paths,
    send_sphere,
)
from structlearn.viewer.notes import legend, notes_path, notes_view, send_notes
from structlearn.viewer.rrd import entity, layout, plot, recording, rgba, scene_view, send_series

SPHERE = "sphere"
"""Time line on which each step is another sphere."""

STEPS_PER_S = 2.0


def write_unseen_avoidance(
    path: str | Path,
    situation: Situations,
    groups: Sequence[Group],
    baseline: PositionPrimitive,
    title: str,
) -> None:
    """Write reaches past unseen spheres as a recording.

    The first tab shows all paths of each ensemble at once; the second one sphere at a time with the paths of
    all ensembles, and how close they get to every sphere. `baseline`: whose local frame the spheres are in.
    """
    centres = in_base_frame(situation.obstacles[0].centre, baseline)
    ensembles = ensembles_of(groups)
    with recording(path, title) as stream:
        send_notes(stream, _notes(title, groups))
        steps = [rr.TimeColumn(SPHERE, sequence=situation.numbers)]
        _send_spheres(stream, situation, centres, groups, baseline, steps)
        bare = [without_avoidance(group) for group in groups]
        send_paths(stream, entity(BARE.name), [bare[0].position], BARE.colour, width=2.0)
        _send_closest(stream, bare, steps)
        for source, its in ensembles.items():
            positions, colour = [reach.position for reach in its], SOURCES[source].colour
            send_paths(stream, entity("all", source), positions, colour, 0.7, 0.7)
            look = rr.LineStrips3D.from_fields(colors=rgba([colour]), radii=-1.5)
            one = entity("one", "paths", source)
            stream.log(one, look, static=True)
            stream.send_columns(one, steps, rr.LineStrips3D.columns(strips=positions))
            _send_closest(stream, its, steps)
        texts = [_table(*pair) for pair in zip(situation.numbers, groups, strict=True)]
        columns = rr.TextDocument.columns(text=texts, media_type=[rr.MediaType.MARKDOWN] * len(texts))
        stream.send_columns(notes_path(SPHERE), steps, columns)
        stream.send_blueprint(_blueprint(ensembles, centres))


def ensembles_of(groups: Sequence[Group]) -> dict[str, list[Reach]]:
    """Reaches of ensembles in all situations, by what they learned from in the order of names."""
    every = [reach for group in groups for reach in of_model(group, ENSEMBLE)]
    found = {source: [reach for reach in every if reach.learned_from == source] for source in SOURCES}
    return {source: its for source, its in found.items() if its}


def hits_table(groups: Sequence[Group]) -> str:
    """How often each ensemble hits, and the reach without avoidance, in Markdown."""
    counts = {BARE.name: sum(without_avoidance(group).hit for group in groups)}
    for source, its in ensembles_of(groups).items():
        counts[model_name(ENSEMBLE, source)] = sum(reach.hit for reach in its)
    rows = [f"| {name} | {count} |" for name, count in counts.items()]
    return f"| hits | of {len(groups)} |\n|---|---|\n" + "\n".join(rows) + "\n"


def ensemble_legend(groups: Sequence[Group]) -> str:
    """Colours of ensembles and spheres, in Markdown."""
    ensembles = {model_name(ENSEMBLE, source): SOURCES[source].colour for source in ensembles_of(groups)}
    return legend(ensembles | {look.name: look.colour for look in (BARE, HIT, FREE)})


def _send_spheres(
    stream: rr.RecordingStream,
    situation: Situations,
    centres: np.ndarray,
    groups: Sequence[Group],
    baseline: PositionPrimitive,
    steps: Sequence[rr.TimeColumn],
) -> None:
    """All centres as small balls, and the sphere of each step in its size."""
    colours = [obstacle_colour(without_avoidance(group)) for group in groups]
    labels = [str(number) for number in situation.numbers]
    balls = rr.Points3D(centres, colors=rgba(colours), radii=0.006, labels=labels, show_labels=False)
    stream.log("centres", balls, static=True)
    spheres = situation.obstacles[0]
    cloud = (spheres.points[0] - spheres.centre[0]) @ baseline_axes(baseline).T
    path, radius = entity("one", "sphere"), float(spheres.radius[0])
    send_sphere(stream, path, cloud, radius, steps, centres, colours)


def _send_closest(stream: rr.RecordingStream, reaches: Group, steps: Sequence[rr.TimeColumn]) -> None:
    look, name = SOURCES[reaches[0].learned_from], reaches[0].learned_from or BARE.name
    closest = np.array([[reach.obstacle_distance] for reach in reaches])
    send_series(stream, entity("closest", name), steps, closest, [look.name], [look.colour])


def _table(number: int, group: Group) -> str:
    rows = [
        f"| {SOURCES[one.learned_from].name} | {one.obstacle_distance:.2f} | {'hit' if one.hit else ''} |"
        for one in [without_avoidance(group), *of_model(group, ENSEMBLE)]
    ]
    return f"## Sphere {number}\n\n| path | closest (radii) | |\n|---|---|---|\n" + "\n".join(rows)


def _blueprint(ensembles: dict[str, list[Reach]], centres: np.ndarray) -> rrb.Blueprint:
    points = np.concatenate([centres, *(its[0].position for its in ensembles.values())])
    one = scene_view(
        f"one sphere and all ensembles (simulated); step on the time line '{SPHERE}'",
        ["/one/**", entity(BARE.name), "/centres"],
        points,
    )
    closest = plot("closest approach to each sphere (radii from its surface; below 0: hit)", ["/closest/**"])
    beside = rrb.Vertical(closest, notes_view(SPHERE, name="this sphere"), row_shares=[1, 1])
    stepped = rrb.Horizontal(one, beside, column_shares=[4, 3], name="one by one")
    everything = np.concatenate([reach.position for its in ensembles.values() for reach in its])
    scenes = [
        scene_view(
            f"{model_name(ENSEMBLE, source)}: {len(its)} paths (simulated)",
            [entity("all", source), entity(BARE.name), "/centres"],
            everything,
        )
        for source, its in ensembles.items()
    ]
    together = rrb.Horizontal(
        rrb.Grid(*scenes, grid_columns=2), notes_view(), column_shares=[4, 1], name="all paths"
    )
    return layout(rrb.Tabs(together, stepped, active_tab=0), timeline=SPHERE, steps_per_s=STEPS_PER_S)


def _notes(title: str, groups: Sequence[Group]) -> str:
    return (
        f"# {title}\n\n{len(groups)} spheres close round the reach, which nobody has shown. One is there at "
        "a time; the balls are the centres of all. Everything is simulated: ensembles of networks that "
        "learned from a simulated person are unrolled, without a robot.\n\n"
        f"{ensemble_legend(groups)}\n\n{hits_table(groups)}"
    )
