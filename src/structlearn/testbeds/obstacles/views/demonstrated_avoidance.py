"""Recordings of trained scenarios: demonstrations (IV.8.3), and what models do beside them (IV.8.5, 8.6)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.avoidance.avoidance_dataset import to_local
from structlearn.primitives.position import PositionPrimitive
from structlearn.readers.demonstration import Demonstration
from structlearn.testbeds.obstacles.names import DEMONSTRATIONS, FREE, HIT, KINDS, SOURCES, model_name
from structlearn.testbeds.obstacles.protocol.avoidance_protocols import NO_MODEL
from structlearn.testbeds.obstacles.protocol.unrolled_reaches import of_model, without_avoidance
from structlearn.testbeds.obstacles.views.avoidance_scene import (
    BARE,
    LONGEST_ARROW_M,
    PALE,
    ShownScenario,
    send_arrows,
    send_hand,
    send_paths,
    send_scenario,
)
from structlearn.testbeds.obstacles.world.scenarios import Scenario
from structlearn.viewer.rrd import (
    FLOOR_SQUARE_M,
    entity,
    layout,
    legend,
    notes_view,
    origin_label,
    plot,
    recording,
    rgba,
    scene_view,
    send_curve,
    send_floor_axes,
    send_notes,
)

SIDES = {1: "left of", 2: "above"}
"""Of the straight line from start to goal, where the hand is, by axis of the local frame."""

DIRECTIONS = {1: "to the left", 2: "upwards"}
"""Of coupling terms, by axis of the local frame; the one along the reach is always 0."""

DIM = "#555c64"
"""Colour of demonstrated coupling terms behind those of models: a darker grey than that of demonstrations."""

ROOM = 1.5
"""Range of plots of coupling terms over that of the demonstrated ones: some go far beyond for an instant."""


def write_avoidance_demonstrations(
    path: str | Path,
    shown: Sequence[ShownScenario],
    unhindered: Sequence[Demonstration],
    baseline: PositionPrimitive,
    places: Sequence[tuple[Scenario, bool]],
    title: str,
) -> None:
    """Write demonstrations past obstacles as a recording.

    The first tab puts all chosen scenarios beside each other, the second shows the unhindered reaches and all
    settings, the others one scenario each with its signals. `places`: a scenario of each setting, and whether
    the reach without avoidance hits an obstacle there.
    """
    origin = origin_label([*unhindered, *(one for group in shown for one in group.demonstrations)])
    with recording(path, title) as stream:
        send_notes(stream, _notes(title, origin, shown, unhindered, places))
        everything = _send_settings(stream, unhindered, baseline, places)
        floor = send_floor_axes(stream, "/axes", everything)
        settings = scene_view("all settings", ["/places", "/unhindered/**", "/axes"], everything, floor)
        scenes, details = [], []
        for one in shown:
            name, points = one.scenario.name, send_scenario(stream, one)
            floor = send_floor_axes(stream, entity(name, "axes"), points)
            parts = ("obstacle", "demonstrated", BARE.name, "hands", "axes")
            contents = [f"{entity(name, part)}/**" for part in parts]
            scenes.append(scene_view(name, contents, points, floor))
            curves = rrb.Vertical(*_send_signals(stream, one, baseline))
            detail = scene_view(name, contents, points, floor)
            details.append(rrb.Horizontal(detail, curves, column_shares=[4, 3], name=name))
        tabs = [
            rrb.Horizontal(view, notes_view(), column_shares=[4, 1], name=words)
            for words, view in (
                ("chosen scenarios", rrb.Grid(*scenes, grid_columns=3)),
                ("all settings", settings),
            )
        ]
        stream.send_blueprint(layout(rrb.Tabs(*tabs, *details, active_tab=0)))


def _send_settings(
    stream: rr.RecordingStream,
    unhindered: Sequence[Demonstration],
    baseline: PositionPrimitive,
    places: Sequence[tuple[Scenario, bool]],
) -> np.ndarray:
    """Log where obstacles stand, with the numbers of their settings, and reaches; their points (N, 3) m."""
    centres = [place.obstacle.centre for place, _ in places]
    colours = rgba([(HIT if hit else FREE).colour for _, hit in places])
    labels = [f"{place.setting:02d}" for place, _ in places]
    balls = rr.Points3D(centres, colors=colours, radii=0.012, labels=labels, show_labels=True)
    stream.log("places", balls, static=True)
    paths = [one.position for one in unhindered]
    send_paths(stream, entity("unhindered", "paths"), paths, DEMONSTRATIONS.colour, PALE)
    bare = baseline.unroll(0.01).position
    send_paths(stream, entity("unhindered", BARE.name), [bare], BARE.colour, width=2.0)
    return np.concatenate([centres, *paths])


def _send_signals(
    stream: rr.RecordingStream, one: ShownScenario, baseline: PositionPrimitive
) -> list[rrb.TimeSeriesView]:
    """Log the hands of people, and signals of these and of the reach without avoidance; plots of them."""
    name, bare = one.scenario.name, without_avoidance(one.reaches)
    people = [(person.name, person.time, person.position) for person in one.demonstrations]
    for label, time, position in people:
        send_hand(stream, entity(name, "hands", label), time, position, DEMONSTRATIONS.colour)
    for label, time, position in [*people, (BARE.name, bare.time, bare.position)]:
        colour = BARE.colour if label == BARE.name else DEMONSTRATIONS.colour
        local = 1e3 * to_local(position, baseline)
        curves = {"distance": 1e3 * one.scenario.obstacle.signed_distance(position)}
        curves |= {side: local[:, axis] for axis, side in SIDES.items()}
        for part, values in curves.items():
            send_curve(stream, entity(name, part, label), time, values, label, colour)
    words = {"distance": "distance to the surface (mm)"}
    words |= {side: f"hand {side} the straight line (mm)" for side in SIDES.values()}
    return [plot(heading, [f"{entity(name, part)}/**"], False) for part, heading in words.items()]


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
        f"{legend(colours)}\n\nPlay the time line to see the hands move.\n"
    )


def write_trained_avoidance(path: str | Path, shown: Sequence[ShownScenario], title: str) -> None:
    """Write what the models do in scenarios that they learned from as a recording.

    Each scenario has a tab with a column per kind of model: paths with coupling terms beside the
    demonstrations, the distance to the obstacle, and coupling terms over time beside what was demonstrated.
    """
    origin = origin_label([one for group in shown for one in group.demonstrations])
    with recording(path, title) as stream:
        tabs = []
        for one in shown:
            name, points = one.scenario.name, send_scenario(stream, one)
            _send_targets(stream, one)
            send_notes(stream, _trained_notes(title, origin, one), name)
            floor = send_floor_axes(stream, entity(name, "axes"), points)
            kinds = [kind for kind in KINDS if kind != NO_MODEL and of_model(one.reaches, kind)]
            columns = []
            for kind in kinds:
                _send_model(stream, one, kind)
                columns.append(_column(one, kind, points, floor))
            shares = [5] * len(columns) + [4]
            tabs.append(rrb.Horizontal(*columns, notes_view(name), column_shares=shares, name=name))
        stream.send_blueprint(layout(rrb.Tabs(*tabs, active_tab=0)))


def _send_targets(stream: rr.RecordingStream, one: ShownScenario) -> None:
    """Coupling terms that the demonstrations teach; every column of plots shows them."""
    for number, rows in one.targets.groupby("demonstration"):
        for axis, direction in DIRECTIONS.items():
            path = entity(one.scenario.name, "demonstrated terms", direction, str(number))
            values = rows[f"target_{'xyz'[axis]}"].to_numpy(float)
            send_curve(stream, path, rows["time_s"].to_numpy(float), values, DEMONSTRATIONS.name, DIM)


def _send_model(stream: rr.RecordingStream, one: ShownScenario, kind: str) -> None:
    """Paths of a model and its signals, by what it learned from."""
    name = one.scenario.name
    for reach in of_model(one.reaches, kind):
        label, colour = SOURCES[reach.learned_from].name, SOURCES[reach.learned_from].colour
        scene = entity(name, kind, label)
        send_paths(stream, f"{scene}/path", [reach.position], colour, width=1.5)
        send_arrows(stream, f"{scene}/coupling", reach, colour)
        send_hand(stream, f"{scene}/hand", reach.time, reach.position, colour)
        distance = 1e3 * one.scenario.obstacle.signed_distance(reach.position)
        send_curve(stream, entity(name, "distance", kind, label), reach.time, distance, label, colour)
        for axis, direction in DIRECTIONS.items():
            curve = entity(name, "terms", kind, direction, label)
            send_curve(stream, curve, reach.time, reach.coupling[:, axis], label, colour)


def _column(one: ShownScenario, kind: str, points: np.ndarray, floor: float) -> rrb.Vertical:
    """Scene and plots of a kind of model."""
    name = one.scenario.name
    parts = ("obstacle", "demonstrated", BARE.name, "axes", kind)
    scene = scene_view(KINDS[kind].name, [f"{entity(name, part)}/**" for part in parts], points, floor)
    distance = plot("distance to the surface (mm)", [f"{entity(name, 'distance', kind)}/**"])
    limit = ROOM * float(np.abs(one.targets[["target_y", "target_z"]].to_numpy()).max())
    terms = []
    for direction in DIRECTIONS.values():
        curves = (("demonstrated terms", direction), ("terms", kind, direction))
        contents = [f"{entity(name, *curve)}/**" for curve in curves]
        term = plot(f"coupling {direction} (m)", contents, legend=False)
        term.properties["ScalarAxis"] = rrb.ScalarAxis(range=(-limit, limit))
        terms.append(term)
    return rrb.Vertical(scene, distance, *terms, row_shares=[5, 2, 2, 2])


def _trained_notes(title: str, origin: str, one: ShownScenario) -> str:
    surface = one.scenario.obstacle.signed_distance
    rows = [
        f"| {1e3 * surface(reach.position).min():.0f} | {1e3 * reach.goal_distance_m:.0f} | "
        f"{model_name(reach.model, reach.learned_from)} |"
        for reach in one.reaches
    ]
    people = min(1e3 * surface(person.position).min() for person in one.demonstrations)
    looks = [DEMONSTRATIONS, *(SOURCES[reach.learned_from] for reach in one.reaches)]
    colours = legend({look.name: look.colour for look in looks})
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
