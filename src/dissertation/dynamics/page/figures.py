"""Figures of the dynamics page, one panel at a time, in the colours and line styles of `names`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from dissertation.dynamics.names import (
    FORM_TITLES,
    IDEAL,
    LOSS_TITLES,
    REACH,
    REFERENCE,
    ROBOT,
    ROBOT_TITLES,
    SHOWN_TRAINING,
    colour,
    look,
)
from dissertation.dynamics.page.page import Raw, pick_up_s
from dissertation.dynamics.protocol.forms import CHOSEN, FORMS, PLAIN
from dissertation.dynamics.protocol.tracking import TrackedReach, tracked_reaches
from dissertation.dynamics.world.arm_motion import SineParameters, sine_path
from dissertation.dynamics.world.joint_logs import PayloadParameters
from dissertation.evidence.results import Results
from dissertation.simulation.still import View
from dissertation.simulation.still import still as rendered
from structlearn.palette import BLACK, GREY
from structlearn.reporting.figure_style import PANEL_WIDTH, Drawing, Raster, canvas, styled
from structlearn.rigid_body.model_names import (
    COULOMB,
    DEFAULT,
    GROUND_TRUTH,
    NAMES,
    model_name,
    models_in_order,
)
from structlearn.rigid_body.tree import KinematicTree

HIGHEST_NMSE = 1e6  # upper axis limit for diverged models

EPOCH_TICKS = (0, 1, 2, 5, 10, 20, 40, 64)

SHOWN_REACHES = {
    IDEAL: (GROUND_TRUTH, "mlp", "delan", "nostr", "cov"),
    ROBOT: (DEFAULT, "mlp", "delan", "nostr", "cov"),
}
"""Models whose reaches are drawn, by robot."""

FORM_MARKERS: Mapping[str, str] = {CHOSEN: "o", PLAIN: "s"}
MARKERS = {"nostr": "x", "symm": "+", "spd": "s", "tri": "^", "cov": "o"}
SHOWN_JOINTS = (1, 2, 4, 6)  # joints whose friction is drawn: large and small ones
WIDE: dict[str, Any] = {"color": REFERENCE, "linewidth": 4.0}  # references

VIEW = View(target=(0.0, 0.0, 0.6), distance=2.45, yaw_deg=50.0, pitch_deg=-16.0)

SHOWN_AT = (0.708, 0.146, 0.925)  # fractions of the motion at which all joints are bent, for the still
COLUMNS = slice(235, 785)  # pixel columns kept of each image: the arm with a narrow margin


def legend_above(figure: Figure, axes: Axes, columns: int = 6) -> None:
    """Add one legend above the whole figure, with the labels of one of its axes."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=columns, columnspacing=1.6)


@styled
def drawings(
    results: Results, still: np.ndarray, raw: Raw, chosen: Mapping[str, Any]
) -> Mapping[str, Sequence[Drawing]]:
    """All figures of the page, keyed by name.

    `still`: image of the arm; `raw`: tables of this run, see `page.Raw`; `chosen`: parameters by key of
    `params.yaml`.
    """
    errors, learning = raw["errors"], chosen["train_dynamics"].learning
    keys = ["form", "model", "seed", "epoch"]
    curves = errors[errors["arm"] == IDEAL].groupby(keys, sort=False)["nmse"].mean().reset_index()
    keys = ["loss", "model", "seed", "batch"]
    online = raw["online"].groupby(keys, sort=False)["nmse"].mean().reset_index()
    reaches = {
        title: tracked_reaches(raw["paths"], raw["scores"], arm, SHOWN_TRAINING, SHOWN_REACHES[arm])
        for arm, title in ROBOT_TITLES.items()
    }
    return {
        "still": [still, epochs_panel(results)],
        "training": [_training(curves, form, learning.threshold) for form in FORMS],
        "tracking": [_tracking(results, arm) for arm in ROBOT_TITLES],
        "reaches": [draw(its, title) for draw in (_off, _speeds) for title, its in reaches.items()],
        "online": [_curves(online, "batch", "loss", loss, title) for loss, title in LOSS_TITLES.items()],
        "bodies": [
            _bodies(raw["base"], "value", "truth", "Base parameters (kg m², kg m)"),
            _bodies(raw["links"], "mass_kg", "true_mass_kg", "Masses of the links (kg)"),
        ],
        "friction": [
            Raster(_friction(joint, its))
            for joint, its in raw["residuals"].groupby("joint")
            if joint in SHOWN_JOINTS
        ],
        "payload": [
            payload_panel(raw["payload"], chosen["record_motion"].payload, pick_up_s(chosen)),
            _payload_errors(raw["payload"]),
        ],
    }


def arm_still(urdf: str, tree: KinematicTree, motion: SineParameters) -> np.ndarray:
    """Image (H, W, 3) uint8 of a URDF's arm in several poses of its sine motion, side by side."""
    path = sine_path(tree, motion).position
    poses = (path[int(share * len(path))] for share in SHOWN_AT)
    return np.hstack([rendered(VIEW, urdf=urdf, angles=pose)[:, COLUMNS] for pose in poses])


def _curves(curves: pd.DataFrame, step: str, column: str, value: str, title: str) -> Figure:
    """Geometric mean over seeds of each model's NMSE (mean over joints), with the range over seeds."""
    figure, panel = _panel(3.3, title, step, "NMSE, mean over joints")
    shown = curves[curves[column] == value]
    for model in models_in_order(shown["model"].unique()):
        its = shown[shown["model"] == model]
        wide = np.log10(its.pivot_table(index=step, columns="seed", values="nmse")).ffill()
        panel.plot(wide.index, 10.0 ** wide.mean(axis=1), label=NAMES[model], **look(model))
        low, high = 10.0 ** wide.min(axis=1), 10.0 ** wide.max(axis=1)
        panel.fill_between(wide.index, low, high, color=colour(model), alpha=0.12, linewidth=0)
    highest = curves["nmse"].max()  # over all panels, which share one scale
    panel.set(yscale="log", ylim=(0.5 * curves["nmse"].min(), min(2.0 * highest, HIGHEST_NMSE)))
    legend_above(figure, panel, columns=4)
    return figure


def _training(curves: pd.DataFrame, form: str, threshold: float) -> Figure:
    """NMSE over the training epochs in simulation."""
    figure = _curves(curves, "epoch", "form", form, FORM_TITLES[form])
    (panel,) = figure.axes
    panel.axhline(threshold, color=BLACK, linestyle="--", linewidth=0.9)
    panel.set_xscale("symlog", linthresh=1.0)
    panel.set_xticks(EPOCH_TICKS, [str(tick) for tick in EPOCH_TICKS])
    panel.minorticks_off()
    panel.set_xlim(0, curves["epoch"].max())
    return figure


def epochs_panel(results: Results) -> Figure:
    """Epochs to the criterion in simulation, one mark per seed; hollow marks: it was not met by then."""
    epochs, reached = (results.wide(name, ["model", "form"], arm=IDEAL) for name in ("epochs", "reached"))
    titles = "Epochs until every joint meets the criterion", "epochs"
    figure = _by_model(epochs.clip(lower=1.0), reached == 0.0, titles, "not met")
    figure.axes[0].set_xticks(EPOCH_TICKS[1:], [str(tick) for tick in EPOCH_TICKS[1:]])
    figure.axes[0].minorticks_off()
    return figure


def _tracking(results: Results, arm: str) -> Figure:
    """NMSE of the tool velocity in reaches, one mark per seed or robot; hollow marks: stopped runs."""
    scores, stopped = (
        results.wide(name, ["model", "form"], arm=arm, task=REACH) for name in ("velocity_nmse", "stopped")
    )
    titles = ROBOT_TITLES[arm], "NMSE of the tool's velocity in reaches"
    return _by_model(scores, stopped == 1.0, titles, "stopped")


def _by_model(values: pd.DataFrame, hollow: pd.DataFrame, titles: tuple[str, str], word: str) -> Figure:
    """One mark per seed or robot (rows) for each model and form (columns); `word` says what hollow means."""
    figure, panel = _panel(3.6, *titles, "")
    models = models_in_order({model for model, _ in values})
    for model, form in values:
        middle = {CHOSEN: -0.17, PLAIN: 0.17}.get(form, 0.0)
        runs = values[model, form].dropna()
        offsets = models.index(model) + middle + np.linspace(-0.1, 0.1, len(runs))
        for empty in (False, True):
            its = hollow[model, form][runs.index] == empty
            fill: dict[str, Any] = {"fillstyle": "none" if empty else "full", "markersize": 4}
            panel.plot(runs[its], offsets[its], FORM_MARKERS.get(form, "o"), color=colour(model), **fill)
    panel.set_yticks(range(len(models)), [model_name(model) for model in models])
    panel.set_xscale("log")
    panel.invert_yaxis()
    panel.grid(axis="y", visible=False)
    mark: dict[str, Any] = {"markersize": 4, "linestyle": "", "color": BLACK}
    handles = [
        Line2D([], [], label=FORM_TITLES[form], marker=marker, **mark)
        for form, marker in FORM_MARKERS.items()
    ]
    handles.append(Line2D([], [], label=word, marker="o", fillstyle="none", **mark))
    figure.legend(handles=handles, loc="outside upper left", ncols=3)
    return figure


def _off(reaches: Sequence[TrackedReach], title: str) -> Figure:
    """Distance of the tool from its reference over time."""
    figure, panel = _panel(2.4, title, "time (s)", "tool error (mm)")
    for reach in reaches:
        panel.plot(reach.time, np.maximum(reach.off_mm, 1e-2), label=reach.label, **look(reach.model))
    panel.set(yscale="log", ylim=(8e-3, 3e3))
    legend_above(figure, panel, columns=5)
    return figure


def _speeds(reaches: Sequence[TrackedReach], title: str) -> Figure:
    """Difference of the tool's speed from that of its reference over time."""
    figure, panel = _panel(2.4, title, "time (s)", "error of the speed (m/s)")
    for reach in reaches:
        error = np.abs(reach.speeds[0] - reach.speeds[1])
        panel.plot(reach.time, np.maximum(error, 1e-4), label=reach.label, **look(reach.model))
    panel.set(yscale="log", ylim=(8e-5, 1e1))
    legend_above(figure, panel, columns=5)
    return figure


def _bodies(table: pd.DataFrame, learned: str, true: str, title: str) -> Figure:
    """Learned against true inertial parameters for each structure, first seed."""
    figure, panel = _panel(3.3, title, "of the arm", "learned")
    first = table["seed"] == table["seed"].min()
    its = table[(table["form"] == CHOSEN) & first].set_index("model")
    for model, marker in MARKERS.items():
        rows = its[its.index == model]
        marked: dict[str, Any] = {"marker": marker, "fillstyle": "none", "linestyle": "", "markersize": 5}
        panel.plot(rows[true], rows[learned], color=colour(model), label=NAMES[model], **marked)
    ends = [table[true].min(), table[true].max()]
    panel.plot(ends, ends, color=GREY, linewidth=0.9, zorder=0)
    if learned == "value":  # from 0.001 to 10 of either sign
        panel.set_xscale("symlog", linthresh=0.01, linscale=0.6)
        panel.set_yscale("symlog", linthresh=0.01, linscale=0.6)
    legend_above(figure, panel)
    return figure


def _friction(joint: int, residuals: pd.DataFrame) -> Figure:
    """Torque residuals of the rigid-body model over the joint's speed, with the learned friction."""
    figure, panel = _panel(2.2, f"Joint {joint}", "speed (rad/s)", "torque (N m)")
    its = residuals.sort_values("velocity_rad_s", kind="stable")
    speed, measured = its["velocity_rad_s"], its["residual_n_m"]
    panel.plot(speed, measured, ".", color=GREY, markersize=3.0, alpha=0.4, label="measured")
    learned, label = colour(f"cov{COULOMB}"), "learned: viscous and Coulomb"
    panel.plot(speed, its["friction_n_m"], color=learned, linewidth=2.0, label=label)
    limit = 1.3 * measured.abs().quantile(0.995)
    panel.set_ylim(-limit, limit)
    legend_above(figure, panel)
    return figure


@styled
def payload_panel(payload: pd.DataFrame, carried: PayloadParameters, pick_up: float) -> Figure:
    """Learned mass and first moment of a payload relative to the truth, one thin line per robot."""
    figure, panel = _panel(2.5, "Learned payload", "time (s)", "share of the truth")
    truth = carried.mass_kg * np.linalg.norm(carried.point_m)
    panel.step([0.0, pick_up, payload["time_s"].max()], [0.0, 0.0, 1.0], label="carried", **WIDE)
    for place, (_, its) in enumerate(payload.groupby("seed")):
        moment = np.linalg.norm(its[[f"moment_{axis}_kg_m" for axis in "xyz"]], axis=1)
        thin: dict[str, Any] = {"color": colour("cov"), "linewidth": 0.9}
        label = ("mass", "first moment") if place == 0 else (None, None)
        panel.plot(its["time_s"], its["mass_kg"] / carried.mass_kg, label=label[0], **thin)
        panel.plot(its["time_s"], moment / truth, linestyle=":", label=label[1], **thin)
    panel.set_ylim(-0.1, 1.6)
    legend_above(figure, panel)
    return figure


def _payload_errors(payload: pd.DataFrame) -> Figure:
    """Torque errors on batches not yet learned from, geometric mean over robots, batch by batch."""
    batch = payload.groupby("seed").cumcount()  # a key without rounding, unlike the time
    means = np.exp(np.log(payload[["nmse_fixed", "nmse_learned"]]).groupby(batch).mean())
    time = payload["time_s"].groupby(batch).mean()
    figure, panel = _panel(2.5, "Torques of the next batch", "time (s)", "NMSE, mean over robots")
    panel.plot(time, means["nmse_fixed"], label="model of the empty arm", **look(GROUND_TRUTH))
    panel.plot(time, means["nmse_learned"], label="learned online", **look("cov"))
    panel.set_yscale("log")
    legend_above(figure, panel)
    return figure


def _panel(height: float, title: str, x: str, y: str) -> tuple[Figure, Axes]:
    figure = canvas(height, PANEL_WIDTH)
    return figure, figure.subplots(subplot_kw={"title": title, "xlabel": x, "ylabel": y})
