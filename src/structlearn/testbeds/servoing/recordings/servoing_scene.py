"""The servoing testbed in recordings: the finger, the handle, electrodes in colour, flat maps.

A finger is drawn as the lines of its surface coordinates, so that electrodes under the skin are seen; it may
be any skin of `tactile.electrodes`. Flat pictures are in mm: x along the finger, y across it, upwards.
"""

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.ground import quaternion
from structlearn.palette import BLUE, GREEN, LIGHT_GREY, ORANGE, PURPLE, SKY, VERMILION
from structlearn.tactile.electrodes import Skin
from structlearn.viewer.electrode_colours import deviation_colours
from structlearn.viewer.rrd import rgba, send_moving_frame, thinning, time_column

ESTIMATED, TRUE, TARGET = VERMILION, GREEN, SKY
"""Colours of points of contact."""

SKIN, HANDLE = "#6b7480", "#8d7f6b"

ELECTRODE_COLOURS = (SKY, ORANGE, GREEN, PURPLE, VERMILION, BLUE, LIGHT_GREY)
"""Colours of electrodes by their number; as there are more electrodes, they come again."""

GRID_LINES, GRID_POINTS = 9, 25
"""Lines of the skin in either direction, and points of each."""

ELECTRODE_M, CONTACT_M = 0.0007, 0.0009
"""Radii of electrodes and points of contact in 3-D views."""

ELECTRODE_MM, CONTACT_MM = 0.75, 0.45
"""The same in flat pictures."""

IN_FRONT = 50.0
"""Order of drawing of paths on flat pictures; points have 30."""

COLOUR_RATE_HZ = 25.0
"""Colours per second; they are most of a file."""

FULL_SCALE_QUANTILE = 0.97
"""Share of the signals within the colour scale: most electrodes feel little."""

AXES_M = 0.006
"""Length of the finger's axes."""

EYE_M = 0.055
"""From the camera to the handle."""


def full_scale(signals: Sequence[np.ndarray]) -> float:
    """Change of the counts that gets the full colour, of signals (T, E) each."""
    return float(np.quantile(np.abs(np.concatenate(signals)), FULL_SCALE_QUANTILE))


def electrode_colours(count: int, opacity: float) -> np.ndarray:
    """Colours 0xRRGGBBAA (count,) that tell neighbouring electrodes apart."""
    return rgba([ELECTRODE_COLOURS[number % len(ELECTRODE_COLOURS)] for number in range(count)], opacity)


def flat(skin: Skin, points: np.ndarray) -> np.ndarray:
    """Places (..., 2) in a flat picture of points (..., 3) m of a skin."""
    along, across = skin.coordinates(points)
    return 1e3 * np.stack([along, -across], axis=-1)


def flat_electrodes(skin: Skin) -> np.ndarray:
    """Places (E, 2) of a skin's electrodes in a flat picture."""
    return flat(skin, skin.project(skin.electrodes))


def send_finger(
    stream: rr.RecordingStream,
    path: str,
    skin: Skin,
    time: np.ndarray,
    position: np.ndarray,
    orientation: np.ndarray,
) -> None:
    """Log a moving finger: its frame, the lines of its skin, and its electrodes.

    Args:
        stream: of the recording.
        path: of the finger; electrodes are at `<path>/electrodes`.
        skin: of the finger.
        time: (T,) s.
        position: (T, 3) m, base frame.
        orientation: (T, 4) finger to base.
    """
    send_moving_frame(stream, path, [time_column(time)], position, orientation, SKIN, AXES_M)
    stream.log(
        f"{path}/skin", rr.LineStrips3D(skin_lines(skin), colors=rgba([SKIN]), radii=-0.8), static=True
    )
    stream.log(f"{path}/electrodes", rr.Points3D(skin.electrodes, radii=ELECTRODE_M), static=True)


def skin_lines(skin: Skin) -> list[np.ndarray]:
    """Lines of constant surface coordinates, (GRID_POINTS, 3) m each."""
    ends = (skin.along, skin.across)
    fine = [np.linspace(*its, GRID_POINTS) for its in ends]
    coarse = [np.linspace(*its, GRID_LINES) for its in ends]
    lines = [skin.surface(fine[0], across) for across in coarse[1]]
    return lines + [skin.surface(along, fine[1]) for along in coarse[0]]


def send_skin_map(stream: rr.RecordingStream, path: str, skin: Skin) -> None:
    """Log the flat picture of a skin: its electrodes with their numbers."""
    places = flat_electrodes(skin)
    stream.log(f"{path}/electrodes", rr.Points2D(places, radii=ELECTRODE_MM), static=True)
    numbers = rr.Points2D(
        places + np.array([0.0, 0.4]),
        labels=[str(number + 1) for number in range(len(places))],
        colors=rgba([SKIN]),
        radii=0.0,
        show_labels=True,
    )
    stream.log(f"{path}/numbers", numbers, static=True)


def send_signals(
    stream: rr.RecordingStream,
    paths: dict[str, type[rr.Points2D] | type[rr.Points3D]],
    time: np.ndarray,
    signals: np.ndarray,
    scale: float,
) -> None:
    """Colour electrodes by signals (T, E) in counts: orange where pressed, blue where it bulges."""
    kept = slice(None, None, thinning(float(np.median(np.diff(time))), COLOUR_RATE_HZ))
    colours = deviation_colours(np.clip(-signals[kept] / scale, -1.0, 1.0), 1.0)
    for path, points in paths.items():
        columns = points.columns(colors=colours.ravel())
        stream.send_columns(
            path, [time_column(time[kept])], columns.partition([colours.shape[1]] * len(colours))
        )


def send_contact(
    stream: rr.RecordingStream,
    paths: tuple[str, str],
    skin: Skin,
    time: np.ndarray,
    point: np.ndarray,
    touching: np.ndarray,
    colour: str,
) -> None:
    """Log a point of contact over time, in the frame of the finger and on its flat picture.

    Args:
        stream: of the recording.
        paths: below the moving finger, and on the flat picture.
        skin: that is touched.
        time: (T,) s.
        point: (T, 3) m, frame of the finger.
        touching: (T,) whether there is a contact; the point vanishes otherwise.
        colour: of the point.
    """
    lengths = touching.astype(int)
    for path, kind, places, radius in (
        (paths[0], rr.Points3D, point[touching], CONTACT_M),
        (paths[1], rr.Points2D, flat(skin, point[touching]), CONTACT_MM),
    ):
        stream.log(path, kind.from_fields(colors=rgba([colour]), radii=radius), static=True)
        stream.send_columns(path, [time_column(time)], kind.columns(positions=places).partition(lengths))


def send_map_path(
    stream: rr.RecordingStream, path: str, time: np.ndarray, places: np.ndarray, colour: str
) -> None:
    """Log a point that moves on a flat picture, (T, 2), and the path behind it, in front of all else."""
    times = [time_column(time)]
    look = {"colors": rgba([colour]), "draw_order": IN_FRONT}
    stream.log(f"{path}/now", rr.Points2D.from_fields(radii=CONTACT_MM, **look), static=True)
    stream.send_columns(f"{path}/now", times, rr.Points2D.columns(positions=places))
    stream.log(f"{path}/trail", rr.LineStrips2D.from_fields(radii=-2.0, **look), static=True)
    trails = [places[: max(end, 2)] for end in range(1, len(time) + 1)]
    stream.send_columns(f"{path}/trail", times, rr.LineStrips2D.columns(strips=trails))


def send_handle(
    stream: rr.RecordingStream, path: str, centre: np.ndarray, axis: np.ndarray, radius: float, length: float
) -> None:
    """Log a handle: a bar with round ends about its centre (3,) m along its horizontal unit axis (3,)."""
    turned = quaternion.from_rotation_vector(0.5 * np.pi * np.cross([0.0, 0.0, 1.0], axis))
    bar = rr.Capsules3D(
        lengths=[length],
        radii=[radius],
        translations=[centre - 0.5 * length * axis],
        quaternions=[quaternion.to_xyzw(turned)],
        colors=rgba([HANDLE], 0.5),
        fill_mode=rr.components.FillMode.Solid,
    )
    stream.log(path, bar, static=True)


def close_view(
    name: str, contents: Sequence[str], centre: np.ndarray, finger_x: np.ndarray
) -> rrb.Spatial3DView:
    """3-D view from beside and below, where the skin meets the handle.

    Args:
        name: heading.
        contents: query expressions of the entities shown.
        centre: (3,) m, of the handle.
        finger_x: (3,) the finger's x axis in the base frame, about horizontal.
    """
    ahead = finger_x * [1.0, 1.0, 0.0]
    ahead = ahead / np.linalg.norm(ahead)
    aside = np.array([ahead[1], -ahead[0], 0.0])
    target = centre - 0.004 * ahead + np.array([0.0, 0.0, 0.006])
    backward = 0.35 * ahead + 0.9 * aside - [0.0, 0.0, 0.25]
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=target + EYE_M * backward / np.linalg.norm(backward),
        look_target=target,
        eye_up=[0.0, 0.0, 1.0],
    )
    return rrb.Spatial3DView(
        name=name, origin="/", contents=list(contents), eye_controls=eye, line_grid=False
    )


def map_view(name: str, contents: Sequence[str], skin: Skin) -> rrb.Spatial2DView:
    """View of a flat picture of a skin, or of a latent map in its size."""
    along, across = (1e3 * np.array(ends) for ends in (skin.along, skin.across))
    bounds = rrb.VisualBounds2D(
        x_range=[along[0] - 2.0, along[1] + 2.0], y_range=[-across[1] - 2.0, -across[0] + 2.0]
    )
    return rrb.Spatial2DView(name=name, origin="/", contents=list(contents), visual_bounds=bounds)
