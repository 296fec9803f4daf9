"""Primitive of a vector signal: sensor traces, chart coordinates, positions in a local frame (IV.3).

An expected sensor trace, what a sensor should read while a primitive runs (associative skill memory), is such
a primitive with one dimension per channel; deviations from it are what feedback models take as input.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from structlearn.primitives import canonical, kernels, transformation
from structlearn.primitives.trajectory import Trajectory, differentiated

SMALLEST_AMPLITUDE = 1e-3
"""An axis along which the demonstrations move less than this is never scaled (its ratio means nothing)."""


@dataclass(frozen=True)
class VectorPrimitive:
    """Learned movement of a D-dimensional signal."""

    weights: np.ndarray  # (..., N, D) forcing weights; leading axes make a batch
    start: np.ndarray  # (D,) mean start of the demonstrations
    goal: np.ndarray  # (D,) mean goal of the demonstrations
    velocity: np.ndarray  # (D,) mean initial velocity of the demonstrations, per duration
    acceleration: np.ndarray  # (D,) mean initial acceleration of the demonstrations, per duration squared
    duration: float  # mean duration of the demonstrations in s
    scaled: np.ndarray  # (D,) axes whose forcing term grows with the distance from start to goal

    def forcing(self, times: np.ndarray, start: np.ndarray, goal: np.ndarray, duration: float) -> np.ndarray:
        """Forcing term over time (eq. IV.6), scaled where that was asked for.

        `times`: (T,) s since the start. `start`: (D,). `goal`: (D,). `duration`: s. Returns (..., T, D)
        forcing term.
        """
        p, u = canonical.phase(times, canonical.time_constant(duration))
        return self._forcing(kernels.features(p, u, self.weights.shape[-2]), start, goal)

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
    ) -> Trajectory:
        """Generate the movement; what is not given is the demonstrations' mean.

        Recorded movements rarely begin at rest to the last bit, and the evolving goal magnifies the rest
        (eq. IV.12), so the mean initial state belongs to the primitive; a robot that stands still passes 0.

        Args:
            dt: sampling interval in s.
            start: (D,) initial position.
            goal: (D,) steady goal.
            duration: s.
            velocity: (D,) initial velocity.
            acceleration: (D,) initial acceleration.
            coupling: feedback in the loop.
            until: time of the last sample in s; default the duration. Later the terms keep fading.

        Returns:
            Trajectory with (..., T, D) signals.
        """
        start = self.start if start is None else np.asarray(start, dtype=float)
        goal = self.goal if goal is None else np.asarray(goal, dtype=float)
        duration = self.duration if duration is None else duration
        tau = canonical.time_constant(duration)
        samples = sample_count(duration if until is None else until, dt)
        features = kernels.sampled_features(samples, dt / tau, self.weights.shape[-2])
        forcing = self._forcing(features, start, goal)
        velocity = self.velocity / duration if velocity is None else velocity
        acceleration = self.acceleration / duration**2 if acceleration is None else acceleration
        return transformation.unroll(start, goal, forcing, dt, tau, velocity, acceleration, coupling)

    def _forcing(self, features: np.ndarray, start: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """Forcing term (..., T, D) from features (T, N)."""
        scale = relative_scale(np.subtract(goal, start), self.goal - self.start, self.scaled)
        return features @ self.weights * scale


def fit_vector(
    demonstrations: Sequence[Trajectory],
    scaled: Sequence[bool] | None = None,
    method: kernels.Regression = "joint",
    kernel_count: int = kernels.KERNEL_COUNT,
) -> VectorPrimitive:
    """Learn a primitive from one or several demonstrations of any durations (IV.5.4).

    `demonstrations`: each with (T_l, D) signals. `scaled`: axes whose forcing term is to scale with the
    distance from start to goal; default none.
    """
    starts = np.array([demonstration.position[0] for demonstration in demonstrations])
    goals = np.array([demonstration.position[-1] for demonstration in demonstrations])
    start, goal = starts.mean(axis=0), goals.mean(axis=0)
    axes = np.zeros(len(start), dtype=bool) if scaled is None else np.array(scaled, dtype=bool)
    targets = [
        transformation.forcing_target(demonstration, canonical.time_constant(demonstration.duration))
        for demonstration in demonstrations
    ]
    scales = relative_scale(goals - starts, goal - start, axes)
    durations = np.array([demonstration.duration for demonstration in demonstrations])[:, None]
    velocities = np.array([demonstration.velocity[0] for demonstration in demonstrations])
    accelerations = np.array([demonstration.acceleration[0] for demonstration in demonstrations])
    return VectorPrimitive(
        weights=kernels.forcing_weights(targets, scales, method, kernel_count),
        start=start,
        goal=goal,
        velocity=np.mean(durations * velocities, axis=0),
        acceleration=np.mean(durations**2 * accelerations, axis=0),
        duration=float(durations.mean()),
        scaled=axes,
    )


def relative_scale(distance: np.ndarray, amplitude: np.ndarray, scaled: np.ndarray) -> np.ndarray:
    """Factor on the forcing term: (G - x_0) / amplitude on scaled axes, 1 elsewhere.

    `distance`: (..., D) goal minus start of this movement. `amplitude`: (D,) goal minus start of the
    demonstrations' mean. `scaled`: (D,) which axes are scaled. Returns (..., D) factors.
    """
    meaningful = scaled & (np.abs(amplitude) >= SMALLEST_AMPLITUDE)
    return np.where(meaningful, distance / np.where(meaningful, amplitude, 1.0), 1.0)


def sample_count(duration: float, dt: float) -> int:
    """Number of samples 0, dt, 2 dt, ... up to the one nearest to the duration in s."""
    return round(duration / dt) + 1


OFFSET_SAMPLES = 5  # The offset of a run is the mean of this many samples at its start


def without_offset(trace: np.ndarray, first: np.ndarray | None = None) -> np.ndarray:
    """A trace relative to the sensor's reading at the start of the run.

    `trace`: (T, E) counts. `first`: (S, E) samples at the start of the run; default the trace itself. For
    later primitives of a run: the trace of its first primitive. Returns (T, E) counts.
    """
    return trace - (trace if first is None else first)[:OFFSET_SAMPLES].mean(axis=0)


def fit_expected_traces(traces: Sequence[np.ndarray], dt: float, smoothing_hz: float) -> VectorPrimitive:
    """Expected traces from repeated runs of a primitive.

    `traces`: per run (T_l, E) readings without offset, on one uniform clock from start to end.
    `smoothing_hz`: low-pass before the traces are differentiated. Returns a vector primitive with one
    dimension per channel.
    """
    return fit_vector([differentiated(trace, dt, smoothing_hz) for trace in traces])


def expected_traces(primitive: VectorPrimitive, samples: int, dt: float) -> np.ndarray:
    """Expected traces over a run of `samples` samples: (samples, E) counts."""
    return primitive.unroll(dt, duration=dt * (samples - 1)).position


def deviation(primitive: VectorPrimitive, trace: np.ndarray, dt: float) -> np.ndarray:
    """Deviation s_actual - s_expected of a run without offset: (T, E) -> (T, E) counts."""
    return trace - expected_traces(primitive, len(trace), dt)
