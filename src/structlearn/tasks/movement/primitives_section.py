"""Page sections on primitives: learned primitives over their demonstrations, and the distances between."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import ceil
from typing import TypeVar

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn import palette
from structlearn.core import signals
from structlearn.primitives.fitting import (
    REPRODUCTION_ERRORS,
    RhythmicSegment,
    Segment,
    orientations,
    segment_paths,
    sequence_segments,
)
from structlearn.primitives.position import in_local_frame
from structlearn.primitives.sequence import PosePrimitive, largest_acceleration_jump
from structlearn.primitives.stiffness import StiffnessParameters, suggested
from structlearn.primitives.trajectory import Trajectory
from structlearn.primitives.twist_swing import dominant_axes, on_chart
from structlearn.readers.demonstration import OUTPUTS, POSE, Demonstration, joint_names
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import SAMPLES, Drawing, canvas, legend, panel, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.movement_figures import (
    outputs_figure,
    reproduction_panel,
    sequence_figure,
    space_panels,
)
from structlearn.tasks.movement.movement_learning import fit_metrics, learned_cuts
from structlearn.tasks.movement.parameters import PARTS, MovementEntry
from structlearn.tasks.section import Section, shown
from structlearn.tasks.task_files import TaskFiles

Drawn = TypeVar("Drawn")

TITLES = {"nominal": "Nominal", "generalised": "New situation"}
# Part of a metric's name and text in tables, by `left_out` and `scaled`
VARIANTS = {
    (False, True): ("fit", "learned from"),
    (True, True): ("left_out", "left out"),
    (False, False): ("fit_unscaled", "learned from, forcing not scaled"),
}
DISTANCES = {"mean_mm": "mean distance (mm)", "max_mm": "largest distance (mm)"}
DISTANCES |= {"end_mm": "distance at the end (mm)", "mean_deg": "mean angle (°)"}
DISTANCES |= {"max_deg": "largest angle (°)", "end_deg": "angle at the end (°)"}
DISTANCES |= {"mean_joint": "mean distance (joints)", "max_joint": "largest distance (joints)"}
DISTANCES |= {"end_joint": "distance at the end (joints)"}
MANY = 30  # number of demonstrations from which distances are shown as histograms
DRAWN, POINTS = 100, 2000
"""Demonstrations drawn in a figure, spread evenly over all, and samples of a path; more make pages slow."""

STRONG_RANGE = 20  # counts; electrodes with a larger range are clear of the sensor's noise of half a count
AXES = ["x", "y", "z"]
VIEWS = {"xz": ("From the side", "forward", "up"), "xy": ("From above", "forward", "to the side")}


def primitives_section(files: TaskFiles) -> Section:
    """Section on the learned primitives and their distances from the demonstrations."""
    own, primitives = files.entry(MovementEntry), files.primitives()
    runs, unit = files.runs("demonstrations", (*POSE, *OUTPUTS)), "joint" if own.of_joints else "mm"
    cuts = learned_cuts(files.segmentation(), own.keep_flagged)
    segments = sequence_segments(runs, cuts, own.fit.smoothing_hz)
    reproduction = files.table("primitives/reproduction").query("regression == @own.fit.regression")
    errors = error_summary(reproduction)
    sequences = {title: files.table(f"primitives/{name}") for name, title in TITLES.items()}
    left_out = errors[errors["demonstrations"] == "left out"]
    quoted = left_out if len(left_out) else errors
    pictures: dict[str, Drawing | Sequence[Drawing]] = {}
    if own.presegmented in (None, PARTS) or own.of_joints:
        if not own.of_joints:
            pictures["space"] = sequence_in_space(runs, sequences[TITLES["nominal"]])
        pictures["fit"] = [
            fit_figure(primitive, place, segments[primitive.name], runs[0].dt, joint_names(runs[0]))
            for place, primitive in enumerate(primitives)
        ]
        pictures["sequence"] = sequence_figure(sequences)
    else:
        pictures["local"] = [local_panel(primitives[0], segments[primitives[0].name], view) for view in VIEWS]
    if own.stiffness is not None:
        spread = files.table("primitives/spread")
        pictures["stiffness"] = [stiffness_figure(one, spread, own.stiffness) for one in primitives]
    if len(runs) >= MANY and not own.of_joints:
        pictures["distances"] = [
            distance_panel(reproduction, f"{which} distance of the primitive", column, width_mm)
            for which, column, width_mm in (("Mean", "mean_mm", 5), ("Largest", "max_mm", 10))
        ]
    tables: dict[str, Table] = {}
    if runs[0].outputs is not None:
        outputs = files.table("primitives/outputs")
        words = outputs["left_out"].map({left_out: VARIANTS[left_out, True][1] for left_out in (False, True)})
        tables["outputs"] = shown(outputs.assign(demonstrations=words).drop(columns="left_out"))
    if runs[0].digital is not None:
        tables["digital"] = shown(files.table("primitives/digital"))
    if tables:
        nominal = sequences[TITLES["nominal"]]
        pictures["outputs"] = outputs_figure(nominal, stretched_outputs(runs, cuts, nominal))
    facts = {
        "own": own,
        "worst": quoted.loc[quoted[f"mean_{unit}"].idxmax()].to_dict(),
        "distance": partial(_distance, own.of_joints),
        "worst_mean": quoted[f"mean_{unit}"].max(),
        "outputs": (*runs[0].output_names, *runs[0].digital_names),
        "continuous": runs[0].outputs is not None,
        "digital": runs[0].digital is not None,
        "of_joints": own.of_joints,
        "jump": max(map(largest_acceleration_jump, sequences.values())),
        "names": list(cuts),
        "turns": "mean_deg" in errors,
        "learned": min(map(len, cuts.values())),
        "of": len(runs) + len(files.left_out()),
        "validated": len(left_out) > 0,
        "in_base": [one.name for one in primitives if one.position.frame == "world" and one.rhythm is None],
        "rhythmic": [
            {
                "name": one.name,
                "period_s": one.duration / one.rhythm.cycles,
                "cycles": one.rhythm.cycles,
                "shown": sorted(
                    own.rhythm.cycles for own in segments[one.name] if isinstance(own, RhythmicSegment)
                ),
            }
            for one in primitives
            if one.rhythm is not None
        ],
        "spread": reproduction.groupby("primitive", sort=False)[f"from_mean_{unit}"].mean().to_dict(),
        "drawn": set(pictures),
        "main": ""
        if own.turns or own.presegmented == PARTS
        else "fit"
        if own.of_joints
        else "space"
        if own.presegmented is None
        else "local",
        "demonstrations": len(runs),
        "drawn_of": ceil(len(runs) / DRAWN),
    }
    numbers = fit_metrics(reproduction, own.fit)
    headlines = (
        tuple(numbers)[:6] if len(left_out) else ()
    )  # a primitive is always near what it was learned from
    find = Findings.of_metrics(numbers, headlines).among("recorded movements")
    add_distances(find, reproduction, errors, segments, unit)
    table = shown(errors, end_mm=".3f")
    tables["errors"] = replace(table, headings={**table.headings, **DISTANCES})
    return Section("primitives", "Primitives", facts=facts, tables=tables, pictures=pictures, find=find)


def _distance(of_joints: bool, distance: float) -> str:
    """A distance in words."""
    return f"{distance:.3g} (joints, root of the sum of squares)" if of_joints else f"{distance:.1f} mm"


def stretched_outputs(
    runs: Sequence[Demonstration], cuts: Mapping[str, pd.DataFrame], nominal: pd.DataFrame
) -> dict[str, list[tuple[np.ndarray, np.ndarray]]]:
    """Outputs by column of a `sequence_table`, each with times in the table and values, of each segment."""
    parts = nominal.groupby("primitive", sort=False)["time_s"].agg(["first", "last"])
    curves: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for run in drawn(runs):
        columns = {
            f"{kind}.{name}": values
            for kind, names, signal in (
                ("output", run.output_names, run.outputs),
                ("digital", run.digital_names, run.digital),
            )
            for name, values in zip(names, () if signal is None else signal.T, strict=True)
        }
        for name, rows in cuts.items():
            if run.name in rows.index:
                first, last = (round(float(rows.loc[run.name, end]) / run.dt) for end in ("start_s", "end_s"))
                begin, end = parts.loc[name, ["first", "last"]].tolist()
                time = np.linspace(begin, end, last - first + 1)
                for column, values in columns.items():
                    curves.setdefault(column, []).append((time, values[first : last + 1]))
    return curves


def drawn(demonstrations: Sequence[Drawn]) -> Sequence[Drawn]:
    """At most `DRAWN` of them, evenly spread."""
    return demonstrations[:: ceil(len(demonstrations) / DRAWN)]


def thinned(path: np.ndarray) -> np.ndarray:
    """At most about `POINTS` samples of a path (T, D), with the last one."""
    step = ceil(len(path) / POINTS)
    return path[(len(path) - 1) % step :: step]


def error_summary(reproduction: pd.DataFrame) -> pd.DataFrame:
    """Errors by primitive and variant: means of mean errors, maxima of largest and end errors."""
    keys = zip(reproduction["left_out"], reproduction["scaled"], strict=True)
    named = reproduction.assign(demonstrations=[VARIANTS[key][1] for key in keys])
    how = {name: "mean" if "mean" in name else "max" for name in REPRODUCTION_ERRORS if name in named}
    table = named.groupby(["primitive", "demonstrations"], sort=False).agg(how).reset_index()
    return table.iloc[np.argsort(pd.factorize(table["primitive"])[0], kind="stable")]


def add_distances(
    find: Findings,
    reproduction: pd.DataFrame,
    errors: pd.DataFrame,
    segments: dict[str, list[Segment]],
    unit: str = "mm",
) -> None:
    """Add distances by primitive and variant, and findings for claims over all primitives."""
    for name, own in reproduction.groupby("primitive", sort=False):
        spread = own.drop_duplicates("demonstration")[f"from_mean_{unit}"]
        find.mean(f"{name}_own_spread_{unit}", spread, unit=unit)
    prefixes = {words: prefix for prefix, words in VARIANTS.values()}
    for row in errors.to_dict("records"):
        lead = f"{row['primitive']}_{prefixes[row['demonstrations']]}"
        for key, column in (("mean", "mean"), ("max", "max"), ("end_max", "end")):
            find.exact(f"{lead}_{key}_{unit}", row[f"{column}_{unit}"], unit=unit)
    variants = {key: rows for key, rows in reproduction.groupby(["left_out", "scaled"], sort=False)}
    published = variants.get((False, False), variants[False, True])
    paths = [path.position for name in published["primitive"].unique() for path, _ in segments[name]]
    factor = 1e3 if unit == "mm" else 1.0
    lengths = factor * np.linalg.norm([path[-1] - path[0] for path in paths], axis=1)
    find.exact("reach_ends", (100 * published[f"end_{unit}"] / lengths).max(), len(published), unit="%")
    if (True, True) in variants:
        left_out = variants[True, True]
        beyond = left_out[f"mean_{unit}"] - left_out[f"from_mean_{unit}"]
        find.mean("left_out_from_mean", beyond, unit=unit)


@styled
def sequence_in_space(runs: list[Demonstration], nominal: pd.DataFrame) -> list[Figure]:
    """Nominal sequence over all demonstrations, in space."""
    grey = {"color": palette.LIGHT_GREY, "linewidth": 0.8}
    paths = [(thinned(run.position), grey) for run in drawn(runs)]
    for place, (name, part) in enumerate(nominal.groupby("primitive", sort=False)):
        look = {"color": palette.primitive_colour(place), "linewidth": 2.2, "label": name}
        paths.append((thinned(part[AXES].to_numpy()), look))
    return space_panels(paths)


@styled
def fit_figure(
    primitive: PosePrimitive, place: int, segments: list[Segment], dt: float, joints: Sequence[str] = ()
) -> Figure:
    """Segments of all demonstrations relative to their goal, with the unrolled primitive.

    Of `joints` in their own unit. Those of a rhythmic primitive are drawn over the cycle, relative to the
    middle of their strokes.
    """
    factor, labels = (1.0, list(joints)) if joints else (1e3, [f"{axis} (mm)" for axis in AXES])
    if primitive.rhythm is not None:
        strokes = [segment for segment in drawn(segments) if isinstance(segment, RhythmicSegment)]
        paths = [path.position for path, _ in strokes] + [primitive.position.unroll(dt).position]
        *shown, unrolled = (
            factor * thinned(path - 0.5 * (path.min(axis=0) + path.max(axis=0))) for path in paths
        )
        spans = [
            (own.first, own.first + own.cycles)
            for own in (*(one.rhythm for one in strokes), primitive.rhythm)
        ]
        return reproduction_panel(primitive.name, place, shown, unrolled, labels, spans)
    shown = [factor * thinned(path.position - path.position[-1]) for path, _ in drawn(segments)]
    unrolled = factor * thinned(primitive.position.unroll(dt).position - primitive.position.goal)
    return reproduction_panel(primitive.name, place, shown, np.asarray(unrolled), labels)


@styled
def stiffness_figure(
    primitive: PosePrimitive, spread: pd.DataFrame, parameters: StiffnessParameters
) -> Figure:
    """Band of the demonstrations about a primitive's path, and below it the stiffness that it suggests."""
    own = spread[spread["primitive"] == primitive.name].drop(columns="primitive").dropna(axis=1)
    stiffness, time = suggested(own.to_numpy(), parameters), np.linspace(0.0, primitive.duration, len(own))
    path = primitive.position.unroll(primitive.duration / (len(own) - 1)).position
    figure = canvas(4.6)
    bands, below = figure.subplots(2, 1, sharex=True)
    for place, (axis, colour) in enumerate(zip(AXES, palette.AXIS_COLOURS, strict=True)):
        middle, width = 1e3 * (path[:, place] - path[-1, place]), 1e3 * own[axis]
        bands.fill_between(time, middle - width, middle + width, color=colour, alpha=0.3, linewidth=0)
        bands.plot(time, middle, color=colour, linewidth=1.0, label=axis)
        below.plot(time, stiffness[:, place], color=colour)
    bands.set(title=f"{primitive.name}: spread", ylabel="to the goal (mm)")
    below.set(ylabel="stiffness (N/m)", xlabel="time (s)")
    below.set_ylim(bottom=0.0)
    return legend(figure, 3)


@styled
def local_panel(primitive: PosePrimitive, segments: list[Segment], view: str) -> Figure:
    """Segments and their primitive in the local frame, in one view."""
    title, *labels = VIEWS[view]
    figure, axes = panel(title, 3.3, xlabel=f"{labels[0]} (mm)", ylabel=f"{labels[1]} (mm)")
    learned, seen = primitive.position, [AXES.index(axis) for axis in view]

    def seen_of(path: Trajectory) -> np.ndarray:
        local = in_local_frame(path, learned.frame).position
        return 1e3 * signals.time_normalised(local, SAMPLES)[:, seen].T

    for number, (path, _) in enumerate(drawn(segments)):
        label = None if number else "recorded"
        axes.plot(*seen_of(path), color=palette.LIGHT_GREY, linewidth=0.7, label=label)
    unrolled = seen_of(learned.unroll(segments[0][0].dt))
    axes.plot(*unrolled, color=palette.REPRODUCTION_COLOUR, linewidth=2.0, label="primitive")
    return legend(figure)


@styled
def distance_panel(reproduction: pd.DataFrame, title: str, column: str, width_mm: float) -> Figure:
    """Histogram of the primitive's distances from all demonstrations."""
    figure, axes = panel(title, xlabel="distance (mm)", ylabel="demonstrations")
    for left_out, colour in ((False, palette.BLUE), (True, palette.OCHRE)):
        values = reproduction.query("scaled and left_out == @left_out")[column]
        bins = np.arange(0.0, values.max() + width_mm, width_mm)
        label = VARIANTS[left_out, True][1]
        axes.hist(values, bins.tolist(), histtype="step", color=colour, label=label, linewidth=1.6)
    return legend(figure)


def turns_section(files: TaskFiles) -> Section | None:
    """Section on turns of the hand: primitives of each run alone, and of all."""
    own = files.entry(MovementEntry)
    if not own.turns:
        return None
    errors = files.table("primitives/turns")
    single, joint = errors[errors["learned_from"] != "all"], errors[errors["learned_from"] == "all"]
    runs, (primitive,) = files.runs("demonstrations", POSE), files.primitives()
    segments = segment_paths(runs, files.segmentation().result(primitive.name), own.fit.smoothing_hz)
    find = Findings("logs")
    largest = {
        "mean of a log": (single["mean_deg"].max(), len(single)),
        "mean of all": (joint["mean_deg"].max(), len(single)),
        "at the end": (errors["end_deg"].max(), len(errors)),
    }
    find.exact("turns_found", largest, unit="degrees")
    single_deg, all_deg = single["mean_deg"].mean(), joint["mean_deg"].item()
    find.exact(f"{primitive.name}_mean_deg_single", single_deg, unit="degrees")
    find.exact(f"{primitive.name}_mean_deg_joint", all_deg, unit="degrees", headline=True)
    for kind, rows in (("single", single), ("joint", joint)):
        find.exact(f"{primitive.name}_end_deg_{kind}", rows["end_deg"].max(), unit="degrees")
    turned = {"least_turn": single["turn_deg"].min(), "most_turn": single["turn_deg"].max()}
    return Section(
        "turns",
        "Turns of the hand",
        facts=turned | {"runs": list(single["learned_from"]), "mean_deg": all_deg},
        tables={"turns": shown(errors)},
        pictures={"turning": turn_panel(segments, primitive)},
        find=find,
    )


@styled
def turn_panel(segments: list[Segment], primitive: PosePrimitive) -> Figure:
    """Twist about the dominant axis and swings about the others, for every run and the primitive."""
    figure, axes = panel("Turn of the hand", xlabel="time / duration", ylabel="degrees to the goal")
    runs = orientations(segments)
    assert primitive.orientation is not None
    frame, time = dominant_axes(runs), np.linspace(0.0, 1.0, 2 * SAMPLES)
    lines = {"-": "twist", "--": "swing", ":": "second swing"}
    colours = {"recorded": palette.DEMONSTRATION_COLOUR, "primitive": palette.REPRODUCTION_COLOUR}
    for path, kind in [
        *((run, "recorded") for run in runs),
        (primitive.orientation.unroll(runs[0].dt), "primitive"),
    ]:
        angles = np.degrees(signals.time_normalised(on_chart(path, frame).position, 2 * SAMPLES))
        for line, angle in zip(lines, angles.T, strict=True):
            axes.plot(time, angle, line, color=colours[kind])
    for name, colour in colours.items():
        axes.plot([], [], color=colour, label=name)
    for line, label in lines.items():
        axes.plot([], [], line, color=palette.BLACK, label=label)
    return legend(figure, 3)


def execution_section(files: TaskFiles) -> Section | None:
    """Section on an execution recorded in parts: the sequence over it."""
    if files.entry(MovementEntry).presegmented != PARTS:
        return None
    errors, nominal = files.table("primitives/execution"), files.table("primitives/nominal")
    words = {"mean_mm": "position (mm)", "mean_deg": "orientation (°)"}
    measured, find = [column for column in words if column in errors], Findings("primitives")
    for row in errors.to_dict("records"):
        for column in measured:
            find.exact(f"{files.name}_{row['primitive']}_{column}", row[column])
    largest = {words[column]: (errors[column].max(), len(errors)) for column in measured}
    find.exact("sequence", largest, headline=True)
    return Section(
        "execution",
        "The execution",
        tables={"execution": shown(errors)},
        pictures={"execution": execution_panel(files.runs("demonstrations", POSE), nominal)},
        find=find,
    )


def traces_section(files: TaskFiles) -> Section | None:
    """Section on sensor primitives of an execution's tactile channels."""
    if files.entry(MovementEntry).traces_hz is None:
        return None
    scores, traces = files.table("primitives/trace_scores"), files.table("primitives/traces")
    strong, find = scores[scores["range"] > STRONG_RANGE], Findings("electrodes that move")
    table = scores.groupby("primitive", sort=False).agg(rms=("rms", "median"), nmse=("nmse", "median"))
    table["strong"] = strong.groupby("primitive").size().reindex(table.index, fill_value=0)
    table["strong_nmse"] = strong.groupby("primitive")["nmse"].mean()
    words = {"strong": f"electrodes beyond {STRONG_RANGE} counts", "strong_nmse": "their mean NMSE"}
    columns = {"median_nmse": "nmse", "median_rms_counts": "rms", "strong_mean_nmse": "strong_nmse"}
    for name, row in table.iterrows():
        for key, column in columns.items():
            find.exact(f"electrodes_{name}_{key}", row[column])
    find.mean("electrodes", strong["nmse"], missing="no electrode moves enough")
    by_primitive = shown(table.reset_index().rename(columns=words))
    return Section(
        "traces",
        "Touch of the execution",
        facts={"electrodes": scores["electrode"].nunique(), "strong_range": STRONG_RANGE},
        tables={"electrodes": Table(scores), "electrode_errors": by_primitive},
        pictures={"electrodes": [electrode_errors_panel(scores), *electrode_panels(scores, traces)]},
        find=find,
    )


@styled
def execution_panel(parts: list[Demonstration], path: pd.DataFrame) -> Figure:
    """Position of an execution, and of the sequence learned from it, with lines at the switches."""
    figure, axes = panel("Recorded (grey), sequence", xlabel="time (s)", ylabel="from the start (mm)")
    first, origin = 0, path[AXES].iloc[0].to_numpy()
    for number, part in enumerate(parts):
        samples = path.iloc[first : first + len(part.time) : 8]
        for place, (axis, colour) in enumerate(zip(AXES, palette.AXIS_COLOURS, strict=True)):
            recorded = 1e3 * (part.position[::8, place] - origin[place])
            axes.plot(samples["time_s"], recorded, color=palette.LIGHT_GREY, linewidth=3.5)
            unrolled = 1e3 * (samples[axis] - origin[place])
            axes.plot(
                samples["time_s"], unrolled, color=colour, linewidth=1.2, label=None if number else axis
            )
        first += len(part.time) - 1
        axes.axvline(path["time_s"].iloc[first], color=palette.GREY, linewidth=0.7)
    return legend(figure, 3)


@styled
def electrode_errors_panel(scores: pd.DataFrame) -> Figure:
    """Error of all sensor primitives over the electrode's range."""
    figure, axes = panel("Error of all electrodes", xlabel="range of the electrode (counts)", ylabel="NMSE")
    by_primitive = scores.groupby("primitive", sort=False)
    for colour, (name, part) in zip(palette.CATEGORICAL_COLOURS, by_primitive, strict=False):
        axes.plot(part["range"], part["nmse"], "o", markersize=4, color=colour, label=name)
    axes.set(xscale="log", yscale="log")
    return legend(figure, 3)


@styled
def electrode_panels(scores: pd.DataFrame, traces: pd.DataFrame) -> list[Figure]:
    """The six electrodes with the largest range, with their sensor primitives, by primitive."""
    strongest = scores.groupby("electrode")["range"].max().nlargest(6).index
    figures = []
    for name, part in traces.groupby("primitive", sort=False):
        figure, axes = panel(f"{name}: recorded (grey), primitive", xlabel="time (s)", ylabel="counts")
        for colour, electrode in zip(palette.CATEGORICAL_COLOURS, strongest, strict=False):
            samples = part[part["electrode"] == electrode].iloc[::8]
            axes.plot(samples["time_s"], samples["recorded"], color=palette.LIGHT_GREY, linewidth=3.0)
            axes.plot(
                samples["time_s"], samples["expected"], color=colour, linewidth=1.1, label=f"E{electrode}"
            )
        figures.append(legend(figure, 3))
    return figures
