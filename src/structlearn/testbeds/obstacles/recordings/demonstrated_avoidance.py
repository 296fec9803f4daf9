"""Recording of demonstrations past obstacles: how people pass them, and the baseline does not (IV.8.3)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.avoidance.avoidance_dataset import to_local
from structlearn.primitives.position import PositionPrimitive
from structlearn.recordings.demonstration import Demonstration
from structlearn.testbeds.obstacles.recordings.avoidance_scene import (
    BASELINE,
    FREE,
    HIT,
    PALE,
    PERSON,
    scenario_points,
    send_hand,
    send_paths,
    send_places,
    send_scenario,
)
from structlearn.testbeds.obstacles.recordings.shown_reaches import ShownScenario, of_baseline
from structlearn.testbeds.obstacles.world.scenarios import Scenario
from structlearn.viewer.notes import colour_words, notes_view, send_notes
from structlearn.viewer.rrd import entity, layout, origin_label, plot, recording, scene_view, send_curve

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
    settings, the others one scenario each with its signals.

    Args:
        path: of the .rrd file.
        shown: the chosen scenarios.
        unhindered: demonstrations without obstacle.
        baseline: the primitive of these.
        places: a scenario of each setting, and whether the baseline hits an obstacle there.
        title: heading, different for every recording.
    """
    origin = origin_label([*unhindered, *(one for group in shown for one in group.demonstrations)])
    with recording(path, title) as stream:
        stream.send_blueprint(_blueprint(shown, unhindered, places, title, origin))
        send_notes(stream, _notes(title, origin, shown, unhindered, places))
        colours = [HIT if hit else FREE for _, hit in places]
        send_places(stream, "places", [place for place, _ in places], colours)
        send_paths(stream, entity("unhindered", "paths"), [one.position for one in unhindered], PERSON, PALE)
        send_paths(
            stream, entity("unhindered", "baseline"), [baseline.unroll(0.01).position], BASELINE, width=2.0
        )
        for one in shown:
            send_scenario(stream, one, PERSON)
            for person in one.demonstrations:
                _send_person(stream, one, person, baseline)
            _send_baseline_curves(stream, one, baseline)


def _send_person(
    stream: rr.RecordingStream, one: ShownScenario, person: Demonstration, baseline: PositionPrimitive
) -> None:
    name = one.scenario.name
    send_hand(stream, entity(name, "hands", person.name), person.time, person.position, PERSON)
    _send_curves(stream, one, person.name, person.time, person.position, baseline, PERSON)


def _send_baseline_curves(
    stream: rr.RecordingStream, one: ShownScenario, baseline: PositionPrimitive
) -> None:
    reach = of_baseline(one.reaches)
    _send_curves(stream, one, "baseline", reach.time, reach.position, baseline, BASELINE)


def _send_curves(
    stream: rr.RecordingStream,
    one: ShownScenario,
    label: str,
    time: np.ndarray,
    position: np.ndarray,
    baseline: PositionPrimitive,
    colour: str,
) -> None:
    name, local = one.scenario.name, to_local(position, baseline)
    distance = 1e3 * one.scenario.obstacle.signed_distance(position)
    send_curve(stream, entity(name, "distance", label), time, distance, label, colour)
    for axis, side in SIDES.items():
        send_curve(stream, entity(name, side, label), time, 1e3 * local[:, axis], label, colour)


def _blueprint(
    shown: Sequence[ShownScenario],
    unhindered: Sequence[Demonstration],
    places: Sequence[tuple[Scenario, bool]],
    title: str,
    origin: str,
) -> rrb.Blueprint:
    scenes = [_scene(one, origin) for one in shown]
    first = rrb.Horizontal(
        rrb.Grid(*scenes, grid_columns=3), notes_view(), column_shares=[4, 1], name="chosen scenarios"
    )
    stands = np.array([place.obstacle.centre for place, _ in places])
    everything = np.concatenate([stands, *(one.position for one in unhindered)])
    heading = f"baseline and all {len(places)} settings{origin}"
    second = rrb.Horizontal(
        scene_view(heading, ["/places", "/unhindered/**"], everything),
        notes_view(),
        column_shares=[4, 1],
        name="all settings",
    )
    details = [_detail(one, origin) for one in shown]
    return layout(rrb.Tabs(first, second, *details, active_tab=0))


def _scene(one: ShownScenario, origin: str) -> rrb.Spatial3DView:
    name = one.scenario.name
    parts = ("obstacle", "demonstrated", "baseline", "hands")
    contents = [f"{entity(name, part)}/**" for part in parts]
    return scene_view(
        f"{name}: {len(one.demonstrations)} demonstrations{origin}", contents, scenario_points(one)
    )


def _detail(one: ShownScenario, origin: str) -> rrb.Horizontal:
    name = one.scenario.name
    plots = [
        plot("distance to the obstacle's surface (mm)", [f"{entity(name, 'distance')}/**"], False),
        *(
            plot(f"hand {side} the straight line (mm)", [f"{entity(name, side)}/**"], False)
            for side in SIDES.values()
        ),
    ]
    scene = _scene(one, origin)
    return rrb.Horizontal(scene, rrb.Vertical(*plots), column_shares=[4, 3], name=name)


def _notes(
    title: str,
    origin: str,
    shown: Sequence[ShownScenario],
    unhindered: Sequence[Demonstration],
    places: Sequence[tuple[Scenario, bool]],
) -> str:
    colours = {
        "light blue": "what a person did; a point is the hand",
        "white": "the baseline, a movement primitive learned from the reaches without obstacle",
        "vermilion": "an obstacle that the baseline hits: it enters the virtual radius, as in the tables",
        "grey": "an obstacle that it does not hit",
    }
    return (
        f"# {title}\n\nReaches past obstacles{origin}: {len(places)} settings, each with several shapes. "
        f"{len(shown)} scenarios are chosen here. {len(unhindered)} reaches without obstacle are in the tab "
        "*all settings*, with the number of every setting. The baseline hits an obstacle in "
        f"{sum(hit for _, hit in places)} settings. Dots on an obstacle are the cloud that models see.\n\n"
        f"{colour_words(colours)}\n\nPlay the time line to see the hands move.\n"
    )
