"""Recording of demonstrations of touch: finger, handle, electrodes and contact points (II.4.1.1)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.ground import quaternion
from structlearn.tactile.electrodes import Skin
from structlearn.testbeds.servoing.names import ESTIMATED, TRUE
from structlearn.testbeds.servoing.recordings import servoing_scene as scene
from structlearn.testbeds.servoing.recordings.shown_touches import ShownTouch
from structlearn.viewer.notes import colour_words, send_notes
from structlearn.viewer.rrd import entity, layout, origin_label, recording, send_curve

TITLE = "Touch: demonstrations"


def write_touch_demonstrations(
    path: str | Path, shown: Sequence[ShownTouch], skin: Skin, handle_radius: float
) -> None:
    """Write demonstrations of touch as a recording, a tab each.

    `handle_radius`: m.
    """
    origin = origin_label([one.demonstration for one in shown])
    scale = scene.full_scale([one.motion.signals for one in shown])
    with recording(path, TITLE) as stream:
        stream.send_blueprint(layout(rrb.Tabs(*[_tab(one, skin, origin) for one in shown], active_tab=0)))
        for one in shown:
            scene.send_touch(stream, entity(one.name), skin, one.motion, one.contacts, scale)
            centre, axis = handle_place(one, skin, handle_radius)
            scene.send_handle(stream, entity(one.name, "handle"), centre, axis, handle_radius)
            _send_curves(stream, one, skin)
            send_notes(stream, _notes(origin, one, scale), one.name)


def handle_place(one: ShownTouch, skin: Skin, handle_radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Where the handle of a demonstration must have been, as its pose is not recorded.

    The finger's x axis lies across the handle; the middle of the handle is behind the contacts.
    `handle_radius`: m. Returns centre (3,) m and horizontal unit axis (3,), base frame.
    """
    behind = one.contact_point + handle_radius * skin.normal(one.contact_point)
    turned = quaternion.rotate(one.motion.orientation[one.rows], behind)
    ahead = _finger_x(one)
    axis = np.array([-ahead[1], ahead[0], 0.0])
    return np.median(one.motion.position[one.rows] + turned, axis=0), axis / np.linalg.norm(axis)


def _finger_x(one: ShownTouch) -> np.ndarray:
    """Mean direction (3,) of the finger's x axis in the base frame."""
    return quaternion.rotate(one.motion.orientation, np.array([1.0, 0.0, 0.0])).mean(axis=0)


def _send_curves(stream: rr.RecordingStream, one: ShownTouch, skin: Skin) -> None:
    """Pressure, load, and surface coordinates of the contact; lines end where it does."""
    pressure = -one.motion.signals.mean(axis=1)
    send_curve(stream, entity(one.name, "pressure", "raw"), one.motion.time, pressure, "pressure", ESTIMATED)
    if len(one.truth):
        time, load = (one.truth[name].to_numpy(float) for name in ("time_s", "load_n"))
        send_curve(stream, entity(one.name, "load", "true"), time, load, "load", TRUE)
    for contact in one.contacts:
        places = np.full((2, len(contact.time)), np.nan)
        places[:, contact.touching] = 1e3 * np.stack(skin.coordinates(contact.point[contact.touching]))
        for axis, values in zip(("along", "across"), places, strict=True):
            place = entity(one.name, axis, contact.name)
            send_curve(stream, place, contact.time, values, contact.name, contact.colour)


def _tab(one: ShownTouch, skin: Skin, origin: str) -> rrb.Horizontal:
    name, plots = one.name, {"pressure": "pressure, -mean of the counts"}
    if len(one.truth):
        plots["load"] = "true load (N)"
    plots |= {axis: f"contact {axis} the finger (mm)" for axis in ("along", "across")}
    views = rrb.Vertical(
        scene.close_view(
            f"finger on the handle{origin}",
            [f"{entity(name, 'finger')}/**", entity(name, "handle")],
            np.median(one.motion.position[one.rows], axis=0),
            _finger_x(one),
        ),
        scene.map_view("skin, flat (mm)", [f"{entity(name, 'skin')}/**"], skin),
        row_shares=[3, 2],
    )
    return scene.tab(name, [views], plots, legends=True)


def _notes(origin: str, one: ShownTouch, scale: float) -> str:
    colours = {"orange electrodes": f"counts fell, full colour at {scale:.0f} counts: pressed"}
    colours |= {"blue electrodes": "counts rose: the fluid bulges", "red point": "estimated contact"}
    if len(one.truth):
        colours |= {"green point": "true contact"}
    return (
        f"# {TITLE}\n\n{one.name}{origin}: {len(np.unique(one.contact))} contacts, from touching to "
        f"lifting.\n\n{colour_words(colours)}\n\nThe pose of the handle is not recorded; it is drawn where "
        "the contacts put it. In flat pictures the tip of the finger is to the right.\n"
    )
