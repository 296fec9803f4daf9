"""Dynamic time warping for point correspondences (algorithm IV.2).

Only two rows of the cost table are kept; backtracking needs one byte per cell.
"""

import numpy as np

from structlearn.core.compilation import numba
from structlearn.core.signals import standardise, standardise_together

INSERTION, MATCHING, DELETION = 0, 1, 2  # ties are broken in this order, that of the published ancestors


def correspondences(reference: np.ndarray, guess: np.ndarray, one_scale: bool = False) -> np.ndarray:
    """Corresponding samples of two signals: the matching moves of the cheapest warping path.

    Both signals are standardised first; the cost of a pair is the Euclidean distance. As in the text,
    backtracking stops when either signal is at its first sample, so the pair (0, 0) is not listed.

    `reference`: (N,) or (N, D) samples. `guess`: (M,) or (M, D) samples. `one_scale`: standardise all columns
    by their common variance, so that noise of a column that hardly moves stays small; else each separately.
    Returns (K, 2) indices into reference and guess, both strictly increasing.
    """
    columns = []
    for signal in (reference, guess):
        table = np.asarray(signal, dtype=float).reshape(len(signal), -1)
        scaled = standardise_together(table) if one_scale else standardise(table)
        columns.append(np.ascontiguousarray(scaled))
    moves = np.empty((len(columns[0]), len(columns[1])), dtype=np.uint8)
    if columns[0].shape[1] == 1:
        _fill_moves_1d(columns[0][:, 0].copy(), columns[1][:, 0].copy(), moves)
    else:
        _fill_moves(columns[0], columns[1], moves)
    return _matching_pairs(moves)


@numba.njit(cache=True, inline="always")
def _cheapest(insertion: float, matching: float, deletion: float) -> tuple[float, int]:
    """The smallest cost of the three ancestors, and its move."""
    best, move = insertion, INSERTION
    if matching < best:
        best, move = matching, MATCHING
    if deletion < best:
        best, move = deletion, DELETION
    return best, move


@numba.njit(cache=True)
def _fill_moves_1d(reference: np.ndarray, guess: np.ndarray, moves: np.ndarray) -> None:
    """Moves (N, M) of the dynamic programme for scalar signals (N,) and (M,)."""
    columns = len(guess)
    above = np.full(columns, np.inf)
    for i in range(len(reference)):
        sample = reference[i]
        corner = 0.0 if i == 0 else np.inf  # cost before the first samples
        left = np.inf
        for j in range(columns):
            best, move = _cheapest(above[j], corner, left)
            moves[i, j] = move
            corner = above[j]
            left = abs(sample - guess[j]) + best
            above[j] = left


@numba.njit(cache=True, fastmath={"contract", "reassoc"})
def _fill_moves(reference: np.ndarray, guess: np.ndarray, moves: np.ndarray) -> None:
    """Moves (N, M) of the dynamic programme for vector signals (N, D) and (M, D)."""
    columns, axes = guess.shape
    above = np.full(columns, np.inf)
    distance = np.empty(columns)
    for i in range(len(reference)):
        for j in range(columns):
            square = 0.0
            for d in range(axes):
                square += (reference[i, d] - guess[j, d]) ** 2
            distance[j] = np.sqrt(square)
        corner = 0.0 if i == 0 else np.inf
        left = np.inf
        for j in range(columns):
            best, move = _cheapest(above[j], corner, left)
            moves[i, j] = move
            corner = above[j]
            left = distance[j] + best
            above[j] = left


@numba.njit(cache=True)
def _matching_pairs(moves: np.ndarray) -> np.ndarray:
    """Follow the moves back from the last cell and list the matching ones in order."""
    i, j = moves.shape[0] - 1, moves.shape[1] - 1
    pairs = np.empty((min(i, j) + 1, 2), dtype=np.int64)
    count = 0
    while i > 0 and j > 0:
        move = moves[i, j]
        if move == INSERTION:
            i -= 1
        elif move == DELETION:
            j -= 1
        else:
            pairs[count, 0], pairs[count, 1] = i, j
            count += 1
            i -= 1
            j -= 1
    return pairs[:count][::-1].copy()
