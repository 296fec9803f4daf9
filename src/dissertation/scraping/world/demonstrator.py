"""Simulated person who demonstrates the nominal scraping task: intended movements of the hand (IV.9).

Go down 8.7 cm until the tool touches the board, turn the tool until its edge lies flat, scrape 6.4 cm along
y. Movements follow published facts of human movement (the constants below). In the physical simulation the
person guides the robot's arm along them (`testbed`); `as_meant` records them as intended, without arm and
board, for sweeps over thousands of demonstrations. People differ in their submovements, drawn here, and in
the constants of `DemonstratorParameters.between`; functions take one person, as drawn by `individuals.drawn`.

Each demonstration has three independent random streams (movement, noise, run) and a fixed number of draws
from the first, so sweeps are controlled: another `noise_mm` scales the noise but keeps the movement and its
true cut points; other pauses only change the gaps between the same primitives.
"""

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

import structlearn
from dissertation.scraping.world.layout import CONTACT_M, FLAT_ORIENTATION
from dissertation.simulation.hand_noise import hand_noise
from dissertation.simulation.individuals import Individual
from structlearn.core import quaternion
from structlearn.core.signals import minimum_jerk
from structlearn.readers.demonstration import Recording, Stream

# Task: lengths as in the recorded scraping, 8.7 cm down and 6.4 cm along y
DOWN_M = np.array([0.0, 0.0, -0.087])
FORWARD_M = np.array([0.0, 0.064, 0.0])
TILT_DEG = np.array([3.0, -3.5, 0.0])  # pitch, roll, yaw about x, y, z to correct; recorded: 3-4 degrees

# Time: the std of timed intervals is about proportional to them (Gibbon 1977; Lewis & Miall 2009).
SHARED_TEMPO = 0.5  # share of the log-duration variance common to the movements of one trial
# Slow movements fluctuate at a constant rate, in proportion to their speed (Guigon et al. 2019).
INTERMITTENCY_HZ = (1.5, 3.5)
INTERMITTENCY = 0.12  # std of the factor on the speed
# Aimed movements have a primary submovement and an overlapping homing-in (Woodworth 1899; Meyer et al. 1988),
# each of minimum jerk (Flash & Hogan 1985). Ranges as fractions of distance and duration; the recorded
# descent has two bumps of speed in about this proportion.
PRIMARY_DISTANCE = (0.60, 0.85)
PRIMARY_DURATION = (0.55, 0.75)
SECONDARY_ONSET = (0.30, 0.50)
# A person repeats a movement with nearly the same submovements. With this share of the ranges varying by
# trial and the rest by person, trials differ in timing by 2-6 % of the duration; in the public recording of
# 97 repeated reaches by 3-4 % (std of the normalised times at which 10 to 90 % of the way are done).
TRIAL_SHARE = 0.4
# Slow hands also halt without cause (van der Wel et al. 2009; Park et al. 2017).
HESITATION_S = (0.08, 0.20)  # std of a Gaussian dip of the speed; with the depth it sets the time lost
# A minimum-jerk movement has no visible first instant: onset and end are where its speed passes 5 % of its
# peak, the usual criterion in studies of reaching.
ONSET_SPEED = 0.05
SLOWEST = 0.02  # lower limit of the speed factor, so that time never runs backwards

# Space: end points scatter by a few per cent of the distance (van Beers et al. 2004); recorded: 0.5-1 mm.
GOAL_SPREAD_M = np.array([0.0010, 0.0015, 0.0002])  # the board fixes z
GOAL_SPREAD_DEG = 0.4  # std of what a person takes for flat; recorded: 0.2-0.5 degrees
BOW_M = np.array([[2.0, 2.0, 0.0], [0.8, 0.8, 0.0], [1.0, 0.0, 0.0]]) * 1e-3  # std of the paths' curvature
BOARD_TAKES_OVER_S = 0.25  # from first touch until the board suppresses the hand's noise along z
EPOCH_NS = 1_577_836_800_000_000_000  # 2020-01-01, an arbitrary fixed start of the recorder's clock
BETWEEN_STARTS_NS = 60_000_000_000
GRID_HZ = 1000.0  # sampling of time warps
RATE_HZ = 300.0  # of intended movements without arm: that of the recorded robot

Seconds = Annotated[float, Field(ge=0, le=10)]
MovementSeconds = Annotated[float, Field(ge=0.5, le=20)]


class DemonstratorParameters(Individual):
    """The demonstrating person; spreads are std over one person's trials."""

    count: int = Field(ge=1, le=1000)
    seed: int = Field(ge=0)
    durations_s: tuple[MovementSeconds, MovementSeconds, MovementSeconds]
    duration_cv: float = Field(ge=0, le=0.4)
    rest_s: tuple[Seconds, Seconds]
    pause_s: tuple[Seconds, Seconds]
    hesitation_probability: float = Field(ge=0, le=1)
    hesitation_depth: float = Field(ge=0, le=0.95)
    start_spread_mm: float = Field(ge=0, le=20)
    start_spread_deg: float = Field(ge=0, le=10)
    noise_mm: float = Field(ge=0, le=20)

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for name in ("rest_s", "pause_s"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name} must be (low, high) with low <= high")
        return self


@dataclass(frozen=True)
class Intention:
    """Intended movement of the hand in one demonstration."""

    name: str  # "01", "02", ...
    time: np.ndarray  # (T,) s
    edge: np.ndarray  # (T, 3) m, path of the edge frame in the base frame, without noise
    tilt: np.ndarray  # (T, 3) rad, rotation vector from flat in the base frame, without noise
    edge_noise: np.ndarray  # (T, 3) m
    tilt_noise: np.ndarray  # (T, 3) rad
    segments: np.ndarray  # (3, 2) s, start and end of descent (ends at contact), turn and scrape
    run: np.random.SeedSequence  # for all randomness of the run itself: sensors, board, pressure


def intended_movements(person: DemonstratorParameters, rate_hz: float = RATE_HZ) -> list[Intention]:
    """Intended movements of one simulated person, one per demonstration."""
    own, *seeds = np.random.SeedSequence(person.seed).spawn(person.count + 1)
    habits = _draw_shapes(np.random.default_rng(own), (3, 2))
    return [_intention(index, seed, person, habits, rate_hz) for index, seed in enumerate(seeds)]


def as_meant(movement: Intention, seed: int) -> Recording:
    """Recording of an intended movement with the hand's noise; `seed` is the person's."""
    orientation = orientation_of(movement.tilt + movement.tilt_noise)
    pose = np.hstack([movement.edge + movement.edge_noise, orientation])
    stamps = first_stamp(int(movement.name) - 1) + np.round(movement.time * 1e9).astype(np.int64)
    provenance = {
        "origin": "simulated",
        "generator": "dissertation.scraping.world.demonstrator",
        "version": structlearn.__version__,
        "seed": str(seed),
        "setting": "board roll 0 degrees, movement as meant",
    }
    return Recording(
        movement.name, (Stream("/hand/pose", "pose", stamps, pose),), movement.segments, provenance
    )


def first_stamp(index: int) -> int:
    """Time stamp in ns at which the recorder starts demonstration `index`."""
    return EPOCH_NS + index * BETWEEN_STARTS_NS


def orientation_of(tilt: np.ndarray) -> np.ndarray:
    """Orientation (T, 4) of the edge frame for rotation vectors from flat (T, 3) in rad."""
    return quaternion.product(quaternion.from_rotation_vector(tilt), FLAT_ORIENTATION)


def _intention(
    index: int,
    seed: np.random.SeedSequence,
    parameters: DemonstratorParameters,
    habits: np.ndarray,
    rate_hz: float,
) -> Intention:
    """One trial; roll and pitch have submovements of their own, as if turned one after the other."""
    movement, noise, run = seed.spawn(3)
    movement_rng, noise_rng = np.random.default_rng(movement), np.random.default_rng(noise)
    movements, end = _draw_movements(parameters, habits, movement_rng)
    edges, tilts, bows = _draw_places(parameters, movement_rng)
    time = np.arange(int(end * rate_hz) + 1) / rate_hz
    edge, tilt = np.tile(edges[0], (len(time), 1)), np.tile(tilts[0], (len(time), 1))
    ways, turns = np.diff(edges, axis=0), np.diff(tilts, axis=0)
    for one, way, turn, bow in zip(movements, ways, turns, bows, strict=True):
        first, second = one.progress(time)[..., None]  # (T, 1) each
        edge += first * way + 16 * first**2 * (1 - first) ** 2 * bow  # curved most half-way
        tilt += np.hstack([first, second, first]) * turn
    (onset, contact), _, (scrape, last) = (one.visible for one in movements)
    segments = np.array([[onset, contact], [contact, scrape], [scrape, last]])
    on_board = np.interp(time, contact + np.array([0.0, BOARD_TAKES_OVER_S]), [0.0, 1.0])
    velocity = np.gradient(edge, 1 / rate_hz, axis=0)
    edge_noise, tilt_noise = hand_noise(velocity, on_board, parameters.noise_mm, rate_hz, noise_rng)
    return Intention(f"{index + 1:02d}", time, edge, tilt, edge_noise, tilt_noise, segments, run)


@dataclass(frozen=True)
class _Movement:
    """One planned movement: timing, time warp and submovement shapes of its two coordinates."""

    onset: float  # s
    duration: float  # s, including hesitation
    grid: np.ndarray  # (N,) s since the onset
    phase: np.ndarray  # (N,) 0 -> 1, warped time
    shapes: np.ndarray  # (2, 3) primary distance, primary duration, secondary onset; one row per coordinate

    @property
    def visible(self) -> tuple[float, float]:
        """First and last time in s at which the noise-free speed is at least `ONSET_SPEED` of its peak."""
        speed = np.gradient(self.progress(self.onset + self.grid)[0], self.grid)
        moving = self.grid[speed >= ONSET_SPEED * speed.max()]
        return self.onset + float(moving[0]), self.onset + float(moving[-1])

    def progress(self, time: np.ndarray) -> np.ndarray:
        """Progress of both coordinates, from 0 at the onset to 1 at the end: (T,) s -> (2, T)."""
        phase = np.interp(time - self.onset, self.grid, self.phase)
        share, primary, secondary = self.shapes.T[..., None]  # (2, 1) each
        first = np.clip(phase / primary, 0.0, 1.0)
        second = np.clip((phase - secondary) / (1 - secondary), 0.0, 1.0)
        return share * minimum_jerk(first) + (1 - share) * minimum_jerk(second)


def _draw_movements(
    parameters: DemonstratorParameters, habits: np.ndarray, rng: np.random.Generator
) -> tuple[list[_Movement], float]:
    """One movement per primitive, and the end of the trial in s.

    The random draws do not depend on the parameters' values; only their scaling does.
    """
    tempo = rng.standard_normal()
    now = rng.uniform(*parameters.rest_s)
    movements = []
    for median, habit in zip(parameters.durations_s, habits, strict=True):
        own = rng.standard_normal()
        scatter = np.sqrt(SHARED_TEMPO) * tempo + np.sqrt(1 - SHARED_TEMPO) * own
        duration = median * np.exp(parameters.duration_cv * np.clip(scatter, -2.5, 2.5))
        movements.append(_draw_movement(now, duration, habit, parameters, rng))
        now += movements[-1].duration + rng.uniform(*parameters.pause_s)
    return movements, movements[-1].onset + movements[-1].duration + rng.uniform(*parameters.rest_s)


def _draw_places(
    parameters: DemonstratorParameters, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edge (4, 3) m and rotation from flat (4, 3) rad at start, contact, flat and end; bows (3, 3) m."""
    start = CONTACT_M - DOWN_M + 1e-3 * parameters.start_spread_mm * rng.standard_normal(3)
    landing = CONTACT_M + GOAL_SPREAD_M * rng.standard_normal(3)
    flat = landing + GOAL_SPREAD_M / 3 * rng.standard_normal(3)  # the edge slips slightly while turning
    finish = flat + FORWARD_M + GOAL_SPREAD_M * rng.standard_normal(3)
    held = TILT_DEG + parameters.start_spread_deg * rng.standard_normal(3)  # no correction before the contact
    drift = 0.5 * parameters.start_spread_deg * rng.standard_normal(3)
    tilts = np.stack([held, held + drift, *(GOAL_SPREAD_DEG * rng.standard_normal((2, 3)))])
    return np.stack([start, landing, flat, finish]), np.radians(tilts), BOW_M * rng.standard_normal((3, 3))


def _draw_shapes(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Draw submovement shapes (*shape, 3): fractions of primary distance and duration, secondary onset."""
    low, high = np.array([PRIMARY_DISTANCE, PRIMARY_DURATION, SECONDARY_ONSET]).T
    return rng.uniform(low, high, (*shape, 3))


def _draw_movement(
    onset: float,
    duration: float,
    habit: np.ndarray,
    parameters: DemonstratorParameters,
    rng: np.random.Generator,
) -> _Movement:
    """Draw one movement: submovement shapes near the person's habit, and warped time."""
    shapes = (1 - TRIAL_SHARE) * habit + TRIAL_SHARE * _draw_shapes(rng, (2,))
    hesitates = rng.random() < parameters.hesitation_probability
    centre, width = rng.uniform(0.25, 0.75), rng.uniform(*HESITATION_S)  # fraction of the duration; s
    depth = hesitates * parameters.hesitation_depth * rng.uniform(0.5, 1.0)
    frequencies, angles = rng.uniform(*INTERMITTENCY_HZ, 4), rng.uniform(0, 2 * np.pi, 4)

    duration += depth * width * np.sqrt(2 * np.pi)  # the dip costs time; the rest keeps its speed
    grid = np.linspace(0.0, duration, int(duration * GRID_HZ) + 2)
    waves = np.cos(2 * np.pi * np.outer(frequencies, grid) + angles[:, None]).sum(0)  # variance 4 / 2
    dip = depth * np.exp(-0.5 * ((grid - centre * duration) / width) ** 2)
    rate = np.maximum((1 + INTERMITTENCY * waves / np.sqrt(2)) * (1 - dip), SLOWEST)
    phase = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))])
    return _Movement(onset, duration, grid, phase / phase[-1], shapes)
