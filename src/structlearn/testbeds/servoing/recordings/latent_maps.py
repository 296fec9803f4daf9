"""Recording of the latent map beside the skin, and of demonstrations as paths on both (figure II.3)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import rerun as rr
import rerun.blueprint as rrb

from structlearn.tactile.electrodes import Skin
from structlearn.tactile.flat_maps import MapLaying, map_laying
from structlearn.testbeds.servoing.recordings.servoing_scene import (
    ESTIMATED,
    TARGET,
    electrode_colours,
    flat,
    map_view,
    send_map_path,
)
from structlearn.testbeds.servoing.recordings.shown_touches import ShownTouch
from structlearn.viewer.notes import notes_view, send_notes
from structlearn.viewer.rrd import entity, layout, origin_label, plot, recording, send_curve

EVERY = 10
"""Every how many samples one is on a path."""

POINT_MM = 0.12
"""Radius of a sample on a flat picture."""

MAP_COLOUR, SKIN_COLOUR = TARGET, ESTIMATED
"""Of curves of the latent map and of the skin."""

PATH = "#ffffff"
"""Colour of paths among coloured samples."""

SAMPLE_OPACITY = 0.5


def write_latent_maps(
    path: str | Path,
    shown: Sequence[ShownTouch],
    latent_map: pd.DataFrame,
    contact_points: np.ndarray,
    skin: Skin,
    map_unit: float,
    count: int,
    title: str,
) -> None:
    """Write the latent map and paths on it as a recording, a tab for each demonstration.

    Args:
        path: of the .rrd file.
        shown: demonstrations whose paths are shown.
        latent_map: see `tactile.latent_evaluation.latent_map`.
        contact_points: (N, 3) m of the same samples.
        skin: of the finger.
        map_unit: m on the skin per unit of the map.
        count: of samples that are drawn.
        title: heading, different for every recording.
    """
    origin = origin_label([one.demonstration for one in shown])
    places = flat(skin, contact_points.astype(float))
    points = 1e3 * map_unit * latent_map[["x", "y"]].to_numpy(float)
    laying = skin_laying(latent_map, contact_points, skin, map_unit)
    electrode = latent_map["electrode"].to_numpy()
    kept = np.linspace(0, len(points) - 1, min(count, len(points))).astype(int)
    colours = electrode_colours(len(skin.electrodes), SAMPLE_OPACITY)[electrode[kept] - 1]
    with recording(path, title) as stream:
        stream.send_blueprint(layout(rrb.Tabs(*[_tab(one, skin, origin) for one in shown], active_tab=0)))
        for name, drawn in (("map", laying(points)), ("skin", places)):
            samples = rr.Points2D(drawn[kept], colors=colours, radii=POINT_MM)
            stream.log(entity("samples", name), samples, static=True)
            _send_numbers(stream, entity("electrodes", name), drawn, electrode)
        for one in shown:
            _send_paths(stream, one, skin, map_unit, laying)
            send_notes(stream, _notes(title, origin, one), one.name)


def skin_laying(
    latent_map: pd.DataFrame, contact_points: np.ndarray, skin: Skin, map_unit: float
) -> MapLaying:
    """How the latent map, in mm, is laid onto the flat skin; arguments as of `write_latent_maps`."""
    points = 1e3 * map_unit * latent_map[["x", "y"]].to_numpy(float)
    return map_laying(points, flat(skin, contact_points.astype(float)))


def _send_numbers(stream: rr.RecordingStream, path: str, drawn: np.ndarray, electrode: np.ndarray) -> None:
    """Numbers of electrodes in the middle of their samples."""
    found = np.unique(electrode)
    middle = [np.median(drawn[electrode == number], axis=0) for number in found]
    numbers = rr.Points2D(middle, labels=[str(number) for number in found], radii=0.0, show_labels=True)
    stream.log(path, numbers, static=True)


def _send_paths(
    stream: rr.RecordingStream, one: ShownTouch, skin: Skin, map_unit: float, laying: MapLaying
) -> None:
    """A path for each contact, and the pressure in the latent state and of the counts."""
    for number in np.unique(one.contact):
        rows = np.flatnonzero(one.contact == number)[::EVERY]
        time = one.time[rows]
        on_map = laying(1e3 * map_unit * one.latent[rows, :2])
        on_skin = flat(skin, one.contact_point[rows])
        send_map_path(stream, entity(one.name, "map", str(number)), time, on_map, PATH)
        send_map_path(stream, entity(one.name, "skin", str(number)), time, on_skin, PATH)
        curves = (
            ("latent", "latent", one.latent[rows, 2], MAP_COLOUR),
            ("pressure", "counts", one.pressure[rows], SKIN_COLOUR),
            ("along", "latent map", on_map[:, 0], MAP_COLOUR),
            ("along", "skin", on_skin[:, 0], SKIN_COLOUR),
            ("across", "latent map", -on_map[:, 1], MAP_COLOUR),
            ("across", "skin", -on_skin[:, 1], SKIN_COLOUR),
        )
        for group, label, values, colour in curves:
            send_curve(stream, entity(one.name, group, label, str(number)), time, values, label, colour)


def _tab(one: ShownTouch, skin: Skin, origin: str) -> rrb.Horizontal:
    maps = [
        map_view(
            heading,
            [entity("samples", part), entity("electrodes", part), f"{entity(one.name, part)}/**"],
            skin,
        )
        for part, heading in (("map", f"latent map (mm){origin}"), ("skin", "contact on the skin (mm)"))
    ]
    headings = {
        "along": "along the finger (mm): blue map, red skin",
        "across": "across the finger (mm): blue map, red skin",
        "latent": "third latent number",
        "pressure": "pressure (counts)",
    }
    plots = [
        plot(heading, [f"{entity(one.name, group)}/**"], legend=False) for group, heading in headings.items()
    ]
    return rrb.Horizontal(
        rrb.Vertical(*maps),
        rrb.Vertical(*plots),
        notes_view(one.name),
        column_shares=[4, 4, 2],
        name=one.name,
    )


def _notes(title: str, origin: str, one: ShownTouch) -> str:
    return (
        f"# {title}\n\nAll samples of touch by the electrode whose reading fell most{origin}; numbers are "
        "of electrodes. Above, where the encoder of the first seed puts them; the map is turned and "
        f"mirrored onto the skin. Below, where the skin is touched, by estimate.\n\nPaths: {one.name}, a "
        "path for each contact.\n"
    )
