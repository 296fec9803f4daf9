"""What was found for claims in one run, by the names that `*_claims.yaml` use.

What was found over people is in `people`.
"""

from collections.abc import Iterable

import numpy as np

from structlearn.reporting.claims import UNKNOWN, Evidence, Found, difference, mean
from structlearn.segmentation.method_comparison import errors_by_seed
from structlearn.segmentation.result import METHODS, RESULT
from structlearn.testbeds.scraping.names import CUT_METHODS
from structlearn.testbeds.scraping.page.segmentation_results import SegmentationResults


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


def sweep_evidence(results: SegmentationResults) -> dict[str, Found]:
    """Of the sweep's people.

    How much better the result's cut points are than each other method's, at the least clear level; and what
    is least true of down-sampling.
    """
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
    evidence: dict[str, Found] = {"least_cut_error": found} if len(wide) else {}
    worst = results.downsampling_worst
    named = {"work": "work", "shift": "shift_samples_text", "shift_ours": "shift_samples"}
    found = {f"downsampled_{name}": mean(worst[column]) for name, column in named.items() if len(worst)}
    return evidence | found
