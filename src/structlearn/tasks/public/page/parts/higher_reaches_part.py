"""Higher reaches as corrections of the others: what coupling over phase alone makes of them."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.core import signals
from structlearn.core.artefacts import Metrics
from structlearn.core.metrics import mean_interval
from structlearn.palette import AXIS_COLOURS, BLACK, LIGHT_GREY
from structlearn.primitives.position import in_local_frame
from structlearn.reporting.claims import Found, difference, mean
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import styled
from structlearn.reporting.panels import SAMPLES, legend, panel
from structlearn.reporting.prose import listing
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page.parts import reaches_part
from structlearn.tasks.public.page.parts.part import Part, Pictures
from structlearn.tasks.public.page.recorded_results import AXES, RecordedResults
from structlearn.tasks.public.page.recorded_tables import shown


def by_reach(results: RecordedResults) -> pd.DataFrame:
    """Distances of the left-out higher reaches, one row per reach: its mean over the splits."""
    return results["coupling_distances"].groupby("reach").mean(numeric_only=True)


def metrics(results: RecordedResults) -> Metrics:
    """Distances of the left-out higher reaches; their std is over the splits, differences are by reach."""
    distances, reaches = results["coupling_distances"], by_reach(results)
    by_split = distances.groupby("split")[["nominal_mm", "coupling_mm", "spread_mm"]].mean()
    values: Metrics = {}
    for column, its_mean, its_std in (
        ("nominal_mm", "nominal_path_mean_mm", "nominal_path_std_mm"),
        ("coupling_mm", "coupling_path_mean_mm", "coupling_path_std_mm"),
        ("spread_mm", "corrected_spread_mm", "corrected_spread_std_mm"),
    ):
        values |= {its_mean: by_split[column].mean(), its_std: by_split[column].std()}
    for name, first, second in (
        ("coupling_gain", "nominal_mm", "coupling_mm"),
        ("coupling_above_spread", "coupling_mm", "spread_mm"),
    ):
        middle, half = mean_interval((reaches[first] - reaches[second]).to_numpy())
        values |= {f"{name}_mm": middle, f"{name}_half_width_mm": half}
    values["coupling_path_end_share"] = distances["end_share"].mean()
    for axis, its in results["coupling_scores"].groupby("axis"):
        values[f"coupling_{axis}_nmse"] = its["nmse"].mean()
    values["corrected_reaches_learned_from"] = int(distances["learned_from"].iloc[0])
    values["corrected_reaches_left_out"] = int((distances["split"] == 0).sum())
    return values


def evidence(results: RecordedResults) -> dict[str, Found]:
    """By the names of the claims."""
    reaches = by_reach(results)
    return {
        "coupling_gain": difference(reaches["nominal_mm"], reaches["coupling_mm"]),
        "coupling_above_mean": difference(reaches["coupling_mm"], reaches["spread_mm"]),
        "coupling_end": mean(100 * reaches["end_share"]),
    }


def facts(results: RecordedResults) -> dict[str, object]:
    """Values for its sentences."""
    targets = results["coupling_scores"].groupby("axis")
    ends = results["coupling_completeness"]
    return {
        "incomplete": int((~ends["complete"]).sum()),
        "higher_reaches": len(ends),
        "splits": results["coupling_distances"]["split"].nunique(),
        "poor_axes": listing(targets["nmse"].mean().loc[lambda error: error >= 1.0].index, "no axis"),
        "target_end_percent": 100 * targets["target_end_share"].mean().max(),
    }


def tables(results: RecordedResults) -> dict[str, Table]:
    """Tables keyed by name."""
    return {
        "coupling_paths": shown(_paths(results)),
        "coupling_axes": shown(_axes(results), largest_m=".1f", spread_m=".1f"),
    }


def _paths(results: RecordedResults) -> pd.DataFrame:
    """Distance of left-out reaches from every path: mean and std over the splits, and the largest."""
    distances = results["coupling_distances"]
    rows = []
    for key in ("nominal", "coupling", "spread"):
        means = distances.groupby("split")[f"{key}_mm"].mean()
        rows.append((public_names.PATHS[key].name, means.mean(), means.std(), distances[f"{key}_mm"].max()))
    return pd.DataFrame(rows, columns=["distance_from", "mean_mm", "std_mm", "furthest_mm"])


def _axes(results: RecordedResults) -> pd.DataFrame:
    """Per local axis: largest mean target, its root mean square spread, and the network on left-out ones."""
    targets, scores = (results[name].groupby("axis") for name in ("coupling_targets", "coupling_scores"))
    frame = pd.DataFrame(
        {
            "largest_m": targets["mean"].agg(lambda values: values.abs().max()),
            "spread_m": targets["std"].agg(lambda values: np.sqrt((values**2).mean())),
            "nmse": scores["nmse"].mean(),
            "nmse_std": scores["nmse"].std(),
            "target_at_the_end_share": scores["target_end_share"].mean(),
            "error_at_the_end_share": scores["residual_end_share"].mean(),
        }
    )
    return frame.loc[AXES].reset_index()


def pictures(results: RecordedResults) -> Pictures:
    """Figures keyed by name."""
    return {
        "higher_reaches": reaches_panel(results),
        "coupling": [distance_panel(results), target_panel(results, "z")],
        "coupling_more": [target_panel(results, "x"), target_panel(results, "y")],
    }


@styled
def reaches_panel(results: RecordedResults) -> Figure:
    """Reaches from the side; higher ones left out, and the primitive without and with coupling."""
    figure, axes = panel("People: reaches, and higher ones", 3.5, xlabel="forward (mm)", ylabel="up (mm)")
    frame = results.reach_primitives[0].position.frame
    for number, (position, _) in enumerate(results.reach_segments):
        path = 1e3 * signals.time_normalised(in_local_frame(position, frame).position, SAMPLES)
        label = None if number else "recorded reaches"
        axes.plot(path[:, 0], path[:, 2], color=LIGHT_GREY, linewidth=0.7, label=label)
    for kind, its in results["coupling_paths"].groupby("path", sort=False):
        label = "higher reaches, left out" if kind == "recorded" else public_names.PATHS[kind].name
        for _, path in its.groupby("reach", sort=False):
            points = 1e3 * signals.time_normalised(path[["x", "z"]].to_numpy(), SAMPLES)
            axes.plot(*points.T, color=public_names.PATHS[kind].colour, linewidth=1.1, label=label)
            label = None
    return legend(figure)


@styled
def distance_panel(results: RecordedResults) -> Figure:
    """Mean distance from the left-out higher reaches over time."""
    figure, axes = panel("From the reaches left out", xlabel="time / duration", ylabel="distance (mm)")
    profile = results["coupling_profile"].iloc[::5]
    for kind, line in (("nominal", "-"), ("coupling", "-"), ("spread", "--")):
        look = public_names.PATHS[kind]
        axes.plot(profile["fraction"], profile[f"{kind}_mm"], line, color=look.colour, label=look.name)
    axes.set_ylim(bottom=0)
    return legend(figure)


@styled
def target_panel(results: RecordedResults, axis: str) -> Figure:
    """Coupling targets of the higher reaches along one local axis over phase, and what was learned."""
    title = f"Coupling along local {axis}{' (up)' if axis == 'z' else ''}"
    figure, axes = panel(title, xlabel="phase p", ylabel="coupling term (m)", xlim=(1.0, 0.0))
    colour, targets = AXIS_COLOURS[AXES.index(axis)], results["coupling_targets"]
    rows = targets[targets["axis"] == axis].iloc[::5]
    low, high = rows["mean"] - rows["std"], rows["mean"] + rows["std"]
    axes.fill_between(rows["phase"], low, high, color=colour, alpha=0.2, linewidth=0)
    axes.plot(rows["phase"], rows["mean"], color=colour, label="asked for: mean, std")
    axes.plot(rows["phase"], rows["learned"], "--", color=BLACK, linewidth=1.1, label="learned")
    return legend(figure)


PART = Part(
    name="higher_reaches",
    heading="Higher reaches as corrections",
    page="movements",
    needs=(
        *reaches_part.PART.needs,
        *("coupling_completeness", "coupling_distances", "coupling_paths", "coupling_profile"),
        *("coupling_scores", "coupling_targets"),
    ),
    parameters=("recorded_corrections",),
    metrics=metrics,
    evidence=evidence,
    facts=facts,
    tables=tables,
    pictures=pictures,
)
