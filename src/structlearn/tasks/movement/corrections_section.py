"""Page section on corrections: what people corrected, and how well a model predicts corrections left out."""

from collections.abc import Iterator

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from structlearn import palette
from structlearn.core import signals
from structlearn.core.metrics import mean_interval
from structlearn.feedback.coupling import Axis, unit
from structlearn.feedback.coupling_dataset import CouplingDataset
from structlearn.primitives.fitting import Segment, segment_paths
from structlearn.primitives.position import in_local_frame
from structlearn.primitives.sequence import PosePrimitive
from structlearn.readers.demonstration import POSE, read_about
from structlearn.reporting.document import Table
from structlearn.reporting.figure_style import SAMPLES, legend, panel, styled
from structlearn.reporting.findings import Findings
from structlearn.reporting.prose import capitalised, listing
from structlearn.tasks.movement.feedback_learning import feedback_metrics, in_view, read_feedback
from structlearn.tasks.movement.parameters import MovementEntry
from structlearn.tasks.section import Section, shown
from structlearn.tasks.task_files import TaskFiles

TARGET_SAMPLES = 200
DRAWN = 6  # number of settings drawn
SHORT_CYCLE = 0.05  # that a demonstration's first or last cycle may lack to be drawn
POOR = 1.0  # NMSE from which a model is no better than the mean
CHECKED = ("reproduction", "smoothing", "others")  # first words of the checks' columns
AXES = ["x", "y", "z"]
PATHS = {"nominal": "nominal_path", "coupling": "coupling_path", "spread": "corrected_spread"}


def feedback_section(files: TaskFiles) -> Section | None:
    """Section on feedback from sensors, learned from corrections in several settings."""
    learned, parameters = read_feedback(files.folder / "feedback"), files.entry(MovementEntry).feedback
    if learned is None or parameters is None:
        return None
    scores, checks = learned.scores, learned.checks
    nmse = scores[scores["learned"]].groupby(["primitive", "axis"], sort=False)["nmse"].mean()
    measures = [name for name in checks.columns if name.split("_")[0] in CHECKED]
    by_setting = checks.groupby(["primitive", "setting"], sort=False)[measures].max().reset_index()
    numbers = feedback_metrics(learned)
    return Section(
        "feedback",
        "Feedback from corrections",
        facts={
            "parameters": parameters,
            "executions": len(read_about(files.recorded / "executions.parquet")),
            "corrections": int(checks.groupby("primitive").size().max()),
            "by": "setting" if len(parameters.settings) > 1 else "part of the demonstrations",
            "worst": nmse.max(),
            "worst_key": nmse.idxmax(),
            "poor": [f"{name} {axis}" for (name, axis), value in nmse.items() if value >= POOR],
        },
        find=Findings.of_metrics(numbers, tuple(numbers)[:2]),
        tables={
            "feedback_scores": response_table(scores),
            "feedback_checks": Table(by_setting, dict.fromkeys(measures, ".3g")),
        },
        pictures={
            "feedback_targets": [
                targets_panel(f"{capitalised(name)}, {axis}", axis, dataset)
                for name, by_axis in learned.datasets.items()
                for axis, dataset in by_axis.items()
            ]
        },
    )


def response_table(scores: pd.DataFrame) -> Table:
    """Table of scores with displacements in mm and degrees."""
    factors, units = zip(*scores["axis"].map(in_view), strict=True)
    frame, measures = scores.assign(unit=units), ["target", "predicted", "rms"]
    frame[measures] = frame[measures].mul(list(factors), axis=0)
    headings = {"left_out": "left out", "nmse": "NMSE", "learned": "of what is learned from"}
    headings |= {"rms": "rms difference", "unit": ""}
    return Table(frame, dict.fromkeys(("nmse", *measures), ".2f"), headings)


@styled
def targets_panel(title: str, axis: Axis, dataset: CouplingDataset) -> Figure:
    """Coupling targets of one primitive on one axis, mean and std by setting; of strokes, of all cycles."""
    label = "time / duration" if dataset.cycle is None else "cycle"
    figure, axes = panel(title, 2.9, xlabel=label, ylabel=f"coupling target ({unit(axis)})")
    time = np.linspace(0.0, 1.0, TARGET_SAMPLES)
    settings = list(dict.fromkeys(dataset.setting))[:DRAWN]
    for colour, setting in zip(palette.CATEGORICAL_COLOURS, settings, strict=False):
        samples = dataset.where(dataset.setting == setting)
        runs = [
            samples.where(samples.demonstration == number) for number in dict.fromkeys(samples.demonstration)
        ]
        curves = np.array([curve for run in runs for curve in _target_curves(run)])
        average, spread = curves.mean(axis=0), curves.std(axis=0)
        axes.plot(time, average, color=colour, label=str(setting))
        axes.fill_between(time, average - spread, average + spread, color=colour, alpha=0.15, linewidth=0)
    return legend(figure)


def _target_curves(run: CouplingDataset) -> Iterator[np.ndarray]:
    """Coupling targets (TARGET_SAMPLES,) of one demonstration; of strokes, a curve per whole cycle."""
    if run.cycle is None:
        yield signals.time_normalised(run.target[:, None], TARGET_SAMPLES)[:, 0]
        return
    share = np.linspace(0.0, 1.0, TARGET_SAMPLES)
    first = np.ceil(run.cycle[0] - SHORT_CYCLE)
    for number in range(max(int(run.cycle[-1] - first + SHORT_CYCLE), 1)):
        yield np.interp(first + number + share, run.cycle, run.target)


def phase_section(files: TaskFiles) -> Section | None:
    """Section on coupling as a function of phase alone, learned from corrected runs."""
    if not (files.folder / "feedback/completeness.parquet").exists():
        return None
    own, (primitive,) = files.entry(MovementEntry), files.primitives()
    cuts = files.segmentation().result(primitive.name)
    segments = segment_paths(files.runs("demonstrations", POSE), cuts, own.fit.smoothing_hz)
    names = ("completeness", "distances", "profile", "targets", "scores", "paths")
    ends, distances, profile, targets, scores, paths = (files.table(f"feedback/{name}") for name in names)
    runs = distances.groupby("run").mean(numeric_only=True)  # mean over the splits for each run
    by_split = distances.groupby("split")[[f"{key}_mm" for key in PATHS]].mean()
    axes, mean, std = scores.groupby("axis"), by_split.mean(), by_split.std()
    values = {
        "coupling_path_end_share": distances["end_share"].mean(),
        "corrected_reaches_learned_from": int(distances["learned_from"].iloc[0]),
        "corrected_reaches_left_out": int((distances["split"] == 0).sum()),
    }
    for key, name in PATHS.items():
        key_figure = f"{name}_mean_mm" if name.endswith("path") else f"{name}_mm"
        values |= {key_figure: mean[f"{key}_mm"], f"{name}_std_mm": std[f"{key}_mm"]}
    for name, first, second in (
        ("coupling_gain", "nominal_mm", "coupling_mm"),
        ("coupling_above_spread", "coupling_mm", "spread_mm"),
    ):
        middle, half = mean_interval((runs[first] - runs[second]).to_numpy())
        values |= {f"{name}_mm": middle, f"{name}_half_width_mm": half}
    values |= {f"coupling_{axis}_nmse": scores["nmse"].mean() for axis, scores in axes}
    find = Findings.of_metrics(values, ("nominal_path_mean_mm", "coupling_path_mean_mm"))
    find = find.among("runs left out, each by its mean over the splits")
    find.difference("coupling_gain", runs["nominal_mm"], runs["coupling_mm"], unit="mm")
    find.difference("coupling_above_mean", runs["coupling_mm"], runs["spread_mm"], unit="mm")
    find.mean("coupling_end", 100 * runs["end_share"], unit="%")
    path_distances = {
        "distance_from": [palette.PHASE_PATHS[key].name for key in PATHS],
        "mean_mm": mean,
        "std_mm": std,
        "furthest_mm": distances[by_split.columns].max(),
    }
    by_axis = {  # largest mean target, rms spread of the targets, errors of the network on those left out
        "largest_m": targets.groupby("axis")["mean"].agg(lambda values: values.abs().max()),
        "spread_m": targets.groupby("axis")["std"].agg(lambda values: np.sqrt((values**2).mean())),
        "nmse": axes["nmse"].mean(),
        "nmse_std": axes["nmse"].std(),
        "target_at_the_end_share": axes["target_end_share"].mean(),
        "error_at_the_end_share": axes["residual_end_share"].mean(),
    }
    in_order = pd.DataFrame(by_axis).loc[AXES].reset_index()
    return Section(
        "corrections",
        "Corrections over the phase",
        facts=values
        | {
            "incomplete": int((~ends["complete"]).sum()),
            "runs": len(ends),
            "splits": distances["split"].nunique(),
            "poor_axes": listing(axes["nmse"].mean().loc[lambda error: error >= POOR].index, "no axis"),
            "target_end_percent": 100 * axes["target_end_share"].mean().max(),
        },
        tables={
            "coupling_paths": shown(pd.DataFrame(path_distances)),
            "coupling_axes": shown(in_order, largest_m=".1f", spread_m=".1f"),
        },
        pictures={
            "corrected": corrected_panel(paths, primitive, segments),
            "coupling": [profile_panel(profile), target_panel(targets, "z")],
            "coupling_more": [target_panel(targets, "x"), target_panel(targets, "y")],
        },
        find=find,
    )


@styled
def corrected_panel(paths: pd.DataFrame, primitive: PosePrimitive, segments: list[Segment]) -> Figure:
    """Recorded runs, corrected runs left out, and the primitive without and with coupling, from the side."""
    figure, axes = panel("Runs and corrected runs", 3.5, xlabel="forward (mm)", ylabel="up (mm)")
    for number, (position, _) in enumerate(segments):
        local = in_local_frame(position, primitive.position.frame).position
        path = 1e3 * signals.time_normalised(local, SAMPLES)
        label = None if number else "recorded runs"
        axes.plot(path[:, 0], path[:, 2], color=palette.LIGHT_GREY, linewidth=0.7, label=label)
    looks = palette.PHASE_PATHS | {
        "recorded": palette.Look("corrected runs, left out", palette.DEMONSTRATION_COLOUR)
    }
    for kind, curve in paths.groupby("path", sort=False):
        for number, (_, path) in enumerate(curve.groupby("run", sort=False)):
            points = 1e3 * signals.time_normalised(path[["x", "z"]].to_numpy(), SAMPLES)
            label = None if number else looks[kind].name
            axes.plot(*points.T, color=looks[kind].colour, linewidth=1.1, label=label)
    return legend(figure)


@styled
def profile_panel(profile: pd.DataFrame) -> Figure:
    """Mean distance from the left-out corrected runs over time."""
    figure, axes = panel("Distance from held-out runs", xlabel="time / duration", ylabel="distance (mm)")
    profile = profile.iloc[::5]
    for kind, line in (("nominal", "-"), ("coupling", "-"), ("spread", "--")):
        look = palette.PHASE_PATHS[kind]
        axes.plot(profile["fraction"], profile[f"{kind}_mm"], line, color=look.colour, label=look.name)
    axes.set_ylim(bottom=0)
    return legend(figure)


@styled
def target_panel(targets: pd.DataFrame, axis: str) -> Figure:
    """Coupling targets of the corrected runs along one local axis over phase, and the learned term."""
    title = f"Coupling along local {axis}{' (up)' if axis == 'z' else ''}"
    figure, axes = panel(title, xlabel="phase p", ylabel="coupling term (m)", xlim=(1.0, 0.0))
    colour, rows = palette.AXIS_COLOURS[AXES.index(axis)], targets[targets["axis"] == axis].iloc[::5]
    low, high = rows["mean"] - rows["std"], rows["mean"] + rows["std"]
    axes.fill_between(rows["phase"], low, high, color=colour, alpha=0.2, linewidth=0)
    axes.plot(rows["phase"], rows["mean"], color=colour, label="target: mean, std")
    axes.plot(rows["phase"], rows["learned"], "--", color=palette.BLACK, linewidth=1.1, label="learned")
    return legend(figure)
