"""What was found for claims in one run, by the names that `*_claims.yaml` use.

What was found over people is in `people`.
"""

from collections.abc import Iterable

import numpy as np

from structlearn.ground.metrics import BETTER, mean_interval
from structlearn.reporting.claims import UNKNOWN, Evidence, Found, counted, difference, exact
from structlearn.segmentation.method_comparison import errors_by_seed
from structlearn.segmentation.result import METHODS, RESULT
from structlearn.testbeds.scraping.names import CUT_METHODS
from structlearn.testbeds.scraping.page.execution_results import ALL
from structlearn.testbeds.scraping.page.refinement_results import RefinementResults
from structlearn.testbeds.scraping.page.segmentation_results import SegmentationResults
from structlearn.testbeds.scraping.protocol.executed_sets import AFTER, BEFORE, NOMINAL


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
    """Of the page on segmentation and primitives, where demonstrations are your own; and of the sweep."""
    found: dict[str, Found] = {}
    if results.alignment is not None:
        for name, method in (("aligned_as_printed", "wls_text"), ("aligned_with_crossings", RESULT)):
            found[name] = {
                row.primitive: Evidence(row.gain_mm, row.low_mm, row.high_mm, len(results.guesses))
                for row in results.alignment[results.alignment["method"] == method].itertuples()
            }
    if results.downsampling_worst is not None:
        shift, work = results.downsampling_worst
        found["downsampling"] = {
            "shift in coarse samples": exact(shift, len(results.was_cut)),
            "work times g²": exact(work, len(results.was_cut)),
        }
    if results.acceleration_jumps:
        switches = len(results.primitives) - 1
        found["smooth"] = {
            name: exact(100.0 * jump, switches) for name, jump in results.acceleration_jumps.items()
        }
    return found | sweep_evidence(results)


def sweep_evidence(results: SegmentationResults) -> dict[str, Found]:
    """How much better the result's cut points are than each other method's, at the least clear level."""
    wide = errors_by_seed(results.noise).pivot_table(
        index=["noise_mm", "seed"], columns="method", values="error_ms"
    )
    wide = wide[wide.index.get_level_values("noise_mm") > 0]
    levels = wide.index.unique("noise_mm")
    others = [method for method in METHODS if method in wide and method != RESULT]
    found = {
        CUT_METHODS[other].name: weakest(
            difference(rows[other], rows[RESULT], comparisons=len(others) * len(levels))
            for _, rows in wide[[other, RESULT]].dropna().groupby(level="noise_mm")
        )
        for other in others
    }
    return {"least_cut_error": found} if len(wide) else {}


def _rise(lower: Evidence) -> Evidence:
    """By how much a cost is higher, of by how much it is lower."""
    return Evidence(-lower.value, -lower.high, -lower.low, lower.n)


def refinement_evidence(results: RefinementResults) -> dict[str, Found]:
    """Of the page on refinement by trial."""
    found: dict[str, Found] = {"converged": {name: _later_gains(results, name) for name in results.refined}}
    if results.evaluated:
        tilt = results.example_deg
        found["lower_after"] = {
            name: results.lower(AFTER, BEFORE, name, [tilt])[0] for name in results.refined
        }
        if results.parameters.added_runs == 1:
            found["text_form"] = found["lower_after"]
        found["share_left"] = {
            name: mean_ratio(*(results.run_costs(model, tilt, name) for model in (AFTER, BEFORE)))
            for name in results.refined
        }
    if results.seen_deg:
        found["seen_kept"] = {
            name: _rise(weakest(results.lower(AFTER, BEFORE, name, results.seen_deg)))
            for name in results.primitives
        }
    if len(results.between):
        found["in_between"] = {
            f"{row.primitive}, {row.model}": weakest(
                results.margins(row.primitive, row.model, (row.below_deg, row.setting_deg, row.above_deg))
            )
            for row in results.between.itertuples()
        }
    if results.tilted_deg:
        found["nominal_is_worst"] = {
            name: weakest(
                gain
                for model in (BEFORE, AFTER)
                for gain in results.lower(model, NOMINAL, name, results.tilted_deg)
            )
            for name in results.primitives
        }
    if 0.0 in results.settings_deg:
        found["level_board_after"] = _rise(results.lower(AFTER, NOMINAL, ALL, [0.0])[0])
    return found


def mean_ratio(first: np.ndarray, second: np.ndarray) -> Evidence:
    """Ratio of the means of samples (N,) in pairs, with its interval to first order."""
    ratio = float(np.mean(first) / np.mean(second))
    _, half = mean_interval(np.asarray(first) - ratio * np.asarray(second))
    half = half / float(np.mean(second))
    return Evidence(ratio, ratio - half, ratio + half, len(first))


def _later_gains(results: RefinementResults, primitive: str) -> Evidence:
    """How many of the iterations after the published number are significantly lower.

    None where the threshold ended the refinement by then; not known where the last iteration did, or where a
    difference has no interval.
    """
    later = results.later(primitive)
    if later.empty:
        return counted(0, 0) if results.met(primitive) else UNKNOWN
    if later["since_half_width"].isna().any():
        return UNKNOWN
    return counted(int((later["since_verdict"] == BETTER).sum()), len(later))
