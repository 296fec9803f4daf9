"""Rhythmic movements: the forcing term of an oscillator with phase and amplitude (Ijspeert et al. 2013).

    f(c) = r sum_i w_i(c) psi_i(2 pi c) / sum_j psi_j(2 pi c)        psi_i(x) = exp(h (cos(x - x_i) - 1))
    w_i(c) = w_i + starting(c) w'_i + stopping(c) w''_i

over c, the cycles since the cycle's phase was 0. A hand that begins and ends at rest moves otherwise in its
first and last half cycle than between: w' and w'' are learned from these, w from all. At rest itself they are
not learned but such that the hand rests where the cycle passes, at any phase, so that starting and stopping
do not shift the baseline. The transformation system is that of discrete primitives with the period as time
constant, linear in the forcing term, so its exact step serves. What is driven is the distance from a baseline
from the start of the movement to its goal; forcing terms vanish at both ends, where the hand rests on it.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from structlearn.core import signals
from structlearn.primitives import canonical
from structlearn.primitives.kernels import OVERLAP
from structlearn.primitives.transformation import ALPHA, BETA

PARTS = 3  # weights per kernel: of the cycle, of starting, and of stopping
TRANSIENT = 0.5  # cycles that starting and stopping take
RESTING = 0.1  # cycles in which they fade, since at rest the hand is where the cycle passes
FINE = 16  # samples per kernel of a path that repeats
RIDGE = (1e-8, 1e-4)
"""Ridge on the weights of the cycle and of its transients, relative to the mean diagonal of the normal
equations: what the cycle explains is not explained by starting or stopping."""


class Rhythm(NamedTuple):
    """Where in its cycle a movement starts, and how many cycles it makes; a stroke is half of one."""

    first: float
    cycles: float


def features(elapsed: np.ndarray, rhythm: Rhythm, count: int) -> np.ndarray:
    """Features (T, 3 N + 1) of the forcing term, of which the last drives the baseline (`with_baseline`).

    `elapsed`: (T,) cycles since the start; beyond the last cycle, forcing terms are 0. `count`: N kernels.
    """
    driven, (first, last) = _kernels(elapsed, rhythm, count), _kernels(np.array([0.0, np.inf]), rhythm, count)
    left = 1.0 - np.minimum(elapsed / rhythm.cycles, 1.0)[:, None]  # of the way from start to goal
    return np.hstack([driven - left * first - (1.0 - left) * last, ALPHA * BETA * left])


def _kernels(elapsed: np.ndarray, rhythm: Rhythm, count: int) -> np.ndarray:
    """(T, 3 N) features of the cycle, and those of starting and of stopping."""
    elapsed = np.minimum(elapsed, rhythm.cycles)
    psi = _activations(rhythm.first + elapsed, count)
    away = np.stack([elapsed, rhythm.cycles - elapsed])[:, :, None]  # from the start, and from the end
    starting, stopping = 1.0 - signals.minimum_jerk(np.minimum(away / TRANSIENT, 1.0))
    moving = signals.minimum_jerk(np.minimum(away / RESTING, 1.0))
    cycle = psi + (starting + stopping) * (psi @ _to_rest(count))
    return np.hstack([cycle, psi * starting * moving[0], psi * stopping * moving[1]])


def _activations(cycles: np.ndarray, count: int) -> np.ndarray:
    """(T, N) activations of the kernels, which sum up to 1."""
    centres, width = np.arange(count) / count, (count / (2.0 * np.pi * OVERLAP)) ** 2
    psi = np.exp(width * (np.cos(2.0 * np.pi * np.subtract.outer(cycles, centres)) - 1.0))
    return psi / psi.sum(axis=1, keepdims=True)


@lru_cache
def _to_rest(count: int) -> np.ndarray:
    """(N, N) changes of the weights with which the hand rests where the cycle passes.

    A forcing term that repeats drives a path that repeats, by the transfer function of the transformation
    system.
    """
    fine = FINE * count
    spectrum = np.fft.rfft(_activations(np.arange(fine) / fine, count), axis=0)
    rate = 2j * np.pi * np.arange(len(spectrum))[:, None]
    passed = np.fft.irfft(spectrum / (rate**2 + ALPHA * rate + ALPHA * BETA), fine, axis=0)[::FINE]
    at_centres = _activations(np.arange(count) / count, count)
    return ALPHA * BETA * np.linalg.solve(at_centres, passed) - np.eye(count)


def phase(elapsed: np.ndarray, rhythm: Rhythm) -> tuple[np.ndarray, np.ndarray]:
    """Phase p (1 -> 0) and phase velocity u (T,) of `canonical.phase`, anew in each cycle; u is 0 at the end.

    `elapsed`: (T,) cycles since the start. Feedback and expected traces of a cycle are over this phase.
    """
    p, u = canonical.phase((rhythm.first + elapsed) % 1.0, canonical.TAU_PER_DURATION)
    return p, np.where(elapsed < rhythm.cycles, u, 0.0)


def with_baseline(weights: np.ndarray, start: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Weights (..., 3 N + 1, D) of all `features`, for a movement from `start` (..., D) to `goal`."""
    way = np.subtract(start, goal)[..., None, :]
    shape = np.broadcast_shapes(weights.shape[:-2], way.shape[:-2])
    return np.concatenate([np.broadcast_to(part, (*shape, *part.shape[-2:])) for part in (weights, way)], -2)


def rests(weights: np.ndarray, rhythm: Rhythm) -> np.ndarray:
    """Distance (2, D) from the baseline at which a movement with weights (3 N, D) starts and ends at rest."""
    return _kernels(np.array([0.0, np.inf]), rhythm, len(weights) // PARTS) @ weights / (ALPHA * BETA)


def repeated(
    weights: np.ndarray,
    way: np.ndarray,
    learned: Rhythm,
    rhythm: Rhythm,
    amplitude: float = 1.0,
) -> np.ndarray:
    """Goal minus start (D,) with another rhythm and amplitude; the baseline drifts as much in each cycle.

    `way`: (D,) goal minus start of the rhythm that was `learned`, with weights (3 N, D).
    """
    before, after = (np.diff(rests(weights, each), axis=0)[0] for each in (learned, rhythm))
    return amplitude * after + (way - before) * rhythm.cycles / learned.cycles


def fitted(rows: Sequence[np.ndarray], targets: Sequence[np.ndarray], amplitudes: np.ndarray) -> np.ndarray:
    """Weights (3 N, D) by least squares.

    `rows`: (T_l, 3 N + 1) `features`. `targets`: (T_l, D) forcing terms without the baseline's. `amplitudes`:
    (L,) of the demonstrations, relative to the primitive's.
    """
    count = rows[0].shape[1] // PARTS
    used = list(zip(amplitudes, (own[:, :-1] for own in rows), targets, strict=True))
    normal = np.sum([scale**2 * (own.T @ own) for scale, own, _ in used], axis=0)
    moment = np.sum([scale * (own.T @ target) for scale, own, target in used], axis=0)
    ridge = np.repeat(RIDGE, [count, (PARTS - 1) * count]) * np.trace(normal) / len(normal)
    return np.linalg.solve(normal + np.diag(ridge), moment)


def mean_ends(
    weights: np.ndarray,
    amplitudes: np.ndarray,
    rhythms: Sequence[Rhythm],
    starts: np.ndarray,
    goals: np.ndarray,
) -> tuple[Rhythm, np.ndarray, np.ndarray]:
    """The rhythm of the demonstration with the median number of cycles, and its mean start and goal (D,).

    `starts`, `goals`: (L, D) of all demonstrations, whose baselines and drifts per cycle are averaged.
    """
    order = np.argsort([rhythm.cycles for rhythm in rhythms], kind="stable")
    typical = rhythms[order[(len(order) - 1) // 2]]
    offsets = amplitudes[:, None, None] * np.array([rests(weights, rhythm) for rhythm in rhythms])
    begun, ended = starts - offsets[:, 0], goals - offsets[:, 1]
    drift = ((ended - begun) / np.array([rhythm.cycles for rhythm in rhythms])[:, None]).mean(axis=0)
    start, goal = begun.mean(axis=0) + rests(weights, typical)
    return typical, start, goal + typical.cycles * drift


def amplitude(weights: np.ndarray, rows: np.ndarray, target: np.ndarray) -> float:
    """Amplitude r of a demonstration relative to the primitive's, by least squares; arguments as `fitted`."""
    forcing = rows[:, : len(weights)] @ weights
    return float(np.sum(forcing * target) / max(np.sum(forcing**2), np.finfo(float).tiny))


def amplitudes(paths: Sequence[np.ndarray]) -> np.ndarray:
    """Amplitudes (L,) of demonstrations (T_l, D) by their extent on the longest axis; their mean is 1.

    What does not change, such as the opening of a gripper that holds the tool, has the amplitude 1.
    """
    extents = np.array([np.ptp(path, axis=0) for path in paths])
    sizes = extents[:, np.argmax(extents.mean(axis=0))]
    return sizes / sizes.mean() if sizes.any() else np.ones(len(sizes))
