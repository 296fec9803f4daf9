"""Recording of what models do in scenarios that they learned from, beside demonstrations (IV.8.5, 8.6)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.avoidance.learned_models import ALL, SETTING
from structlearn.palette import GREEN, GREY, ORANGE, SKY
from structlearn.testbeds.obstacles.recordings.avoidance_scene import (
    LONGEST_ARROW_M,
    scenario_points,
    send_arrows,
    send_hand,
    send_paths,
    send_scenario,
)
from structlearn.testbeds.obstacles.recordings.shown_reaches import MODEL_NAMES, ShownScenario, of_model
from structlearn.viewer.notes import colour_words, notes_view, send_notes
from structlearn.viewer.rrd import entity, layout, origin_label, plot, recording, scene_view, send_curve

DIRECTIONS = {1: "to the left", 2: "upwards"}
"""Of coupling terms, by axis of the local frame; the one along the reach is always 0."""

SOURCE_COLOURS = {SETTING: SKY, ALL: GREEN}
"""Of reaches by what their model learned from; a shape is `SHAPE_COLOUR`."""

SHAPE_COLOUR = ORANGE

DIM = "#555c64"
"""Colour of demonstrated coupling terms behind those of models."""

ROOM = 1.5
"""Range of plots of coupling terms over that of the demonstrated ones: some go far beyond for an instant."""


def write_trained_avoidance(path: str | Path, shown: Sequence[ShownScenario], title: str) -> None:
    """Write what the models do in scenarios that they learned from as a recording.

    Each scenario has a tab with a column per kind of model: paths with coupling terms beside the
    demonstrations, the distance to the obstacle, and coupling terms over time beside what was demonstrated.

    Args:
        path: of the .rrd file.
        shown: the chosen scenarios.
        title: heading, different for every recording.
    """
    origin = origin_label([one for group in shown for one in group.demonstrations])
    with recording(path, title) as stream:
        tabs = [_tab(one, origin) for one in shown]
        stream.send_blueprint(layout(rrb.Tabs(*tabs, active_tab=0)))
        for one in shown:
            send_scenario(stream, one, GREY)
            _send_targets(stream, one)
            for model in _models(one):
                _send_model(stream, one, model)
            send_notes(stream, _notes(title, origin, one), one.scenario.name)


def _send_targets(stream: rr.RecordingStream, one: ShownScenario) -> None:
    """Coupling terms that the demonstrations teach; every column of plots shows them."""
    for number, rows in one.targets.groupby("demonstration"):
        for axis, direction in DIRECTIONS.items():
            path = entity(one.scenario.name, "demonstrated terms", direction, str(number))
            values = rows[f"target_{'xyz'[axis]}"].to_numpy(float)
            send_curve(stream, path, rows["time_s"].to_numpy(float), values, "demonstrated", DIM)


def _send_model(stream: rr.RecordingStream, one: ShownScenario, model: str) -> None:
    """Paths of a model and its signals, by what it learned from."""
    name = one.scenario.name
    for reach in of_model(one.reaches, model):
        colour = SOURCE_COLOURS.get(reach.learned_from, SHAPE_COLOUR)
        scene = entity(name, model, reach.label)
        send_paths(stream, f"{scene}/path", [reach.position], colour, width=1.5)
        send_arrows(stream, f"{scene}/coupling", reach, colour)
        send_hand(stream, f"{scene}/hand", reach.time, reach.position, colour)
        distance = 1e3 * one.scenario.obstacle.signed_distance(reach.position)
        curve = entity(name, "distance", model, reach.label)
        send_curve(stream, curve, reach.time, distance, reach.label, colour)
        for axis, direction in DIRECTIONS.items():
            curve = entity(name, "terms", model, direction, reach.label)
            send_curve(stream, curve, reach.time, reach.coupling[:, axis], reach.label, colour)


def _models(one: ShownScenario) -> list[str]:
    """Kinds of models that were unrolled, in the order of their names for headings."""
    return [model for model in MODEL_NAMES if of_model(one.reaches, model)]


def _tab(one: ShownScenario, origin: str) -> rrb.Horizontal:
    limits = _target_range(one)
    columns = [_model_column(one, model, origin, limits) for model in _models(one)]
    notes = notes_view(one.scenario.name)
    return rrb.Horizontal(*columns, notes, column_shares=[5] * len(columns) + [4], name=one.scenario.name)


def _model_column(one: ShownScenario, model: str, origin: str, limits: tuple[float, float]) -> rrb.Vertical:
    name = one.scenario.name
    scene = scene_view(
        f"{MODEL_NAMES[model]}{origin}",
        [f"{entity(name, part)}/**" for part in ("obstacle", "demonstrated", "baseline", model)],
        scenario_points(one),
    )
    distance = plot("distance to the obstacle's surface (mm)", [f"{entity(name, 'distance', model)}/**"])
    terms = []
    for direction in DIRECTIONS.values():
        kinds = (("demonstrated terms",), ("terms", model))
        contents = [f"{entity(name, *kind, direction)}/**" for kind in kinds]
        term = plot(f"coupling {direction} (grey: demonstrated)", contents, legend=False)
        term.properties["ScalarAxis"] = rrb.ScalarAxis(range=limits)
        terms.append(term)
    return rrb.Vertical(scene, distance, *terms, row_shares=[5, 2, 2, 2])


def _target_range(one: ShownScenario) -> tuple[float, float]:
    largest = float(np.abs(one.targets[["target_y", "target_z"]].to_numpy()).max())
    return (-ROOM * largest, ROOM * largest)


def _notes(title: str, origin: str, one: ShownScenario) -> str:
    colours = {
        "light blue": "the model of this scenario alone",
        "orange": f"the model of all {one.scenario.shape}s",
        "green": "the model of all shapes",
        "white": "the baseline, without coupling term",
        "grey": "what people did",
    }
    rows = [
        f"| {_closest(one, reach.position):.0f} | {1e3 * reach.goal_distance_m:.0f} | "
        f"{MODEL_NAMES.get(reach.model, '')} {reach.label} |"
        for reach in one.reaches
    ]
    people = min(_closest(one, person.position) for person in one.demonstrations)
    return (
        f"# {title}\n\nThe {one.scenario.shape} in setting {one.scenario.setting:02d}, and what models do "
        f"that learned from it{origin}. The reaches are unrolled, without a robot.\n\n"
        f"{colour_words(colours)}\n\n"
        f"Arrows are the coupling term along the path; none is drawn longer than {LONGEST_ARROW_M:g} m.\n\n"
        "| closest | goal off | model |\n|---|---|---|\n"
        + "\n".join([*rows, f"| {people:.0f} | | people |"])
        + "\n\nClosest: mm from the obstacle's surface, negative inside. Goal off: mm at the due time.\n"
    )


def _closest(one: ShownScenario, position: np.ndarray) -> float:
    return 1e3 * float(one.scenario.obstacle.signed_distance(position).min())
