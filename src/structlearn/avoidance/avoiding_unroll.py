"""Unroll of the baseline primitive with an avoidance model in the loop, for a batch of scenarios (IV.8.4).

Everything is in each scenario's local frame: origin at its start, x along its reach. The integrator is that
of all primitives (`primitives.transformation`); the avoidance model is its coupling term.

A moving obstacle is observed in its own frame, in which it is at rest as in training: the velocity among the
features is relative to it.

With several obstacles, each has its own features and post-processing. Their coupling terms are not summed,
which would double a detour around two obstacles on the same side: along each axis the strongest push in
either direction counts (`strongest_pushes`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from structlearn.avoidance.features import CouplingModel, obstacle_features
from structlearn.avoidance.postprocessing import Deadline, GoalReach, PostprocessingParameters, post_processed
from structlearn.avoidance.shapes import CloudBatch
from structlearn.core.errors import InputError
from structlearn.core.frames import local_frame
from structlearn.primitives import canonical, transformation
from structlearn.primitives.position import SHORTEST_REACH, PositionPrimitive
from structlearn.primitives.trajectory import Trajectory
from structlearn.primitives.vector import sample_count


def no_coupling(features: np.ndarray, phase: np.ndarray, phase_velocity: np.ndarray) -> np.ndarray:
    """Avoidance model of the baseline: (B, 3) zeros."""
    return np.zeros((len(features), 3))


@dataclass(frozen=True)
class GoalChange:
    """A goal that moves during the movement; the evolving goal follows it (eq. IV.10)."""

    time: float  # time of the change, s since the start
    goals: np.ndarray  # (B, 3) or (3,) new steady goals in the base frame, m


@dataclass(frozen=True)
class AvoidancePaths:
    """Unrolled movements of B scenarios in their local frames."""

    path: Trajectory  # (B, T, 3) positions relative to the start, velocities, accelerations
    coupling: np.ndarray  # (B, T, 3) applied coupling term, held over the step after its sample
    requested: np.ndarray  # (B, T, 3) post-processed coupling term, before the limits of `GoalReach`
    goal: np.ndarray  # (B, 3) steady goal, the last one if it changed
    start: np.ndarray  # (B, 3) origin of the local frame in the base frame, m
    frame: np.ndarray  # (B, 3, 3) local to base
    duration: float  # prescribed duration in s; the path may continue

    @property
    def in_base_frame(self) -> Trajectory:
        """The paths (B, T, 3) in the base frame."""
        return self.path.turned(np.swapaxes(self.frame, 1, 2)).shifted(self.start[:, None])


def unroll_avoiding(
    primitive: PositionPrimitive,
    model: CouplingModel,
    obstacles: Sequence[CloudBatch],
    dt: float,
    postprocessing: PostprocessingParameters,
    starts: np.ndarray | None = None,
    goals: np.ndarray | None = None,
    duration: float | None = None,
    until_factor: float = 1.5,
    goal_change: GoalChange | None = None,
) -> AvoidancePaths:
    """Unroll the baseline around one or several obstacles in each of B scenarios.

    Feedback begins at the second sample: at the first, the initial goal (eq. IV.12) would absorb it and
    return it with the opposite sign. `obstacles`: in the local frames; `dt`: s; `starts`, `goals` (B, 3) or
    (3,) m, base frame, and `duration` in s, default: the primitive's; `until_factor`: end of the path in
    durations; `goal_change`: frame and forcing term remain those of the first goals. Raises ValueError: no
    obstacle, batches of different sizes, a reach without a local frame, a goal change outside the movement,
    or a model that returns another shape or NaN.
    """
    sizes = {len(obstacle.points) for obstacle in obstacles}
    if len(sizes) != 1:
        raise ValueError(
            f"obstacles must come for one number of scenarios, are for {sorted(sizes) or 'none'}"
        )
    batch = sizes.pop()
    starts = np.broadcast_to(primitive.start if starts is None else starts, (batch, 3)).astype(float)
    goals = np.broadcast_to(primitive.goal if goals is None else goals, (batch, 3)).astype(float)
    frames = reach_frames(primitive, starts, goals)
    goal = _turned(goals - starts, frames)
    duration = primitive.duration if duration is None else duration
    tau = canonical.time_constant(duration)
    if not 0.0 < dt <= until_factor * duration:
        raise InputError(f"a sampling interval of {dt:g} s does not fit a movement of {duration:g} s")
    time = dt * np.arange(sample_count(until_factor * duration, dt))
    # the forcing term is scaled per scenario: (B, 1, 3) ends against times (T,)
    forcing = primitive.local.forcing(time, np.zeros((batch, 1, 3)), goal[:, None], duration)
    feedback = _Feedback(model, obstacles, time, duration, postprocessing)
    change = len(time) - 1 if goal_change is None else _change_sample(goal_change, time)
    rates = primitive.local.velocity / duration, primitive.local.acceleration / duration**2
    begun, coupling = forcing[:, : change + 1], partial(feedback.at, 0, goal)
    path = transformation.unroll(np.zeros((batch, 3)), goal, begun, dt, tau, *rates, coupling)
    if goal_change is not None:  # keeping the acceleration lets the evolving goal continue
        goal = _turned(np.subtract(goal_change.goals, starts), frames)
        rates, coupling = (path.velocity[:, -1], path.acceleration[:, -1]), partial(feedback.at, change, goal)
        rest = transformation.unroll(
            path.position[:, -1], goal, forcing[:, change:], dt, tau, *rates, coupling
        )
        path = _joined(path, rest, time)
    return AvoidancePaths(path, feedback.coupling, feedback.requested, goal, starts, frames, duration)


def reach_frames(primitive: PositionPrimitive, starts: np.ndarray, goals: np.ndarray) -> np.ndarray:
    """Local frames (B, 3, 3) to base of reaches from starts (B, 3) to goals (B, 3), as the primitive's.

    Raises InputError: a reach is too short to have a direction, or parallel to the frame's anchor.
    """
    lengths = np.linalg.norm(goals - starts, axis=1)
    short = np.flatnonzero(~(lengths >= SHORTEST_REACH))
    if primitive.frame == "world" or len(short):
        where = f"scenario {short[0]}: a reach" if len(short) else "a baseline"
        raise InputError(
            f"{where} shorter than {SHORTEST_REACH:g} m has no direction to avoid obstacles across"
        )
    frames = []
    for number, (start, goal) in enumerate(zip(starts, goals, strict=True)):
        try:
            frames.append(local_frame(start, goal, primitive.frame))
        except ValueError as error:
            raise InputError(f"scenario {number}: {error}") from error
    return np.stack(frames)


class _Feedback:
    """Coupling term for `transformation.unroll`, with a record of the applied terms."""

    def __init__(
        self,
        model: CouplingModel,
        obstacles: Sequence[CloudBatch],
        time: np.ndarray,
        duration: float,
        parameters: PostprocessingParameters,
    ) -> None:
        batch, self._dt = len(obstacles[0].points), time[1]
        self.coupling, self.requested = np.zeros((2, batch, len(time), 3))
        self._model, self._obstacles, self._time = model, obstacles, time
        self._decay = parameters.passed_decay_per_m2
        self._extent = [(o.points[..., 0].min(axis=1), o.points[..., 0].max(axis=1)) for o in obstacles]
        self._tau = canonical.time_constant(duration)
        phase = canonical.phase(time, self._tau)
        self._phase = [np.repeat(values[:, None], batch, axis=1) for values in phase]  # (T, B) each
        limits = ((1.0, parameters.end_limit_m), (parameters.late_factor, parameters.late_limit_m))
        due = [Deadline(sample_count(f * duration, self._dt) - 1, m) for f, m in limits if m is not None]
        self._reach = GoalReach((batch, 3), self._dt / self._tau, due, parameters.return_coupling)
        self._done = 0  # samples with a known coupling term; the first has none

    def at(self, first: int, goal: np.ndarray, step: int, x: np.ndarray, xd: np.ndarray) -> np.ndarray:
        """Coupling term (B, 3) at a step after the first sample of a segment with one goal."""
        k = first + step
        if k > self._done:  # the sample of a goal change belongs to two segments
            terms = [self._term(number, k, goal, x, xd) for number in range(len(self._obstacles))]
            self.requested[:, k] = strongest_pushes(np.stack(terms))
            self.coupling[:, k] = self._reach.admissible(k, self.requested[:, k])
            self._reach.advance(self.coupling[:, k])
            self._done = k
        return self.coupling[:, k]

    def _term(self, number: int, k: int, goal: np.ndarray, x: np.ndarray, xd: np.ndarray) -> np.ndarray:
        """Post-processed coupling term (B, 3) for one obstacle."""
        obstacle, (first_x, last_x) = self._obstacles[number], self._extent[number]
        moved = obstacle.displacement(float(self._time[k]))
        velocity = (moved - obstacle.displacement(float(self._time[k - 1]))) / self._dt
        seen = obstacle_features(x - moved, xd - velocity, self._tau, obstacle.points, obstacle.centre)
        wanted = np.asarray(self._model(seen, self._phase[0][k], self._phase[1][k]))
        if wanted.shape != x.shape or not np.isfinite(wanted).all():
            raise ValueError(
                f"the avoidance model returned {wanted.shape} at sample {k}, wanted are finite {x.shape}"
            )
        at, goal_x = x[:, 0] - moved[:, 0], goal[:, 0] - moved[:, 0]
        return post_processed(wanted, at, first_x, last_x, goal_x, self._decay)


def strongest_pushes(terms: np.ndarray) -> np.ndarray:
    """Combine terms (O, ..., 3) of several obstacles: per axis max_i max(c_i, 0) + min_i min(c_i, 0).

    Terms of opposite sign add up, terms of the same sign do not; a single obstacle's term is unchanged.
    """
    return np.maximum(terms, 0.0).max(axis=0) + np.minimum(terms, 0.0).min(axis=0)


def _turned(vectors: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Vectors (B, 3) of the base frame in the local frames (B, 3, 3)."""
    return np.einsum("bi,bij->bj", vectors, frames)


def _change_sample(change: GoalChange, time: np.ndarray) -> int:
    sample = sample_count(change.time, time[1]) - 1
    if not 0 < sample < len(time) - 1:
        raise InputError(f"the goal changes at {change.time:g} s, outside the movement of {time[-1]:g} s")
    return sample


def _joined(path: Trajectory, rest: Trajectory, time: np.ndarray) -> Trajectory:
    """Concatenate two segments (B, T_i, 3); the second begins with the last sample of the first."""
    pieces = zip(*([part.position, part.velocity, part.acceleration] for part in (path, rest)), strict=True)
    return Trajectory(time, *(np.concatenate([first, then[:, 1:]], axis=1) for first, then in pieces))
