"""A finger touching a handle: contact, force and counts, for many fingers at once.

The contact is analytic. The skin is a core (an axis-aligned box) inflated by its radius, and the handle an
inflated segment, so they touch where segment and core are closest. One step of a closed loop is

    position, orientation = moved(position, orientation, velocity, dt)
    contact = touching(position, orientation, handle, finger)
    signal, memory = touch(contact.load[None], contact.point[None], finger, memory)
    counts = read_out(signal[0], finger, rng)

The skin is indented by Hertz's law. Counts are those of the fingers that pinch a tool (`electrode_response`),
with hysteresis and creep of the load, but not of the contact point: an object that slides or rolls over the
skin does not stick to it.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydantic import Field

from dissertation.simulation.electrode_response import (
    PLAY_N,
    Response,
    ResponseParameters,
    crept,
    draw_response,
    lagged,
    played,
    static_counts,
)
from dissertation.simulation.individuals import Individual
from structlearn.core import quaternion
from structlearn.core.compilation import cross, numba
from structlearn.tactile.electrodes import Skin

NEWTON_STEPS = 8  # enough for the exact closest point: the derivative has at most six kinks


class TouchFingerParameters(Individual):
    """Finger parameters that depend on the object, here a handle instead of a tool's edge."""

    # std of the pressure under a point contact; wider than for an edge, since a handle is round: then
    # p = -mean(s) increases with the load everywhere on the skin
    width_mm: float = Field(gt=0)
    stiffness_n_mm: float = Field(gt=0)  # load in N at 1 mm of indentation, K in F = K d^1.5

    def with_electrodes_of(self, other: ResponseParameters) -> "FingerParameters":
        """Combine the electrodes of another finger with this one's width and stiffness, and their spreads.

        The bulge is the same in all: the more of it, the larger the part of the skin on which p falls with
        the load, and where light touches are not noticed.
        """
        names = ResponseParameters.model_fields
        shared = {name: getattr(other, name) for name in names}
        between = {
            name: spread for name, spread in other.between.items() if name in names and name != "bulge"
        }
        return FingerParameters(**shared | self.model_dump() | {"between": between | self.between})


class FingerParameters(TouchFingerParameters, ResponseParameters):
    """A touching finger with its electrodes, which differ more than `between` says of whole fingers."""


@dataclass(frozen=True)
class Handle:
    """A round bar with round ends, or a ball if its length is zero."""

    centre: np.ndarray  # (3,) m, base frame
    axis: np.ndarray  # (3,) unit, base frame
    half_length: float  # m
    radius: float  # m


@dataclass(frozen=True)
class Finger:
    """Skin, electrodes and stiffness of a finger."""

    skin: Skin  # with E electrodes
    response: Response  # of one finger
    stiffness: float  # N/m^1.5
    noise_counts: float  # std of the white noise before rounding

    def indentation(self, load: np.ndarray) -> np.ndarray:
        """Indentation (...) in m under a load (...) in N."""
        return (np.asarray(load) / self.stiffness) ** (2 / 3)


class Contact(NamedTuple):
    """Contact of B fingers with the handle."""

    point: np.ndarray  # (B, 3) m on the skin, closest to the handle, finger frame
    load: np.ndarray  # (B,) N, zero in the air
    gap: np.ndarray  # (B,) m between skin and handle, negative when indented


class Memory(NamedTuple):
    """Hidden state of B fingers between samples."""

    play: np.ndarray  # (B, K) N
    creep: np.ndarray  # (B, M) N
    lag: np.ndarray  # (B, E) counts


def make_finger(parameters: FingerParameters, skin: Skin, sensor_seed: int, rate_hz: float) -> Finger:
    """Finger with individual electrodes of the sensor with this seed, read `rate_hz` times per second."""
    rng = np.random.default_rng(sensor_seed)
    response = draw_response(parameters, 1e3 * skin.electrodes, 1, rng, rate_hz)
    return Finger(skin, response, parameters.stiffness_n_mm * 1e3**1.5, parameters.noise_counts)


def moved(
    position: np.ndarray, orientation: np.ndarray, velocity: np.ndarray, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    """Poses (B, 3) m, (B, 4) after dt s at velocities (B, 6) m/s, rad/s in the fingers' own frames."""
    step = dt * velocity
    turn = quaternion.from_rotation_vector(step[:, 3:])
    return _moved(position, orientation, step, turn)


def touching(position: np.ndarray, orientation: np.ndarray, handle: Handle, finger: Finger) -> Contact:
    """Contact of fingers at (B, 3) m, (B, 4) finger to base, with the handle.

    The squared distance between core and segment is convex in the position on the segment, and its derivative
    piecewise linear and increasing, so Newton's method ends exactly at the root.
    """
    skin = finger.skin
    on_bar = _closest(
        position, orientation, handle.centre, handle.axis, handle.half_length, skin.core_low, skin.core_high
    )
    distance = np.linalg.norm(on_bar - skin.core(on_bar), axis=1)
    gap = distance - skin.radius - handle.radius
    load = finger.stiffness * np.maximum(-gap, 0.0) ** 1.5
    return Contact(skin.project(on_bar), load, gap)


def rested(fingers: int, finger: Finger) -> Memory:
    """Memory of fingers at rest."""
    electrodes, shares = len(finger.skin.electrodes), len(finger.response.creep)
    return Memory(
        np.zeros((fingers, len(PLAY_N))), np.zeros((fingers, shares)), np.zeros((fingers, electrodes))
    )


def touch(load: np.ndarray, point: np.ndarray, finger: Finger, memory: Memory) -> tuple[np.ndarray, Memory]:
    """Counts (T, B, E) before noise, and the memory after them.

    `load` (T, B) N; `point` (T, B, 3) m on the skin, finger frame; `memory` is not changed.
    """
    after = Memory(*(values.copy() for values in memory))
    return _touch(load, 1e3 * point, finger.response, PLAY_N, after), after


def read_out(signal: np.ndarray, finger: Finger, rng: np.random.Generator) -> np.ndarray:
    """Rounded counts with noise, (..., E) -> (..., E)."""
    return np.rint(signal + finger.noise_counts * rng.standard_normal(signal.shape))


_product = numba.njit(cache=True)(quaternion.product_components)


@numba.njit(cache=True)
def _rotated(q: np.ndarray | tuple, vector: np.ndarray) -> tuple:
    """Rotate a vector by a unit quaternion."""
    axis = (q[1], q[2], q[3])
    once = cross(axis, vector)
    twice = cross(axis, once)
    return (
        vector[0] + 2.0 * (q[0] * once[0] + twice[0]),
        vector[1] + 2.0 * (q[0] * once[1] + twice[1]),
        vector[2] + 2.0 * (q[0] * once[2] + twice[2]),
    )


@numba.njit(cache=True)
def _moved(
    position: np.ndarray, orientation: np.ndarray, step: np.ndarray, turn: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Poses (B, 3), (B, 4) after steps (B, 6), whose rotations are the quaternions `turn` (B, 4)."""
    places, turned = np.empty_like(position), np.empty_like(orientation)
    for b in range(len(position)):
        shift = _rotated(orientation[b], step[b])
        for i in range(3):
            places[b, i] = position[b, i] + shift[i]
        q = _product(orientation[b], turn[b])
        size = np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
        for i in range(4):
            turned[b, i] = q[i] / size
    return places, turned


@numba.njit(cache=True)
def _closest(
    position: np.ndarray,
    orientation: np.ndarray,
    centre: np.ndarray,
    axis: np.ndarray,
    half_length: float,
    low: np.ndarray,
    high: np.ndarray,
) -> np.ndarray:
    """Points (B, 3) m of a handle closest to the box from `low` to `high`, in the frames of the fingers."""
    closest = np.empty_like(position)
    for b in range(len(position)):
        back = (orientation[b, 0], -orientation[b, 1], -orientation[b, 2], -orientation[b, 3])
        middle = _rotated(back, centre - position[b])
        along = _rotated(back, axis)
        place = 0.0
        for _ in range(NEWTON_STEPS if half_length > 0 else 0):
            rise = slope = 0.0
            for i in range(3):
                on_bar = middle[i] + place * along[i]
                outwards = on_bar - min(max(on_bar, low[i]), high[i])
                if outwards != 0.0:
                    rise += outwards * along[i]
                    slope += along[i] ** 2
            if slope > 0.0:
                place = min(max(place - rise / slope, -half_length), half_length)
        for i in range(3):
            closest[b, i] = middle[i] + place * along[i]
    return closest


@numba.njit(cache=True)
def _touch(
    load: np.ndarray, point: np.ndarray, response: Response, play: np.ndarray, memory: Memory
) -> np.ndarray:
    """Counts (T, B, E) at points in mm; updates `memory`."""
    counts = np.empty((*load.shape, len(response.electrodes)))
    for t in range(load.shape[0]):
        for b in range(load.shape[1]):
            pressed = played(load[t, b], play, response.hysteresis, memory.play[b])
            pressed = crept(pressed, response.creep, response.creep_keep, True, memory.creep[b])
            signal = static_counts(pressed, point[t, b], 0, response)
            lagged(signal, response.lag_keep, True, memory.lag[b])
            for electrode in range(len(signal)):
                counts[t, b, electrode] = memory.lag[b, electrode] + response.offset[0, electrode]
    return counts
