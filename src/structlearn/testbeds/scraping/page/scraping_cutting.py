"""Sections on the cutting: figures IV.14 and IV.15, noise and down-sampling."""

from collections.abc import Sequence

import pandas as pd

from structlearn.ground.metrics import BETTER, UNDECIDED, WORSE
from structlearn.reporting.page import Block, Prose, Section, Sizes, Table, beside
from structlearn.reporting.prose import capitalised, counted, interval, listing
from structlearn.reporting.segmentation_figures import METHOD_NAMES
from structlearn.segmentation.result import METHODS, RESULT
from structlearn.testbeds.scraping.page.scraping_results import ScrapingResults


def correspondences(results: ScrapingResults, sizes: Sizes) -> Section:
    """The alignment of one demonstration with the reference (figure IV.14), and the errors of the cuts."""
    primitive = results.found_primitives[0]
    guess = results.most_refined_guess(primitive.name)
    blocks: list[Block] = [
        Prose(
            "Dynamic time warping pairs samples of a guessed segment with samples of the reference. Weighted "
            "least squares fits `t_guess = τ t_ref + d` to the pairs (eq. IV.15, IV.18): pairs at near-zero "
            "velocity are dropped, the others weigh `exp(-k |v_ref - v_guess|)`."
        ),
        Prose(
            "Two weighted variants are kept. “As printed” uses the pairs alone. They lie in mid-movement, "
            "where two trials of one person differ in shape, and the cut is an extrapolation to the ends. "
            "“With crossings”, which makes the cuts used below, also counts the zero-velocity crossings at "
            "both ends as correspondences; a crossing far from the printed alignment counts less."
        ),
        beside(
            "correspondences",
            sizes,
            f"As figure IV.14, for primitive “{primitive.name}” on {primitive.axis}, demonstration "
            f"{guess.name}: the one in which ordinary and weighted least squares differ most. (a) Pairs "
            "without weights. (b) Pairs of largest weight, chosen not to be neighbours. (c) Refined "
            "segments, stretched to the reference.",
            "Reference and guess with lines between corresponding samples, and the refined segments.",
        ),
    ]
    errors = results.errors_of_cuts
    if errors is not None:
        means = errors.set_index("method")["mean_ms"]
        best = means.idxmin()
        sentence = f"On this set “{METHOD_NAMES[best]}” has the smallest mean error, {means[best]:.0f} ms"
        if best != RESULT:
            sentence += f"; “{METHOD_NAMES[RESULT]}” has {means[RESULT]:.0f} ms"
        count = len(results.guesses)
        blocks += [
            Prose(
                f"{sentence}. {capitalised(counted(count, 'demonstration'))} of one person "
                "cannot rank the methods; the noise sweep below has more."
            ),
            Table(
                errors.assign(method=_named(errors["method"])),
                "Absolute error of the cut points of primitives with an axis, start and end, against the "
                "true ones of the simulation; the reference is left out.",
                formats={"mean_ms": ".1f", "max_ms": ".0f"},
                headings={"mean_ms": "mean (ms)", "max_ms": "largest (ms)"},
                strong=_rows_of_result(errors),
                source="tables/cut_errors.csv",
            ),
        ]
    return Section("One reference, one guess", tuple(blocks), results.simulated)


def alignment(results: ScrapingResults, sizes: Sizes) -> Section:
    """The segments of all demonstrations aligned (figure IV.15)."""
    blocks: list[Block] = []
    table = results.alignment
    if table is None:
        blocks.append(Prose("Only the reference could be cut; there is nothing to align."))
    else:
        blocks += [
            Prose(
                "Each segment is stretched to the duration of the reference and shifted to its own mean. "
                "The spread is the mean distance between all pairs of segments; the distance is that from "
                "the reference's segment, which allows a test in pairs against ordinary least squares. "
                "A small spread is not the same as a small error: cuts that are all late by the same time "
                "lie close together too."
            ),
            beside(
                "alignment",
                sizes,
                "As figure IV.15a and b: segments before the refinement (zero-velocity crossing) and after "
                "it. Black: the reference.",
                "Stretched segments of all demonstrations, one row per primitive, one column per method.",
            ),
            Table(
                table.assign(method=_named(table["method"])),
                "How closely the segments lie together. Gain: distance by ordinary least squares minus that "
                "of the row, with its 95 % confidence interval over the demonstrations.",
                formats=dict.fromkeys(("spread_mm", "distance_mm", "gain_mm", "low_mm", "high_mm"), ".2f"),
                headings={
                    "spread_mm": "spread (mm)",
                    "distance_mm": "distance (mm)",
                    "gain_mm": "gain (mm)",
                    "low_mm": "from",
                    "high_mm": "to",
                    "verdict": "than ordinary",
                },
                strong=_rows_of_result(table),
                source="tables/alignment.csv",
            ),
        ]
    blocks.append(
        beside(
            "space",
            sizes,
            "As figure IV.15c: all demonstrations in space, coloured by primitive. A primitive that only "
            "turns the tool is little more than a point.",
            "Paths of all demonstrations in three dimensions and from above, coloured by primitive.",
        )
    )
    return Section("All demonstrations aligned", tuple(blocks), results.simulated)


def noise(results: ScrapingResults, sizes: Sizes) -> Section:
    """How the cut errors grow with noise, and whether one method is better than another."""
    comparison, sweep = results.sweep_comparison, results.sweep
    levels = sorted(sweep["noise_mm"].unique())
    wide = sweep.pivot_table(index="noise_mm", columns="method", values="mean_ms")
    wide = wide[[method for method in METHODS if method in wide]].reset_index().rename_axis(columns=None)
    blocks: list[Block] = [
        Prose(
            f"{comparison['seeds'].max()} simulated people per noise level demonstrate the task; the same "
            "people at every level, only the noise grows. These are movements as the person means them, "
            "without arm and board. The errors of one person's demonstrations are averaged first. "
            f"{_left_out_of_sweep(results)}"
        ),
        Prose(_ranking(wide)),
        Prose(
            "Tested in pairs, “with crossings” is "
            + "; ".join(
                _verdicts(other, comparison[comparison["method"] == other], len(levels))
                for other in comparison["method"].unique()
            )
            + "."
        ),
        beside(
            "noise_sweep",
            sizes,
            "Left: mean absolute error of the cut points over the people, with its 95 % confidence interval; "
            "note the logarithmic scale. Right: error of the other methods minus that of “weighted, with "
            "crossings”, in pairs; above zero “with crossings” is better. Time warping is left out there.",
            "Cut error over noise level for five methods, and paired differences to the weighted method.",
        ),
        Table(
            wide,
            "Mean absolute cut error in ms by noise level.",
            formats={"noise_mm": "g"} | dict.fromkeys(METHODS, ".1f"),
            headings={"noise_mm": "noise (mm)"} | METHOD_NAMES,
            source="tables/noise_sweep.csv",
        ),
        Table(
            _differences(comparison),
            "Comparison in pairs over the people: error of each method minus that of “weighted, with "
            "crossings” in ms, with its 95 % confidence interval by the t distribution.",
            formats={"noise_mm": "g"},
            headings={"noise_mm": "noise (mm)"} | METHOD_NAMES,
            source="tables/noise_sweep_comparison.csv",
        ),
    ]
    return Section("Robustness against noise", tuple(blocks), simulated=True)


def downsampling(results: ScrapingResults, sizes: Sizes) -> Section:
    """What down-sampling the alignment saves and costs (appendix C)."""
    effect = results.downsampling
    return Section(
        "Down-sampling",
        (
            Prose(
                "Time warping fills a table of as many cells as the product of both lengths. Using every "
                "g-th sample of both divides them by g² (appendix C). The pairs become coarser by g, their "
                "fit much less so. The cells are counted here; `make bench` measures the time."
            ),
            beside(
                "downsampling",
                sizes,
                "Left: cells of the table. Right: how far the cut points move against the smallest g.",
                "Work and shift of cut points over the down-sampling factor.",
            ),
            Table(
                effect,
                "Work and shift of the cut points “with crossings” by down-sampling factor.",
                formats={"work": ".2g", "mean_shift_ms": ".2f", "max_shift_ms": ".1f"},
                headings={
                    "factor": "g",
                    "work": "work",
                    "mean_shift_ms": "mean shift (ms)",
                    "max_shift_ms": "largest shift (ms)",
                },
                source="tables/downsampling.csv",
            ),
        ),
        results.simulated,
    )


def _left_out_of_sweep(results: ScrapingResults) -> str:
    if results.sweep_left_out == 0:
        return "Every demonstration could be cut."
    if results.sweep_left_out == 1:
        return "One demonstration could not be cut and is not counted."
    return f"{results.sweep_left_out} demonstrations could not be cut and are not counted."


def _ranking(wide: pd.DataFrame) -> str:
    """What the means say: where the result is best, and where the printed variant loses to plain crossing."""
    noisy = wide[wide["noise_mm"] > 0]
    others = noisy.drop(columns=["noise_mm", RESULT])
    lost = noisy[others.min(axis=1) <= noisy[RESULT]]
    ours = f"“{METHOD_NAMES[RESULT]}”"
    if noisy.empty:
        text = ""
    elif lost.empty:
        text = f"By its mean, {ours} has the smallest error at every level with noise. "
    else:
        better = listing(
            f"“{METHOD_NAMES[others.loc[place].idxmin()]}” at {noisy.loc[place, 'noise_mm']:g} mm"
            for place in lost.index
        )
        text = f"By its mean, {ours} does not have the smallest error everywhere: {better} is better. "
    if {"wls_text", "zvc"} <= set(wide.columns):
        behind = wide.loc[wide["wls_text"] > wide["zvc"], "noise_mm"].tolist()
        if behind:
            where = "every level" if len(behind) == len(wide) else _millimetres(behind)
            text += f"“As printed”, it has a larger error than the plain crossing at {where}."
        else:
            text += "“As printed”, too, it has a smaller error than the plain crossing at every level."
    return text


def _verdicts(other: str, rows: pd.DataFrame, count: int) -> str:
    """What the paired test says against one other method."""
    parts = []
    for verdict, words in (
        (BETTER, "better than"),
        (WORSE, "worse than"),
        (UNDECIDED, "not distinguishable from"),
    ):
        levels = rows.loc[rows["verdict"] == verdict, "noise_mm"].tolist()
        if levels:
            where = f"all {count} levels" if len(levels) == count else _millimetres(levels)
            parts.append((words, where))
    (words, where), *more = parts
    text = f"{words} “{METHOD_NAMES[other]}” at {where}"
    return text + "".join(f", {words} it at {where}" for words, where in more)


def _differences(comparison: pd.DataFrame) -> pd.DataFrame:
    """One row per level, one column per other method: mean difference and its interval as text."""
    text = [
        f"{row.difference_ms:.1f} {interval(row.low_ms, row.high_ms)}".replace("-", "\N{MINUS SIGN}")
        for row in comparison.itertuples()
    ]
    wide = comparison.assign(text=text).pivot_table(
        index="noise_mm", columns="method", values="text", aggfunc="first"
    )
    return wide[list(comparison["method"].unique())].reset_index().rename_axis(columns=None)


def _rows_of_result(table: pd.DataFrame) -> frozenset[int]:
    return frozenset(place for place, method in enumerate(table["method"]) if method == RESULT)


def _named(methods: pd.Series) -> pd.Series:
    """Methods by the names that readers know from the figures."""
    return methods.map(METHOD_NAMES)


def _millimetres(levels: Sequence[float]) -> str:
    return listing(f"{level:g}" for level in levels) + " mm"
