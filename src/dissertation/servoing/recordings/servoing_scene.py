"""Recordings of the servoing testbed: finger, handle, coloured electrodes, flat maps.

Fingers (any skin of `tactile.electrodes`) are drawn as lines of constant surface coordinates, so electrodes
below the skin stay visible. Flat pictures are in mm: x along the finger, y across it, upwards.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from pydantic import Field

from structlearn.core import quaternion
from structlearn.core.params import Parameters
from structlearn.tactile.electrodes import MapAlignment, Skin, align_map
from structlearn.viewer.rrd import (
    Recording,
    below,
    eye_view,
    flat_view,
    notes_view,
    plot,
    thinning,
)

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


def send_touch(
    to: Recording, path: str, skin: Skin, motion: FingerMotion, contacts: Sequence[Contact], scale: float
) -> None:
    """Log a moving `finger` and the flat `skin` below a path, with coloured electrodes and contacts.

    `scale`: counts shown in full colour, orange where pressed, light blue where the fluid bulges.
    """
    finger, flat_skin = f"{path}/finger", f"{path}/skin"
    dt = float(np.median(np.diff(motion.time)))
    kept = slice(None, None, thinning(dt, POSE_RATE_HZ))
    pose = (motion.position[kept], SKIN, motion.orientation[kept], AXES_M)
    to.moving_frame(finger, motion.time[kept], *pose)
    to.lines(f"{finger}/skin", skin_lines(skin), SKIN, -0.8)
    places = flat(skin, skin.project(skin.electrodes))
    numbers = [str(number + 1) for number in range(len(places))]
    to.dots(f"{flat_skin}/numbers", places + np.array([0.0, 0.4]), SKIN, 0.0, labels=numbers)
    kept = slice(None, None, thinning(dt, COLOUR_RATE_HZ))
    felt = np.clip(-motion.signals[kept] / scale, -1.0, 1.0)
    for above, electrodes in (
        (finger, rr.Points3D(skin.electrodes, radii=ELECTRODE_M)),
        (flat_skin, rr.Points2D(places, radii=ELECTRODE_MM)),
    ):
        to.readings(f"{above}/electrodes", motion.time[kept], electrodes, felt, 1.0)
    for contact in contacts:
        _send_contact(to, path, skin, contact)


def _send_contact(to: Recording, path: str, skin: Skin, contact: Contact) -> None:
    """Log a contact point in the finger frame and on the flat skin."""
    if not len(contact.time):
        return
    kept = slice(None, None, thinning(float(np.median(np.diff(contact.time))), COLOUR_RATE_HZ))
    time, points, there = contact.time[kept], contact.point[kept], contact.touching[kept]
    for above, places, radius in (("finger", points, CONTACT_M), ("skin", flat(skin, points), CONTACT_MM)):
        name = f"{path}/{above}/{contact.name}"
        to.moving_point(name, time, places, contact.colour, radius, there=there)


def skin_lines(skin: Skin) -> list[np.ndarray]:
    """Lines of constant surface coordinates, (GRID_POINTS, 3) m each."""
    ends = (skin.along, skin.across)
    fine = [np.linspace(*its, GRID_POINTS) for its in ends]
    coarse = [np.linspace(*its, GRID_LINES) for its in ends]
    lines = [skin.surface(fine[0], across) for across in coarse[1]]
    return lines + [skin.surface(along, fine[1]) for along in coarse[0]]


def send_map_path(to: Recording, path: str, time: np.ndarray, places: np.ndarray, colour: str) -> None:
    """Log a point (T, 2) mm moving on a flat picture, with its trail, in the foreground."""
    to.moving_point(f"{path}/now", time, places, colour, CONTACT_MM, draw_order=IN_FRONT)
    to.trail(f"{path}/trail", time, places, colour, -2.0, draw_order=IN_FRONT)


def send_handle(to: Recording, path: str, centre: np.ndarray, axis: np.ndarray, radius: float) -> None:
    """Log the handle, a capsule with its centre (3,) m and horizontal unit axis (3,)."""
    turned = quaternion.from_rotation_vector(0.5 * np.pi * np.cross([0.0, 0.0, 1.0], axis))
    end, size = centre - 0.5 * HANDLE_M * axis, {"lengths": [HANDLE_M], "radii": [radius]}
    pose = {"translations": [end], "quaternions": [quaternion.to_xyzw(turned)]}
    to.solid(path, rr.Capsules3D, HANDLE, 0.5, **size, **pose)


def close_view(
    name: str, contents: Sequence[str], centre: np.ndarray, finger_x: np.ndarray
) -> rrb.Spatial3DView:
    """3-D view of the skin on the handle at `centre` (3,) m, from the side and below.

    `finger_x` (3,): the finger's x axis in the base frame, roughly horizontal.
    """
    ahead = finger_x * [1.0, 1.0, 0.0]
    ahead = ahead / np.linalg.norm(ahead)
    aside = np.array([ahead[1], -ahead[0], 0.0])
    target = centre - 0.004 * ahead + np.array([0.0, 0.0, 0.006])
    backward = 0.35 * ahead + 0.9 * aside - [0.0, 0.0, 0.25]
    return eye_view(name, contents, target, EYE_M * backward / np.linalg.norm(backward))


def map_view(name: str, paths: Sequence[str], skin: Skin) -> rrb.Spatial2DView:
    """2-D view of what is logged below some paths, with the extent of the flat skin."""
    (left, right), (low, high) = (1e3 * np.array(ends) for ends in (skin.along, skin.across))
    return flat_view(
        name, paths, [left - MARGIN_MM, right + MARGIN_MM], [-high - MARGIN_MM, -low + MARGIN_MM]
    )


def tab(
    name: str, columns: Sequence[rrb.Vertical], plots: Mapping[str, str], legends: bool = False
) -> rrb.Horizontal:
    """Tab with columns of views, plots of the entities below its name, and notes."""
    drawn = [plot(heading, [below(name, group)], legends) for group, heading in plots.items()]
    beside = rrb.Vertical(*drawn, notes_view(name))
    return rrb.Horizontal(rrb.Horizontal(*columns), beside, column_shares=[1, 1], name=name)
