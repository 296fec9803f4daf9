"""Primitive of a Cartesian position in its local frame, which is aligned with the reach (IV.6.1)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal, Self

import numpy as np

from structlearn.core import signals
from structlearn.core.frames import FrameKind, frame_kind, local_frame
from structlearn.primitives import kernels, transformation
from structlearn.primitives.rhythmic import Rhythm
from structlearn.primitives.trajectory import Trajectory
from structlearn.primitives.vector import (
    SubsetFit,
    VectorPrimitive,
    fit_rhythmic,
    fit_vector,
    fit_vector_subsets,
)

SHORTEST_REACH = 0.01
"""m; shorter reaches use the base frame, because their direction is mostly noise."""

FrameChoice = Literal["auto", "reach", "base", "none"]
"""Frame in which a movement is learned: along its reach (IV.6.1), in the axes of the base, or `auto`: along
the reach, unless the demonstrations clearly agree better in the axes of the base (`CLOSER`). `none`: joints
and other coordinates (D,), which take the place of x, y, z below, are learned as they are."""

CLOSER = 0.5
"""Scatter of the demonstrations in the axes of the base, over that in their local frames, below which the
base is used: they return near their starts, so that the directions of their reaches are mostly noise (wipe,
stir). Reaches whose directions are known scatter alike in both, or less in their local frames."""

SHAPE_SAMPLES = 50  # per path in normalised time, to compare frames


@dataclass(frozen=True)
class PositionPrimitive:
    """Learned movement of a point."""

    local: VectorPrimitive  # the movement relative to its start, in the local frame
    frame: FrameKind  # which definition of the local frame (see `frames.frame_kind`)
    start: np.ndarray  # (3,) mean start of the demonstrations in the base frame, m
    goal: np.ndarray  # (3,) mean goal of the demonstrations in the base frame, m

    @property
    def duration(self) -> float:
        """Mean duration of the demonstrations in s."""
        return self.local.duration

    def repeated(self, cycles: float, amplitude: float = 1.0, first: float | None = None) -> Self:
        """As `ForcedPrimitive.repeated`."""
        local = self.local.repeated(cycles, amplitude, first)
        ends = {"start": self.start + local.start, "goal": self.start + local.goal}
        return replace(self, local=replace(local, start=np.zeros(3), goal=local.goal - local.start), **ends)

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
        frame: np.ndarray | None = None,
    ) -> Trajectory:
        """Generate the movement in the base frame, (..., T, 3) m; arguments as in `VectorPrimitive.unroll`.

        `coupling`: in the local frame, relative to the start. `frame`: (3, 3) local to base; default: the
        local frame from start to goal.
        """
        start = self.start if start is None else np.asarray(start, dtype=float)
        goal = self.goal if goal is None else np.asarray(goal, dtype=float)
        axes = local_frame(start, goal, self.frame) if frame is None else frame
        path = self.local.unroll(
            dt,
            start=np.zeros_like(start),
            goal=(goal - start) @ axes,
            duration=duration,
            velocity=None if velocity is None else np.broadcast_to(velocity, start.shape) @ axes,
            acceleration=None if acceleration is None else np.broadcast_to(acceleration, start.shape) @ axes,
            coupling=coupling,
            until=until,
        )
        return path.turned(axes.T).shifted(start)


def fit_position(
    demonstrations: Sequence[Trajectory],
    scaled: Sequence[bool] = (False, False, False),
    method: kernels.Regression = "joint",
    kernel_count: int = kernels.KERNEL_COUNT,
    frame: FrameChoice = "auto",
) -> PositionPrimitive:
    """Fit a position primitive; each demonstration is expressed in its own local frame.

    `demonstrations`: (T_l, 3) signals in the base frame. `scaled`: local axes (x: along the reach) whose
    forcing term scales with the reach.
    """
    start, goal = (np.mean([path.position[at] for path in demonstrations], axis=0) for at in (0, -1))
    kind = _Frames(demonstrations, frame).kind(np.ones(len(demonstrations), dtype=bool))
    local = [in_local_frame(path, kind) for path in demonstrations]
    return PositionPrimitive(
        fit_vector(local, _scaled(scaled, kind), method, kernel_count), kind, start, goal
    )


def fit_rhythmic_position(
    demonstrations: Sequence[Trajectory],
    rhythms: Sequence[Rhythm],
    kernel_count: int = kernels.KERNEL_COUNT,
    frame: FrameChoice = "base",
) -> PositionPrimitive:
    """As `vector.fit_rhythmic`, in the axes of the base: a reach that returns has no direction."""
    fitted = fit_rhythmic(demonstrations, rhythms, kernel_count)
    local = replace(fitted, start=np.zeros_like(fitted.start), goal=fitted.goal - fitted.start)
    return PositionPrimitive(local, "none" if frame == "none" else "world", fitted.start, fitted.goal)


def fit_position_subsets(
    demonstrations: Sequence[Trajectory],
    scaled: Sequence[bool] = (False, False, False),
    kernel_count: int = kernels.KERNEL_COUNT,
    frame: FrameChoice = "auto",
) -> SubsetFit[PositionPrimitive]:
    """As `fit_position`, for some of the demonstrations at a time; samples are read once per frame kind."""
    starts, goals = (np.array([path.position[at] for path in demonstrations]) for at in (0, -1))
    frames = _Frames(demonstrations, frame)

    @cache
    def local_fit(kind: FrameKind) -> SubsetFit[VectorPrimitive]:
        local = [in_local_frame(path, kind) for path in demonstrations]
        return fit_vector_subsets(local, _scaled(scaled, kind), kernel_count)

    def fit(used: np.ndarray, method: kernels.Regression) -> PositionPrimitive:
        start, goal = starts[used].mean(axis=0), goals[used].mean(axis=0)
        kind = frames.kind(used)
        return PositionPrimitive(local_fit(kind)(used, method), kind, start, goal)

    return fit


class _Frames:
    """Choice of the local frame for some of L demonstrations at a time."""

    def __init__(self, demonstrations: Sequence[Trajectory], choice: FrameChoice) -> None:
        self.choice = choice
        self.reaches = np.array([path.position[-1] - path.position[0] for path in demonstrations])
        self.curves = cache(lambda kind: _shapes(demonstrations, kind))

    def kind(self, used: np.ndarray) -> FrameKind:
        """Frame for the demonstrations in a mask (L,)."""
        if self.choice == "none":
            return "none"
        kind = frame_kind(self.reaches[used].mean(axis=0), SHORTEST_REACH)
        if self.choice == "base" or kind == "world":
            return "world"
        if self.choice == "reach":
            return kind
        in_base, along = (_scatter(self.curves(frame)[used]) for frame in ("world", kind))
        return "world" if in_base < CLOSER * along else kind


def _shapes(demonstrations: Sequence[Trajectory], kind: FrameKind) -> np.ndarray:
    """(L, S, 3) m: paths in normalised time without the minimum-jerk reach, which follows any goal."""
    progress = signals.minimum_jerk(np.linspace(0.0, 1.0, SHAPE_SAMPLES))[:, None]
    try:
        local = [in_local_frame(path, kind).position for path in demonstrations]
    except ValueError:  # a demonstration without a direction has no such frame
        return np.full((len(demonstrations), SHAPE_SAMPLES, 3), np.inf)
    return np.array([signals.time_normalised(path, SHAPE_SAMPLES) - progress * path[-1] for path in local])


def _scatter(curves: np.ndarray) -> float:
    """Root of the mean squared distance in m of curves (L, S, 3) from their mean."""
    if np.isinf(curves).any():
        return np.inf
    return float(np.sqrt(np.mean(np.sum((curves - curves.mean(axis=0)) ** 2, axis=2))))


def _scaled(scaled: Sequence[bool], kind: FrameKind) -> Sequence[bool] | None:
    """Axes of the local frame to scale: none of the base frame's, which do not follow the reach."""
    return scaled if kind not in ("world", "none") else None


def in_local_frame(trajectory: Trajectory, kind: FrameKind) -> Trajectory:
    """Position path relative to its start, in the local frame of its start and end."""
    return from_start(trajectory, local_frame(trajectory.position[0], trajectory.position[-1], kind))


def from_start(trajectory: Trajectory, axes: np.ndarray) -> Trajectory:
    """Position path relative to its start, in axes given by the columns of `axes` (3, 3)."""
    return trajectory.shifted(-trajectory.position[0]).turned(axes)
