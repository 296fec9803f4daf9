"""One scraping execution: primitives in sequence, and sensor primitives of two fingers."""

import pandas as pd
from matplotlib.figure import Figure

from structlearn.core.artefacts import Metrics
from structlearn.palette import AXIS_COLOURS, CATEGORICAL_COLOURS, GREY, LIGHT_GREY
from structlearn.reporting.claims import Found, exact, mean, unknown
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import styled
from structlearn.reporting.panels import legend, panel
from structlearn.tasks.public.page.parts.part import Part, Pictures
from structlearn.tasks.public.page.recorded_results import AXES, RecordedResults
from structlearn.tasks.public.page.recorded_tables import shown

STRONG_RANGE = 20
"""Counts; an electrode that moves more than this stands clear of the sensor's noise of half a count."""

STRONG = {"strong": f"electrodes beyond {STRONG_RANGE} counts", "strong_nmse": "their mean NMSE"}
"""Columns of the electrodes' errors that need more words."""


def strong_electrodes(results: RecordedResults) -> pd.DataFrame:
    """Scores of the electrodes that move by more than `STRONG_RANGE`."""
    return results["electrode_scores"][results["electrode_scores"]["range"] > STRONG_RANGE]


def electrodes(results: RecordedResults) -> pd.DataFrame:
    """Error of the sensor primitives, over all electrodes and over those that move."""
    by = results["electrode_scores"].groupby("primitive", sort=False)
    strong = strong_electrodes(results).groupby("primitive")["nmse"]
    found = by.agg(rms=("rms", "median"), nmse=("nmse", "median"))
    found["strong"] = strong.size().reindex(found.index, fill_value=0)
    return found.assign(strong_nmse=strong.mean()).reset_index()


def metrics(results: RecordedResults) -> Metrics:
    """By primitive."""
    values: Metrics = {}
    for row in results["sequence_errors"].itertuples():
        values[f"scraping_{row.primitive}_mean_mm"] = row.mean_mm
        values[f"scraping_{row.primitive}_mean_deg"] = row.mean_deg
    for row in electrodes(results).itertuples():
        values[f"electrodes_{row.primitive}_median_nmse"] = row.nmse
        values[f"electrodes_{row.primitive}_median_rms_counts"] = row.rms
        values[f"electrodes_{row.primitive}_strong_mean_nmse"] = row.strong_nmse
    return values


def evidence(results: RecordedResults) -> dict[str, Found]:
    """By the names of the claims."""
    parts, strong = results["sequence_errors"], strong_electrodes(results)
    return {
        "sequence": {
            "position (mm)": exact(parts["mean_mm"].max(), len(parts)),
            "orientation (°)": exact(parts["mean_deg"].max(), len(parts)),
        },
        "electrodes": mean(strong["nmse"]) if len(strong) else unknown("no electrode moves enough"),
    }


def facts(results: RecordedResults) -> dict[str, object]:
    """Values for its sentences."""
    return {
        "parts_of_execution": list(results["sequence_errors"]["primitive"]),
        "electrode_count": results["electrode_scores"]["electrode"].nunique(),
        "strong_range": STRONG_RANGE,
    }


def tables(results: RecordedResults) -> dict[str, Table]:
    """Tables keyed by name."""
    return {
        "electrodes": Table(results["electrode_scores"]),
        "execution": shown(results["sequence_errors"]),
        "electrode_errors": shown(electrodes(results).rename(columns=STRONG)),
    }


def pictures(results: RecordedResults) -> Pictures:
    """Figures keyed by name."""
    return {
        "execution": execution_panel(results),
        "electrodes": [electrode_errors_panel(results), *electrode_panels(results)],
    }


@styled
def execution_panel(results: RecordedResults) -> Figure:
    """Position of the scraping execution, and of the sequence learned from it; lines where it switches."""
    figure, axes = panel(
        "Scraping: recorded (grey), sequence", xlabel="time (s)", ylabel="from the start (mm)"
    )
    path, first = results["sequence"], 0
    origin = path[AXES].iloc[0].to_numpy()
    for number, part in enumerate(results.execution):
        its = path.iloc[first : first + len(part.time) : 8]
        for place, (axis, colour) in enumerate(zip(AXES, AXIS_COLOURS, strict=True)):
            recorded = 1e3 * (part.position[::8, place] - origin[place])
            axes.plot(its["time_s"], recorded, color=LIGHT_GREY, linewidth=3.5)
            unrolled = 1e3 * (its[axis] - origin[place])
            axes.plot(its["time_s"], unrolled, color=colour, linewidth=1.2, label=None if number else axis)
        first += len(part.time) - 1
        axes.axvline(path["time_s"].iloc[first], color=GREY, linewidth=0.7)
    return legend(figure, 3)


@styled
def electrode_errors_panel(results: RecordedResults) -> Figure:
    """Error of all sensor primitives over how far the electrode moves."""
    figure, axes = panel("Error of all electrodes", xlabel="range of the electrode (counts)", ylabel="NMSE")
    parts = results["electrode_scores"].groupby("primitive", sort=False)
    for colour, (name, part) in zip(CATEGORICAL_COLOURS, parts, strict=False):
        axes.plot(part["range"], part["nmse"], "o", markersize=4, color=colour, label=name)
    axes.set(xscale="log", yscale="log")
    return legend(figure, 3)


@styled
def electrode_panels(results: RecordedResults) -> list[Figure]:
    """The six electrodes that move most in every primitive, with their sensor primitives."""
    strongest = results["electrode_scores"].groupby("electrode")["range"].max().nlargest(6).index
    figures = []
    for name, part in results["electrode_traces"].groupby("primitive", sort=False):
        figure, axes = panel(f"{name}: recorded (grey), primitive", xlabel="time (s)", ylabel="counts")
        for colour, electrode in zip(CATEGORICAL_COLOURS, strongest, strict=False):
            its = part[part["electrode"] == electrode].iloc[::8]
            axes.plot(its["time_s"], its["recorded"], color=LIGHT_GREY, linewidth=3.0)
            axes.plot(its["time_s"], its["expected"], color=colour, linewidth=1.1, label=f"E{electrode}")
        figures.append(legend(figure, 3))
    return figures


PART = Part(
    name="scraping",
    heading="Scraping",
    page="movements",
    needs=("sequence", "sequence_errors", "electrode_scores", "electrode_traces"),
    parameters=("recorded_scraping",),
    metrics=metrics,
    evidence=evidence,
    facts=facts,
    tables=tables,
    pictures=pictures,
)
