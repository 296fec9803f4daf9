"""Simulated people who reach past obstacles, independent of coupling terms and networks.

A reach has minimum jerk (Flash & Hogan 1985) and is slightly lifted, as over a table. Where it would come too
close to an obstacle, the person picks a side and a via point there with the least additional jerk; the path
is then deformed until the hand keeps its clearance everywhere: descent on a hinge of the obstacle's signed
distance in the metric of squared jerk (covariant descent, Ratliff et al. 2009). Trials differ in duration,
lift, end points, clearance, perceived place of the obstacle, side and motor noise; people differ in the
constants of `AvoiderParameters.between`. Functions take one person, as drawn by `individuals.drawn`.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

import structlearn
from dissertation.obstacles.world.scenarios import Scenario, SceneParameters, check_clear, reach_frame
from dissertation.simulation.individuals import Individual
from structlearn.avoidance.shapes import SHAPES, Obstacle
from structlearn.core.signals import minimum_jerk
from structlearn.readers.demonstration import Demonstration

PLAN_POINTS = 51  # points of a planned path over its normalised duration; samples are interpolated
FIXED_POINTS = 3  # at either end of a plan: the hand starts and ends at rest
SIDES = 16  # candidate directions across the reach
DETOURS_M = np.linspace(0.0, 0.5, 101)  # candidate detours on each side
DESCENT_STEPS, DESCENT_RATE, TOLERANCE_M = 200, 0.3, 5e-4  # stops when no clearance is missed by more
TIGHT = 0.9  # clearance as a share of the free space at start or goal, where that is less
NOISE_CORRELATION_S = 0.12  # std of the Gaussian that smooths motor noise; corrections take 0.1 to 0.3 s

Seconds = Annotated[float, Field(ge=0, le=10)]
Spread = Annotated[float, Field(ge=0, le=0.1)]


class AvoiderParameters(Individual):
    """The person, and the motion capture that records the hand; spreads are std over one person's trials."""

    baseline_count: int = Field(ge=1, le=1000)
    count: int = Field(ge=1, le=1000)
    seed: int = Field(ge=0)
    rate_hz: float = Field(ge=10, le=1000)
    movement_s: float = Field(ge=0.3, le=20)
    movement_cv: float = Field(ge=0, le=0.4)
    rest_s: tuple[Seconds, Seconds]
    lift_m: float = Field(ge=0, le=0.3)
    bow_spread_m: tuple[Spread, Spread]
    end_spread_m: float = Field(ge=0, le=0.05)
    clearance_m: float = Field(ge=0.01, le=0.3)
    clearance_spread: float = Field(ge=0, le=0.3)
    perception_m: float = Field(ge=0, le=0.02)
    preferred_deg: float = Field(ge=-180, le=180)
    preference_m: float = Field(ge=0, le=0.5)
    indecision_m: float = Field(ge=0, le=0.1)
    motor_noise_m: float = Field(ge=0, le=0.01)
    marker_noise_m: float = Field(ge=0, le=0.01)

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.rest_s[0] > self.rest_s[1]:
            raise ValueError("rest_s must be (low, high) with low <= high")
        return self


def demonstrations(
    scenario: Scenario | None, scene: SceneParameters, person: AvoiderParameters
) -> list[Demonstration]:
    """Reaches "01", "02", ... in one scenario, or without obstacle if it is None.

    Each depends only on the seed, the scenario and its number. Raises InputError: an obstacle contains start
    or goal, or the reach has no direction.
    """
    provenance = {
        "origin": "simulated",
        "generator": "dissertation.obstacles.world.reaching_person",
        "version": structlearn.__version__,
        "seed": str(person.seed),
        "setting": "no obstacle" if scenario is None else scenario.name,
        "orientation": "not recorded",
    }
    return [
        Demonstration(f"{number:02d}", time, position, provenance=provenance)
        for number, (time, position) in enumerate(reaches(scenario, scene, person), start=1)
    ]


def captured(
    scenario: Scenario | None, scene: SceneParameters, person: AvoiderParameters
) -> list[Demonstration]:
    """`demonstrations` of a recorded person, with time stamps in whole ns as from motion capture."""
    made = demonstrations(scenario, scene, person)
    return [replace(one, time=np.round(one.time * 1e9) * 1e-9) for one in made]


def reaches(
    scenario: Scenario | None, scene: SceneParameters, person: AvoiderParameters
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Times (T,) s and measured positions (T, 3) m in the base frame of each of the `demonstrations`."""
    count = person.baseline_count if scenario is None else person.count
    place = (0, 0) if scenario is None else (1 + SHAPES.index(scenario.shape), scenario.setting)
    seeds = [np.random.SeedSequence([person.seed, *place, number]) for number in range(count)]
    draws = [np.random.default_rng(seed) for seed in seeds]
    axes = reach_frame(scene.start, scene.goal)
    trials = np.stack([rng.standard_normal(13) for rng in draws])  # a fixed number of draws
    durations = person.movement_s * np.exp(person.movement_cv * np.clip(trials[:, 0], -2.5, 2.5))
    bow = np.array([0.0, person.lift_m]) + np.array(person.bow_spread_m) * trials[:, 11:]
    starts = scene.start + person.end_spread_m * trials[:, 1:4]
    goals = scene.goal + person.end_spread_m * trials[:, 4:7]
    plans = _undisturbed(starts, goals, bow @ axes[:, 1:].T)
    if scenario is not None:
        check_clear(scenario.obstacle, scene.start, scene.goal)
        clearance = person.clearance_m * np.exp(person.clearance_spread * trials[:, 7])
        moved = person.perception_m * trials[:, 8:11]  # perception error, applied as a shift of the hand
        chance = np.stack([rng.gumbel(size=SIDES) for rng in draws])
        seen = plans - moved[:, None]
        plans = _avoiding(seen, scenario.obstacle, clearance, axes, person, chance) + moved[:, None]
    return [
        _moved(plan, duration, rng, person)
        for plan, duration, rng in zip(plans, durations, draws, strict=True)
    ]


def _undisturbed(starts: np.ndarray, goals: np.ndarray, bow: np.ndarray) -> np.ndarray:
    """Minimum-jerk reaches (D, N, 3) from starts (D, 3) to goals (D, 3), offset by `bow` (D, 3) halfway."""
    s = np.linspace(0.0, 1.0, PLAN_POINTS)[:, None]
    arch = 64.0 * (s * (1.0 - s)) ** 3  # at rest at both ends, 1 halfway
    return starts[:, None] + (goals - starts)[:, None] * minimum_jerk(s) + bow[:, None] * arch


def _avoiding(
    paths: np.ndarray,
    solid: Obstacle,
    clearance: np.ndarray,
    axes: np.ndarray,
    person: AvoiderParameters,
    chance: np.ndarray,
) -> np.ndarray:
    """Deform paths (D, N, 3) with little jerk until they keep a clearance (D,) from the obstacle."""
    ends = solid.signed_distance(paths[:, [0, -1]]).min(axis=1)
    clearance = np.minimum(clearance, TIGHT * ends)[:, None]
    metric = jerk_metric(PLAN_POINTS)
    distance = solid.signed_distance(paths)
    closest = np.clip(distance.argmin(axis=1), FIXED_POINTS, PLAN_POINTS - FIXED_POINTS - 1)
    each = np.arange(len(paths))
    detour = _detour(paths[each, closest], solid, clearance, axes, person, chance)
    hindered = np.any(distance < clearance, axis=1)
    via = metric[closest] / metric[closest, closest][:, None]  # least jerk through the via point
    paths = paths + np.where(hindered[:, None], detour, 0.0)[:, None] * via[..., None]
    for _ in range(DESCENT_STEPS):
        distance, normal = solid.distance_and_normal(paths)
        missing = np.maximum(clearance - distance, 0.0)  # (D, N)
        worst = missing.max(axis=1)
        wanting = worst >= TOLERANCE_M  # finished paths stay, so that results do not depend on the batch
        if not wanting.any():
            break
        step = metric @ (missing[..., None] * normal)
        longest = np.linalg.norm(step, axis=-1).max(axis=1)
        rate = DESCENT_RATE * worst * wanting / np.where(wanting, longest, 1.0)
        paths = paths + rate[:, None, None] * step
    return paths


def _detour(
    points: np.ndarray,
    solid: Obstacle,
    clearance: np.ndarray,
    axes: np.ndarray,
    person: AvoiderParameters,
    chance: np.ndarray,
) -> np.ndarray:
    """Displacement (D, 3) of closest points (D, 3) to the side of least cost; `chance` (D, S) is random."""
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    sides = np.outer(np.cos(angle), axes[:, 1]) + np.outer(np.sin(angle), axes[:, 2])  # (S, 3)
    tried = points[:, None, None] + sides[:, None] * DETOURS_M[:, None]  # (D, S, M, 3)
    free = solid.signed_distance(tried) >= clearance[..., None]
    needed = DETOURS_M[np.where(free.any(axis=-1), free.argmax(axis=-1), -1)]  # (D, S)
    preference = person.preference_m * np.cos(angle - np.radians(person.preferred_deg))
    side = (needed - preference - person.indecision_m * chance).argmin(axis=1)
    return np.take_along_axis(needed, side[:, None], axis=1) * sides[side]


@lru_cache
def jerk_metric(count: int) -> np.ndarray:
    """Response (count, count) of a path at rest at both ends to a push, with the least squared jerk.

    This is the inverse of the quadratic form of squared third differences, scaled to a largest entry of 1;
    rows and columns of the `FIXED_POINTS` at either end are 0.
    """
    third = np.diff(np.eye(count), n=3, axis=0)[:, FIXED_POINTS:-FIXED_POINTS]
    metric = np.zeros((count, count))
    metric[FIXED_POINTS:-FIXED_POINTS, FIXED_POINTS:-FIXED_POINTS] = np.linalg.inv(third.T @ third)
    metric /= metric.max()
    metric.flags.writeable = False
    return metric


def _moved(
    plan: np.ndarray, duration: float, rng: np.random.Generator, person: AvoiderParameters
) -> tuple[np.ndarray, np.ndarray]:
    """Times (T,) s and measured positions (T, 3) m along one planned path (N, 3)."""
    from scipy.interpolate import CubicSpline
    from scipy.ndimage import gaussian_filter1d

    before, after = rng.uniform(*person.rest_s, size=2)
    time = np.arange(round((before + duration + after) * person.rate_hz) + 1) / person.rate_hz
    moving = np.clip((time - before) / duration, 0.0, 1.0)
    path = CubicSpline(np.linspace(0.0, 1.0, PLAN_POINTS), plan)
    speed = np.linalg.norm(path(moving, 1), axis=1, keepdims=True) * ((moving > 0) & (moving < 1))[:, None]
    width = NOISE_CORRELATION_S * person.rate_hz
    motor = gaussian_filter1d(rng.standard_normal((len(time) + 200, 3)), width, axis=0)[100:-100]
    motor *= np.sqrt(2.0 * np.sqrt(np.pi) * width)  # restores unit std
    noise = person.motor_noise_m * speed / speed.max() * motor
    return time, path(moving) + noise + person.marker_noise_m * rng.standard_normal((len(time), 3))
