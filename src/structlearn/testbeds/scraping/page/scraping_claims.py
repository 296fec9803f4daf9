"""The dissertation's statements on this testbed, beside what is found here."""

import pandas as pd

from structlearn.ground.metrics import BETTER, UNDECIDED, WORSE
from structlearn.reporting.page import Prose, Section, Table
from structlearn.reporting.prose import interval, listing
from structlearn.reporting.segmentation_figures import METHOD_NAMES
from structlearn.segmentation.method_comparison import wins_at_every_noise_level
from structlearn.testbeds.scraping.page.feedback_claims import feedback_claims
from structlearn.testbeds.scraping.page.refinement_claims import refinement_claims
from structlearn.testbeds.scraping.page.scraping_results import ScrapingResults

SMOOTH_JUMP = 0.01
"""A jump of the acceleration below this fraction of its maximum is what a smooth path does in one sample."""


def claims(results: ScrapingResults) -> Section:
    """The dissertation's statements on this testbed, beside what is found here."""
    rows = []
    if results.alignment is not None:
        table = results.alignment.set_index(["primitive", "method"])
        for primitive in results.found_primitives:
            ordinary = table.loc[(primitive.name, "ls")]
            for method in ("wls_text", "wls"):
                row = table.loc[(primitive.name, method)]
                rows.append(
                    (
                        f"Weighted least squares aligns “{primitive.name}” better than ordinary",
                        "Fig. IV.15b" if method == "wls_text" else "Fig. IV.15b, our variant",
                        f"spread {ordinary.spread_mm:.2f} → {row.spread_mm:.2f} mm; closer to the reference "
                        f"by {row.gain_mm:.2f} mm, 95 % CI {interval(row.low_mm, row.high_mm, '.2f')}",
                        {BETTER: "yes", WORSE: "no"}.get(row.verdict, UNDECIDED),
                    )
                )
    finest = results.downsampling.iloc[0]
    limit = 1e3 * results.reference.dt * results.downsampling["factor"]
    rest = results.downsampling.iloc[1:]
    if len(rest):
        worst = rest.iloc[-1]
        rows.append(
            (
                "Down-sampling by g divides the work by g² and leaves the alignment as it is",
                "Appendix C",
                f"up to g = {worst.factor:.0f} ({finest.work / worst.work:.0f} times less work) cut points "
                f"move {rest['mean_shift_ms'].max():.1f} ms on average and {rest['max_shift_ms'].max():.1f} "
                "ms at most; yes means: never more than one coarse sample",
                "yes" if (results.downsampling["max_shift_ms"] <= limit).all() else "no",
            )
        )
    for name, jump in results.acceleration_jumps.items():
        rows.append(
            (
                "Position, velocity and acceleration do not jump where primitives join",
                "eq. IV.12 to IV.14",
                f"{name} sequence: acceleration changes by {100 * jump:.2g} % of its maximum in the sample "
                f"of a switch; yes means: less than {100 * SMOOTH_JUMP:g} %",
                "yes" if jump < SMOOTH_JUMP else "no",
            )
        )
    if (results.sweep["noise_mm"] > 0).any():
        rows.append(_sweep_claim(results))
    if results.feedback is not None:
        rows += feedback_claims(results.feedback)
        if results.feedback.refinement is not None:
            rows += refinement_claims(results.feedback.refinement)
    frame = pd.DataFrame(rows, columns=["statement", "source", "here", "holds"])
    return Section(
        "Dissertation and reproduction",
        (
            Prose(
                "Statements of the dissertation, which shows these results as pictures, for the most part "
                "without numbers, and of this project, beside what is found here. An ordering holds if the "
                "95 % confidence interval of the difference in pairs excludes zero; it is undecided if the "
                "interval includes zero."
            ),
            Table(frame),
        ),
        results.simulated,
    )


def _sweep_claim(results: ScrapingResults) -> tuple[str, str, str, str]:
    """Whether weighted least squares finds the best cut points, at the levels with noise."""
    noisy = results.sweep_comparison[results.sweep_comparison["noise_mm"] > 0]
    smallest = wins_at_every_noise_level(results.sweep)
    decided = (noisy["verdict"] == BETTER).all()
    open_against = [
        f"{METHOD_NAMES[method]} at {(rows['verdict'] != BETTER).sum()} of {len(rows)}"
        for method, rows in noisy.groupby("method", sort=False)
        if (rows["verdict"] != BETTER).any()
    ]
    return (
        "Weighted least squares with crossings finds better cut points than every other method, whatever the "
        "noise",
        "this project",
        (
            "its mean error is the smallest at every level"
            if smallest
            else "its mean error is not always smallest"
        )
        + (f"; in pairs it is not proven better than {listing(open_against)} levels" if open_against else ""),
        "no" if not smallest else "yes" if decided else UNDECIDED,
    )
