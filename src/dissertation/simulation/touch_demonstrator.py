"""Simulated demonstrations of touch: a person guides a finger over a handle (dissertation II.4.1.1).

Two parts, each over several areas of the skin. Rotation: touch, rotate about the finger's x axis, lift,
touch, rotate back, lift. Translation: touch, swipe forwards along x, lift, touch, swipe backwards, lift, and
the same once more. A person's force differs between contacts and varies during each; people differ in pace,
force, steadiness and tilt, and their sensors too (`person_with_sensor`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Annotated, Literal, TypeVar

import numpy as np
import pandas as pd
from pydantic import Field

import structlearn
from dissertation.simulation.hand_noise import hand_noise
from dissertation.simulation.individuals import Individual, drawn
from dissertation.simulation.touch import (
    Finger,
    FingerParameters,
    Handle,
    make_finger,
    read_out,
    rested,
    touch,
    touching,
)
from structlearn.core import quaternion
from structlearn.core.signals import minimum_jerk
from structlearn.readers.demonstration import Recording, Stream
from structlearn.tactile.electrodes import SKINS, Skin

Motion = Literal["rotation", "translation"]
Swept = TypeVar("Swept", float, np.ndarray)
SLIDES: dict[Motion, tuple[int, ...]] = {"rotation": (1, -1), "translation": (1, -1, 1, -1)}
"""Direction of each contact in a demonstration."""

SAMPLED_EVERY = 3  # robot ticks per sample of the electrodes: 100 Hz at 300 Hz
APPROACH_S, PRESS_S = 0.5, 0.35  # durations of approach and of pressing; the same for release and retreat
WAVER_S = 0.25  # width of the Gaussian that smooths the held force; chosen: it varies below 1 Hz
AREA_SPREAD_MM = 0.7  # std of a contact's start within its area; chosen so that areas adjoin
DRIFT_MM = 0.4  # std per second of a contact's sideways drift; chosen: hands do not follow straight lines
RISE_MM = 8.0  # height of the finger above the handle in the air, clear of it despite the hand's sway
STAMP_JITTER_S = 2e-4  # std of the electrodes' time stamps, which come from their own clock
TRUTH = ("trial", "time_s", "x_m", "y_m", "z_m", "load_n")  # columns of `true_contacts`
CLOCK_START_NS = 10**9  # time stamp of the first sample


class ToucherParameters(Individual):
    """A person demonstrating touch; the median gives about as many samples as the dissertation has."""

    skin: Literal["biotac", "flat_pad", "sphere"]
    seed: int = Field(ge=0)
    sensor_seed: int = Field(ge=0)
    areas: int = Field(ge=1)
    rotations: int = Field(ge=0)
    translations: int = Field(ge=0)
    rate_hz: float = Field(ge=30, le=3000)
    along_mm: tuple[float, float]
    across_deg: float = Field(ge=0, le=80)
    durations_s: tuple[Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]]
    time_cv: float = Field(ge=0)
    load_n: tuple[float, float]
    waver: float = Field(ge=0)
    tilt_deg: float = Field(ge=0)
    rest_s: tuple[float, float]
    noise_mm: float = Field(ge=0)
    handle_radius_mm: float = Field(gt=0)
    handle_half_mm: float = Field(ge=0)


@dataclass(frozen=True)
class TouchRun:
    """A demonstration with its true contacts, over T robot ticks and S electrode samples."""

    name: str
    motion: Motion
    position: np.ndarray  # (T, 3) m, finger in the base frame
    orientation: np.ndarray  # (T, 4) finger to base
    counts: np.ndarray  # (S, E) whole counts
    contact_point: np.ndarray  # (S, 3) m, point of the skin closest to the handle, finger frame
    load: np.ndarray  # (S,) N


def person_with_sensor(
    people: ToucherParameters, fingers: FingerParameters
) -> tuple[ToucherParameters, FingerParameters]:
    """The person and the sensor with the seeds of `people`, drawn from both populations."""
    return drawn(people, people.seed), drawn(fingers, people.sensor_seed)


def demonstrate(person: ToucherParameters, parameters: FingerParameters) -> Iterator[TouchRun]:
    """All demonstrations of one person with one sensor: rotations first, ordered by area."""
    finger = make_finger(parameters, SKINS[person.skin], person.sensor_seed, person.rate_hz / SAMPLED_EVERY)
    for kind, (motion, repeats) in enumerate(
        zip(SLIDES, (person.rotations, person.translations), strict=True)
    ):
        for area, repeat in product(range(person.areas), range(repeats)):
            rng = np.random.default_rng((person.seed, kind, area, repeat))
            name = f"{motion}_{area + 1}_{repeat + 1}"
            yield _demonstration(name, motion, (area + 0.5) / person.areas, finger, person, rng)


def recorded(run: TouchRun, person: ToucherParameters) -> Recording:
    """Recording of a demonstration: poses at the robot's rate, electrodes slower."""
    rng = np.random.default_rng((person.seed, len(run.position)))
    ticks = CLOCK_START_NS + np.round(np.arange(len(run.position)) * 1e9 / person.rate_hz).astype(np.int64)
    step = 1 / person.rate_hz
    jitter = np.clip(STAMP_JITTER_S * rng.standard_normal(len(run.counts)), -step, step)
    jitter[[0, -1]] = 0.0
    sampled = ticks[::SAMPLED_EVERY] + np.round(1e9 * jitter).astype(np.int64)
    origin = {
        "origin": "simulated",
        "generator": "dissertation.simulation.touch_demonstrator",
        "version": structlearn.__version__,
        "seed": f"{person.seed}, {run.name}",
        "skin": person.skin,
        "motion": run.motion,
    }
    streams = (
        Stream("/finger/pose", "pose", ticks, np.hstack([run.position, run.orientation])),
        Stream("/finger/electrodes", "tactile", sampled, run.counts),
    )
    return Recording(run.name, streams, None, origin)


def true_contacts(run: TouchRun, person: ToucherParameters) -> pd.DataFrame:
    """True contacts: `trial`, `time_s`, `x_m`, `y_m`, `z_m` in the finger frame, `load_n`."""
    time = np.arange(len(run.load)) * SAMPLED_EVERY / person.rate_hz
    numbers = np.column_stack([time, run.contact_point, run.load]).astype(np.float32)
    columns = (np.full(len(time), run.name), *numbers.T)
    return pd.DataFrame(dict(zip(TRUTH, columns, strict=True)))


def covered(person: ToucherParameters, skin: Skin) -> tuple[tuple[float, float], tuple[float, float]]:
    """Demonstrated ranges of the surface coordinates along and across the finger, m."""
    low, high = 1e-3 * np.array(person.along_mm)
    turn = np.radians(person.across_deg) * skin.radius
    return (low, high), (skin.core_low[1] - turn, skin.core_high[1] + turn)


def held_on_handle(
    along: np.ndarray,
    across: np.ndarray,
    load: np.ndarray,
    handle: Handle,
    finger: Finger,
    tilt: tuple[float | np.ndarray, float | np.ndarray] = (0.0, 0.0),
) -> tuple[np.ndarray, np.ndarray]:
    """Poses (B, 3) m, (B, 4) at which a finger lies across a horizontal handle, touching given skin points.

    `along`, `across` (B,) m: surface coordinates of the points (`Skin.surface`); `load` (B,) N; `tilt`: pitch
    about the handle and yaw about the vertical in rad, () or (B,) each. Tilted by both, the finger touches
    beside these points by the product of both angles.
    """
    skin = finger.skin
    point = skin.surface(along, across)
    normal = skin.normal(point)
    roll = -np.arctan2(normal[:, 1], -normal[:, 2])
    zero = np.zeros_like(roll)
    rolled = quaternion.from_rotation_vector(np.stack([roll, zero, zero], axis=1))
    heading = np.arctan2(handle.axis[1], handle.axis[0]) - 0.5 * np.pi
    pitch, yaw = (
        quaternion.from_rotation_vector(np.multiply.outer(turn, axis))
        for turn, axis in ((tilt[0], [0, 1, 0]), (heading + tilt[1], [0, 0, 1]))
    )
    orientation = quaternion.product(quaternion.product(yaw, pitch), rolled)
    reach = skin.core(point) + (skin.radius + handle.radius - finger.indentation(load))[:, None] * normal
    return handle.centre - quaternion.rotate(orientation, reach), orientation


def _demonstration(
    name: str,
    motion: Motion,
    area: float,
    finger: Finger,
    person: ToucherParameters,
    rng: np.random.Generator,
) -> TouchRun:
    heading = rng.uniform(-0.5, 0.5)
    handle = Handle(
        centre=np.array([0.5, 0.1, 0.9]) + 0.05 * rng.standard_normal(3),
        axis=np.array([-np.sin(heading), np.cos(heading), 0.0]),
        half_length=1e-3 * person.handle_half_mm,
        radius=1e-3 * person.handle_radius_mm,
    )
    parts = [_contact(motion, direction, area, handle, finger, person, rng) for direction in SLIDES[motion]]
    along, across, load, height = (np.concatenate(column) for column in zip(*parts, strict=True))
    tilt = np.radians(person.tilt_deg) * rng.standard_normal(2)
    position, orientation = held_on_handle(along, across, load, handle, finger, (tilt[0], tilt[1]))
    position = position + height[:, None] * [0.0, 0.0, 1.0]
    position, orientation = _held_by_hand(position, orientation, load > 0, person, rng)
    contact = touching(position[::SAMPLED_EVERY], orientation[::SAMPLED_EVERY], handle, finger)
    signal, _ = touch(contact.load[:, None], contact.point[:, None], finger, rested(1, finger))
    counts = read_out(signal[:, 0], finger, rng)
    return TouchRun(name, motion, position, orientation, counts, contact.point, contact.load)


def _contact(
    motion: Motion,
    direction: int,
    area: float,
    handle: Handle,
    finger: Finger,
    person: ToucherParameters,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """One contact from air to air: along m, across m, load N and height above the handle m, (T,) each."""
    rate, skin = person.rate_hz, finger.skin
    median = dict(zip(SLIDES, person.durations_s, strict=True))[motion]
    slide = round(rate * max(median * np.exp(person.time_cv * rng.standard_normal()) - 2 * PRESS_S, 0.5))
    press, approach = round(rate * PRESS_S), round(rate * APPROACH_S)
    rest = [round(rate * rng.uniform(*person.rest_s)) for _ in range(2)]
    before, after = rest[0] + approach, approach + rest[1]
    total = before + press + slide + press + after
    rising, pressing = (minimum_jerk(np.arange(count) / count) for count in (approach, press))
    contact = np.zeros(2 * press + slide)
    away = np.concatenate([np.ones(rest[0]), 1 - rising, contact, rising, np.ones(rest[1])])
    pressed = np.concatenate([np.zeros(before), pressing, np.ones(slide), 1 - pressing, np.zeros(after)])
    way = np.concatenate([np.zeros(before + press), _steady(slide), np.ones(press + after)])
    waver = 1 + person.waver * _smooth_noise(total, WAVER_S * rate, rng)
    load = rng.uniform(*person.load_n) * pressed * np.maximum(waver, 0.2)
    sideways = 1e-3 * (
        AREA_SPREAD_MM * rng.standard_normal()
        + DRIFT_MM * (rng.standard_normal() * way * slide / rate + _smooth_noise(total, rate, rng))
    )
    (low, high), (left, right) = covered(person, skin)
    swept = (1 - way if direction < 0 else way) * 2 - 1  # -1 to 1 or back
    if motion == "rotation":
        along, across = low + area * (high - low) + sideways, _between(left, right, swept)
    else:
        along, across = _between(low, high, swept), _between(left, right, 2 * area - 1) + sideways
    return along, across, load, 1e-3 * RISE_MM * away


def _held_by_hand(
    position: np.ndarray,
    orientation: np.ndarray,
    contact: np.ndarray,
    person: ToucherParameters,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Add a hand's sway, motor noise and tremor to the intended path."""
    velocity = np.gradient(position, 1 / person.rate_hz, axis=0)
    off, turned = hand_noise(velocity, contact.astype(float), person.noise_mm, person.rate_hz, rng)
    held = quaternion.product(quaternion.from_rotation_vector(turned), orientation)
    return position + off, quaternion.sign_continuous(held)


def _between(low: float, high: float, swept: Swept) -> Swept:
    """Position of a sweep from -1, the low end, to 1."""
    return 0.5 * (low + high) + 0.5 * (high - low) * swept


def _steady(samples: int) -> np.ndarray:
    """Fraction of the way (samples,), at constant speed with ramps at both ends."""
    edge = max(samples // 5, 1)
    speed = np.minimum(1.0, np.minimum(np.arange(1, samples + 1), np.arange(samples, 0, -1)) / edge)
    return np.cumsum(speed) / speed.sum()


def _smooth_noise(samples: int, width: float, rng: np.random.Generator) -> np.ndarray:
    """Gaussian noise (samples,) of unit variance, smooth over `width` samples."""
    from scipy.ndimage import gaussian_filter1d

    noise = gaussian_filter1d(rng.standard_normal(samples + 8 * round(width)), width)[4 * round(width) :]
    return noise[:samples] * np.sqrt(2 * np.sqrt(np.pi) * width)
