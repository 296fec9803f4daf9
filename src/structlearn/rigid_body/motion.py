"""Motions to learn dynamics from: filtered joint states and torques, their parts, and errors by block."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from structlearn.core import signals
from structlearn.core.errors import InputError
from structlearn.core.metrics import drawn_counts

SMALLEST_VARIANCE = 1e-12  # (N m)^2; below it a joint's torque was not measured


@dataclass(frozen=True)
class Motion:
    """Samples for inverse dynamics, in the order of time."""

    q: np.ndarray  # (N, n) rad, positions (m for sliding joints, and so below)
    qd: np.ndarray  # (N, n) rad/s
    qdd: np.ndarray  # (N, n) rad/s^2
    torque: np.ndarray  # (N, n) N m

    def __len__(self) -> int:
        return len(self.q)

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return self.q.shape[1]

    @property
    def torque_variance(self) -> np.ndarray:
        """(n,) variance of each joint's torque, which normalises its errors."""
        return self.torque.var(axis=0)

    def part(self, samples: slice | np.ndarray) -> "Motion":
        """Subset of the samples."""
        return Motion(self.q[samples], self.qd[samples], self.qdd[samples], self.torque[samples])

    def split(self, share: float) -> tuple["Motion", "Motion"]:
        """The first `share` of the samples, for training, and the rest, for testing."""
        end = round(share * len(self))
        return self.part(slice(None, end)), self.part(slice(end, None))


def joined_motions(motions: Sequence[Motion]) -> Motion:
    """Concatenation of several motions of the same joints."""
    fields = ("q", "qd", "qdd", "torque")
    return Motion(*(np.concatenate([getattr(motion, field) for motion in motions]) for field in fields))


def measured_motion(
    name: str,
    time: np.ndarray,
    positions: np.ndarray,
    velocities: np.ndarray,
    torques: np.ndarray,
    rate_hz: float | None = None,
    cutoff_hz: float = np.inf,
) -> Motion:
    """Motion on a uniform clock, low-pass filtered, with accelerations differentiated from the velocities.

    All signals pass the same zero-phase filter, so linear relations between them are kept.

    Args:
        name: of the log, for messages.
        time: (T,) s, increasing; may be irregular.
        positions: (T, n) rad.
        velocities: (T, n) rad/s.
        torques: (T, n) N m.
        rate_hz: sampling rate of the clock; None: 1 / median step.
        cutoff_hz: of the low-pass; no filter at or above half the rate.

    Raises:
        InputError: fewer than three samples, or a joint's torque does not vary.
    """
    rate_hz = rate_hz or 1.0 / float(np.median(np.diff(time)))
    ticks = time[0] + np.arange(int(np.floor((time[-1] - time[0]) * rate_hz + 1e-6)) + 1) / rate_hz
    if len(ticks) < 3:
        raise InputError(f"{name}: {time[-1] - time[0]:.3g} s are too short for a motion at {rate_hz:g} Hz")
    positions, velocities, torques = (
        np.stack([np.interp(ticks, time, column) for column in values.T], axis=1)
        for values in (positions, velocities, torques)
    )
    return smoothed_motion(name, positions, velocities, torques, 1.0 / rate_hz, cutoff_hz)


def smoothed_motion(
    name: str,
    positions: np.ndarray,
    velocities: np.ndarray,
    torques: np.ndarray,
    dt: float,
    cutoff_hz: float = np.inf,
) -> Motion:
    """As `measured_motion`, for samples already on a uniform clock, `dt` s apart."""
    filtered = (signals.low_pass(values, dt, cutoff_hz) for values in (positions, velocities, torques))
    q, qd, torque = map(np.ascontiguousarray, filtered)  # torch refuses the filter's reversed views
    motion = Motion(q, qd, signals.derivative(qd, dt), torque)
    constant = np.flatnonzero(motion.torque_variance < SMALLEST_VARIANCE)
    if len(constant):
        raise InputError(f"{name}: the torque of joint {constant[0] + 1} does not vary; was it recorded?")
    return motion


def excited(name: str, velocities: np.ndarray, slow: float, rest: int) -> slice:
    """Longest motion in a log, without rests and transients around it.

    The arm rests where no joint is faster than `slow` rad/s; rests shorter than `rest` samples do not split a
    motion. Raises InputError: the arm never moves.
    """
    moving = np.flatnonzero((np.abs(velocities) > slow).any(axis=1))
    if not len(moving):
        raise InputError(f"{name}: no joint ever moves faster than {slow:g} rad/s")
    pieces = np.split(moving, np.flatnonzero(np.diff(moving) > rest) + 1)
    longest = max(pieces, key=lambda piece: piece[-1] - piece[0])
    return slice(int(longest[0]), int(longest[-1]) + 1)


def drawn_nmse(
    blocks: pd.DataFrame, model: Sequence[str], draws: int, seed: int
) -> tuple[np.ndarray, np.ndarray, int]:
    """NMSE (n,) of a model (kind, friction) on a part, for drawn blocks (D, n), and the number of blocks."""
    ordered = blocks.sort_values(["block", "joint"], kind="stable")
    count, joints = ordered["block"].nunique(), ordered["joint"].nunique()
    columns = ["samples", "torque", "torque_squared", "/".join(model)]
    sums = ordered[columns].to_numpy().reshape(count, joints, 4)
    drawn = np.tensordot(drawn_counts(count, draws, seed), sums, 1)
    samples, torque, squared, error = np.moveaxis(np.concatenate([sums.sum(axis=0)[None], drawn]), -1, 0)
    errors = error / (squared - torque**2 / samples)
    return errors[0], errors[1:], count
