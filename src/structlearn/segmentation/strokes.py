"""Strokes: motion to and fro or round and round, whose number may differ between demonstrations.

A stroke is half a cycle. To and fro, it is a move between two turning points or rests, opposite to the one
before; round and round, it is a stretch between the turning points of a run along its longest axis. A run of
at least two strokes is one candidate for a primitive (`motion_runs.Candidates`), compared with others stroke
by stroke, whatever their number.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise, product

import numpy as np

from structlearn.core.errors import InputError
from structlearn.segmentation.motion_runs import (
    REST_FRACTION,
    AxisMotion,
    Candidates,
    CandidateSearch,
    Strokes,
    cut_points,
    runs_of_motion,
)

OPPOSITE = -0.7  # largest cosine between the ways of a stroke and the next
ALIKE = 2.0  # largest ratio of their lengths
DIP = 0.5  # of the peaks on both sides, below which the speed falls at a turning point
ROUND = 2.5  # path length over extent of a run, above which it goes round: a circle's is pi
TURNS = 0.35  # of a round run's range, by which it goes back after a turning point
RESTLESS = 0.9  # share of half a cycle in which a hand moves that turns back without a pause
TRIMMED = 3  # candidates begin at one of so many first strokes, likewise at the end: others may look alike
LARGEST_RATIO = 2.0
"""Of the periods of two demonstrations; beyond, they are not the same movement at another pace."""


def find_strokes(moved: AxisMotion, threshold: float, bridge: int = 0) -> list[Strokes]:
    """Longest runs of strokes in a recording, in order of time, at a `threshold` of the speed.

    `bridge`: longest dip in samples across which moves in one direction are one stroke.
    """
    return [*_round_runs(moved, threshold), *_to_and_fro(moved, threshold, bridge)]


def stroke_candidates(moved: AxisMotion, search: CandidateSearch, runs: Candidates) -> Candidates:
    """Candidates for a primitive of strokes, at every threshold; may be empty. `runs`: single ones."""
    found: dict[tuple[int, int], Strokes] = {}
    for threshold, bridge in product(search.thresholds, (0, search.bridge)):
        for strokes in find_strokes(moved, threshold, bridge):
            for first, last in product(range(TRIMMED), range(TRIMMED)):
                own = slice(first, len(strokes.ends) - last)
                part = Strokes(strokes.ends[own], strokes.share[own], (-1) ** first * strokes.way)
                if len(part.ends) >= 2 and part.number >= 1.5:
                    limits = int(part.ends[0, 0]), int(part.ends[-1, 1])
                    if limits not in found or part.number > found[limits].number:
                        found[limits] = part
    chosen = [found[limits] for limits in sorted(found)]
    begins, ends = np.array(sorted(found), dtype=int).reshape(-1, 2).T
    numbers = np.array([strokes.number for strokes in chosen])
    lengths = (runs.travelled[ends] - runs.travelled[begins]) / numbers
    return Candidates(
        begins,
        ends,
        np.zeros(len(chosen)),
        search.dt * np.array([strokes.samples for strokes in chosen]),
        np.maximum(lengths, search.dt * search.thresholds[0]),
        runs.path,
        runs.travelled,
        runs.runs,
        runs.turns,
        tuple(chosen),
    )


def _moves(moved: AxisMotion, threshold: float, bridge: int) -> np.ndarray:
    """First and last samples (M, 2) of moves between turning points and rests; runs on are joined."""
    moves = [
        part
        for first, last in runs_of_motion(moved.smooth_speed, threshold, len(moved.path)).tolist()
        for part in _between_dips(moved.smooth_speed, first, last)
    ]
    joined: list[tuple[int, int]] = []
    for first, last in moves:
        if joined and first - joined[-1][1] <= bridge:
            before = moved.path[joined[-1][1]] - moved.path[joined[-1][0]]
            if _cosine(before, moved.path[last] - moved.path[first]) > -OPPOSITE:
                first = joined.pop()[0]
        joined.append((first, last))
    return np.array(joined, dtype=int).reshape(-1, 2)


def _middle(path: np.ndarray) -> float:
    """Sample at which a stroke (T, D) has gone half of its way."""
    done = (path - path[0]) @ (path[-1] - path[0])
    later = max(int(np.argmax(done >= 0.5 * done[-1])), 1)
    before, after = done[later - 1 : later + 1]
    return later - 1 + float((0.5 * done[-1] - before) / max(after - before, np.finfo(float).tiny))


def _between_dips(speed: np.ndarray, first: int, last: int) -> Iterator[tuple[int, int]]:
    """Parts of a run between its dips, at which the speed falls below `DIP` of the peaks on both sides."""
    waiting = [(first, last)]
    while waiting:
        first, last = waiting.pop()
        part = speed[first : last + 1]
        before, after = np.maximum.accumulate(part), np.maximum.accumulate(part[::-1])[::-1]
        depth = part / np.minimum(before, after)
        lowest = first + int(np.argmin(depth))
        if depth[lowest - first] >= DIP:
            yield first, last
        else:
            waiting += [(lowest, last), (first, lowest)]


def _to_and_fro(moved: AxisMotion, threshold: float, bridge: int) -> Iterator[Strokes]:
    moves = _moves(moved, threshold, bridge)
    if len(moves) < 2:
        return
    ways = moved.path[moves[:, 1]] - moved.path[moves[:, 0]]
    lengths = np.linalg.norm(ways, axis=1)
    follows = [
        _cosine(way, following) < OPPOSITE and max(pair) < ALIKE * min(pair)
        for (way, following), pair in zip(pairwise(ways), pairwise(lengths), strict=True)
    ]
    ends = np.flatnonzero(~np.array([*follows, False], dtype=bool))
    rest = REST_FRACTION * threshold
    # (M, 2) end of the move before, and start of the next
    limits = np.stack([np.append(0, moves[:-1, 1]), np.append(moves[1:, 0], len(moved.path) - 1)], axis=1)
    for first, last in zip([0, *(ends[:-1] + 1)], ends, strict=True):
        if last > first:
            own = [
                cut_points(moved.speed, (start, end), threshold, rest, (earliest, latest))
                for start, end, earliest, latest in np.hstack([moves, limits])[first : last + 1].tolist()
            ]
            yield Strokes(np.array(own), np.ones(len(own)), ways[first])


def _cosine(one: np.ndarray, other: np.ndarray) -> float:
    return float(one @ other / max(np.linalg.norm(one) * np.linalg.norm(other), np.finfo(float).tiny))


def _round_runs(moved: AxisMotion, threshold: float) -> Iterator[Strokes]:
    for first, last in runs_of_motion(moved.smooth_speed, threshold, len(moved.path)).tolist():
        path = moved.path[first : last + 1]
        centred = path - path.mean(axis=0)
        extent = 2.0 * np.linalg.norm(centred, axis=1).max()
        length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        parts = list(_between_dips(moved.smooth_speed, first, last))
        if len(parts) == 1 and length > ROUND * extent:
            axis = np.linalg.svd(centred, full_matrices=False)[2][0]
            strokes = round_strokes(moved.path, (first, last), axis)
            if strokes is not None:
                yield strokes


def round_strokes(path: np.ndarray, run: tuple[int, int], axis: np.ndarray) -> Strokes | None:
    """Strokes between the turning points of a run along an axis (D,); None if it has fewer than two."""
    first, last = run
    turns = first + _turning_points(path[first : last + 1] @ axis)
    if len(turns) < 2:
        return None
    ends = np.array([first, *turns, last])
    travelled = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path[first : last + 1], axis=0), axis=1)))
    lengths = np.diff(travelled[ends - first])
    share = np.ones(len(turns) + 1)
    share[[0, -1]] = lengths[[0, -1]] / lengths[1:-1].mean()  # not of the time: it starts and stops at rest
    kept = np.diff(ends) > 0
    return Strokes(np.stack([ends[:-1], ends[1:]], axis=1)[kept], share[kept], np.zeros(path.shape[1]))


def _turning_points(values: np.ndarray) -> np.ndarray:
    """Samples at which values (T,) turn back by more than `TURNS` of their range."""
    least, found = TURNS * np.ptp(values), list[int]()
    high = low = 0
    rising = 0
    for sample, value in enumerate(values.tolist()):
        high, low = (sample if value > values[high] else high), (sample if value < values[low] else low)
        if rising >= 0 and values[high] - value > least:
            found += [high] * (high > 0)
            rising, low, high = -1, sample, sample
        elif rising <= 0 and value - values[low] > least:
            found += [low] * (low > 0)
            rising, low, high = 1, sample, sample
    return np.array(found, dtype=int)


def longest_axis(path: np.ndarray, strokes: Strokes) -> np.ndarray:
    """Direction (D,) of the strokes of a run in a path (T, D)."""
    if strokes.way.any():
        return strokes.way / np.linalg.norm(strokes.way)
    part = path[strokes.ends[0, 0] : strokes.ends[-1, 1] + 1]
    return np.linalg.svd(part - part.mean(axis=0), full_matrices=False)[2][0]


def require_one_period(name: str, own: Strokes, reference: str, other: Strokes, dt: float) -> None:
    """Raise InputError if strokes take `LARGEST_RATIO` times as long as the reference's, or the other way."""
    periods = [2.0 * dt * strokes.samples for strokes in (own, other)]
    if max(periods) > LARGEST_RATIO * min(periods):
        raise InputError(
            f"{name}: its period of {periods[0]:.2f} s and that of {reference}, {periods[1]:.2f} s, differ "
            f"by more than a factor of {LARGEST_RATIO:g}: are these the same strokes?"
        )


def working_share(runs: Sequence[Strokes]) -> float:
    """Mean share of half a cycle in which the hand moves; the rest is a pause between two strokes."""
    moving = sum(float(np.sum(strokes.ends[:-1, 1] - strokes.ends[:-1, 0])) for strokes in runs)
    return moving / sum(float(strokes.ends[-1, 0] - strokes.ends[0, 0]) for strokes in runs)


def knots(path: np.ndarray, strokes: Strokes, axis: np.ndarray, working: float) -> np.ndarray:
    """(K, 2) samples and cycles of a run of strokes in a path (T, D): where it starts and ends, and between.

    A stroke passes its middle at full speed, so its time is known best there; where the hand turns back at
    once, it is not known when a stroke ends and the next one starts.

    Cycles are 0 where a hand at rest begins a stroke along the `axis` (D,), or where one that goes round
    turns back to it. `working`: `working_share` of all demonstrations.
    """
    if strokes.way.any():
        number = np.arange(len(strokes.ends))[:, None] + (strokes.way @ axis < 0.0)
        cycles = 0.5 * (number + working * np.array([0.0, 0.5, 1.0]))
        middles = [_middle(path[first : last + 1]) for first, last in strokes.ends]
        samples = np.insert(strokes.ends.astype(float), 1, strokes.ends[:, 0] + middles, axis=1)
        if working > RESTLESS:
            outer = np.ones(samples.size, dtype=bool)
            outer[1:-1] = np.arange(1, samples.size - 1) % 3 == 1
            samples, cycles = samples.ravel()[outer], cycles.ravel()[outer]
    else:
        again = round_strokes(path, (int(strokes.ends[0, 0]), int(strokes.ends[-1, 1])), axis) or strokes
        samples = np.append(again.ends[:, 0], again.ends[-1, 1]).astype(float)
        place = path[again.ends[:, 1]] @ axis
        number = np.append(0.0, np.cumsum(again.share)) - again.share[0]
        cycles = 0.5 * (number + (place[0] > place[1]))
    pairs = np.stack([samples.ravel(), cycles.ravel()], axis=1)
    kept = np.append(True, (np.diff(pairs[:, 0]) > 0) & (np.diff(pairs[:, 1]) > 1e-6))
    return pairs[kept]
