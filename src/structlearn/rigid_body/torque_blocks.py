"""Errors of torques block by block of a motion: their intervals (`block_bootstrap`) need no samples."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from structlearn.ground.block_bootstrap import block_count, block_sums, drawn_counts
from structlearn.rigid_body.motion import Motion


def block_table(
    torques: Mapping[tuple[str, str], Mapping[str, np.ndarray]], parts: Mapping[str, Motion], length: int
) -> pd.DataFrame:
    """What errors on each part rest on, block by block.

    Args:
        torques: (M, N, n) N m of each model (kind and friction) on each part.
        parts: motions by name.
        length: samples of a block.

    Returns:
        `part`, `block`, `joint`, `samples`, sums `torque` and `torque_squared`, and a column of summed
        squared errors, mean over seeds, per model: `KIND/FRICTION`.
    """
    tables = []
    for name, part in parts.items():
        count = block_count(len(part), length)
        sums = {"samples": np.ones_like(part.torque), "torque": part.torque, "torque_squared": part.torque**2}
        sums |= {"/".join(key): ((its[name] - part.torque) ** 2).mean(axis=0) for key, its in torques.items()}
        columns = {key: block_sums(values, length).ravel() for key, values in sums.items()}
        keys = {
            "part": name,
            "block": np.repeat(np.arange(count), part.joints),
            "joint": np.tile(np.arange(1, part.joints + 1), count),
        }
        tables.append(pd.DataFrame(keys | columns))
    return pd.concat(tables, ignore_index=True)


def drawn_nmse(
    blocks: pd.DataFrame, model: Sequence[str], draws: int, seed: int
) -> tuple[np.ndarray, np.ndarray, int]:
    """NMSE of a model on one part, and what the bootstrap over its blocks draws for it.

    Args:
        blocks: rows of `block_table` of one part.
        model: kind and friction.
        draws: D, of the bootstrap.
        seed: of the draws.

    Returns:
        (n,) NMSE by joint, the same of drawn blocks (D, n), and the number of blocks.
    """
    its = blocks.sort_values(["block", "joint"])
    count, joints = its["block"].nunique(), its["joint"].nunique()
    columns = ["samples", "torque", "torque_squared", "/".join(model)]
    sums = its[columns].to_numpy().reshape(count, joints, 4)
    drawn = np.tensordot(drawn_counts(count, draws, seed), sums, 1)
    return _normalised(sums.sum(axis=0)), _normalised(drawn), count


def _normalised(sums: np.ndarray) -> np.ndarray:
    """(..., n) of sums (..., n, 4): samples, torque, its square, squared errors."""
    samples, torque, squared, error = np.moveaxis(sums, -1, 0)
    return error / (squared - torque**2 / samples)
