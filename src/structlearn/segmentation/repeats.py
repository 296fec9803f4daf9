"""Split a recording, e.g. a teleoperation session, into repeats of a task, by the pattern of its moves.

Nothing marks where a repeat begins, and a pause between two repeats looks like one between two moves. But the
moves recur in the same order: the pattern is the sequence of moves that explains most of the hand's path in
all recordings. Between repeats the hand may move freely (the way back, a second grip), at a price.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from structlearn.core.errors import InputError
from structlearn.readers.demonstration import SIGNAL_UNITS, Demonstration
from structlearn.segmentation import motion_runs
from structlearn.segmentation.motion_runs import MOVED, AxisMotion, Candidates, CandidateSearch
from structlearn.segmentation.parameters import BETWEEN, SegmentParameters
from structlearn.segmentation.run_assignment import PAUSE_PRICE, UNASSIGNED_PRICE, Pattern, mismatch

SEQUENCES = 300
"""Number of sequences tried as the pattern; the work grows with it."""

COVERED = 0.4
"""Least share of the path that repeats cover; for a task of a single move there, half is the way back."""

LONGEST_REST_S = 1.0
"""Longest rest kept before and after a repeat."""

REPEAT_COLUMNS = ["recording", "demonstration", "start_s", "end_s", "unlike"]
"""Recording, name of the repeat as a demonstration, its place in the recording, and its dissimilarity from
the pattern (`run_assignment.mismatch`, mean over its moves)."""


def split_repeats(
    recordings: Sequence[Demonstration], parameters: SegmentParameters, count: int | None
) -> tuple[list[Demonstration], pd.DataFrame]:
    """Demonstrations of one repeat each, including half the adjacent rests, and a table of `REPEAT_COLUMNS`.

    `count`: number of repeats in every recording; None: unknown. Raises InputError: the moves do not repeat,
    or the number of repeats differs.
    """
    moved = [motion_runs.motion(recording, "xyz", parameters) for recording in recordings]
    pace = motion_runs.pace(moved)
    thresholds = tuple(fraction * pace for fraction in motion_runs.FRACTIONS)
    candidates, runs = [], []
    for motion, recording in zip(moved, recordings, strict=True):
        bridge = round(parameters.bridge_s / recording.dt)
        candidates.append(_candidates(motion, thresholds, recording.dt, bridge))
        runs += [_candidates(motion, (threshold,), recording.dt, 0) for threshold in thresholds]
    shown = sum(primitive.axis not in ("rot", BETWEEN) for primitive in parameters.primitives)
    pattern = _best_pattern(candidates, runs, max(1, shown))  # fewer if two primitives form one run
    moves, longest = pattern.path_length.shape[1], float(pattern.path_length.max())
    repeats = [_repeats(choices, pattern) for choices in candidates]
    pairs = zip(candidates, repeats, strict=True)
    covered = sum(float(choices.path_length[chains].sum()) for choices, chains in pairs)
    share = covered / sum(float(choices.travelled[-1]) for choices in candidates)
    if share < COVERED or sum(map(len, repeats)) < 2:
        raise InputError(
            f"repeats: the moves of the recordings do not repeat: at most {share:.0%} of the way is the "
            f"same {moves} move{'s' * (moves > 1)} again"
        )
    parts, rows = [], []
    for recording, choices, chains in zip(recordings, candidates, repeats, strict=True):
        if len(chains) != (count or len(chains)) or not len(chains):
            wanted = f", not {count}" if count else ""
            raise InputError(f"{recording.name}: has {_times(recording, choices, chains)}{wanted}")
        if (before := float(choices.travelled[choices.first[chains[0, 0]]])) > longest:
            raise InputError(
                f"{recording.name}: where a repeat begins is ambiguous: before the first of "
                f"{_times(recording, choices, chains)} the hand goes {before:.2f} m, farther than in any of "
                f"its {moves} moves; name all moves, also the way back"
            )
        costs = [mismatch(choices, pattern, place)[0] for place in range(moves)]
        for number, chain in enumerate(chains, start=1):
            first, last = _with_rests(choices, chain, MOVED * longest, round(LONGEST_REST_S / recording.dt))
            name = f"{recording.name}-{number:02d}"
            parts.append(excerpt(recording, name, first, last))
            mean = np.mean([cost[chosen] for cost, chosen in zip(costs, chain, strict=True)])
            rows.append((recording.name, name, recording.time[first], recording.time[last], float(mean)))
    return parts, pd.DataFrame(rows, columns=REPEAT_COLUMNS)


def _candidates(motion: AxisMotion, thresholds: Sequence[float], dt: float, bridge: int) -> Candidates:
    return motion_runs.run_candidates(motion, CandidateSearch(thresholds, dt, bridge, most=len(motion.path)))


def _best_pattern(candidates: Sequence[Candidates], runs: Sequence[Candidates], most: int) -> Pattern:
    """Sequence of moves that explains most of the path in all recordings; the first of equal ones."""
    best, least = None, np.inf
    for moves in range(1, most + 1):
        rows = [
            [(choices, at) for at in range(first, first + moves)]
            for choices in runs
            for first in range(len(choices.first) - moves + 1)
        ]
        if not rows:
            break
        rows = [rows[at] for at in np.linspace(0, len(rows) - 1, min(SEQUENCES, len(rows))).astype(int)]
        patterns = Pattern.of(rows)
        unexplained = np.sum([_explain(choices, patterns)[0] for choices in candidates], axis=0)
        chosen = int(np.argmin(unexplained))
        if unexplained[chosen] < least:
            least, best = float(unexplained[chosen]), Pattern.of(rows[chosen : chosen + 1])
    if best is None:
        raise InputError("repeats: the recordings have no run of motion")
    return best


def _explain(choices: Candidates, pattern: Pattern) -> tuple[np.ndarray, np.ndarray]:
    """Least path that repeats of K patterns leave unexplained, and backtracking for the first pattern.

    A move between repeats costs its path length, one within a repeat or before the first `UNASSIGNED_PRICE`
    times that; a move of the pattern costs its mismatch times the mean move's path length or its own. Since
    the former are sums along the path, the best predecessor of a candidate is a running minimum.

    Returns (K,) m.   (P + 1, G) candidate before each as the pattern's move, -1 for none; the last row holds
    the one that ends the last repeat.
    """
    moves, count = len(pattern.displacement), len(choices.first)
    length = np.maximum(pattern.mean_path_length[:, :1], choices.path_length)
    pauses = PAUSE_PRICE * choices.paused_s
    price = np.array([length * (mismatch(choices, pattern, place) + pauses) for place in range(moves)])
    inside = np.where(np.arange(moves) < moves - 1, UNASSIGNED_PRICE, 1.0)[:, None]  # price after each move
    patterns = len(pattern.path_length)
    cost = np.empty((moves, patterns, count))
    best = np.full((moves, patterns), np.inf)  # least cost after a move, minus the path up to there
    start = np.full(patterns, np.inf)  # the same for whole repeats
    last, before = np.full(moves, -1), np.full((moves + 1, count), -1)
    whole, ended, order = -1, 0, np.argsort(choices.last, kind="stable")
    for at in range(count):
        while ended < count and choices.last[order[ended]] <= choices.first[at]:
            other = order[ended]
            value = cost[:, :, other] - inside * choices.travelled[choices.last[other]]
            last = np.where(value[:, 0] < best[:, 0], other, last)
            best = np.minimum(best, value)
            whole = int(other) if best[-1, 0] < start[0] and last[-1] == other else whole
            start = np.minimum(start, best[-1])
            ended += 1
        here = choices.travelled[choices.first[at]]
        since = np.vstack([np.minimum(start + here, UNASSIGNED_PRICE * here), best[:-1] + inside[:-1] * here])
        cost[:, :, at] = since + price[:, :, at]
        before[:moves, at] = [whole if start[0] + here < UNASSIGNED_PRICE * here else -1, *last[:-1]]
    none = np.full(patterns, UNASSIGNED_PRICE * choices.travelled[-1])
    total = np.vstack([none, (cost[-1] - choices.travelled[choices.last]).T + choices.travelled[-1]])
    before[moves, :] = int(np.argmin(total[:, 0])) - 1
    return total.min(axis=0), before


def _repeats(choices: Candidates, pattern: Pattern) -> np.ndarray:
    """(N, P) candidates of the repeats in order of time."""
    moves, (_, before) = len(pattern.displacement), _explain(choices, pattern)
    chain, at = [], int(before[moves, 0]) if before.shape[1] else -1
    while at >= 0:
        for place in range(moves)[::-1]:
            chain.append(at)
            at = int(before[place, at])
    return np.array(chain[::-1], dtype=int).reshape(-1, moves)


def _with_rests(choices: Candidates, chain: np.ndarray, moved: float, most: int) -> tuple[int, int]:
    """First and last sample of a repeat with half the adjacent rests, at most `most` samples each."""
    first, last = int(choices.first[chain[0]]), int(choices.last[chain[-1]])
    runs = choices.runs[np.diff(choices.travelled[choices.runs])[:, 0] > moved]
    earlier, later = runs[runs[:, 1] <= first, 1], runs[runs[:, 0] >= last, 0]
    begin = (int(earlier[-1]) + first) // 2 if len(earlier) else 0
    end = (int(later[0]) + last) // 2 if len(later) else len(choices.path) - 1
    return max(begin, first - most), min(end, last + most)


def excerpt(recording: Demonstration, name: str, first: int, last: int) -> Demonstration:
    """Samples first..last of a recording as a demonstration."""
    here, time = slice(first, last + 1), recording.time[[first, last]]
    signals = {
        signal: values[here] for signal in SIGNAL_UNITS if (values := getattr(recording, signal)) is not None
    }
    true = recording.true_segments
    if true is not None:
        true = true[(true[:, 0] >= time[0]) & (true[:, 1] <= time[1])] - time[0]
    return replace(recording, name=name, time=recording.time[here] - time[0], true_segments=true, **signals)


def _times(recording: Demonstration, choices: Candidates, chains: np.ndarray) -> str:
    """Number and times of repeats as text."""
    ends = [(choices.first[chain[0]], choices.last[chain[-1]]) for chain in chains]
    times = ", ".join(f"{recording.time[a]:.1f}-{recording.time[b]:.1f}" for a, b in ends)
    return f"{len(chains)} repeats of the task{f' ({times} s)' if times else ''}"
