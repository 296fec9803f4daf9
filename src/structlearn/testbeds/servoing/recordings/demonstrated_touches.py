"""Recording of demonstrations of touch: finger, handle, electrodes and contact points (II.4.1.1)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.ground import quaternion
from structlearn.tactile.electrodes import Skin
from structlearn.testbeds.servoing.recordings.servoing_scene import (
    COLOUR_RATE_HZ,
    ESTIMATED,
    TRUE,
    close_view,
    full_scale,
    map_view,
    send_contact,
    send_finger,
    send_handle,
    send_signals,
    send_skin_map,
)
from structlearn.testbeds.servoing.recordings.shown_touches import ShownTouch
from structlearn.viewer.notes import colour_words, notes_view, send_notes
from structlearn.viewer.rrd import entity, layout, origin_label, plot, recording, send_curve, thinning

HANDLE_M = 0.03
"""Length of the handle that is drawn."""

POSE_RATE_HZ = 50.0
"""Poses of the finger per second."""


def write_touch_demonstrations(
    path: str | Path, shown: Sequence[ShownTouch], skin: Skin, handle_radius: float, title: str
) -> None:
    """Write demonstrations of touch as a recording, a tab each.

    Args:
        path: of the .rrd file.
        shown: the demonstrations.
        skin: of the finger.
        handle_radius: m.
        title: heading, different for every recording.
    """
    origin = origin_label([one.demonstration for one in shown])
    scale = full_scale([one.signals for one in shown])
    with recording(path, title) as stream:
        stream.send_blueprint(layout(rrb.Tabs(*[_tab(one, skin, origin) for one in shown], active_tab=0)))
        for one in shown:
            _send_scene(stream, one, skin, handle_radius, scale)
            _send_curves(stream, one, skin)
            send_notes(stream, _notes(title, origin, one, scale), one.name)


def handle_place(one: ShownTouch, skin: Skin, handle_radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Where the handle of a demonstration must have been, as its pose is not recorded.

    The finger's x axis lies across the handle; the middle of the handle is behind the contacts.

    Args:
        one: the demonstration.
        skin: of the finger.
        handle_radius: m.

    Returns:
        Centre (3,) m and horizontal unit axis (3,), base frame.
    """
    rows = np.rint(one.time / one.demonstration.dt).astype(int)
    orientation = one.demonstration.orientation[rows]
    behind = one.contact_point + handle_radius * skin.normal(one.contact_point)
    centre = np.median(one.demonstration.position[rows] + quaternion.rotate(orientation, behind), axis=0)
    ahead = finger_x(one)
    axis = np.array([-ahead[1], ahead[0], 0.0])
    return centre, axis / np.linalg.norm(axis)


def finger_x(one: ShownTouch) -> np.ndarray:
    """Mean direction (3,) of the finger's x axis in the base frame."""
    return quaternion.rotate(one.demonstration.orientation, np.array([1.0, 0.0, 0.0])).mean(axis=0)


def _send_scene(
    stream: rr.RecordingStream, one: ShownTouch, skin: Skin, handle_radius: float, scale: float
) -> None:
    demonstration = one.demonstration
    kept = slice(None, None, thinning(demonstration.dt, POSE_RATE_HZ))
    finger, skin_map = entity(one.name, "finger"), entity(one.name, "skin")
    poses = (demonstration.position[kept], demonstration.orientation[kept])
    send_finger(stream, finger, skin, demonstration.time[kept], *poses)
    centre, axis = handle_place(one, skin, handle_radius)
    send_handle(stream, entity(one.name, "handle"), centre, axis, handle_radius, HANDLE_M)
    send_skin_map(stream, skin_map, skin)
    electrodes = {f"{finger}/electrodes": rr.Points3D, f"{skin_map}/electrodes": rr.Points2D}
    send_signals(stream, electrodes, demonstration.time, one.signals, scale)
    every = thinning(demonstration.dt, COLOUR_RATE_HZ)
    for name, (time, point, touching), colour in (
        ("estimated", _estimated(one), ESTIMATED),
        ("true", _true(one), TRUE),
    ):
        if len(time):
            places = (f"{finger}/{name}", f"{skin_map}/{name}")
            send_contact(stream, places, skin, time[::every], point[::every], touching[::every], colour)


def _estimated(one: ShownTouch) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Estimated contact over the whole time: times (T,), points (T, 3) and whether something touches (T,)."""
    time = one.demonstration.time
    rows = np.rint(one.time / one.demonstration.dt).astype(int)
    point, touching = np.zeros((len(time), 3)), np.zeros(len(time), dtype=bool)
    point[rows], touching[rows] = one.contact_point, True
    return time, point, touching


def _true(one: ShownTouch) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of the true contact."""
    truth = one.truth
    point = truth[["x_m", "y_m", "z_m"]].to_numpy(float)
    return truth["time_s"].to_numpy(float), point, truth["load_n"].to_numpy() > 0


def _send_curves(stream: rr.RecordingStream, one: ShownTouch, skin: Skin) -> None:
    """Pressure, load, and surface coordinates of the contact; lines end where it does."""
    name, time = one.name, one.demonstration.time
    send_curve(
        stream, entity(name, "pressure", "raw"), time, -one.signals.mean(axis=1), "pressure", ESTIMATED
    )
    if len(one.truth):
        load = one.truth["load_n"].to_numpy(float)
        send_curve(
            stream, entity(name, "load", "true"), one.truth["time_s"].to_numpy(float), load, "load", TRUE
        )
    for label, (its, point, touching), colour in (
        ("estimated", _estimated(one), ESTIMATED),
        ("true", _true(one), TRUE),
    ):
        if len(its):
            for axis, values in zip(("along", "across"), skin.coordinates(point[touching]), strict=True):
                whole = np.full(len(its), np.nan)
                whole[touching] = 1e3 * values
                send_curve(stream, entity(name, axis, label), its, whole, label, colour)


def _tab(one: ShownTouch, skin: Skin, origin: str) -> rrb.Horizontal:
    name = one.name
    rows = np.rint(one.time / one.demonstration.dt).astype(int)
    centre = np.median(one.demonstration.position[rows], axis=0)
    scene = close_view(
        f"finger on the handle{origin}",
        [f"{entity(name, 'finger')}/**", entity(name, "handle")],
        centre,
        finger_x(one),
    )
    skin_map = map_view("skin, flat (mm)", [f"{entity(name, 'skin')}/**"], skin)
    plots = [plot("pressure, -mean of the counts", [f"{entity(name, 'pressure')}/**"], legend=False)]
    if len(one.truth):
        plots.append(plot("true load (N)", [f"{entity(name, 'load')}/**"], legend=False))
    plots += [
        plot(f"contact {axis} the finger (mm)", [f"{entity(name, axis)}/**"]) for axis in ("along", "across")
    ]
    return rrb.Horizontal(
        rrb.Vertical(scene, skin_map, row_shares=[3, 2]),
        rrb.Vertical(*plots),
        notes_view(name),
        column_shares=[4, 4, 2],
        name=name,
    )


def _notes(title: str, origin: str, one: ShownTouch, scale: float) -> str:
    colours = {"orange electrodes": f"counts fell, full colour at {scale:.0f} counts: pressed"}
    colours |= {"blue electrodes": "counts rose: the fluid bulges", "red point": "estimated contact"}
    if len(one.truth):
        colours |= {"green point": "true contact"}
    return (
        f"# {title}\n\n{one.name}{origin}: {len(np.unique(one.contact))} contacts, from touching to "
        f"lifting.\n\n{colour_words(colours)}\n\nThe pose of the handle is not recorded; it is drawn where "
        "the contacts put it. In flat pictures the tip of the finger is to the right.\n"
    )
