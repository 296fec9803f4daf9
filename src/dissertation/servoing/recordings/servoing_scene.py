"""Recordings of the servoing testbed: finger, handle, coloured electrodes, flat maps.

Fingers (any skin of `tactile.electrodes`) are drawn as lines of constant surface coordinates, so electrodes
below the skin stay visible. Flat pictures are in mm: x along the finger, y across it, upwards.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import rerun as rr
from pydantic import Field

from structlearn.core import quaternion
from structlearn.core.params import Parameters
from structlearn.tactile.electrodes import MapAlignment, Skin, align_map
from structlearn.viewer import items, views
from structlearn.viewer.items import Item
from structlearn.viewer.views import Panel

SKIN, HANDLE = "#6b7480", "#8d7f6b"

HANDLE_M = 0.03  # drawn length of the handle
GRID_LINES, GRID_POINTS = 9, 25  # skin lines in each direction, and points per line
ELECTRODE_M, CONTACT_M = 0.0007, 0.0009  # radii of electrodes and contact points in 3-D views
ELECTRODE_MM, CONTACT_MM = 0.75, 0.45  # the same in flat pictures
MARGIN_MM = 2.0  # around flat pictures
IN_FRONT = 50.0  # draw order of paths in flat pictures; points have 30

POSE_RATE_HZ, COLOUR_RATE_HZ = 50.0, 25.0  # finger and electrodes; colours take up most of a file
FULL_SCALE_QUANTILE = 0.97  # share of the signals within the colour scale: most electrodes respond little
AXES_M, EYE_M = 0.006, 0.055  # length of the finger's axes; distance from the camera to the handle


class ServoingViewParameters(Parameters):
    """Contents of the recordings of the servoing testbed."""

    demonstrations: tuple[str, ...]
    map_points: int = Field(ge=1)
    trials: int = Field(ge=1)


@dataclass(frozen=True)
class FingerMotion:
    """Motion and signals of a finger with E electrodes over T samples."""

    time: np.ndarray  # (T,) s
    position: np.ndarray  # (T, 3) m, base frame
    orientation: np.ndarray  # (T, 4) finger to base
    signals: np.ndarray  # (T, E) counts minus offset


@dataclass(frozen=True)
class Contact:
    """A contact point over T samples."""

    name: str  # e.g. `true`
    colour: str
    time: np.ndarray  # (T,) s
    point: np.ndarray  # (T, 3) m, finger frame
    touching: np.ndarray  # (T,) whether there is a contact; otherwise the point is hidden


@dataclass(frozen=True)
class FlatSkin:
    """A skin in flat pictures, with the latent map aligned to it."""

    skin: Skin
    alignment: MapAlignment  # alignment of the map, in mm
    unit_mm: float  # mm per unit of the map

    @classmethod
    def fitted(cls, skin: Skin, contact_points: np.ndarray, latent: np.ndarray, map_unit: float) -> Self:
        """Fit to N contact points (N, 3) m and map coordinates (N, 2) in units of `map_unit` m."""
        alignment = align_map(1e3 * map_unit * latent, flat(skin, contact_points.astype(float)))
        return cls(skin, alignment, 1e3 * map_unit)

    def places(self, points: np.ndarray) -> np.ndarray:
        """Flat coordinates (..., 2) mm of points (..., 3) m on the skin."""
        return flat(self.skin, points)

    def latent(self, states: np.ndarray) -> np.ndarray:
        """Flat coordinates (..., 2) mm of latent states (..., 3) in the networks' units."""
        return self.alignment(self.unit_mm * states[..., :2])


def full_scale(signals: Sequence[np.ndarray]) -> float:
    """Counts shown in full colour, for signals (T, E) each."""
    return float(np.quantile(np.abs(np.concatenate(signals)), FULL_SCALE_QUANTILE))


def flat(skin: Skin, points: np.ndarray) -> np.ndarray:
    """Flat-picture coordinates (..., 2) mm of points (..., 3) m on a skin."""
    along, across = skin.coordinates(points)
    return 1e3 * np.stack([along, -across], axis=-1)


def touch(
    path: str, skin: Skin, motion: FingerMotion, contacts: Sequence[Contact], scale: float
) -> tuple[list[Item], list[Item]]:
    """A moving finger and the flat skin below a path, each with coloured electrodes and contacts.

    `scale`: counts shown in full colour, orange where pressed, light blue where the fluid bulges.
    """
    kept = items.kept(motion.time, POSE_RATE_HZ)
    pose = (motion.position[kept], SKIN, motion.orientation[kept], AXES_M)
    finger = [
        items.moving_frame(f"{path}/finger", motion.time[kept], *pose),
        items.lines(f"{path}/finger/skin", skin_lines(skin), SKIN, -0.8),
    ]
    places = flat(skin, skin.project(skin.electrodes))
    numbers = [str(number + 1) for number in range(len(places))]
    drawn = [items.texts(f"{path}/skin/numbers", places + np.array([0.0, 0.4]), numbers, SKIN)]
    kept = items.kept(motion.time, COLOUR_RATE_HZ)
    time, felt = motion.time[kept], np.clip(-motion.signals[kept] / scale, -1.0, 1.0)
    solid, dots = rr.Points3D(skin.electrodes, radii=ELECTRODE_M), rr.Points2D(places, radii=ELECTRODE_MM)
    finger.append(items.readings(f"{path}/finger/electrodes", time, solid, felt, 1.0))
    drawn.append(items.readings(f"{path}/skin/electrodes", time, dots, felt, 1.0))
    for contact in (one for one in contacts if len(one.time)):
        kept = items.kept(contact.time, COLOUR_RATE_HZ)
        time, point, name, look = contact.time[kept], contact.point[kept], contact.name, contact.colour
        for above, shown, at, radius in (
            ("finger", finger, point, CONTACT_M),
            ("skin", drawn, flat(skin, point), CONTACT_MM),
        ):
            place = (f"{path}/{above}/{name}", time, at, look, radius)
            shown.append(items.moving_point(*place, there=contact.touching[kept]))
    return finger, drawn


def skin_lines(skin: Skin) -> list[np.ndarray]:
    """Lines of constant surface coordinates, (GRID_POINTS, 3) m each."""
    ends = (skin.along, skin.across)
    fine = [np.linspace(*its, GRID_POINTS) for its in ends]
    coarse = [np.linspace(*its, GRID_LINES) for its in ends]
    lines = [skin.surface(fine[0], across) for across in coarse[1]]
    return lines + [skin.surface(along, fine[1]) for along in coarse[0]]


def map_path(path: str, time: np.ndarray, places: np.ndarray, colour: str) -> list[Item]:
    """A point (T, 2) mm moving on a flat picture, with its trail, in the foreground."""
    point = items.moving_point(f"{path}/now", time, places, colour, CONTACT_MM, draw_order=IN_FRONT)
    return [point, items.trail(f"{path}/trail", time, places, colour, -2.0, draw_order=IN_FRONT)]


def handle(path: str, centre: np.ndarray, axis: np.ndarray, radius: float) -> Item:
    """The handle, a capsule with its centre (3,) m and horizontal unit axis (3,)."""
    turned = quaternion.from_rotation_vector(0.5 * np.pi * np.cross([0.0, 0.0, 1.0], axis))
    end, size = centre - 0.5 * HANDLE_M * axis, {"lengths": [HANDLE_M], "radii": [radius]}
    pose = {"translations": [end], "quaternions": [quaternion.to_xyzw(turned)]}
    return items.solid(path, rr.Capsules3D, HANDLE, 0.5, **size, **pose)


def close_view(name: str, shown: Sequence[Item], centre: np.ndarray, finger_x: np.ndarray) -> Panel:
    """3-D view of the skin on the handle at `centre` (3,) m, from the side and below.

    `finger_x` (3,): the finger's x axis in the base frame, roughly horizontal.
    """
    ahead = finger_x * [1.0, 1.0, 0.0]
    ahead = ahead / np.linalg.norm(ahead)
    aside = np.array([ahead[1], -ahead[0], 0.0])
    target = centre - 0.004 * ahead + np.array([0.0, 0.0, 0.006])
    backward = 0.35 * ahead + 0.9 * aside - [0.0, 0.0, 0.25]
    return views.eye(name, shown, target, EYE_M * backward / np.linalg.norm(backward))


def map_view(name: str, shown: Sequence[Item], skin: Skin) -> Panel:
    """2-D view with the extent of the flat skin."""
    (left, right), (low, high) = (1e3 * np.array(ends) for ends in (skin.along, skin.across))
    columns, rows = ([start - MARGIN_MM, end + MARGIN_MM] for start, end in ((left, right), (-high, -low)))
    return views.flat(name, shown, columns, rows)


def tab(name: str, columns: Sequence[Panel], plots: Sequence[Panel], notes: str) -> Panel:
    """Tab with columns of views, beside plots and notes."""
    beside = views.column(*plots, views.notes(notes, name))
    return views.row(views.row(*columns), beside, shares=[1, 1], name=name)
