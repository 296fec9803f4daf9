"""Recordings of demonstrated touches (II.4.1.1), and of the latent map beside the skin (figure II.3)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import rerun as rr

from dissertation.servoing.names import ESTIMATED, LATENT, TRUE, electrode_colours
from dissertation.servoing.recordings import servoing_scene as scene
from structlearn.core import quaternion
from structlearn.core.errors import InputError
from structlearn.readers.demonstration import Demonstration
from structlearn.tactile.electrodes import Skin
from structlearn.tactile.touch_dataset import TouchDataset
from structlearn.viewer import items, views
from structlearn.viewer.items import Item, entity, series
from structlearn.viewer.recording import Recording

EVERY = 10  # samples per point of a path
POINT_MM, SAMPLE_OPACITY = 0.12, 0.5  # radius and opacity of a sample on a flat picture
PATH = "#ffffff"  # colour of paths over coloured samples

PLOTS = {
    "along": "along the finger (mm): blue map, orange skin",
    "across": "across the finger (mm): blue map, orange skin",
    "latent": "third latent number",
    "pressure": "pressure (counts)",
}


@dataclass(frozen=True)
class ShownTouch:
    """A demonstration of T samples, N of them in contact."""

    demonstration: Demonstration  # on the sample clock
    motion: scene.FingerMotion  # counts minus offset
    rows: np.ndarray  # (N,) indices of the samples in contact
    contact: np.ndarray  # (N,) contact number, ascending
    contact_point: np.ndarray  # (N, 3) m, estimated, finger frame
    pressure: np.ndarray  # (N,) counts
    latent: np.ndarray  # (N, 3) in the networks' units: two map coordinates, one for pressure
    truth: pd.DataFrame  # true contacts, see `simulation.touch_demonstrator.true_contacts`

    @property
    def name(self) -> str:
        """Name of the demonstration."""
        return self.demonstration.name

    @property
    def contacts(self) -> list[scene.Contact]:
        """Estimated and true contact over the whole demonstration."""
        point, touching = np.zeros((len(self.motion.time), 3)), np.zeros(len(self.motion.time), dtype=bool)
        point[self.rows], touching[self.rows] = self.contact_point, True
        time, load = (self.truth[name].to_numpy(float) for name in ("time_s", "load_n"))
        true = self.truth[["x_m", "y_m", "z_m"]].to_numpy(float)
        return [
            scene.Contact("estimated", ESTIMATED, self.motion.time, point, touching),
            scene.Contact("true", TRUE, time, true, load > 0),
        ]


def shown_touches(
    demonstrations: Sequence[Demonstration],
    dataset: TouchDataset,
    latent_map: pd.DataFrame,
    truth: pd.DataFrame,
    names: Sequence[str],
    air_s: float,
) -> list[ShownTouch]:
    """Select demonstrations by name, with their samples; `demonstrations` are numbered as in the dataset.

    `latent_map`: see `tactile.latent_comparison.latent_map`; `air_s`: time in the air at the start, which
    gives the offset. Raises InputError: there is no demonstration of such a name.
    """
    numbers = {one.name: number for number, one in enumerate(demonstrations)}
    if unknown := [name for name in names if name not in numbers]:
        raise InputError(
            f"inspect_servoing.demonstrations: there is no '{unknown[0]}', only {', '.join(sorted(numbers))}"
        )
    found = []
    for name in names:
        one, rows = demonstrations[numbers[name]], np.flatnonzero(dataset.trial == numbers[name])
        air = max(round(air_s / one.dt), 1)
        tactile = one.signal("tactile")
        signals = tactile - tactile[:air].mean(axis=0)
        found.append(
            ShownTouch(
                demonstration=one,
                motion=scene.FingerMotion(one.time, one.position, one.signal("orientation"), signals),
                rows=np.rint(dataset.time[rows].astype(float) / one.dt).astype(int),
                contact=dataset.contact[rows],
                contact_point=dataset.contact_point[rows].astype(float),
                pressure=dataset.pressure[rows].astype(float),
                latent=latent_map.iloc[rows][["x", "y", "z"]].to_numpy(float),
                truth=truth[truth["trial"] == name],
            )
        )
    return found


def demonstrations(shown: Sequence[ShownTouch], skin: Skin, handle_radius: float) -> Recording:
    """Demonstrations of touch, one tab each; `handle_radius` in m."""
    scale = scene.full_scale([one.motion.signals for one in shown])
    title, tabs = "Touch: demonstrations", []
    for one in shown:
        name, origin = one.name, views.origin_label([other.demonstration for other in shown])
        finger, drawn = scene.touch(entity(name), skin, one.motion, one.contacts, scale)
        handle = scene.handle(entity(name, "handle"), *handle_place(one, skin, handle_radius), handle_radius)
        middle = np.median(one.motion.position[one.rows], axis=0)
        view = scene.close_view(f"finger on the handle{origin}", [*finger, handle], middle, _finger_x(one))
        flat = scene.map_view("skin, flat (mm)", drawn, skin)
        plots = views.plots(_curves(one, skin))
        colours = {
            f"counts fell, full colour at {scale:.0f} counts: pressed": "orange electrodes",
            "counts rose: the fluid bulges": "light blue electrodes",
            "estimated contact": "orange point",
        }
        if len(one.truth):
            colours["true contact"] = "green point"
        notes = (
            f"# {title}\n\n{name}{origin}: {len(np.unique(one.contact))} contacts, from touching to "
            f"lifting.\n\n{views.legend(colours)}\n\nThe pose of the handle is not recorded; it is drawn "
            "where the contacts put it. In flat pictures the tip of the finger is to the right.\n"
        )
        tabs.append(scene.tab(name, [views.column(view, flat, shares=[3, 2])], plots, notes))
    return Recording(title, views.tabs(*tabs))


def handle_place(one: ShownTouch, skin: Skin, handle_radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Centre (3,) m and horizontal unit axis (3,) of the handle in the base frame, inferred from contacts.

    Assumes that the finger's x axis lies across the handle, whose centre line is behind the contacts.
    """
    behind = one.contact_point + handle_radius * skin.normal(one.contact_point)
    turned = quaternion.rotate(one.motion.orientation[one.rows], behind)
    ahead = _finger_x(one)
    axis = np.array([-ahead[1], ahead[0], 0.0])
    return np.median(one.motion.position[one.rows] + turned, axis=0), axis / np.linalg.norm(axis)


def _finger_x(one: ShownTouch) -> np.ndarray:
    """Mean direction (3,) of the finger's x axis in the base frame."""
    return quaternion.rotate(one.motion.orientation, np.array([1.0, 0.0, 0.0])).mean(axis=0)


def _curves(one: ShownTouch, skin: Skin) -> dict[str, list[Item]]:
    """Pressure, load and surface coordinates of the contact; lines are interrupted where contact is."""
    pressure = -one.motion.signals.mean(axis=1)
    raw = series(entity(one.name, "pressure", "raw"), one.motion.time, pressure, "pressure", ESTIMATED)
    curves = {"pressure: mean fall of the counts": [raw]}
    if len(one.truth):
        time, load = (one.truth[name].to_numpy(float) for name in ("time_s", "load_n"))
        curves["true load (N)"] = [series(entity(one.name, "load", "true"), time, load, "load", TRUE)]
    for axis in ("along", "across"):
        its = curves.setdefault(f"contact {axis} the finger (mm)", [])
        for contact in one.contacts:
            places, coordinates = np.full(len(contact.time), np.nan), contact.point[contact.touching]
            places[contact.touching] = 1e3 * skin.coordinates(coordinates)[axis == "across"]
            path = entity(one.name, axis, contact.name)
            its.append(series(path, contact.time, places, contact.name, contact.colour))
    return curves


def latent_maps(
    shown: Sequence[ShownTouch],
    flat_skin: scene.FlatSkin,
    latent_map: pd.DataFrame,
    contact_points: np.ndarray,
    count: int,
) -> Recording:
    """The latent map with contact paths on it, one tab for each demonstration.

    `latent_map` and `contact_points` (N, 3) m belong to the same samples, of which `count` are drawn.
    """
    title, origin = "Touch: latent map", views.origin_label([one.demonstration for one in shown])
    places = {"map": flat_skin.latent(latent_map[["x", "y"]].to_numpy(float))}
    places["skin"] = flat_skin.places(contact_points.astype(float))
    electrode = latent_map["electrode"].to_numpy()
    kept = np.linspace(0, len(electrode) - 1, min(count, len(electrode))).astype(int)
    every = electrode_colours(len(flat_skin.skin.electrodes))
    colours = items.rgba(every, SAMPLE_OPACITY)[electrode[kept] - 1]
    found, samples = np.unique(electrode), dict[str, list[Item]]()
    labels: dict[str, Any] = {"labels": [str(number) for number in found], "radii": 0.0, "show_labels": True}
    for part, drawn in places.items():
        middle = [np.median(drawn[electrode == number], axis=0) for number in found]
        names = Item(entity("electrodes", part), [rr.Points2D(middle, **labels)])
        samples[part] = [items.dots(entity("samples", part), drawn[kept], colours, POINT_MM), names]
    tabs = []
    for one in shown:
        curves: dict[str, list[Item]] = {part: [] for part in (*places, *PLOTS)}
        for part, item in _contact_paths(one, flat_skin):
            curves[part].append(item)
        maps = [
            scene.map_view(heading, [*samples[part], *curves[part]], flat_skin.skin)
            for part, heading in (("map", f"latent map (mm){origin}"), ("skin", "contact on the skin (mm)"))
        ]
        plots = [views.plot(heading, curves[part], legend=False) for part, heading in PLOTS.items()]
        notes = (
            f"# {title}\n\nAll samples of touch by the electrode whose reading fell most{origin}; numbers "
            "are of electrodes. Above, where the encoder of the first seed puts them; the map is turned and "
            f"mirrored onto the skin. Below, where the skin is touched, by estimate.\n\nPaths: {one.name}, a "
            "path for each contact.\n"
        )
        tabs.append(scene.tab(one.name, [views.column(*maps)], plots, notes))
    return Recording(title, views.tabs(*tabs))


def _contact_paths(one: ShownTouch, flat_skin: scene.FlatSkin) -> Iterator[tuple[str, Item]]:
    """A path for each contact, and its pressure in the latent state and in counts, by map or plot."""
    for number in np.unique(one.contact):
        rows = np.flatnonzero(one.contact == number)[::EVERY]
        time = one.motion.time[one.rows[rows]]
        curves = [("latent", "latent", one.latent[rows, 2], LATENT)]
        curves.append(("pressure", "counts", one.pressure[rows], ESTIMATED))
        for part, drawn, colour in (
            ("map", flat_skin.latent(one.latent[rows]), LATENT),
            ("skin", flat_skin.places(one.contact_point[rows]), ESTIMATED),
        ):
            path = scene.map_path(entity(one.name, part, str(number)), time, drawn, PATH)
            yield from ((part, item) for item in path)
            curves += [("along", part, drawn[:, 0], colour), ("across", part, -drawn[:, 1], colour)]
        for group, label, values, colour in curves:
            yield group, series(entity(one.name, group, label, str(number)), time, values, label, colour)
