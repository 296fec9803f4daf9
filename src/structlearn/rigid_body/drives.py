"""Identification of an arm's drives: gains of the motors, and delays of the currents.

    tau = k i(t + d)        k: gain in N m/A, d: delay of the measured current in s

At rest the controller commands a current for the torque of its model, so k is their ratio. In motion the
current covers friction as well, which a smooth function of the velocity accounts for.
"""

from collections.abc import Sequence

import numpy as np

from structlearn.core.metrics import block_count, block_sums, drawn_counts
from structlearn.rigid_body.friction import FrictionTerm, friction_columns
from structlearn.rigid_body.motion import Motion
from structlearn.rigid_body.regressor import torque_regressor
from structlearn.rigid_body.tree import KinematicTree

LEAST_CURRENT_A = 0.01  # below it a joint shows no gain: the axis is vertical, or nothing hangs on it
TURNING_RAD_S = 0.02  # below it the sign of the velocity, and with it of the friction, is not certain
STRIBECK_RAD_S = 0.1  # where friction falls from its value at rest
INDEPENDENT = 1e-7  # directions of a regressor with less than this share of the strongest are rounding


def resting_gains(
    current: np.ndarray, torque: np.ndarray, length: int, draws: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Gains of drives that hold an arm at rest: torque over current, by least squares through zero.

    Currents (N, n) A are those the controller commands, torques (N, n) N m those of its model. The bootstrap
    draws blocks of `length` samples. Returns (n,) N m/A and (draws, n); NaN where no current flows.
    """
    products = block_sums(np.stack([current * torque, current**2], axis=1), length)  # (B, 2, n)
    counts = drawn_counts(len(products), draws, seed)
    flowing = np.abs(current).max(axis=0) > LEAST_CURRENT_A

    def ratio(sums: np.ndarray) -> np.ndarray:
        safe = np.where(flowing, sums[..., 1, :], 1.0)
        return np.where(flowing, sums[..., 0, :] / safe, np.nan)

    return ratio(products.sum(axis=0)), ratio(np.tensordot(counts, products, 1))


def moving_gains(
    current: np.ndarray, torque: np.ndarray, velocity: np.ndarray, length: int, draws: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Gains of drives that move an arm at (N, n) rad/s, beside friction as a smooth function of the velocity.

    Otherwise as `resting_gains`; torques are those of the links.
    """
    drawn_blocks = drawn_counts(block_count(len(current), length), draws, seed)
    counts = np.vstack([np.ones_like(drawn_blocks[:1]), drawn_blocks])  # the first is the whole
    gains, drawn = [], []
    for its_current, its_torque, speed in zip(current.T, torque.T, velocity.T, strict=True):
        sign, turning = np.sign(speed), np.abs(speed) > TURNING_RAD_S
        columns = [its_torque, speed, speed * np.abs(speed), speed**3, sign]
        columns += [sign * np.exp(-np.abs(speed) / STRIBECK_RAD_S), its_current]
        rows = np.stack(columns, axis=1) * turning[:, None]
        size = np.sqrt((rows**2).sum(axis=0))  # columns of one size keep the digits of normal equations
        products = block_sums(np.einsum("np,nq->npq", rows / size, rows / size), length)
        sums = np.tensordot(counts, products, 1)
        found = np.linalg.solve(sums[:, :-1, :-1], sums[:, :-1, -1:])[:, 0, 0] * size[-1] / size[0]
        gains.append(1.0 / found[0])
        drawn.append(1.0 / found[1:])
    return np.array(gains), np.array(drawn).T


def current_delays(
    tree: KinematicTree,
    states: Motion,
    torques: np.ndarray,
    delays_s: np.ndarray,
    friction: Sequence[FrictionTerm],
    length: int,
    draws: int,
    seed: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Delays of measured currents against the motion they drive, each joint for itself.

    Every joint is fitted with its own parameters by least squares at every delay (K,) s of an even grid, to
    torques (K, N, n) of the currents shifted back by it. The delay is where the squares are least, between
    grid points by the parabola through three of them. The bootstrap draws blocks of `length` squares with the
    parameters held. The torques of `states` are not used.

    Returns:
        Delays (n,) and (draws, n) in s, and the squares (K, n) over those of the least.
    """
    columns = torque_regressor(tree, states.q, states.qd, states.qdd)
    rubbing = friction_columns(states.q, states.qd, friction)
    counts = drawn_counts(block_count(len(states), length), draws, seed)
    delays, drawn, curves = [], [], []
    for joint in range(states.joints):
        rows = np.column_stack([columns[:, joint], rubbing[:, joint]])
        basis, strength, _ = np.linalg.svd(rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-12), False)
        basis = basis[:, strength > INDEPENDENT * strength[0]]
        measured = torques[:, :, joint].T  # (N, K)
        squares = block_sums((measured - basis @ (basis.T @ measured)) ** 2, length)  # (B, K)
        whole = squares.sum(axis=0)
        delays.append(_least(delays_s, whole[None])[0])
        drawn.append(_least(delays_s, counts @ squares))
        curves.append(whole / whole.min())
    return np.array(delays), np.array(drawn).T, np.array(curves).T


def _least(grid: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Where each row (M, K) is least, by a parabola; at the end of the grid where it falls to there."""
    place = np.clip(values.argmin(axis=1), 1, len(grid) - 2)
    before, here, after = (values[np.arange(len(values)), place + step] for step in (-1, 0, 1))
    bend = before - 2.0 * here + after
    shift = np.where(bend > 0.0, 0.5 * (before - after) / np.where(bend > 0.0, bend, 1.0), 0.0)
    return grid[place] + np.clip(shift, -1.0, 1.0) * (grid[1] - grid[0])
