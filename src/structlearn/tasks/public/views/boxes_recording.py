"""Recording of reaches past boxes: a person's hand and those of models in the scenes of that person."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb

from structlearn.palette import BLACK, GREY, LIGHT_GREY
from structlearn.tasks.public.public_names import BOX_WAYS
from structlearn.viewer.notes import legend, notes_view, send_notes
from structlearn.viewer.rrd import (
    entity,
    eye_view,
    layout,
    recording,
    rgba,
    send_moving_frame,
    solid_boxes,
    time_column,
)

TITLE = "Reaches past boxes: a person and models"

SHOWN = ("recorded", "none", "text", "scene", "planned")
"""Ways that are drawn: all six hide each other."""

COLOURS = {way: LIGHT_GREY if BOX_WAYS[way].colour == BLACK else BOX_WAYS[way].colour for way in SHOWN}
"""Black is the ground of the viewer."""

EYE_M = np.array([0.0, -0.55, 0.75])
"""From the middle of a scene to the eye: behind the person, from above, so that gaps are seen."""


def write_box_reaches(path: str | Path, tables: Mapping[str, pd.DataFrame]) -> None:
    """Write the reaches that the page shows, a tab for each scene, as a recording."""
    with recording(path, TITLE) as stream:
        send_notes(stream, _note())
        tabs = []
        for name, paths in tables["paths"].groupby("reach", sort=False):
            shapes = tables["shapes"].query("reach == @name")
            middle = _send_shapes(stream, name, shapes)
            for way in SHOWN:
                _send_way(stream, entity(name, BOX_WAYS[way].name), paths[paths["way"] == way], COLOURS[way])
            view = eye_view(name, [f"{entity(name)}/**"], middle, EYE_M)
            tabs.append(rrb.Horizontal(view, notes_view(), column_shares=[4, 1], name=name))
        stream.send_blueprint(layout(rrb.Tabs(*tabs, active_tab=0)))


def _note() -> str:
    colours = legend({BOX_WAYS[way].name: COLOURS[way] for way in SHOWN if way != "none"})
    return (
        "Boxes and the person's hand were recorded. The other hands are unrolled in this scene by models "
        "that learned from other people, in the time that the person took. The boxes are dark, the walls of "
        f"the shelf pale.\n\n{colours}\n- thin white: {BOX_WAYS['none'].name}"
    )


def _send_shapes(stream: rr.RecordingStream, name: str, shapes: pd.DataFrame) -> np.ndarray:
    """Log boxes and walls; returns the middle of the boxes (3,) m."""
    for kind, colour, opacity in ((True, GREY, 1.0), (False, LIGHT_GREY, 0.25)):
        its = shapes[shapes["box"] == kind]
        sizes, centres = its[["width_m", "depth_m", "height_m"]], its[["x_m", "y_m", "z_m"]]
        solid = solid_boxes(sizes.to_numpy(), centres.to_numpy(), [colour], opacity)
        stream.log(entity(name, "boxes" if kind else "walls"), solid, static=True)
    return shapes.loc[shapes["box"], ["x_m", "y_m", "z_m"]].to_numpy().mean(axis=0)


def _send_way(stream: rr.RecordingStream, path: str, its: pd.DataFrame, colour: str) -> None:
    """Log a hand over time, and its whole path as a line."""
    points = its[["x_m", "y_m", "z_m"]].to_numpy()
    width = 1.0 if colour == LIGHT_GREY else 2.0
    line = rr.LineStrips3D([points], colors=rgba([colour]), radii=-width)
    stream.log(f"{path}/path", line, static=True)
    send_moving_frame(
        stream, f"{path}/hand", [time_column(its["time_s"].to_numpy())], points, None, colour, 0.0
    )
