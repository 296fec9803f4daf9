"""What a robot commands beside its movement: the opening of a gripper, a force, a digital output.

Continuous outputs are primitives over the phase of the movement, in their own units. Digital ones are on or
off and change at a phase: the median phase of the demonstrations' edges. An edge is found with hysteresis,
so that the noise of a sensor makes none; since the phase of a run only falls, none comes twice.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

HYSTERESIS = (1.0 / 3.0, 2.0 / 3.0)
"""Shares of its range below which an output goes off, and above which it goes on."""


@dataclass(frozen=True)
class Switching:
    """States of B digital outputs during a primitive."""

    first: np.ndarray  # (B,) whether each is on at the start
    edges: np.ndarray  # (E, 2) output that changes, and the phase at which it does

    def states(self, p: np.ndarray) -> np.ndarray:
        """(T, B) whether each output is on at phases (T,), which fall from 1."""
        passed = p[:, None] <= self.edges[:, 1]  # (T, E)
        own = self.edges[:, :1] == np.arange(len(self.first))  # (E, B)
        return self.first ^ ((passed @ own.astype(int)) % 2 == 1)


def switched(values: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(T, B) whether outputs (T, B) are on: from above `high` (B,) until below `low` (B,).

    Before either is passed, whichever bound is nearer counts as passed.
    """
    levels = np.where(values > high, 1, np.where(values < low, -1, 0))
    levels[0] = np.where(levels[0] == 0, np.where(values[0] > 0.5 * (low + high), 1, -1), levels[0])
    rows = np.where(levels != 0, np.arange(len(values))[:, None], 0)
    return np.take_along_axis(levels, np.maximum.accumulate(rows, axis=0), axis=0) > 0


def hysteresis(values: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Bounds `low`, `high` (B,) of `switched` for outputs (T_l, B) of all demonstrations.

    Outputs that never change are on if they are not 0.
    """
    least, most = (np.array(ends) for ends in (_over(np.min, values), _over(np.max, values)))
    still = least == most
    low, high = (least + share * (most - least) for share in HYSTERESIS)
    return np.where(still, 0.0, low), np.where(still, np.finfo(float).tiny, high)


def _over(extreme: Callable[..., Any], values: Sequence[np.ndarray]) -> np.ndarray:
    return extreme([extreme(own, axis=0) for own in values], axis=0)


def edges(states: np.ndarray) -> list[np.ndarray]:
    """Share of a primitive's duration, at each change of states (T, B), by output."""
    changed = states[1:] != states[:-1]
    return [(np.flatnonzero(own) + 0.5) / len(changed) for own in changed.T]


def typical(states: Sequence[np.ndarray], output: int) -> tuple[bool, np.ndarray]:
    """State of an output at the start of most demonstrations, and shares (M, E) at which it changes in these.

    The M demonstrations are those with this state and the same number of edges; of equally many, those like
    the first. `states`: (T_l, B).
    """
    seen = [(bool(own[0, output]), edges(own)[output]) for own in states]
    kinds = Counter((first, len(shares)) for first, shares in seen)
    first, count = kinds.most_common(1)[0][0]
    alike = [shares for begun, shares in seen if (begun, len(shares)) == (first, count)]
    return first, np.array(alike)
