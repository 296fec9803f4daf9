"""How far two engines are apart that run the same."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

LARGEST = {
    "joint position (rad)": 1e-7,
    "hand position (m)": 1e-6,
    "joint torque (N m)": 1e-3,
    "electrodes (counts)": 1.0,
}
"""What is allowed. They agree to 1e-13 m and 1e-11 N m; a contact may magnify how another processor rounds,
and a count then falls to the other side."""


def differences(
    run: str, compiled: Mapping[str, np.ndarray], pybullet: Mapping[str, np.ndarray]
) -> pd.DataFrame:
    """Largest differences between a run of the compiled engine and the same one in PyBullet.

    `compiled`: signals (T, n) by name, some of `LARGEST`. Returns a row per signal: `run`, `signal`,
    `largest_difference`, `allowed`.

    Raises:
        RuntimeError: a difference is larger than allowed, or one engine stopped earlier.
    """
    rows = []
    for signal, one in compiled.items():
        other, allowed = pybullet[signal], LARGEST[signal]
        if one.shape != other.shape:
            raise RuntimeError(f"{run}: the engines stopped at different ticks: {len(one)} and {len(other)}")
        largest = float(np.abs(one - other).max())
        if not largest <= allowed:
            raise RuntimeError(f"{run}: the engines differ in {signal} by {largest:g}, allowed: {allowed:g}")
        rows.append((run, signal, largest, allowed))
    return pd.DataFrame(rows, columns=["run", "signal", "largest_difference", "allowed"])
