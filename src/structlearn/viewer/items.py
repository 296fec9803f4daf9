"""What recordings show: items, i.e. entities with components that stay or change over times.

Times are in s since the start of a demonstration or movement, or arrays keyed by time line, whose integers
count steps. Colours are `#rrggbb`, one or several, or numbers as of `rgba`; radii below 0 are in points.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from rerun.error_utils import set_strict_mode

from structlearn.core import quaternion
from structlearn.palette import AXIS_COLOURS, LIGHT_BLUE, ORANGE, primitive_colour

set_strict_mode(True)  # otherwise rerun turns errors into warnings and leaves views empty

TIME = "time"  # time line of seconds
VIEW_RATE_HZ = 100.0  # signals are thinned to about this rate, enough for a screen
AXIS_SHARE = 0.12  # length of a moving frame's axes as a fraction of the scene's radius
SHORTEST_AXES = 0.01  # m; for scenes in which hardly anything but the orientation moves
FLOOR_SQUARE_M = 0.1
RESTING = "#565d66"  # electrode that reads as expected

Colours = str | Sequence[str] | np.ndarray
Times = np.ndarray | Mapping[str, np.ndarray]
Step = Mapping[str, float] | None  # one time on each time line


@dataclass(frozen=True, eq=False)
class Item:
    """An entity; `path` is also the query expression by which views find it."""

    path: str
    still: Sequence[rr.AsComponents] = ()
    times: Times | None = None
    columns: Any = ()  # components over times
    at: Step = None  # when `still` appears; None: always
    floor_m: float | None = None  # height of the floor that it stands on
    chunks: Any = None  # ready to be sent


def entity(*parts: str) -> str:
    """Entity path from its parts, with special characters escaped."""
    return rr.new_entity_path(list(parts))


def rgba(colours: Colours, opacity: float = 1.0) -> np.ndarray:
    """Colours 0xRRGGBBAA (N,) for rerun, from one `#rrggbb` or N; numbers stay."""
    if isinstance(colours, np.ndarray):
        return colours
    colours = [colours] if isinstance(colours, str) else colours
    alpha = f"{round(255 * opacity):02x}"
    return np.array([int(f"{colour[1:]}{alpha}", 16) for colour in colours], dtype=np.uint32)


def blended(share: np.ndarray, colours: Sequence[str]) -> np.ndarray:
    """Colours 0xRRGGBBAA (...) interpolated over `colours`, from the first at share 0 to the last at 1."""
    stops = np.array([[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in colours])
    places = np.linspace(0.0, 1.0, len(stops))
    red, green, blue = (np.interp(share, places, stops[:, part]).astype(np.uint32) for part in range(3))
    return (red << 24) | (green << 16) | (blue << 8) | 0xFF


def thinning(dt: float, rate_hz: float = VIEW_RATE_HZ) -> int:
    """Step between kept samples that thins a signal to about `rate_hz`."""
    return max(1, round(1.0 / (rate_hz * dt)))


def kept(times: np.ndarray, rate_hz: float = VIEW_RATE_HZ) -> slice:
    """Samples of T times that are kept at about `rate_hz`."""
    return slice(None, None, thinning(float(np.median(np.diff(times))), rate_hz))


def axis_length(points: np.ndarray) -> float:
    """Axis length in m for frames that move among points (N, 3) m."""
    return max(AXIS_SHARE * 0.5 * float(np.linalg.norm(np.ptp(points, axis=0))), SHORTEST_AXES)


def series(
    path: str,
    times: Times,
    values: np.ndarray,
    names: str | Sequence[str],
    colours: str | Sequence[str] = AXIS_COLOURS,
    width: float = 1.5,
) -> Item:
    """One signal (T,) with a name and a colour, or D signals (T, D), as lines of one plot."""
    count = values.size // max(len(values), 1)
    called = [names] if isinstance(names, str) and values.ndim == 1 else list(names)
    shown = rgba(colours if isinstance(colours, str) else colours[: len(called)])
    style = rr.SeriesLines(names=called, colors=shown, widths=[width] * len(called))
    columns = rr.Scalars.columns(scalars=values.ravel()).partition([count] * len(values))
    return Item(path, [style], times, columns)


def marks(path: str, times: Times, values: np.ndarray, name: str, colour: str) -> Item:
    """Single samples (K,) as points in a plot, e.g. a curve's cut points."""
    style = rr.SeriesPoints(names=name, colors=rgba(colour), markers="circle", marker_sizes=3.0)
    return Item(path, [style], times, rr.Scalars.columns(scalars=values))


def lane(path: str, times: Times, names: Sequence[str]) -> Item:
    """Coloured lane of P primitives with P + 1 times: their starts and the last end."""
    colours = rgba([primitive_colour(place) for place in range(len(names))])
    look = rr.StateConfiguration(values=names, colors=colours)
    return Item(path, [look], times, rr.StateChange.columns(state=[*names, ""]))


def lines(
    path: str, strips: Any, colours: Colours, radii: float, opacity: float = 1.0, at: Step = None, **look: Any
) -> Item:
    """N lines of points (2,) or (3,), with N colours or one; `look`: other components."""
    kind: Any = rr.LineStrips3D if np.shape(strips[0])[-1] == 3 else rr.LineStrips2D
    return Item(path, [kind(strips, colors=rgba(colours, opacity), radii=radii, **look)], at=at)


def dots(
    path: str, points: Any, colours: Colours, radii: float, opacity: float = 1.0, at: Step = None, **look: Any
) -> Item:
    """N points (2,) or (3,), with N colours or one; `labels` are shown; `look`: other components."""
    kind: Any = rr.Points3D if np.shape(points)[-1] == 3 else rr.Points2D
    shown = {"show_labels": True} if "labels" in look else {}
    return Item(path, [kind(points, colors=rgba(colours, opacity), radii=radii, **(shown | look))], at=at)


def texts(path: str, places: Any, labels: Sequence[str], colours: Colours, at: Step = None) -> Item:
    """Labels below N points (2,) of a drawing, with N colours or one for all."""
    return dots(path, np.reshape(places, (-1, 2)), colours, 0.0, at=at, labels=list(labels))


def solid(path: str, kind: Any, colours: Colours, opacity: float = 1.0, **shape: Any) -> Item:
    """N filled bodies of a kind of rerun's, e.g. `Capsules3D`, with N colours or one."""
    return Item(path, [kind(colors=rgba(colours, opacity), **{"fill_mode": "solid"} | shape)])


def floor_axes(path: str, points: np.ndarray) -> Item:
    """Arrows x, y and z, one floor square long, at the corner of a floor below points (N, 3) m."""
    corner = points.min(axis=0)
    look: dict[str, Any] = {"colors": rgba(AXIS_COLOURS), "labels": ["x", "y", "z"], "show_labels": True}
    arrows = rr.Arrows3D(origins=[corner] * 3, vectors=FLOOR_SQUARE_M * np.eye(3), **look)
    return Item(path, [arrows], floor_m=float(corner[2]))


def moving_point(
    path: str,
    times: Times,
    places: np.ndarray,
    colour: str,
    radius: float,
    there: np.ndarray | None = None,
    **look: Any,
) -> Item:
    """Moving point (T, 2) or (T, 3); hidden where `there` (T,) is False."""
    kind: Any = rr.Points3D if places.shape[1] == 3 else rr.Points2D
    shown = np.full(len(places), True) if there is None else there
    columns = kind.columns(positions=places[shown]).partition(shown.astype(int))
    return Item(path, [kind.from_fields(colors=rgba(colour), radii=radius, **look)], times, columns)


def trail(path: str, times: Times, places: np.ndarray, colour: str, radius: float, **look: Any) -> Item:
    """Path (T, 2) or (T, 3) travelled so far."""
    kind: Any = rr.LineStrips3D if places.shape[1] == 3 else rr.LineStrips2D
    columns = kind.columns(strips=[places[: max(end, 2)] for end in range(1, len(places) + 1)])
    return Item(path, [kind.from_fields(radii=radius, colors=rgba(colour), **look)], times, columns)


def moving_frame(
    path: str,
    times: Times,
    position: np.ndarray,
    colour: str = "",
    orientation: Any = None,
    axes_m: float = 0.0,
) -> Item:
    """Pose over time, (T, 3) m and, if known, (T, 4), of an entity and all below it.

    With a colour it is shown as a point, with axes of a length in m.
    """
    still: list[rr.AsComponents] = (
        [rr.Points3D([[0.0] * 3], colors=rgba(colour), radii=-3.0)] if colour else []
    )
    pose: dict[str, Any] = {"translation": position}
    if orientation is not None:
        pose["quaternion"] = quaternion.to_xyzw(orientation)
        still += [rr.TransformAxes3D(axes_m)] if axes_m > 0.0 else []
    return Item(path, still, times, rr.Transform3D.columns(**pose))


def travelled(
    path: str, times: Times, position: np.ndarray, colour: str, radius: float, body: str = "hand"
) -> list[Item]:
    """The whole path (T, 3) m of a body as a line, and the body moving along it."""
    line = lines(f"{path}/path", [position], colour, radius)
    return [line, moving_frame(f"{path}/{body}", times, position, colour)]


def readings(
    path: str, times: Times, points: rr.Points2D | rr.Points3D, deviation: np.ndarray, scale: float
) -> Item:
    """E electrodes, coloured by deviations (T, E): light blue below what is expected."""
    colours = blended(0.5 + 0.5 * deviation / scale, (LIGHT_BLUE, RESTING, ORANGE))
    columns = points.columns(colors=colours.ravel()).partition([colours.shape[1]] * len(colours))
    return Item(path, [points], times, columns)
