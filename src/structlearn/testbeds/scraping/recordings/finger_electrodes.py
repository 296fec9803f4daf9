"""Electrodes of the two fingers in recordings: where they are, and how far off they read."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from structlearn.palette import GREY
from structlearn.simulation.fingers import TouchParameters
from structlearn.tactile.electrodes import ELECTRODES_MM, SKIN_RADIUS_MM
from structlearn.testbeds.scraping.recordings.shown_execution import Execution
from structlearn.viewer.electrode_colours import deviation_colours
from structlearn.viewer.rrd import rgba, thinning, time_column

FULL_SCALE_QUANTILE = 0.995
"""Share of the deviations within the colour scale: single electrodes would darken all others."""

FINGERS = ("left finger", "right finger")

COLOUR_RATE_HZ = 50.0
"""Colours per second: smooth to the eye; they are most of a file."""

MAP_WIDTH, MAP_GAP = 24.0, 3.0
"""mm that one finger takes in the flat picture, and between the two."""


def full_scale(executions: Sequence[Execution]) -> float:
    """Deviation in counts that gets the full colour, the same for all of these."""
    return float(
        np.quantile(np.abs(np.concatenate([one.deviation for one in executions])), FULL_SCALE_QUANTILE)
    )


def electrodes() -> np.ndarray:
    """Places of the electrodes, (2, 19, 3) m from the grasp, left finger first; axes as the hand's.

    A finger's own x runs to its tip, z into it, and y so that the left finger's is the hand's -y.
    """
    touch = TouchParameters()
    along, across, inwards = ELECTRODES_MM.T
    fingers = []
    for side, home in zip((1.0, -1.0), touch.home_mm, strict=True):
        outwards = side * (touch.pad_distance_mm + SKIN_RADIUS_MM + inwards)
        fingers.append(np.column_stack([outwards, -side * across, along - home]))
    return 1e-3 * np.array(fingers)


def send_electrode_map(stream: rr.RecordingStream, path: str, one: Execution, scale: float) -> None:
    """Log the electrodes of both fingers as flat pictures, seen from the back of each finger.

    Drawn in mm: the fingers lie beside each other with their tips to the right, the scraping direction up.
    """
    places = 1e3 * electrodes()
    flat = np.concatenate([_on_map(finger, places[finger]) for finger in range(2)])
    stream.log(path, rr.Points2D(flat, radii=1.1), static=True)
    send_colours(stream, path, rr.Points2D, one, scale)
    names = rr.Points2D(
        [_on_map(finger, np.array([[0.0, -6.2, -5.0]]))[0] for finger in range(2)],
        labels=FINGERS,
        colors=rgba([GREY]),
        radii=0.0,
        show_labels=True,
    )
    stream.log(f"{path}/names", names, static=True)


def map_view(name: str, path: str) -> rrb.Spatial2DView:
    """View of `send_electrode_map`."""
    bounds = rrb.VisualBounds2D(x_range=[-16.0, 2 * MAP_WIDTH + MAP_GAP - 11.0], y_range=[-7.0, 11.0])
    return rrb.Spatial2DView(name=name, origin="/", contents=[f"{path}/**"], visual_bounds=bounds)


def _on_map(finger: int, place: np.ndarray) -> np.ndarray:
    """Points (K, 2) of the flat picture, downwards, of places (K, 3) mm relative to the grasp."""
    return np.column_stack([place[:, 2] + finger * (MAP_WIDTH + MAP_GAP), -place[:, 1]])


def send_colours(
    stream: rr.RecordingStream,
    path: str,
    points: type[rr.Points2D] | type[rr.Points3D],
    one: Execution,
    scale: float,
) -> None:
    """Colours of the electrodes over time; until feedback begins all read as expected."""
    kept = slice(None, None, thinning(float(np.median(np.diff(one.time))), COLOUR_RATE_HZ))
    times = np.concatenate([one.run.time[:1], one.time[kept]])
    shown = np.concatenate([np.zeros((1, one.deviation.shape[1])), one.deviation[kept]])
    colours = deviation_colours(shown, scale)
    columns = points.columns(colors=colours.ravel())
    stream.send_columns(path, [time_column(times)], columns.partition([colours.shape[1]] * len(colours)))
