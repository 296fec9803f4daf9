"""Rerun views of touch: presses and their map, servoing, forces; slides and deviations."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from structlearn.palette import BLUE, GOOD, GREY, LIGHT_GREY, place_colours
from structlearn.primitives.primitive_files import read_vector_primitive
from structlearn.primitives.vector import VectorPrimitive, deviation, without_offset
from structlearn.readers.demonstration import Demonstration, read_streams
from structlearn.tasks.task_files import TaskFiles
from structlearn.tasks.touch.parameters import SurfaceParameters, TouchParameters
from structlearn.tasks.touch.surface_traces import slides_on_clock, trial_groups
from structlearn.tasks.touch.touch_names import SLIDE_GROUPS, material_of, of_pair, shown_map
from structlearn.viewer import items, views
from structlearn.viewer.demonstrations import demonstrations
from structlearn.viewer.items import Item, entity
from structlearn.viewer.recording import Recording
from structlearn.viewer.views import Panel

PRESS_MM, PROBE_MM, MARGIN_MM = 0.3, 0.7, 2.5  # radii of dots; margin around the plate
TRIALS = 12  # paths shown one after the other, a step per second
IN_FRONT = 30.0  # drawing order

NOTE = f"""A probe pressed a skin at known positions; everything is recorded. A press has the same colour on
the plate and in the latent map, which was learned from another run and is only rotated and shifted onto it.

Over time, on the plate: servoing on the table of recorded presses, from one press to the readings of another,
a step a second, one path after the other. Below: the force on a scale at one place, and what is read off the
skin by another run.

{views.legend({"probe": LIGHT_GREY, "its target": GREY, "scale": GOOD, "estimated from the skin": BLUE})}"""


NOTHING = "The task has no touches."


def recordings(files: TaskFiles) -> dict[str, Recording]:
    """The recording of a skin, or of slides."""
    parameters = files.entry(TouchParameters)
    if parameters.surfaces is None:
        return {"skin": skin(files.tables("touch"), parameters.tuned_on)}
    trials = slides_on_clock(read_streams(files.recorded / "streams.parquet"), parameters.surfaces)
    expected = read_vector_primitive(files.learned / "expected.safetensors")
    return {"slides": slides(trials, expected, parameters.surfaces)}


def skin(tables: Mapping[str, pd.DataFrame], tuned_on: tuple[str, ...]) -> Recording:
    """A skin: its map if there are several runs, and forces if there is a scale."""
    shown, notes = [], views.notes(NOTE)
    if "maps" in tables:
        shown.append(_maps(shown_map(tables["maps"], tuned_on), tables.get("paths")))
    if "traces" in tables:
        its = of_pair(tables["traces"], tables["traces"])
        columns = {"force_n": ("scale", GOOD), "read_n": ("estimated from the skin", BLUE)}
        forces = [
            items.series(entity("force", look[0]), its["time_s"].to_numpy(), its[column].to_numpy(), *look)
            for column, look in columns.items()
        ]
        shown.append(views.plot("force (N)", forces))
    left = views.column(*shown, shares=[3, 1][: len(shown)]) if shown else notes
    return Recording("A skin and its map", views.row(left, notes, shares=[4, 1]))


def _maps(maps: pd.DataFrame, paths: pd.DataFrame | None) -> Panel:
    """Presses on the plate and in the map, in mm from the plate's middle."""
    plate = maps[["x_m", "y_m"]].to_numpy()
    middle, colours = 0.5 * (plate.min(axis=0) + plate.max(axis=0)), place_colours(plate)

    def drawn(points: np.ndarray) -> np.ndarray:
        return 1e3 * (points - middle) * [1.0, -1.0]  # the viewer's y is downwards

    def presses(name: str, points: np.ndarray) -> Item:
        return items.dots(entity(name, "presses"), drawn(points), colours, PRESS_MM)

    on_plate = [presses("plate", plate)]
    if paths is not None:
        shown = of_pair(paths, maps)
        shown = shown[shown["trial"] < TRIALS].sort_values(["trial", "step"], kind="stable")
        time = np.arange(len(shown), dtype=float)
        for name, start, colour in (("probe", "", LIGHT_GREY), ("target", "target_", GREY)):
            places = drawn(shown[[f"{start}x_m", f"{start}y_m"]].to_numpy())
            point = (entity("plate", name), time, places, colour, PROBE_MM)
            on_plate.append(items.moving_point(*point, draw_order=IN_FRONT))
    half = 0.5e3 * np.ptp(plate, axis=0).max() + MARGIN_MM
    ends = [-half, half]
    on_map = [presses("map", maps[["map_x_m", "map_y_m"]].to_numpy())]
    return views.row(
        views.flat("the skin (mm): where it was pressed", on_plate, ends, ends),
        views.flat("its map, learned from another run (mm)", on_map, ends, ends),
    )


def slides(
    trials: Sequence[Demonstration], expected: VectorPrimitive, parameters: SurfaceParameters
) -> Recording:
    """Slides, with the electrodes' deviations from the expected traces."""
    groups = trial_groups([trial.name for trial in trials], parameters)
    materials = dict.fromkeys(material_of(trial.name) for trial in trials)
    learned = next(material_of(name) for name, group in groups.items() if group == "learned")
    first = ("left out", "other material", "learned")  # the first trials have a tab
    order = sorted(trials, key=lambda trial: first.index(groups[trial.name]))
    deviating = [
        replace(trial, tactile=deviation(expected, without_offset(trial.signal("tactile")), trial.dt))
        for trial in order
    ]
    note = (
        f"A robot slides a tactile finger over {' and '.join(materials)}. Tabs of single trials show how far "
        f"each electrode deviates from the traces expected of {learned}:\n\n"
        f"{views.legend(dict(SLIDE_GROUPS.values()))}"
    )
    colours = [SLIDE_GROUPS[groups[trial.name]].colour for trial in order]
    title = "Slides: deviation from the expected traces"
    return demonstrations(deviating, None, title, note, colours=colours)
