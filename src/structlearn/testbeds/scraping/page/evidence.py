"""What was found for the claims of the three pages, by the names that their `*_claims.yaml` use."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from structlearn.feedback.training_parameters import POINTWISE, UNROLLED
from structlearn.reporting.claims import UNKNOWN, Evidence, Found, exact
from structlearn.segmentation.result import RESULT
from structlearn.testbeds.scraping.names import CUT_METHODS
from structlearn.testbeds.scraping.page.execution_results import ALL
from structlearn.testbeds.scraping.page.feedback_results import BoardResults, FeedbackResults
from structlearn.testbeds.scraping.page.segmentation_results import SegmentationResults
from structlearn.testbeds.scraping.protocol.executed_sets import NOMINAL

MODEL_PAIRS = {
    "best_structure": (("pmnn_100", "pmnn_0"), ("pmnn_100", "ffnn_phase"), ("pmnn_100", "ffnn")),
    "order_of_structures": (("pmnn_100", "pmnn_0"), ("pmnn_0", "ffnn_phase"), ("ffnn_phase", "ffnn")),
    "phase_helps": (("ffnn_phase", "ffnn"),),
    "features_inside": (
        *(("pmnn_100", other) for other in ("pca", "autoencoder")),
        *(("pmnn_6", other) for other in ("pca", "autoencoder")),
    ),
    "more_nodes": (("pmnn_100", "pmnn_6"),),
}
"""Pairs (better, worse) of representations that a claim is made of."""


def weakest(found: Iterable[Evidence]) -> Evidence:
    """Of several numbers that all should be above zero the one that decides.

    That is one that is not known; else the clearest of those that are below zero; else that whose interval
    reaches lowest.
    """
    found = list(found)
    unknown = [one for one in found if not np.isfinite([one.value, one.low, one.high]).all()]
    refuted = [one for one in found if one.high <= 0.0]
    if not found or unknown:
        return unknown[0] if unknown else UNKNOWN
    return min(refuted, key=lambda one: one.high) if refuted else min(found, key=lambda one: one.low)


def segmentation_evidence(results: SegmentationResults) -> dict[str, Found]:
    """Of the page on segmentation and primitives."""
    found: dict[str, Found] = {}
    if results.alignment is not None:
        for name, method in (("aligned_as_printed", "wls_text"), ("aligned_with_crossings", RESULT)):
            found[name] = {
                row.primitive: Evidence(row.gain_mm, row.low_mm, row.high_mm, len(results.guesses))
                for row in results.alignment[results.alignment["method"] == method].itertuples()
            }
    first, rest = results.downsampling.iloc[0], results.downsampling.iloc[1:]
    if len(rest):
        shift = rest["max_shift_ms"] / (1e3 * results.reference.dt * rest["factor"])
        saved = rest["work"] / first["work"] * (rest["factor"] / first["factor"]) ** 2
        worst = saved.loc[(saved - 1.0).abs().idxmax()]
        found["downsampling"] = {
            "shift in coarse samples": exact(shift.max(), len(results.was_cut)),
            "work times g²": exact(worst, len(results.was_cut)),
        }
    if results.acceleration_jumps:
        switches = len(results.primitives) - 1
        found["smooth"] = {
            name: exact(100.0 * jump, switches) for name, jump in results.acceleration_jumps.items()
        }
    noisy = results.sweep_comparison[results.sweep_comparison["noise_mm"] > 0]
    if len(noisy):
        found["least_cut_error"] = {
            CUT_METHODS[method].name: weakest(
                Evidence(row.difference_ms, row.low_ms, row.high_ms, row.seeds) for row in rows.itertuples()
            )
            for method, rows in noisy.groupby("method", sort=False)
        }
    return found


def feedback_evidence(results: FeedbackResults) -> dict[str, Found]:
    """Of the page on feedback models."""
    found: dict[str, Found] = {}
    if len(results.comparison):
        for name, pairs in MODEL_PAIRS.items():
            found[name] = {
                primitive: weakest(model_gain(results, primitive, *pair) for pair in pairs)
                for primitive in results.adapted
            }
        shared = {name: results.dominant(name) for name in results.adapted}
        found["phase_dependent"] = {name: exact(one[2], len(one[0])) for name, one in shared.items()}
    return found | (_board_evidence(results.board) if results.board is not None else {})


def model_gain(results: FeedbackResults, primitive: str, better: str, worse: str) -> Evidence:
    """By how much the generalisation NMSE of one representation is below another's, in pairs over folds."""
    table = results.orderings[results.orderings["stopping"] == "validation"]
    keys = (table["primitive"] == primitive) & (table["better"] == better) & (table["worse"] == worse)
    rows = table[keys]
    if rows.empty:
        return UNKNOWN
    value, half = rows.iloc[0][["difference", "half_width"]]
    folds = results.comparison.loc[results.comparison["primitive"] == primitive, "fold"].nunique()
    return Evidence(value, value - half, value + half, folds)


def _board_evidence(board: BoardResults) -> dict[str, Found]:
    executions = len(board.scores) // len(board.primitives)
    found: dict[str, Found] = {
        "lower_cost": {
            name: weakest(board.lower(POINTWISE, NOMINAL, name, board.tilted_deg))
            for name in board.primitives
        },
        "in_the_unroll": weakest(board.lower(UNROLLED, POINTWISE, ALL, board.tilted_deg)),
        "tells_tilts_apart": {
            name: _weakest_step(rows, board.runs)
            for name, rows in board.coupling.groupby("primitive", sort=False)
        },
        "force_held": exact(board.force_error_percent, executions),
        "torque_monotone": {name: exact(step, board.runs) for name, step in board.torque_steps.items()},
    }
    if 0.0 in board.settings_deg:
        found["level_board"] = _rise(board.lower(POINTWISE, NOMINAL, ALL, [0.0])[0])
    return found


def _weakest_step(rows: pd.DataFrame, runs: int) -> Evidence:
    """Of the coupling term's steps from tilt to tilt, counted positive in the direction of their sum."""
    steps = rows.dropna(subset="step")
    if np.sign(steps["step"].sum()) < 0:
        steps = steps.assign(step=-steps["step"], low=-steps["high"], high=-steps["low"])
    return weakest(Evidence(row.step, row.low, row.high, runs) for row in steps.itertuples())


def _rise(lower: Evidence) -> Evidence:
    """By how much a cost is higher, of by how much it is lower."""
    return Evidence(-lower.value, -lower.high, -lower.low, lower.n)
