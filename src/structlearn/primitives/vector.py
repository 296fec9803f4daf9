"""Primitive of a vector signal: sensor traces, chart coordinates, positions in a local frame (IV.3).

The expected sensor traces of a primitive (associative skill memory) are such a primitive, with one dimension
per channel; deviations from them are the input of feedback models.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import repeat
from typing import Any, Generic, Self, TypeVar

import numpy as np

from structlearn.primitives import canonical, kernels, rhythmic, transformation
from structlearn.primitives.rhythmic import Rhythm
from structlearn.primitives.trajectory import OrientationTrajectory, Trajectory, differentiated

SMALLEST_AMPLITUDE = 1e-3
"""Axes along which the demonstrations move less than this are never scaled: their ratio would be noise."""

Unrolled = TypeVar("Unrolled", Trajectory, OrientationTrajectory, covariant=True)
Fitted = TypeVar("Fitted")


@dataclass(frozen=True)
class ForcedPrimitive(ABC, Generic[Unrolled]):
    """Forcing weights and the demonstrations' mean boundary conditions, for a vector or an orientation."""

    weights: np.ndarray  # (..., N, D) of the forcing term, rhythmic (..., 3 N, D); leading axes make a batch
    start: np.ndarray  # (D,) mean start of the demonstrations; orientation (4,)
    goal: np.ndarray  # (D,) mean goal of the demonstrations; orientation (4,)
    velocity: np.ndarray  # (D,) mean initial velocity of the demonstrations, per duration
    acceleration: np.ndarray  # (D,) mean initial acceleration of the demonstrations, per duration squared
    duration: float  # mean duration of the demonstrations in s
    rhythm: Rhythm | None = field(default=None, kw_only=True)  # of a rhythmic movement

    def time_constant(self, duration: float) -> float:
        """Time constant tau in s of a movement of a duration in s: of a rhythmic one, the period."""
        return canonical.time_constant(duration) if self.rhythm is None else duration / self.rhythm.cycles

    def features(self, samples: int, step: float) -> np.ndarray:
        """Features (T, N) of the forcing term at T samples; `step`: sampling interval / tau, dimensionless.

        Of a rhythmic movement (T, 3 N + 1), as `rhythmic.features`.
        """
        if self.rhythm is None:
            return kernels.sampled_features(samples, step, self.weights.shape[-2])
        return rhythmic.features(
            step * np.arange(samples), self.rhythm, self.weights.shape[-2] // rhythmic.PARTS
        )

    def phase(self, elapsed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Phase and its velocity (T,) at times since the start over tau; of a rhythmic one, of the cycle."""
        return canonical.phase(elapsed, 1.0) if self.rhythm is None else rhythmic.phase(elapsed, self.rhythm)

    def features_at(self, times: np.ndarray, duration: float) -> np.ndarray:
        """As `features`, at times (T,) s of a movement of `duration` s."""
        tau, size = self.time_constant(duration), self.weights.shape[-2]
        if self.rhythm is None:
            return kernels.features(*canonical.phase(times, tau), size)
        return rhythmic.features(times / tau, self.rhythm, size // rhythmic.PARTS)

    def unroll(
        self,
        dt: float,
        start: np.ndarray | None = None,
        goal: np.ndarray | None = None,
        duration: float | None = None,
        velocity: np.ndarray | float | None = None,
        acceleration: np.ndarray | float | None = None,
        coupling: transformation.Coupling | None = None,
        until: float | None = None,
    ) -> Unrolled:
        """Generate the movement; defaults are the demonstrations' means.

        Recorded movements rarely begin exactly at rest, and the evolving goal amplifies the remaining motion
        (eq. IV.12), so the mean initial state is part of the primitive; pass 0 for a robot that stands still.

        Args:
            dt: sampling interval in s.
            start: (D,) initial position; (4,) orientation.
            goal: (D,) steady goal; (4,) orientation.
            duration: s.
            velocity: (D,) initial velocity; (3,) rad/s.
            acceleration: (D,) initial acceleration; (3,) rad/s^2.
            coupling: feedback in the loop, of the step, x (..., D) and xd; for orientations Q (..., 4) and w.
            until: time of the last sample in s; default: the duration. Beyond it the terms keep decaying.

        Returns:
            Trajectory with (..., T, D) signals, or orientations (..., T, 4).
        """
        start = self.start if start is None else np.asarray(start, dtype=float)
        goal = self.goal if goal is None else np.asarray(goal, dtype=float)
        duration = self.duration if duration is None else duration
        tau = self.time_constant(duration)
        features = self.features(sample_count(duration if until is None else until, dt), dt / tau)
        velocity = self.velocity / duration if velocity is None else velocity
        acceleration = self.acceleration / duration**2 if acceleration is None else acceleration
        return self._integrated(start, goal, features, dt, tau, velocity, acceleration, coupling)

    @abstractmethod
    def repeated(self, cycles: float, amplitude: float = 1.0, first: float | None = None) -> Self:
        """The rhythmic movement with other numbers: its duration and goal follow, its period stays.

        `first`: where in the cycle it starts; default: where it does, so that its start stays.
        """

    def _repeated(
        self, way: np.ndarray, cycles: float, amplitude: float, first: float | None
    ) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
        """Fields of `repeated` but its ends; its start minus this one's, and its goal minus its start (D,).

        `way`: (D,) goal minus start of this movement.
        """
        if self.rhythm is None:
            raise ValueError("a discrete movement cannot be repeated")
        if not (cycles > 0.0 and amplitude > 0.0):
            raise ValueError(f"cycles and amplitude must be positive, are {cycles:g} and {amplitude:g}")
        still = Rhythm(self.rhythm.first, cycles)
        rhythm = still if first is None else Rhythm(first, cycles)
        longer = cycles / self.rhythm.cycles
        fields = {
            "weights": amplitude * self.weights,
            "velocity": longer * self.velocity,
            "acceleration": longer**2 * self.acceleration,
            "duration": longer * self.duration,
            "rhythm": rhythm,
        }
        starts = [rhythmic.rests(self.weights, each)[0] for each in (still, rhythm)]
        way = rhythmic.repeated(self.weights, way, self.rhythm, rhythm, amplitude)
        return fields, amplitude * (starts[1] - starts[0]), way

    @abstractmethod
    def _integrated(
        self, start: np.ndarray, goal: np.ndarray, features: np.ndarray, *system: Any
    ) -> Unrolled:
        """The movement with forcing features (T, N); `system`: the further arguments of `unroll`."""


@dataclass(frozen=True)
class VectorPrimitive(ForcedPrimitive[Trajectory]):
    """Learned movement of a D-dimensional signal."""

    scaled: np.ndarray  # (D,) axes whose forcing term grows with the distance from start to goal

    def forcing(self, times: np.ndarray, start: np.ndarray, goal: np.ndarray, duration: float) -> np.ndarray:
        """Forcing term (..., T, D) at times (T,) s, scaled along the `scaled` axes (eq. IV.6)."""
        return self._forcing(self.features_at(times, duration), start, goal)

    def weights_towards(self, start: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """Weights (..., N, D) of `features` for a movement from `start` to `goal` (..., D)."""
        if self.rhythm is not None:
            return rhythmic.with_baseline(self.weights, start, goal)
        return self.weights * relative_scale(np.subtract(goal, start), self.goal - self.start, self.scaled)

    def repeated(self, cycles: float, amplitude: float = 1.0, first: float | None = None) -> Self:
        """As `ForcedPrimitive.repeated`; the amplitude is relative to this one's."""
        fields, moved, way = self._repeated(self.goal - self.start, cycles, amplitude, first)
        start = self.start + moved
        return replace(self, start=start, goal=start + way, **fields)

    def _forcing(self, features: np.ndarray, start: np.ndarray, goal: np.ndarray) -> np.ndarray:
        if self.rhythm is not None:
            return features @ self.weights_towards(start, goal)
        scale = relative_scale(np.subtract(goal, start), self.goal - self.start, self.scaled)
        return features @ self.weights * scale

    def _integrated(
        self, start: np.ndarray, goal: np.ndarray, features: np.ndarray, *system: Any
    ) -> Trajectory:
        return transformation.unroll(start, goal, self._forcing(features, start, goal), *system)


def fit_vector(
    demonstrations: Sequence[Trajectory],
    scaled: Sequence[bool] | None = None,
    method: kernels.Regression = "joint",
    kernel_count: int = kernels.KERNEL_COUNT,
) -> VectorPrimitive:
    """Fit a primitive to one or several demonstrations of any durations (IV.5.4).

    `demonstrations`: (T_l, D) signals each. `scaled`: axes whose forcing term scales with the distance from
    start to goal; default: none.
    """
    targets = _forcing_targets(demonstrations)

    def weights(scales: np.ndarray) -> np.ndarray:
        return kernels.forcing_weights(targets, scales, method, kernel_count)

    ends = Boundaries.of(demonstrations)
    return _fitted(ends, _mask(scaled, ends), weights)


def fit_rhythmic(
    demonstrations: Sequence[Trajectory],
    rhythms: Sequence[Rhythm],
    kernel_count: int = kernels.KERNEL_COUNT,
) -> VectorPrimitive:
    """Fit a rhythmic primitive to demonstrations (T_l, D) that start and end as their rhythms say.

    Cycles of a demonstration take equally long, and its amplitude is that of its path.
    """
    rows, targets = zip(*map(rhythmic_target, demonstrations, rhythms, repeat(kernel_count)), strict=True)
    amplitudes = rhythmic.amplitudes([path.position for path in demonstrations])
    weights = rhythmic.fitted(rows, targets, amplitudes)
    ends = Boundaries.of(demonstrations)
    typical, start, goal = rhythmic.mean_ends(weights, amplitudes, rhythms, ends.start, ends.goal)
    return VectorPrimitive(
        weights, start, goal, *ends.over(rhythms, typical), np.zeros(len(start), dtype=bool), rhythm=typical
    )


def rhythmic_target(
    path: Trajectory, rhythm: Rhythm, kernel_count: int = kernels.KERNEL_COUNT
) -> tuple[np.ndarray, np.ndarray]:
    """Features (T, 3 N + 1) of a demonstration, and the forcing term (T, D) that they are to span."""
    tau = path.duration / rhythm.cycles
    rows = rhythmic.features(path.time / tau, rhythm, kernel_count)
    x, xd, xdd = path.position, path.velocity, path.acceleration
    baseline = rows[:, -1:] * (x[0] - x[-1])
    first = transformation.initial_goal(x[0], xd[0], xdd[0], tau, baseline[0])
    goal = transformation.goal_path(x[-1], first, path.time, tau)
    alpha, beta = transformation.ALPHA, transformation.BETA
    return rows, tau**2 * xdd - alpha * (beta * (goal - x) - tau * xd) - baseline


SubsetFit = Callable[[np.ndarray, kernels.Regression], Fitted]
"""Primitive of the demonstrations that are used, a mask (L,), by a regression."""


def fit_vector_subsets(
    demonstrations: Sequence[Trajectory],
    scaled: Sequence[bool] | None = None,
    kernel_count: int = kernels.KERNEL_COUNT,
) -> SubsetFit[VectorPrimitive]:
    """As `fit_vector`, for some of the demonstrations at a time; samples are read only once."""
    ends = Boundaries.of(demonstrations)
    mask = _mask(scaled, ends)
    equations = kernels.NormalEquations.of(_forcing_targets(demonstrations), kernel_count)

    def fit(used: np.ndarray, method: kernels.Regression) -> VectorPrimitive:
        return _fitted(ends.of_some(used), mask, lambda scales: equations.weights(used, scales, method))

    return fit


def _forcing_targets(demonstrations: Sequence[Trajectory]) -> list[np.ndarray]:
    return [
        transformation.forcing_target(demonstration, canonical.time_constant(demonstration.duration))
        for demonstration in demonstrations
    ]


@dataclass(frozen=True)
class Boundaries:
    """Boundary conditions of L demonstrations, of which a primitive keeps the means."""

    start: np.ndarray  # (L, D); orientations (L, 4)
    goal: np.ndarray  # (L, D); orientations (L, 4)
    velocity: np.ndarray  # (L, D) initial velocity per duration
    acceleration: np.ndarray  # (L, D) initial acceleration per duration squared
    duration: np.ndarray  # (L, 1) s

    @classmethod
    def of(cls, demonstrations: Sequence[Trajectory] | Sequence[OrientationTrajectory]) -> Self:
        """Of vector signals or of orientations."""
        duration = np.array([demonstration.duration for demonstration in demonstrations])[:, None]
        paths, velocities, accelerations = zip(
            *(tuple(vars(demonstration).values())[1:] for demonstration in demonstrations), strict=True
        )
        start, goal = (np.array([path[at] for path in paths]) for at in (0, -1))
        velocity, acceleration = (
            np.array([rate[0] for rate in rates]) for rates in (velocities, accelerations)
        )
        return cls(start, goal, duration * velocity, duration**2 * acceleration, duration)

    def of_some(self, used: np.ndarray) -> Self:
        """Those of the demonstrations in a mask (L,)."""
        return type(self)(**{name: values[used] for name, values in vars(self).items()})

    @property
    def initial_state(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Mean initial velocity per duration, acceleration per duration squared, and duration in s."""
        return self.velocity.mean(axis=0), self.acceleration.mean(axis=0), float(self.duration.mean())

    def over(self, rhythms: Sequence[Rhythm], typical: Rhythm) -> tuple[np.ndarray, np.ndarray, float]:
        """Likewise of rhythmic movements, for a movement of the typical rhythm and the mean period."""
        longer = typical.cycles / np.array([[rhythm.cycles] for rhythm in rhythms])
        velocity, acceleration = longer * self.velocity, longer**2 * self.acceleration
        return type(self)(self.start, self.goal, velocity, acceleration, longer * self.duration).initial_state


def _mask(scaled: Sequence[bool] | None, ends: Boundaries) -> np.ndarray:
    return np.zeros(ends.start.shape[1], dtype=bool) if scaled is None else np.array(scaled, dtype=bool)


def _fitted(
    ends: Boundaries, scaled: np.ndarray, weights: Callable[[np.ndarray], np.ndarray]
) -> VectorPrimitive:
    """Primitive with weights (N, D) that follow from the scales (L, D) of the demonstrations."""
    start, goal = ends.start.mean(axis=0), ends.goal.mean(axis=0)
    scales = relative_scale(ends.goal - ends.start, goal - start, scaled)
    return VectorPrimitive(weights(scales), start, goal, *ends.initial_state, scaled)


def relative_scale(distance: np.ndarray, amplitude: np.ndarray, scaled: np.ndarray) -> np.ndarray:
    """Factor (..., D) on the forcing term: (G - x_0) / amplitude on scaled axes, 1 elsewhere.

    `distance`: (..., D) goal minus start of this movement. `amplitude`: (D,) mean goal minus mean start of
    the demonstrations. `scaled`: (D,) mask.
    """
    meaningful = scaled & (np.abs(amplitude) >= SMALLEST_AMPLITUDE)
    return np.where(meaningful, distance / np.where(meaningful, amplitude, 1.0), 1.0)


def sample_count(duration: float, dt: float) -> int:
    """Number of samples 0, dt, 2 dt, ... up to the one nearest to `duration` s."""
    return round(duration / dt) + 1


OFFSET_SAMPLES = 5  # a run's offset is the mean of this many samples at its start


def without_offset(trace: np.ndarray, first: np.ndarray | None = None) -> np.ndarray:
    """Trace (T, E) relative to the sensor's reading at the start of the run.

    `first`: (S, E) samples at the start of the run; default: the trace itself. Later primitives of a run pass
    the trace of its first primitive.
    """
    return trace - (trace if first is None else first)[:OFFSET_SAMPLES].mean(axis=0)


def fit_expected_traces(
    traces: Sequence[np.ndarray], dt: float, smoothing_hz: float, rhythms: Sequence[Rhythm] = ()
) -> VectorPrimitive:
    """Fit the expected sensor traces of a primitive to repeated runs, one dimension per channel.

    `traces`: per run (T_l, E) readings without offset, on one uniform clock from start to end.
    `smoothing_hz`: cut-off of the low-pass before differentiation. `rhythms`: of the runs of a rhythmic
    primitive, whose cycles take equally long.
    """
    smooth = [differentiated(trace, dt, smoothing_hz) for trace in traces]
    return fit_rhythmic(smooth, rhythms) if rhythms else fit_vector(smooth)


def expected_traces(primitive: VectorPrimitive, samples: int, dt: float) -> np.ndarray:
    """Expected traces of a run with `samples` samples: (samples, E) counts."""
    return primitive.unroll(dt, duration=dt * (samples - 1)).position


def deviation(primitive: VectorPrimitive, trace: np.ndarray, dt: float) -> np.ndarray:
    """Deviation s_actual - s_expected of a run without offset: (T, E) -> (T, E) counts."""
    return trace - expected_traces(primitive, len(trace), dt)
