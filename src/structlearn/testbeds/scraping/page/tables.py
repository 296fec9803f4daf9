"""Tables of the three pages; what the stages and results hold is shown as it is, with words for its keys."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from structlearn.feedback.coupling_dataset import PARTS
from structlearn.feedback.feedback_models import POINTWISE
from structlearn.reporting.document import Table
from structlearn.reporting.prose import with_spread
from structlearn.segmentation.alignment import RESULT
from structlearn.testbeds.scraping.names import (
    CUT_METHODS,
    REPRESENTATIONS,
    ROLLOUTS,
    RUNS,
    SEARCHES,
    primitive_title,
)
from structlearn.testbeds.scraping.page.execution_results import ExecutionResults
from structlearn.testbeds.scraping.page.feedback_results import FeedbackResults
from structlearn.testbeds.scraping.page.refinement_results import RefinementResults
from structlearn.testbeds.scraping.page.segmentation_results import SegmentationResults
from structlearn.testbeds.scraping.protocol.execution_scores import NOMINAL

LOOKS = CUT_METHODS | REPRESENTATIONS | RUNS | SEARCHES | ROLLOUTS
WORDS: Mapping[str, Mapping[Any, str]] = {
    column: {key: look.name for key, look in LOOKS.items()}
    for column in ("method", "model", "baseline", "representation", "better", "worse", "kind")
} | {
    "left_out": {False: "all", True: "all but the one compared"},
    "seen": {True: "learned from", False: "never learned from"},
    "stopping": {"validation": "validation", "generalization": "the one left out"},
}
"""By column, what is written for a key; names are those of figures and recordings."""

DECIMALS = {
    2: "spread_mm distance_mm gain_mm low_mm high_mm mean_mm mean_deg end_deg ratio reproduction_deg "
    "roll_torque_mn_m mean_shift_ms pointwise_deg pointwise_std unrolled_deg unrolled_std std_deg norm_rad "
    "others shift_samples shift_samples_text",
    1: "mean_ms max_shift_ms max_mm max_deg difference_ms low_ms high_ms half_width_ms mean std low high "
    "step lower_rad since_lower_rad since_half_width end_roll_deg cost_rad mean_below mean_above",
    3: "end_mm smoothing_deg difference lower_deg force_n force_std_n "
    + " ".join(f"{part}_{what}" for part in PARTS for what in ("mean", "std")),
    0: "max_ms",
}
FORMATS = {name: f".{digits}f" for digits, names in DECIMALS.items() for name in names.split()}
FORMATS |= {
    "half_width": ".3g",
    "noise_mm": "g",
    "setting_deg": "g",
    "work": ".2g",
    "p_value": ".2g",
    "dimensions": ".2g",
}
UNITS = {"mm": "mm", "ms": "ms", "deg": "°", "rad": "rad", "n": "N", "s": "s"}
HEADINGS = {
    "factor": "g",
    "which": "",
    "setting_deg": "board (°)",
    "better": "first",
    "worse": "second",
    "low": "from",
    "high": "to",
    "left_out": "learned from",
    "others": "other axes",
    "shift_samples": "largest, coarse samples",
    "shift_samples_text": "as printed, coarse samples",
    "roll_torque_mn_m": "roll torque (mN m)",
    "lower_rad": "lower by (rad)",
    "since_lower_rad": "lower than iteration 2 (rad)",
    "generalization": "generalisation",
}


def shown(frame: pd.DataFrame, **formats: str) -> Table:
    """A table with words for keys, units in its headings and a sensible number of digits."""
    headings = {name: HEADINGS.get(name, _heading(name)) for name in frame.columns}
    strong = frozenset(place for place, one in enumerate(frame.get("method", ())) if one == RESULT)
    return Table(frame, FORMATS | formats, headings, strong, WORDS)


def _heading(column: str) -> str:
    """`mean_ms` as `mean (ms)`."""
    name, _, unit = column.rpartition("_")
    return f"{name.replace('_', ' ')} ({UNITS[unit]})" if name and unit in UNITS else column.replace("_", " ")


def segmentation_tables(results: SegmentationResults) -> dict[str, Table]:
    """Of the page on segmentation and primitives; those without content are left out."""
    frames = {
        "demonstrations_left_out": results.segmentation.left_out,
        "cut_points": results.segmentation.cuts,
        "cut_errors": results.errors_of_cuts,
        "alignment": results.alignment,
        "noise_sweep": results.sweep,
        "noise_sweep_comparison": results.sweep_comparison,
        "downsampling": results.downsampling,
        "reproduction": results.fit,
    }
    return _with_content(frames)


def feedback_tables(results: FeedbackResults, published: Mapping) -> dict[str, Table]:
    """Of the page on feedback models."""
    frames = {
        "coupling_checks": results.coupling_checks,
        "model_errors": results.model_errors,
        "model_orderings": results.orderings,
        "model_nmse": nmse_beside_published(results, published),
        "board_nominal": results.board.nominal.reset_index(),
        "board_costs": results.board.costs,
        "board_cost_ratios": results.board.ratios,
        "board_coupling": results.board.coupling,
        "path_errors": results.board.path_comparison(results.seen_deg),
        "hand_roll": hand_rolls(results.board, results.primitives, published),
    }
    return _with_content(frames)


def refinement_tables(
    results: RefinementResults, primitives: Sequence[str], published: Mapping
) -> dict[str, Table]:
    """Of the page on refinement by trial; `primitives` are the names of all."""
    frames = {
        "refinement_curves": results.curves,
        "refinement_progress": results.progress,
        "refinement_costs": results.costs,
        "refinement_cost_ratios": results.ratios,
        "refinement_between": results.between,
        "refinement_faults": results.faults,
    }
    if results.examples:
        frames["hand_roll_refined"] = hand_rolls(results, primitives, published)
    if len(results.search):
        frames |= {"search_efficiency": results.searches, "searches": results.searched.reset_index()}
    return _with_content(frames)


def nmse_beside_published(results: FeedbackResults, published: Mapping) -> pd.DataFrame:
    """Table IV.5: NMSE of PMNN with 100 nodes, mean ± std over the folds."""
    rows = []
    for name in results.adapted:
        title = primitive_title(results.primitives, name)
        printed = published["nmse"].get(name, {})
        if printed:
            cells = {part: with_spread(mean, std, ".2f") for part in PARTS for mean, std in [printed[part]]}
            rows.append({"primitive": title, "which": "published"} | cells)
        for stopping, rule in (("generalization", ", as published"), ("validation", "")):
            error = results.model_error(name, "pmnn_100", stopping)
            cells = {part: with_spread(error[f"{part}_mean"], error[f"{part}_std"], ".3f") for part in PARTS}
            which = f"here, step best for {WORDS['stopping'][stopping]}{rule}"
            rows.append({"primitive": title, "which": which} | cells)
    return pd.DataFrame(rows)


def hand_rolls(executed: ExecutionResults, primitives: Sequence[str], published: Mapping) -> pd.DataFrame:
    """Figure IV.17: rolls of the hand in degrees; the protractor's stand beside those at the same tilt."""
    columns, printed = ["start", *(f"end of {name}" for name in primitives)], published["hand"]
    rows = []
    if executed.example_deg == printed["setting_deg"]:
        for model, words in ((NOMINAL, "no feedback"), (POINTWISE, "with feedback")):
            readings = [f"{reading:.1f}" for reading in printed[model]]
            rows.append({"which": f"published, {words}"} | dict(zip(columns, readings, strict=False)))
    for model, found in executed.hand_roll.groupby("model", sort=False):
        cells = [with_spread(*reading) for reading in zip(found["mean_deg"], found["std_deg"], strict=True)]
        rows.append({"which": f"here, {RUNS[model].name}"} | dict(zip(columns, cells, strict=True)))
    return pd.DataFrame(rows)


def _with_content(frames: Mapping[str, pd.DataFrame | None]) -> dict[str, Table]:
    return {name: shown(frame) for name, frame in frames.items() if frame is not None and len(frame)}
