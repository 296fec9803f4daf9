"""Slides of a finger over materials: what expected traces predict, what deviations from them tell."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn.core.artefacts import Metrics
from structlearn.readers.slide import material_of
from structlearn.reporting.claims import (
    Evidence,
    Found,
    by_case,
    confidence,
    geometric_mean,
    in_words,
    unknown,
)
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import styled
from structlearn.reporting.panels import legend, panel
from structlearn.reporting.prose import listing
from structlearn.tasks.public import public_names
from structlearn.tasks.public.page.parts.part import Part, Pictures
from structlearn.tasks.public.page.recorded_results import RecordedResults
from structlearn.tasks.public.page.recorded_tables import shown

TOO_FEW = unknown("it takes two slides over each of two materials")
"""To tell materials apart."""

FEW = 3
"""Materials that sentences name; tables have all."""

STREAM_UNITS = {
    "pose": "m",
    "joint_positions": "rad",
    "joint_velocities": "rad/s",
    "joint_torques": "N m",
    "wrench": "N, N m",
    "tactile": "counts",
}


def by_group(results: RecordedResults) -> pd.DataFrame:
    """Deviation from the expected traces by group of trials."""
    by = results["slide_deviations"].groupby("group", sort=False)["rms"]
    return by.agg(trials="size", median_rms="median", largest_rms="max").reset_index()


def slide_material(results: RecordedResults) -> str:
    """Material whose expected traces the others are held against."""
    trials = results["slide_deviations"]
    return material_of(trials.loc[trials["group"] == "learned", "demonstration"].iloc[0])


def by_channels(results: RecordedResults) -> pd.DataFrame:
    """Errors of the slides left out, by material and channels: all of a trial's electrodes, or a group."""
    count = results["slide_statistics"]["electrode"].nunique()
    whole = results["slide_left_one_out"].assign(channels="all", electrodes=count)
    parts = pd.concat([whole, results["slide_channels"]])
    rows = []
    for (material, channels), its in parts.groupby(["material", "channels"], sort=False):
        nmse = its["nmse"].to_numpy()
        row = {"material": material, "channels": channels, "electrodes": int(its["electrodes"].iloc[0])}
        row |= {"median_rms_counts": its["rms"].median(), "nmse": in_words(geometric_mean(nmse), ".2f")}
        rows.append(row | {"better_than_their_mean": f"{(nmse < 1).sum()} of {len(nmse)}"})
    order = {material: place for place, material in enumerate(dict.fromkeys(whole["material"]))}
    columns = ["material", "channels", "electrodes", "median_rms_counts", "nmse", "better_than_their_mean"]
    table = pd.DataFrame(rows, columns=columns)
    return table.sort_values("material", key=lambda its: its.map(order), kind="stable")


def metrics(results: RecordedResults) -> Metrics:
    """Of groups, of slides left out by material, and of the common clock."""
    values: Metrics = {}
    for row in by_group(results).itertuples():
        values[f"slides_{row.group.replace(' ', '_')}_median_rms_counts"] = row.median_rms
    for material, trials in results["slide_left_one_out"].groupby("material"):
        values[f"slides_left_one_out_{material}_median_rms_counts"] = trials["rms"].median()
        values[f"slides_left_one_out_{material}_median_nmse"] = trials["nmse"].median()
    clock = results["clock_errors"].set_index("kind")
    values["slides_clock_pose_rms_mm"] = 1e3 * clock.loc["pose", "rms_error"]
    strength = results["slide_channels"].query("channels in ('strong', 'weak')")
    for (material, channels), trials in strength.groupby(["material", "channels"]):
        values[f"slides_left_one_out_{material}_{channels}_median_nmse"] = trials["nmse"].median()
    return values


def evidence(results: RecordedResults) -> dict[str, Found]:
    """By the names of the claims."""
    left_out = results["slide_left_one_out"]
    own = dict(list(left_out.groupby("material", sort=False)))
    across = dict(list(results["slide_across"].groupby("expected", sort=False)["rms"]))
    strong = results["slide_channels"].query("channels == 'strong'")
    either = {name: (its, own[name]["rms"]) for name, its in across.items() if name in own}
    return {
        "other_material": by_case(group_difference, either) or TOO_FEW,
        "slides_predicted": _predicted(left_out),
        "slides_predicted_strong": _predicted(strong),
    }


def _predicted(table: pd.DataFrame) -> Found:
    """NMSE by material."""
    cases = {name: [its.to_numpy()] for name, its in table.groupby("material")["nmse"]}
    return by_case(geometric_mean, cases) or unknown("no slide could be left out")


def group_difference(first: np.ndarray, second: np.ndarray, comparisons: int = 1) -> Evidence:
    """Mean of (N,) minus mean of (M,) samples that are no pairs, with Welch's interval."""
    from scipy import stats

    if min(len(first), len(second)) < 2:
        return TOO_FEW
    test = stats.ttest_ind(np.asarray(first), np.asarray(second), equal_var=False)
    interval = test.confidence_interval(confidence(comparisons))
    return Evidence(
        float(np.mean(first) - np.mean(second)), interval.low, interval.high, len(first) + len(second)
    )


def facts(results: RecordedResults) -> dict[str, object]:
    """Values for its sentences."""
    deviations, left_out = results["slide_deviations"], results["slide_left_one_out"]
    material, found = slide_material(results), evidence(results)
    either = found["other_material"]
    channels = by_channels(results).set_index(["material", "channels"])["nmse"]
    return {
        "materials": list(dict.fromkeys(map(material_of, deviations["demonstration"]))),
        "slide_count": len(deviations),
        "slide_material": material,
        "slide_groups": by_group(results).set_index("group").to_dict("index"),
        "predicted": listing(
            f"{(its < 1).sum()} of {len(its)} over {name}"
            for name, its in list(left_out.groupby("material", sort=False)["nmse"])[:FEW]
        )
        if len(left_out)
        else "",
        "worst_slide": deviations.loc[deviations["rms"].idxmax()].to_dict(),
        "more_counts_by_material": {
            name: in_words(its, ".1f")
            for name, its in list(({} if isinstance(either, Evidence) else either).items())[:FEW]
        },
        "nmse_of": {name: channels[name].to_dict() for name in channels.index.unique(0)[:FEW]},
    }


def tables(results: RecordedResults) -> dict[str, Table]:
    """Tables keyed by name."""
    clock = results["clock_errors"]
    return {
        "slide_channels": shown(by_channels(results)),
        "slide_clock": shown(clock.assign(unit=clock["kind"].map(STREAM_UNITS))),
        "slides": shown(by_group(results)),
    }


def pictures(results: RecordedResults) -> Pictures:
    """Figures keyed by name."""
    slides = [slide_panel(results, place) for place in range(3)]
    return {"slides": [slides[0], trials_panel(results)], "slides_more": slides[1:]}


@styled
def slide_panel(results: RecordedResults, place: int) -> Figure:
    """Deviation of one of the electrodes that vary most: mean and std over the trials of a group."""
    groups = {name: its for name, its in results["slide_statistics"].groupby("group")}
    electrode = groups["learned"].groupby("electrode")["std"].mean().nlargest(3).index[place]
    title = f"Electrode {electrode}: mean and std over trials"
    figure, axes = panel(title, xlabel="time (s)", ylabel="deviation (counts)")
    for group in (name for name in ("other material", "learned") if name in groups):
        look, rows = (
            public_names.SLIDE_GROUPS[group],
            groups[group].query("electrode == @electrode").iloc[::4],
        )
        low, high = rows["mean"] - rows["std"], rows["mean"] + rows["std"]
        axes.fill_between(rows["time_s"], low, high, color=look.colour, alpha=0.2, linewidth=0)
        axes.plot(rows["time_s"], rows["mean"], color=look.colour, label=look.name)
    return legend(figure)


@styled
def trials_panel(results: RecordedResults) -> Figure:
    """Deviation of every trial; of one learned from, by the traces that the others let expect."""
    figure, axes = panel("Every trial", ylabel="root mean square (counts)")
    alone = results["slide_left_one_out"].set_index("demonstration")["rms"]
    trials = results["slide_deviations"]
    trials = trials.assign(
        rms=trials["rms"].where(trials["group"] != "learned", trials["demonstration"].map(alone))
    )
    for group, look in public_names.SLIDE_GROUPS.items():
        chosen = np.flatnonzero(trials["group"] == group)
        axes.bar(chosen, trials["rms"].iloc[chosen], color=look.colour, label=look.name)
    axes.set_xticks(range(len(trials)), trials["demonstration"], rotation=90, fontsize=7)
    axes.grid(axis="x", visible=False)
    return legend(figure, 3)


PART = Part(
    name="slides",
    heading="Slides over materials",
    page="movements",
    needs=(
        *("clock_errors", "slide_deviations", "slide_left_one_out", "slide_channels", "slide_across"),
        "slide_statistics",
    ),
    parameters=("recorded_slides",),
    metrics=metrics,
    evidence=evidence,
    facts=facts,
    tables=tables,
    pictures=pictures,
)
