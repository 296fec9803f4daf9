"""Recording of the latent map beside the skin, and of demonstrations as paths on both (figure II.3)."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb

from structlearn.tactile.electrodes import Skin
from structlearn.testbeds.servoing.names import ESTIMATED, LATENT, electrode_colours
from structlearn.testbeds.servoing.recordings import servoing_scene as scene
from structlearn.testbeds.servoing.recordings.shown_touches import ShownTouch
from structlearn.viewer.notes import send_notes
from structlearn.viewer.rrd import entity, layout, origin_label, recording, rgba, send_curve

TITLE = "Touch: latent map"

EVERY = 10
"""Every how many samples one is on a path."""

POINT_MM, SAMPLE_OPACITY = 0.12, 0.5
"""Radius of a sample on a flat picture, and how much it covers."""

PATH = "#ffffff"
"""Colour of paths among coloured samples."""

PLOTS = {
    "along": "along the finger (mm): blue map, red skin",
    "across": "across the finger (mm): blue map, red skin",
    "latent": "third latent number",
    "pressure": "pressure (counts)",
}


def write_latent_maps(
    path: str | Path,
    shown: Sequence[ShownTouch],
    flat_skin: scene.FlatSkin,
    latent_map: pd.DataFrame,
    contact_points: np.ndarray,
    count: int,
) -> None:
    """Write the latent map and paths on it as a recording, a tab for each demonstration.

    `latent_map`: see `tactile.latent_evaluation.latent_map`; `contact_points` (N, 3) m of the same samples;
    `count`: of samples that are drawn.
    """
    origin = origin_label([one.demonstration for one in shown])
    places = {"map": flat_skin.latent(latent_map[["x", "y"]].to_numpy(float))}
    places["skin"] = flat_skin.places(contact_points.astype(float))
    electrode = latent_map["electrode"].to_numpy()
    kept = np.linspace(0, len(electrode) - 1, min(count, len(electrode))).astype(int)
    every = electrode_colours(len(flat_skin.skin.electrodes))
    colours = rgba(every, SAMPLE_OPACITY)[electrode[kept] - 1]
    found = np.unique(electrode)
    labels: dict[str, Any] = {"labels": [str(number) for number in found], "radii": 0.0, "show_labels": True}
    with recording(path, TITLE) as stream:
        tabs = [_tab(one, flat_skin.skin, origin) for one in shown]
        stream.send_blueprint(layout(rrb.Tabs(*tabs, active_tab=0)))
        for name, drawn in places.items():
            samples = rr.Points2D(drawn[kept], colors=colours, radii=POINT_MM)
            stream.log(entity("samples", name), samples, static=True)
            middle = [np.median(drawn[electrode == number], axis=0) for number in found]
            stream.log(entity("electrodes", name), rr.Points2D(middle, **labels), static=True)
        for one in shown:
            _send_paths(stream, one, flat_skin)
            send_notes(stream, _notes(origin, one), one.name)


def _send_paths(stream: rr.RecordingStream, one: ShownTouch, flat_skin: scene.FlatSkin) -> None:
    """A path for each contact, and the pressure in the latent state and of the counts."""
    for number in np.unique(one.contact):
        rows = np.flatnonzero(one.contact == number)[::EVERY]
        time = one.time[rows]
        places = {
            "map": flat_skin.latent(one.latent[rows]),
            "skin": flat_skin.places(one.contact_point[rows]),
        }
        curves = [("latent", "latent", one.latent[rows, 2], LATENT)]
        curves.append(("pressure", "counts", one.pressure[rows], ESTIMATED))
        for (part, drawn), colour in zip(places.items(), (LATENT, ESTIMATED), strict=True):
            scene.send_map_path(stream, entity(one.name, part, str(number)), time, drawn, PATH)
            curves += [("along", part, drawn[:, 0], colour), ("across", part, -drawn[:, 1], colour)]
        for group, label, values, colour in curves:
            send_curve(stream, entity(one.name, group, label, str(number)), time, values, label, colour)


def _tab(one: ShownTouch, skin: Skin, origin: str) -> rrb.Horizontal:
    maps = [
        scene.map_view(
            heading,
            [entity("samples", part), entity("electrodes", part), f"{entity(one.name, part)}/**"],
            skin,
        )
        for part, heading in (("map", f"latent map (mm){origin}"), ("skin", "contact on the skin (mm)"))
    ]
    return scene.tab(one.name, [rrb.Vertical(*maps)], PLOTS)


def _notes(origin: str, one: ShownTouch) -> str:
    return (
        f"# {TITLE}\n\nAll samples of touch by the electrode whose reading fell most{origin}; numbers are "
        "of electrodes. Above, where the encoder of the first seed puts them; the map is turned and "
        f"mirrored onto the skin. Below, where the skin is touched, by estimate.\n\nPaths: {one.name}, a "
        "path for each contact.\n"
    )
