"""Tables of the three pages, with names for keys, units in headings and sensible digits."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import pandas as pd

from structlearn.core.metrics import mean_interval, verdict
from structlearn.feedback.coupling_dataset import PARTS
from structlearn.feedback.feedback_models import POINTWISE, UNROLLED
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
from structlearn.testbeds.scraping.page.board_results import BoardResults, ExecutionResults
from structlearn.testbeds.scraping.page.results import ScrapingResults
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


def tables(results: ScrapingResults, printed: Mapping[str, Any]) -> dict[str, Table]:
    """Tables of the three pages that have any rows; `printed`: see `page.published`."""
    cut, fed, refined = results.segmentation, results.feedback, results.refinement
    board = fed.board
    frames = {
        "demonstrations_left_out": cut.segmentation.left_out,
        "cut_points": cut.segmentation.cuts,
        "cut_errors": cut.errors_of_cuts,
        "alignment": cut.alignment,
        "noise_sweep": cut.sweep,
        "noise_sweep_comparison": cut.sweep_comparison,
        "downsampling": cut.downsampling,
        "reproduction": cut.fit,
        "coupling_checks": fed.checks,
        "model_errors": fed.model_errors.reset_index(),
        "model_orderings": fed.orderings,
        "model_nmse": nmse_beside_published(results, printed),
        "board_nominal": board.nominal.reset_index(),
        "board_costs": board.costs,
        "board_cost_ratios": board.ratios,
        "board_coupling": board.coupling,
        "path_errors": path_comparison(board, fed.seen_deg),
        "hand_roll": hand_rolls(board, fed.primitives, printed),
        "refinement_curves": refined.curves,
        "refinement_progress": refined.progress,
        "refinement_costs": refined.costs,
        "refinement_cost_ratios": refined.ratios,
        "refinement_between": refined.between,
        "refinement_faults": refined.faults,
    }
    if refined.examples:
        frames["hand_roll_refined"] = hand_rolls(refined, fed.primitives, printed)
    if len(refined.search):
        frames |= {"search_efficiency": refined.searches, "searches": refined.searched.reset_index()}
    return {name: _shown(frame) for name, frame in frames.items() if frame is not None and len(frame)}


def _shown(frame: pd.DataFrame) -> Table:
    """A table with names for keys and headings; rows of the method that is used below are bold."""
    headings = {name: HEADINGS.get(name, _heading(name)) for name in frame.columns}
    strong = frozenset(place for place, one in enumerate(frame.get("method", ())) if one == RESULT)
    return Table(frame, FORMATS, headings, strong, WORDS)


def _heading(column: str) -> str:
    """`mean_ms` as `mean (ms)`."""
    name, _, unit = column.rpartition("_")
    return f"{name.replace('_', ' ')} ({UNITS[unit]})" if name and unit in UNITS else column.replace("_", " ")


def nmse_beside_published(results: ScrapingResults, published: Mapping) -> pd.DataFrame:
    """Table IV.5: NMSE of PMNN with 100 nodes, mean ± std over the folds."""
    fed, rows = results.feedback, []
    for name in fed.adapted:
        title = primitive_title(fed.primitives, name)
        printed = published["nmse"].get(name, {})
        if printed:
            cells = {part: with_spread(mean, std, ".2f") for part in PARTS for mean, std in [printed[part]]}
            rows.append({"primitive": title, "which": "published"} | cells)
        for stopping, rule in (("generalization", ", as published"), ("validation", "")):
            error = fed.model_errors.loc[(name, "pmnn_100", stopping)]
            cells = {part: with_spread(error[f"{part}_mean"], error[f"{part}_std"], ".3f") for part in PARTS}
            which = f"here, step best for {WORDS['stopping'][stopping]}{rule}"
            rows.append({"primitive": title, "which": which} | cells)
    return pd.DataFrame(rows)


def path_comparison(board: BoardResults, seen_deg: Sequence[float]) -> pd.DataFrame:
    """Errors of the unrolled path, pointwise beside unrolled, in training settings and others.

    One row per `primitive` and `seen`: `count` of demonstrations, mean and std of both models, the mean
    paired difference `lower_deg` (pointwise minus unrolled), and the `verdict` on the unrolled model.
    """
    keys = ["primitive", "setting_deg", "demonstration"]
    wide = board.path_errors.pivot_table("error_deg", keys, "model").reset_index()
    known = wide["setting_deg"].isin(list(seen_deg))
    rows = []
    for name, seen in product(board.primitives, (True, False)):
        part = wide[(wide["primitive"] == name) & (known == seen)]
        if len(part):
            row: dict[str, object] = {"primitive": name, "seen": seen, "count": len(part)}
            for model in (POINTWISE, UNROLLED):
                row |= {f"{model}_deg": part[model].mean(), f"{model}_std": part[model].std()}
            lower, half_width = mean_interval((part[POINTWISE] - part[UNROLLED]).to_numpy())
            row |= {"lower_deg": lower, "half_width": half_width}
            rows.append(row | {"verdict": str(verdict(lower - half_width, lower + half_width))})
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
