"""Figures of the page of the recorded data; a function draws one panel, or panels of one kind."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from structlearn.ground import signals
from structlearn.ground.metrics import mean_interval
from structlearn.palette import AXIS_COLOURS, BLACK, BLUE, CATEGORICAL_COLOURS, GREY, LIGHT_GREY, ORANGE
from structlearn.primitives.position import in_local_frame
from structlearn.primitives.twist_swing import dominant_axes, on_chart
from structlearn.reporting import segmentation_figures
from structlearn.reporting.figure_style import PANEL_WIDTH, Drawing, canvas, styled
from structlearn.segmentation.method_comparison import paired_comparison
from structlearn.testbeds.recorded import names
from structlearn.testbeds.recorded.page.results import AXES, RecordedResults, by_axis

HEIGHT = 3.1
"""Inches of a panel."""

SAMPLES = 60
"""Of a curve among a hundred; no eye sees more."""

TRACED = ("urdf", "mlp", "cov_viscous", "cov_coulomb")
"""Columns of torques that are drawn beside the measured ones."""

TRACED_JOINTS = (5, 7, 1, 6)

AIMED_NMSE, TEXT_NMSE = dict(zip(AXES, (0.25, 0.27, 0.42), strict=True)), 0.25
"""Bounds of the claims, drawn as dashed lines: of avoidance by axis, and of touch."""


def pictures(results: RecordedResults) -> dict[str, Drawing | Sequence[Drawing]]:
    """All figures by name."""
    cuts = paired_comparison(results.by_seed)
    torques = [torque_panel(results, joint) for joint in TRACED_JOINTS]
    slides = [slide_panel(results, place) for place in range(3)]
    return {
        "overview": [reaches_panel(results), torques[0]],
        "reach_cuts": segmentation_figures.noise_figure(
            results.by_level, cuts, "noise added (mm)", "same draw"
        ),
        "reaches": [fit_panel(results, "mean_mm", 5), fit_panel(results, "max_mm", 10)],
        "coupling": [distance_panel(results), target_panel(results, "z")],
        "coupling_more": [target_panel(results, "x"), target_panel(results, "y")],
        "turning": [turn_panel(results), execution_panel(results)],
        "electrodes": [electrode_errors_panel(results), *electrode_panels(results)],
        "slides": [slides[0], trials_panel(results)],
        "slides_more": slides[1:],
        "avoidance": [representations_panel(results, AXES), phase_panel(results)],
        "avoidance_axes": [representations_panel(results, [axis]) for axis in AXES],
        "touch": [touch_panel(results, carried) for carried in (False, True)],
        "touch_electrodes": correlation_panels(results),
        "panda": [panda_panel(results), torques[1]],
        "panda_torques": torques[2:],
    }


def panel(title: str, height: float = HEIGHT, **labels: object) -> tuple[Figure, Axes]:
    """An empty panel with what `Axes.set` takes; height in inches."""
    figure = canvas(height, PANEL_WIDTH)
    axes = figure.subplots()
    axes.set(**labels)
    axes.set_title(title, pad=8)
    return figure, axes


def legend(figure: Figure, columns: int = 2) -> Figure:
    """The same figure, with a legend above its panel."""
    figure.legend(loc="outside upper left", ncols=columns, columnspacing=1.2)
    return figure


@styled
def reaches_panel(results: RecordedResults) -> Figure:
    """Reaches from the side; higher ones left out, and the primitive without and with coupling."""
    figure, axes = panel("People: reaches, and higher ones", 3.5, xlabel="forward (mm)", ylabel="up (mm)")
    frame = results.reach_primitive.position.frame
    for number, (position, _) in enumerate(results.reach_segments):
        path = 1e3 * signals.time_normalised(in_local_frame(position, frame).position, SAMPLES)
        label = None if number else "recorded reaches"
        axes.plot(path[:, 0], path[:, 2], color=LIGHT_GREY, linewidth=0.7, label=label)
    for kind, its in results["coupling_paths"].groupby("path", sort=False):
        label = "higher reaches, left out" if kind == "recorded" else names.PATHS[kind].name
        for _, path in its.groupby("reach", sort=False):
            points = 1e3 * signals.time_normalised(path[["x", "z"]].to_numpy(), SAMPLES)
            axes.plot(*points.T, color=names.PATHS[kind].colour, linewidth=1.1, label=label)
            label = None
    return legend(figure)


@styled
def distance_panel(results: RecordedResults) -> Figure:
    """Mean distance from the left-out higher reaches over time."""
    figure, axes = panel("From the reaches left out", xlabel="time / duration", ylabel="distance (mm)")
    profile = results["coupling_profile"].iloc[::5]
    for kind, line in (("nominal", "-"), ("coupling", "-"), ("spread", "--")):
        look = names.PATHS[kind]
        axes.plot(profile["fraction"], profile[f"{kind}_mm"], line, color=look.colour, label=look.name)
    axes.set_ylim(bottom=0)
    return legend(figure)


@styled
def target_panel(results: RecordedResults, axis: str) -> Figure:
    """Coupling that the higher reaches ask for along one local axis over phase, and what was learned."""
    title = f"Coupling along local {axis}{' (up)' if axis == 'z' else ''}"
    figure, axes = panel(title, xlabel="phase p", ylabel="coupling term (m)", xlim=(1.0, 0.0))
    colour, targets = AXIS_COLOURS[AXES.index(axis)], results["coupling_targets"]
    rows = targets[targets["axis"] == axis].iloc[::5]
    low, high = rows["mean"] - rows["std"], rows["mean"] + rows["std"]
    axes.fill_between(rows["phase"], low, high, color=colour, alpha=0.2, linewidth=0)
    axes.plot(rows["phase"], rows["mean"], color=colour, label="asked for: mean, std")
    axes.plot(rows["phase"], rows["learned"], "--", color=BLACK, linewidth=1.1, label="learned")
    return legend(figure)


@styled
def fit_panel(results: RecordedResults, column: str, width_mm: float) -> Figure:
    """How far the primitive is from every reach, in bins of a width."""
    which = {"mean_mm": "Mean", "max_mm": "Largest"}[column]
    figure, axes = panel(f"{which} distance of the primitive", xlabel="distance (mm)", ylabel="reaches")
    for variant, colour in (("learned from", BLUE), ("left out", ORANGE)):
        values = results["reach_errors"].query("variant == @variant")[column]
        bins = np.arange(0.0, values.max() + width_mm, width_mm)
        axes.hist(values, bins, histtype="step", color=colour, label=variant, linewidth=1.6)
    return legend(figure)


@styled
def turn_panel(results: RecordedResults) -> Figure:
    """Twist about the dominant axis, and swings about the others, of every log and of the primitive."""
    figure, axes = panel(
        "Unscrewing: turn of the hand", xlabel="time / duration", ylabel="degrees to the goal"
    )
    logs = [orientation for _, orientation in results.unscrewing_segments]
    unrolled = results.unscrewing_primitive.orientation.unroll(logs[0].dt)
    frame = dominant_axes(logs)
    for path, look in [*((log, names.RECORDED) for log in logs), (unrolled, names.LEARNED)]:
        angles = np.degrees(signals.time_normalised(on_chart(path, frame).position, 2 * SAMPLES))
        for line, angle in zip(("-", "--", ":"), angles.T, strict=True):
            axes.plot(np.linspace(0.0, 1.0, len(angle)), angle, line, color=look.colour)
    for look in (names.RECORDED, names.LEARNED):
        axes.plot([], [], color=look.colour, label=look.name)
    for line, label in (("-", "twist"), ("--", "swing"), (":", "second swing")):
        axes.plot([], [], line, color=BLACK, label=label)
    return legend(figure, 3)


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


@styled
def slide_panel(results: RecordedResults, place: int) -> Figure:
    """Deviation of one of the electrodes that vary most: mean and std over the trials of a group."""
    by_group = {name: its for name, its in results["slide_statistics"].groupby("group")}
    electrode = by_group["learned"].groupby("electrode")["std"].mean().nlargest(3).index[place]
    title = f"Electrode {electrode}: mean and std over trials"
    figure, axes = panel(title, xlabel="time (s)", ylabel="deviation (counts)")
    for group in ("other material", "learned"):
        look, rows = names.SLIDE_GROUPS[group], by_group[group].query("electrode == @electrode").iloc[::4]
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
    for group, look in names.SLIDE_GROUPS.items():
        chosen = np.flatnonzero(trials["group"] == group)
        axes.bar(chosen, trials["rms"].iloc[chosen], color=look.colour, label=look.name)
    axes.set_xticks(range(len(trials)), trials["demonstration"], rotation=90, fontsize=7)
    axes.grid(axis="x", visible=False)
    return legend(figure, 3)


@styled
def representations_panel(results: RecordedResults, columns: Sequence[str]) -> Figure:
    """Error averaged over local axes, with its interval over the blocks; hollow: samples learned from."""
    title = "Averaged over three local axes" if len(columns) > 1 else f"Local {columns[0]}"
    figure, axes = panel(title, 3.4, xlabel="NMSE")
    errors, train = (
        by_axis(results["avoidance_scores"], name)[columns].mean(axis=1) for name in ("nmse", "train")
    )
    folds = results["avoidance_folds"].query("axis in @columns")
    by_fold = folds.groupby(["representation", "inputs", "fold"])["nmse"].mean()
    rows = list(names.REPRESENTATIONS)
    for offset, (inputs, look) in zip((-0.2, 0.0, 0.2), names.INPUTS.items(), strict=True):
        style = {"color": look.colour, "marker": "o", "markersize": 5, "linestyle": ""}
        for name, _ in (key for key in errors.index if key[1] == inputs):
            place, half = rows.index(name) + offset, mean_interval(by_fold[name, inputs].to_numpy())[1]
            axes.errorbar(errors[name, inputs], place, xerr=half, **style)
            axes.plot(train[name, inputs], place, **style, fillstyle="none")
        axes.plot([], [], label=look.name, **style)
    if len(columns) == 1:
        axes.axvline(AIMED_NMSE[columns[0]], color=BLACK, linestyle="--", linewidth=1.0)
    axes.set_yticks(
        range(len(rows)), [label.replace(" (", "\n(") for label in names.REPRESENTATIONS.values()]
    )
    axes.set_xlim(left=0.0)
    axes.invert_yaxis()
    return legend(figure)


@styled
def phase_panel(results: RecordedResults) -> Figure:
    """What phase and its velocity take off the error, with the interval over the blocks."""
    figure, axes = panel("What the phase is worth", 3.4, ylabel="NMSE less with phase and its velocity")
    worth = results["avoidance_phase"].query("inputs == 'phase'").set_index(["representation", "axis"])
    for offset, (name, colour) in enumerate((("ridge", GREY), ("network", ORANGE), ("ensemble", BLUE)), -1):
        its, places = worth.loc[name].loc[AXES], np.arange(3) + 0.18 * offset
        label = names.REPRESENTATIONS[name]
        axes.errorbar(places, its["gain"], its["half_width"], fmt="o", color=colour, label=label)
    axes.axhline(0.0, color=BLACK, linewidth=1.0)
    axes.set_xticks(range(3), [f"local {axis}" for axis in AXES])
    axes.grid(axis="x", visible=False)
    return legend(figure)


@styled
def touch_panel(results: RecordedResults, carried: bool) -> Figure:
    """Reconstruction error of every model; mean and std over parts that are left out and seeds."""
    title = "Learned from another set" if carried else "Learned from the same set"
    figure, axes = panel(title, 3.9, xscale="log", xlim=(0.03, 8), xlabel="NMSE of the reconstruction")
    asked = [key for key in names.TOUCH_ASKED if (key[2] == "new set") == carried]
    for offset, (model, look) in enumerate(names.TOUCH_MODELS.items(), -1):
        its = results.touch_scores.xs(model, level="model").loc[asked]
        middle, std = its["reconstruction"], its["reconstruction_std"]
        bars = [np.minimum(std, 0.9 * middle), std]  # a logarithmic axis has no zero
        places = np.arange(len(asked)) + 0.22 * offset
        axes.errorbar(middle, places, xerr=bars, fmt="o", markersize=5, color=look.colour, label=look.name)
    axes.axvline(TEXT_NMSE, color=BLACK, linestyle="--", linewidth=1.0)
    axes.axvline(1.0, color=BLACK, linewidth=1.0)
    axes.set_xticks([0.03, 0.1, 0.3, 1, 3], ["0.03", "0.1", "0.3", "1", "3"])
    axes.minorticks_off()
    pairs = [(first, second if carried else new.replace(", ", ",\n")) for first, second, new in asked]
    axes.set_yticks(range(len(asked)), [f"{first}\n\N{RIGHTWARDS ARROW} {what}" for first, what in pairs])
    axes.invert_yaxis()
    return legend(figure, 1)


@styled
def correlation_panels(results: RecordedResults) -> list[Figure]:
    """Correlation matrices of the electrodes, one panel per set."""
    figures = []
    for name, its in results["touch_correlations"].groupby("set", sort=False):
        figure, axes = panel(name.capitalize(), 3.4, xlabel="electrode", ylabel="electrode")
        matrix = its.pivot_table(index="electrode", columns="other", values="correlation")
        edge = len(matrix) + 0.5
        image = axes.imshow(matrix, cmap="RdBu_r", vmin=-1, vmax=1, extent=(0.5, edge, edge, 0.5))
        axes.set(xticks=[1, 7, 11, 19], yticks=[1, 7, 11, 19])
        axes.grid(visible=False)
        figure.colorbar(image, ax=axes, label="correlation", shrink=0.85)
        figures.append(figure)
    return figures


def panda_panel(results: RecordedResults) -> Figure:
    """NMSE of the Panda's models on the test part over the joints."""
    return joint_errors_panel(results.panda, "Every joint")


def torque_panel(results: RecordedResults, joint: int) -> Figure:
    """Torque of one joint of the Panda in the test part, measured and by models."""
    title = f"Robot: joint {joint} of a Franka Panda"
    return traced_panel(results["panda_traces"], joint, title, "time of the test part (s)")


@styled
def joint_errors_panel(errors: pd.DataFrame, title: str) -> Figure:
    """NMSE over the joints; rows of errors are of models and friction, columns of joints."""
    figure, axes = panel(title, 3.5, xlabel="joint", ylabel="NMSE on the test part", yscale="log")
    for key, look in names.DYNAMICS_LOOKS.items():
        if key in errors.index:
            its, line = errors.loc[key], "--" if key[0] == "least_squares" else "-"
            axes.plot(its.index, its, line, marker="o", markersize=4, color=look.colour, label=look.name)
    axes.set_xticks(errors.columns)
    return legend(figure)


@styled
def traced_panel(traces: pd.DataFrame, joint: int, title: str, xlabel: str) -> Figure:
    """Torque of one joint, measured and by models, of a table of `arm_identification.trace_table`."""
    figure, axes = panel(title, 3.5, xlabel=xlabel, ylabel="torque (N m)")
    looks = {"_".join(key).removesuffix("_none"): look for key, look in names.DYNAMICS_LOOKS.items()}
    its = traces.query("joint == @joint")
    axes.plot(its["time_s"], its["measured"], color=BLACK, linewidth=2.4, alpha=0.35, label="measured")
    for name in TRACED:
        axes.plot(its["time_s"], its[name], color=looks[name].colour, linewidth=1.0, label=looks[name].name)
    low, high = its["measured"].min(), its["measured"].max()
    axes.set_ylim(low - 0.5 * (high - low), high + 0.5 * (high - low))
    return legend(figure)
