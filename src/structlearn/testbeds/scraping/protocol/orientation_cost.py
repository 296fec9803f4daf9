"""Cost of an execution: how far the tool is off its nominal orientation on the board (eq. IV.34).

    J_t = | 2 log(Q_nr,t o Q_cr,t*) |        n: nominal run at 0 degrees, c: current run

The dissertation prints the norm with a trailing 2: read as the Euclidean norm.
"""

from collections.abc import Sequence

import numpy as np

from structlearn.ground import quaternion
from structlearn.ground.errors import InputError
from structlearn.recordings.demonstration import Demonstration


def nominal_orientation(runs: Sequence[Demonstration]) -> np.ndarray:
    """Orientation of the tool on the board in the default setting, mean over runs.

    `runs`: nominal executions in the default setting, of equal commanded durations. Returns (T, 4) unit
    quaternions, sign-continuous; T of the shortest run. Raises InputError: a run has no tool-to-board
    orientation.
    """
    length = min(len(run.time) for run in runs)
    paths = np.stack([_tool_to_board(run)[:length] for run in runs], axis=1)  # (T, R, 4)
    aligned = np.where(np.sum(paths * paths[:, :1], axis=2, keepdims=True) < 0, -paths, paths)
    # over a degree or two the normalised mean is the mean orientation
    return quaternion.sign_continuous(quaternion.normalised(aligned.mean(axis=1)))


def orientation_cost(run: Demonstration, nominal: np.ndarray) -> np.ndarray:
    """Cost at every tick.

    `run`: the current execution, on the clock of the nominal runs and of the same durations. `nominal`:
    (T, 4) of `nominal_orientation`. Returns (T',) rad, T' the shorter of both. Raises InputError: the run has
    no tool-to-board orientation.
    """
    current = _tool_to_board(run)
    length = min(len(current), len(nominal))
    return np.linalg.norm(quaternion.difference(nominal[:length], current[:length]), axis=1)


def accumulated(cost: np.ndarray, segment: tuple[float, float], rate_hz: float) -> float:
    """Sum of the cost over the ticks of one primitive (fig. IV.20), rad.

    `cost`: (T,) rad. `segment`: start and end of the primitive in s.
    """
    first, last = (round(end * rate_hz) for end in segment)
    return float(cost[first : last + 1].sum())


def _tool_to_board(run: Demonstration) -> np.ndarray:
    if run.tool_to_board is None:
        raise InputError(f"{run.name}: has no tool-to-board orientation, which the cost is made of")
    return run.tool_to_board
