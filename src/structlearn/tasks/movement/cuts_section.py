"""Page sections on recordings and cuts: rates, gaps, primitives over time, what is left out or flagged."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.palette import BLACK, METHOD_NAMES
from structlearn.readers.demonstration import POSE, Demonstration
from structlearn.reporting.document import Table
from structlearn.reporting.evidence import difference
from structlearn.reporting.figure_style import PANEL_WIDTH, canvas, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.movement_figures import draw_cuts, noise_figure, shade_primitives, speed
from structlearn.reporting.prose import level_name, listing
from structlearn.segmentation.alignment import METHODS, RESULT
from structlearn.segmentation.cut_errors import errors_by_level, errors_by_seed, paired_comparison
from structlearn.segmentation.quality import MEASURES, OF_JOINTS, quality
from structlearn.segmentation.segments import Segmentation
from structlearn.tasks.movement.movement_learning import cut_metrics
from structlearn.tasks.movement.parameters import MovementEntry
from structlearn.tasks.section import Section, shown
from structlearn.tasks.task_files import TaskFiles

DRAWN = 12  # demonstrations with drawn speed; of more, flagged ones come first
ENDS = ["start_s", "end_s"]
CASES = {  # claims on cuts of movements between rests: pairs of methods whose errors are compared
    "printed_over_crossing": ("zvc", "wls_published"),
    "printed_over_least_squares": ("ls", "wls_published"),
    "ours_over_crossing": ("zvc", "wls"),
    "ours_over_warping": ("dtw", "wls"),
}


def recordings_section(files: TaskFiles) -> Section:
    """Section on the sets of recordings with their files, rates and gaps."""
    table, clock = files.table("recorded/recordings"), files.entry(MovementEntry).clock
    sets = table.groupby("set", sort=False).agg(
        files=("recording", "size"),
        shortest_s=("duration_s", "min"),
        longest_s=("duration_s", "max"),
        poses_hz=("pose_hz", "median"),
        largest_gap_ms=("largest_gap_ms", "max"),
        signals=("signals", "first"),
    )
    words = {"recording": "file", "pose_hz": "poses_hz"}
    tables = {"sets": shown(sets.reset_index()), "recordings": shown(table.rename(columns=words))}
    facts: dict[str, Any] = {"clock_hz": clock.rate_hz if clock else None, "repeats": 0}
    facts |= {"stamps": sorted({note for note in table["stamps"] if note})}
    if (files.recorded / "repeats.parquet").exists():
        repeats = files.table("recorded/repeats")
        tables["repeats"] = shown(repeats.rename(columns=words), **dict.fromkeys(ENDS, ".2f"))
        facts |= {"repeats": len(repeats), "repeated": repeats["recording"].nunique()}
    return Section("recorded", "Recordings", facts=facts, tables=tables)


def cuts_section(files: TaskFiles) -> Section:
    """Section on the cuts: start and end of each primitive in each demonstration."""
    own, segmentation = files.entry(MovementEntry), files.segmentation()
    demonstrations = files.runs("demonstrations", POSE)
    by_name, flagged = (
        {demonstration.name: demonstration for demonstration in demonstrations},
        set(segmentation.warnings["demonstration"]),
    )
    cut = [name for name in by_name if name in set(segmentation.cuts["demonstration"])]
    drawn = sorted(cut, key=lambda name: name not in flagged)[:DRAWN] if own.presegmented is None else []
    points = pd.concat([segmentation.result(name).reset_index() for name in segmentation.primitives])
    points = points[["demonstration", "primitive", *ENDS]].sort_values(
        ["demonstration", "start_s"], kind="stable"
    )
    facts = {
        "cut": len(cut),
        "presegmented": own.presegmented,
        "drawn": len(drawn),
        "reference": segmentation.reference,
        "onsets": own.segment is not None and own.segment.at_onsets,
        "left_out": len(segmentation.left_out),
        "warnings": len(segmentation.warnings),
        "flagged": [name for name in cut if name in flagged],
        "kept": own.keep_flagged,
        "true": any(demonstration.true_segments is not None for demonstration in demonstrations),
    }
    tables = {
        "lengths": shown(primitive_lengths(by_name, segmentation), start_to_end_mm=".0f", start_to_end=".3g"),
        "left_out": Table(segmentation.left_out),
        "warnings": Table(segmentation.warnings, {"number": ".2f"}),
    }
    if own.presegmented is None:  # quality of each demonstration, the best first; outliers are bold
        made = quality(demonstrations, segmentation.results, own.fit.smoothing_hz)
        measures = OF_JOINTS if own.of_joints else MEASURES
        ranked = made.sort_values("rank", kind="stable").reset_index(drop=True)[
            ["rank", "demonstration", *measures, "outlier"]
        ]
        strong = frozenset(np.flatnonzero(ranked["outlier"] != "").tolist())
        tables["quality"] = shown(ranked, strong)
        facts["outliers"] = made.loc[made["outlier"] != "", "demonstration"].tolist()
    tables["cut_points"] = shown(points, **dict.fromkeys(ENDS, ".3f"))
    metrics = cut_metrics(demonstrations, segmentation)
    return Section(
        "cuts",
        "Cuts",
        facts=facts,
        find=Findings.of_metrics(metrics, ("cuts_demonstrations", "cuts_warnings")),
        tables=tables,
        pictures={"cuts": [speed_panel(by_name[name], segmentation) for name in drawn]} if drawn else {},
    )


def primitive_lengths(demonstrations: dict[str, Demonstration], segmentation: Segmentation) -> pd.DataFrame:
    """Durations of the primitives, and distances from their start to their end, one row each.

    Of joints in their unit, as `start_to_end`.
    """
    rows, of_joints = [], any(run.of_joints for run in demonstrations.values())
    for name, cuts in segmentation.results.items():
        distances = []
        for demonstration, cut in cuts.iterrows():
            run = demonstrations[str(demonstration)]
            ticks = [min(round(cut[end] / run.dt), len(run.time) - 1) for end in ENDS]
            distances.append((1.0 if of_joints else 1e3) * np.linalg.norm(np.subtract(*run.position[ticks])))
        durations = cuts["end_s"] - cuts["start_s"]
        rows.append((name, durations.mean(), durations.min(), durations.max(), np.mean(distances)))
    distance = "start_to_end" if of_joints else "start_to_end_mm"
    return pd.DataFrame(rows, columns=["primitive", "mean_s", "shortest_s", "longest_s", distance])


def rests_section(files: TaskFiles) -> Section | None:
    """Section on how well whole movements are found between rests."""
    if files.entry(MovementEntry).rests is None:
        return None
    errors = files.table("segments/cut_errors")
    by_seed = errors_by_seed(errors)
    by_level, compared = errors_by_level(by_seed), paired_comparison(by_seed)
    wide = by_level.pivot_table(index="noise_mm", columns="method", values="mean_ms")
    winners = [f"“{METHOD_NAMES[method]}” at {level:g} mm" for level, method in wide.idxmin(axis=1).items()]
    headings = {method: f"{name} (ms)" for method, name in METHOD_NAMES.items()} | {"noise_mm": "noise (mm)"}
    (primitive,) = errors["primitive"].unique()
    find = Findings()
    for row in by_level.itertuples():
        name = f"{primitive}_cut_error_ms_{level_name(row.noise_mm)}mm"
        name += f"_{row.method}" if row.method != RESULT else ""
        find.exact(name, row.mean_ms, unit="ms", headline=name.endswith("_2mm"))
    find = find.among("movements, averaged over draws of rests and noise")
    # pairs are movements, averaged over draws of rests and noise, which differ little without noise
    both_ends = 1e3 * errors[["start_error_s", "end_error_s"]].abs().mean(axis=1)
    paired = errors.assign(error_ms=both_ends).pivot_table(
        "error_ms", ["noise_mm", "demonstration"], "method"
    )
    for name, (first, second) in CASES.items():
        levels = paired.dropna(subset=[first, second]).groupby(level="noise_mm")
        gains = {f"{level:g} mm": difference(errors[first], errors[second]) for level, errors in levels}
        find.add(name, gains, unit="ms")
    table = Table(wide[list(METHODS)].reset_index(), dict.fromkeys(METHODS, ".1f"), headings)
    return Section(
        "rests",
        "Cuts between simulated rests",
        facts={"between": listing(winners)},
        find=find,
        tables={"noise": table, "comparison": Table(compared)},
        pictures={"noise": noise_figure(by_level, compared, "noise added (mm)", "same draw")},
    )


@styled
def speed_panel(demonstration: Demonstration, segmentation: Segmentation) -> Figure:
    """Speed of one demonstration with its primitives and cuts."""
    figure = canvas(1.8, PANEL_WIDTH)
    panel = figure.subplots()
    factor, unit = (1.0, "joints per s") if demonstration.of_joints else (1e3, "mm/s")
    panel.plot(demonstration.time, factor * speed(demonstration), color=BLACK)
    names = segmentation.primitives
    cuts = [tuple(segmentation.result(name).loc[demonstration.name, ENDS]) for name in names]
    shade_primitives(panel, cuts, names)
    draw_cuts(panel, cuts, demonstration)
    label = f"{demonstration.name}: time (s)"
    panel.set(xlim=demonstration.time[[0, -1]], xlabel=label, ylabel=f"speed ({unit})")
    return figure
