"""Recording of demonstrations past obstacles: how people pass them, and a bare reach does not (IV.8.3)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.avoidance.avoidance_dataset import to_local
from structlearn.primitives.position import PositionPrimitive
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.obstacles.names import DEMONSTRATIONS, FREE, HIT
from structlearn.testbeds.obstacles.protocol.unrolled_reaches import without_avoidance
from structlearn.testbeds.obstacles.recordings.avoidance_scene import (
    BARE,
    PALE,
    send_hand,
    send_paths,
    send_scenario,
)
from structlearn.testbeds.obstacles.recordings.shown_scenarios import ShownScenario
from structlearn.testbeds.obstacles.world.scenarios import Scenario
from structlearn.viewer.notes import legend, notes_view, send_notes
from structlearn.viewer.rrd import entity, layout, origin_label, plot, recording, rgba, scene_view, send_curve

SIDES = {1: "left of", 2: "above"}
"""Of the straight line from start to goal, where the hand is, by axis of the local frame."""


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
        settings = scene_view(
            f"reach without avoidance and all {len(places)} settings{origin}",
            ["/places", "/unhindered/**"],
            everything,
        )
        scenes, details = [], []
        for one in shown:
            name, points = one.scenario.name, send_scenario(stream, one)
            parts = ("obstacle", "demonstrated", BARE.name, "hands")
            contents = [f"{entity(name, part)}/**" for part in parts]
            heading = f"{name}: {len(one.demonstrations)} demonstrations{origin}"
            scenes.append(scene_view(heading, contents, points))
            curves = rrb.Vertical(*_send_signals(stream, one, baseline))
            detail = scene_view(heading, contents, points)
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
    words = {"distance": "distance to the obstacle's surface (mm)"}
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
        f"{len(shown)} scenarios are chosen here. {len(unhindered)} reaches without obstacle are in the tab "
        "*all settings*, with the number of every setting. The reach without avoidance hits an obstacle (it "
        f"enters the virtual radius, as in the tables) in {sum(hit for _, hit in places)} settings. Dots on "
        "an obstacle are the cloud that models see; a point is the hand.\n\n"
        f"{legend(colours)}\n\nPlay the time line to see the hands move.\n"
    )
