"""Assignment of runs of motion to the primitives of a task, jointly over all demonstrations.

Only the order of the primitives is given; their shape is learned from the demonstrations. One demonstration,
cut in one way, is the pattern, and a candidate's cost grows with its difference from the pattern's primitive
in duration, path length and direction. For a given pattern, dynamic programming finds the cheapest chain of
candidates in every demonstration. Every way to cut every demonstration is tried as the pattern; the one with
the least total cost is taken, and its demonstration is the reference.

Motion may be left out (a twitch) and dips may be bridged (a hesitation), both at a price.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Self

import numpy as np

from structlearn.core.compilation import numba
from structlearn.segmentation.motion_runs import Candidates

UNASSIGNED_PRICE = 1.5  # price of motion outside all primitives, per mean path length of a primitive
DISPLACED = 2.0
"""Further price of unassigned motion, by its displacement: a twitch returns, whereas motion that leads to the
start of the next primitive is probably part of one."""

HASTE = 0.5  # weight of the duration: people repeat paths more exactly than timing
PAUSE_PRICE = 1.0
"""Price per s of a dip counted as a hesitation: the longer, the more likely it is a pause."""

MISSING = 3.0
"""Cost above which a candidate is not the pattern's primitive: a twitch instead of a move, or a move in the
opposite direction with another length."""

MOST_OVERLAP = 0.3
"""Allowed overlap of neighbours on different axes, relative to the shorter one: the hand often turns before
it has arrived. Motion along one axis belongs to a single primitive."""

PATTERNS, FEWEST_PATTERNS = 1200, 10
"""Number of ways to cut that are tried as the pattern, in total and at least per demonstration: the cheapest
by the prices above. The work grows with their number times that of the demonstrations; of more than 120
demonstrations, an evenly spread part is tried, so that it does not grow with their square."""


@dataclass(frozen=True)
class Chosen:
    """Candidates chosen as the P primitives of one demonstration."""

    chain: np.ndarray  # (P,) indices of the candidates
    costs: np.ndarray  # (P,) dissimilarity from the pattern
    # (P + 1,) unassigned motion before each primitive and after the last (`UNASSIGNED_PRICE`), relative to
    # a mean primitive of the pattern
    unassigned: np.ndarray


@dataclass(frozen=True)
class Assignment:
    """The cheapest choice over all demonstrations."""

    reference: int  # index of the demonstration that is the pattern
    chosen: list[Chosen | None]  # per demonstration; None if it has no such chain
    total: float  # price, comparable between sets of candidates


@dataclass(frozen=True)
class Pattern:
    """Duration, path length and displacement of K patterns of P primitives."""

    duration: np.ndarray  # (K, P) s
    path_length: np.ndarray  # (K, P)
    displacement: list[np.ndarray]  # P of (K, D)
    turns: np.ndarray  # (P,) mask: path in rad

    @classmethod
    def of(cls, picked: Sequence[Sequence[tuple[Candidates, int]]]) -> Self:
        """Patterns of K by P candidates, each with its index."""
        return cls(
            np.array([[choices.duration[g] for choices, g in row] for row in picked]),
            np.array([[choices.path_length[g] for choices, g in row] for row in picked]),
            [np.array([own.displacement[g] for own, g in column]) for column in zip(*picked, strict=True)],
            np.array([choices.turns for choices, _ in picked[0]]),
        )

    @property
    def mean_path_length(self) -> np.ndarray:
        """(K, P) mean path length over the primitives with the same unit."""
        same = self.turns[:, None] == self.turns
        return self.path_length @ (same / same.sum(axis=0))


def assign(
    demonstrations: Sequence[Sequence[Candidates]], references: Sequence[int], between: Sequence[bool]
) -> Assignment | None:
    """The cheapest assignment over all demonstrations.

    `demonstrations`: per demonstration, the candidates for its P primitives in order of time. `between`: (P,)
    mask: a primitive without an axis precedes, in which any motion is free. None if no demonstration among
    the references has a chain of candidates.
    """
    gaps = [_gaps(primitives, between) for primitives in demonstrations]
    references = references[:: ceil(len(references) * FEWEST_PATTERNS / PATTERNS)]
    most = max(PATTERNS // len(references), FEWEST_PATTERNS)
    owners, chains, own = [], [], []
    for index in references:
        cheapest_chains, prices = _chains(demonstrations[index], gaps[index], most)
        owners += [index] * len(cheapest_chains)
        chains += cheapest_chains
        own += prices
    if not chains:
        return None
    picked = [
        list(zip(demonstrations[owner], chain, strict=True))
        for owner, chain in zip(owners, chains, strict=True)
    ]
    pattern, missing = Pattern.of(picked), MISSING * len(demonstrations[0])
    total = np.array(own)
    for index, primitives in enumerate(demonstrations):
        cheapest, _ = _cheapest(primitives, gaps[index], pattern)
        total += np.where(np.array(owners) == index, 0.0, np.minimum(cheapest, missing))
    best = int(np.argmin(total))
    reference, pattern = owners[best], Pattern.of(picked[best : best + 1])
    chosen = []
    for index, primitives in enumerate(demonstrations):
        chain = chains[best] if index == reference else _cheapest(primitives, gaps[index], pattern)[1]
        chosen.append(None if chain is None else _chosen(primitives, gaps[index], chain, pattern))
    return Assignment(reference, chosen, float(total[best]))


def _chosen(
    primitives: Sequence[Candidates], gaps: Sequence[np.ndarray], chain: np.ndarray, pattern: Pattern
) -> Chosen:
    places = range(len(chain))
    motion = [gaps[p][chain[p - 1] if p else 0, chain[p]] for p in places] + [gaps[-1][chain[-1], 0]]
    costs = [mismatch(choices, pattern, p)[0, chain[p]] for p, choices in enumerate(primitives)]
    return Chosen(chain, np.array(costs), np.array(motion) / pattern.mean_path_length[0, [*places, -1]])


def _gaps(primitives: Sequence[Candidates], between: Sequence[bool]) -> list[np.ndarray]:
    """Cost (`_unassigned`) of motion before each primitive along its own axis, and after the last one.

    Returns P + 1 tables: (1, G) before the first, (G before, G after) between, inf for the wrong order, (G,
    1) after the last.
    """
    first, last = primitives[0], primitives[-1]
    tables = [_unassigned(first, np.zeros(1, dtype=int), first.first)]
    for before, after, moves in zip(primitives, primitives[1:], between[1:], strict=False):
        overlap = before.last[:, None] - after.first[None]
        shorter = np.minimum((before.last - before.first)[:, None], (after.last - after.first)[None])
        other_axis = not np.array_equal(before.runs, after.runs)
        later = before.first[:, None] < after.first[None]
        in_order = (overlap <= MOST_OVERLAP * shorter * other_axis) & later
        price = np.zeros(in_order.shape) if moves else _unassigned(after, before.last, after.first)
        tables.append(np.where(in_order, price, np.inf))
    return [*tables, _unassigned(last, last.last, np.array([len(last.path) - 1]))]


def _unassigned(choices: Candidates, since: np.ndarray, until: np.ndarray) -> np.ndarray:
    """(S, U) path length along one axis from samples (S,) to samples (U,), plus `DISPLACED` displacements."""
    path_length = np.maximum(choices.travelled[until][None] - choices.travelled[since][:, None], 0.0)
    apart = np.linalg.norm(choices.path[until][None] - choices.path[since][:, None], axis=2)
    return path_length + DISPLACED * np.minimum(apart, path_length)


def _chains(
    primitives: Sequence[Candidates], gaps: Sequence[np.ndarray], most: int
) -> tuple[list[np.ndarray], list[float]]:
    """Cheapest cuts of a demonstration and their costs, counting only unassigned motion and dips.

    The least cost-to-go of each candidate is computed first, so that of unfinished cuts those are kept with
    which the cheapest whole ones begin: without it a twitch before the first move, which costs less than to
    leave it out, would take a move's place in all of them.
    """
    ways = np.array([choices.travelled[-1] for choices in primitives])
    alike = [sum(choices.turns == other.turns for other in primitives) for choices in primitives]
    price = UNASSIGNED_PRICE * np.array(alike) / np.maximum(ways, np.finfo(float).tiny)
    to_go = [price[-1] * gaps[-1][:, 0]]  # (G,) per primitive, the last first
    for place in range(len(primitives) - 1, 0, -1):
        after = price[place] * gaps[place] + PAUSE_PRICE * primitives[place].paused_s + to_go[-1]
        to_go.append(after.min(axis=1, initial=np.inf))
    chains, prices = np.zeros((1, 0), dtype=int), np.zeros(1)
    for place, (choices, rest) in enumerate(zip(primitives, to_go[::-1], strict=True)):
        before = gaps[place][chains[:, -1] if place else [0]]  # (N, G)
        grown = prices[:, None] + price[place] * before + PAUSE_PRICE * choices.paused_s
        whole = (grown + rest).ravel()
        order = np.argsort(whole, kind="stable")[:most]
        order = order[np.isfinite(whole[order])]
        rows, columns = np.unravel_index(order, grown.shape)
        chains, prices = np.hstack([chains[rows], columns[:, None]]), grown[rows, columns]
    prices = prices + to_go[0][chains[:, -1]]
    return list(chains), prices.tolist()


def mismatch(choices: Candidates, pattern: Pattern, place: int) -> np.ndarray:
    """(K, G) dissimilarity of each candidate from each pattern's primitive; 0 if equal.

    Combines the log ratios of duration and path length, and the distance of the displacements.
    """
    path_length = pattern.path_length[:, place, None]
    displacement, other = choices.displacement[None], pattern.displacement[place][:, None]
    apart = np.linalg.norm(displacement - other, axis=2)
    if choices.strokes:  # they may start with the one to or the one fro
        apart = np.minimum(apart, np.linalg.norm(displacement + other, axis=2))
    longer = np.abs(np.log(choices.duration[None] / pattern.duration[:, place, None]))
    farther = np.abs(np.log(choices.path_length[None] / path_length))
    return HASTE * longer + farther + 2.0 * apart / (choices.path_length[None] + path_length)


@numba.njit(cache=True)
def _reached(best: np.ndarray, price: np.ndarray, gaps: np.ndarray) -> np.ndarray:
    """(K, G) cost to reach each candidate, from costs (K, F) so far, at prices (K,) of gaps (F, G)."""
    costs = np.full((len(best), gaps.shape[1]), np.inf)
    for k in range(len(best)):
        for f in range(len(gaps)):
            if best[k, f] < np.inf:
                for g in range(gaps.shape[1]):
                    costs[k, g] = min(costs[k, g], best[k, f] + price[k] * gaps[f, g])
    return costs


def _cheapest(
    primitives: Sequence[Candidates], gaps: Sequence[np.ndarray], pattern: Pattern
) -> tuple[np.ndarray, np.ndarray | None]:
    """Cost (K,) of the cheapest chain of candidates for each pattern, and the first pattern's chain.

    Costs are inf if there is no chain; the chain is (P,) candidates, or None.
    """
    price = UNASSIGNED_PRICE / pattern.mean_path_length  # (K, P)
    best, ways_back = np.zeros((len(price), 1)), []
    for place, choices in enumerate(primitives):
        if len(choices.first) == 0:
            return np.full(len(price), np.inf), None
        ways_back.append(np.argmin(best[0][:, None] + price[0, place] * gaps[place], axis=0))
        best = _reached(best, price[:, place], gaps[place])
        best += mismatch(choices, pattern, place) + PAUSE_PRICE * choices.paused_s
    ends = best + price[:, -1:] * gaps[-1][None, :, 0]
    if not np.isfinite(ends[0]).any():
        return ends.min(axis=1), None
    chain = [int(np.argmin(ends[0]))]
    for way_back in ways_back[:0:-1]:
        chain.append(int(way_back[chain[-1]]))
    return ends.min(axis=1), np.array(chain[::-1])
