"""Figures of the public recordings: reaches, unscrewing, a scraping execution, slides."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from structlearn.ground import quaternion, signals
from structlearn.palette import (
    AXIS_COLOURS,
    BLUE,
    CATEGORICAL_COLOURS,
    DEMONSTRATION_COLOUR,
    LIGHT_GREY,
    ORANGE,
    REPRODUCTION_COLOUR,
    VERMILION,
)
from structlearn.primitives.fitting import Segment
from structlearn.primitives.position import in_local_frame
from structlearn.primitives.sequence import PosePrimitive
from structlearn.primitives.trajectory import OrientationTrajectory
from structlearn.primitives.twist_swing import TwistSwingPrimitive, dominant_axes, on_chart
from structlearn.recordings.demonstration import Demonstration
from structlearn.reporting.figures import canvas, styled

GROUP_COLOURS = {"learned": BLUE, "left out": ORANGE, "other material": VERMILION}
SAMPLES = 300
ELECTRODES_SHOWN = 6


@styled
def reaches_figure(segments: Sequence[Segment], primitive: PosePrimitive, errors: pd.DataFrame) -> Figure:
    """All reaches in their local frames with the primitive, and how far the primitive is from each.

    Args:
        segments: the reaches.
        primitive: learned from all of them.
        errors: rows of `recorded.reaches.learn_reaches`.
    """
    figure = canvas(5.2)
    grid = figure.subplots(2, 2).ravel()
    path = in_local_frame(primitive.position.unroll(1e-3), primitive.position.frame)
    fraction = np.linspace(0.0, 1.0, SAMPLES)
    for axis, panel in enumerate(grid[:3]):
        for position, _ in segments:
            local = in_local_frame(position, primitive.position.frame).position
            panel.plot(
                fraction,
                1e3 * signals.time_normalised(local, SAMPLES)[:, axis],
                color=DEMONSTRATION_COLOUR,
                alpha=0.25,
                linewidth=0.6,
            )
        unrolled = 1e3 * signals.time_normalised(path.position, SAMPLES)[:, axis]
        panel.plot(fraction, unrolled, color=REPRODUCTION_COLOUR, linewidth=1.8)
        panel.set(title=f"Local {'xyz'[axis]}", xlabel="time / duration", ylabel="mm")
    for variant, colour in (("learned from", BLUE), ("left out", ORANGE)):
        values = errors[errors["variant"] == variant]["mean_mm"]
        grid[3].hist(
            values, bins=np.arange(0, 65, 5), histtype="step", color=colour, label=variant, linewidth=1.6
        )
    grid[3].set(title="Distance of the primitive", xlabel="mean distance (mm)", ylabel="reaches")
    grid[3].legend()
    return figure


@styled
def unscrewing_figure(paths: Sequence[OrientationTrajectory], joint: TwistSwingPrimitive) -> Figure:
    """Twist and swing about the dominant axis in every log, and as the joint primitive unrolls them.

    Args:
        paths: the logs.
        joint: learned from all of them.
    """
    figure = canvas(3.2)
    panels = figure.subplots(1, 3)
    axes = dominant_axes(paths)
    curves = [on_chart(path, axes).position for path in paths]
    unrolled = on_chart(joint.unroll(paths[0].dt), axes).position
    for panel, axis, title in zip(
        panels, range(3), ("Twist", "Swing, first axis", "Swing, second axis"), strict=True
    ):
        for curve in curves:
            fraction = np.linspace(0.0, 1.0, len(curve))
            panel.plot(fraction, np.degrees(curve[:, axis]), color=DEMONSTRATION_COLOUR, linewidth=0.9)
        panel.plot(
            np.linspace(0.0, 1.0, len(unrolled)),
            np.degrees(unrolled[:, axis]),
            color=REPRODUCTION_COLOUR,
            linewidth=1.8,
        )
        panel.set(title=title, xlabel="time / duration")
    panels[0].set_ylabel("degrees, relative to the goal")
    return figure


@styled
def execution_figure(parts: Sequence[Demonstration], path: pd.DataFrame) -> Figure:
    """The recorded execution and the sequence learned from it, and the distance between them.

    Args:
        parts: the recorded primitives in order.
        path: the unrolled sequence (`primitives.sequence.sequence_table`).
    """
    figure = canvas(4.4)
    positions, distance = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    points = path[["x", "y", "z"]].to_numpy()
    turns = path[["qw", "qx", "qy", "qz"]].to_numpy()
    angles = distance.twinx()
    first = 0
    for part in parts:
        here = slice(first, first + len(part.time))
        time = path["time_s"].to_numpy()[here]
        for axis, colour in enumerate(AXIS_COLOURS):
            origin = points[0, axis]
            positions.plot(time, 1e3 * (part.position[:, axis] - origin), color=LIGHT_GREY, linewidth=3.5)
            positions.plot(
                time,
                1e3 * (points[here, axis] - origin),
                color=colour,
                linewidth=1.2,
                label="xyz"[axis] if first == 0 else None,
            )
        away = 1e3 * np.linalg.norm(points[here] - part.position, axis=1)
        angle = np.degrees(quaternion.angle_between(turns[here], part.orientation))
        distance.plot(time, away, color=BLUE, label="position" if first == 0 else None)
        angles.plot(time, angle, color=ORANGE)
        first += len(part.time) - 1
        for panel in (positions, distance):
            panel.axvline(path["time_s"].iloc[first], color=DEMONSTRATION_COLOUR, linewidth=0.7)
    distance.plot([], [], color=ORANGE, label="orientation (right)")
    positions.set(title="Recorded (grey) and unrolled", ylabel="from the start (mm)")
    distance.set(title="Distance", ylabel="mm", xlabel="time (s)", ylim=(0, None))
    angles.set(ylabel="degrees", ylim=(0, None))
    angles.grid(visible=False)
    positions.legend(ncols=3)
    distance.legend(ncols=2)
    return figure


@styled
def electrodes_figure(traces: pd.DataFrame, scores: pd.DataFrame) -> Figure:
    """The electrodes that move most with their sensor primitives, and the error of all over their range.

    Args:
        traces: `recorded.scraping.learn_traces`, third result.
        scores: the same, second result.
    """
    figure = canvas(5.6)
    grid = figure.add_gridspec(2, 3, height_ratios=(1.15, 1.0))
    names = list(dict.fromkeys(traces["primitive"]))
    strongest = scores.groupby("electrode")["range"].max().nlargest(ELECTRODES_SHOWN).index
    for column, name in enumerate(names[:3]):
        panel = figure.add_subplot(grid[0, column])
        part = traces[traces["primitive"] == name]
        for colour, electrode in zip(CATEGORICAL_COLOURS, strongest, strict=False):
            trace = part[part["electrode"] == electrode]
            panel.plot(trace["time_s"], trace["recorded"], color=LIGHT_GREY, linewidth=3.0)
            panel.plot(trace["time_s"], trace["expected"], color=colour, linewidth=1.1, label=f"{electrode}")
        panel.set(title=name, xlabel="time (s)")
        if column == 0:
            panel.set_ylabel("counts")
            panel.legend(title="electrode", ncols=2, columnspacing=1.0, loc="upper left")
    errors = figure.add_subplot(grid[1, :2])
    for colour, name in zip(CATEGORICAL_COLOURS, names, strict=False):
        part = scores[scores["primitive"] == name]
        errors.plot(
            part["range"], part["nmse"], linestyle="", marker="o", markersize=4, color=colour, label=name
        )
    errors.set(xscale="log", yscale="log", xlabel="range of the electrode (counts)", ylabel="NMSE")
    errors.set_title("Error of all electrodes")
    errors.legend()
    rms = figure.add_subplot(grid[1, 2])
    rms.hist(scores["rms"], bins=np.geomspace(0.4, 15, 16), color=BLUE, edgecolor="white")
    rms.set(xscale="log", title="Root mean squared error", xlabel="counts", ylabel="electrodes")
    rms.set_xticks([0.5, 1, 2, 5, 10], ["0.5", "1", "2", "5", "10"])
    return figure


@styled
def slides_figure(statistics: pd.DataFrame, deviations: pd.DataFrame) -> Figure:
    """Deviation from the expected traces: strongest electrodes over time, and every trial.

    Args:
        statistics: `recorded.slides.learn_slides`, third result.
        deviations: the same, second result.
    """
    figure = canvas(5.4)
    grid = figure.add_gridspec(2, 3, height_ratios=(1.3, 1.0))
    spread = statistics[statistics["group"] == "learned"].groupby("electrode")["std"].mean()
    for column, electrode in enumerate(spread.nlargest(3).index):
        panel = figure.add_subplot(grid[0, column])
        for group in ("other material", "learned"):
            rows = statistics[(statistics["group"] == group) & (statistics["electrode"] == electrode)]
            time, mean, std = (rows[name].to_numpy() for name in ("time_s", "mean", "std"))
            colour = GROUP_COLOURS[group]
            panel.fill_between(time, mean - std, mean + std, color=colour, alpha=0.2, linewidth=0)
            panel.plot(time, mean, color=colour, label=group)
        panel.set(title=f"Electrode {electrode}", xlabel="time (s)")
        if column == 0:
            panel.set_ylabel("deviation (counts)")
            panel.legend()
    trials = figure.add_subplot(grid[1, :])
    colours = [GROUP_COLOURS[group] for group in deviations["group"]]
    trials.bar(range(len(deviations)), deviations["rms"], color=colours)
    trials.set_xticks(
        range(len(deviations)), deviations["demonstration"], rotation=60, ha="right", rotation_mode="anchor"
    )
    trials.set(title="Deviation of every trial", ylabel="root mean square (counts)")
    trials.grid(axis="x", visible=False)
    patches = [Patch(color=colour, label=group) for group, colour in GROUP_COLOURS.items()]
    trials.legend(handles=patches, ncols=3)
    return figure
