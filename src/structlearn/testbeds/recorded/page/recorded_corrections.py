"""The part of the recorded page on corrected reaches: coupling over phase, and what it makes of the path."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Picture

from structlearn.ground.artefacts import Metrics
from structlearn.ground.metrics import mean_interval
from structlearn.palette import AXIS_COLOURS, BLACK, BLUE, DEMONSTRATION_COLOUR, REPRODUCTION_COLOUR
from structlearn.recordings.clmc import INCOMPLETE_REACHES
from structlearn.reporting.figures import canvas, styled
from structlearn.reporting.page import Prose, Section, Sizes, Table, beside
from structlearn.reporting.prose import interval, listing
from structlearn.testbeds.recorded.protocol.corrected_reaches import AXES, DATASET
from structlearn.testbeds.recorded.protocol.correction_splits import END, CorrectionResults

DISTANCES = {
    "nominal_mm": "nominal primitive",
    "coupling_mm": "with learned coupling",
    "spread_mm": "mean of the reaches learned from",
}
"""What the left-out reaches are compared with, by column of `CorrectionResults.distances`."""

PATHS = {
    "recorded": ("recorded, left out", DEMONSTRATION_COLOUR),
    "nominal": ("nominal primitive", BLUE),
    "coupling": ("with learned coupling", REPRODUCTION_COLOUR),
}


@styled
def targets_figure(results: CorrectionResults) -> Picture:
    """Coupling targets of all corrected reaches over phase, and what was learned from some of them."""
    figure = canvas(3.2)
    panels = figure.subplots(1, 3, sharey=True)
    for panel, axis, colour in zip(panels, AXES, AXIS_COLOURS, strict=True):
        rows = results.targets[results.targets["axis"] == axis]
        phase, mean, std = (rows[name].to_numpy() for name in ("phase", "mean", "std"))
        panel.fill_between(phase, mean - std, mean + std, color=colour, alpha=0.2, linewidth=0)
        panel.plot(phase, mean, color=colour, label="mean of the targets")
        panel.plot(phase, rows["learned"], color=BLACK, linestyle="--", linewidth=1.1, label="learned")
        _phase_axis(panel)
        panel.set_title(f"Local {axis}")
    panels[0].set_ylabel("coupling term (m)")
    panels[0].legend()
    return figure


@styled
def paths_figure(results: CorrectionResults) -> Picture:
    """Left-out reaches of one split from the side and from above, and distances from them over phase."""
    figure = canvas(3.6)
    side, above, distance = figure.subplots(1, 3)
    for kind, (label, colour) in PATHS.items():
        its = results.paths[results.paths["path"] == kind]
        for number, (_, path) in enumerate(its.groupby("reach", sort=False)):
            first = label if number == 0 else None
            millimetres = 1e3 * path[list(AXES)].to_numpy()
            side.plot(*millimetres[:, [0, 2]].T, color=colour, linewidth=1.0, alpha=0.8, label=first)
            above.plot(*millimetres[:, [0, 1]].T, color=colour, linewidth=1.0, alpha=0.8)
    side.set(title="From the side", xlabel="local x, along the reach (mm)", ylabel="local z, up (mm)")
    above.set(title="From above", xlabel="local x (mm)", ylabel="local y, sideways (mm)")
    for name, colour in zip(DISTANCES, (BLUE, REPRODUCTION_COLOUR, BLACK), strict=True):
        style = "--" if name == "spread_mm" else "-"
        label = DISTANCES[name] if name == "spread_mm" else None
        phase = results.profile["phase"]
        distance.plot(phase, results.profile[name], color=colour, linestyle=style, label=label)
    _phase_axis(distance)
    distance.set(title="Distance from left-out reaches", ylabel="mm", ylim=(0, None))
    handles, labels = side.get_legend_handles_labels()
    more_handles, more_labels = distance.get_legend_handles_labels()
    figure.legend(
        handles + more_handles, labels + more_labels, loc="outside upper left", ncols=4, columnspacing=1.6
    )
    return figure


def _phase_axis(panel: Axes) -> None:
    """Phase as it runs: from 1 down to 0."""
    panel.set(xlabel="phase p", xlim=(1.0, 0.0))


def pictures(results: CorrectionResults) -> dict[str, Picture]:
    """Figures by name."""
    return {"coupling_targets": targets_figure(results), "coupling_paths": paths_figure(results)}


def tables(results: CorrectionResults) -> dict[str, pd.DataFrame]:
    """Tables by name."""
    return {"corrected_reaches": results.distances, "coupling_scores": results.scores}


def distance_table(results: CorrectionResults) -> pd.DataFrame:
    """Distance of the left-out reaches from each of `DISTANCES`: mean, std over splits, worst reach.

    Returns:
        `path`, `mean_mm`, `std_mm`, `max_mm`.
    """
    by_split = results.distances.groupby("split")[list(DISTANCES)].mean()
    return pd.DataFrame(
        {
            "path": list(DISTANCES.values()),
            "mean_mm": by_split.mean().to_numpy(),
            "std_mm": by_split.std().to_numpy(),
            "max_mm": results.distances[list(DISTANCES)].max().to_numpy(),
        }
    )


def score_table(results: CorrectionResults) -> pd.DataFrame:
    """Per local axis: largest mean target, its spread, and the network on left-out targets.

    Returns:
        `axis`, `largest_m` (of the mean target over phase), `spread_m` (root mean square std over normalised
        time), `nmse` and `nmse_std` over splits, `target_end_share`, `residual_end_share`.
    """
    targets = results.targets.groupby("axis", sort=False)
    scores = results.scores.groupby("axis", sort=False)
    return pd.DataFrame(
        {
            "axis": list(AXES),
            "largest_m": targets["mean"].agg(lambda values: values.abs().max()).to_numpy(),
            "spread_m": targets["std"].agg(lambda values: np.sqrt((values**2).mean())).to_numpy(),
            "nmse": scores["nmse"].mean().to_numpy(),
            "nmse_std": scores["nmse"].std().to_numpy(),
            "target_end_share": scores["target_end_share"].mean().to_numpy(),
            "residual_end_share": scores["residual_end_share"].mean().to_numpy(),
        }
    )


def paired_difference_mm(results: CorrectionResults, first: str, second: str) -> tuple[float, float]:
    """Mean over reaches of one column of the distances minus another, and half of its 95 % interval.

    A reach counts once, with its mean over the splits that left it out.
    """
    by_reach = results.distances.groupby("reach")[[first, second]].mean()
    return mean_interval((by_reach[first] - by_reach[second]).to_numpy())


def metrics(results: CorrectionResults) -> Metrics:
    """Flat metrics of the corrected reaches."""
    distances = results.distances
    table = distance_table(results).set_index("path")
    names = {"nominal_mm": "nominal_path", "coupling_mm": "coupling_path", "spread_mm": "corrected_spread"}
    values: Metrics = {}
    for column, name in names.items():
        suffix = "_mm" if column == "spread_mm" else "_mean_mm"
        values[f"{name}{suffix}"] = table.loc[DISTANCES[column], "mean_mm"]
        values[f"{name}_std_mm"] = table.loc[DISTANCES[column], "std_mm"]
    for name, pair in (
        ("coupling_gain", ("nominal_mm", "coupling_mm")),
        ("coupling_above_spread", ("coupling_mm", "spread_mm")),
    ):
        values[f"{name}_mm"], values[f"{name}_half_width_mm"] = paired_difference_mm(results, *pair)
    values["coupling_path_end_share"] = distances["end_share"].mean()
    for row in score_table(results).itertuples():
        values[f"coupling_{row.axis}_nmse"] = row.nmse
    values["corrected_reaches_learned_from"] = int(distances["learned_from"].iloc[0])
    values["corrected_reaches_left_out"] = int((distances["split"] == 0).sum())
    return values


def section(results: CorrectionResults, sizes: Sizes) -> Section:
    """The section of the page."""
    return Section(
        "Higher reaches as corrections",
        (
            Prose(_what_was_done(results)),
            beside(
                "coupling_targets",
                sizes,
                "Coupling targets against the nominal primitive in the local frame, mean and standard "
                "deviation over the corrected reaches; dashed: learned in the first split. Time runs to the "
                "right, the second half of it in the last fifth of the phase.",
                "Coupling term of three local axes over phase, with a band for the spread.",
            ),
            Table(
                score_table(results),
                "Coupling targets, and the phase-only network on those of the left-out reaches (mean and std "
                f"over splits). At the end: in the last {_percent(END, 0)} of the movement.",
                formats={
                    "largest_m": ".1f",
                    "spread_m": ".1f",
                    "nmse": ".2f",
                    "nmse_std": ".2f",
                    "target_end_share": ".1%",
                    "residual_end_share": ".1%",
                },
                headings={
                    "axis": "local axis",
                    "largest_m": "largest mean (m)",
                    "spread_m": "spread (m)",
                    "nmse": "NMSE, left out",
                    "nmse_std": "std",
                    "target_end_share": "squared target at the end",
                    "residual_end_share": "squared error at the end",
                },
                source="tables/coupling_scores.csv",
            ),
            beside(
                "coupling_paths",
                sizes,
                "Left and middle: the reaches left out in the first split and what is unrolled to their "
                "goals, in their local frames (axes scaled separately). Right: mean distance from the "
                "left-out reaches over all splits.",
                "Paths from the side and from above, and distance over phase.",
            ),
            Table(
                distance_table(results),
                "Distance of the left-out reaches over normalised time; std over splits.",
                formats={"mean_mm": ".1f", "std_mm": ".1f", "max_mm": ".1f"},
                headings={
                    "path": "from",
                    "mean_mm": "mean (mm)",
                    "std_mm": "std (mm)",
                    "max_mm": "furthest reach (mm)",
                },
                source="tables/corrected_reaches.csv",
            ),
            Prose(_what_it_shows(results)),
        ),
    )


def _what_was_done(results: CorrectionResults) -> str:
    first = results.distances[results.distances["split"] == 0]
    learned, left_out = first["learned_from"].iloc[0], len(first)
    incomplete = len(INCOMPLETE_REACHES[DATASET])
    return (
        f"{learned + left_out + incomplete} more reaches have the same start and goal and a clearly higher "
        "arc. Their source does not say why; to take them for corrections is this page's reading. "
        f"{incomplete} of them begin or end in mid-air and are left aside, so {learned} are learned from and "
        f"{left_out} left out, in {results.distances['split'].nunique()} random splits. A corrected reach "
        "asks for a coupling term beside the nominal primitive's forcing term. With the phase as its only "
        "input, a phase-modulated network without hidden layer is linear; it is solved, not trained, "
        "and added to the nominal primitive, which is then unrolled to the goal and in the time of each "
        "left-out reach."
    )


def _what_it_shows(results: CorrectionResults) -> str:
    means = results.distances[list(DISTANCES)].mean()
    gain, gain_half = paired_difference_mm(results, "nominal_mm", "coupling_mm")
    above, above_half = paired_difference_mm(results, "coupling_mm", "spread_mm")
    if abs(above) <= above_half:
        verdict = "not to be told from"
    else:
        verdict = "further than" if above > 0 else "nearer than"
    scores = score_table(results)
    poor = scores[scores["nmse"] >= 1.0]["axis"]
    unexplained = (
        f" Along local {listing(poor)} the network is no better on left-out targets than their mean: there "
        "the reaches differ among each other more than their mean changes over phase."
        if len(poor)
        else ""
    )
    return (
        f"With the learned coupling the path is {means['coupling_mm']:.1f} mm from the left-out reaches "
        f"instead of {means['nominal_mm']:.1f} mm; reach by reach it is {gain:.1f} mm nearer (95 % "
        f"interval over reaches {interval(gain - gain_half, gain + gain_half)}). This is {verdict} the "
        f"{means['spread_mm']:.1f} mm between a reach and the mean of those learned from (difference "
        f"{interval(above - above_half, above + above_half)} mm), about the best that a movement which "
        f"knows no more than the phase can do.{unexplained} The last {_percent(END, 0)} of the movement, "
        f"where the phase velocity fades, holds {_percent(results.distances['end_share'].mean())} of the "
        f"remaining distance and {_percent(scores['target_end_share'].max())} or less of the squared "
        "targets: they fade there too."
    )


def _percent(share: float, digits: int = 1) -> str:
    return f"{100 * share:.{digits}f} %"
